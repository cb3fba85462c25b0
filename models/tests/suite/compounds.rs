//! Joints of several axes as chains of joints.

use sarrus_dynamics::description::JointKind;

use super::*;

/// A body on a joint of this type.
fn on(kind: &str, inside: &str) -> String {
    format!(
        r#"<robot name="r"><link name="base"/><link name="body"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name="j" type="{kind}"><parent link="base"/><child link="body"/>
        <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>{inside}</joint></robot>"#
    )
}

fn read(urdf: &str, yaml: Option<&str>) -> sarrus_models::Loaded {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_planar_joint_is_two_sliders_and_a_turn() {
    let loaded = read(&on("planar", "<axis xyz=\"0 0 2\"/>"), None);
    assert_eq!(loaded.report.to_string(), "");
    let joints = &loaded.description.joints;
    let links = &loaded.description.links;
    let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["j/x", "j/y", "j/rz"]);
    assert_eq!(loaded.compiled.model.active_names(), names);
    let kinds = [JointKind::Prismatic, JointKind::Prismatic, JointKind::Continuous];
    assert_eq!(joints.iter().map(|joint| joint.kind).collect::<Vec<_>>(), kinds);
    let axes: Vec<[f64; 3]> = joints.iter().map(|joint| joint.axis).collect();
    assert_eq!(axes, [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]);
    let ends: Vec<(&str, &str)> = joints
        .iter()
        .map(|joint| (links[joint.parent].name.as_str(), links[joint.child].name.as_str()))
        .collect();
    assert_eq!(ends, [("base", "j/x"), ("j/x", "j/y"), ("j/y", "body")]);
    assert_eq!(joints[0].origin.xyz, [1.0, 2.0, 3.0]);
    assert_eq!(joints[1].origin, Default::default());
    // without an axis it is x, as URDF says
    let default = read(&on("planar", ""), None).description;
    let axes: Vec<[f64; 3]> = default.joints.iter().map(|joint| joint.axis).collect();
    assert_eq!(axes, [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
}

#[test]
fn a_universal_joint_is_two_turns() {
    let inside = "<axis xyz=\"1 0 0\"/><axis2 xyz=\"0 1 0\"/><dynamics damping=\"0.5\"/>\
        <limit lower=\"-1\" upper=\"2\" effort=\"3\" velocity=\"4\"/>";
    let loaded = read(&on("universal", inside), None);
    let joints = &loaded.description.joints;
    let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["j/r1", "j/r2"]);
    for (joint, axis) in joints.iter().zip([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) {
        assert_eq!((joint.kind, joint.axis), (JointKind::Revolute, axis));
        let limits = joint.limits.unwrap();
        assert_eq!((limits.lower, limits.upper), (-1.0, 2.0));
        assert_eq!(joint.terms.damping, 0.5);
    }
}

#[test]
fn the_name_of_a_joint_of_several_axes_stands_for_all_of_them() {
    let yaml = |lists: &str, active: &str| {
        format!(
            "submechanisms:\n- {{type: 2T+R, contextual_name: s, jointnames_spanningtree: {lists}, \
             jointnames_independent: {lists}, jointnames_active: {active}}}\n"
        )
    };
    let urdf = on("planar", "<axis xyz=\"0 0 1\"/>");
    let whole = read(&urdf, Some(&yaml("[j]", "[j/rz]")));
    assert_eq!(whole.report.to_string(), "");
    assert_eq!(whole.compiled.model.active_names(), ["j/rz"]);
    let parts = read(&urdf, Some(&yaml("[j/x, j/y, j/rz]", "[j/rz]")));
    assert_eq!(whole.description, parts.description);
    let twice = reported(&urdf, &yaml("[j, j/y]", "[]"));
    assert!(twice.contains("`j/y` is in `jointnames_spanningtree` twice"), "{twice}");
}

#[test]
fn a_coupling_names_one_axis() {
    let other = |inside: &str| {
        format!(
            "<link name=\"tip\"/><joint name=\"k\" type=\"continuous\"><parent link=\"body\"/>\
             <child link=\"tip\"/>{inside}</joint></robot>"
        )
    };
    let urdf = on("planar", "<axis xyz=\"0 0 1\"/>");
    let with_other = |inside: &str| urdf.replace("</robot>", &other(inside));
    let reported = |urdf: &str| reported_of(urdf.as_bytes(), None, false);
    let found = reported(&with_other("<mimic joint=\"j\"/>"));
    let expected =
        "the joint `j`, which has several axes, expected one of j/x, j/y, j/rz, name one";
    assert!(found.contains(expected), "{found}");
    let found = reported(&with_other("<mimic joint=\"j/rz\"/>"));
    assert!(!found.contains("several axes"), "{found}");
    let found = reported(&on("planar", "<mimic joint=\"j\"/>"));
    assert!(found.contains("the joint `j` is coupled"), "{found}");
}
