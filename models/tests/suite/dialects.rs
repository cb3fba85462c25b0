//! Loops that stand in the URDF, in the words of other programs.

use sarrus_dynamics::ClosureKind;
use sarrus_models::Loaded;

use super::*;

/// A four-bar, cut between the ends of coupler and rocker at (1, 0, 1), with `inside` behind it.
fn four_bar(inside: &str) -> String {
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

/// What the submechanism file of the four-bar says about its loop.
fn yaml(cut: &str) -> String {
    let joints = "[crank_joint, coupler_joint, rocker_joint]";
    format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: bars\n  \
         jointnames_spanningtree: {joints}\n  jointnames_independent: [crank_joint]\n  \
         jointnames_active: [crank_joint]\n  loop_constraints:\n  - {cut}\n"
    )
}

fn good(urdf: &str, yaml: Option<&str>) -> Loaded {
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
