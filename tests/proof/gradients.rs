//! Fields of derivatives against duals over double-double along random directions, against each
//! other, and against a published linkage in fifty digits.

use std::sync::atomic::{AtomicUsize, Ordering};

use sarrus_dynamics::description::{Inertial, SubmechanismKind};
use sarrus_dynamics::scalar::{Dd, Dual, Real};
use sarrus_dynamics::{
    Axes, CutJoint, DescriptionBuilder, Field, FieldSet, LinkId, Model, PlanScalar, Query, Request,
    Status, Warnings,
};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::{assert_close, error_by_size, largest};
use sarrus_tests::dual::model;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{matrix_product, plus, product, times};

use crate::derivatives::moved;

use Field::*;

const OF_STATE: [Field; 4] = [Gd, DqddDy, DgBiasDyd, DjacobianDy];
const OF_FORCES: [Field; 6] =
    [DtauYDy, DtauYDyd, DtauUDy, DtauUDyd, DtauUnactuatedDy, DtauUnactuatedDyd];
const OF_ACCELERATIONS: [Field; 3] = [DyddDy, DyddDyd, DyddDtauU];

/// One state with random wrenches, its motion over any scalar, and a way to ask at it.
struct Asked<S: PlanScalar> {
    robot: Robot<S>,
    links: Vec<u16>,
    axes: (Axes, Option<u16>),
    wrenches: Vec<f64>,
    /// Of second derivatives, where some are asked for.
    direction: Vec<f64>,
}

impl<S: PlanScalar> Asked<S> {
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
        let direction: Vec<S> = self.direction.iter().map(|x| S::from_f64(*x)).collect();
        if !direction.is_empty() {
            given.push((Direction, &direction));
        }
        given.extend(force);
        given.extend(q.map(|q| (QGuess, q)));
        self.robot.ask_for(base, &given).ok()
    }
}

fn asked<S: PlanScalar>(case: &Case, model: Model<S>, k: u64) -> Asked<S> {
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
    Asked { robot: Robot::new(model), links, axes, wrenches, direction: Vec::new() }
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
    let y = direction(n);
    let yd = direction(n);
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

/// The derivatives of double keep their digits, or their answer warns; and they agree with M_y.
#[test]
fn derivatives_in_double_keep_twelve_digits_or_warn() {
    Ledger::over(robots(), |case, ledger| {
        let k = 3 - case.seed % 2;
        let mut robots = (
            asked(case, case.compiled.model.clone(), 0),
            asked(case, case.compiled.exact.clone(), 0),
        );
        let state = case.state::<f64>(k);
        let exact = case.state::<Dd>(k);
        let inverse = Request::InverseDynamics;
        let tau = robots.0.ask(inverse, (&state, None), None, &[TauY]).get(TauY).to_vec();
        let tau_exact: Vec<Dd> = tau.iter().map(|x| Dd::from(*x)).collect();
        // the first field has the error that the others may have a hundred times
        for (request, force, want) in [
            (Request::Kinematics, false, [&[Qdd], &OF_STATE[..]].concat()),
            (inverse, false, [&[TauY], &OF_FORCES[..]].concat()),
            (Request::ForwardDynamics, true, [&[Ydd], &OF_ACCELERATIONS[..]].concat()),
        ] {
            let given = force.then_some((TauY, tau.as_slice()));
            let x = robots.0.ask(request, (&state, None), given, &want);
            let given = force.then_some((TauY, tau_exact.as_slice()));
            let y = robots.1.ask(request, (&exact, None), given, &want);
            if x.answer.warnings.contains(Warnings::ILL_CONDITIONED) {
                continue;
            }
            let mut of_first = None;
            for field in &want {
                let b: Vec<f64> = y.get(*field).iter().map(|x| x.to_f64()).collect();
                let least = if request == Request::Kinematics { 1.0 } else { 1e-3 };
                let error = error_by_size(x.get(*field), &b, least);
                let first = *of_first.get_or_insert(error);
                let allowed = f64::max(1e-12, 100.0 * first) + case.contradiction();
                ledger.note(&format!("{} in double", field.name()), case, error, allowed);
            }
        }
    });
}

/// Against duals over double-double of the first ones along the same direction.
#[test]
fn second_derivatives_in_double_keep_twelve_digits_or_warn() {
    let answered = AtomicUsize::new(0);
    Ledger::over(robots(), |case, ledger| {
        let plain = &case.compiled.model;
        let n = plain.sizes().n_vy;
        let k = 2 + case.seed % 2;
        let mut at = asked(case, plain.clone(), 0);
        let mut over_duals = asked(case, model(&case.compiled.exact), 0);
        let state = case.state::<f64>(k);
        let exact = case.state::<Dd>(k);
        let tau =
            at.ask(Request::InverseDynamics, (&state, None), None, &[TauU]).get(TauU).to_vec();
        let x = at.ask(Request::Kinematics, (&state, None), None, &[Q]);
        let mut seeded = Seeded::new(case.seed ^ 0x2d);
        at.direction = (0..2 * n + tau.len()).map(|_| seeded.within(-1.0, 1.0)).collect();
        let v: Vec<Dd> = at.direction.iter().map(|x| Dd::from(*x)).collect();
        let displaced = displaced(case, &exact, [&v[..n], &v[n..2 * n]]);
        let pushed: Vec<Dual<Dd>> =
            tau.iter().zip(&v[2 * n..]).map(|(x, d)| Dual::new(Dd::from(*x), *d)).collect();
        let mut q: Vec<Dual<Dd>> = x.get(Q).iter().map(|x| Dual::constant(Dd::from(*x))).collect();
        for _ in 0..3 {
            let near = (&displaced, Some(q.as_slice()));
            q = over_duals.ask(Request::Kinematics, near, None, &[Q]).get(Q).to_vec();
        }
        for (request, force, value, second, first) in [
            (Request::InverseDynamics, false, TauY, D2TauYV, &[DtauYDy, DtauYDyd][..]),
            (Request::ForwardDynamics, true, Ydd, D2YddV, &OF_ACCELERATIONS),
        ] {
            let given = force.then_some((TauU, tau.as_slice()));
            let x = at.ask(request, (&state, None), given, &[value, second]);
            if x.answer.warnings.contains(Warnings::ILL_CONDITIONED) {
                continue;
            }
            answered.fetch_add(1, Ordering::Relaxed);
            let given = force.then_some((TauU, pushed.as_slice()));
            let wanted = [first, &[value]].concat();
            let y = over_duals.ask(request, (&displaced, Some(&q)), given, &wanted);
            let of_value: Vec<f64> = y.get(value).iter().map(|x| x.to_f64()).collect();
            let of_first = error_by_size(x.get(value), &of_value, 1e-3);
            let mut b = Vec::new();
            for row in 0..n {
                for field in first {
                    let columns = y.get(*field).len() / n;
                    let row = &y.get(*field)[row * columns..(row + 1) * columns];
                    b.extend(row.iter().map(|x| x.du.to_f64()));
                }
            }
            let error = error_by_size(x.get(second), &b, 1e-3);
            let allowed = f64::max(1e-12, 100.0 * of_first) + case.contradiction();
            ledger.note(second.name(), case, error, allowed);
        }
    });
    let answered = answered.into_inner();
    println!("{answered} of {} answers without a warning", 2 * robots().len());
    assert!(answered > robots().len());
}

/// A sum over the rows is the sum of the rows; without ẏ the numbers are those of ẏ = 0; a missing
/// number and one that is none have their reasons.
#[test]
fn second_derivatives_come_as_matrix_or_with_multipliers() {
    let case = Case::bundled("torso");
    let mut robot = Robot::new(case.compiled.model.clone());
    let state = case.state::<f64>(1);
    let n = state.yd.len();
    let still = vec![0.0; n];
    let v: Vec<f64> = (0..3 * n).map(|k| (k as f64).cos()).collect();
    let mu: Vec<f64> = (0..n).map(|k| 1.0 + k as f64).collect();
    let given: [(Field, &[f64]); 3] = [(Y, &state.y), (Direction, &v), (Multipliers, &mu)];
    for (request, field, tau) in [
        (Request::InverseDynamics, D2TauYV, None),
        (Request::ForwardDynamics, D2YddV, Some((TauU, still.as_slice()))),
    ] {
        let given: Vec<(Field, &[f64])> = given.into_iter().chain(tau).collect();
        let without: Vec<(Field, &[f64])> =
            given.iter().copied().filter(|(field, _)| *field != Multipliers).collect();
        let sum = robot.ask(request, &given, &[field]).ok();
        let whole = robot.ask(request, &without, &[field, Q]).ok();
        let columns = sum.get(field).len();
        assert_eq!(whole.get(field).len(), n * columns);
        let back: Vec<f64> = (0..columns)
            .map(|c| (0..n).map(|r| mu[r] * whole.get(field)[r * columns + c]).sum())
            .collect();
        assert_close(field.name(), sum.get(field), &back, 1e-3, 1e-14);
        let stands: Vec<(Field, &[f64])> =
            without.iter().copied().chain([(Yd, still.as_slice())]).collect();
        let stands = robot.ask(request, &stands, &[field]).ok();
        assert_eq!(stands.get(field), whole.get(field));
        let nan = vec![f64::NAN; 3 * n];
        let spoilt: Vec<(Field, &[f64])> = without
            .iter()
            .map(|(field, x)| (*field, if *field == Direction { nan.as_slice() } else { *x }))
            .collect();
        let spoilt = robot.ask(request, &spoilt, &[field]);
        assert_eq!(spoilt.answer.status, Status::NonFiniteInput);
        assert!(spoilt.get(field).iter().all(|x| x.is_nan()));
        let info = case.compiled.model.info();
        let missing = [
            FieldSet::of(&[Y, TauU]),
            FieldSet::of(&[Q, Direction, TauU]),
            FieldSet::of(&[Y, Direction, TauY]),
        ];
        for given in missing {
            let given = given.iter().filter(|field| *field < TauQ || tau.is_some()).collect();
            let query = Query::new(request, given, FieldSet::of(&[field]));
            let is_fine = tau.is_none() && given.has(Y) && given.has(Direction);
            assert_eq!(query.check(info).is_ok(), is_fine, "{query:?}");
        }
    }
}

/// M ∂ÿ/∂y = −∂τ_y/∂y and M ∂ÿ/∂ẏ = −∂τ_y/∂ẏ at fixed τ_y; M ∂ÿ/∂τ_u = G_uᵀ.
#[test]
fn derivatives_of_inverse_and_forward_dynamics_are_inverse_to_each_other() {
    Ledger::over(robots(), |case, ledger| {
        let mut at = asked(case, case.compiled.exact.clone(), 0);
        let n = at.robot.model.sizes().n_vy;
        let n_u = at.robot.model.sizes().n_u;
        let mut state = case.state::<Dd>(1);
        let inverse = Request::InverseDynamics;
        let tau = at.ask(inverse, (&state, None), None, &[TauY]).get(TauY).to_vec();
        let want = [&OF_ACCELERATIONS[..], &[Ydd]].concat();
        let x = at.ask(Request::ForwardDynamics, (&state, None), Some((TauY, &tau)), &want);
        state.ydd = x.get(Ydd).to_vec();
        let y = at.ask(inverse, (&state, None), None, &[MY, GU, CondKd, CondMy, DtauYDy, DtauYDyd]);
        let allowed =
            1e4 * Dd::EPSILON * y.get(CondKd)[0].to_f64().powi(3) * y.get(CondMy)[0].to_f64()
                + case.contradiction();
        for (of_ydd, of_tau) in [(DyddDy, DtauYDy), (DyddDyd, DtauYDyd)] {
            let back = matrix_product(y.get(MY), x.get(of_ydd), n, n);
            let minus = times(-Dd::ONE, y.get(of_tau));
            ledger.compare(of_ydd.name(), case, &back, &minus, 1.0, allowed);
        }
        let back = matrix_product(y.get(MY), x.get(DyddDtauU), n, n_u);
        let transposed: Vec<Dd> =
            (0..n * n_u).map(|at| y.get(GU)[at % n_u * n + at / n_u]).collect();
        ledger.compare("dydd_dtau_u", case, &back, &transposed, 1.0, allowed);
    });
}

/// The four-bar of bars 0.4, 1, 0.8 and 1.1 m, 2 kg/m, in fifty digits: θ, θ̇, θ̈, τ, ∂τ/∂θ,
/// ∂τ/∂θ̇, M, ∂θ̈/∂θ at that τ, ∂θ̈/∂θ̇.
#[test]
#[allow(clippy::excessive_precision, reason = "the numbers stand as they were computed")]
fn a_four_bar_has_the_derivatives_of_its_equation_of_motion() {
    const KNOWN: [[f64; 9]; 3] = [
        [
            0.3,
            0.7,
            -1.2,
            4.8163827112834853,
            -1.5552627415796261,
            -0.34013029286067029,
            0.19934956517015062,
            7.8016861499154229,
            1.7062003248934065,
        ],
        [
            1.0,
            0.0,
            0.0,
            2.9794021987338977,
            -5.7078964656165261,
            0.0,
            0.25982393047168609,
            21.968324685314293,
            0.0,
        ],
        [
            -2.0,
            -3.0,
            4.0,
            -0.038646923968454888,
            9.9140531497955961,
            -0.24274590928871531,
            0.1611313857879021,
            -61.527759482224679,
            1.5065091639455192,
        ],
    ];
    const ZERO: f64 = 1.0;
    let (s, c) = ZERO.sin_cos();
    let b = [0.4 * c, 0.4 * s, 0.0];
    let d = [1.1, 0.0, 0.0];
    // the pin above both ends
    let x = d[0] - b[0];
    let y = d[1] - b[1];
    let square = x * x + y * y;
    let along = (1.0 + square - 0.64) / (2.0 * square);
    let across = (1.0 / square - along * along).sqrt();
    let pin = [b[0] + along * x - across * y, b[1] + along * y + across * x, 0.0];
    let rod = |from: [f64; 3], to: [f64; 3]| {
        let along = [to[0] - from[0], to[1] - from[1], 0.0];
        Inertial::rod(2.0 * along[0].hypot(along[1]), [0.0; 3], along)
    };
    for kind in [SubmechanismKind::FourBar, SubmechanismKind::Numerical] {
        let z = [0.0, 0.0, 1.0];
        let mut robot = DescriptionBuilder::new("four-bar");
        robot.gravity([0.0, -9.81, 0.0]);
        robot.submechanism("bars", kind);
        let crank = robot.revolute("crank", LinkId::BASE, z).inertial(rod([0.0; 3], b)).link();
        let coupler = robot.revolute("coupler", crank, z).at(b).inertial(rod(b, pin)).link();
        let rocker = robot.revolute("rocker", LinkId::BASE, z).at(d).inertial(rod(d, pin)).link();
        robot.cut("pin", coupler, rocker).at(pin).joint(CutJoint::PlanarRevolute { axis: z });
        robot.independent([crank]);
        let mut robot = Robot::new(robot.compile().unwrap().model);
        for [y, yd, ydd, tau, by_y, by_yd, mass, ydd_by_y, ydd_by_yd] in KNOWN {
            let given: [(Field, &[f64]); 3] = [(Y, &[y - ZERO]), (Yd, &[yd]), (Ydd, &[ydd])];
            let want = [TauY, DtauYDy, DtauYDyd, MY];
            let x = robot.ask(Request::InverseDynamics, &given, &want).ok();
            let found = want.map(|field| x.get(field)[0]);
            assert_close(&format!("ID at {y}"), &found, &[tau, by_y, by_yd, mass], 1.0, 1e-12);
            let given: [(Field, &[f64]); 3] = [(Y, &[y - ZERO]), (Yd, &[yd]), (TauY, &[tau])];
            let want = [Ydd, DyddDy, DyddDyd];
            let x = robot.ask(Request::ForwardDynamics, &given, &want).ok();
            let found = want.map(|field| x.get(field)[0]);
            assert_close(&format!("FD at {y}"), &found, &[ydd, ydd_by_y, ydd_by_yd], 1.0, 1e-12);
        }
    }
}
