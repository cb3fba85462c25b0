//! A robot with locked joints or without some branches, against the whole robot at the same pose
//! and motion: state, frames, Jacobians and inverse dynamics; forward dynamics through the inverse
//! dynamics of the whole robot at the resulting accelerations.

mod cases;
mod faults;

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Lock, Model, Query, Reduced, Request, locked};
use sarrus_tests::cases::{Case, Ledger, State};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use Field::*;

/// Links with compared frames and with wrenches.
const LINKS: usize = 4;
/// Bound at condition 1: rounding; the whole robot's double-double answer contributes the least.
const SHARE: f64 = 64.0 * f64::EPSILON;

/// Index in `within` of each name of `of`.
fn places(of: &[String], within: &[String]) -> Vec<usize> {
    let place = |name: &String| within.iter().position(|other| other == name);
    of.iter().map(|name| place(name).unwrap_or_else(|| panic!("no {name}"))).collect()
}

/// The joint of a name.
fn joint(case: &Case, name: &str) -> usize {
    case.description.joints.iter().position(|joint| joint.name == name).unwrap()
}

/// A random position within the reach of an independent joint of one degree of freedom.
fn position(case: &Case, name: &str, seeded: &mut Seeded) -> f64 {
    let at = case.compiled.model.independent_names().iter().position(|other| other == name);
    at.map_or(0.0, |at| seeded.within(-1.0, 1.0) * case.reach[at])
}

/// Names of the independent joints of one degree of freedom.
fn independents(case: &Case) -> Vec<String> {
    let names = case.compiled.model.independent_names().iter();
    names.filter(|name| !name.contains("/r") && !name.contains("/t")).cloned().collect()
}

/// The reduced robot, the whole one, and the values of the locked joints.
struct Pair<'a> {
    case: &'a Case,
    whole: Robot<Dd>,
    small: Robot<f64>,
    reduced: &'a Reduced,
    held: Vec<(String, f64)>,
    /// Number of compared states.
    compared: u64,
}

impl<'a> Pair<'a> {
    /// Compiles the reduced robot.
    fn new(case: &'a Case, reduced: &'a Reduced, held: &[(String, f64)]) -> Pair<'a> {
        let small = Model::compile(&reduced.description)
            .unwrap_or_else(|error| panic!("{} with {held:?}: {error}", case.name));
        let whole = Robot::new(case.compiled.exact.clone());
        Pair {
            case,
            whole,
            small: Robot::new(small.model),
            reduced,
            held: held.to_vec(),
            compared: 0,
        }
    }

    /// Locks joints of a robot by name.
    fn locked(case: &'a Case, held: &[(String, f64)]) -> Reduced {
        let lock = |(name, x): &(String, f64)| Lock {
            joint: joint(case, name),
            position: (*x != 0.0).then_some(*x),
        };
        let locks: Vec<Lock> = held.iter().map(lock).collect();
        locked(&case.description, &locks)
            .unwrap_or_else(|error| panic!("{} with {held:?}: {error}", case.name))
    }

    /// A state of the whole robot at the locked values, and the one of the reduced robot.
    fn states(&self, k: u64) -> (State<Dd>, State<f64>) {
        let mut whole = self.case.state::<f64>(k);
        let model = &self.whole.model;
        let small = &self.small.model;
        let mut kept = vec![false; whole.yd.len()];
        places(small.independent_names(), model.independent_names())
            .into_iter()
            .for_each(|v| kept[v] = true);
        for (v, _) in kept.iter().enumerate().filter(|(_, kept)| !**kept) {
            (whole.yd[v], whole.ydd[v]) = (0.0, 0.0);
        }
        let of_q = places(small.independent_q_names(), model.independent_q_names());
        for (e, name) in model.independent_q_names().iter().enumerate() {
            if of_q.contains(&e) {
                continue;
            }
            let held = self.held.iter().find(|(held, _)| held == name);
            whole.y[e] = held.map_or(f64::from(name.ends_with("/qw")), |(_, x)| *x);
        }
        let of_v = places(small.independent_names(), model.independent_names());
        let pick = |of: &[f64], at: &[usize]| at.iter().map(|i| of[*i]).collect();
        let small = State {
            y: pick(&whole.y, &of_q),
            yd: pick(&whole.yd, &of_v),
            ydd: pick(&whole.ydd, &of_v),
        };
        let exact = |of: &[f64]| of.iter().map(|x| Dd::from(*x)).collect();
        (State { y: exact(&whole.y), yd: exact(&whole.yd), ydd: exact(&whole.ydd) }, small)
    }

    /// Compares some states.
    fn compare(&mut self, ledger: &mut Ledger, states: u64) {
        for k in 0..states {
            let (whole, small) = self.states(k);
            self.compare_state(ledger, &whole, &small, k);
        }
    }

    fn compare_state(
        &mut self,
        ledger: &mut Ledger,
        at: &State<Dd>,
        small_at: &State<f64>,
        k: u64,
    ) {
        let case = self.case;
        let mut seeded = Seeded::new(case.seed + k);
        let n_links = self.reduced.links.len();
        let some: Vec<usize> = (0..LINKS).map(|_| seeded.below(n_links)).collect();
        let links: Vec<u16> = some.iter().map(|l| *l as u16).collect();
        let there: Vec<u16> = some.iter().map(|l| self.reduced.links[*l] as u16).collect();
        let small = &mut self.small;
        let whole = &mut self.whole;

        // state
        let want =
            [Q, Qd, Qdd, U, Ud, Udd, FramePose, FrameTwist, FrameAcc, JacobianIndependent, CondKd];
        let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&want));
        let given = [(Y, at.y.as_slice()), (Yd, &at.yd), (Ydd, &at.ydd)];
        let small_given = [(Y, small_at.y.as_slice()), (Yd, &small_at.yd), (Ydd, &small_at.ydd)];
        let reference = whole.ask_for(query.with_frames(&there), &given);
        let mine = small.ask_for(query.with_frames(&links), &small_given);
        // a state that the whole robot does not reach is skipped
        if reference.answer.status != sarrus_dynamics::Status::Ok {
            return;
        }
        self.compared += 1;
        let mine = mine.ok();
        let K_d = mine.get(CondKd)[0].max(reference.get(CondKd)[0].to_f64());
        let share = SHARE + case.contradiction();
        let names = |model: &Model<f64>, field| match field {
            Q => model.tree_q_names().to_vec(),
            Qd | Qdd => model.tree_names().to_vec(),
            _ => model.active_names().to_vec(),
        };
        let speed = largest(reference.get(Qd)).max(1.0);
        for field in [Q, Qd, Qdd, U, Ud, Udd] {
            let at = places(&names(&small.model, field), &names(&case.compiled.model, field));
            let reference = pick(reference.get(field), &at);
            let power = if matches!(field, Q | U | Qd | Ud) { K_d } else { K_d * K_d };
            let error = error_by_size(mine.get(field), &reference, speed * speed);
            ledger.note(field.name(), case, error, share * power);
        }
        for field in [FramePose, FrameTwist, FrameAcc] {
            let reference: Vec<f64> = reference.get(field).iter().map(|x| x.to_f64()).collect();
            let mine = one_sense(field, mine.get(field), &reference);
            let error = error_by_size(&mine, &reference, speed * speed);
            ledger.note(field.name(), case, error, share * K_d * K_d);
        }
        let vy = places(small.model.independent_names(), case.compiled.model.independent_names());
        let n = case.compiled.model.sizes().n_vy;
        let columns: Vec<f64> = (reference.get(JacobianIndependent).chunks_exact(n.max(1)))
            .flat_map(|row| vy.iter().map(|v| row[*v].to_f64()))
            .collect();
        let error = error_by_size(mine.get(JacobianIndependent), &columns, 1.0);
        ledger.note("jacobian_independent", case, error, share * K_d);

        // inverse dynamics with wrenches; forces of the remaining independents
        let query = Query::new(
            Request::InverseDynamics,
            FieldSet::EMPTY,
            FieldSet::of(&[TauY, MY, CY, TauQ]),
        );
        let size = case.scale.powi(4) * 100.0;
        let wrenches = seeded.numbers(6 * LINKS, size);
        let exact: Vec<Dd> = wrenches.iter().map(|x| Dd::from(*x)).collect();
        let reference = whole
            .ask_for(
                query.with_wrenches(&there),
                &[given[0], given[1], given[2], (Wrenches, &exact)],
            )
            .ok();
        let mine = small
            .ask_for(
                query.with_wrenches(&links),
                &[small_given[0], small_given[1], small_given[2], (Wrenches, &wrenches)],
            )
            .ok();
        let forces = pick(reference.get(TauY), &vy);
        let force = largest(reference.get(TauQ)).max(size);
        let error = error_by_size(mine.get(TauY), &forces, force);
        ledger.note("tau_y", case, error, share * K_d * K_d);

        // forward dynamics: the whole robot needs the given forces for these accelerations
        let tau = seeded.numbers(vy.len(), force);
        let forward = small.ask(
            Request::ForwardDynamics,
            &[small_given[0], small_given[1], (TauY, &tau)],
            &[Ydd],
        );
        if forward.answer.status == sarrus_dynamics::Status::MassNotPositive {
            return;
        }
        let forward = forward.ok();
        let mut ydd = vec![Dd::from(0.0); n];
        vy.iter().zip(forward.get(Ydd)).for_each(|(v, x)| ydd[*v] = Dd::from(*x));
        let back = whole.ask(Request::InverseDynamics, &[given[0], given[1], (Ydd, &ydd)], &[TauY]);
        let back = pick(back.ok().get(TauY), &vy);
        // by backward error
        let all = largest(mine.get(MY)) * largest(forward.get(Ydd)) * vy.len() as f64
            + largest(mine.get(CY))
            + largest(&tau);
        let error = error_by_size(&back, &tau, all);
        ledger.note("forward dynamics", case, error, share * K_d * K_d);
    }
}

/// Some numbers, rounded once.
fn pick(of: &[Dd], at: &[usize]) -> Vec<f64> {
    at.iter().map(|i| of[*i].to_f64()).collect()
}

/// Poses with quaternions of the reference's sign.
fn one_sense(field: Field, mine: &[f64], reference: &[f64]) -> Vec<f64> {
    let mut mine = mine.to_vec();
    if field == FramePose {
        for (pose, reference) in mine.chunks_exact_mut(7).zip(reference.chunks_exact(7)) {
            let dot: f64 = pose[3..].iter().zip(&reference[3..]).map(|(a, b)| a * b).sum();
            pose[3..].iter_mut().for_each(|x| *x *= dot.signum());
        }
    }
    mine
}

/// Sizes for messages.
fn sizes(fields: &Model<f64>) -> [usize; 3] {
    let sizes = fields.sizes();
    [sizes.n_v, sizes.n_vy, sizes.n_c]
}
