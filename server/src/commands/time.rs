//! `sarrus time`: the fastest motion along a path that the actuators can drive.

use std::path::PathBuf;

use clap::Args;
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request, Status, TaskParts};
use sarrus_models::Loaded;
use sarrus_report::csv_rows;
use sarrus_report::measure::progress::Progress;
use sarrus_show::{Motion, POINTS, Settings, motion, sparse};
use sarrus_simulation::{Stop, Timed, time_path};

use super::curves::{charts, command_line};
use super::output::{self, Failure, Outcome, Results};
use super::robot::RobotFlags;
use super::table::table;

/// The columns of a pose.
const POSE: [&str; 7] = ["px", "py", "pz", "qx", "qy", "qz", "qw"];

/// Flags of `time`.
#[derive(Args)]
#[command(override_usage = "sarrus time [OPTIONS] <PATH> <--robot <NAME>|FILE.urdf> [FILE.yml]")]
pub(crate) struct Time {
    /// A table: a first line with the names of the independent joints, or of poses as FRAME/px,
    /// FRAME/py, FRAME/pz, FRAME/qx to FRAME/qw, then a row for each place on the path.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    #[command(flatten)]
    robot: RobotFlags,
    /// The table to write; without it it goes to stdout. Between its rows y is the cubic through
    /// y and ẏ of both, which keeps the limits to 0.1 %.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The page to write: the robot in motion beside curves of y, ẏ, u and τ_u with their limits.
    #[arg(long, value_name = "PAGE")]
    show: Option<PathBuf>,
}

impl Time {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let model = &loaded.compiled.model;
        if model.sizes().n_qy != model.sizes().n_vy {
            let words = "paths are of joints of one freedom, and some independent has more";
            return Err(Failure::start(words));
        }
        let (lines, numbers, heads) = table(&self.path)?;
        let rows = match rows_of_joints(model, &heads, &numbers) {
            Some(rows) => rows,
            None => self.rows_of_poses(model, &heads, (&lines, &numbers))?,
        };
        if rows.windows(2).all(|pair| pair[0] == pair[1]) {
            let file = self.path.display();
            return Err(Failure::start(format!("{file}: expected two different rows or more")));
        }
        let progress = Progress::silent();
        let timed = time_path(model, &rows, &mut |done| progress.show("timing", done));
        progress.clear();
        let timed = timed.map_err(Failure::start)?.map_err(|stop| {
            Failure::finding(format!("{}: {}", self.path.display(), words(&stop, &lines)))
        })?;
        let duration = timed.times.last().copied().unwrap_or_default();
        let about = format!(
            "{duration:.6} s, {} rows, {:.1e} of a limit exceeded between them",
            timed.times.len(),
            timed.excess
        );
        let write = |path: &PathBuf, file: String| {
            output::write(path, file)?;
            Ok::<String, Failure>(format!("{}: {about}\n", path.display()))
        };
        let shown = match &self.show {
            Some(path) => write(path, self.page(&loaded, &timed, &about)?)?,
            None => String::new(),
        };
        let table = csv(model, &timed)?;
        let text = match &self.out {
            Some(path) => write(path, table)? + &shown,
            None => table,
        };
        Ok(Results { text, code: 0 })
    }

    /// The page of a motion.
    fn page(&self, loaded: &Loaded, timed: &Timed, about: &str) -> Result<String, Failure> {
        let model = &loaded.compiled.model;
        let loops = FieldSet::of(if model.sizes().n_c > 0 { &[Field::SigmaMin] } else { &[] });
        let want = loops.with(Field::Q).with(Field::U);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let mut planned = Planned::new(model, &query).map_err(Failure::start)?;
        let places = sparse(timed.times.len(), POINTS);
        let rows: Vec<_> = places.iter().filter_map(|k| timed.rows.get(*k)).collect();
        let mut fields = [const { Vec::new() }; 3];
        for [y, ..] in &rows {
            planned.give(Field::Y, y);
            // without an answer the numbers are NaN
            let _ = planned.run(model);
            for (rows, field) in fields.iter_mut().zip([Field::Q, Field::SigmaMin, Field::U]) {
                rows.push(planned.get(field).to_vec());
            }
        }
        let [q, sigma_min, u] = fields;
        let of = |k: usize| rows.iter().map(|row| row[k].clone()).collect::<Vec<_>>();
        let page = Motion {
            samples: timed.times.len(),
            times: places.iter().filter_map(|k| timed.times.get(*k).copied()).collect(),
            q,
            sigma_min: sigma_min.concat(),
            charts: charts(loaded, [of(0), of(1), u, of(3)]),
            texts: vec![about.to_owned()],
            command: command_line(),
        };
        let settings = Settings::new(&self.robot.source(), &self.robot.options(), false);
        Ok(motion(loaded, &settings, &page))
    }

    /// Rows of y that have these poses, each from the one before.
    fn rows_of_poses(
        &self,
        model: &Model<f64>,
        heads: &[String],
        (lines, numbers): (&[usize], &[Vec<f64>]),
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let file = self.path.display();
        let unknown = |head: &str| {
            Failure::start(format!(
                "{file}:1: found the column `{head}`, expected each of {}, or FRAME/px to FRAME/qw",
                model.independent_names().join(", ")
            ))
        };
        let mut tasks = Vec::new();
        for of in heads.chunks(POSE.len()) {
            let frame = of[0].strip_suffix("/px").ok_or_else(|| unknown(&of[0]))?;
            let link = model.info().link(frame).ok_or_else(|| unknown(&of[0]))?;
            let whole = of.iter().map(|head| head.strip_prefix(frame)).zip(POSE);
            let fits = |(head, part): (Option<&str>, &str)| head == Some(&format!("/{part}"));
            if of.len() != POSE.len() || !whole.into_iter().all(fits) {
                return Err(unknown(&of[of.len() - 1]));
            }
            tasks.push((link, TaskParts::POSITION.with(TaskParts::ORIENTATION)));
        }
        let given = FieldSet::of(&[Field::YGuess]);
        let query = Query::new(Request::InverseKinematics, given, FieldSet::of(&[Field::Y]));
        let query = query.with_tasks(&tasks);
        let mut planned = Planned::new(model, &query).map_err(Failure::start)?;
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for (line, row) in lines.iter().zip(numbers) {
            if let Some(before) = rows.last() {
                planned.give(Field::YGuess, before);
            }
            let poses = row.chunks(POSE.len());
            let targets = poses.flat_map(|pose| [pose, &[0.0, 0.0, 1.0, 1.0]].concat());
            planned.give(Field::TaskTarget, &targets.collect::<Vec<f64>>());
            let answer = planned.run(model);
            if answer.status != Status::Ok {
                let status = answer.status.name();
                return Err(Failure::finding(format!("{file}:{line}: the pose is {status}")));
            }
            rows.push(planned.get(Field::Y).to_vec());
        }
        Ok(rows)
    }
}

/// The rows in the order of y, where the heads are the independent joints.
fn rows_of_joints(
    model: &Model<f64>,
    heads: &[String],
    numbers: &[Vec<f64>],
) -> Option<Vec<Vec<f64>>> {
    let names = model.independent_names();
    let column = |name: &String| heads.iter().position(|head| head == name);
    let columns: Vec<usize> = names.iter().map(column).collect::<Option<_>>()?;
    let fits = heads.len() == names.len();
    fits.then(|| numbers.iter().map(|row| columns.iter().map(|c| row[*c]).collect()).collect())
}

/// Why a path cannot be driven, at lines of its file.
fn words(stop: &Stop, lines: &[usize]) -> String {
    let place = |row: f64| {
        let at = |k: usize| lines.get(k).copied().unwrap_or_default();
        let first = row.floor() as usize;
        match row > row.floor() {
            true => format!("between the lines {} and {}", at(first), at(first + 1)),
            false => format!("at line {}", at(first)),
        }
    };
    match stop {
        Stop::Limit { row, what, name, value, limits: [lower, upper] } => format!(
            "{} the {what} of {name} is {value:.6}, beyond or at its limits {lower:.6} to \
             {upper:.6}; it cannot be driven",
            place(*row)
        ),
        Stop::Status { row, status } => {
            format!("{} the robot's state is {}", place(*row), status.name())
        }
    }
}

/// The motion as a table: time, then y, ẏ and ÿ of each independent, then τ_u.
fn csv(model: &Model<f64>, timed: &Timed) -> Result<String, Failure> {
    let names = model.independent_names().iter();
    let with = |ending: &str, names: &[String]| -> Vec<String> {
        names.iter().map(|name| format!("{name}{ending}")).collect()
    };
    let mut rows = vec![
        [
            vec!["t".to_owned()],
            names.cloned().collect(),
            with("/yd", model.independent_names()),
            with("/ydd", model.independent_names()),
            with("/tau_u", model.active_names()),
        ]
        .concat(),
    ];
    for (t, numbers) in timed.times.iter().zip(&timed.rows) {
        let cells = [*t].into_iter().chain(numbers.iter().flatten().copied());
        rows.push(cells.map(|x| x.to_string()).collect());
    }
    csv_rows::write(&rows).map_err(Failure::start)
}
