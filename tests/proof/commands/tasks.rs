//! Answers of `ask` in task space.

use sarrus_tests::reference::numbers;
use serde_json::{Value, json};

use super::answers::{keys, one, shape};
use super::ask;

#[test]
fn steps_of_tasks_have_their_motion_and_name_their_limits() {
    let link = "ElbowAct_Link";
    let there =
        format!(r#"{{"y":[0.3],"yd":[0.2],"ydd":[0.1],"frames":["{link}"],"want":["frames"]}}"#);
    let there = one("kinematics", "lambda", &there)["frames"][link].clone();
    let of = |request: &str, task: &str, more: &str| {
        let line = format!(r#"{{"tasks":[{{"frame":"{link}",{task}}}],"dt":0.001{more}}}"#);
        one(request, "lambda", &line)
    };
    let twist = format!(r#""twist":{}"#, there["twist"]);
    let found = of("diff-ik", &twist, r#","y":[0.3]"#);
    assert_eq!(keys(&found)[2..], ["yd", "binding", "task_residual"]);
    assert_eq!((&found["status"], &found["binding"]), (&json!("ok"), &json!([])));
    assert!((numbers(&found["yd"])[0] - 0.2).abs() < 1e-6, "{found}");
    let acc = format!(r#""acc":{}"#, there["acc"]);
    let found = of("step", &acc, r#","y":[0.3],"yd":[0.2]"#);
    assert_eq!(keys(&found)[2..], ["ydd", "tau_u", "binding", "task_residual", "contact_forces"]);
    assert!((numbers(&found["ydd"])[0] - 0.1).abs() < 1e-6, "{found}");
    assert_eq!(found["contact_forces"], json!({}));
    let line = format!(r#"{{"y":[0.3],"yd":[0.2],"tau_u":[{}]}}"#, numbers(&found["tau_u"])[0]);
    let again = one("forward-dynamics", "lambda", &line);
    assert!((numbers(&again["ydd"])[0] - numbers(&found["ydd"])[0]).abs() < 1e-8, "{again}");
    // a frame that stands still does so by forces of the ground, which the line's wrenches are
    let held = format!(r#"{{"y":[0.3],"yd":[0],"dt":0.001,"contacts":["{link}"]}}"#);
    let held = one("step", "lambda", &held);
    assert!(numbers(&held["ydd"])[0].abs() < 1e-9, "{held}");
    let line = format!(
        r#"{{"y":[0.3],"tau_u":[{}],"wrenches":{}}}"#,
        numbers(&held["tau_u"])[0],
        held["contact_forces"]
    );
    let again = one("forward-dynamics", "lambda", &line);
    assert!(numbers(&again["ydd"])[0].abs() < 1e-6, "{again}");
    let outside = of("diff-ik", &twist, r#","y":[0.3],"bounds":{"y":[[0.4,0.3]]}"#);
    assert_eq!((&outside["status"], &outside["yd"]), (&json!("infeasible"), &Value::Null));
    assert_eq!(outside["binding"].as_array().map(Vec::len), Some(1), "{outside}");

    for (request, bad) in [
        ("diff-ik", r#"{"y":[0.3],"tasks":[]}"#),
        ("diff-ik", r#"{"y":[0.3],"dt":0,"tasks":[]}"#),
        ("diff-ik", r#"{"dt":0.1,"y":[0],"tasks":[{"frame":"Elbow_Link","acc":[0,0,0,0,0,0]}]}"#),
        ("step", r#"{"dt":0.1,"y":[0],"tasks":[{"frame":"Elbow_Link","p":[0,0,0]}]}"#),
        ("ik", r#"{"tasks":[{"frame":"Elbow_Link","twist":[0,0,0,0,0,0]}]}"#),
        ("ik", r#"{"com":[0,0,0],"contacts":["Elbow_Link"]}"#),
        ("step", r#"{"dt":0.1,"y":[0],"contacts":["Elbow"]}"#),
    ] {
        let answer = ask(request, "lambda", &[bad]).json().remove(0);
        assert_eq!(answer["status"], "bad_request", "{bad}");
    }
}

#[test]
fn positions_are_found_for_tasks_and_name_their_bounds() {
    let link = "ElbowAct_Link";
    let there = format!(r#"{{"y":[0.3],"frames":["{link}"],"want":["frames"]}}"#);
    let there = one("kinematics", "lambda", &there)["frames"][link].clone();
    let of = |p: &Value, more: &str| {
        let quat = &there["quat"];
        let line = format!(r#"{{"tasks":[{{"frame":"{link}","p":{p},"quat":{quat}}}]{more}}}"#);
        one("ik", "lambda", &line)
    };
    let found = of(&there["p"], "");
    assert_eq!(keys(&found)[2..], ["y", "q", "u", "iterations", "binding", "task_residual"]);
    assert_eq!((&found["status"], &found["binding"]), (&json!("ok"), &json!([])));
    assert!((numbers(&found["y"])[0] - 0.3).abs() < 1e-8, "{found}");
    assert!(numbers(&found["task_residual"])[0] <= 1e-9 && found["task_residual"][1].is_null());

    let bounded = of(&there["p"], r#","bounds":{"y":[[null,0.1]]},"y_guess":[2]"#);
    assert_eq!(bounded["status"], "not_reached");
    assert_eq!(numbers(&bounded["y"]), [0.1]);
    assert_eq!(bounded["binding"].as_array().map(Vec::len), Some(1), "{bounded}");
    let far = of(&json!([9, 9, 9]), r#","all":true"#);
    assert_eq!((&far["status"], &far["solutions"]), (&json!("not_reached"), &json!([])));
    let empty = of(&there["p"], r#","bounds":{"y":[[0.2,0.1]]}"#);
    assert_eq!((&empty["status"], &empty["y"]), (&json!("infeasible"), &Value::Null));
    assert_eq!(empty["binding"].as_array().map(Vec::len), Some(1), "{empty}");

    for bad in [
        "{}",
        r#"{"tasks":[]}"#,
        r#"{"tasks":[{"p":[0,0,0]}]}"#,
        r#"{"tasks":[{"frame":"Elbow_Link"}]}"#,
        r#"{"tasks":[{"frame":"Elbow_Link","p":[0,0,0],"priority":2}]}"#,
        r#"{"tasks":[{"frame":"Elbow_Link","p":[0,0,0]}],"y":[0]}"#,
        r#"{"tasks":[{"frame":"Elbow_Link","axis":[0,0,0]}]}"#,
        r#"{"com":[0,0,0],"bounds":{"q":[]}}"#,
    ] {
        let answer = ask("ik", "lambda", &[bad]).json().remove(0);
        assert_eq!(answer["status"], "bad_request", "{bad}");
    }
    let kinematics = r#"{"y":[0],"com":[0,0,0]}"#;
    let answer = ask("kinematics", "lambda", &[kinematics]).json().remove(0);
    assert_eq!((&answer["status"], &answer["column"]), (&json!("bad_request"), &json!(10)));
}

#[test]
fn inertia_and_forces_of_frames_come_as_matrices() {
    let line = r#"{"y":[0.3],"yd":[1],"frames":["Elbow_Link"],
        "want":["Lambda","mu","p_task","task_rank"]}"#;
    let answer = one("inverse-dynamics", "lambda", &line.replace('\n', ""));
    assert_eq!(shape(&answer["Lambda"]), (6, 6));
    assert_eq!(numbers(&answer["task_rank"]), [1.0, 1.0]);
    assert_eq!((numbers(&answer["mu"]).len(), numbers(&answer["p_task"]).len()), (6, 6));
    for field in ["Lambda", "mu", "p_task", "task_rank"] {
        let line = format!(r#"{{"y":[0.3],"want":["{field}"]}}"#);
        let answer = ask("inverse-dynamics", "lambda", &[&line]).json().remove(0);
        assert_eq!(answer["status"], "bad_request", "{field}");
    }
}
