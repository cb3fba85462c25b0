//! Digits against processor time of Andrews' squeezer (`--published`), on the axes of SciML's page
//! of this problem: the largest relative error of the seven angles at 0.03 s from the published
//! ones, at the tolerances of that page and tighter ones.
//!
//! Runs are longer than the turns that other programs on the machine take, so the time is that of
//! this thread on its processor, the mean of many runs.

use sarrus_models::{Loaded, Options, Source, load};
use sarrus_report::Outcome;
use sarrus_report::measure::machine::machine;
use sarrus_simulation::{
    Input, Method, Point, Run, Settings, Setup, Source as Force, Space, Spring, Start, simulate,
};

use crate::table::{Table, error};

/// End of the motion [s].
const END: f64 = 0.03;
/// The angles at the start, from which q counts, and at the end: β, Θ, γ, Φ, δ, Ω, ε.
const START: [f64; 7] = [
    -0.06171389001427645,
    0.0,
    0.45527981916307037,
    0.22266839016588588,
    0.48736497954384256,
    -0.22266839016588588,
    1.2305474445498212,
];
const PUBLISHED: [f64; 7] = [
    15.81077119629904,
    -15.75637105984298,
    0.04082224013073101,
    -0.5347301163226948,
    0.5244099658805304,
    0.5347301163226948,
    1.048080741042263,
];
/// The tolerances of SciML's page, and tighter ones.
const TOLERANCES: [f64; 8] = [3e-5, 1e-5, 3e-6, 3e-7, 1e-7, 1e-8, 1e-9, 1e-10];
/// Steps of the method with fixed ones [s].
const STEPS: [f64; 3] = [1e-4, 5e-5, 2.5e-5];
/// Nanoseconds on the processor of all runs of a setting: its clock may advance by milliseconds.
const MEASURED: f64 = 200e6;

/// Prints the table.
///
/// # Errors
///
/// A motion that does not reach its end, a system without processor times of threads.
pub fn run() -> Outcome {
    let squeezer = load(&Source::Bundled("squeezer".to_owned()), &Options::default())?;
    let tight = Settings { rtol: 1e-13, atol: 1e-13, ..settings(Method::Dop853) };
    let reference = angles(&motion(&squeezer, &tight)?)?;
    let mut rows = Vec::new();
    for method in [Method::Dop853, Method::Radau5, Method::RungeKutta] {
        let of = |number: f64| match method.is_fixed() {
            true => Settings { step: Some(number), ..settings(method) },
            false => Settings { rtol: number, atol: number, ..settings(method) },
        };
        for number in if method.is_fixed() { &STEPS[..] } else { &TOLERANCES } {
            let mut last = motion(&squeezer, &of(*number))?;
            let start = processor_time()?;
            let mut spent = 0.0;
            let mut runs = 0.0;
            while spent < MEASURED {
                last = motion(&squeezer, &of(*number))?;
                spent = processor_time()? - start;
                runs += 1.0;
            }
            let found = angles(&last)?;
            let worst = relative(&found, &PUBLISHED);
            rows.push(vec![
                method.name().to_owned(),
                format!("{number:e}"),
                error(worst),
                format!("{:.1}", -worst.log10()),
                error(relative(&found, &reference)),
                format!("{:.2}", 1e-6 * spent / runs),
                last.counts.steps.to_string(),
                last.counts.evaluations.to_string(),
            ]);
        }
    }
    let table = Table {
        title: "Andrews' squeezer to 0.03 s".to_owned(),
        columns: vec![
            "method",
            "tolerance or step",
            "error",
            "digits",
            "from our reference",
            "ms",
            "steps",
            "evaluations",
        ],
        n_text: 1,
        rows,
        notes: vec![
            "error: largest relative one of the seven angles from the published ones; our \
             reference: DOP853 at 1e-13;"
                .to_owned(),
            "ms: processor time of a whole run;".to_owned(),
            format!(
                "our reference is {} from the published angles",
                error(relative(&reference, &PUBLISHED))
            ),
        ],
    };
    print!("{}\n{}", table.text(), machine()?);
    Ok(())
}

/// One sample, at the end.
fn settings(method: Method) -> Settings {
    Settings { every: Some(END), ..Settings::new(method, END) }
}

/// From rest, with the published spring and moment.
fn motion(squeezer: &Loaded, settings: &Settings) -> Outcome<Run> {
    let links = squeezer.compiled.model.link_names();
    let at = |name: &str, at: [f64; 3]| {
        let link = links.iter().position(|of| of == name);
        link.map(|link| Point { link, at }).ok_or_else(|| format!("no link {name}"))
    };
    let spring = Spring {
        from: at("ground", [0.014, 0.072, 0.0])?,
        to: at("K3", [0.02, -0.018, 0.0])?,
        stiffness: 4530.0,
        damping: 0.0,
        rest: 0.07785,
    };
    let moment = Input { space: Space::Actuator, source: Force::Constant(vec![0.033]) };
    let setup = Setup {
        description: &squeezer.description,
        compiled: &squeezer.compiled,
        springs: &[spring],
        inputs: &[moment],
    };
    let start = Start::Independent { y: vec![0.0], yd: vec![0.0], guess: None };
    let run = simulate(&setup, &start, settings, &mut |_| ())?;
    if run.end.is_finished() { Ok(run) } else { Err(run.end.name().into()) }
}

/// The seven angles at the end, by name.
fn angles(run: &Run) -> Outcome<[f64; 7]> {
    let last = run.samples.last().ok_or("no sample")?;
    let moved: [f64; 7] = last.q.as_slice().try_into()?;
    Ok(std::array::from_fn(|k| START[k] + moved[k]))
}

fn relative(found: &[f64; 7], exact: &[f64; 7]) -> f64 {
    let errors = found.iter().zip(exact).map(|(found, exact)| ((found - exact) / exact).abs());
    errors.fold(0.0, f64::max)
}

/// Nanoseconds of this thread on a processor.
fn processor_time() -> Outcome<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    Ok(text.split(' ').next().ok_or("no processor time")?.parse()?)
}
