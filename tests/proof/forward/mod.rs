//! Forward dynamics by three methods, which agree with each other, with inverse dynamics and with
//! other engines.

mod chains;
mod terms;

use sarrus_dynamics::description::{
    Description, Inertial, JointKind, Placement, SubmechanismKind, Terms,
};
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{
    Compiled, DescriptionBuilder, Field, FieldSet, LinkId, Method, Model, Plan, PlanScalar, Query,
    Request, Status, Workspace,
};
use sarrus_report::robots::chain::lambdas_in_a_row;
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::{assert_close, largest};
use sarrus_tests::reference::{ROBOTS, cases, numbers, vectors};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{minus, plus, product};

use Field::*;

/// States of each robot.
const STATES: u64 = 2;

/// Answer of one method, with its fields in a row.
fn forward<T: PlanScalar>(
    model: &Model<T>,
    method: Method,
    given: &[(Field, &[T])],
    want: &[Field],
) -> (Status, Vec<Vec<T>>) {
    let fields: Vec<Field> = given.iter().map(|x| x.0).collect();
    let query = Query::new(Request::ForwardDynamics, FieldSet::of(&fields), FieldSet::of(want));
    let plan = Plan::with_method(model, &query, method).unwrap();
    assert_eq!(plan.method(), method);
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let mut input = vec![T::ZERO; plan.given().len()];
    given.iter().for_each(|(field, numbers)| {
        input[plan.given().slot(*field).unwrap().range()].copy_from_slice(numbers)
    });
    let mut output = vec![T::ZERO; plan.want().len()];
    let status = plan.run(model, &mut workspace, &input, &mut output).status;
    (
        status,
        want.iter()
            .map(|field| output[plan.want().slot(*field).unwrap().range()].to_vec())
            .collect(),
    )
}

/// ‖M_y ÿ + C_y − τ_y‖ / (‖M_y‖‖ÿ‖ + ‖C_y‖ + ‖τ_y‖).
fn backward_error<T: PlanScalar>(M: &[T], C: &[T], tau: &[T], ydd: &[T]) -> f64 {
    let residual = largest(&minus(&plus(&product(M, ydd), C), tau));
    let norm = M
        .chunks_exact(ydd.len().max(1))
        .map(|row| row.iter().map(|x| x.to_f64().abs()).sum())
        .fold(0.0, f64::max);
    let size = norm * largest(ydd) + largest(C) + largest(tau);
    if residual == 0.0 { 0.0 } else { residual / size }
}

fn methods_agree<T: PlanScalar>(
    case: &Case,
    model: &Model<T>,
    state: &State<T>,
    scalar: &str,
    allowed: f64,
    ledger: &mut Ledger,
) {
    let motion: [(Field, &[T]); 3] = [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)];
    let inverse = Robot::new(model.clone())
        .ask(Request::InverseDynamics, &motion, &[TauY, TauQ, MY, CY, CondMy, CondKd, Lambda])
        .ok();
    let M = inverse.get(MY);
    let C = inverse.get(CY);
    let cond = inverse.get(CondMy)[0].to_f64() * inverse.get(CondKd)[0].to_f64();
    // forces that cancel along the loops leave their rounding
    let cond = cond
        * (1.0
            + largest(inverse.get(TauQ))
                / (largest(M) * largest(&state.ydd)).max(f64::MIN_POSITIVE));
    let loops = case.contradiction() * inverse.get(CondKd)[0].to_f64();
    let forces = Seeded::new(case.seed).numbers(M.len().isqrt(), largest(inverse.get(TauY)));
    let forces: Vec<T> = forces.into_iter().map(T::from_f64).collect();
    let mut lambdas = Vec::new();
    for method in Method::ALL {
        let name = method.name();
        // oracle and closed forms differ by the contradiction of the loops
        let allowed = if method == Method::Kkt { allowed + loops } else { allowed };
        for (what, tau) in [("of the motion", inverse.get(TauY)), ("at random", &forces)] {
            let (status, x) =
                forward(model, method, &[motion[0], motion[1], (TauY, tau)], &[Ydd, Lambda]);
            assert_eq!(status, Status::Ok, "{name}");
            ledger.note(
                &format!("{name}, forces {what}, in {scalar}"),
                case,
                backward_error(M, C, tau, &x[0]),
                allowed,
            );
            if what == "of the motion" {
                ledger.compare(
                    &format!("{name} gives ÿ back in {scalar}"),
                    case,
                    &x[0],
                    &state.ydd,
                    0.0,
                    allowed * cond,
                );
            } else {
                lambdas.push(x[1].clone());
            }
        }
    }
    let size = largest(inverse.get(Lambda));
    for lambda in &lambdas[1..] {
        ledger.compare(
            &format!("λ of all methods in {scalar}"),
            case,
            lambda,
            &lambdas[0],
            size,
            (allowed + loops) * cond * 1e2,
        );
    }
}

#[test]
fn the_three_methods_agree_on_every_robot() {
    Ledger::over(robots(), |case, ledger| {
        let Compiled { model, exact, .. } = &case.compiled;
        for k in 0..STATES {
            methods_agree(case, model, &case.state::<f64>(k), "double", 1e-12, ledger);
            methods_agree(case, exact, &case.state::<Dd>(k), "double-double", 1e-25, ledger);
        }
    });
}

#[test]
fn every_method_agrees_with_an_independent_engine() {
    for name in ROBOTS {
        let model = Case::bundled(name).compiled.model;
        for (k, case) in cases(&vectors(name)).iter().enumerate() {
            let y = numbers(&case["y"]);
            let yd = numbers(&case["yd"]);
            let tau = numbers(&case["tau_fd"]);
            for method in Method::ALL {
                let (status, x) = forward(
                    &model,
                    method,
                    &[(Y, &y), (Yd, &yd), (TauU, &tau)],
                    &[Ydd, Qdd, Lambda],
                );
                assert_eq!(status, Status::Ok);
                for (x, key) in x.iter().zip(["ydd_fd", "qdd_fd", "lambda_fd"]) {
                    assert_close(
                        &format!("{name} state {k}, {}: {key}", method.name()),
                        x,
                        &numbers(&case[key]),
                        0.0,
                        1e-12,
                    );
                }
            }
        }
    }
}

#[test]
fn the_model_chooses_one_of_the_fast_methods() {
    let mut seen = Vec::new();
    let mut dearer = 0;
    for case in robots() {
        let model = &case.compiled.model;
        let chosen = model.forward_method();
        let costs = [Method::Recursion, Method::Projection]
            .map(|method| model.predicted_cost(method).unwrap());
        let cheaper = if costs[0] < costs[1] { Method::Recursion } else { Method::Projection };
        // the cheaper method, unless it loses digits, as on random robots with unequal masses
        let is_bundled = ROBOTS.contains(&model.name());
        assert!(chosen == cheaper || !is_bundled, "{}", model.name());
        dearer += usize::from(chosen != cheaper);
        assert_eq!(model.predicted_cost(Method::Kkt), None);
        seen.push(chosen);
    }
    println!("the dearer method on {dearer} of {} robots", seen.len());
    assert!(10 * dearer < seen.len(), "{dearer} of {}", seen.len());
    assert!(seen.contains(&Method::Recursion) && seen.contains(&Method::Projection), "{seen:?}");
    assert_eq!(Model::compile(&lambdas(50)).unwrap().model.forward_method(), Method::Recursion);
}

#[test]
fn no_method_allocates() {
    for case in robots().iter().take(9).chain(robots().iter().skip(9).step_by(12)) {
        let model = &case.compiled.model;
        let state = case.state::<f64>(0);
        for method in Method::ALL {
            let query = Query::new(
                Request::ForwardDynamics,
                FieldSet::of(&[Y, Yd, TauY]),
                FieldSet::of(&[Ydd, Qdd, Lambda, CY]),
            );
            let plan = Plan::with_method(model, &query, method).unwrap();
            let mut workspace = Workspace::for_plans(model, [&plan]);
            let mut input = vec![0.0; plan.given().len()];
            input[plan.given().slot(Y).unwrap().range()].copy_from_slice(&state.y);
            input[plan.given().slot(Yd).unwrap().range()].copy_from_slice(&state.yd);
            let mut output = vec![0.0; plan.want().len()];
            let before = crate::allocation::calls();
            let answer = plan.run(model, &mut workspace, &input, &mut output);
            assert_eq!(crate::allocation::calls(), before, "{} on {}", method.name(), case.name);
            assert_eq!(answer.status, Status::Ok, "{} on {}", method.name(), case.name);
        }
    }
}

#[test]
fn a_workspace_without_room_is_refused() {
    let model = Case::bundled("lambda").compiled.model;
    let query =
        Query::new(Request::ForwardDynamics, FieldSet::of(&[Y, TauY]), FieldSet::of(&[Ydd]));
    let [recursion, projection, kkt] =
        Method::ALL.map(|method| Plan::with_method(&model, &query, method).unwrap());
    let status = |workspace: &mut Workspace<f64>, plan: &Plan| {
        plan.run(&model, workspace, &[0.1, 0.0], &mut [0.0]).status
    };
    let mut small = Workspace::for_plans(&model, [&recursion]);
    assert_eq!(
        [&recursion, &projection, &kkt].map(|plan| status(&mut small, plan)),
        [Status::Ok, Status::WrongSize, Status::WrongSize]
    );
    let mut usual = Workspace::new(&model);
    assert_eq!(
        [&recursion, &projection, &kkt].map(|plan| status(&mut usual, plan)),
        [Status::Ok, Status::Ok, Status::WrongSize]
    );
    let mut all = Workspace::for_plans(&model, [&projection, &kkt]);
    assert_eq!([&recursion, &projection, &kkt].map(|plan| status(&mut all, plan)), [Status::Ok; 3]);
}

/// Lambdas in a row: every second one on the slider of the one before, the others on its rocker.
fn lambdas(n: usize) -> Description {
    lambdas_in_a_row(n, true).0.build().unwrap()
}
