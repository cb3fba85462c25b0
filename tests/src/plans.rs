//! Every kind of request on a model, with inputs for it.

use std::sync::OnceLock;

use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Field, FieldSet, Model, Plan, PlanScalar, Query, Request};

use crate::cases::{Case, State};
use crate::run::{Fields, Robot};
use crate::seed::Seeded;

/// Plans of every request from every space, each for all fields at once and for each field alone,
/// with frames and wrenches on some links.
pub fn every_plan<T: Real>(model: &Model<T>, seeded: &mut Seeded) -> Vec<Plan> {
    let of = |(request, given): (Request, Vec<Field>)| plans(model, request, &given, seeded);
    questions().into_iter().flat_map(of).collect()
}

/// The plans of [`every_plan`] from this many requests and spaces, drawn by chance: most of the
/// thousands of queries on a robot are refused, which takes longer than to answer the others.
pub fn some_plans<T: Real>(model: &Model<T>, seeded: &mut Seeded, count: usize) -> Vec<Plan> {
    let questions = questions();
    let mut drawn = Vec::new();
    let mut found = 0;
    // a question may have no plan on the robot
    while found < count {
        let (request, given) = &questions[seeded.below(questions.len())];
        let mut plans = plans(model, *request, given, seeded);
        found += usize::from(!plans.is_empty());
        drawn.append(&mut plans);
    }
    drawn
}

/// Every request with all that may be given for it.
fn questions() -> Vec<(Request, Vec<Field>)> {
    let of = |request: Request| givens(request).into_iter().map(move |given| (request, given));
    Request::ALL.iter().copied().flat_map(of).collect()
}

fn plans<T: Real>(
    model: &Model<T>,
    request: Request,
    given: &[Field],
    seeded: &mut Seeded,
) -> Vec<Plan> {
    use Field::*;
    let mut link = || seeded.below(model.link_names().len()) as u16;
    let base =
        Query::new(request, FieldSet::of(given), FieldSet::EMPTY).with_frames(&[link(), link()]);
    let base = match given.contains(&Wrenches) {
        true => base.with_wrenches(&[link(), link()]),
        false => base,
    };
    // they are slow to find among many parameters
    let is_quick = |field: &&Field| **field != BaseParameters || model.sizes().n_parameters() < 50;
    let single: Vec<Plan> = Field::ALL
        .iter()
        .filter(is_quick)
        .filter_map(|field| with(model, base, FieldSet::of(&[*field])))
        .collect();
    let all =
        single.iter().fold(FieldSet::EMPTY, |all, plan| FieldSet(all.0 | plan.query().want.0));
    let without = FieldSet(all.0 & !FieldSet::of(&[JacobianActuator, TauU]).0);
    let together = [with(model, base, all), with(model, base, without)];
    together.into_iter().flatten().chain(single).collect()
}

fn with<T: Real>(model: &Model<T>, mut query: Query, want: FieldSet) -> Option<Plan> {
    query.want = want;
    Plan::new(model, &query).ok()
}

fn givens(request: Request) -> Vec<Vec<Field>> {
    use Field::*;
    let motions = [
        vec![Y, Yd, Ydd],
        vec![U, Ud, Udd],
        vec![Q, Qd, Qdd],
        vec![Y],
        // accelerations from rest
        vec![Y, Ydd],
        vec![U, Udd],
        vec![Q, Qdd],
        vec![Y, Yd, Ydd, QGuess, QdGuess],
        vec![Y, Ud, Udd],
    ];
    match request {
        Request::InverseDynamics => motions
            .iter()
            .cloned()
            .chain(motions.iter().map(|of| of.iter().copied().chain([Wrenches]).collect()))
            .chain([vec![Y, Yd, Ydd, Wrenches, Direction], vec![Y, Direction, Multipliers]])
            .collect(),
        Request::ForwardDynamics => vec![
            vec![Y, Yd, TauU],
            vec![Y, Yd, TauY],
            vec![Q, Qd, TauQ],
            vec![U, Ud, TauU],
            vec![Y, TauU],
            vec![Y, Yd, QGuess, TauU, Wrenches],
            vec![Y, TauU, Direction],
            vec![Y, Yd, TauU, Direction, Multipliers],
        ],
        Request::Map => {
            motions.into_iter().chain([vec![Y, TauU], vec![Y, TauY], vec![Y, TauQ]]).collect()
        }
        Request::Observe => vec![
            vec![Y, Yd, TauU, Dt, Gain],
            vec![Q, Qd, TauY, Wrenches, Dt, Gain, Observer],
            vec![Y, Yd, QGuess, TauU, Dt, Gain, Observer],
        ],
        _ => motions.to_vec(),
    }
}

/// The motion at a state in every space, from which [`input`] takes its numbers.
pub fn motion<T: PlanScalar>(robot: &mut Robot<T>, state: &State<T>) -> Fields<T> {
    use Field::*;
    let given = [(Y, state.y.as_slice()), (Yd, &state.yd), (Ydd, &state.ydd)];
    robot.ask(Request::Kinematics, &given, &[Y, Yd, Ydd, Q, Qd, Qdd, U, Ud, Udd])
}

/// Input of a plan at a motion.
pub fn input<T: PlanScalar>(
    case: &Case,
    plan: &Plan,
    motion: &Fields<T>,
    seeded: &mut Seeded,
) -> Vec<T> {
    use Field::*;
    let mut input = vec![T::ZERO; plan.given().len()];
    for slot in plan.given().slots() {
        let to = &mut input[slot.range()];
        match slot.field {
            QGuess => to.copy_from_slice(motion.get(Q)),
            QdGuess => to.copy_from_slice(motion.get(Qd)),
            Dt | Gain | Direction | Multipliers => {
                to.fill_with(|| T::from_f64(seeded.within(0.0, 1.0)))
            }
            TauQ | TauY | TauU | Wrenches | Observer => {
                to.fill_with(|| T::from_f64(seeded.within(-1.0, 1.0) * case.scale.powi(4) * 100.0))
            }
            field => to.copy_from_slice(motion.get(field)),
        }
    }
    input
}

/// True for a plan of several fields, and for one in `n` of the plans of one field, which differ
/// from it by the steps that they leave out: each has its turn on every n-th robot. With
/// `SARRUS_THOROUGH` all plans are taken.
pub fn has_turn(plan: &Plan, number: usize, n: usize) -> bool {
    static THOROUGH: OnceLock<bool> = OnceLock::new();
    plan.query().want.iter().count() > 1
        || number.is_multiple_of(n)
        || *THOROUGH.get_or_init(|| std::env::var_os("SARRUS_THOROUGH").is_some())
}
