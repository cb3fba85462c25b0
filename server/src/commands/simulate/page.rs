//! The page of a simulation: the curves beside the robot.

use sarrus_dynamics::{Field, FieldSet, Planned, Query, Request, Status};
use sarrus_models::Loaded;
use sarrus_show::{Chart, Curve, Motion, POINTS, Settings, motion, sparse};
use sarrus_simulation::{Sample, Setup};

use super::output::Report;
use crate::commands::curves::{self, command_line};

/// Most rows of λ that are drawn.
const ROWS: usize = 24;

/// The page.
pub(super) fn page(report: &Report<'_>, setup: &Setup<'_>, settings: &Settings) -> String {
    let Report { loaded, run, .. } = report;
    let samples: Vec<&Sample> =
        sparse(run.samples.len(), POINTS).into_iter().filter_map(|k| run.samples.get(k)).collect();
    let is_sprung = !setup.springs.is_empty() || !run.elastic.is_empty();
    let states = States::new(loaded, (!is_sprung).then_some(setup), &samples);
    let mut texts: Vec<String> = report.summary(&[]).lines().map(str::to_owned).collect();
    if let Some(first) = samples.first() {
        texts.push(format!("start y = {:?}, yd = {:?}", first.y, first.yd));
    }
    if is_sprung {
        texts.push(
            "loop and motor forces are not drawn beside springs between links or in actuators"
                .to_owned(),
        );
    }
    let page = Motion {
        samples: run.samples.len(),
        times: samples.iter().map(|sample| sample.time).collect(),
        q: samples.iter().map(|sample| sample.q.clone()).collect(),
        sigma_min: states.rows(Field::SigmaMin).concat(),
        charts: charts(loaded, &samples, &states),
        texts,
        command: command_line(),
    };
    motion(loaded, settings, &page)
}

/// Fields at each sample: NaN where it has no answer.
struct States(Vec<(Field, Vec<Vec<f64>>)>);

impl States {
    /// Loop forces of the motion under its inputs; then the forces of the motors that give the same
    /// motion.
    fn new(loaded: &Loaded, setup: Option<&Setup<'_>>, samples: &[&Sample]) -> States {
        use Field::{Lambda, QGuess, QdGuess, SigmaMin, TauQ, TauU, U, Y, Yd, Ydd};
        let model = &loaded.compiled.model;
        let has_loops = model.sizes().n_c > 0;
        let state = FieldSet::of(if has_loops { &[Y, Yd, QGuess, QdGuess] } else { &[Y, Yd] });
        let loops = FieldSet::of(if has_loops { &[Lambda, SigmaMin] } else { &[] });
        let mut states = States(Vec::new());
        let forces = setup.and_then(|setup| setup.forces(samples.iter().copied()).ok());
        let Some(forces) = forces else { return states };
        let run = |query: &Query, extra: Field, rows: &[Vec<f64>]| {
            let mut planned = Planned::new(model, query).ok()?;
            let mut found: Vec<_> = query.want.iter().map(|field| (field, Vec::new())).collect();
            for (sample, row) in samples.iter().zip(rows) {
                planned.give(Y, &sample.y);
                planned.give(Yd, &sample.yd);
                planned.give(QGuess, &sample.q);
                planned.give(QdGuess, &sample.qd);
                planned.give(extra, row);
                if planned.run(model).status != Status::Ok {
                    planned.output.fill(f64::NAN);
                }
                found.iter_mut().for_each(|(field, rows)| rows.push(planned.get(*field).to_vec()));
            }
            Some(found)
        };
        let query = Query::new(Request::ForwardDynamics, state.with(TauQ), loops.with(Ydd));
        if let Some(found) = run(&query, TauQ, &forces) {
            states.0 = found;
            let want = FieldSet::of(&[U, TauU]);
            let query = Query::new(Request::InverseDynamics, state.with(Ydd), want);
            let found = run(&query, Ydd, &states.rows(Ydd));
            states.0.extend(found.into_iter().flatten());
        }
        states
    }

    /// A field at each sample; none where it is not known.
    fn rows(&self, field: Field) -> Vec<Vec<f64>> {
        let of = self.0.iter().find(|(of, _)| *of == field);
        of.map(|(_, rows)| rows.clone()).unwrap_or_default()
    }
}

/// Positions and velocities of the independents, motors, loops, energies, residual.
fn charts(loaded: &Loaded, samples: &[&Sample], states: &States) -> Vec<Chart> {
    let list = |of: fn(&Sample) -> &Vec<f64>| -> Vec<Vec<f64>> {
        samples.iter().map(|sample| of(sample).clone()).collect()
    };
    let [u, tau_u] = [Field::U, Field::TauU].map(|field| states.rows(field));
    let mut charts = curves::charts(loaded, [list(|x| &x.y), list(|x| &x.yd), u, tau_u]);
    let loops = &loaded.compiled.model.info().loops;
    charts.extend(loop_forces(loops, &states.rows(Field::Lambda)));
    let curve = |name: &str, of: &dyn Fn(&Sample) -> f64| Curve {
        name: name.to_owned(),
        values: samples.iter().map(|sample| of(sample)).collect(),
        limits: [None; 2],
    };
    let start = samples.first().map_or(0.0, |sample| sample.balance());
    let energies = vec![
        curve("kinetic", &|x| x.energy.kinetic),
        curve("potential", &|x| x.energy.potential),
        curve("work of inputs less losses", &|x| x.work),
    ];
    let errors = vec![
        curve("change of energy less work, J", &|x| (x.balance() - start).abs()),
        curve("loop residual", &|x| x.energy.residual),
    ];
    charts.push(Chart { title: "Energy, J".to_owned(), log: false, curves: energies });
    charts.push(Chart { title: "What should be zero".to_owned(), log: true, curves: errors });
    charts
}

/// λ, of many rows those that become largest.
fn loop_forces(names: &[String], rows: &[Vec<f64>]) -> Option<Chart> {
    let curve = |(k, name): (usize, &String)| Curve {
        name: name.clone(),
        values: rows.iter().map(|row| row[k]).collect(),
        limits: [None; 2],
    };
    let mut curves: Vec<Curve> = names.iter().enumerate().map(curve).collect();
    let size = |curve: &Curve| curve.values.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    curves.sort_by(|a, b| size(b).total_cmp(&size(a)));
    curves.truncate(ROWS);
    let count = match names.len() {
        0..=ROWS => String::new(),
        count => format!(", the largest {ROWS} of {count}"),
    };
    let title = format!("Loop forces λ, N and N m{count}");
    (!rows.is_empty() && !curves.is_empty()).then_some(Chart { title, log: false, curves })
}
