//! Loops that stand in the URDF, in the words of other programs.

use sarrus_dynamics::ClosureKind;
use sarrus_models::Loaded;

use super::*;

/// A four-bar, cut between the ends of coupler and rocker at (1, 0, 1), with `inside` behind it.
pub(super) fn four_bar(inside: &str) -> String {
    let link = |name: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="1"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#
        )
    };
    let joint = |name: &str, parent: &str, xyz: &str| {
        format!(
            r#"<joint name="{name}_joint" type="continuous"><parent link="{parent}"/>
            <child link="{name}"/><origin xyz="{xyz}"/><axis xyz="0 1 0"/></joint>"#
        )
    };
    format!(
        "<robot name=\"four_bar\"><link name=\"base\"/>{}{}{}{}{}{}{inside}</robot>",
        link("crank"),
        link("coupler"),
        link("rocker"),
        joint("crank", "base", "0 0 0"),
        joint("coupler", "crank", "0 0 1"),
        joint("rocker", "base", "1.2 0 0")
    )
}

/// The submechanism file of the four-bar with this loop.
fn yaml(cut: &str) -> String {
    let joints = "[crank_joint, coupler_joint, rocker_joint]";
    format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: bars\n  \
         jointnames_spanningtree: {joints}\n  jointnames_independent: [crank_joint]\n  \
         jointnames_active: [crank_joint]\n  loop_constraints:\n  - {cut}\n"
    )
}

pub(super) fn good(urdf: &str, yaml: Option<&str>) -> Loaded {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_cut_lies_between_the_frames_of_two_links() {
    let ends = r#"<link name="eye"/><link name="pin"/>
        <joint name="to_eye" type="fixed"><parent link="coupler"/><child link="eye"/>
          <origin xyz="1 0 0"/></joint>
        <joint name="to_pin" type="fixed"><parent link="rocker"/><child link="pin"/>
          <origin xyz="-0.2 0 1"/></joint>"#;
    let cut = "{frames: [eye, pin], cut_joint_type: planar_revolute, axis: [0, 1, 0]}";
    let loaded = good(&four_bar(ends), Some(&yaml(cut)));
    let model = &loaded.compiled.model;
    assert_eq!(model.loop_names(), ["eye_pin/b", "eye_pin/c"]);
    assert_eq!(model.closures()[0].kind, ClosureKind::Numerical);
    let apart = four_bar(&ends.replace("-0.2 0 1", "-0.2 0 1.001"));
    let reported = reported(&apart, &yaml(cut));
    assert!(reported.contains("open by 1.000e-3 m (or rad) at the zero pose"), "{reported}");
}

/// The four-bar's crank has a motor.
pub(super) const MOTOR: &str = r#"<transmission name="t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="crank_joint"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
    <actuator name="m"><mechanicalReduction>1</mechanicalReduction></actuator></transmission>"#;

/// The loop in the words of each program; each with the same meaning.
pub(super) const DIALECTS: [(&str, &str); 6] = [
    (
        "gazebo",
        r#"<gazebo><joint name="pin" type="revolute"><parent>coupler</parent><child>rocker</child>
        <pose>-0.2 0 1 0 0 0</pose><axis><xyz>0 1 0</xyz></axis></joint></gazebo>"#,
    ),
    (
        "URDF+",
        r#"<loop name="pin" type="revolute"><predecessor link="coupler"><origin xyz="1 0 0"/>
        </predecessor><successor link="rocker"><origin xyz="-0.2 0 1"/></successor>
        <axis xyz="0 1 0"/></loop>"#,
    ),
    (
        "Isaac Sim",
        r#"<loop_joint name="pin" type="revolute"><link1 link="coupler" xyz="1 0 0" rpy="0 0 0"/>
        <link1 link="rocker" xyz="-0.2 0 1" rpy="0 0 0"/><axis xyz="0 1 0"/></loop_joint>"#,
    ),
    (
        "an exporter",
        r#"<loop_joint name="pin" type="revolute"><parent link="coupler"/><child link="rocker"/>
        <parent_origin xyz="1 0 0"/><child_origin xyz="-0.2 0 1"/>
        <axis xyz="0 1 0" frame="parent"/></loop_joint>"#,
    ),
    (
        "urdfdom",
        r#"<constraint name="pin" type="revolute"><parent link="coupler"/>
        <parent_origin xyz="1 0 0" rpy="0 0 0"/><parent_axis xyz="0 1 0"/><child link="rocker"/>
        <child_origin xyz="-0.2 0 1" rpy="0 0 0"/><child_axis xyz="0 1 0"/></constraint>"#,
    ),
    (
        "Drake",
        r#"<drake:ball_constraint name="pin"><drake:ball_constraint_body_A name="coupler"/>
        <drake:ball_constraint_body_B name="rocker"/>
        <drake:ball_constraint_p_AP value="1 0 0"/>
        <drake:ball_constraint_p_BQ value="-0.2 0 1"/></drake:ball_constraint>"#,
    ),
];

#[test]
fn loops_of_the_urdf_need_no_submechanism_file() {
    let cut = "{cut_joint: pin, predecessor_body: coupler, successor_body: rocker, \
        predecessor_placement: {xyz: [1, 0, 0]}, successor_placement: {xyz: [-0.2, 0, 1]}, \
        cut_joint_type: revolute, axis: [0, 1, 0]}";
    let expected = good(&four_bar(""), Some(&yaml(cut)));
    let zero = |loaded: &Loaded| loaded.compiled.model.closures_at_zero()[0].cond_Kd;
    for (program, inside) in DIALECTS {
        let loaded = good(&four_bar(&format!("{inside}{MOTOR}")), None);
        let model = &loaded.compiled.model;
        assert_eq!(model.independent_names(), ["crank_joint"], "{program}");
        assert_eq!(model.active_names(), ["crank_joint"], "{program}");
        let closure = &model.closures()[0];
        assert_eq!((closure.name.as_str(), closure.rank), ("pin", 2), "{program}");
        assert!((zero(&loaded) / zero(&expected) - 1.0).abs() < 1e-9, "{program}");
        let reported = loaded.report.to_string();
        let of_redundancy = reported.lines().all(|line| line.contains("redundant"));
        let stray = program == "Drake" && reported.contains("the prefix `drake` is not declared");
        assert!(of_redundancy || stray, "{program}: {reported}");
    }
    // declared, as Drake's own files are
    let declared = four_bar(&format!("{}{MOTOR}", DIALECTS[5].1));
    let declared = with(&declared, "<robot ", "<robot xmlns:drake=\"http://drake.mit.edu\" ");
    assert_eq!(good(&declared, None).compiled.model.loop_names().len(), 3);
}

#[test]
fn a_loop_of_the_urdf_joins_the_submechanism_of_its_joints() {
    let serial = yaml("").replace("  loop_constraints:\n  - \n", "");
    let numerical = serial.replace("type: NUMERICAL", "type: FOURBAR");
    for (program, inside) in DIALECTS.iter().take(5) {
        let loaded = good(&four_bar(inside), Some(&numerical));
        let closure = &loaded.compiled.model.closures()[0];
        assert_eq!((closure.kind, closure.rank), (ClosureKind::Analytic, 2), "{program}");
        let twice =
            yaml("{frames: [rocker, coupler], cut_joint_type: planar_revolute, axis: [0, 1, 0]}");
        let reported = reported(&four_bar(inside), &twice);
        let line =
            "the loop `pin` of the URDF is that of `rocker_coupler`, expected each loop once";
        assert!(reported.contains(line), "{program}: {reported}");
    }
    let serial = serial.replace("NUMERICAL", "SERIAL");
    let serial = serial.replace("[crank_joint]", "[crank_joint, coupler_joint, rocker_joint]");
    let reported = reported(&four_bar(DIALECTS[0].1), &serial);
    assert!(reported.contains("the loop `pin` closes joints of the serial"), "{reported}");
}

#[test]
fn the_independents_of_a_loop_come_from_its_actuators_or_from_urdf_plus() {
    let plain = four_bar(DIALECTS[1].1);
    let reported = reported_of(plain.as_bytes(), None, false);
    let line =
        "submechanisms: [{type: NUMERICAL, contextual_name: pin, jointnames_independent: […]";
    assert!(reported.contains(line), "{reported}");
    assert!(reported.lines().all(|line| line.chars().count() <= 400), "{reported}");
    // a file with these lines is good
    let written = "submechanisms: [{type: NUMERICAL, contextual_name: pin, jointnames_independent: \
        [rocker_joint], jointnames_active: [crank_joint], jointnames_spanningtree: [crank_joint, \
        coupler_joint, rocker_joint]}]";
    let loaded = good(&plain, Some(written));
    assert_eq!(loaded.compiled.model.independent_names(), ["rocker_joint"]);
    assert_eq!(loaded.compiled.model.active_names(), ["crank_joint"]);
    let marked = plain.replace(
        "<joint name=\"rocker_joint\"",
        "<joint independent=\"True\" name=\"rocker_joint\"",
    );
    let loaded = good(&marked, None);
    assert_eq!(loaded.compiled.model.independent_names(), ["rocker_joint"]);
    let commanded = plain.replace(
        "</robot>",
        "<ros2_control name=\"c\" type=\"system\"><joint name=\"coupler_joint\">\
         <command_interface name=\"effort\"/></joint><joint name=\"crank_joint\">\
         <state_interface name=\"position\"/></joint></ros2_control></robot>",
    );
    let loaded = good(&commanded, None);
    assert_eq!(loaded.compiled.model.active_names(), ["coupler_joint"]);
}

#[test]
fn the_origin_of_a_loop_may_have_a_quaternion() {
    let condition = |inside: &str| {
        let urdf = four_bar(&format!("{inside}{MOTOR}"));
        let urdf = urdf.replace("<robot ", "<robot version=\"1.1\" ");
        good(&urdf, None).compiled.model.closures_at_zero()[0].cond_Kd
    };
    for (program, plain) in [DIALECTS[1], DIALECTS[2], DIALECTS[4]] {
        // a quarter turn about x, in which y is −z
        let quaternion = "quat_xyzw=\"0.7071067811865476 0 0 0.7071067811865476\"";
        let turned = plain.replace(" rpy=\"0 0 0\"", "");
        let turned = turned.replace("xyz=\"1 0 0\"", &format!("xyz=\"1 0 0\" {quaternion}"));
        let turned = turned.replace("xyz=\"-0.2 0 1\"", &format!("xyz=\"-0.2 0 1\" {quaternion}"));
        let turned = turned.replace("axis xyz=\"0 1 0\"", "axis xyz=\"0 0 -1\"");
        assert!((condition(&turned) / condition(plain) - 1.0).abs() < 1e-9, "{program}");
    }
    let gazebo = four_bar(&DIALECTS[0].1.replace("\"revolute\"", "\"cylindrical\""));
    let reported = reported_of(gazebo.as_bytes(), None, false);
    assert!(reported.contains("of type `cylindrical`, expected revolute"), "{reported}");
    assert!(!reported.contains("prismatic, cylindrical"), "{reported}");
}

#[test]
fn an_actuator_of_a_closing_joint_is_reported() {
    let motor = |of: &str| {
        format!(
            "{MOTOR}<transmission name=\"second\"><joint name=\"{of}\"/><actuator name=\"m\"/>\
             </transmission>"
        )
    };
    for (name, dialect) in [DIALECTS[0], DIALECTS[1]] {
        let on = |joint: &str| four_bar(&format!("{dialect}{}", motor(joint)));
        let found = "the closing joint `pin` has an actuator, which a cut cannot have";
        let reported = reported_of(on("pin").as_bytes(), None, false);
        assert!(reported.contains(found), "{name}: {reported}");
        let lenient = reported_of(on("pin").as_bytes(), None, true);
        assert!(lenient.contains(found), "{name}: {lenient}");
        assert!(!reported_of(on("rocker_joint").as_bytes(), None, false).contains(found));
    }
}

#[test]
fn a_loop_that_says_too_little_is_an_error_with_the_lines_to_write() {
    let gazebo = DIALECTS[0].1;
    for (inside, expected) in [
        (gazebo.replace("\"revolute\"", "\"revolute2\""), "the loop `pin` of type `revolute2`"),
        (gazebo.replace("<pose>", "<pose relative_to=\"crank\">"), "in another frame"),
        (gazebo.replace("<xyz>", "<xyz expressed_in=\"__model__\">"), "in another frame"),
        (
            gazebo.replace("<xyz>", "<use_parent_model_frame>1</use_parent_model_frame><xyz>"),
            "in another frame",
        ),
        (DIALECTS[1].1.replace("revolute", "rolling"), "the loop `pin` of type `rolling`"),
        (
            DIALECTS[1].1.replace("<successor", "<other").replace("/successor", "/other"),
            "two links",
        ),
        (DIALECTS[3].1.replace("1 0 0\"", "1 0 0\" rpy=\"0 0.1 0\""), "in a turned frame"),
        (DIALECTS[4].1.replace("revolute", "universal").replace("child_axis", "x"), "has one axis"),
        ("<drake:weld_constraint/>".to_owned(), "`drake:weld_constraint` is not read"),
        ("<drake:linear_bushing_rpy/>".to_owned(), "`drake:linear_bushing_rpy` is not read"),
    ] {
        let reported = reported_of(four_bar(&format!("{inside}{MOTOR}")).as_bytes(), None, false);
        assert!(reported.contains(expected), "{expected}: {reported}");
        assert!(reported.contains("loop_constraints: [{cut_joint: "), "{expected}: {reported}");
    }
    // a screw ties coordinates: no cut does
    let screw = four_bar(&gazebo.replace("\"revolute\"", "\"screw\""));
    let reported = reported_of(screw.as_bytes(), None, false);
    assert!(
        reported.contains("of type `screw`") && reported.contains("<mimic joint"),
        "{reported}"
    );
    let unknown = DIALECTS[0].1.replace("<parent>coupler", "<parent>model::copler");
    let reported = reported_of(four_bar(&unknown).as_bytes(), None, false);
    let expected = "names the link `copler`, expected a link of this file: coupler, rocker";
    assert!(reported.contains(expected), "{reported}");
}

/// How many robots are held in the world of Gazebo.
#[test]
fn a_joint_that_fixes_the_root_in_the_world_changes_nothing() {
    let fixed = r#"<gazebo><joint name="f" type="fixed"><parent>world</parent><child>base</child>
        </joint></gazebo>"#;
    let one = good(&four_bar(""), None);
    assert_eq!(good(&four_bar(fixed), None).description, one.description);
}

#[test]
fn a_coupling_of_urdf_plus_is_a_gear() {
    let gear = r#"<coupling name="g"><predecessor link="coupler"/><successor link="rocker"/>
        <ratio value="-3"/></coupling>"#;
    let loaded = good(&four_bar(gear), None);
    // −3 (crank + coupler) = rocker
    let coupling = loaded.description.joints[2].coupling.clone().unwrap();
    let mut terms = coupling.terms;
    terms.sort_by_key(|(joint, _)| *joint);
    assert_eq!(terms, [(0, -3.0), (1, -3.0)]);
    // the successor's joint is independent
    let marked =
        four_bar(gear).replace("name=\"rocker_joint\"", "independent=\"1\" name=\"rocker_joint\"");
    let loaded = good(&marked, None);
    assert_eq!(loaded.compiled.model.independent_names().len(), 2);
    assert!(loaded.compiled.model.independent_names().contains(&"rocker_joint".to_owned()));
    let wrong = four_bar(&gear.replace("<ratio value=\"-3\"/>", ""));
    let reported = reported_of(wrong.as_bytes(), None, false);
    assert!(reported.contains("write <mimic joint multiplier/>"), "{reported}");
}

#[test]
fn loops_have_names_of_their_own_and_bounds() {
    let twice = DIALECTS[1].1.repeat(2);
    let reported = reported_of(four_bar(&format!("{twice}{MOTOR}")).as_bytes(), None, false);
    assert!(reported.contains("a second loop is named `pin`"), "{reported}");
    // Drake's constraints bear no name: two balls make a hinge
    let ball = DIALECTS[5].1.replace(" name=\"pin\"", "");
    let other = ball.replace("1 0 0", "1 0.5 0").replace("-0.2 0 1", "-0.2 0.5 1");
    let loaded = good(&four_bar(&format!("{ball}{other}{MOTOR}")), None);
    let names = loaded.compiled.model.loop_names();
    assert_eq!((names[0].as_str(), names[3].as_str()), ("coupler_rocker/x", "coupler_rocker_2/x"));
    let many = reported_of(four_bar(&ball.repeat(1100)).as_bytes(), None, false);
    assert!(many.contains("the robot has 1100 loops, expected at most 1024"), "{many}");
}

#[test]
fn a_loop_between_links_that_do_not_move_is_a_warning() {
    let tip = r#"<link name="tip"/><joint name="hold" type="fixed"><parent link="crank"/>
        <child link="tip"/></joint>
        <gazebo><joint name="weld" type="fixed"><parent>crank</parent><child>tip</child></joint>
        </gazebo>"#;
    let loaded = good(&four_bar(tip), None);
    assert!(loaded.report.to_string().contains("the loop `weld` lies between links that do not"));
    assert_eq!(loaded.compiled.model.loop_names().len(), 0);
}

/// As GRBDA's six_bar and planar_leg_linkage: two of the joints are marked, and the zero pose is a
/// dead point where the gap is that of rounding.
#[test]
fn the_joints_that_urdf_plus_does_not_mark_dependent_are_independent() {
    let marked = |names: &[&str], urdf: String| {
        names.iter().fold(urdf, |urdf, name| {
            let joint = format!("<joint name=\"{name}\"");
            urdf.replace(&joint, &joint.replace("<joint", "<joint independent=\"false\""))
        })
    };
    let urdf = marked(&["coupler_joint", "rocker_joint"], four_bar(DIALECTS[1].1));
    let loaded = good(&urdf, None);
    assert_eq!(loaded.compiled.model.independent_names(), ["crank_joint"]);
    assert_eq!(loaded.compiled.model.active_names(), ["crank_joint"]);
    // stretched: 0.096 + 0.031 = 0.011 + 0.096 + 0.02 up to rounding
    let flat = urdf
        .replace("xyz=\"0 0 1\"/><axis", "xyz=\"0.096 0 0\"/><axis")
        .replace("1.2 0 0", "0.031 0 0")
        .replace("<origin xyz=\"1 0 0\"/>", "<origin xyz=\"0.031 0 0\"/>")
        .replace("<origin xyz=\"-0.2 0 1\"/>", "<origin xyz=\"0.0960000000000001 0 0\"/>");
    let reported = good(&flat, None).report.to_string();
    assert!(reported.contains("the zero pose is a dead point of pin"), "{reported}");
    // a loop that is open at zero says so
    let open = reported_of(urdf.replace("-0.2 0 1", "-0.2 0 1.1").as_bytes(), None, false);
    assert!(open.contains("a loop that is open by 1.000e-1 m (or rad)"), "{open}");
}
