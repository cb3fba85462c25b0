//! Fields of derivatives against duals over double-double along random directions, against each
//! other, and against a published linkage in fifty digits.

use sarrus_dynamics::scalar::{Dual, Real};
use sarrus_dynamics::{Axes, Field, FieldSet, Model, PlanScalar, Query, Request};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::dual::model;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{plus, product, times};

use crate::derivatives::moved;

use Field::*;

const OF_STATE: [Field; 4] = [Gd, DqddDy, DgBiasDyd, DjacobianDy];
const OF_FORCES: [Field; 6] =
    [DtauYDy, DtauYDyd, DtauUDy, DtauUDyd, DtauUnactuatedDy, DtauUnactuatedDyd];
const OF_ACCELERATIONS: [Field; 3] = [DyddDy, DyddDyd, DyddDtauU];

/// One state with random wrenches, its motion over any scalar, and a way to ask at it.
struct Asked<'a, S: PlanScalar> {
    case: &'a Case,
    robot: Robot<S>,
    links: Vec<u16>,
    axes: (Axes, Option<u16>),
    wrenches: Vec<f64>,
}

impl<S: PlanScalar> Asked<'_, S> {
    fn ask(
        &mut self,
        request: Request,
        (state, q): (&State<S>, Option<&[S]>),
        force: Option<(Field, &[S])>,
        want: &[Field],
    ) -> Fields<S> {
        let wrenches: Vec<S> = self.wrenches.iter().map(|x| S::from_f64(*x)).collect();
        let mut given = vec![(Y, state.y.as_slice()), (Yd, &state.yd)];
        let mut base = Query::new(request, FieldSet::EMPTY, FieldSet::of(want))
            .with_frames(&self.links)
            .with_axes(self.axes.0);
        if let Some(link) = self.axes.1 {
            base = base.relative_to(link);
        }
        if request != Request::ForwardDynamics {
            given.push((Ydd, &state.ydd));
        }
        if request != Request::Kinematics {
            base = base.with_wrenches(&self.links[..self.links.len().min(2)]);
            given.push((Wrenches, &wrenches));
        }
        given.extend(force);
        given.extend(q.map(|q| (QGuess, q)));
        self.robot.ask_for(base, &given).ok()
    }
}

fn asked<S: PlanScalar>(case: &Case, model: Model<S>, k: u64) -> Asked<'_, S> {
    let mut seeded = Seeded::new(case.seed ^ 0xd1ff);
    let count = model.link_names().len();
    let of = |part: usize| (count * part / 4).min(count - 1) as u16;
    let mut links: Vec<u16> = [2, 4, 1].map(of).to_vec();
    links.dedup();
    let wrenches = (0..2).flat_map(|_| [seeded.vector(2.0), seeded.vector(9.0)].concat());
    let wrenches = wrenches.take(6 * links.len().min(2)).collect();
    let axes = match k % 4 {
        0 => (Axes::Mixed, None),
        1 => (Axes::World, None),
        2 => (Axes::Local, Some(of(3))),
        _ => (Axes::World, Some(of(3))),
    };
    Asked { case, robot: Robot::new(model), links, axes, wrenches }
}

/// The state, displaced by a direction of y and one of ẏ.
fn displaced<S: PlanScalar>(
    case: &Case,
    state: &State<S>,
    [along_y, along_yd]: [&[S]; 2],
) -> State<Dual<S>> {
    let constants = |x: &[S]| -> Vec<Dual<S>> { x.iter().map(|x| Dual::constant(*x)).collect() };
    let step = Dual::new(S::ZERO, S::ONE);
    State {
        y: moved(case, &constants(&state.y), &constants(along_y), step),
        yd: plus(&constants(&state.yd), &times(step, &constants(along_yd))),
        ydd: constants(&state.ydd),
    }
}

fn slopes<S: PlanScalar>(x: &[Dual<S>]) -> Vec<S> {
    x.iter().map(|x| x.du).collect()
}

/// Every derivative times a direction against the dual along it.
fn compare_on<S: PlanScalar>(case: &Case, plain: &Model<S>, k: u64, ledger: &mut Ledger) {
    let mut at = asked(case, plain.clone(), k);
    let mut over_duals = asked(case, model(plain), k);
    let n = plain.sizes().n_vy;
    let state = case.state::<S>(k);
    let mut seeded = Seeded::new(case.seed ^ 0xde51 ^ k);
    let mut direction =
        |n: usize| -> Vec<S> { (0..n).map(|_| S::from_f64(seeded.within(-1.0, 1.0))).collect() };
    let (y, yd) = (direction(n), direction(n));
    let tau = direction(plain.sizes().n_u);
    let none = vec![S::ZERO; n];

    let both = [&OF_STATE[..], &[Q, CondKd]].concat();
    let x = at.ask(Request::Kinematics, (&state, None), None, &both);
    let cond = x.get(CondKd)[0].to_f64();
    let allowed = 1e4 * S::EPSILON * cond.powi(3) + case.contradiction();
    let q = x.get(Q).to_vec();
    let mut along = |request, directions: [&[S]; 2], force: Option<(Field, &[Dual<S>])>, want| {
        let state = displaced(case, &state, directions);
        let mut q: Vec<Dual<S>> = q.iter().map(|x| Dual::constant(*x)).collect();
        for _ in 0..2 {
            let near = (&state, Some(q.as_slice()));
            q = over_duals.ask(Request::Kinematics, near, None, &[Q]).get(Q).to_vec();
        }
        over_duals.ask(request, (&state, Some(&q)), force, want)
    };
    let mut check = |what: &str, a: &[S], b: &[S], size: f64| {
        ledger.compare(what, case, a, b, size.max(largest(a)), allowed);
    };

    let by_y = along(Request::Kinematics, [&y, &none], None, &[Qdd, FrameTwist]);
    let by_yd = along(Request::Kinematics, [&none, &yd], None, &[GBias]);
    let moving = along(Request::Kinematics, [&state.yd, &none], None, &[G]);
    check("Ġ", x.get(Gd), &slopes(moving.get(G)), 1.0);
    check("∂q̈/∂y", &product(x.get(DqddDy), &y), &slopes(by_y.get(Qdd)), 1.0);
    check("∂g/∂ẏ", &product(x.get(DgBiasDyd), &yd), &slopes(by_yd.get(GBias)), 1.0);
    let twists = slopes(by_y.get(FrameTwist));
    check("∂(J ẏ)/∂y", &product(x.get(DjacobianDy), &y), &twists, 1.0);

    let inverse = Request::InverseDynamics;
    let forces = [TauY, TauU, TauUnactuated];
    let x = at.ask(inverse, (&state, None), None, &[&OF_FORCES[..], &forces].concat());
    let size = largest(x.get(TauY)).max(1.0);
    let by_y = along(inverse, [&y, &none], None, &forces);
    let by_yd = along(inverse, [&none, &yd], None, &forces);
    for (value, [of_y, of_yd]) in forces.into_iter().zip([
        [DtauYDy, DtauYDyd],
        [DtauUDy, DtauUDyd],
        [DtauUnactuatedDy, DtauUnactuatedDyd],
    ]) {
        let name = value.name();
        check(&format!("∂{name}/∂y"), &product(x.get(of_y), &y), &slopes(by_y.get(value)), size);
        let of_yd = product(x.get(of_yd), &yd);
        check(&format!("∂{name}/∂ẏ"), &of_yd, &slopes(by_yd.get(value)), size);
    }

    let forward = Request::ForwardDynamics;
    for (force, numbers) in [(TauU, x.get(TauU)), (TauY, x.get(TauY))] {
        let given = Some((force, numbers));
        let x = at.ask(forward, (&state, None), given, &[&OF_ACCELERATIONS[..], &[Ydd]].concat());
        let size = largest(x.get(Ydd)).max(1.0);
        let held: Vec<Dual<S>> = numbers.iter().map(|x| Dual::constant(*x)).collect();
        let by_y = along(forward, [&y, &none], Some((force, &held)), &[Ydd]);
        let by_yd = along(forward, [&none, &yd], Some((force, &held)), &[Ydd]);
        let name = force.name();
        let of_y = product(x.get(DyddDy), &y);
        check(&format!("∂ÿ/∂y at {name}"), &of_y, &slopes(by_y.get(Ydd)), size);
        let of_yd = product(x.get(DyddDyd), &yd);
        check(&format!("∂ÿ/∂ẏ at {name}"), &of_yd, &slopes(by_yd.get(Ydd)), size);
        if force == TauU {
            let pushed: Vec<Dual<S>> =
                numbers.iter().zip(&tau).map(|(x, d)| Dual::new(*x, *d)).collect();
            let pushed = along(forward, [&none, &none], Some((force, &pushed)), &[Ydd]);
            let of_tau = product(x.get(DyddDtauU), &tau);
            check("∂ÿ/∂τ_u", &of_tau, &slopes(pushed.get(Ydd)), size);
        }
    }
}

#[test]
fn derivatives_are_those_of_duals_over_double_double() {
    Ledger::over(robots(), |case, ledger| {
        for k in 0..2 {
            compare_on(case, &case.compiled.exact, 2 * k + case.seed % 2, ledger);
        }
    });
}
