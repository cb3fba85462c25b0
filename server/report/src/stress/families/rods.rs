//! Rods whose universal joint is near its gimbal or has axes that miss each other, and rods near
//! their dead point; in closed form and by all rows.

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::families::dead_points_in_series::everything;
use crate::stress::harness::{At, Cases, State};
use crate::stress::mechanisms::trains::{RodAt, one_rod};

/// A crank and a lever with such a rod between, asked everything near the zero pose and away.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(7 << 32 | seed);
    let usual = RodAt { delta: random.between(0.3, 1.2), ..RodAt::default() };
    let (what, value, at) = match seed % 3 {
        0 => {
            let angle = random.scale(1e-6, 0.3);
            ("gimbal", angle, RodAt { gimbal: Some(angle), ..usual })
        }
        1 => {
            let gap = random.scale(1e-16, 1e-2);
            ("gap", gap, RodAt { gap, ..usual })
        }
        _ => {
            let delta = random.scale(1e-6, 0.3);
            ("dead point", delta, RodAt { delta, ..usual })
        }
    };
    let mut of = one_rod(&mut random, &at)?;
    let all_rows = random.coin();
    of.submechanisms.iter_mut().for_each(|part| part.closed_forms = !all_rows);
    let rows = if all_rows { ", all rows" } else { "" };
    let name = format!("rod with a {what}{rows}, seed {seed}");
    let Some(robot) = cases.load(&name, At { value, method: "-" }, of) else { return Ok(()) };
    for reach in [0.0, value.min(0.1), 0.2] {
        let mut draw = |size: f64| vec![size * random.next()];
        let mut state = State { y: draw(reach), yd: draw(1.0), ydd: draw(1.0), ..State::default() };
        state.forces(&robot)?;
        everything(cases, &robot, value, &state)?;
    }
    Ok(())
}
