//! A hand that goes up and down 1000 times a second: `hand [NAME [FRAME [SECONDS]]]`.
//!
//! Each millisecond the server computes the pose and the twist of a frame, and then the step of a
//! motion: the accelerations that move the hand to its target, and the forces of the motors for
//! them, within all limits. Here are no motors; the robot does as the step says. Late cycles are
//! counted as `loop_1khz` counts them. Start `sarrus serve` with a robot of a fixed base first.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use sarrus_client::{Field, Request, Robot, TaskParts};

const CYCLE: Duration = Duration::from_millis(1);
/// How far the hand goes up, and its period `[m, s]`.
const SWING: (f64, f64) = (0.1, 2.0);
/// How stiffly it follows: v̇ = v̇* + K (p* − p) + D (v* − v) `[1/s², 1/s]`.
const GAINS: (f64, f64) = (400.0, 40.0);
/// Damping of all joints in the room that the hand leaves: ÿ near −D ẏ `[1/s]`.
const DAMPING: f64 = 4.0;
/// Where each joint begins `[rad, m]`.
const START: f64 = 0.2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "default".to_owned());
    let mut robot = Robot::connect(&name)?;
    let last = robot.model().links.last().ok_or("a robot without links")?.clone();
    let hand = arguments.next().unwrap_or(last);
    let seconds: f64 = arguments.next().map_or(Ok(5.0), |text| text.parse())?;

    let n = robot.model().independent.len();
    let look = robot
        .query(Request::Kinematics)
        .given(["y", "yd"])
        .want(["frame_pose", "frame_twist"])
        .frames([&hand])
        .prepare()?;
    let whole = TaskParts::POSITION.with(TaskParts::ORIENTATION);
    let step = robot
        .query(Request::Step)
        .given(["y", "yd", "ydd", "dt"])
        .want(["ydd", "tau_u"])
        .tasks([(&hand, whole)])
        .prepare()?;
    let layout = robot.plan(step).ok_or("a plan that is not there")?;
    let given = layout.given().clone();
    let range = |field| given.slot(field).map(|slot| slot.range()).ok_or("a field is missing");
    let [of_y, of_yd] = [range(Field::Y)?, range(Field::Yd)?];
    let [of_ydd, of_dt] = [range(Field::Ydd)?, range(Field::Dt)?];
    let of_task = range(Field::TaskMotion)?;
    let mut input = vec![0.0; given.len()];
    let mut moved = vec![0.0; layout.want().len()];
    let mut state = vec![START; n];
    state.resize(2 * n, 0.0);
    // the pose (7) and the twist (6) of the hand
    let mut seen = [0.0; 13];
    robot.ask(look, &state, &mut seen)?.ok()?;
    let start = seen;

    // nothing allocates after this line
    let dt = CYCLE.as_secs_f64();
    let w = TAU / SWING.1;
    let cycles = (seconds / dt) as u32;
    let begin = Instant::now();
    let mut late = 0_u32;
    let mut longest = Duration::ZERO;
    let mut farthest: f64 = 0.0;
    for cycle in 0..cycles {
        let due = begin + CYCLE * cycle;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let asked = Instant::now();
        robot.ask(look, &state, &mut seen)?.ok()?;

        // the wanted acceleration of the hand [ω̇; v̇], with weight 1
        let turned = w * dt * f64::from(cycle);
        let (sin, cos) = turned.sin_cos();
        let half = 0.5 * SWING.0;
        let [up, speed, more] = [half * (1.0 - cos), half * w * sin, half * w * w * cos];
        let turn = turn(&seen[3..7], &start[3..7]);
        let mut task = [0.0, 0.0, 0.0, 0.0, 0.0, more, 1.0];
        let mut away: f64 = 0.0;
        for k in 0..3 {
            let [target, rate] = if k == 2 { [start[k] + up, speed] } else { [start[k], 0.0] };
            away += (target - seen[k]).powi(2);
            task[k] += GAINS.0 * turn[k] - GAINS.1 * seen[7 + k];
            task[3 + k] += GAINS.0 * (target - seen[k]) + GAINS.1 * (rate - seen[10 + k]);
        }
        farthest = farthest.max(away.sqrt());

        input[of_y.clone()].copy_from_slice(&state[..n]);
        input[of_yd.clone()].copy_from_slice(&state[n..]);
        for (to, yd) in input[of_ydd.clone()].iter_mut().zip(&state[n..]) {
            *to = -DAMPING * yd;
        }
        input[of_dt.clone()].fill(dt);
        input[of_task.clone()].copy_from_slice(&task);
        robot.ask(step, &input, &mut moved)?.ok()?;
        longest = longest.max(asked.elapsed());

        // the motors would get moved[n..], which are τ_u; the accelerations stand before them
        for i in 0..n {
            state[i] += dt * (state[n + i] + 0.5 * dt * moved[i]);
            state[n + i] += dt * moved[i];
        }
        late += u32::from(due.elapsed() > CYCLE);
    }
    let longest = longest.as_micros();
    println!("{cycles} cycles, {late} late, longest answers {longest} us");
    println!("farthest from its target: {farthest:e}");
    println!("tau_u: {:?}", &moved[n..]);
    Ok(())
}

/// The rotation from one unit quaternion (x, y, z, w) to another, for small ones as a vector in
/// the root's axes: 2 times the vector of b a⁻¹.
fn turn(a: &[f64], b: &[f64]) -> [f64; 3] {
    let sign = 2.0_f64.copysign(a.iter().zip(b).map(|(a, b)| a * b).sum());
    let part = |i: usize, j: usize, k: usize| {
        sign * (b[i] * a[3] - b[3] * a[i] + b[k] * a[j] - b[j] * a[k])
    };
    [part(0, 1, 2), part(1, 2, 0), part(2, 0, 1)]
}
