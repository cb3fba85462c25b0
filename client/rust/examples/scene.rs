//! Locked joints cost nothing: a complete humanoid, with some joints locked, and one of its arms
//! alone. Prints the remaining sizes and the time of an inverse dynamics, each the minimum of many
//! interleaved rounds.

use std::time::Instant;

use sarrus_client::{Lock, Options, Robot, Source};

/// Name, locked joints and, if not all, the links that are kept.
const SCENES: [(&str, &[&str], &[&str]); 5] = [
    ("the whole robot", &[], &[]),
    ("torso and head locked", &["Body*", "Head*"], &[]),
    ("and the right arm locked", &["Body*", "Head*", "AR*"], &[]),
    ("torso, head, hands locked", &["Body*", "Head*", "A?Hand*"], &[]),
    ("left forearm and torso only", &[], &["ALWrist*"]),
];
/// Rounds, and calls of each.
const ROUNDS: usize = 200;
const CALLS: u32 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut robots = Vec::new();
    for (name, lock, only) in SCENES {
        let lock: Vec<Lock> = lock.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        let only = only.iter().map(|link| (*link).to_owned()).collect();
        let source = Source::Bundled("rh5v2_full".into());
        let robot = Robot::load(&source, &Options { lock, only, ..Options::default() })?;
        robots.push((name, robot, f64::INFINITY));
    }
    for _ in 0..ROUNDS {
        for (_, robot, least) in &mut robots {
            let n_y = robot.model().independent.len();
            let y = vec![0.1; n_y];
            let rate = vec![0.5; n_y];
            let mut tau_u = vec![0.0; robot.model().active.len()];
            let start = Instant::now();
            for _ in 0..CALLS {
                robot.inverse_dynamics(&y, &rate, &rate, &mut tau_u)?;
            }
            *least = least.min(start.elapsed().as_secs_f64() / f64::from(CALLS));
        }
    }
    println!("{:<28} {:>6} {:>3} {:>3} {:>9}", "", "joints", "y", "u", "ID");
    for (name, robot, least) in &robots {
        let sizes = robot.model().sizes;
        let joints = sizes.n_v;
        let y = sizes.n_vy;
        let u = sizes.n_u;
        println!("{name:<28} {joints:>6} {y:>3} {u:>3} {:>6.2} µs", least * 1e6);
    }
    Ok(())
}
