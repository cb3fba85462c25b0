//! Springs, dampers and rotors on mechanisms with equations of one line, and a mass matrix that is
//! not positive definite.

use sarrus_dynamics::PlanScalar;
use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

/// A rod of point masses on revolute joints about y, each along z of its link, with a bend at zero.
fn rods(bends: &[f64], terms: &[Terms]) -> Description {
    let mut robot = DescriptionBuilder::new("rods");
    robot.default_inertial(Inertial::point(1.0, [0.0, 0.0, 1.0]));
    let mut on = LinkId::BASE;
    for (k, (bend, terms)) in bends.iter().zip(terms).enumerate() {
        let pivot = robot.joint(format!("pivot{k}"), JointKind::Continuous, on);
        let pivot = pivot.origin([0.0, 0.0, if k == 0 { 0.0 } else { 1.0 }]).rpy([0.0, *bend, 0.0]);
        on = pivot.axis([0.0, 1.0, 0.0]).terms(*terms).link();
    }
    robot.build().unwrap()
}

#[test]
fn a_pendulum_feels_its_spring_damper_and_rotor() {
    let terms = Terms {
        damping: 0.7,
        stiffness: 3.0,
        rest: 0.4,
        rotor_inertia: 2e-4,
        gear_ratio: 50.0,
        ..Terms::default()
    };
    let model = Model::compile(&rods(&[0.0], &[terms])).unwrap().model;
    let q = 0.9_f64;
    let qd = -1.3;
    let qdd = 2.1;
    // upright at zero: gravity pulls by −g sin q
    let inertia = 1.0 + 50.0 * 50.0 * 2e-4;
    let bias = 0.7 * qd + 3.0 * (q - 0.4) - 9.81 * q.sin();
    let tau = inertia * qdd + bias;
    let x = Robot::new(model.clone())
        .ask(Request::InverseDynamics, &[(Y, &[q]), (Yd, &[qd]), (Ydd, &[qdd])], &[TauU, MY, CY])
        .ok();
    assert_close("τ", x.get(TauU), &[tau], 0.0, 1e-15);
    assert_close("M", x.get(MY), &[inertia], 0.0, 1e-15);
    assert_close("C", x.get(CY), &[bias], 0.0, 1e-15);
    for method in Method::ALL {
        let (status, x) =
            forward(&model, method, &[(Y, &[q]), (Yd, &[qd]), (TauU, &[tau])], &[Ydd]);
        assert_eq!(status, Status::Ok);
        assert_close(method.name(), &x[0], &[qdd], 0.0, 1e-15);
    }
}

/// Terms on dependent joints change the forces by their virtual work: Gᵀ (N² I (G ÿ + g) + d q̇ + k
/// (q − rest)).
#[test]
fn terms_of_dependent_joints_act_through_the_loop() {
    let plain = lambdas(3);
    let mut loaded = plain.clone();
    for (k, joint) in loaded.joints.iter_mut().enumerate() {
        let x = 1.0 + k as f64;
        joint.terms = Terms {
            damping: 3.0 * x,
            stiffness: 40.0 * x,
            rest: 0.02 * x,
            rotor_inertia: 1e-3 * x,
            gear_ratio: 9.0,
            ..Terms::default()
        };
    }
    fn check<T: PlanScalar>(plain: &Model<T>, loaded: &Model<T>, allowed: f64) {
        let number = T::from_f64;
        let of = |x: [f64; 3]| x.map(number);
        let y = of([0.1, -0.2, 0.15]);
        let yd = of([0.5, 1.0, -0.8]);
        let ydd = of([2.0, -1.0, 3.0]);
        let motion: [(Field, &[T]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
        let state =
            Robot::new(plain.clone()).ask(Request::Kinematics, &motion, &[Q, Qd, Qdd, G]).ok();
        let [before, after] = [plain, loaded].map(|model| {
            Robot::new(model.clone()).ask(Request::InverseDynamics, &motion, &[TauY, MY, CY]).ok()
        });
        let n = state.get(Q).len();
        let jacobian = state.get(G);
        let mut tau = before.get(TauY).to_vec();
        let mut M = before.get(MY).to_vec();
        for j in 0..n {
            let x = 1.0 + j as f64;
            let inertia = number(1e-3 * x) * number(81.0);
            let force = inertia * state.get(Qdd)[j]
                + number(3.0 * x) * state.get(Qd)[j]
                + number(40.0 * x) * (state.get(Q)[j] - number(0.02 * x));
            for a in 0..3 {
                tau[a] += jacobian[j * 3 + a] * force;
                for b in 0..3 {
                    M[a * 3 + b] += inertia * jacobian[j * 3 + a] * jacobian[j * 3 + b];
                }
            }
        }
        assert_close("τ_y", after.get(TauY), &tau, 0.0, allowed);
        assert_close("M_y", after.get(MY), &M, 0.0, allowed);
        assert_close(
            "C_y",
            &plus(&product(after.get(MY), &ydd), after.get(CY)),
            &tau,
            0.0,
            allowed,
        );
        for method in Method::ALL {
            let (status, x) =
                forward(loaded, method, &[motion[0], motion[1], (TauY, &tau)], &[Ydd, Lambda]);
            assert_eq!(status, Status::Ok);
            assert_close(method.name(), &x[0], &ydd, 0.0, 100.0 * allowed);
            let (_, mine) = forward(
                loaded,
                Method::Recursion,
                &[motion[0], motion[1], (TauY, &tau)],
                &[Lambda],
            );
            assert_close(&format!("λ, {}", method.name()), &x[1], &mine[0], 0.0, 1e3 * allowed);
        }
    }
    let plain = Model::compile(&plain).unwrap();
    let loaded = Model::compile(&loaded).unwrap();
    check(&plain.model, &loaded.model, 1e-13);
    check(&plain.exact, &loaded.exact, 1e-27);
}

#[test]
fn terms_of_a_joint_of_several_freedoms_are_a_fault() {
    let damped = Terms { damping: 1.0, ..Terms::default() };
    let sprung = Terms { stiffness: 1.0, ..damped };
    for (kind, terms) in [(JointKind::Floating, damped), (JointKind::Spherical, sprung)] {
        let mut robot = rods(&[0.0], &[terms]);
        robot.joints[0].kind = kind;
        robot.submechanisms[0].active.clear();
        let error = Model::compile(&robot).unwrap_err().to_string();
        assert!(error.contains("pivot0") && error.contains("several freedoms"), "{error}");
    }
}

/// A damped ball at rest except for its rotation needs an additional moment of d ω.
#[test]
fn a_ball_joint_is_damped_in_each_direction() {
    let ball = |damping| {
        let mut robot = rods(&[0.0], &[Terms { damping, ..Terms::default() }]);
        robot.joints[0].kind = JointKind::Spherical;
        robot.submechanisms[0].active.clear();
        Model::compile(&robot).unwrap().model
    };
    let q = [0.1, -0.2, 0.3, 0.92736184954957];
    let omega = [1.0, -2.0, 0.5];
    let force = |model: Model<f64>| {
        let given = [(Y, &q[..]), (Yd, &omega[..]), (Ydd, &[0.0; 3][..])];
        Robot::new(model).ask(Request::InverseDynamics, &given, &[TauY]).ok().get(TauY).to_vec()
    };
    let damped = force(ball(0.75));
    let free = force(ball(0.0));
    for k in 0..3 {
        assert!((damped[k] - free[k] - 0.75 * omega[k]).abs() < 1e-14);
    }
}

/// A rotor of negative inertia reduces the mass matrix: beside the second joint the first has 2 −
/// 3/2 when bent by a right angle, and 1 − 3/2 when straight.
#[test]
fn a_mass_that_is_not_positive_has_a_status_by_every_method() {
    let none = Terms::default();
    let model =
        Model::compile(&rods(&[0.0, FRAC_PI_2], &[Terms { rotor_inertia: -1.5, ..none }, none]))
            .unwrap()
            .model;
    for (bend, expected) in
        [(0.0, Status::Ok), (-FRAC_PI_2, Status::MassNotPositive), (PI, Status::Ok)]
    {
        for method in Method::ALL {
            let (status, x) =
                forward(&model, method, &[(Y, &[0.3, bend]), (TauY, &[1.0, 1.0])], &[Ydd]);
            assert_eq!(status, expected, "{} at {bend}", method.name());
            assert_eq!(x[0][0].is_nan(), expected != Status::Ok);
        }
    }
}
