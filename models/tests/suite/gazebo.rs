//! Elements inside `<gazebo>`, and terms of closing joints.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use sarrus_dynamics::description::{Cut, Description, Terms};

use super::dialects::{DIALECTS, MOTOR, four_bar, good};
use super::*;

/// The four-bar with its loop, a motor and these lines; the report without redundant rows.
fn report(inside: &str, lenient: bool) -> String {
    let urdf = four_bar(&format!("{}{MOTOR}{inside}", DIALECTS[1].1));
    let reported = reported_of(urdf.as_bytes(), None, lenient);
    reported.lines().filter(|line| !line.contains("redundant")).collect()
}

fn described(inside: &str) -> Description {
    good(&four_bar(inside), None).description
}

#[test]
fn an_element_that_changes_the_dynamics_is_an_error_or_a_warning_when_lenient() {
    for (inside, found) in [
        ("<gravity>0</gravity>", "`gravity`"),
        ("<gravity>false</gravity>", "`gravity`"),
        ("<turnGravityOff>true</turnGravityOff>", "`turnGravityOff`"),
        ("<dampingFactor>0.01</dampingFactor>", "`dampingFactor`"),
        ("<kinematic>1</kinematic>", "`kinematic`"),
        ("<static>true</static>", "`static`"),
        ("<velocity_decay><linear>1</linear></velocity_decay>", "`velocity_decay`"),
        ("<model name=\"m\"><joint name=\"j\" type=\"fixed\"/></model>", "`model`"),
        ("<link name=\"more\"/>", "`link`"),
        ("<pose>0 0 1 0 0 0</pose>", "`pose`"),
    ] {
        let of_rocker = format!("<gazebo reference=\"rocker\">{inside}</gazebo>");
        let line = format!("{found} in `gazebo` of `rocker` changes the dynamics");
        let [strict, lenient] = [false, true].map(|lenient| report(&of_rocker, lenient));
        assert!(strict.contains(&line), "{inside}: {strict}");
        assert!(strict.contains("or take it as it is with --lenient"), "{inside}: {strict}");
        assert!(lenient.contains(&line) && !lenient.contains("--lenient"), "{inside}: {lenient}");
    }
    // the attitude of the whole robot turns gravity, its place does not
    assert!(report("<gazebo><pose>0 0 1 0 0.1 0</pose></gazebo>", false).contains("`pose` in"));
    let link = four_bar("")
        .replace("<link name=\"base\"/>", "<link name=\"base\"><gravity>0</gravity></link>");
    let of_link = reported_of(link.as_bytes(), None, false);
    assert!(of_link.contains("`gravity` in `gazebo` of `base` changes"), "{of_link}");
}

#[test]
fn elements_that_say_what_the_model_has_or_concern_contacts_are_silent() {
    for inside in [
        "<gravity>true</gravity><turnGravityOff>0</turnGravityOff>",
        "<dampingFactor>0.0</dampingFactor><static>0</static>",
        "<mu1>0.2</mu1><kp>1e6</kp><material>Gazebo/Grey</material><maxVel>1</maxVel>",
        "<implicitSpringDamper>1</implicitSpringDamper><stopErp>0.2</stopErp>",
        "<plugin filename=\"libgazebo_ros_control.so\" name=\"c\"><joint>x</joint></plugin>",
        "<sensor type=\"imu\" name=\"s\"/>",
    ] {
        let found = report(&format!("<gazebo reference=\"rocker\">{inside}</gazebo>"), false);
        assert_eq!(found, "", "{inside}");
    }
    assert_eq!(report("<gazebo><pose>0 0 1 0 0 0</pose></gazebo>", false), "");
    let unknown = report("<gazebo reference=\"rocker\"><turnOff>1</turnOff></gazebo>", false);
    assert!(unknown.contains("the element `turnOff` in `gazebo` of `rocker` is not known"));
}

#[test]
fn a_spring_of_gazebo_is_the_joints_spring() {
    let spring = "<gazebo reference=\"rocker_joint\"><springReference>0.2</springReference>\
        <springStiffness>20</springStiffness></gazebo>";
    let read = described(spring);
    let expected = Terms { stiffness: 20.0, rest: 0.2, ..Terms::default() };
    assert_eq!(read.joints[2].terms, expected);
    // in two elements, beside the same one in URDF
    let parts = spring.replace(
        "</springReference>",
        "</springReference></gazebo><gazebo \
        reference=\"rocker_joint\">",
    );
    let twice = four_bar(&parts).replace(
        "<origin xyz=\"1.2 0 0\"/>",
        "<origin xyz=\"1.2 0 0\"/>\
        <dynamics spring_stiffness=\"20\" spring_reference=\"0.2\"/>",
    );
    assert_eq!(good(&twice, None).description.joints[2].terms, expected);
    let other = reported_of(twice.replace("\"20\"", "\"30\"").as_bytes(), None, false);
    assert!(other.contains("the joint `rocker_joint` has a second spring"), "{other}");
    let nobody = four_bar(&spring.replace("rocker_joint", "roker_joint"));
    let nobody = reported_of(nobody.as_bytes(), None, false);
    assert!(nobody.contains("the spring belongs to the joint `roker_joint`, which does not exist"));
    assert!(nobody.contains("did you mean `rocker_joint`?"), "{nobody}");
}

#[test]
fn a_mimic_plugin_is_a_coupling() {
    let plugin = "<gazebo><plugin filename=\"libroboticsgroup_gazebo_mimic_joint_plugin.so\" \
        name=\"p\"><joint>crank_joint</joint><mimicJoint>rocker_joint</mimicJoint>\
        <multiplier>-2</multiplier><offset>0.1</offset></plugin></gazebo>";
    let coupling = described(plugin).joints[2].coupling.clone().unwrap();
    assert_eq!((&coupling.terms[..], coupling.offset), (&[(0, -2.0)][..], 0.1));
    // published files have both
    let mimic = "<mimic joint=\"crank_joint\" multiplier=\"-2\" offset=\"0.1\"/></joint>";
    let urdf = four_bar(plugin);
    let end = urdf.rfind("</joint><gazebo").unwrap();
    let both = format!("{}{mimic}{}", &urdf[..end], &urdf[end + "</joint>".len()..]);
    assert_eq!(good(&both, None).description.joints[2].coupling.clone().unwrap(), coupling);
    let other = reported_of(both.replace("offset=\"0.1\"", "").as_bytes(), None, false);
    assert!(other.contains("the joint `rocker_joint` is coupled a second time"), "{other}");
    let silent = report("<gazebo><plugin name=\"mimic\" filename=\"x\"/></gazebo>", false);
    assert!(silent.contains("a plug-in that couples joints, without `joint`"), "{silent}");
}

#[test]
fn damping_or_a_spring_of_a_closing_joint_is_an_error() {
    let sdf =
        |term: &str| DIALECTS[0].1.replace("</xyz>", &format!("</xyz><dynamics>{term}</dynamics>"));
    let of_urdf = |n: usize, end: &str| {
        let dynamics = "<dynamics damping=\"0.5\" friction=\"0.1\"/>";
        DIALECTS[n].1.replace(end, &format!("{dynamics}{end}"))
    };
    for (inside, terms) in [
        (sdf("<damping>0.5</damping>"), "damping"),
        (sdf("<spring_stiffness>5</spring_stiffness>"), "spring_stiffness"),
        (of_urdf(1, "</loop>"), "damping, friction"),
        (of_urdf(2, "</loop_joint>"), "damping, friction"),
        (of_urdf(4, "</constraint>"), "damping, friction"),
    ] {
        let [strict, lenient] = [false, true].map(|lenient| {
            reported_of(four_bar(&format!("{inside}{MOTOR}")).as_bytes(), None, lenient)
        });
        let line = format!("the closing joint `pin` has {terms}, which a cut cannot have");
        assert!(strict.contains(&line) && strict.contains("--lenient"), "{inside}: {strict}");
        assert!(lenient.contains(&line), "{inside}: {lenient}");
    }
    let none = sdf("<damping>0</damping><spring_stiffness>0</spring_stiffness>");
    let none = good(&four_bar(&format!("{none}{MOTOR}")), None);
    assert!(none.report.to_string().lines().all(|line| line.contains("redundant")));
    let friction = four_bar(&format!("{}{MOTOR}", sdf("<friction>0.1</friction>")));
    let friction = reported_of(friction.as_bytes(), None, false);
    assert!(friction.contains("the closing joint `pin` has dry friction"), "{friction}");
    let mimic = DIALECTS[0].1.replace("</xyz>", "</xyz><mimic joint=\"crank_joint\"/>");
    let mimic = reported_of(four_bar(&format!("{mimic}{MOTOR}")).as_bytes(), None, false);
    assert!(mimic.contains("the closing joint `pin` is coupled"), "{mimic}");
}

/// The cut of a loop whose pose is turned by a right angle about y.
#[test]
fn a_pose_may_be_in_degrees_or_have_a_quaternion() {
    let posed = |attributes: &str, angles: &str| {
        let pose = format!("<pose{attributes}>-0.2 0 1 {angles}</pose>");
        DIALECTS[0].1.replace("<pose>-0.2 0 1 0 0 0</pose>", &pose)
    };
    let placed = |inside: &str| {
        let read = good(&four_bar(&format!("{inside}{MOTOR}")), None).description;
        let Cut::Placed { predecessor, .. } = read.submechanisms[0].loops[0].cut else { panic!() };
        predecessor
    };
    let r = FRAC_1_SQRT_2;
    for (attributes, angles) in [
        ("", format!("0 {FRAC_PI_2} 0")),
        (" degrees=\"false\"", format!("0 {FRAC_PI_2} 0")),
        (" degrees=\"true\"", "0 90 0".to_owned()),
        (" degrees=\"1\" rotation_format=\"euler_rpy\"", "0 90 0".to_owned()),
        (" rotation_format=\"quat_xyzw\"", format!("0 {r} 0 {r}")),
    ] {
        let found = placed(&posed(attributes, &angles));
        assert_eq!(found.xyz, [-0.2, 0.0, 1.0], "{attributes}");
        let gap = found.rpy.iter().zip([0.0, FRAC_PI_2, 0.0]).map(|(a, b)| (a - b).abs());
        assert!(gap.fold(0.0, f64::max) < 1e-15, "{attributes}: {:?}", found.rpy);
    }
    for (attributes, angles, expected) in [
        (" degrees=\"yes\"", "0 90 0", "`degrees` of `pose` is `yes`"),
        (" rotation_format=\"axis\"", "0 90 0", "the rotation format `axis`"),
        (" degrees=\"true\" rotation_format=\"quat_xyzw\"", "0 0 0 1", "without degrees"),
        (" rotation_format=\"quat_xyzw\"", "0 0 0 2", "has the length 2"),
    ] {
        let urdf = four_bar(&format!("{}{MOTOR}", posed(attributes, angles)));
        let reported = reported_of(urdf.as_bytes(), None, false);
        assert!(reported.contains(expected), "{expected}: {reported}");
    }
}

#[test]
fn axes_of_a_constraint_that_disagree_at_zero_leave_it_open_by_their_angle() {
    let with_axis = |axis: &str| {
        let own = format!("<child_axis xyz=\"{axis}\"/>");
        four_bar(&format!("{}{MOTOR}", DIALECTS[4].1.replace("<child_axis xyz=\"0 1 0\"/>", &own)))
    };
    for (axis, gap) in [("1 0 0", "1.571e0"), ("0.1 1 0", "9.967e-2"), ("1e-5 1 0", "1.000e-5")] {
        let reported = reported_of(with_axis(axis).as_bytes(), None, false);
        let line = format!("the axes of the loop `pin` are {gap} rad apart at the zero pose");
        assert!(reported.contains(&line), "{axis}: {reported}");
        // an axis that is tilted further leaves no motion
        let open = format!("a loop that is open by {gap} m (or rad) at the zero pose");
        assert!(reported.contains(&open) || reported.contains("mobility 0"), "{axis}: {reported}");
    }
    // the length and the sign of an axis do not count, and its frame may be turned
    for axis in ["0 3 0", "0 -1 0"] {
        good(&with_axis(axis), None);
    }
    let turned = with_axis("1 0 0").replace(
        "<child_origin xyz=\"-0.2 0 1\" rpy=\"0 0 0\"/>",
        &format!("<child_origin xyz=\"-0.2 0 1\" rpy=\"0.3 0 {FRAC_PI_2}\"/>"),
    );
    let loaded = good(&turned, None);
    assert_eq!(loaded.compiled.model.closures()[0].rank, 2);
}
