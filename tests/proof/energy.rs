//! Motion over time: forward dynamics keeps the energy, and without gravity a robot at rest stays
//! at rest.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, Model, Request};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::Robot;
use sarrus_tests::small::{minus, plus, times};

use crate::derivatives::{energy, frames, in_joints, moved};

/// One step of the classical Runge-Kutta method without any force on the actuators.
fn step(case: &Case, robot: &mut Robot<Dd>, state: &State<Dd>, h: f64) -> State<Dd> {
    let no_force = vec![Dd::from(0.0); robot.model.sizes().n_vy];
    let mut at = |y: &[Dd], yd: &[Dd]| -> Vec<Dd> {
        let given = [(Field::Y, y), (Field::Yd, yd), (Field::TauY, no_force.as_slice())];
        robot.ask(Request::ForwardDynamics, &given, &[Field::Ydd]).ok().get(Field::Ydd).to_vec()
    };
    let half = Dd::from(0.5 * h);
    let h = Dd::from(h);
    let y = &state.y;
    let v1 = &state.yd;
    let a1 = at(y, v1);
    let v2 = plus(v1, &times(half, &a1));
    let a2 = at(&moved(case, y, v1, half), &v2);
    let v3 = plus(v1, &times(half, &a2));
    let a3 = at(&moved(case, y, &v2, half), &v3);
    let v4 = plus(v1, &times(h, &a3));
    let a4 = at(&moved(case, y, &v3, h), &v4);
    let mean = |a: &[Dd], b: &[Dd], c: &[Dd], d: &[Dd]| {
        let sum = |k: usize| a[k] + b[k] + b[k] + c[k] + c[k] + d[k];
        (0..a.len()).map(|k| sum(k) / Dd::from(6.0)).collect::<Vec<Dd>>()
    };
    let yd = plus(v1, &times(h, &mean(&a1, &a2, &a3, &a4)));
    State { y: moved(case, y, &mean(v1, &v2, &v3, &v4), h), yd, ydd: a1 }
}

#[test]
fn energy_is_kept_to_the_order_of_the_integrator() {
    // a quaternion needs another integrator
    let damped =
        |case: &Case| case.description.joints.iter().any(|joint| joint.terms.damping != 0.0);
    let cases = robots().iter().filter(|case| {
        !case.floats()
            && !damped(case)
            && (case.seed >= 1000 || case.seed % 10 == 1 || case.seed % 20 == 18)
    });
    Ledger::over(cases, |case, ledger| {
        let mut robot = Robot::new(case.compiled.exact.clone());
        let slow = |x: &[Dd]| times(Dd::from(0.3), x);
        let start = case.state::<Dd>(0);
        let start = State { y: slow(&start.y), yd: slow(&start.yd), ydd: start.ydd };
        let all = |robot: &mut Robot<Dd>, state: &State<Dd>| {
            let (pose, twist) = frames(robot, state);
            let (kinetic, potential) = energy(case, &pose, &twist);
            let given = [(Field::Y, state.y.as_slice()), (Field::Yd, &state.yd)];
            let x = robot.ask(Request::Kinematics, &given, &[Field::Q, Field::Qd]).ok();
            let [rotors, springs, _] =
                in_joints(case, &robot.model, x.get(Field::Q), x.get(Field::Qd));
            (kinetic + rotors, potential + springs)
        };
        let mut after = |steps: u32| {
            (0..steps).fold(start.clone(), |state, _| {
                step(case, &mut robot, &state, 8e-3 / f64::from(steps))
            })
        };
        let [coarse, fine, finest] = [4, 8, 16].map(&mut after);
        let (kinetic, potential) = all(&mut robot, &start);
        let (after_kinetic, after_potential) = all(&mut robot, &finest);
        let drift = ((after_kinetic + after_potential) - (kinetic + potential)).to_f64().abs();
        ledger.note(
            "energy drift in 16 steps of 0.5 ms",
            case,
            drift / kinetic.to_f64().max(after_kinetic.to_f64()),
            1e-8,
        );
        // half the step reduces the error of a fourth-order method sixteenfold
        let gap = |a: &State<Dd>, b: &State<Dd>| largest(&minus(&a.yd, &b.yd));
        let wide = gap(&coarse, &fine);
        let narrow = gap(&fine, &finest);
        if wide > 1e-24 {
            ledger.note(
                "order of convergence less four",
                case,
                ((wide / narrow).log2() - 4.0).abs(),
                0.7,
            );
        }
    });
}

#[test]
fn without_gravity_nothing_pulls() {
    // springs pull and damping is linear in the velocities
    Ledger::over(robots().iter().filter(|case| !case.has_terms()).step_by(2), |case, ledger| {
        let weightless = Description { gravity: [0.0; 3], ..case.description.clone() };
        let mut robot = Robot::new(Model::compile(&weightless).unwrap().model);
        let state = case.state::<f64>(0);
        let rest = robot
            .ask(
                Request::InverseDynamics,
                &[(Field::Y, &state.y)],
                &[Field::TauQ, Field::TauY, Field::CY],
            )
            .ok();
        for field in [Field::TauQ, Field::TauY, Field::CY] {
            assert!(rest.get(field).iter().all(|x| *x == 0.0), "{field:?} {:?}", rest.get(field));
        }
        // the remaining C_y is quadratic in the velocities
        let mut bias = |factor: f64| {
            let yd = times(factor, &state.yd);
            robot
                .ask(
                    Request::InverseDynamics,
                    &[(Field::Y, &state.y), (Field::Yd, &yd)],
                    &[Field::CY, Field::TauQ],
                )
                .ok()
        };
        let once = bias(1.0);
        let twice = bias(2.0);
        let size = 4.0 * largest(once.get(Field::TauQ));
        ledger.compare(
            "C_y(2 ẏ) = 4 C_y(ẏ)",
            case,
            &times(4.0, once.get(Field::CY)),
            twice.get(Field::CY),
            size,
            1e-14,
        );
    });
}
