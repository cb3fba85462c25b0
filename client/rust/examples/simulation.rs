//! A robot in time, without a server: a lambda falls, swings, and keeps its energy.

use sarrus_models::{Options, Source, load};
use sarrus_simulation::{Method, Settings, Setup, Start, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robot = load(&Source::Bundled("lambda".into()), &Options::default())?;
    let setup = Setup {
        description: &robot.description,
        compiled: &robot.compiled,
        springs: &[],
        inputs: &[],
    };
    let start = Start::Independent { y: vec![0.3], yd: vec![0.0], guess: None };
    let settings = Settings { step: Some(1e-3), ..Settings::new(Method::RungeKutta, 2.0) };
    let run = simulate(&setup, &start, &settings, &mut |_| ())?;

    for sample in run.samples.iter().step_by(200) {
        println!("{:5.2} s  y {:8.4}  yd {:8.4}", sample.time, sample.y[0], sample.yd[0]);
    }
    println!("{:?}, energy drift {:e} J", run.end, run.drift());
    Ok(())
}
