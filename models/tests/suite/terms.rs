//! Joints of several freedoms; damping, springs and rotors of joints.

use sarrus_dynamics::description::{Friction, JointKind, Terms};

use super::*;

/// The lambda with this inside its elbow joint.
fn with_dynamics(dynamics: &str) -> String {
    with(URDF, "<limit lower=\"-1.5\"", &format!("{dynamics}<limit lower=\"-1.5\""))
}

/// The lambda with this behind its joints.
fn with_transmission(transmission: &str) -> String {
    with(URDF, "</robot>", &format!("{transmission}\n</robot>"))
}

fn elbow(urdf: &str) -> (Terms, String) {
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(YAML.into()) };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    (loaded.description.joints[0].terms, loaded.report.to_string())
}

/// The lambda on a ball joint of this type.
fn on_a_ball(kind: &str, inside: &str) -> String {
    let ball = format!(
        "<link name=\"world\"/><joint name=\"ball\" type=\"{kind}\"><parent link=\"world\"/><child \
         link=\"base\"/>{inside}</joint>\n</robot>"
    );
    let heavy = "<link name=\"base\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" \
        ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>";
    with(&with(URDF, "</robot>", &ball), "<link name=\"base\"/>", heavy)
}

#[test]
fn the_names_of_sdf_are_read_from_dynamics() {
    let (terms, reported) = elbow(&with_dynamics(
        "<dynamics damping=\"0.5\" friction=\"0\" spring_stiffness=\"20\" \
         spring_reference=\"-0.25\"/>",
    ));
    assert_eq!(terms, Terms { damping: 0.5, stiffness: 20.0, rest: -0.25, ..Terms::default() });
    assert_eq!(reported, "");
    assert_eq!(elbow(URDF).0, Terms::default());
}

#[test]
fn dry_friction_is_read_and_the_report_names_the_request_that_counts_it() {
    let (terms, reported) = elbow(&with_dynamics("<dynamics damping=\"0\" friction=\"0.1\"/>"));
    assert_eq!(terms.friction, Friction { coulomb: 0.1, ..Friction::default() });
    let expected = "robot.urdf:27:5: the joint `elbow` has dry friction, which counts only on request, \
        expected `damping`, ask with \"friction\": true, or simulate with --friction\n";
    assert_eq!(reported, expected);
}

#[test]
fn a_rotor_is_read_from_a_transmission_or_from_dynamics() {
    let expected = Terms { rotor_inertia: 1e-4, gear_ratio: 50.0, ..Terms::default() };
    let drake = "<transmission><actuator name=\"m\"><drake:rotor_inertia value=\"1e-4\"/><drake:gear_ratio value=\"50\"/></actuator>\
        <joint name=\"elbow\"/></transmission>";
    let declared =
        with(&with_transmission(drake), "<robot ", "<robot xmlns:drake=\"http://drake.mit.edu\" ");
    assert_eq!(elbow(&declared), (expected, String::new()));
    let (terms, reported) = elbow(&with_transmission(drake));
    assert_eq!(terms, expected);
    let warning = "robot.urdf:42:34: the prefix `drake` is not declared, expected \
        xmlns:drake=\"…\" on the outermost element, declare it\n";
    assert_eq!(reported, warning);
    let reduction = "<transmission><actuator name=\"m\"><mechanicalReduction>50</mechanicalReduction><rotor_inertia value=\"1e-4\"/></actuator>\
        <joint name=\"elbow\"/></transmission>";
    assert_eq!(elbow(&with_transmission(reduction)), (expected, String::new()));
    assert_eq!(
        elbow(&with_dynamics("<dynamics rotor_inertia=\"1e-4\" gear_ratio=\"50\"/>")),
        (expected, String::new())
    );
}

#[test]
fn a_transmission_without_a_rotor_is_not_looked_at() {
    let ros = "<transmission name=\"t\"><type>x</type><joint name=\"nobody\"/><joint name=\"elbow\"/><actuator name=\"a\">\
        <mechanicalReduction>often</mechanicalReduction></actuator><actuator name=\"a\"/></transmission>";
    assert_eq!(elbow(&with_transmission(ros)), (Terms::default(), String::new()));
}

#[test]
fn a_ball_joint_has_four_coordinates_and_needs_neither_axis_nor_limits() {
    for kind in ["spherical", "ball"] {
        let source = Source::Text { urdf: on_a_ball(kind, "").into(), submechanisms: None };
        let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.description.joints[3].kind, JointKind::Spherical);
        let sizes = loaded.compiled.model.sizes();
        assert_eq!((sizes.n_q, sizes.n_v), (7, 6));
    }
}

#[test]
fn a_serial_type_counts_three_rotations_for_a_ball_joint() {
    let yaml = "submechanisms:\n- \
        {type: 3R, contextual_name: b, jointnames_spanningtree: [ball], jointnames_independent: [ball], jointnames_active: []}\n";
    let yaml = with(YAML, "submechanisms:\n", yaml);
    assert_eq!(reported(&on_a_ball("ball", ""), &yaml), "");
    let wrong = reported(&on_a_ball("ball", ""), &yaml.replace("3R", "2R"));
    let expected = "submechanisms.yml:2:10: the type `2R` stands over 3 rotations and 0 \
        translations, expected 2 and 0, correct the type or jointnames_spanningtree\n";
    assert_eq!(wrong, expected);
}

#[test]
fn a_ball_joint_can_have_damping_and_no_spring() {
    let urdf = on_a_ball("spherical", "<dynamics damping=\"0.5\"/>");
    let source = Source::Text { urdf: urdf.into(), submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let damped = Terms { damping: 0.5, ..Terms::default() };
    assert_eq!(
        (loaded.description.joints[3].terms, loaded.report.to_string().as_str()),
        (damped, "")
    );
    let sprung = on_a_ball("ball", "<dynamics spring_stiffness=\"2\"/>");
    let expected = "robot.urdf:42:94: the ball joint `ball` has a spring or a rotor, expected \
        damping, or a joint of one freedom, remove it, or change the type of the joint\n";
    assert_eq!(reported_of(sprung.as_bytes(), None, false), expected);
}

#[test]
fn joints_of_several_freedoms_and_fixed_ones_have_no_terms() {
    let at = |kind: &str| {
        reported_of(on_a_ball(kind, "<dynamics damping=\"1\"/>").as_bytes(), None, false)
    };
    let expected = "robot.urdf:42:98: the joint `ball` of several freedoms has damping, a spring \
        or a rotor, expected a joint of one freedom, remove it, or change the type of the joint\n";
    assert_eq!(at("floating"), expected);
    let fixed = at("fixed");
    assert!(
        fixed
            .contains("the fixed joint `ball` has damping, a spring or a rotor, which is not read"),
        "{fixed}"
    );
    let harmless = reported_of(
        on_a_ball("fixed", "<dynamics damping=\"0\" friction=\"0\"/>").as_bytes(),
        None,
        false,
    );
    assert_eq!(harmless, "");
}

faults! { urdf:
    a_negative_damping_is_an_error:
        "<axis xyz=\"0 1 0\"/>" => "<axis xyz=\"0 1 0\"/><dynamics damping=\"-1\" \
            spring_stiffness=\"-2\"/>",
        "robot.urdf:39:24: `damping` of `dynamics` is -1, expected zero or more, correct the value",
        "robot.urdf:39:24: `spring_stiffness` of `dynamics` is -2, expected zero or more, correct \
         the value";
    a_malformed_damping_is_an_error_and_an_unknown_attribute_a_warning:
        "<axis xyz=\"0 1 0\"/>" => "<axis xyz=\"0 1 0\"/><dynamics damping=\"inf\" \
            dampening=\"1\"/>",
        "robot.urdf:39:43: `damping` of `dynamics`: `inf` is not finite, expected one finite \
         number, correct the value",
        "robot.urdf:39:48: the attribute `dampening` of `dynamics` is not known and not read, \
         expected damping, friction, spring_stiffness, spring_reference, rotor_inertia, \
         gear_ratio, did you mean `damping`?";
    a_rotor_of_no_joint_is_an_error_with_the_nearest:
        "</robot>" => "<transmission><actuator name=\"m\"><rotor_inertia value=\"1\"/></actuator>\
            <joint name=\"elbo\"/></transmission></robot>",
        "robot.urdf:42:34: the rotor belongs to the joint `elbo`, which does not exist, expected a \
         joint of this file, did you mean `elbow`?";
    a_second_rotor_of_a_joint_is_an_error:
        "</robot>" => "<transmission><actuator name=\"m\"><rotor_inertia value=\"1\"/></actuator>\
            <joint name=\"elbow\"/></transmission>\n<transmission><actuator name=\"m\">\
            <rotor_inertia value=\"1\"/></actuator><joint name=\"elbow\"/></transmission></robot>",
        "robot.urdf:43:34: the joint `elbow` has a second rotor, expected one, add both inertias \
         up, each times its ratio squared";
    a_rotor_of_two_joints_is_an_error:
        "</robot>" => "<transmission><actuator name=\"m\"><rotor_inertia value=\"1\"/></actuator>\
            <joint name=\"elbow\"/><joint name=\"swing\"/></transmission></robot>",
        "robot.urdf:42:15: the transmission has 1 rotors and 2 joints, expected one of each, write \
         a transmission for each rotor";
    a_rotor_without_a_ratio_or_of_less_than_nothing_is_an_error:
        "</robot>" => "<transmission><actuator name=\"m\"><rotor_inertia value=\"1\"/><gear_ratio \
            value=\"0\"/></actuator><joint name=\"elbow\"/></transmission>\n<transmission>\
            <actuator name=\"m\"><rotor_inertia value=\"-1\"/></actuator><joint name=\"swing\"/>\
            </transmission></robot>",
        "robot.urdf:42:15: the gear ratio of a rotor is zero, expected how often it turns while \
         the joint turns once, correct the value",
        "robot.urdf:43:34: the rotor inertia is -1, expected zero or more, correct the value";
}
