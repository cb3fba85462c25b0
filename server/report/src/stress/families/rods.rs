//! Rods whose universal joint is near its gimbal, or has axes that miss each other.

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::families::dead_points_in_series::everything;
use crate::stress::harness::{At, Cases, State};
use crate::stress::mechanisms::trains::{Universal, one_rod};

/// A crank and a lever with such a rod between, asked everything near the zero pose and away.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(7 << 32 | seed);
    let (what, value, universal) = match seed % 2 {
        0 => {
            let angle = random.scale(1e-6, 0.3);
            ("gimbal", angle, Universal { gimbal: Some(angle), ..Universal::default() })
        }
        _ => {
            let gap = random.scale(1e-16, 1e-2);
            ("gap", gap, Universal { gap, ..Universal::default() })
        }
    };
    let at = At { value, method: "-" };
    let of = one_rod(&mut random, &universal)?;
    let name = format!("rod with a {what}, seed {seed}");
    let Some(robot) = cases.load(&name, at, of) else { return Ok(()) };
    for reach in [0.0, value.min(0.1), 0.2] {
        let mut draw = |size: f64| vec![size * random.next()];
        let mut state = State { y: draw(reach), yd: draw(1.0), ydd: draw(1.0), ..State::default() };
        state.forces(&robot)?;
        everything(cases, &robot, value, &state)?;
    }
    Ok(())
}
