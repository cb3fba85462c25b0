//! Forward dynamics three ways: they agree with each other, with inverse dynamics and with what others computed; joint terms on mechanisms
//! whose equations fit in a line.

use std::f64::consts::{FRAC_PI_2, PI};

use sarrus_dynamics::description::{
    Cut, Description, Inertial, Joint, JointKind, Link, Loop, Placement, Row, Submechanism, SubmechanismKind, Terms,
};
use sarrus_dynamics::scalar::{Dd, Scalar};
use sarrus_dynamics::{Compiled, Field, FieldSet, Method, Model, Plan, Request, Status, Wanted, Workspace};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::{assert_close, largest};
use sarrus_tests::reference::{ROBOTS, cases, numbers, vectors};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{minus, plus, product};

use Field::*;

/// States of each robot.
const STATES: u64 = 2;

/// What one method answers; the fields one after the other.
fn forward<T: Scalar>(model: &Model<T>, method: Method, given: &[(Field, &[T])], want: &[Field]) -> (Status, Vec<Vec<T>>) {
    let fields: Vec<Field> = given.iter().map(|x| x.0).collect();
    let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::of(&fields), FieldSet::of(want));
    let plan = Plan::with_method(model, &wanted, method).unwrap();
    assert_eq!(plan.method(), method);
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let mut input = vec![T::ZERO; plan.given().len()];
    given.iter().for_each(|(field, numbers)| input[plan.given().slot(*field).unwrap().range()].copy_from_slice(numbers));
    let mut output = vec![T::ZERO; plan.want().len()];
    let status = plan.run(model, &mut workspace, &input, &mut output).status;
    (status, want.iter().map(|field| output[plan.want().slot(*field).unwrap().range()].to_vec()).collect())
}

/// ‖M_y ÿ + C_y − τ_y‖ / (‖M_y‖‖ÿ‖ + ‖C_y‖ + ‖τ_y‖).
fn backward_error<T: Scalar>(M: &[T], C: &[T], tau: &[T], ydd: &[T]) -> f64 {
    let residual = largest(&minus(&plus(&product(M, ydd), C), tau));
    let norm = M.chunks_exact(ydd.len().max(1)).map(|row| row.iter().map(|x| x.to_f64().abs()).sum()).fold(0.0, f64::max);
    let size = norm * largest(ydd) + largest(C) + largest(tau);
    if residual == 0.0 { 0.0 } else { residual / size }
}

fn methods_agree<T: Scalar>(case: &Case, model: &Model<T>, state: &State<T>, scalar: &str, allowed: f64, ledger: &mut Ledger) {
    let motion: [(Field, &[T]); 3] = [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)];
    let inverse = Robot::new(model.clone()).ask(Request::InverseDynamics, &motion, &[TauY, TauQ, MY, CY, CondMy, CondKd, Lambda]).ok();
    let (M, C, cond) = (inverse.get(MY), inverse.get(CY), inverse.get(CondMy)[0].to_f64() * inverse.get(CondKd)[0].to_f64());
    // forces that cancel along the loops leave their rounding
    let cond = cond * (1.0 + largest(inverse.get(TauQ)) / (largest(M) * largest(&state.ydd)).max(f64::MIN_POSITIVE));
    let loops = case.contradiction() * inverse.get(CondKd)[0].to_f64();
    let forces = Seeded::new(case.seed).numbers(M.len().isqrt(), largest(inverse.get(TauY)));
    let forces: Vec<T> = forces.into_iter().map(T::from_f64).collect();
    let mut lambdas = Vec::new();
    for method in Method::ALL {
        let name = method.name();
        // oracle and closed forms differ by how far loops contradict each other
        let allowed = if method == Method::Kkt { allowed + loops } else { allowed };
        for (what, tau) in [("of the motion", inverse.get(TauY)), ("at random", &forces)] {
            let (status, x) = forward(model, method, &[motion[0], motion[1], (TauY, tau)], &[Ydd, Lambda]);
            assert_eq!(status, Status::Ok, "{name}");
            ledger.note(&format!("{name}, forces {what}, in {scalar}"), case, backward_error(M, C, tau, &x[0]), allowed);
            if what == "of the motion" {
                ledger.compare(&format!("{name} gives ÿ back in {scalar}"), case, &x[0], &state.ydd, 0.0, allowed * cond);
            } else {
                lambdas.push(x[1].clone());
            }
        }
    }
    let size = largest(inverse.get(Lambda));
    for lambda in &lambdas[1..] {
        ledger.compare(&format!("λ of all methods in {scalar}"), case, lambda, &lambdas[0], size, (allowed + loops) * cond * 1e2);
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
            let (y, yd, tau) = (numbers(&case["y"]), numbers(&case["yd"]), numbers(&case["tau_fd"]));
            for method in Method::ALL {
                let (status, x) = forward(&model, method, &[(Y, &y), (Yd, &yd), (TauU, &tau)], &[Ydd, Qdd, Lambda]);
                assert_eq!(status, Status::Ok);
                for (x, key) in x.iter().zip(["ydd_fd", "qdd_fd", "lambda_fd"]) {
                    assert_close(&format!("{name} state {k}, {}: {key}", method.name()), x, &numbers(&case[key]), 0.0, 1e-12);
                }
            }
        }
    }
}

#[test]
fn the_model_chooses_one_of_the_fast_methods() {
    let mut seen = Vec::new();
    for case in robots() {
        let model = &case.compiled.model;
        let chosen = model.forward_method();
        let costs = [Method::Recursion, Method::Projection].map(|method| model.predicted_cost(method).unwrap());
        assert_eq!(chosen, if costs[0] < costs[1] { Method::Recursion } else { Method::Projection });
        assert_eq!(model.predicted_cost(Method::Kkt), None);
        seen.push(chosen);
    }
    assert!(seen.contains(&Method::Recursion) && seen.contains(&Method::Projection), "{seen:?}");
    assert_eq!(Model::compile(&lambdas(50)).unwrap().model.forward_method(), Method::Recursion);
}

#[test]
fn no_method_allocates() {
    for case in robots().iter().take(9).chain(robots().iter().skip(9).step_by(12)) {
        let model = &case.compiled.model;
        let state = case.state::<f64>(0);
        for method in Method::ALL {
            let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::of(&[Y, Yd, TauY]), FieldSet::of(&[Ydd, Qdd, Lambda, CY]));
            let plan = Plan::with_method(model, &wanted, method).unwrap();
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
    let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::of(&[Y, TauY]), FieldSet::of(&[Ydd]));
    let [recursion, projection, kkt] = Method::ALL.map(|method| Plan::with_method(&model, &wanted, method).unwrap());
    let status = |workspace: &mut Workspace<f64>, plan: &Plan| plan.run(&model, workspace, &[0.1, 0.0], &mut [0.0]).status;
    let mut small = Workspace::for_plans(&model, [&recursion]);
    assert_eq!([&recursion, &projection, &kkt].map(|plan| status(&mut small, plan)), [Status::Ok, Status::WrongSize, Status::WrongSize]);
    let mut usual = Workspace::new(&model);
    assert_eq!([&recursion, &projection, &kkt].map(|plan| status(&mut usual, plan)), [Status::Ok, Status::Ok, Status::WrongSize]);
    let mut all = Workspace::for_plans(&model, [&projection, &kkt]);
    assert_eq!([&recursion, &projection, &kkt].map(|plan| status(&mut all, plan)), [Status::Ok; 3]);
}

// chains

fn at(xyz: [f64; 3], rpy: [f64; 3]) -> Placement {
    Placement { xyz, rpy }
}

fn joint(name: String, kind: JointKind, parent: usize, child: usize, origin: Placement, axis: [f64; 3], terms: Terms) -> Joint {
    Joint { name, kind, parent, child, origin, axis, limits: None, coupling: None, terms }
}

fn robot(name: &str) -> Description {
    Description {
        name: name.into(),
        links: vec![Link { name: "base".into(), inertial: None }],
        joints: Vec::new(),
        submechanisms: Vec::new(),
        gravity: [0.0, 0.0, -9.81],
    }
}

/// Lambdas in a row, every second one on the slider of the one before, the others on its rocker.
fn lambdas(n: usize) -> Description {
    let mut robot = robot("lambdas");
    let mut on = 0;
    for k in 0..n {
        let (link, first) = (robot.links.len(), robot.joints.len());
        for (name, y, mass) in [("rocker", 0.1, 1.2), ("stator", 0.1, 0.5), ("slider", -0.1, 0.4)] {
            let inertial = Inertial { origin: at([0.0, y, 0.01], [0.0; 3]), mass, inertia: [0.004, 0.0, 0.0, 0.002, 0.0, 0.005] };
            robot.links.push(Link { name: format!("{name}{k}"), inertial: Some(inertial) });
        }
        let (sine, cosine) = f64::sin_cos(0.3);
        let from = if k == 0 { [0.0; 3] } else { [0.1, 0.2, 0.05] };
        let stator = [from[0] - 0.114 * sine, from[1] + 0.114 * cosine, from[2]];
        let (x, none) = ([1.0, 0.0, 0.0], Terms::default());
        let (turn, slide) = (JointKind::Revolute, JointKind::Prismatic);
        robot.joints.push(joint(format!("rocker{k}"), turn, on, link, at(from, [0.8, 0.0, 0.3]), x, none));
        robot.joints.push(joint(format!("stator{k}"), turn, on, link + 1, at(stator, [1.08, 0.0, 0.3]), x, none));
        robot.joints.push(joint(format!("slider{k}"), slide, link + 1, link + 2, at([0.0, 0.3, 0.0], [0.0; 3]), [0.0, 1.0, 0.0], none));
        let row = |name: &str, axis: usize| Row {
            name: name.into(),
            axis: std::array::from_fn(|i| f64::from(u8::from(i == axis))),
            against: None,
        };
        robot.submechanisms.push(Submechanism {
            name: format!("lambda{k}"),
            kind: SubmechanismKind::Rrpr,
            type_name: "RRPR".into(),
            spanning_tree: vec![first, first + 1, first + 2],
            independent: vec![first],
            active: vec![first + 2],
            loops: vec![Loop {
                name: format!("pin{k}"),
                predecessor: link,
                successor: link + 2,
                cut: Cut::AtJoint(first + 2),
                rows: vec![row("y", 4), row("z", 5)],
            }],
        });
        on = if k % 2 == 0 { link } else { link + 2 };
    }
    robot
}

#[test]
fn the_methods_agree_on_chains_of_loops() {
    for n in [1, 2, 3, 10, 40] {
        let Compiled { model, exact, .. } = Model::compile(&lambdas(n)).unwrap_or_else(|error| panic!("{error}"));
        fn check<T: Scalar>(model: &Model<T>, allowed: f64) {
            let n = model.sizes().n_vy;
            let mut seeded = Seeded::new(n as u64);
            let mut random = |size: f64| -> Vec<T> { seeded.numbers(n, size).into_iter().map(T::from_f64).collect() };
            let (y, yd, tau) = (random(0.2), random(1.0), random(10.0));
            let inverse = Robot::new(model.clone()).ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd)], &[MY, CY]).ok();
            for method in Method::ALL {
                let (status, x) = forward(model, method, &[(Y, &y), (Yd, &yd), (TauY, &tau)], &[Ydd]);
                assert_eq!(status, Status::Ok);
                let error = backward_error(inverse.get(MY), inverse.get(CY), &tau, &x[0]);
                assert!(error <= allowed, "{n} lambdas, {}: {error:.2e}", method.name());
            }
        }
        check(&model, 1e-12);
        check(&exact, 1e-25);
    }
}

#[test]
fn a_chain_of_a_thousand_loops_is_solved_and_gives_its_forces_back() {
    let model = Model::compile(&lambdas(1000)).unwrap_or_else(|error| panic!("{error}")).model;
    let n = 1000;
    let mut seeded = Seeded::new(5);
    let (y, yd, tau) = (seeded.numbers(n, 0.02), seeded.numbers(n, 0.1), seeded.numbers(n, 10.0));
    let (status, x) = forward(&model, Method::Recursion, &[(Y, &y), (Yd, &yd), (TauY, &tau)], &[Ydd]);
    assert_eq!(status, Status::Ok);
    let inverse = Robot::new(model).ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd), (Ydd, &x[0])], &[TauY, MY, CY]).ok();
    let error = backward_error(inverse.get(MY), inverse.get(CY), &tau, &x[0]);
    // what inverse dynamics gives back, by the same size
    let M = inverse.get(MY);
    let size = M.chunks_exact(n).map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max) * largest(&x[0]);
    let back = largest(&minus(inverse.get(TauY), &tau)) / size;
    println!("backward error {error:.2e}, forces given back {back:.2e}");
    assert!(error <= 1e-12 && back <= 1e-12, "{error:.2e} {back:.2e}");
}

// terms of joints

/// A rod of point masses on revolute joints about y, each in the direction z of its link turned by an angle at zero.
fn rods(bends: &[f64], terms: &[Terms]) -> Description {
    let mut robot = robot("rods");
    for (k, (bend, terms)) in bends.iter().zip(terms).enumerate() {
        let inertial = Inertial { origin: at([0.0, 0.0, 1.0], [0.0; 3]), mass: 1.0, inertia: [0.0; 6] };
        robot.links.push(Link { name: format!("rod{k}"), inertial: Some(inertial) });
        let origin = at([0.0, 0.0, if k == 0 { 0.0 } else { 1.0 }], [0.0, *bend, 0.0]);
        robot.joints.push(joint(format!("pivot{k}"), JointKind::Continuous, k, k + 1, origin, [0.0, 1.0, 0.0], *terms));
    }
    let joints: Vec<usize> = (0..bends.len()).collect();
    robot.submechanisms.push(Submechanism {
        name: "all".into(),
        kind: SubmechanismKind::Serial,
        type_name: "R".into(),
        spanning_tree: joints.clone(),
        independent: joints.clone(),
        active: joints,
        loops: vec![],
    });
    robot
}

#[test]
fn a_pendulum_feels_its_spring_damper_and_rotor() {
    let terms = Terms { damping: 0.7, stiffness: 3.0, rest: 0.4, rotor_inertia: 2e-4, gear_ratio: 50.0 };
    let model = Model::compile(&rods(&[0.0], &[terms])).unwrap().model;
    let (q, qd, qdd) = (0.9_f64, -1.3, 2.1);
    // upright at zero: gravity pulls by −g sin q
    let inertia = 1.0 + 50.0 * 50.0 * 2e-4;
    let bias = 0.7 * qd + 3.0 * (q - 0.4) - 9.81 * q.sin();
    let tau = inertia * qdd + bias;
    let x = Robot::new(model.clone()).ask(Request::InverseDynamics, &[(Y, &[q]), (Yd, &[qd]), (Ydd, &[qdd])], &[TauU, MY, CY]).ok();
    assert_close("τ", x.get(TauU), &[tau], 0.0, 1e-15);
    assert_close("M", x.get(MY), &[inertia], 0.0, 1e-15);
    assert_close("C", x.get(CY), &[bias], 0.0, 1e-15);
    for method in Method::ALL {
        let (status, x) = forward(&model, method, &[(Y, &[q]), (Yd, &[qd]), (TauU, &[tau])], &[Ydd]);
        assert_eq!(status, Status::Ok);
        assert_close(method.name(), &x[0], &[qdd], 0.0, 1e-15);
    }
}

/// With and without terms on dependent joints the forces differ by what virtual work says: Gᵀ (N² I (G ÿ + g) + d q̇ + k (q − rest)).
#[test]
fn terms_of_dependent_joints_act_through_the_loop() {
    let plain = lambdas(3);
    let mut loaded = plain.clone();
    for (k, joint) in loaded.joints.iter_mut().enumerate() {
        let x = 1.0 + k as f64;
        joint.terms = Terms { damping: 3.0 * x, stiffness: 40.0 * x, rest: 0.02 * x, rotor_inertia: 1e-3 * x, gear_ratio: 9.0 };
    }
    fn check<T: Scalar>(plain: &Model<T>, loaded: &Model<T>, allowed: f64) {
        let number = T::from_f64;
        let of = |x: [f64; 3]| x.map(number);
        let (y, yd, ydd) = (of([0.1, -0.2, 0.15]), of([0.5, 1.0, -0.8]), of([2.0, -1.0, 3.0]));
        let motion: [(Field, &[T]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
        let state = Robot::new(plain.clone()).ask(Request::Kinematics, &motion, &[Q, Qd, Qdd, G]).ok();
        let [before, after] =
            [plain, loaded].map(|model| Robot::new(model.clone()).ask(Request::InverseDynamics, &motion, &[TauY, MY, CY]).ok());
        let (n, jacobian) = (state.get(Q).len(), state.get(G));
        let (mut tau, mut M) = (before.get(TauY).to_vec(), before.get(MY).to_vec());
        for j in 0..n {
            let x = 1.0 + j as f64;
            let inertia = number(1e-3 * x) * number(81.0);
            let force =
                inertia * state.get(Qdd)[j] + number(3.0 * x) * state.get(Qd)[j] + number(40.0 * x) * (state.get(Q)[j] - number(0.02 * x));
            for a in 0..3 {
                tau[a] += jacobian[j * 3 + a] * force;
                for b in 0..3 {
                    M[a * 3 + b] += inertia * jacobian[j * 3 + a] * jacobian[j * 3 + b];
                }
            }
        }
        assert_close("τ_y", after.get(TauY), &tau, 0.0, allowed);
        assert_close("M_y", after.get(MY), &M, 0.0, allowed);
        assert_close("C_y", &plus(&product(after.get(MY), &ydd), after.get(CY)), &tau, 0.0, allowed);
        for method in Method::ALL {
            let (status, x) = forward(loaded, method, &[motion[0], motion[1], (TauY, &tau)], &[Ydd, Lambda]);
            assert_eq!(status, Status::Ok);
            assert_close(method.name(), &x[0], &ydd, 0.0, 100.0 * allowed);
            let (_, mine) = forward(loaded, Method::Recursion, &[motion[0], motion[1], (TauY, &tau)], &[Lambda]);
            assert_close(&format!("λ, {}", method.name()), &x[1], &mine[0], 0.0, 1e3 * allowed);
        }
    }
    let (plain, loaded) = (Model::compile(&plain).unwrap(), Model::compile(&loaded).unwrap());
    check(&plain.model, &loaded.model, 1e-13);
    check(&plain.exact, &loaded.exact, 1e-27);
}

#[test]
fn terms_of_a_joint_of_several_freedoms_are_a_fault() {
    let mut robot = rods(&[0.0], &[Terms { damping: 1.0, ..Terms::default() }]);
    robot.joints[0].kind = JointKind::Spherical;
    robot.submechanisms[0].active.clear();
    let error = Model::compile(&robot).unwrap_err().to_string();
    assert!(error.contains("pivot0") && error.contains("several freedoms"), "{error}");
}

/// A rotor of negative inertia stands for whatever takes inertia away: beside the second joint the first has 2 − 3/2 when bent by a right angle,
/// and 1 − 3/2 when straight.
#[test]
fn a_mass_that_is_not_positive_has_a_status_by_every_method() {
    let none = Terms::default();
    let model = Model::compile(&rods(&[0.0, FRAC_PI_2], &[Terms { rotor_inertia: -1.5, ..none }, none])).unwrap().model;
    for (bend, expected) in [(0.0, Status::Ok), (-FRAC_PI_2, Status::MassNotPositive), (PI, Status::Ok)] {
        for method in Method::ALL {
            let (status, x) = forward(&model, method, &[(Y, &[0.3, bend]), (TauY, &[1.0, 1.0])], &[Ydd]);
            assert_eq!(status, expected, "{} at {bend}", method.name());
            assert_eq!(x[0][0].is_nan(), expected != Status::Ok);
        }
    }
}

/// Spherical joints in a row, and one that a loop's cluster hangs from.
#[test]
fn the_methods_agree_on_spherical_joints() {
    let mut robot = lambdas(2);
    for k in 0..2 {
        let (link, j) = (robot.links.len(), robot.joints.len());
        let inertial = Inertial { origin: at([0.1, 0.2, -0.1], [0.3, 0.2, 0.1]), mass: 1.5, inertia: [0.02, 0.001, 0.0, 0.03, 0.0, 0.04] };
        robot.links.push(Link { name: format!("ball{k}"), inertial: Some(inertial) });
        // on the slider of the first lambda, then on itself
        let parent = if k == 0 { 3 } else { link - 1 };
        let origin = at([0.1, 0.0, 0.2], [0.1, 0.5, 0.0]);
        robot.joints.push(joint(format!("ball{k}"), JointKind::Spherical, parent, link, origin, [0.0, 0.0, 1.0], Terms::default()));
        robot.submechanisms.push(Submechanism {
            name: format!("ball{k}"),
            kind: SubmechanismKind::Serial,
            type_name: "S".into(),
            spanning_tree: vec![j],
            independent: vec![j],
            active: vec![],
            loops: vec![],
        });
    }
    let Compiled { model, exact, .. } = Model::compile(&robot).unwrap_or_else(|error| panic!("{error}"));
    fn check<T: Scalar>(model: &Model<T>, allowed: f64) {
        let half = T::from_f64(0.5);
        let y = [T::from_f64(0.1), T::from_f64(-0.1), half, half, half, half, half, -half, half, -half];
        let n = model.sizes().n_vy;
        let mut seeded = Seeded::new(9);
        let mut random = |size: f64| -> Vec<T> { seeded.numbers(n, size).into_iter().map(T::from_f64).collect() };
        let (yd, tau) = (random(1.0), random(5.0));
        let inverse = Robot::new(model.clone()).ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd)], &[MY, CY]).ok();
        for method in Method::ALL {
            let (status, x) = forward(model, method, &[(Y, &y), (Yd, &yd), (TauY, &tau)], &[Ydd]);
            assert_eq!(status, Status::Ok);
            let error = backward_error(inverse.get(MY), inverse.get(CY), &tau, &x[0]);
            assert!(error <= allowed, "{}: {error:.2e}", method.name());
        }
    }
    check(&model, 1e-13);
    check(&exact, 1e-28);
}
