//! The results of a simulation: a table, a summary.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use sarrus_models::Loaded;
use sarrus_report::csv_rows;
use sarrus_simulation::{EventKind, Exceeded, Method, Run, Sample};
use serde_json::{Value, json};

/// A simulation and its robot.
pub(super) struct Report<'a> {
    pub(super) loaded: &'a Loaded,
    pub(super) run: &'a Run,
    pub(super) method: Method,
}

impl Report<'_> {
    /// Writes motion.csv and motion.html; returns their paths.
    pub(super) fn write(&self, folder: &Path, page: String) -> Result<Vec<String>, String> {
        fs::create_dir_all(folder)
            .map_err(|error| format!("cannot make the folder {}: {error}", folder.display()))?;
        let files = [("motion.csv", csv(self.loaded, self.run)?), ("motion.html", page)];
        let write = |(name, text): (&str, String)| {
            let path = folder.join(name);
            let written = fs::write(&path, text);
            written.map_err(|error| format!("cannot write {}: {error}", path.display()))?;
            Ok(path.display().to_string())
        };
        files.into_iter().map(write).collect()
    }

    /// As text.
    pub(super) fn summary(&self, files: &[String]) -> String {
        let Report { loaded, run, method } = self;
        let counts = &run.counts;
        let mut text = String::new();
        let mut line = |words: String| {
            let _ = writeln!(text, "{words}");
        };
        line(format!(
            "{}, {}: {} at {} s",
            loaded.description.name,
            method.name(),
            run.end.name(),
            run.time
        ));
        line(format!(
            "steps {}, rejected {}, without an answer {}, evaluations {} ({} in double-double), \
             Jacobians {}, factorisations {}",
            counts.steps,
            counts.rejected,
            counts.failed,
            counts.evaluations,
            counts.precise,
            counts.jacobians,
            counts.factorisations
        ));
        line(format!(
            "energy drift {:.2e} of the largest energy, loop residual {:.2e}",
            run.drift(),
            run.residual()
        ));
        if let Some([y, yd]) = run.error_estimate {
            line(format!("estimated error y {y:.2e}, yd {yd:.2e}"));
        }
        if run.correction.iter().any(|x| *x != 0.0) {
            line(format!(
                "the start was moved by {:.2e} in q and {:.2e} in qd to close the loops",
                run.correction[0], run.correction[1]
            ));
        }
        for limit in run.exceeded(loaded.compiled.model.info()) {
            let Exceeded { name, what, value, time, .. } = &limit;
            let by = limit.by();
            line(format!("{what} of {name} is {by:.3} beyond its limit at {time} s ({value:.3})"));
        }
        for event in &run.events {
            line(format!("at {} s: {}", event.time, words(&event.kind)));
        }
        if let Some(last) = run.last() {
            let list = |x: &[f64]| x.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(",");
            line(format!("y  = {}", list(&last.y)));
            line(format!("yd = {}", list(&last.yd)));
        }
        files.iter().for_each(|file| line(file.clone()));
        text
    }

    /// As JSON.
    pub(super) fn value(&self, files: &[String]) -> Value {
        let Report { loaded, run, method } = self;
        let counts = &run.counts;
        let events: Vec<Value> = run
            .events
            .iter()
            .map(|event| json!({"time": event.time, "event": words(&event.kind)}))
            .collect();
        let named = |names: &[String], list: fn(&Sample) -> &[f64]| -> Value {
            let numbers = run.last().map_or(&[] as &[f64], list);
            names
                .iter()
                .zip(numbers)
                .map(|(name, x)| (name.clone(), json!(x)))
                .collect::<serde_json::Map<_, _>>()
                .into()
        };
        let model = &loaded.compiled.model;
        let limit = |of: Exceeded| {
            let Exceeded { name, what, value, lower, upper, time, .. } = of;
            json!({
                "name": name, "what": what, "value": value, "lower": lower, "upper": upper,
                "time": time
            })
        };
        let limits: Vec<Value> = run.exceeded(model.info()).into_iter().map(limit).collect();
        json!({
            "robot": loaded.description.name,
            "method": method.name(),
            "status": run.end.name(),
            "time": run.time,
            "steps": counts.steps,
            "rejected": counts.rejected,
            "failed": counts.failed,
            "evaluations": counts.evaluations,
            "precise": counts.precise,
            "jacobians": counts.jacobians,
            "factorisations": counts.factorisations,
            "drift": run.drift(),
            "residual": run.residual(),
            "correction": run.correction,
            "error_estimate": run.error_estimate,
            "independents": run.independents,
            "events": events,
            "limits": limits,
            "y": named(model.independent_q_names(), |sample| &sample.y),
            "yd": named(model.independent_names(), |sample| &sample.yd),
            "files": files,
        })
    }
}

/// The name of a column and its value in a sample.
type Column<'a> = (String, Box<dyn Fn(&Sample) -> f64 + 'a>);

fn columns<'a>(loaded: &'a Loaded, run: &'a Run) -> Vec<Column<'a>> {
    let info = loaded.compiled.model.info();
    let names = [&info.independent_q, &info.independent, &info.tree_q, &info.tree, &run.elastic];
    let theta: fn(&Sample) -> &[f64] = |sample| &sample.theta;
    let figure =
        |(name, of): (&str, fn(&Sample) -> f64)| -> Column<'a> { (name.to_owned(), Box::new(of)) };
    let [time, figures @ ..] = Sample::FIGURES;
    let mut columns = vec![figure(time)];
    for ((symbol, list), names) in Sample::STATES.into_iter().chain([("theta", theta)]).zip(names) {
        for (k, name) in names.iter().enumerate() {
            columns.push((
                format!("{symbol}.{name}"),
                Box::new(move |sample| list(sample).get(k).copied().unwrap_or(f64::NAN)),
            ));
        }
    }
    columns.extend(figures.map(figure));
    columns
}

/// A head and a row for each sample; numbers keep their bits when read back.
fn csv(loaded: &Loaded, run: &Run) -> Result<String, String> {
    let columns = columns(loaded, run);
    let mut rows: Vec<Vec<String>> = vec![columns.iter().map(|(name, _)| name.clone()).collect()];
    let cells = |sample| columns.iter().map(|(_, of)| format!("{:?}", of(sample))).collect();
    rows.extend(run.samples.iter().map(cells));
    csv_rows::write(&rows).map_err(|error| error.to_string())
}

fn words(kind: &EventKind) -> String {
    match kind {
        EventKind::Switched { from, to, before, after } => format!(
            "went on with the independents {} in place of {} (distance to singularity \
             {before:.2e}, then {after:.2e})",
            to.join(", "),
            from.join(", ")
        ),
        EventKind::NotSwitched { to, why } => {
            format!("the independents {} would be better, but {why}", to.join(", "))
        }
        EventKind::Shortened(status) => format!("a step was shortened: {status} on its way"),
        EventKind::NearSingular(distance) => {
            format!("ended near a singularity (distance {distance:.2e})")
        }
        EventKind::Limited(name) => format!("{name} gives what its limits allow"),
        EventKind::Stopped(name) => format!("{name} came to its stop"),
        EventKind::Stiff => "stiff for an explicit method; radau5 takes longer steps".to_owned(),
        other => format!("{other:?}"),
    }
}
