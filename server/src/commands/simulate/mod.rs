//! `sarrus simulate`: a robot integrated in time.

mod input;
mod output;
mod page;

use std::path::PathBuf;

use clap::Args;
use sarrus_models::Loaded;
use sarrus_report::measure::progress::Progress;
use sarrus_show::Settings as Show;
use sarrus_simulation::{Method, Settings, Setup, SimulationError, Start, simulate};

use super::output::{Failure, FormatFlag, Outcome, Results, file_name};
use super::robot::RobotFlags;
use super::{Choices, choice};
use input::{ForceFlags, Numbers};

/// Samples of a run without `--every`.
const SAMPLES: f64 = 500.0;

/// Flags of `simulate`.
#[derive(Args)]
pub(crate) struct Simulate {
    #[command(flatten)]
    robot: RobotFlags,
    /// Method of integration.
    #[arg(long, value_parser = choice(&METHODS), value_name = "METHOD", default_value = "dop853")]
    method: Method,
    /// Duration, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, allow_hyphen_values = true)]
    duration: f64,
    /// Length of a fixed step, or the first step of a method that finds its own, s.
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    step: Option<f64>,
    /// Relative tolerance of methods that find their own step.
    #[arg(long, value_name = "NUMBER", default_value_t = 1e-8, allow_hyphen_values = true)]
    rtol: f64,
    /// Absolute tolerance of these, in metres, radians and their rates.
    #[arg(long, value_name = "NUMBER", default_value_t = 1e-8, allow_hyphen_values = true)]
    atol: f64,
    /// Baumgarte's rates alpha = beta, 1/s; a tenth of the inverse step without it.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    stabilisation: Option<f64>,
    /// Time between two rows of the result, s; about five hundred rows without it.
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    every: Option<f64>,
    #[command(flatten)]
    start: StartFlags,
    #[command(flatten)]
    forces: ForceFlags,
    /// Ends where the independents become singular instead of going on with others.
    #[arg(long)]
    no_switching: bool,
    /// Never computes in double-double near singularities.
    #[arg(long)]
    no_precise: bool,
    /// Counts the friction of joints.
    #[arg(long)]
    friction: bool,
    /// Keeps the forces of actuators within their limits, and says when one is reached.
    #[arg(long)]
    limits: bool,
    /// Stiff one-sided stops at the limits of joints, N m/rad or N/m.
    #[arg(long, value_name = "STIFFNESS")]
    stops: Option<f64>,
    /// Simulates once more with other steps to estimate the error.
    #[arg(long)]
    estimate: bool,
    /// The folder for motion.csv and motion.html; the default is the robot's name with
    /// `-simulation`, here.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Prints nothing but the path of motion.html, the robot in motion beside its curves.
    #[arg(long, conflicts_with = "format")]
    show: bool,
    #[command(flatten)]
    format: FormatFlag,
}

/// The initial state.
#[derive(Args)]
struct StartFlags {
    /// Independent coordinates, separated by commas; the zero pose without them.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, conflicts_with_all = ["q", "qd"])]
    y: Option<Numbers>,
    /// Independent velocities; at rest without them.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, conflicts_with_all = ["q", "qd"])]
    yd: Option<Numbers>,
    /// Tree coordinates; a pose whose loops are open is closed, and how far it was moved is
    /// printed.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    q: Option<Numbers>,
    /// Tree velocities.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, requires = "q")]
    qd: Option<Numbers>,
    /// A closed pose near y from which numerical closures continue.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, conflicts_with = "q")]
    q_guess: Option<Numbers>,
}

const METHODS: Choices<Method, 6> = [
    (Method::Euler, "euler", "Semi-implicit Euler, fixed step"),
    (Method::RungeKutta, "rk4", "Runge and Kutta's classical method, fixed step"),
    (Method::Dop853, "dop853", "Dormand and Prince's explicit method of order 8, its own step"),
    (
        Method::Radau5,
        "radau5",
        "Radau's implicit method of order 5 for stiff problems, its own step",
    ),
    (
        Method::Baumgarte,
        "baumgarte",
        "For comparison: rk4 in all tree coordinates, loops stabilised",
    ),
    (Method::Projection, "projection", "For comparison: the same, loops closed after each step"),
];

impl Simulate {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let model = &loaded.compiled.model;
        let inputs = self.forces.inputs(model).map_err(Failure::start)?;
        let springs = self.forces.springs(model).map_err(Failure::start)?;
        let setup = Setup {
            description: &loaded.description,
            compiled: &loaded.compiled,
            springs: &springs,
            inputs: &inputs,
        };
        let progress = Progress::silent();
        let settings = self.settings();
        let run = simulate(&setup, &self.start.start(&loaded), &settings, &mut |time| {
            progress.show("simulating", time / settings.duration)
        });
        progress.clear();
        let run = run.map_err(|error: SimulationError| Failure::start(error.to_string()))?;
        let report = output::Report { loaded: &loaded, run: &run, method: self.method };
        let lines = Show::new(&self.robot.source(), &self.robot.options(), false);
        let page = page::page(&report, &setup, &lines);
        let usual = || PathBuf::from(file_name(model.name()) + "-simulation");
        let folder = self.out.clone().unwrap_or_else(usual);
        let files = report.write(&folder, page).map_err(Failure::start)?;
        let text = match self.show {
            true => files.last().map(|path| format!("{path}\n")).unwrap_or_default(),
            false => self.format.render(&report.value(&files), |_| report.summary(&files)),
        };
        Ok(Results { text, code: u8::from(!run.end.is_finished()) })
    }

    fn settings(&self) -> Settings {
        let method = self.method;
        // rows of the result fall on fixed steps
        let sparse = self.duration / SAMPLES;
        let every = match self.step {
            Some(step) if method.is_fixed() && step > 0.0 => step * (sparse / step).ceil().max(1.0),
            _ => sparse,
        };
        Settings {
            step: self.step,
            rtol: self.rtol,
            atol: self.atol,
            stabilisation: self.stabilisation,
            every: Some(self.every.unwrap_or(every)),
            switching: !self.no_switching,
            precise: !self.no_precise,
            friction: self.friction,
            limited: self.limits,
            stops: self.stops,
            estimate: self.estimate,
            ..Settings::new(method, self.duration)
        }
    }
}

impl StartFlags {
    fn start(&self, loaded: &Loaded) -> Start {
        let model = &loaded.compiled.model;
        let given = |numbers: &Option<Numbers>| numbers.as_ref().map(|numbers| numbers.0.clone());
        if let Some(q) = given(&self.q) {
            return Start::Tree {
                q,
                qd: given(&self.qd).unwrap_or_else(|| vec![0.0; model.sizes().n_v]),
            };
        }
        // a quaternion at rest is 0 0 0 1
        let rest = |names: &[String]| {
            names.iter().map(|name| f64::from(u8::from(name.ends_with("/qw")))).collect()
        };
        Start::Independent {
            y: given(&self.y).unwrap_or_else(|| rest(model.independent_q_names())),
            yd: given(&self.yd).unwrap_or_else(|| vec![0.0; model.sizes().n_vy]),
            guess: given(&self.q_guess),
        }
    }
}
