//! The files of Gepetto's tools, written and read again.

use std::fs;
use std::path::PathBuf;

use sarrus_dynamics::description::JointKind;
use sarrus_models::{Loaded, Options, Source, Target, bundled, export, import, load};

use super::export::{robot, same};

/// A folder of this process.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("sarrus_gepetto_{name}_{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn active(of: &Loaded) -> Vec<String> {
    let mut names = of.compiled.model.info().active.clone();
    names.sort();
    names
}

#[test]
fn every_bundled_robot_is_the_same_after_a_way_through_the_files_of_gepetto() {
    let folder = folder("all");
    let mut count = 0;
    for (name, _) in bundled() {
        let loaded = robot(name);
        let Ok(written) = export(&loaded, Target::Gepetto, name, false) else {
            println!("{name}: Gepetto's files cannot express it");
            continue;
        };
        if written.held.joints.iter().any(|joint| joint.kind == JointKind::Floating) {
            println!("{name}: a floating joint");
        }
        for (ending, text) in &written.files {
            fs::write(folder.join(format!("{name}{ending}")), text).unwrap();
        }
        let urdf = folder.join(format!("{name}.yaml"));
        let source = Source::Files { urdf, submechanisms: None };
        let read = load(&source, &Options::default());
        let read = read.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(active(&read), active(&loaded), "{name}");
        same(name, &loaded.description, &written.held, &read.description);
        count += 1;
    }
    fs::remove_dir_all(folder).unwrap();
    assert!(count >= 15, "{count}");
}

#[test]
fn faults_of_the_files_of_gepetto_are_named() {
    let folder = folder("faults");
    let urdf = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" \
                type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint></robot>";
    fs::write(folder.join("r.urdf"), urdf).unwrap();
    let words = |file: &str, yaml: &str| {
        let path = folder.join(file);
        fs::write(&path, yaml).unwrap();
        match import(&path, None, &[], &Options::default()) {
            Ok(imported) => imported.report.to_string(),
            Err(error) => error.to_string(),
        }
    };
    for (file, yaml, expected) in [
        ("r.yaml", "closed_loop: [[a, b]]\ntype: [2d]\n", "1:15: a closed loop"),
        ("r.yaml", "closed_loop: [[a]]\n", "1:15: a closed loop"),
        ("r.yaml", "closed_loop: []\nrotor: 3\n", "2:1: the key `rotor` of the file is not known"),
        ("r.yaml", "closed_loop: []\nname_mot: mot\n", "2:11: `name_mot` is"),
        (
            "r.yaml",
            "closed_loop: []\njoint_name: [j]\njoint_type: [UJOINT]\n",
            "a joint of another type, expected SPHERICAL",
        ),
        ("s.yaml", "closed_loop: []\n", "s.urdf` cannot be opened"),
        ("r.yaml", "closed_loop: []\nname_mot: [m]\n", "`m`, expected a joint of"),
        ("r.yaml", "closed_loop: []\njoint_name: [m]\njoint_type: [SPHERICAL]\n", "`m`, expected"),
        (
            "r.yaml",
            "closed_loop: [[a, b]]\ntype: [6d, 3d]\n",
            "2 types, expected one for each of 1",
        ),
        ("r.yaml", "closed_loop: [[a, c]]\ntype: [3d]\n", "the loop `a_c` names the link `c`"),
    ] {
        let found = words(file, yaml);
        assert!(found.contains(expected), "{yaml}: {found}");
    }
    let outside = std::env::temp_dir().join(format!("sarrus_gepetto_r_{}", std::process::id()));
    fs::write(&outside, urdf).unwrap();
    std::os::unix::fs::symlink(&outside, folder.join("t.urdf")).unwrap();
    let found = words("t.yaml", "closed_loop: []\n");
    assert!(found.contains("lies outside of the first file's folder"), "{found}");
    fs::remove_file(outside).unwrap();
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_comment_with_the_robots_end_hides_no_loop() {
    let folder = folder("comment");
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" \
             izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let hinge = |name: &str, at: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"a\"/><child \
             link=\"{name}_\"/><origin xyz=\"{at}\"/><axis xyz=\"0 1 0\"/></joint>"
        )
    };
    let frame = "<link name=\"f\"/><joint name=\"g\" type=\"fixed\"><parent link=\"k_\"/><child \
                 link=\"f\"/></joint>";
    let parts = [link("a"), link("j_"), link("k_"), hinge("j", "0 0 0"), hinge("k", "0 0 0")];
    let urdf = format!("<robot name=\"r\">{}{frame}</robot><!-- </robot> -->", parts.concat());
    fs::write(folder.join("r.urdf"), urdf).unwrap();
    let path = folder.join("r.yaml");
    fs::write(&path, "closed_loop: [[j_, f]]\ntype: [6d]\nname_mot: [j]\n").unwrap();
    let imported = import(&path, None, &[], &Options::default()).unwrap();
    assert!(imported.report.errors.is_empty(), "{}", imported.report);
    assert_eq!(imported.independent, ["j"]);
    fs::remove_dir_all(folder).unwrap();
}
