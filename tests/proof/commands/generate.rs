//! `generate`.

use serde_json::json;

use super::{Folder, run};

const LINE: &str = r#"{"request": "inverse-dynamics", "y": [0], "yd": [0], "want": ["tau_u"]}"#;

/// Exit code, results and stderr of `generate` on a robot, into a new folder.
fn generate(robot: &str, line: &str, folder: &Folder) -> (Option<i32>, String, String) {
    let out = folder.0.display().to_string();
    let arguments =
        ["generate", "--robot", robot, "--query", line, "--out", &out, "--format", "json"];
    let run = run(&arguments, b"");
    (run.code, run.out, run.err)
}

#[test]
fn one_query_becomes_c_that_passes_its_own_test() {
    let folder = Folder::new("generate");
    let (code, out, err) = generate("lambda", LINE, &folder);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    let results: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(results["operations"].as_u64().unwrap() > 20);
    // the build depends on the machine's compiler
    let built = results["compiler"] != json!("not built");
    assert_eq!(results["files"].as_array().unwrap().len(), if built { 5 } else { 3 });
    for file in results["files"].as_array().unwrap() {
        assert!(std::path::Path::new(file.as_str().unwrap()).exists());
    }
    assert_eq!(results["compared"], if built { json!(4096) } else { json!(null) });
    assert_eq!(results["test"].as_str().is_some_and(|test| test.contains("the same bits")), built);
}

#[test]
fn what_has_no_straight_line_is_a_finding_and_a_bad_line_a_wrong_flag() {
    let folder = Folder::new("generate_not");
    for (line, expected, words) in [
        (r#"{"request": "kinematics", "y": [0], "want": ["K"]}"#, 1, "`K`"),
        (r#"{"request": "kinematics", "y": [0]"#, 2, "--query"),
    ] {
        let (code, out, err) = generate("lambda", line, &folder);
        assert_eq!((code, out.as_str()), (Some(expected), ""));
        assert!(err.starts_with("sarrus generate: ") && err.contains(words), "{err}");
    }
}

#[test]
fn kernels_for_devices_have_their_files_and_are_run_or_say_why_not() {
    for (language, endings) in [("cuda", [".cu", "_launch.cu"]), ("opencl", [".cl", "_launch.c"])] {
        let folder = Folder::new(&format!("generate_{language}"));
        let out = folder.0.display().to_string();
        let name = "lambda_inverse_dynamics";
        let arguments = ["generate", "--robot", "lambda", "--query", LINE, "--language", language];
        let run = run(&[&arguments[..], &["--out", &out]].concat(), b"");
        assert_eq!((run.code, run.err.as_str()), (Some(0), ""));
        for ending in [&[".c", ".h", "_test.c"][..], &endings].concat() {
            assert!(folder.0.join(format!("{name}{ending}")).exists(), "{ending}");
        }
        let is_run = run.out.contains("lambda_inverse_dynamics_kernel: 16384 states, 0 left");
        assert!(is_run || run.out.contains("not run: "), "{}", run.out);
    }
}
