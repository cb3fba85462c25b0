//! Warnings about a robot's files on stderr of the commands that compute with it.

use super::{FLOATING, Folder, ask, run};

/// A robot with impossible principal moments.
fn odd(folder: &Folder) -> String {
    folder.file("a.urdf", FLOATING.replacen("ixx=\"1\"", "ixx=\"5\"", 1))
}

#[test]
fn warnings_of_load_reach_stderr_of_ask_and_simulate() {
    let folder = Folder::new("load_warnings");
    let urdf = odd(&folder);
    let out = folder.0.join("motion").display().to_string();
    let of_robot = ["--urdf", &urdf, "--lenient"];
    let checked = run(&[&["check"], &of_robot[..]].concat(), b"");
    let warnings: Vec<&str> =
        checked.out.lines().filter(|line| line.contains(": warning: ")).collect();
    assert!(!warnings.is_empty(), "{}", checked.out);
    for command in [&["ask", "kinematics"][..], &["simulate", "--duration", "0.01", "--out", &out]]
    {
        let answered = run(&[command, &of_robot].concat(), b"");
        assert_eq!(answered.code, Some(0), "{}", answered.err);
        assert_eq!(answered.err.lines().collect::<Vec<_>>(), warnings, "{command:?}");
    }
    // a robot without warnings prints nothing
    assert_eq!(ask("kinematics", "lambda", &[r#"{"y":[0.1]}"#]).err, "");
}

#[test]
fn an_unknown_frame_lists_the_links_the_nearest_first() {
    let line = r#"{"y":[0.1],"frames":["Rod"]}"#;
    let error = ask("kinematics", "lambda", &[line]).json().remove(0)["error"].to_string();
    assert!(error.contains("is none of the 4 links of lambda, expected one of "), "{error}");
    assert!(error.chars().count() <= 400, "{error}");
}
