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

/// The slider-crank of the README, and its submechanism file with this type and without its loop.
pub(super) fn slider_crank(type_name: &str) -> (String, String) {
    let readme = include_str!("../../README.md");
    let block = |language: &str| {
        let start = readme.split(&format!("```{language}\n")).nth(1).unwrap();
        start.split("```").next().unwrap().to_owned()
    };
    let yaml = with(&block("yaml"), "NUMERICAL", type_name);
    (block("xml"), yaml[..yaml.find("  loop_constraints").unwrap()].to_owned())
}

const TREE: &str = "[crank_joint, rod_joint, drive_joint]";

#[test]
fn a_wrong_type_is_reported_as_a_geometry_with_the_types_that_fit() {
    let fits = "write type: SLIDERCRANK with jointnames_spanningtree: [crank_joint, rod_joint, \
        drive_joint], which fits";
    for (type_name, fault) in [
        ("RRPR", "the joints of crank_drive have not the geometry of their type RRPR"),
        ("FOURBAR", "dependent joints in crank_drive (type FOURBAR) that nothing determines"),
    ] {
        let (urdf, yaml) = slider_crank(type_name);
        let reported = super::reported(&urdf, &yaml);
        assert_eq!(reported.lines().count(), 1, "{reported}");
        assert!(reported.contains(fault) && reported.contains(fits), "{reported}");
    }
    // the right type with its joints in another order
    let (urdf, yaml) = slider_crank("SLIDERCRANK");
    assert_eq!(super::reported(&urdf, &yaml), "");
    let turned = yaml.replace(TREE, "[rod_joint, crank_joint, drive_joint]");
    assert!(super::reported(&urdf, &turned).contains(fits));
    // a lambda is no slider-crank
    let yaml = with(&YAML[..YAML.find("  loop_constraints").unwrap()], "NUMERICAL", "SLIDERCRANK");
    let reported = super::reported(URDF, &yaml);
    assert!(
        reported.contains("write type: RRPR with jointnames_spanningtree: [elbow, "),
        "{reported}"
    );
}

#[test]
fn a_loop_of_another_type_is_closed_as_that_with_a_warning() {
    let readme = include_str!("../../README.md");
    let (urdf, _) = slider_crank("RRPR");
    let yaml = readme.split("```yaml\n").nth(1).unwrap().split("```").next().unwrap();
    for type_name in ["RRPR", "FOURBAR", "2SPU+1U"] {
        let yaml = with(yaml, "NUMERICAL", type_name);
        let reported = super::reported(&urdf, &yaml);
        if type_name != "2SPU+1U" {
            assert!(reported.contains("it is closed as a SLIDERCRANK; write type: SLIDERCRANK"));
        }
        let yaml = suggested(&urdf, Some(&yaml));
        assert!(yaml.contains("type: SLIDERCRANK") && yaml.contains("pin_z"), "{yaml}");
    }
}

#[test]
fn a_proposal_never_loses_a_loop() {
    for type_name in ["RRPR", "FOURBAR", "2SPU+1U", "SERIAL", "SLIDER_CRANK"] {
        let (urdf, yaml) = slider_crank(type_name);
        let yaml = suggested(&urdf, Some(&yaml));
        assert!(yaml.contains("type: SLIDERCRANK"), "{type_name}: {yaml}");
        assert!(yaml.contains(&format!("jointnames_spanningtree: {TREE}")), "{yaml}");
        assert!(yaml.contains("jointnames_independent: [crank_joint]"), "{yaml}");
    }
    // with a loop that no file has the file stays, and its fault is told
    let three_turns = URDF.replace("type=\"prismatic\"", "type=\"revolute\"");
    let yaml = with(&YAML[..YAML.find("  loop_constraints").unwrap()], "NUMERICAL", "FOURBAR");
    let text = |of: &str| of.as_bytes().to_vec();
    let source = Source::Text { urdf: text(&three_turns), submechanisms: Some(text(&yaml)) };
    let found = suggest(&source, &Options::default()).unwrap();
    assert!(found.yaml.contains("type: FOURBAR"), "{}", found.yaml);
    let [error] = &found.report.errors[..] else { panic!("{}", found.report) };
    assert!(error.to_string().starts_with("suggested.yml:3:20: "), "{error}");
}

#[test]
fn a_loop_of_the_urdf_is_in_the_proposal() {
    let (urdf, yaml) = slider_crank("SERIAL");
    let pin = "<loop name=\"pin\" type=\"revolute\"><predecessor link=\"rod\">\
        <origin xyz=\"0.3 0 -0.1\"/></predecessor><successor link=\"drive\"/>\
        <axis xyz=\"0 1 0\"/></loop></robot>";
    let shut = with(&urdf, "</robot>", pin);
    let independent = with(&yaml, "[crank_joint]", TREE);
    for yaml in [Some(&*yaml), Some(&independent), None] {
        let found = suggested(&shut, yaml);
        assert!(found.contains("type: SLIDERCRANK") && found.contains(TREE), "{found}");
        assert!(found.contains("jointnames_independent: [crank_joint]"), "{found}");
        let source =
            Source::Text { urdf: shut.as_bytes().into(), submechanisms: Some(found.into()) };
        let model = load(&source, &Options::default()).unwrap().compiled.model;
        assert_eq!(model.loop_names()[0], "pin/x");
    }
}
