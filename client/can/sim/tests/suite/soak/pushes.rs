//! Pushes on the links of a robot: found where external forces are observed, and nowhere else.

use super::*;

/// Part of the effort's limit that pushes ask of an actuator.
const PUSH: f64 = 0.8;
/// Time in which they grow to it `[s]`.
const GROWTH: f64 = 0.4;
/// The threshold of the monitor.
const THRESHOLD: f64 = 0.4;

/// Robots by chance, whose motors report efforts, under a bridge with these rules of the model.
fn robots(rules: &str) -> Vec<(u64, Run)> {
    let mut drives = all_drives();
    drives
        .retain(|(name, _)| ["damiao impedance", "moteus torque", "cia402 torque"].contains(name));
    let seeds = (0..).map(|k| 1 + ROBOTS * k);
    let of = |seed| Some((seed, Run::robot(seed, Chance(seed), &drives, rules)?));
    seeds.filter_map(of).take(16).collect()
}

/// At rest, an actuator's way is pushed more and more; the reason of the stop, and the time since
/// the push was beyond the threshold `[ms]`.
fn pushed(run: &mut Run) -> Option<(Reason, f64)> {
    run.rests = true;
    while !run.next.is_over(run.world.now_ns) {
        run.cycle();
    }
    assert_eq!(run.until(0.5), None, "{}", run.name);
    let u = (run.chance.bits() % run.world.shafts.len() as u64) as usize;
    let limit = run.world.shafts.iter().find(|shaft| shaft.actuator == u).unwrap().limits.effort;
    let begin_ns = run.world.now_ns;
    while run.world.now_ns < begin_ns + 1_000 * MS {
        let t = (run.world.now_ns - begin_ns) as f64 * 1e-9;
        let part = PUSH * (t / GROWTH).min(1.0);
        let robot = run.world.robot.as_mut().unwrap();
        robot.push = robot.row(u).iter().map(|g| part * limit * g).collect();
        run.cycle();
        if let Some((_, reason)) = run.world.stopped() {
            return Some((reason, 1e3 * (t - GROWTH * THRESHOLD / PUSH)));
        }
    }
    None
}

#[test]
fn a_push_on_a_link_is_found_and_quick_motion_is_none() {
    let mut n_found = 0;
    for (seed, mut run) in robots(&format!("external: {THRESHOLD}")) {
        let alarm = run.until(10.0);
        assert!(alarm.is_none_or(|reason| run.is_true(reason)), "{} {seed}: {alarm:?}", run.name);
        if alarm.is_some() {
            continue;
        }
        let found = pushed(&mut run);
        println!("{} at {} Hz: {found:?}", run.name, 1_000_000_000 / run.world.period_ns);
        // a push that a soft controller gives way to is fast before it is strong
        if found.is_some_and(|(reason, _)| run.is_true(reason)) {
            continue;
        }
        n_found += 1;
        let (reason, ms) = found.unwrap_or_else(|| panic!("{} {seed}: not found", run.name));
        assert_eq!(reason, Reason::ExternalForce, "{} {seed}", run.name);
        assert!(ms.abs() < 100.0, "{} {seed}: {ms}", run.name);
    }
    assert!(n_found >= 4, "{n_found}");
}

#[test]
fn external_forces_are_not_observed_by_default() {
    for (seed, mut run) in robots("clearance: 0.2").into_iter().take(3) {
        let found = pushed(&mut run).map(|(reason, _)| reason);
        assert_ne!(found, Some(Reason::ExternalForce), "{} {seed}", run.name);
    }
}
