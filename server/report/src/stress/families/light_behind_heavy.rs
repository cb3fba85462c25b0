//! Light links behind heavy ones: rounding of the heavy ones must not swamp the light ones.

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::families::dead_points_in_series::everything;
use crate::stress::harness::{At, Cases, State};
use crate::stress::mechanisms::weights::{planar_loops, planar_platform, row, tree};

/// Seeds beyond the first ones that once failed silently.
pub(crate) const WORST: [u64; 9] = [1860, 1350, 1990, 565, 1400, 1630, 270, 1919, 1512];

/// The mechanism of this seed, with every question.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(1 << 32 | seed);
    let decades = random.between(3.0, 6.0);
    let ratio = 10f64.powf(decades);
    let (name, of) = match seed % 5 {
        0 => ("welded loops", planar_loops(&mut random, [10.0 / ratio, 10.0])?),
        1 | 4 => ("welded legs", planar_platform(&mut random, [10.0 / ratio, 10.0])?),
        2 => {
            let n = 8 + random.below(9);
            ("links in a row", row(&mut random, n, 10.0, 10.0 / ratio)?)
        }
        _ => {
            let n = 8 + random.below(25);
            ("tree", tree(&mut random, n, decades)?)
        }
    };
    let name = format!("{name}, seed {seed}");
    let at = At { value: ratio, method: "-" };
    let Some(robot) = cases.load(&name, at, of) else { return Ok(()) };
    let speed = random.one_of(&[0.0, 1.0, 1.0, 5.0]);
    let mut draw =
        |n: usize, size: f64| -> Vec<f64> { (0..n).map(|_| size * random.next()).collect() };
    let sizes = robot.compiled.model.sizes();
    // a quaternion is not scaled
    let mut state = State::of(&robot, 0.3)?;
    if state.y.len() == state.yd.len() {
        state.y = draw(sizes.n_qy, if sizes.n_c > 0 { 0.03 } else { 0.3 });
    }
    (state.yd, state.ydd) = (draw(sizes.n_vy, speed), draw(sizes.n_vy, 2.0));
    state.forces(&robot)?;
    everything(cases, &robot, ratio, &state)
}
