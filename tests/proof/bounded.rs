//! The work of a request is bounded: what the bound costs, counted in states.

use std::sync::Arc;

use sarrus_dynamics::{Batch, CUT_SHORT, Model, Plan, Workspace};
use sarrus_models::{Loaded, Options, Source, bundled, load};
use sarrus_proto::{Answer, Field, FieldSet, Query, QueryOptions, Request, Status, Warnings};
use sarrus_tests::seed::Seeded;

/// Random states of each robot; `SARRUS_STATES` sets another number, `SARRUS_ROBOTS` the robots
/// (names with spaces between them).
const STATES: usize = 300;

/// The answers of one query with and without a search, over one workspace.
struct Both<'a> {
    model: &'a Model<f64>,
    plans: [Plan; 2],
    workspace: Workspace<f64>,
    outputs: [Vec<f64>; 2],
}

impl<'a> Both<'a> {
    fn new(model: &'a Model<f64>, given: Field, want: &[Field]) -> Both<'a> {
        let query = Query::new(Request::Kinematics, FieldSet::of(&[given]), FieldSet::of(want));
        let plans = [query, query.with_options(QueryOptions::SEARCH)]
            .map(|query| Plan::new(model, &query).unwrap());
        let outputs = plans.each_ref().map(|plan| vec![0.0; plan.want().len()]);
        Both { model, plans, workspace: Workspace::new(model), outputs }
    }

    /// Both statuses; where both are `ok` they have the same bits.
    fn ask(&mut self, input: &[f64]) -> [Status; 2] {
        let mut answers = [Status::Ok; 2];
        for ((plan, output), status) in self.plans.iter().zip(&mut self.outputs).zip(&mut answers) {
            *status = plan.run(self.model, &mut self.workspace, input, output).status;
        }
        let bits = self.outputs.each_ref().map(|x| x.iter().map(|x| x.to_bits()));
        let [bounded, searched] = bits;
        if answers == [Status::Ok; 2] {
            assert!(bounded.eq(searched), "{}: {input:?}", self.model.name());
        }
        answers
    }
}

/// Random independents within the limits, those without limits within one turn.
fn random_y(loaded: &Loaded, seeded: &mut Seeded) -> Vec<f64> {
    let names = loaded.compiled.model.independent_names();
    let mut y = Vec::new();
    for name in names {
        if let Some(joint) = name.strip_suffix("/rx") {
            if names.contains(&format!("{joint}/tx")) {
                y.extend(seeded.vector(1.0));
            }
            let turn = seeded.numbers(4, 1.0);
            let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
            y.extend(turn.iter().map(|x| x / length));
        } else if !name.contains('/') {
            let joint = loaded.description.joints.iter().find(|joint| joint.name == *name);
            let limits = joint.and_then(|joint| joint.limits).map(|x| (x.lower, x.upper));
            let turn = (-core::f64::consts::PI, core::f64::consts::PI);
            let is_bounded = |(low, high): &(f64, f64)| low.is_finite() && high.is_finite();
            let (low, high) = limits.filter(is_bounded).unwrap_or(turn);
            y.push(seeded.within(low, high));
        }
    }
    y
}

#[test]
fn within_the_bound_every_reachable_state_of_the_bundled_robots_is_answered() {
    let states = std::env::var("SARRUS_STATES").ok().map_or(STATES, |n| n.parse().unwrap());
    let only = std::env::var("SARRUS_ROBOTS").ok();
    let is_asked = |name: &str| only.as_ref().is_none_or(|x| x.split(' ').any(|x| x == name));
    let mut table = String::new();
    let mut is_kept = true;
    for (name, _) in bundled().filter(|(name, _)| is_asked(name)) {
        let loaded = load(&Source::Bundled(name.into()), &Options::default()).unwrap();
        let model = &loaded.compiled.model;
        let bound = model.bound();
        assert!(bound.ns <= 500_000.0, "{name}: {bound:?}");
        let mut from_y = Both::new(model, Field::Y, &[Field::Q, Field::U, Field::Iterations]);
        let mut from_u = Both::new(model, Field::U, &[Field::Q]);
        let [u, iterations] = [Field::U, Field::Iterations]
            .map(|field| from_y.plans[0].want().slot(field).unwrap().range());
        let mut seeded = Seeded::new(name.len() as u64);
        // ok with a search, and of these not without it, from y and from u; iterations of a state
        let (mut ok, mut lost, mut most) = ([0, 0], [0, 0], 0.0_f64);
        let mut note = |k: usize, [bounded, searched]: [Status; 2], input: &[f64]| {
            if searched == Status::Ok && bounded != Status::Ok {
                println!("{name}: lost from {}: {input:?}", ["y", "u"][k]);
            }
            ok[k] += usize::from(searched == Status::Ok);
            lost[k] += usize::from(searched == Status::Ok && bounded != Status::Ok);
            // a bound that was met says so; any other status is that of the search
            let is_cut = bounded == Status::NotConverged;
            assert!(bounded == searched || is_cut, "{name}: {bounded:?} {searched:?}");
        };
        for _ in 0..states {
            let y = random_y(&loaded, &mut seeded);
            let statuses = from_y.ask(&y);
            note(0, statuses, &y);
            if statuses[0] == Status::Ok {
                most = most.max(from_y.outputs[0][iterations.start]);
                let given = from_y.outputs[0][u.clone()].to_vec();
                note(1, from_u.ask(&given), &given);
            }
        }
        let row = format!(
            "{name}: {states} states, ok {ok:?}, of these lost {lost:?}; {most} steps at most\n"
        );
        print!("{row}");
        table += &row;
        is_kept &= [0, 1].into_iter().all(|k| lost[k] * 100_000 <= ok[k]);
        assert!(most <= f64::from(bound.steps), "{name}: {most} {bound:?}");
    }
    assert!(is_kept, "more than 1 in 100,000 is lost from y or from u:\n{table}");
}

#[test]
fn a_state_that_no_loop_reaches_costs_no_more_than_the_bound() {
    // far outside every robot
    let mut cut = 0;
    for name in ["delta", "active_ankle", "wrist", "bricard", "rh5v2_full"] {
        let loaded = load(&Source::Bundled(name.into()), &Options::default()).unwrap();
        let model = &loaded.compiled.model;
        let mut both = Both::new(model, Field::Y, &[Field::Q, Field::NearestY]);
        let iterations = Both::new(model, Field::Y, &[Field::Q, Field::Iterations]);
        let [plan, _] = &iterations.plans;
        let mut seeded = Seeded::new(7);
        for _ in 0..20 {
            let y: Vec<f64> = random_y(&loaded, &mut seeded).iter().map(|y| 2.0 * y).collect();
            let [bounded, searched] = both.ask(&y);
            let [of_bounded, of_searched] = both.outputs.each_ref().map(|x| x[x.len() - 1]);
            let is_answer = bounded == Status::Ok;
            assert!(is_answer || of_bounded.is_nan(), "{name}: a nearest y without a search");
            cut += usize::from(bounded == Status::NotConverged && searched != bounded);
            if searched == Status::Unreachable {
                assert!(of_searched.is_finite(), "{name}: {y:?}");
            }
            let mut output = vec![0.0; plan.want().len()];
            let mut workspace = Workspace::new(model);
            let _ = plan.run(model, &mut workspace, &y, &mut output);
            let taken = output[output.len() - 1];
            assert!(taken.is_nan() || taken <= f64::from(model.bound().steps), "{name}: {taken}");
        }
    }
    assert!(cut > 0, "some state meets the bound");
}

#[test]
fn a_row_that_is_cut_short_takes_its_turn_once() {
    let mut robot = load(&Source::Bundled("delta".into()), &Options::default()).unwrap();
    let loops = robot.description.submechanisms.iter_mut();
    loops.for_each(|of| of.closed_forms = false);
    let model = Arc::new(Model::compile(&robot.description).unwrap().model);
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::Q.into());
    let plan = Plan::new(&model, &query).unwrap();
    let mut batch = Batch::new(&model, &plan);
    assert!(batch.lanes() > 1, "its rows are closed apart");
    let [good, long] = [[0.1, 0.1, 0.0], [-1.0, 0.5, -0.8]];
    for (before, rows) in [(0, [long, good, good, good]), (2, [good, good, long, good])] {
        let (plan, workspace) = batch.parts();
        workspace.answer_in_turns();
        let mut output = vec![0.0; rows.len() * plan.want().len()];
        let mut answers = [Answer { status: Status::Ok, warnings: Warnings::NONE }; 4];
        let done = workspace.run(plan, rows.as_flattened(), &mut output, &mut answers);
        assert_eq!((done, answers[before]), (before + 1, CUT_SHORT));
        assert!(workspace.is_cut(before) && plan.is_cut_short(workspace.one().1, CUT_SHORT.status));
        // its closure was not tried again alone
        assert_eq!(batch.alone(), 0);
    }
}
