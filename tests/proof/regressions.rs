//! Faults reported by users and reviews, each with the smallest robot that shows it.

use sarrus_dynamics::description::{JointKind, SubmechanismKind};
use sarrus_dynamics::{Field, Model, Request, Status};
use sarrus_tests::cases::Case;
use sarrus_tests::draft::Draft;
use sarrus_tests::run::Robot;

use Field::*;

#[test]
fn idle_freedoms_behind_a_ball_joint_are_named_as_they_stand_still() {
    // a universal joint on two struts, each between two balls
    let mut draft = Draft::new(5, SubmechanismKind::Numerical, true);
    let (first, link) = draft.turn(0, [0.0; 3], [1.0, 0.0, 0.0]);
    let (second, platform) = draft.turn(link, [0.0; 3], [0.0, 1.0, 0.0]);
    let mut sliders = vec![];
    for side in [1.0, -1.0] {
        let foot = [0.2 * side, 0.2, -0.5];
        let head = [0.23 * side, 0.25, 0.1];
        let (_, rod) = draft.joint(JointKind::Spherical, 0, foot, [0.0, 0.0, 1.0]);
        let (slider, end) = draft.slide(rod, foot, [0.03 * side, 0.05, 0.6]);
        draft.cut(end, platform, head, &[], &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        sliders.push(slider);
    }
    draft.roles(&[(first, 0.2), (second, 0.2)], &sliders);
    let model =
        Model::compile(&draft.description()).unwrap_or_else(|errors| panic!("{errors:?}")).model;

    let mut robot = Robot::new(model);
    let [one, other] = [[0.11, -0.07], [-0.05, 0.13]]
        .map(|y| robot.ask(Request::Kinematics, &[(Y, &y)], &[G]).ok());
    let still = |v: usize| {
        [&one, &other].iter().all(|answer| answer.get(G)[2 * v..2 * v + 2] == [0.0, 0.0])
    };
    let names = robot.model.tree_names();
    let locked: Vec<&String> = (0..names.len()).filter(|v| still(*v)).map(|v| &names[v]).collect();
    let mut reported: Vec<&String> = robot.model.closures()[0].idle.iter().collect();
    reported.sort_by_key(|name| names.iter().position(|of| of == *name));
    assert_eq!((reported.len(), reported), (2, locked));
}

#[test]
fn asking_for_good_independents_does_not_take_an_answer_away() {
    // nearly flat, where K nearly loses rank; and an unreachable platform
    let flat =
        [1e-3, 1e-4, 1e-6].map(|off| ("four_bars_2", vec![off - std::f64::consts::FRAC_PI_2]));
    let far = [("stewart", vec![1e4; 6])];
    for (name, y) in flat.into_iter().chain(far) {
        let mut robot = Robot::new(Case::bundled(name).compiled.model);
        let answer = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, GoodIndependents]).ok();
        let good = answer.get(GoodIndependents).iter().filter(|x| **x == 1.0).count();
        assert_eq!(good, y.len(), "{name} at {y:?}");
    }
}

#[test]
fn a_loop_that_is_singular_at_zero_is_warned_of_and_called_singular() {
    // rod and rocker in one line
    let mut draft = Draft::new(6, SubmechanismKind::Numerical, true);
    let up = [0.0, 0.0, 1.0];
    let along = [0.25, 0.125, 0.0];
    let (crank, arm) = draft.turn(0, [0.0; 3], up);
    let (_, rod) = draft.turn(arm, [0.0, 0.125, 0.0], up);
    let (_, rocker) = draft.turn(0, [0.5, 0.125, 0.0], up);
    draft.cut(rod, rocker, along, &[], &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    draft.roles(&[(crank, 0.2)], &[crank]);
    let compiled =
        Model::compile(&draft.description()).unwrap_or_else(|errors| panic!("{errors:?}"));
    assert!(
        compiled.warnings.iter().any(|warning| warning.found.contains("singular at the zero pose")),
        "{:?}",
        compiled.warnings
    );

    let mut robot = Robot::new(compiled.model);
    for y in [0.0, 0.1, -0.1] {
        let status = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).answer.status;
        assert_eq!(status, Status::SingularIndependents, "{y}");
    }
}

#[test]
fn an_angle_of_which_a_double_knows_nothing_is_no_finite_input() {
    let mut robot = Robot::new(Case::bundled("lambda").compiled.model);
    let status = robot.ask(Request::InverseDynamics, &[(Y, &[1e14])], &[TauY]).answer.status;
    assert_eq!(status, Status::NonFiniteInput);
}
