//! Faults that concern whole files, and sources that cannot be read.

use std::path::PathBuf;

use super::*;

/// A file of this content in a fresh folder of the system's temporary directory.
fn file(name: &str, content: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("sarrus-models-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn remove(path: &std::path::Path) {
    std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
}

#[test]
fn bytes_that_are_not_utf8_are_reported_with_their_position() {
    let mut urdf = URDF.as_bytes().to_vec();
    let at = URDF.find("rocker").unwrap();
    urdf[at] = 0xe9;
    let expected = "robot.urdf:3:15: the byte 0xe9 is not UTF-8, expected UTF-8 text, save the \
        file as UTF-8\n";
    assert_eq!(reported_of(&urdf, Some(YAML.as_bytes()), false), expected);
    let reported = reported_of(URDF.as_bytes(), Some(b"a: \xff\xfe"), false);
    assert_eq!(
        reported,
        "submechanisms.yml:1:4: the byte 0xff is not UTF-8, expected UTF-8 text, save the file as \
         UTF-8\n"
    );
}

#[test]
fn another_format_is_reported() {
    let expected = "robot.urdf:1:1: the outermost element is `model`, expected `robot`, `mujoco` or \
        `sdf`, give a file of URDF, MJCF or SDF (expand xacro files)\n";
    assert_eq!(reported_of(b"<model name=\"a\"/>", None, false), expected);
    assert_eq!(
        reported_of(b"name: robot", None, false),
        "robot.urdf:1:1: this is not XML: unknown token, expected a well-formed URDF file, correct \
         the file at this position\n"
    );
    assert_eq!(
        reported_of(b"", None, false),
        "robot.urdf:1:1: this is not XML: the document does not have a root node, expected a \
         well-formed URDF file, correct the file at this position\n"
    );
}

#[test]
fn an_empty_robot_and_an_empty_list_are_reported() {
    let reported = reported_of(b"<robot name=\"r\"/>", Some(b""), false);
    let expected = "robot.urdf:1:1: the robot has no link, expected at least one, add links\n\
        submechanisms.yml:1:1: the file is nothing, expected a mapping with the keys submechanisms, actuators, exoskeletons, correct it\n";
    assert_eq!(reported, expected);
    let reported = reported_of(URDF.as_bytes(), Some(b"submechanisms: []"), false);
    assert_eq!(
        reported,
        "submechanisms.yml:1:16: `submechanisms` is empty, expected at least one, list the joints \
         in submechanisms\n"
    );
    let reported = reported_of(URDF.as_bytes(), Some(b"submechanisms: {a: b}"), false);
    assert_eq!(
        reported,
        "submechanisms.yml:1:16: `submechanisms` is a mapping, expected a list, write each \
         submechanism as a list item\n"
    );
}

#[test]
fn faults_of_both_files_are_reported_at_once_in_the_order_of_their_positions() {
    let urdf = with(
        &with(URDF, "<mass value=\"1.5\"/>", "<mass value=\"x\"/>"),
        "<axis xyz=\"0 1 0\"/>",
        "<axis xyz=\"0 0 0\"/>",
    );
    let yaml = with(
        &with(YAML, "successor_body: rod", "successor_body: rot"),
        "  type: NUMERICAL",
        "  typ: NUMERICAL",
    );
    let spans: Vec<String> = reported(&urdf, &yaml)
        .lines()
        .map(|line| line.split(' ').next().unwrap().to_owned())
        .collect();
    let expected = [
        "robot.urdf:6:20:",
        "robot.urdf:39:5:",
        "submechanisms.yml:2:3:",
        "submechanisms.yml:3:3:",
        "submechanisms.yml:13:21:",
    ];
    assert_eq!(spans, expected);
}

#[test]
fn a_file_that_cannot_be_opened_is_no_fault_of_its_content() {
    let missing = std::env::temp_dir().join("sarrus-models-no-such-file.urdf");
    let source = Source::Files { urdf: missing.clone(), submechanisms: None };
    let Err(error @ LoadError::Open(..)) = load(&source, &Options::default()) else { panic!() };
    let expected = format!(
        "cannot open {}: No such file or directory (os error 2); give the path of a readable file",
        missing.display()
    );
    assert_eq!(error.to_string(), expected);
}

#[test]
fn an_unknown_robot_is_reported_with_the_nearest() {
    let Err(error) = load(&Source::Bundled("stewert".into()), &Options::default()) else {
        panic!()
    };
    let expected = "there is no bundled robot `stewert`; expected one of lambda, torso, ankle, parallelogram, stewart, wrist, r3_lambda_r, \
        rh5v2_upper_body, rh5v2_full, four_bars_2, five_bar, squeezer, bricard, delta, active_ankle, stewart_floating, \
        g1_ankle, jansen, three_rrr, gripper, bennett, agile_eye, wheel_leg, delta_balls, cassie_leg, cassie, digit_tarsus, \
        kangaroo_leg; did you mean `stewart`?";
    assert_eq!(error.to_string(), expected);
}

#[test]
fn a_smurf_file_without_a_robot_is_reported() {
    for (name, content, what) in [
        (
            "a.smurf",
            "modelname: a\n",
            "1:1: the file has no `files`, expected a list of the robot's files, add it\n",
        ),
        ("b.smurf", "files:\n- a.yml\n", "2:3: `files` names no URDF, expected one, add it\n"),
    ] {
        let path = file(name, content.as_bytes());
        let loaded =
            load(&Source::Files { urdf: path.clone(), submechanisms: None }, &Options::default());
        let Err(LoadError::Faults(report)) = loaded else { panic!() };
        assert_eq!(report.to_string(), format!("{}:{what}", path.display()));
        remove(&path);
    }
}

#[test]
fn a_smurf_file_takes_the_first_yaml_with_submechanisms() {
    let smurf = file("c.smurf", b"files:\n- robot.urdf\n- limits.yml\n- loops.yml\n");
    for (name, content) in
        [("robot.urdf", URDF), ("limits.yml", "limits: {names: []}"), ("loops.yml", YAML)]
    {
        std::fs::write(smurf.with_file_name(name), content).unwrap();
    }
    let loaded =
        load(&Source::Files { urdf: smurf.clone(), submechanisms: None }, &Options::default());
    assert_eq!(loaded.unwrap().description.submechanisms[0].name, "elbow_joint");
    remove(&smurf);
}

#[test]
fn a_xacro_file_is_to_be_expanded() {
    let expected = |line: u32, column: u32| {
        format!(
            "robot.urdf:{line}:{column}: an element of xacro, which is not expanded, expected a \
             URDF file, expand it: xacro robot.xacro > robot.urdf\n"
        )
    };
    let macros = "<xacro:include filename=\"arm.xacro\"/>\n</robot>";
    let undeclared = with(URDF, "</robot>", macros);
    assert_eq!(reported_of(undeclared.as_bytes(), None, false), expected(42, 2));
    let name = "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" ";
    let declared = with(&undeclared, "<robot ", name);
    assert_eq!(reported_of(declared.as_bytes(), None, false), expected(42, 1));
    // a prefix in an expanded file, or in a comment, is no macro
    let expanded = with(&with(URDF, "<robot ", name), "</robot>", "<!-- <xacro:arm/> --></robot>");
    assert_eq!(reported_of(expanded.as_bytes(), None, false), "");
}
