//! The least controller: `hold [BRIDGE [STIFFNESS [DAMPING [SWING]]]]`.
//!
//! Every actuator is to stay where it was at the start, with a stiffness and a damping (N m/rad and
//! N m s/rad, or N/m and N s/m), or to go SWING (rad or m) away from there and back in four
//! seconds. Start `sarrus-can run` first, and arm with `sarrus-can arm` while this runs. It needs
//! no server and knows no robot: for a motor on a bench, and never for actuators that share a
//! closed loop.

use std::f64::consts::PI;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use sarrus_client::actuators::ActuatorCommand;
use sarrus_client::{Controller, Observer};

/// Commands in a second `[Hz]`.
const RATE: f64 = 250.0;
/// Time of one swing `[s]`.
const PERIOD: f64 = 4.0;

fn main() -> ExitCode {
    match hold() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hold: {error}");
            ExitCode::FAILURE
        }
    }
}

fn hold() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let bridge = arguments.next().unwrap_or_else(|| "default".to_owned());
    let numbers: Vec<f64> = arguments.map(|text| text.parse()).collect::<Result<_, _>>()?;
    let number = |place: usize| numbers.get(place).copied().unwrap_or(0.0);
    let [stiffness, damping, swing] = [number(0), number(1), number(2)];

    // where all actuators are, once every motor has reported it
    let observer = Observer::connect(&bridge)?;
    let start = loop {
        match observer.state().filter(|state| {
            state.position.iter().take(state.n_u as usize).all(|position| position.is_finite())
        }) {
            Some(state) => break state,
            None => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    let n_u = start.n_u as usize;
    let mut controller = Controller::connect(&bridge, start.fingerprint)?;
    println!("holds {n_u} actuators");

    let mut command = ActuatorCommand { n_u: start.n_u, ..ActuatorCommand::default() };
    command.stiffness[..n_u].fill(stiffness);
    command.damping[..n_u].fill(damping);
    let begin = Instant::now();
    loop {
        let w = 2.0 * PI / PERIOD;
        let (sin, cos) = (w * begin.elapsed().as_secs_f64()).sin_cos();
        for i in 0..n_u {
            command.position[i] = start.position[i] + swing * (1.0 - cos) / 2.0;
            command.velocity[i] = swing * w * sin / 2.0;
        }
        controller.send(&mut command);
        std::thread::sleep(Duration::from_secs_f64(1.0 / RATE));
    }
}
