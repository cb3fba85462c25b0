//! Submechanism files that are proposed.

use sarrus_models::{Options, Source, bundled, bundled_text, load, suggest};

use super::{URDF, YAML, with};

/// The proposal for two texts, which must be ready to use.
fn suggested(urdf: &str, yaml: Option<&str>) -> String {
    let text = |yaml: Option<&str>| Source::Text {
        urdf: urdf.into(),
        submechanisms: yaml.map(|yaml| yaml.into()),
    };
    let found = suggest(&text(yaml), &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(found.report.errors, [], "{}", found.yaml);
    load(&text(Some(&found.yaml)), &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    found.yaml
}

#[test]
fn independents_that_are_wrong_or_missing_are_found_with_the_type_that_fits() {
    for (from, to) in [
        ("jointnames_independent: [elbow]", "jointnames_independent: [elbow, swing]"),
        ("jointnames_independent: [elbow]", "jointnames_independent: []"),
        ("  jointnames_independent: [elbow]\n", ""),
        ("type: NUMERICAL", "type: 3RUS2"),
        (
            "jointnames_spanningtree: [elbow, swing, slide]",
            "jointnames_spanningtree: [slide, elbow, swing]",
        ),
        ("  jointnames_spanningtree: [elbow, swing, slide]\n", ""),
    ] {
        let yaml = suggested(URDF, Some(&with(YAML, from, to)));
        assert!(yaml.contains("type: RRPR"), "{to}: {yaml}");
        assert_eq!(yaml.matches("cut_joint: slide").count(), 1, "{yaml}");
        let independent = yaml.split("jointnames_independent: [").nth(1).unwrap();
        assert_eq!(independent.split(']').next().unwrap().split(", ").count(), 1, "{yaml}");
    }
    // one that is right stays
    assert!(suggested(URDF, Some(YAML)).contains("jointnames_independent: [elbow]"));
}

#[test]
fn a_type_that_defines_its_loops_gets_its_independents() {
    let yaml = with(&YAML[..YAML.find("  loop_constraints").unwrap()], "NUMERICAL", "RRPR");
    let yaml = with(&yaml, "jointnames_independent: [elbow]", "jointnames_independent: []");
    assert!(suggested(URDF, Some(&yaml)).contains("jointnames_independent: [elbow]"));
}

#[test]
fn a_urdf_alone_is_serial_and_joints_in_no_submechanism_are_added() {
    let yaml = suggested(URDF, None);
    assert!(yaml.contains("type: SERIAL") && yaml.contains("independent: [elbow, swing, slide]"));
    let more = "<link name=\"hand\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" \
        ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link><joint name=\"roll\" \
        type=\"continuous\"><parent link=\"rocker\"/><child link=\"hand\"/></joint></robot>";
    let yaml = suggested(&with(URDF, "</robot>", more), Some(YAML));
    assert!(yaml.contains("contextual_name: others") && yaml.contains("[roll]"), "{yaml}");
}

#[test]
fn every_bundled_robot_keeps_what_it_has() {
    for (name, _) in bundled() {
        let (urdf, yaml) = bundled_text(name).unwrap();
        let found = suggested(urdf, Some(yaml));
        let load = |yaml: &str| {
            let submechanisms = Some(yaml.into());
            let source = Source::Text { urdf: urdf.into(), submechanisms };
            load(&source, &Options::default()).unwrap().compiled.model
        };
        let new = load(&found);
        let old = load(yaml);
        assert_eq!(new.independent_names(), old.independent_names(), "{name}: {found}");
        for (new, old) in new.closures().iter().zip(old.closures()) {
            // a closed form is never lost
            assert!(old.kind.name() != "analytic" || new.kind == old.kind, "{name}: {new:?}");
        }
    }
}

/// A leg as Cassie's: a rod on a ball joint of the hip, cut at the heel, where it is a ball too.
fn leg(independent: &str) -> (String, String) {
    let link = |name: &str| {
        format!(
            r#"<link name="{name}"><inertial><mass value="1"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#
        )
    };
    let joint = |name: &str, kind: &str, links: [&str; 2], xyz: &str| {
        format!(
            r#"<joint name="{name}" type="{kind}"><parent link="{}"/><child link="{}"/>
            <origin xyz="{xyz}"/><axis xyz="0 0 1"/></joint>"#,
            links[0], links[1]
        )
    };
    let urdf = [
        "<robot name=\"leg\"><link name=\"hip\"/>".to_owned(),
        ["rod", "thigh", "shin", "tarsus", "heel"].map(link).concat(),
        joint("ball", "spherical", ["hip", "rod"], "0 0 0.045"),
        joint("knee", "continuous", ["hip", "thigh"], "0.12 0 0.005"),
        joint("spring", "continuous", ["thigh", "shin"], "0.06 0.047 0"),
        joint("ankle", "continuous", ["shin", "tarsus"], "0.43 0.02 0"),
        joint("back", "continuous", ["tarsus", "heel"], "-0.013 -0.03 0"),
        "</robot>".to_owned(),
    ];
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: leg\n  \
         jointnames_spanningtree: [ball, knee, spring, ankle, back]\n  \
         jointnames_independent: [{independent}]\n  jointnames_active: [knee]\n  \
         loop_constraints:\n  - {{cut_joint: end, predecessor_body: rod, successor_body: heel, \
         cut_joint_type: spherical, predecessor_placement: {{xyz: [0.487, 0.027, -0.02]}}, \
         successor_placement: {{xyz: [-0.11, -0.01, 0.02]}}}}\n"
    );
    (urdf.concat(), yaml)
}

/// A ball joint turns in one direction of the loop only, which a file cannot name.
#[test]
fn independents_are_whole_joints() {
    for (independent, named) in [
        ("knee, spring", "such as [knee, spring, back]"),
        ("knee, ball", "write jointnames_independent: [knee, ankle, back]"),
        ("knee, spring, ankle, back", "write jointnames_independent: [knee, spring, ankle]"),
    ] {
        let (urdf, yaml) = leg(independent);
        let reported = super::reported(&urdf, &yaml);
        assert!(reported.contains(named), "{independent}: {reported}");
        let yaml = suggested(&urdf, Some(&yaml));
        assert!(yaml.contains("jointnames_independent: [knee, spring, "), "{yaml}");
        assert!(yaml.contains("rods that spin idly, by the joint that stands still: ball"));
    }
}
