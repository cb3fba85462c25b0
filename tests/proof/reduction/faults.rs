//! Locks that are refused, and their errors.

use sarrus_dynamics::{Lock, Model, locked};
use sarrus_tests::cases::Case;

use super::joint;

/// Errors of locks by joint name.
fn fault(case: &Case, locks: &[(&str, Option<f64>)]) -> String {
    let lock = |(name, position): &(&str, Option<f64>)| Lock {
        joint: joint(case, name),
        position: *position,
    };
    let locks: Vec<Lock> = locks.iter().map(lock).collect();
    let errors = locked(&case.description, &locks).unwrap_err().errors;
    errors.iter().map(|of| format!("{}; {}; {}", of.found, of.expected, of.help)).collect()
}

#[test]
fn a_position_that_no_loop_reaches_is_a_fault_that_names_the_joints() {
    let case = Case::bundled("wrist");
    let said = fault(&case, &[("WristPitch", Some(0.1)), ("WristRoll", Some(2.0))]);
    assert!(said.contains("WristPitch at 0.1, WristRoll at 2"), "{said}");
}

#[test]
fn a_position_beyond_the_limits_is_held_and_said() {
    let case = Case::bundled("torso");
    let locks = [Lock { joint: joint(&case, "BodyPitch"), position: Some(1.6) }];
    let reduced = locked(&case.description, &locks).unwrap();
    let said: Vec<&str> = reduced.warnings.iter().map(|of| of.found.as_str()).collect();
    assert!(said.contains(&"the joint BodyPitch held at 1.6"), "{said:?}");
}

#[test]
fn joints_that_others_hold_already_cannot_be_held_elsewhere() {
    let case = Case::bundled("torso");
    let both = [("BodyPitch", Some(0.1)), ("BodyRoll", Some(0.0)), ("BodyActL", Some(0.3))];
    let said = fault(&case, &both);
    assert!(said.contains("BodyActL locked at 0.3, where its loop is open"), "{said}");
    // locked at the values that the other locks give
    let three = [("BodyActL", None), ("BodyActR", None), ("BodyBL1", None)];
    let three = three.map(|(name, position)| Lock { joint: joint(&case, name), position });
    let reduced = locked(&case.description, &three).unwrap();
    assert_eq!(Model::compile(&reduced.description).unwrap().model.sizes().n_v, 0);
    let delta = Case::bundled("delta");
    let said = fault(&delta, &[("platform_rx", None)]);
    assert!(said.contains("platform_rx, which never moves"), "{said}");
}

#[test]
fn positions_that_are_no_numbers_and_joints_that_are_fixed_are_faults() {
    let case = Case::bundled("torso");
    assert!(fault(&case, &[("BodyPitch", Some(f64::NAN))]).contains("a finite number"));
    let fixed = case.description.joints.iter();
    let fixed = fixed.clone().find(|of| of.kind == sarrus_dynamics::description::JointKind::Fixed);
    if let Some(fixed) = fixed {
        assert!(fault(&case, &[(&fixed.name, None)]).contains("which is fixed"));
    }
    let lock = Lock { joint: 1000, position: None };
    locked(&case.description, &[lock]).unwrap_err();
    let floating = Case::bundled("stewart_floating");
    let joint = floating.description.joints.iter();
    let joint =
        joint.clone().find(|of| of.kind == sarrus_dynamics::description::JointKind::Floating);
    let said = fault(&floating, &[(&joint.unwrap().name, Some(0.1))]);
    assert!(said.contains("several degrees of freedom"), "{said}");
}

#[test]
fn a_robot_that_is_held_whole_has_no_joint_left() {
    for robot in ["lambda", "torso", "stewart", "stewart_floating", "five_bar"] {
        let case = Case::bundled(robot);
        let independent = case.description.submechanisms.iter().flat_map(|of| &of.independent);
        let locks: Vec<Lock> = independent.map(|j| Lock { joint: *j, position: None }).collect();
        let reduced = locked(&case.description, &locks).unwrap();
        let model = sarrus_dynamics::Model::compile(&reduced.description).unwrap().model;
        assert_eq!([model.sizes().n_q, model.sizes().n_c, model.closures().len()], [0; 3]);
        assert_eq!(model.link_names(), case.compiled.model.link_names());
    }
}
