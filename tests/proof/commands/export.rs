//! `sarrus export`: files, exit codes, and our own files as they are read.

use std::fs;

use super::{Folder, run};

#[test]
fn a_robot_is_written_and_not_written_over() {
    let folder = Folder::new("export");
    let into = folder.file("kept", "").replace("kept", "mine");
    let own = ["export", "--robot", "torso", "--to", "urdf", "--out", &into];
    let done = run(&own, b"");
    assert_eq!(done.code, Some(0), "{done:?}");
    let files: Vec<&str> = done.out.lines().take(2).collect();
    assert_eq!(files, [format!("{into}/torso.urdf"), format!("{into}/torso.yml")]);
    assert!(done.out.contains("fingerprint   0.0e0"), "{done:?}");
    let fingerprint = |arguments: &[&str]| {
        let told = run(&[arguments, &["--format", "json"]].concat(), b"");
        let told: serde_json::Value = serde_json::from_str(&told.out).unwrap();
        told["fingerprint"].as_str().unwrap().to_owned()
    };
    let written = fingerprint(&["check", files[0], files[1]]);
    assert_eq!(written, fingerprint(&["check", "--robot", "torso"]));
    let again = run(&own, b"");
    assert!(again.code == Some(2) && again.err.contains("cannot be written"), "{again:?}");

    for (format, endings) in [
        ("mjcf", &["xml"][..]),
        ("sdf", &["sdf"]),
        ("pinocchio", &["py", "urdf"]),
        ("gepetto", &["urdf", "yaml"]),
    ] {
        let into = format!("{into}/{format}");
        let arguments = ["export", "--robot", "torso", "--to", format, "--out", &into];
        let done = run(&[&arguments[..], &["--format", "json"]].concat(), b"");
        assert_eq!(done.code, Some(0), "{done:?}");
        let told: serde_json::Value = serde_json::from_str(&done.out).unwrap();
        let files = endings.iter().map(|ending| format!("{into}/torso.{ending}"));
        assert_eq!(told["files"], serde_json::json!(files.collect::<Vec<_>>()), "{done:?}");
        let deviation = told["deviation"].as_object().unwrap();
        let is_known = ["NotRun", "Measured"].iter().any(|key| deviation.contains_key(*key));
        assert!(is_known, "{done:?}");
        println!("{format}: {}", told["deviation"]);
    }
    // a file of MJCF stands where a URDF does
    let xml = format!("{into}/mjcf/torso.xml");
    assert_eq!(run(&["check", &xml], b"").code, Some(0));
    let lines = fs::read_to_string(&xml).unwrap();
    assert!(lines.contains("<connect name=\"BodyActL\" site1="), "{lines}");
}
