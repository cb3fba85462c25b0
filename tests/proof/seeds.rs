//! Tabulated starts of numerical closures lead to the same pose as continuation from the zero pose.

use std::f64::consts::TAU;

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::{Field, Request, Status};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use Field::*;

/// Number of targets for each robot.
const TARGETS: u64 = 400;
/// Largest distance between two results for one assembly; near a singular pose neither is more
/// exact.
const SAME: f64 = 1e-7;

/// Random independents, near or far.
fn target(case: &Case, seeded: &mut Seeded, far: f64) -> Vec<f64> {
    let model = &case.compiled.model;
    let mut y = case.state::<f64>(seeded.bits() % 1000).y;
    for (y, name) in y.iter_mut().zip(model.independent_q_names()) {
        let joint = case.description.joints.iter().find(|joint| joint.name == *name);
        match joint.map(|joint| joint.kind) {
            Some(JointKind::Prismatic) => *y = seeded.within(-far, far) * case.scale,
            Some(_) => *y = seeded.within(-far, far),
            // a part of a quaternion
            None => {}
        }
    }
    y
}

#[test]
fn seeds_lead_to_the_assembly_that_continuation_reaches() {
    let mut compared = 0;
    let mut fewer = 0;
    let mut more = 0;
    let mut worst = (0.0_f64, String::new());
    for case in robots() {
        let model = &case.compiled.model;
        let mut robot = Robot::new(model.clone());
        let mut seeded = Seeded::new(case.seed + 97);
        let mut zero = case.state::<f64>(0).y;
        zero.iter_mut().zip(model.independent_q_names()).for_each(|(y, name)| {
            if !name.contains('/') {
                *y = 0.0;
            }
        });
        let zero = robot.ask(Request::Kinematics, &[(Y, &zero)], &[Q]);
        if zero.answer.status != Status::Ok {
            continue;
        }
        let zero = zero.get(Q).to_vec();
        let slides = |k: usize| {
            let joints = &case.description.joints;
            let of = |name: &str| joints.iter().find(|joint| joint.name == name);
            of(&model.tree_q_names()[k]).is_none_or(|joint| joint.kind == JointKind::Prismatic)
        };
        for k in 0..TARGETS {
            let y = target(case, &mut seeded, [0.3, 0.8, 1.6, 3.2][k as usize % 4]);
            let want = [Q, Qd, Residual, Iterations];
            let yd = seeded.numbers(model.sizes().n_vy, 1.0);
            let without = robot.ask(Request::Kinematics, &[(Y, &y), (Yd, &yd)], &want);
            let given = [(Y, y.as_slice()), (Yd, yd.as_slice()), (QGuess, zero.as_slice())];
            let with = robot.ask(Request::Kinematics, &given, &want);
            if with.answer.status != Status::Ok {
                continue;
            }
            assert_eq!(without.answer.status, Status::Ok, "{} target {k}: {y:?}", case.name);
            let steps = [&without, &with].map(|x| x.get(Iterations)[0]);
            compared += 1;
            fewer += usize::from(steps[0] < steps[1]);
            more += usize::from(steps[0] > steps[1]);
            for (i, (a, b)) in without.get(Q).iter().zip(with.get(Q)).enumerate() {
                let apart = a - b;
                let apart = if slides(i) {
                    apart.abs() / case.scale
                } else {
                    (apart - TAU * (apart / TAU).round()).abs()
                };
                if apart > worst.0 {
                    worst = (apart, format!("{} target {k}: {y:?}", case.name));
                }
            }
        }
    }
    println!("{compared} answers, {fewer} in fewer steps and {more} in more; apart by {worst:?}");
    assert!(worst.0 < SAME, "{worst:?}");
    assert!(fewer > compared / 10 && more < fewer / 10, "{fewer} fewer, {more} more");
}

#[test]
fn seeds_of_the_bundled_robots_take_the_place_of_continuation() {
    for name in ["wrist", "five_bar", "squeezer", "delta", "active_ankle"] {
        let case = Case::bundled(name);
        let mut robot = Robot::new(case.compiled.model.clone());
        let mut steps = [0.0; 2];
        for k in 0..64 {
            let y = case.state::<f64>(k).y;
            let without = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, Iterations]).ok();
            let zero = vec![0.0; without.get(Q).len()];
            let guess = [(Y, y.as_slice()), (QGuess, zero.as_slice())];
            let with = robot.ask(Request::Kinematics, &guess, &[Iterations]).ok();
            steps[0] += without.get(Iterations)[0];
            steps[1] += with.get(Iterations)[0];
        }
        assert!(2.0 * steps[0] < steps[1], "{name}: {steps:?}");
    }
}
