//! `sarrus-can commission`: moves each motor a little, compares it with the model, and writes the
//! record without which a robot is not armed.
//!
//! It runs the bridge with all its rules and is the bridge's controller. All mechanisms are armed
//! and held where they are, by the effort that the model needs there and by the spring and damper
//! of a stop. Then one actuator after the other goes a part of its range away from its nearer
//! limit and comes back at the same speed, so that friction cancels in the mean of both ways:
//!
//! ```text
//! |mean(τ − τ_model)| ≤ 0.25 mean|τ_model| + 0.02 limits.effort
//! ```

mod model;
mod session;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;
use sarrus_can_core::config::{Commissioning, Configuration, Limits};
use sarrus_can_run::{Settings, prepare, stderr, write_whole};

use crate::check::table;
use crate::failed;
use model::Model;
use session::{Motor, Session, Trial};

/// Part of the model's effort, and of the limit, by which an effort may differ.
const MODEL: f64 = 0.25;
const LIMIT: f64 = 0.02;
/// Parts of the way that count as following it.
const FOLLOWS: std::ops::RangeInclusive<f64> = 0.5..=1.5;
/// Part of its own way by which an actuator that is held may move.
const HELD: f64 = 0.5;

/// The result of a motor for which the model's effort is smaller than the allowed difference.
const UNJUDGED: &str = "effort not judged";
/// Stands below a table with such a motor.
const UNJUDGED_HELP: &str = "effort not judged: the model needs less than may differ, so a wrong \
    sign, gear or torque constant would not show. Watch which way it moves; commission where it \
    carries more, or with the `limits.effort` that the robot needs\n";
/// Stands below the table of a robot that has no actuator beyond its degrees of freedom.
const BLIND: &str = "pose: no more actuators than degrees of freedom, so a wrong zero or gear \
    shows in the effort alone\n";

const HEAD: &str = "actuator | way | followed | effort | model | allowed | pose | result";

type Tried = (Vec<Vec<String>>, bool, bool);

/// Flags of `commission`.
#[derive(Args)]
pub(crate) struct Commission {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// Do not ask for confirmation
    #[arg(long)]
    yes: bool,
    /// How far each actuator moves, as part of the range between its limits
    #[arg(long, default_value_t = 0.02)]
    part: f64,
    /// Least time for one way `[s]`
    #[arg(long, default_value_t = 1.0)]
    seconds: f64,
}

type Error = Box<dyn std::error::Error>;

impl Commission {
    /// 0 with a record; 1 for a finding or a faulty configuration, 2 for failures at start-up.
    pub(crate) fn run(&self) -> Result<ExitCode, ExitCode> {
        let is_sound = |number: f64, most: f64| number > 0.0 && number <= most;
        if !is_sound(self.part, 0.5) || !is_sound(self.seconds, 60.0) {
            let bounds = "`--part` is at most 0.5, `--seconds` at most 60";
            return Err(failed("commission", bounds));
        }
        let configuration = crate::configuration(&self.config)?;
        if !self.yes && !confirmed(&configuration) {
            eprintln!("sarrus-can commission: not confirmed");
            return Ok(ExitCode::from(1));
        }
        stderr::never_wait("sarrus-can");
        let folder = self.config.parent().unwrap_or(std::path::Path::new(""));
        let path = folder.join(&configuration.record_file);
        let record = configuration.record();
        let tried = self.tried(configuration);
        stderr::finish();
        match tried {
            Ok((rows, is_good, is_blind)) => {
                let mut text = String::new();
                table(&mut text, HEAD, &rows);
                if is_blind {
                    text += BLIND;
                }
                if rows.iter().flatten().any(|cell| cell == UNJUDGED) {
                    text += UNJUDGED_HELP;
                }
                print!("{text}");
                if !is_good {
                    return Ok(ExitCode::from(1));
                }
                // the table as comments, then the lines that must fit
                let table: String = text.lines().map(|line| format!("# {line}\n")).collect();
                let shown = path.display();
                write_whole(&path, &(table + &record))
                    .map_err(|error| failed("commission", format_args!("{shown}: {error}")))?;
                println!("{shown}");
                Ok(ExitCode::SUCCESS)
            }
            Err(error) => Err(failed("commission", error)),
        }
    }

    /// The table of all motors, whether there is no finding, and whether nothing but efforts shows
    /// a wrong zero.
    fn tried(&self, mut configuration: Configuration) -> Result<Tried, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        crate::run::end_by_signals(&stop)?;
        configuration.commissioning = Commissioning::Done;
        let motors: Vec<Motor> =
            configuration.motors.iter().map(|motor| Motor::new(motor, &configuration)).collect();
        let mut model = Model::new(&configuration)?;
        let name = format!("commission-{}", std::process::id());
        let fingerprint = configuration.fingerprint;
        let rate_hz = configuration.rate_hz;
        let settings = Settings {
            name: name.clone(),
            priority: Some(crate::run::PRIORITY),
            fault_log: None,
            log: None,
        };
        let mut owned = Vec::new();
        let open = |bus: &_| crate::run::open(bus, &mut owned);
        let prepared = prepare(configuration, settings, stop.clone(), open)?;
        let running = prepared.start()?;
        let mut session = Session::connect(&name, fingerprint, rate_hz, &motors, stop)?;
        let trials = session.all(&motors, &mut model, self.part, self.seconds);
        session.disarm();
        running.end()?;

        let mut rows = Vec::new();
        let mut is_good = true;
        for (place, (motor, trial)) in motors.iter().zip(&trials).enumerate() {
            let finding = match trial {
                Ok(trial) => finding(place, motor, trial, &motors),
                Err(why) => Some(why.clone()),
            };
            is_good &= finding.is_none();
            let is_judged = |trial: &Trial| allowed(&motor.limits, trial) < trial.model.abs();
            let good = if trial.as_ref().is_ok_and(is_judged) { "good" } else { UNJUDGED };
            rows.push(row(motor, trial.as_ref().ok(), finding.as_deref().unwrap_or(good)));
        }
        Ok((rows, is_good, model.closes_anywhere()))
    }
}

/// Asks for a confirmation.
fn confirmed(configuration: &Configuration) -> bool {
    eprintln!(
        "All {} motors get power and hold the robot where it is; then each moves a little.\n\
         Keep out of its reach, support it, and have a hand on the emergency stop.\n\
         type `yes` to go on:",
        configuration.motors.len()
    );
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).is_ok() && answer.trim() == "yes"
}

/// By how much an effort may differ from the model's.
fn allowed(limits: &Limits, trial: &Trial) -> f64 {
    MODEL * trial.model.abs() + LIMIT * limits.effort
}

/// A contradiction between a motor and the robot, in words.
fn finding(place: usize, motor: &Motor, trial: &Trial, motors: &[Motor]) -> Option<String> {
    if !trial.has_pose {
        return Some("the robot has no such pose: an offset, a sign or a gear is wrong".to_owned());
    }
    let share = trial.moved / trial.way;
    if !FOLLOWS.contains(&share) {
        return Some("did not follow: its gear, its torque or its load is wrong".to_owned());
    }
    let off = trial.effort - trial.model;
    if off.abs() > allowed(&motor.limits, trial) {
        return Some("another effort: sign, gear, torque constant or identifier".to_owned());
    }
    let others: Vec<&str> = motors
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != place)
        .filter(|(other, of)| {
            let moved = trial.others.get(*other).copied().unwrap_or(0.0);
            moved > HELD * (trial.part * (of.limits.upper - of.limits.lower)).abs()
        })
        .map(|(_, of)| of.name.as_str())
        .collect();
    (!others.is_empty()).then(|| format!("also moved: {}", others.join(", ")))
}

fn row(motor: &Motor, trial: Option<&Trial>, result: &str) -> Vec<String> {
    let number = |number: Option<f64>| match number {
        Some(number) if number.is_finite() => format!("{number:.4}"),
        _ => "-".to_owned(),
    };
    let of = |value: fn(&Trial) -> f64| number(trial.map(value));
    vec![
        motor.name.clone(),
        of(|trial| trial.way),
        trial.map_or("-".to_owned(), |trial| format!("{:.0} %", 100.0 * trial.moved / trial.way)),
        of(|trial| trial.effort),
        of(|trial| trial.model),
        number(trial.map(|trial| allowed(&motor.limits, trial))),
        trial.map_or("-", |trial| if trial.has_pose { "closed" } else { "open" }).to_owned(),
        result.to_owned(),
    ]
}
