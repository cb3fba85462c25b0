//! The whole chain of control: `follow [SERVER [BRIDGE [SECONDS]]]`.
//!
//! Encoders measure u; the server computes y from it, and τ_u for the desired motion of y; the
//! bridge sends τ_u to the motors. Start `sarrus serve` with the robot and `sarrus-can run` with
//! its configuration first, and arm with `sarrus-can arm` while this runs.

use std::f64::consts::PI;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use sarrus_client::actuators::{ActuatorCommand, MechanismState};
use sarrus_client::{Controller, Request, Robot, Status};

/// Cycles in a second `[Hz]`.
const RATE: f64 = 500.0;
/// How stiffly the independent coordinates follow: ÿ = ÿ* + K (y* − y) + D (ẏ* − ẏ) `[1/s², 1/s]`.
const GAINS: (f64, f64) = (100.0, 20.0);
/// How far and how fast they swing `[rad, s]`.
const SWING: (f64, f64) = (0.1, 4.0);

fn main() -> ExitCode {
    match follow() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("follow: {error}");
            ExitCode::FAILURE
        }
    }
}

fn follow() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let server = arguments.next().unwrap_or_else(|| "default".to_owned());
    let bridge = arguments.next().unwrap_or_else(|| "default".to_owned());
    let seconds: f64 = arguments.next().map_or(Ok(f64::INFINITY), |text| text.parse())?;

    let mut robot = Robot::connect(&server)?;
    let n_y = robot.model().independent.len();
    let n_u = robot.model().active.len();
    let from_encoders = robot.query(Request::Map).given(["u", "ud"]).want(["y", "yd"]).prepare()?;
    let to_efforts = robot
        .query(Request::InverseDynamics)
        .given(["y", "yd", "ydd"])
        .want(["tau_u"])
        .prepare()?;
    let mut controller = Controller::connect(&bridge, robot.model().fingerprint)?;

    let mut encoders = vec![0.0; 2 * n_u];
    let mut state = vec![0.0; 2 * n_y];
    let mut motion = vec![0.0; 3 * n_y];
    let mut tau_u = vec![0.0; n_u];
    let mut start = None;
    let mut y_start = vec![0.0; n_y];
    let mut command = ActuatorCommand { n_u: n_u as u64, ..ActuatorCommand::default() };
    let begin = Instant::now();
    let mut worst = None::<f64>;
    let mut next = begin;
    while begin.elapsed().as_secs_f64() < seconds {
        next += Duration::from_secs_f64(1.0 / RATE);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        let Some(measured) = controller.state() else { continue };

        // encoders to independent coordinates
        encoders[..n_u].copy_from_slice(&measured.position[..n_u]);
        encoders[n_u..].copy_from_slice(&measured.velocity[..n_u]);
        let answer = robot.ask(from_encoders, &encoders, &mut state)?;
        if answer.status != Status::Ok {
            // motors that have not measured yet, or a pose that cannot be: no command, and the
            // bridge takes the power away
            continue;
        }

        // a swing that begins where the robot is when it gets power
        let is_enabled = measured.state == MechanismState::Enabled as u32;
        if !is_enabled || start.is_none() {
            y_start.copy_from_slice(&state[..n_y]);
            start = is_enabled.then(Instant::now);
        }
        let t = start.map_or(0.0, |start| start.elapsed().as_secs_f64());
        let (size, period) = SWING;
        let w = 2.0 * PI / period;
        let [position, velocity, acceleration] =
            [size * (1.0 - (w * t).cos()), size * w * (w * t).sin(), size * w * w * (w * t).cos()];
        for i in 0..n_y {
            let [y, yd] = [state[i], state[n_y + i]];
            let behind = y_start[i] + position - y;
            motion[i] = y;
            motion[n_y + i] = yd;
            motion[2 * n_y + i] = if is_enabled { acceleration } else { 0.0 }
                + GAINS.0 * behind
                + GAINS.1 * (velocity - yd);
            if t > 2.0 {
                worst = Some(worst.unwrap_or(0.0).max(behind.abs()));
            }
        }

        // accelerations to efforts
        let answer = robot.ask(to_efforts, &motion, &mut tau_u)?;
        if answer.status != Status::Ok {
            continue;
        }
        command.position[..n_u].copy_from_slice(&measured.position[..n_u]);
        command.effort[..n_u].copy_from_slice(&tau_u);
        controller.send(&mut command);
    }
    match worst {
        Some(worst) => println!(
            "largest distance from the wanted motion, from two seconds after power on: {worst:.4} \
             rad"
        ),
        None => println!("the motors never had power for two seconds"),
    }
    Ok(())
}
