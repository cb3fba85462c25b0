//! `sarrus import`: files, exit codes, and other formats wherever a URDF stands.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use super::{Folder, Run, run, sarrus};

const PLAIN: &str = r#"<robot name="plain"><link name="a"/><link name="b"/>
  <joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
</robot>"#;

fn model(name: &str) -> String {
    format!("{}/../models/tests/suite/mjcf/{name}.xml", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn an_imported_model_is_checked_asked_and_not_written_over() {
    let folder = Folder::new("import");
    let into = folder.file("kept", "").replace("kept", "mine");
    let done = run(&["import", &model("ankle"), "--out", &into], b"");
    assert_eq!(done.code, Some(0), "{}", done.err);
    let files: Vec<&str> = done.out.lines().take(2).collect();
    assert_eq!(files, [format!("{into}/ankle.urdf"), format!("{into}/ankle.yml")]);
    assert!(done.out.contains("independent  motor_1 motor_2\n"), "{}", done.out);
    assert!(done.out.contains("closure      "), "{}", done.out);
    let note = "ankle.xml:50:5: note: the gear of the actuator `m2` is 3; τ_u is the force on";
    assert!(done.err.contains(note), "{}", done.err);
    assert_eq!(run(&["check", files[0], files[1]], b"").code, Some(0));

    // the model itself gives the same answers
    let line = b"{\"y\": [0.1, -0.05], \"yd\": [1, 2], \"want\": [\"q\", \"tau_u\"]}\n";
    let written = run(&["ask", "inverse-dynamics", files[0], files[1]], line);
    let direct = run(&["ask", "inverse-dynamics", "--urdf", &model("ankle")], line);
    assert!(written.out.contains("\"ok\""), "{}", written.out);
    assert_eq!(written.out, direct.out);

    assert_eq!(run(&["import", &model("ankle"), "--out", &into], b"").code, Some(2));
    assert_eq!(run(&["import", &model("missing"), "--out", &into], b"").code, Some(2));
    let spring = "<mujoco><worldbody><body><joint stiffness=\"1 2\"/><geom size=\"1\"/></body>\
                  </worldbody></mujoco>";
    let spring = folder.file("spring.xml", spring);
    let strict = run(&["import", &spring, "--out", &into], b"");
    assert_eq!(strict.code, Some(1), "{}", strict.err);
    let expected = "spring.xml:1:33: `stiffness` of `joint` is not linear";
    assert!(strict.err.contains(expected), "{}", strict.err);
    let lenient = run(&["import", &spring, "--out", &into, "--lenient"], b"");
    assert_eq!(lenient.code, Some(0), "{}", lenient.err);
}

#[test]
fn models_of_sdf_and_of_gepettos_tools_stand_where_a_urdf_does() {
    let folder = Folder::new("import-formats");
    let into = folder.file("kept", "").replace("kept", "mine");
    let file = format!("{}/../models/tests/suite/sdf/loops.sdf", env!("CARGO_MANIFEST_DIR"));
    let done = run(&["import", &file, "--out", &into], b"");
    assert_eq!(done.code, Some(0), "{}", done.err);
    let written: Vec<&str> = done.out.lines().take(2).collect();
    assert_eq!(written, [format!("{into}/loops.urdf"), format!("{into}/loops.yml")]);
    let [direct, from_files] = [vec![&*file], written.clone()].map(|files| {
        let arguments = [&["ask", "inverse-dynamics"], &files[..]].concat();
        let independents = run(&[&["check", "--format", "json"], &files[..]].concat(), b"").out;
        let found: serde_json::Value = serde_json::from_str(&independents).unwrap();
        let n = found["independent"].as_array().unwrap().len();
        let y = vec![0.01; n];
        let line = format!("{{\"y\": {y:?}, \"want\": [\"q\", \"tau_y\"]}}\n");
        run(&arguments, line.as_bytes()).out
    });
    assert!(direct.contains("\"ok\""), "{direct}");
    assert_eq!(direct, from_files);

    // the way out and back
    let out = format!("{into}/out");
    for (target, ending) in [("sdf", "sdf"), ("gepetto", "yaml")] {
        let exported = run(&["export", "--robot", "wrist", "--to", target, "--out", &out], b"");
        assert_eq!(exported.code, Some(0), "{}", exported.err);
        let file = format!("{out}/wrist.{ending}");
        let checked = run(&["check", "--urdf", &file], b"");
        assert_eq!(checked.code, Some(0), "{target}: {}", checked.out);
        let back = run(&["import", &file, "--out", &format!("{out}/{target}")], b"");
        assert_eq!(back.code, Some(0), "{target}: {}", back.err);
    }
    let missing = folder.file("alone.yaml", "closed_loop: []\n");
    assert_eq!(run(&["import", &missing, "--out", &into], b"").code, Some(1));
}

/// A program in place of Python that says how it is called.
#[test]
fn files_of_python_end_as_others_do() {
    let folder = Folder::new("import-python");
    let program = folder.file("python", "");
    fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();
    let import = |name: &str, script: &str| {
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        let mut command = Command::new(sarrus());
        command.args(["import", name, "--out", &program.replace("/python", "/mine")]);
        Run::of(command.env("SARRUS_PYTHON", &program), b"")
    };
    for ending in ["lua", "usda", "USDC"] {
        let gone = import(&folder.file("gone", "").replace("gone", &format!("no.{ending}")), "");
        assert_eq!(gone.code, Some(2), "{}", gone.err);
        assert!(gone.err.contains("cannot open"), "{}", gone.err);
        let file = folder.file(&format!("robot.{ending}"), "");
        let done = import(&file, &format!("cat << 'END'\n{PLAIN}\nEND"));
        assert_eq!(done.code, Some(0), "{}", done.err);
        fs::remove_dir_all(program.replace("/python", "/mine")).unwrap();
        for (script, code) in [("exit 1", 1), ("exit 2", 2), ("exit 7", 1), ("kill -9 $$", 1)] {
            assert_eq!(import(&file, script).code, Some(code), "{script}");
        }
    }
    // no module of the current folder
    let printed = format!("print({:?})", PLAIN.trim());
    let good = folder.file("place", "").replace("/place", "");
    let bad = format!("{good}/bad");
    for of in [&good, &bad] {
        fs::create_dir_all(format!("{of}/sarrus")).unwrap();
    }
    fs::write(format!("{good}/sarrus/__init__.py"), "").unwrap();
    fs::write(format!("{good}/sarrus/convert.py"), printed).unwrap();
    for file in ["runpy.py", "pkgutil.py", "sarrus/__init__.py", "sarrus/convert.py"] {
        fs::write(format!("{bad}/{file}"), "raise SystemExit(9)").unwrap();
    }
    fs::write(&program, format!("#!/bin/sh\nPYTHONPATH={good} exec python3 \"$@\"\n")).unwrap();
    let mut command = Command::new(sarrus());
    command.args(["import", &format!("{good}/robot.lua"), "--out", &format!("{good}/mine")]);
    let done = Run::of(command.env("SARRUS_PYTHON", &program).current_dir(&bad), b"");
    assert_eq!(done.code, Some(0), "{}", done.err);
}

#[test]
fn macros_are_expanded_by_the_program_xacro_on_request() {
    let folder = Folder::new("import-xacro");
    let file = folder.file("robot.urdf.xacro", PLAIN);
    let program = folder.file("xacro", "#!/bin/sh\nexec cat \"$1\"\n");
    fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();
    let programs = program.replace("/xacro", "");
    let import = |programs: &str| {
        let mut command = Command::new(sarrus());
        command.args(["import", "--xacro", &file, "--out", &format!("{programs}/mine")]);
        Run::of(command.env("PATH", format!("{programs}:/bin:/usr/bin")), b"")
    };
    let done = import(&programs);
    assert_eq!(done.code, Some(0), "{}", done.err);
    assert!(done.out.contains("plain.urdf"), "{}", done.out);
    fs::write(&program, "#!/bin/sh\necho no such macro >&2\nexit 3\n").unwrap();
    let failed = import(&programs);
    assert_eq!(failed.code, Some(1));
    assert!(failed.err.contains("no such macro"), "{}", failed.err);
}
