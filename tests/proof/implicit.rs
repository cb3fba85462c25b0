//! The tree with its loops as constraints: forward dynamics at closed states, and projection onto
//! closed states.

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Compiled, Field, FieldSet, ImplicitForm, Method, Model, Plan, PlanScalar, Query, Request,
    Status, Workspace,
};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::transposed;

use Field::*;

/// The robots of the laws, and one with redundant rows.
fn all() -> Vec<Case> {
    [Case::bundled("bricard"), Case::bundled("stewart_floating")]
        .into_iter()
        .chain(robots().iter().cloned())
        .collect()
}

/// A closed state in all coordinates, with K and condition numbers.
struct Closed<T> {
    q: Vec<T>,
    qd: Vec<T>,
    rows: Vec<T>,
    cond: f64,
}

fn closed<T: PlanScalar>(model: &Model<T>, state: &State<T>) -> Closed<T> {
    let mut robot = Robot::new(model.clone());
    let motion: [(Field, &[T]); 2] = [(Y, &state.y), (Yd, &state.yd)];
    let x = robot.ask(Request::Kinematics, &motion, &[Q, Qd, K, CondKd]).ok();
    let at = Robot::new(model.clone()).ask(Request::InverseDynamics, &motion, &[CondMy]).ok();
    let cond = x.get(CondKd)[0].to_f64() * at.get(CondMy)[0].to_f64();
    Closed { q: x.get(Q).to_vec(), qd: x.get(Qd).to_vec(), rows: x.get(K).to_vec(), cond }
}

/// q̈ and λ by forward dynamics from forces on the tree, by one method.
fn planned<T: PlanScalar>(
    model: &Model<T>,
    method: Method,
    base: Query,
    given: &[(Field, &[T])],
) -> [Vec<T>; 2] {
    let fields: Vec<Field> = given.iter().map(|x| x.0).collect();
    let mut query = base;
    query.want = FieldSet::of(&[Qdd, Lambda]);
    fields.iter().for_each(|field| query.given = query.given.with(*field));
    let plan = Plan::with_method(model, &query, method).unwrap();
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let mut input = vec![T::ZERO; plan.given().len()];
    given.iter().for_each(|(field, numbers)| {
        input[plan.given().slot(*field).unwrap().range()].copy_from_slice(numbers)
    });
    let mut output = vec![T::ZERO; plan.want().len()];
    assert_eq!(plan.run(model, &mut workspace, &input, &mut output).status, Status::Ok);
    [Qdd, Lambda].map(|field| output[plan.want().slot(field).unwrap().range()].to_vec())
}

fn agree<T: PlanScalar>(
    case: &Case,
    model: &Model<T>,
    state: &State<T>,
    scalar: &str,
    allowed: f64,
    ledger: &mut Ledger,
) {
    let n_v = model.sizes().n_v;
    let Closed { q, qd, rows, cond } = closed(model, state);
    let tau: Vec<T> =
        Seeded::new(case.seed).numbers(n_v, 3.0).into_iter().map(T::from_f64).collect();
    // a wrench on the last link
    let link = (model.link_names().len() - 1) as u16;
    let wrench: Vec<T> = [0.3, -0.2, 0.5, 4.0, -7.0, 2.0].into_iter().map(T::from_f64).collect();
    let base = Query::new(Request::ForwardDynamics, FieldSet::EMPTY, FieldSet::EMPTY);
    let given: [(Field, &[T]); 4] =
        [(Y, &state.y), (Yd, &state.yd), (TauQ, &tau), (Wrenches, &wrench)];
    let mut form = ImplicitForm::with_wrenches(model, &[link]);
    let none = (T::ZERO, T::ZERO);
    let stabilised = (T::from_f64(5.0), T::from_f64(5.0));
    for (what, stabilisation) in [("alone", none), ("with Baumgarte", stabilised)] {
        let mut qdd = vec![T::ZERO; n_v];
        let status = form.accelerations(model, &q, &qd, &tau, &wrench, stabilisation, &mut qdd);
        assert_eq!(status, Status::Ok, "{what}");
        assert!(
            form.position_drift().to_f64() < 1e-12 + case.contradiction(),
            "{}",
            form.position_drift().to_f64()
        );
        for method in [Method::Kkt, Method::Recursion] {
            let [of_plan, lambda] = planned(model, method, base.with_wrenches(&[link]), &given);
            let size = largest(&of_plan).max(1.0);
            let loops = case.contradiction() * 1e2;
            let name = format!("q̈ {what} against {} in {scalar}", method.name());
            ledger.compare(&name, case, &qdd, &of_plan, size, (allowed + loops) * cond);
            // the split of force over redundant rows is arbitrary, its effect is not
            let forces = |lambda: &[T]| transposed(&rows, lambda, n_v);
            let mine = forces(form.lambda());
            let others = forces(&lambda);
            let name = format!("Kᵀλ {what} against {} in {scalar}", method.name());
            ledger.compare(
                &name,
                case,
                &mine,
                &others,
                largest(&tau),
                (allowed + loops) * cond * 1e2,
            );
        }
    }
}

#[test]
fn at_a_closed_state_it_is_the_plans_forward_dynamics() {
    let cases = all();
    Ledger::over(&cases, |case, ledger| {
        let Compiled { model, exact, .. } = &case.compiled;
        agree(case, model, &case.state::<f64>(0), "double", 1e-12, ledger);
        agree(case, exact, &case.state::<Dd>(0), "double-double", 1e-25, ledger);
    });
}

/// Unit of each coordinate: a typical length if it slides.
fn units(case: &Case) -> Vec<f64> {
    let slides = |name: &String| {
        case.description.joints.iter().any(|x| x.name == *name && x.kind == JointKind::Prismatic)
    };
    case.compiled
        .model
        .tree_q_names()
        .iter()
        .map(|name| if slides(name) { case.scale } else { 1.0 })
        .collect()
}

/// q of a closed state with a small random change in every coordinate of one degree of freedom.
fn disturbed(case: &Case, q: &[f64], size: f64, seed: u64) -> Vec<f64> {
    let moves = Seeded::new(seed).numbers(q.len(), size);
    let names = case.compiled.model.tree_q_names();
    let moved =
        |k: usize, unit: f64| if names[k].contains('/') { q[k] } else { q[k] + unit * moves[k] };
    units(case).into_iter().enumerate().map(|(k, unit)| moved(k, unit)).collect()
}

#[test]
fn a_disturbed_pose_is_closed_to_rounding_by_a_move_no_longer_than_the_disturbance() {
    let cases = all();
    let mut closed_again = 0;
    let mut refused = 0;
    Ledger::over(&cases, |case, ledger| {
        let model = &case.compiled.model;
        let state = case.state::<f64>(1);
        let reference = closed(model, &state);
        let mut form = ImplicitForm::new(model);
        let units = units(case);
        for size in [1e-8, 1e-4, 1e-2] {
            let mut q = disturbed(case, &reference.q, size, case.seed);
            let before = q.clone();
            let mut qd: Vec<f64> = reference
                .qd
                .iter()
                .zip(Seeded::new(7).numbers(q.len(), 1.0))
                .map(|(qd, by)| qd + by)
                .collect();
            let status = form.project(model, &mut q, &mut qd);
            if status != Status::Ok {
                // near a singular pose there may be no closed pose near a large disturbance
                assert!(size > 1e-3 && reference.cond > 1e3, "{status} after {size}");
                refused += 1;
                continue;
            }
            closed_again += 1;
            let tau = vec![0.0; qd.len()];
            let mut qdd = tau.clone();
            assert_eq!(
                form.accelerations(model, &q, &qd, &tau, &[], (0.0, 0.0), &mut qdd),
                Status::Ok
            );
            let rows = 1e-14 + case.contradiction();
            ledger.note("φ after a projection", case, form.position_drift(), rows);
            ledger.note(
                "K q̇ after a projection",
                case,
                form.velocity_drift(),
                1e-13 * largest(&qd).max(1.0) * (1.0 + 1.0 / case.scale) + rows,
            );
            // the undisturbed pose is closed and at that distance
            let far = |a: &[f64], b: &[f64]| {
                a.iter()
                    .zip(b)
                    .zip(&units)
                    .map(|((a, b), unit)| ((a - b) / unit).powi(2))
                    .sum::<f64>()
                    .sqrt()
            };
            let moved = far(&q, &before);
            let disturbance = far(&reference.q, &before);
            ledger.note("length of the move", case, moved, 3.0 * disturbance + 1e-14);
            // a second projection changes nothing
            let again = q.clone();
            let mut again_qd = qd.clone();
            assert_eq!(form.project(model, &mut q, &mut again_qd), Status::Ok);
            ledger.compare(
                "q projected twice",
                case,
                &q,
                &again,
                1.0,
                1e-13 + case.contradiction() * 1e2,
            );
            ledger.compare(
                "q̇ projected twice",
                case,
                &again_qd,
                &qd,
                1.0,
                1e-11 + case.contradiction() * 1e2,
            );
        }
    });
    println!("{closed_again} closed, {refused} refused");
    assert!(closed_again > 20 * refused);
}

/// One Runge-Kutta step of order four for (q, q̇) of a robot without quaternions.
fn step(
    model: &Model,
    form: &mut ImplicitForm<f64>,
    stabilisation: (f64, f64),
    h: f64,
    q: &mut [f64],
    qd: &mut [f64],
) {
    let n = q.len();
    let tau = vec![0.0; n];
    let mut k_q = vec![vec![0.0; n]; 4];
    let mut k_v = vec![vec![0.0; n]; 4];
    for stage in 0..4 {
        let by = [0.0, h / 2.0, h / 2.0, h][stage];
        let last = stage.max(1) - 1;
        let at: Vec<f64> = (0..n).map(|i| q[i] + by * k_q[last][i]).collect();
        let rate: Vec<f64> = (0..n).map(|i| qd[i] + by * k_v[last][i]).collect();
        assert_eq!(
            form.accelerations(model, &at, &rate, &tau, &[], stabilisation, &mut k_v[stage]),
            Status::Ok
        );
        k_q[stage] = rate;
    }
    for i in 0..n {
        q[i] += h / 6.0 * (k_q[0][i] + 2.0 * k_q[1][i] + 2.0 * k_q[2][i] + k_q[3][i]);
        qd[i] += h / 6.0 * (k_v[0][i] + 2.0 * k_v[1][i] + 2.0 * k_v[2][i] + k_v[3][i]);
    }
}

/// φ̈ + 2 α φ̇ + β² φ = 0 row by row: from rest φ falls by (1 + β t) e^{−β t} with α = β.
#[test]
fn a_drifted_state_comes_back_as_baumgarte_says() {
    let beta = 40.0_f64;
    let h = 5e-4;
    let steps = 400;
    for name in ["lambda", "torso", "stewart", "squeezer", "wrist", "bricard", "four_bars_2"] {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        let state = case.state::<f64>(2);
        let start = disturbed(&case, &closed(model, &state).q, 1e-4, 5);
        let mut form = ImplicitForm::new(model);
        let drift = |form: &ImplicitForm<f64>| form.position_drift();
        let mut run = |stabilisation: (f64, f64)| {
            let mut q = start.clone();
            let mut qd = vec![0.0; model.sizes().n_v];
            let mut qdd = qd.clone();
            form.accelerations(model, &q, &qd, &qdd.clone(), &[], stabilisation, &mut qdd);
            let first = drift(&form);
            (0..steps).for_each(|_| step(model, &mut form, stabilisation, h, &mut q, &mut qd));
            let still = vec![0.0; qd.len()];
            form.accelerations(model, &q, &qd, &still, &[], stabilisation, &mut qdd);
            (first, drift(&form))
        };
        let (first, last) = run((beta, beta));
        let t = f64::from(steps) * h;
        let expected = (1.0 + beta * t) * (-beta * t).exp();
        println!(
            "{name}: drift {first:.3e} to {last:.3e}, a part of {:.4e}, expected {expected:.4e}",
            last / first
        );
        // within the error of the integration
        assert!((last / first / expected - 1.0).abs() < 0.05, "{name}");
    }
}

#[test]
fn what_does_not_fit_is_refused_and_nothing_allocates() {
    for case in all().iter().take(12) {
        let model = &case.compiled.model;
        let sizes = model.sizes();
        let at = closed(model, &case.state::<f64>(0));
        let mut form = ImplicitForm::new(model);
        let mut qdd = vec![0.0; sizes.n_v];
        let zero = vec![0.0; sizes.n_v];
        let mut q = at.q.clone();
        let mut qd = at.qd.clone();
        let mut far = at.q.clone();
        far.iter_mut()
            .zip(model.tree_q_names())
            .filter(|(_, name)| !name.contains('/'))
            .for_each(|(q, _)| *q += 2.0);
        let mut far_qd = at.qd.clone();
        let before = crate::allocation::calls();
        let fine = form.accelerations(model, &at.q, &at.qd, &zero, &[], (1.0, 1.0), &mut qdd);
        let closed = form.project(model, &mut q, &mut qd);
        // closed elsewhere or refused, but never half closed
        let elsewhere = form.project(model, &mut far, &mut far_qd);
        let short = form.accelerations(model, &at.q, &at.qd, &zero[1..], &[], (1.0, 1.0), &mut qdd);
        let too_many =
            form.accelerations(model, &at.q, &at.qd, &zero, &[0.0], (1.0, 1.0), &mut qdd);
        let no_number =
            form.accelerations(model, &at.q, &at.qd, &zero, &[], (f64::NAN, 1.0), &mut qdd);
        assert_eq!(crate::allocation::calls(), before, "{}", case.name);
        assert_eq!(
            [fine, closed, short, too_many, no_number],
            [Status::Ok, Status::Ok, Status::WrongSize, Status::WrongSize, Status::NonFiniteInput]
        );
        assert!(qdd.iter().all(|x| x.is_nan()) && form.lambda().iter().all(|x| x.is_nan()));
        assert_eq!(
            elsewhere == Status::Ok,
            far.iter().all(|x| x.is_finite()),
            "{}: {elsewhere}",
            case.name
        );
        let other =
            Case::bundled(if case.name == "torso" { "lambda" } else { "torso" }).compiled.model;
        assert_eq!(form.project(&other, &mut q, &mut qd), Status::WrongModel);
    }
}

/// The projected state is closed in double-double too.
#[test]
fn a_projected_pose_is_closed_in_double_double() {
    for name in ["torso", "bricard", "squeezer", "delta"] {
        let case = Case::bundled(name);
        let Compiled { model, exact, .. } = &case.compiled;
        let state = case.state::<f64>(3);
        let mut q = disturbed(&case, &closed(model, &state).q, 1e-3, 11);
        let mut qd = vec![0.0; q.len()];
        assert_eq!(ImplicitForm::new(model).project(model, &mut q, &mut qd), Status::Ok);
        let mut closer: Vec<Dd> = q.iter().map(|x| Dd::from(*x)).collect();
        let mut still = vec![Dd::ZERO; q.len()];
        assert_eq!(ImplicitForm::new(exact).project(exact, &mut closer, &mut still), Status::Ok);
        let rounded: Vec<Dd> = q.iter().map(|x| Dd::from(*x)).collect();
        let error = error_by_size(&rounded, &closer, 1.0);
        assert!(error < 1e-14, "{name}: {error}");
    }
}
