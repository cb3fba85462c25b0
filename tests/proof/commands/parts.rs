//! Partial requests: `joints` in a line of `ask`, and `check --plan`.

use serde_json::{Value, json};

use super::run;

fn ask(line: &Value) -> (Option<i32>, Value) {
    let run =
        run(&["ask", "inverse-dynamics", "--robot", "rh5v2_full"], line.to_string().as_bytes());
    assert_eq!(run.out.lines().count(), 1, "{run:?}");
    (run.code, run.json().remove(0))
}

#[test]
fn joints_pick_rows_in_the_order_of_the_model() {
    let names = run(&["check", "--format", "json", "--robot", "rh5v2_full"], b"").json().remove(0);
    let of = |key: &str| -> Vec<String> {
        let names = names[key].as_array().unwrap().iter();
        names.map(|name| name.as_str().unwrap().to_owned()).collect()
    };
    let y = vec![0.05; of("independent").len()];
    let want = ["q", "tau_y", "tau_u", "M_y"];
    let (code, whole) = ask(&json!({ "y": y, "want": want }));
    assert_eq!((code, &whole["status"]), (Some(0), &json!("ok")));
    // the order of the patterns does not matter, and a joint is picked once
    let (code, part) =
        ask(&json!({ "y": y, "want": want, "joints": ["BodyYaw", "ALElbow*", "ALElbow"] }));
    assert_eq!((code, &part["status"]), (Some(0), &json!("ok")));
    for (field, key) in
        [("q", "tree"), ("tau_y", "independent"), ("tau_u", "active"), ("M_y", "independent")]
    {
        let rows = of(key).into_iter().zip(whole[field].as_array().unwrap());
        let is_picked = |name: &str| name == "BodyYaw" || name.starts_with("ALElbow");
        let expected: Vec<&Value> =
            rows.filter(|(name, _)| is_picked(name)).map(|(_, row)| row).collect();
        assert!(!expected.is_empty(), "{field}");
        assert_eq!(part[field].as_array().unwrap().iter().collect::<Vec<_>>(), expected, "{field}");
    }
}

#[test]
fn joints_that_are_none_are_faults_with_the_nearest_name() {
    let (code, answer) = ask(&json!({ "y": [], "joints": ["ALElbw"] }));
    assert_eq!((code, &answer["status"]), (Some(1), &json!("bad_request")));
    let words = answer["error"].as_str().unwrap();
    assert!(words.contains("`ALElbw` matches none") && words.contains("ALElbow"), "{words}");
    for joints in [json!([]), json!("ALElbow"), json!([1])] {
        let (code, answer) = ask(&json!({ "y": [], "joints": joints }));
        assert_eq!((code, &answer["status"]), (Some(1), &json!("bad_request")), "{joints}");
    }
}

fn plan(line: &Value) -> (Option<i32>, Option<Value>, String) {
    let line = line.to_string();
    let arguments = ["check", "--robot", "rh5v2_full", "--format", "json", "--plan", &line];
    let run = run(&arguments, b"");
    (run.code, run.json().first().cloned(), run.err)
}

#[test]
fn a_plan_says_what_it_does_and_leaves_out() {
    let count = |plan: &Value, key: &str| plan[key].as_u64().unwrap();
    let n = run(&["check", "--format", "json", "--robot", "rh5v2_full"], b"").json().remove(0)
        ["independent"]
        .as_array()
        .unwrap()
        .len();
    let y = vec![0.05; n];
    let pose = json!({ "request": "kinematics", "y": y, "want": ["frames"], "frames": ["BodyPitch_Link"] });
    let (code, pose, _) = plan(&pose);
    let pose = pose.unwrap();
    assert_eq!((code, &pose["status"]), (Some(0), &json!("ok")));
    let want = ["q", "qd", "qdd", "u"];
    let state = json!({ "request": "kinematics", "y": y, "yd": y, "ydd": y, "want": want });
    let state = plan(&state).1.unwrap();
    // the loop of the torso's platform is not closed: its two joints are given
    assert_eq!(count(&pose, "closed_loops"), 0);
    assert_eq!(count(&state, "closed_loops"), count(&state, "closed_loops_of_robot"));
    assert!(count(&pose, "bodies") < 4 && count(&pose, "bodies_of_robot") > 40);
    assert!(10 * count(&pose, "operations") < count(&state, "operations"), "{pose} {state}");
    assert!(pose["ns"].as_f64().unwrap() > 0.0);
    assert_eq!(count(&pose, "bytes_in"), 8 * n as u64);
    let steps: Vec<&str> =
        pose["steps"].as_array().unwrap().iter().map(|step| step.as_str().unwrap()).collect();
    assert_eq!(steps, ["poses of bodies", "frames in the root"]);

    // gravity alone needs fewer operations than inverse dynamics
    let of = |line: Value| count(&plan(&line).1.unwrap(), "operations");
    let gravity = of(json!({ "request": "inverse-dynamics", "y": y }));
    let moving = of(json!({ "request": "inverse-dynamics", "y": y, "yd": y, "ydd": y }));
    assert!(gravity < moving, "{gravity} {moving}");

    for bad in [
        json!({ "y": y }),
        json!({ "request": "dance", "y": y }),
        json!({ "request": "map" }),
        json!([]),
    ] {
        let (code, none, words) = plan(&bad);
        assert_eq!((code, none), (Some(2), None), "{bad}");
        assert!(words.starts_with("sarrus check: --plan: "), "{words}");
    }
}
