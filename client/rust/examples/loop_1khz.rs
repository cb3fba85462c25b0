//! A control loop of 1 kHz without motors: `loop_1khz [NAME [SECONDS]]`.
//!
//! Each millisecond the server computes the actuator forces for a swing. Late cycles are counted,
//! not caught up: a cycle is late if it begins, or its answer comes, after the next should begin.
//! Start `sarrus serve` with a robot first.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use sarrus_client::Robot;

const CYCLE: Duration = Duration::from_millis(1);
/// Amplitude and period of the swing `[rad, s]`.
const SWING: (f64, f64) = (0.1, 2.0);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "default".to_owned());
    let seconds: f64 = arguments.next().map_or(Ok(5.0), |text| text.parse())?;

    let mut robot = Robot::connect(&name)?;
    let n_y = robot.model().independent.len();
    let n_u = robot.model().active.len();
    let mut y = vec![0.0; n_y];
    let mut yd = vec![0.0; n_y];
    let mut ydd = vec![0.0; n_y];
    let mut tau_u = vec![0.0; n_u];
    // nothing allocates after this line
    robot.prepare_inverse_dynamics()?;

    let cycles = (seconds / CYCLE.as_secs_f64()) as u32;
    let start = Instant::now();
    let w = TAU / SWING.1;
    let mut late = 0_u32;
    let mut longest = Duration::ZERO;
    for cycle in 0..cycles {
        let begin = start + CYCLE * cycle;
        std::thread::sleep(begin.saturating_duration_since(Instant::now()));

        let (sin, cos) = (w * (begin - start).as_secs_f64()).sin_cos();
        y.fill(SWING.0 * (1.0 - cos));
        yd.fill(SWING.0 * w * sin);
        ydd.fill(SWING.0 * w * w * cos);
        let asked = Instant::now();
        robot.inverse_dynamics(&y, &yd, &ydd, &mut tau_u)?;
        longest = longest.max(asked.elapsed());
        late += u32::from(begin.elapsed() > CYCLE);
    }
    println!("{cycles} cycles, {late} late, longest answer {} us", longest.as_micros());
    Ok(())
}
