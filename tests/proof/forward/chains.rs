//! Loops in a row, from one to a thousand, and spherical joints between them.

use super::*;
use sarrus_dynamics::PlanScalar;

#[test]
fn the_methods_agree_on_chains_of_loops() {
    for n in [1, 2, 3, 10, 40] {
        let Compiled { model, exact, .. } =
            Model::compile(&lambdas(n)).unwrap_or_else(|error| panic!("{error}"));
        fn check<T: PlanScalar>(model: &Model<T>, allowed: f64) {
            let n = model.sizes().n_vy;
            let mut seeded = Seeded::new(n as u64);
            let mut random = |size: f64| -> Vec<T> {
                seeded.numbers(n, size).into_iter().map(T::from_f64).collect()
            };
            let y = random(0.2);
            let yd = random(1.0);
            let tau = random(10.0);
            let inverse = Robot::new(model.clone())
                .ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd)], &[MY, CY])
                .ok();
            for method in Method::ALL {
                let (status, x) =
                    forward(model, method, &[(Y, &y), (Yd, &yd), (TauY, &tau)], &[Ydd]);
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
    let y = seeded.numbers(n, 0.02);
    let yd = seeded.numbers(n, 0.1);
    let tau = seeded.numbers(n, 10.0);
    let (status, x) =
        forward(&model, Method::Recursion, &[(Y, &y), (Yd, &yd), (TauY, &tau)], &[Ydd]);
    assert_eq!(status, Status::Ok);
    let inverse = Robot::new(model)
        .ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd), (Ydd, &x[0])], &[TauY, MY, CY])
        .ok();
    let error = backward_error(inverse.get(MY), inverse.get(CY), &tau, &x[0]);
    // residual of inverse dynamics, relative to the same size
    let M = inverse.get(MY);
    let size = M.chunks_exact(n).map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
        * largest(&x[0]);
    let back = largest(&minus(inverse.get(TauY), &tau)) / size;
    println!("backward error {error:.2e}, forces given back {back:.2e}");
    assert!(error <= 1e-12 && back <= 1e-12, "{error:.2e} {back:.2e}");
}

/// Spherical joints in a row, one of them the parent of a loop's cluster.
#[test]
fn the_methods_agree_on_spherical_joints() {
    let (mut robot, sliders) = lambdas_in_a_row(2, true);
    let inertial = Inertial {
        origin: Placement { xyz: [0.1, 0.2, -0.1], rpy: [0.3, 0.2, 0.1] },
        mass: 1.5,
        inertia: [0.02, 0.001, 0.0, 0.03, 0.0, 0.04],
    };
    // on the slider of the first lambda, then each on the one before
    let mut on = sliders[0];
    for k in 0..2 {
        robot.submechanism(format!("ball{k}"), SubmechanismKind::Serial);
        let ball = robot.spherical(format!("ball{k}"), on).origin([0.1, 0.0, 0.2]);
        on = ball.rpy([0.1, 0.5, 0.0]).inertial(inertial).link();
    }
    let Compiled { model, exact, .. } = robot.compile().unwrap_or_else(|error| panic!("{error}"));
    fn check<T: PlanScalar>(model: &Model<T>, allowed: f64) {
        let half = T::from_f64(0.5);
        let y =
            [T::from_f64(0.1), T::from_f64(-0.1), half, half, half, half, half, -half, half, -half];
        let n = model.sizes().n_vy;
        let mut seeded = Seeded::new(9);
        let mut random = |size: f64| -> Vec<T> {
            seeded.numbers(n, size).into_iter().map(T::from_f64).collect()
        };
        let yd = random(1.0);
        let tau = random(5.0);
        let inverse = Robot::new(model.clone())
            .ask(Request::InverseDynamics, &[(Y, &y), (Yd, &yd)], &[MY, CY])
            .ok();
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
