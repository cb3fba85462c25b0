//! The page of a simulation: the curves beside the robot.

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
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
struct States {
    dynamics: Option<Vec<Vec<f64>>>,
    motors: Option<Vec<Vec<f64>>>,
    plans: [Option<Plan>; 2],
}

impl States {
    /// Loop forces of the motion under its inputs; then the forces of the motors that give the same
    /// motion.
    fn new(loaded: &Loaded, setup: Option<&Setup<'_>>, samples: &[&Sample]) -> States {
        use Field::{Lambda, QGuess, QdGuess, SigmaMin, TauQ, TauU, U, Y, Yd, Ydd};
        let model = &loaded.compiled.model;
        let has_loops = model.sizes().n_c > 0;
        let state = FieldSet::of(if has_loops { &[Y, Yd, QGuess, QdGuess] } else { &[Y, Yd] });
        let loops = FieldSet::of(if has_loops { &[Lambda, SigmaMin] } else { &[] });
        let mut states = States { dynamics: None, motors: None, plans: [None, None] };
        let forces = setup.and_then(|setup| setup.forces(samples.iter().copied()).ok());
        let Some(forces) = forces else { return states };
        let run = |query: &Query, extra: Field, rows: &[Vec<f64>]| {
            let plan = Plan::new(model, query).ok()?;
            let mut workspace = Workspace::for_plans(model, [&plan]);
            let mut input = vec![0.0; plan.given().len()];
            let mut of = |(sample, extra_row): (&&Sample, &Vec<f64>)| {
                for (field, numbers) in [
                    (Y, &sample.y),
                    (Yd, &sample.yd),
                    (QGuess, &sample.q),
                    (QdGuess, &sample.qd),
                    (extra, extra_row),
                ] {
                    if let Some(slot) = plan.given().slot(field) {
                        input[slot.range()].copy_from_slice(numbers);
                    }
                }
                let mut output = vec![f64::NAN; plan.want().len()];
                let answer = plan.run(model, &mut workspace, &input, &mut output);
                if answer.status != Status::Ok {
                    output.fill(f64::NAN);
                }
                output
            };
            let rows = samples.iter().zip(rows).map(&mut of).collect::<Vec<_>>();
            Some((plan, rows))
        };
        let query = Query::new(Request::ForwardDynamics, state.with(TauQ), loops.with(Ydd));
        if let Some((plan, rows)) = run(&query, TauQ, &forces) {
            let ydd = plan.want().slot(Ydd).map(|slot| slot.range()).unwrap_or_default();
            let ydd: Vec<Vec<f64>> = rows.iter().map(|row| row[ydd.clone()].to_vec()).collect();
            (states.plans[0], states.dynamics) = (Some(plan), Some(rows));
            let want = FieldSet::of(&[U, TauU]);
            let query = Query::new(Request::InverseDynamics, state.with(Ydd), want);
            if let Some((plan, rows)) = run(&query, Ydd, &ydd) {
                (states.plans[1], states.motors) = (Some(plan), Some(rows));
            }
        }
        states
    }

    /// A field at each sample; none where it is not known.
    fn rows(&self, field: Field) -> Vec<Vec<f64>> {
        let both = [(&self.plans[0], &self.dynamics), (&self.plans[1], &self.motors)];
        let of = |(plan, rows): (&Option<Plan>, &Option<Vec<Vec<f64>>>)| {
            let range = plan.as_ref()?.want().slot(field)?.range();
            Some(rows.as_ref()?.iter().map(|row| row[range.clone()].to_vec()).collect())
        };
        both.into_iter().find_map(of).unwrap_or_default()
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
