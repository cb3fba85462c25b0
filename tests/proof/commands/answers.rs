//! Answers of `ask`: keys, order, shapes, numbers.

use sarrus_tests::cases::Case;
use sarrus_tests::reference::numbers;
use serde_json::{Value, json};

use super::{FLOATING, Folder, ask, run};

pub(super) fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

/// The answer to one line.
pub(super) fn one(request: &str, robot: &str, line: &str) -> Value {
    let answer = ask(request, robot, &[line]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    answer.json().remove(0)
}

/// (rows, columns) of a list of rows.
pub(super) fn shape(value: &Value) -> (usize, usize) {
    let rows = value.as_array().unwrap();
    let columns = rows.first().map_or(0, |row| row.as_array().unwrap().len());
    assert!(rows.iter().all(|row| row.as_array().unwrap().len() == columns
        && row.as_array().unwrap().iter().all(Value::is_number)));
    (rows.len(), columns)
}

#[test]
fn without_a_wish_every_request_has_its_usual_answer() {
    let of = |request, line: &str| keys(&one(request, "torso", line)).join(" ");
    assert_eq!(of("kinematics", r#"{"y":[0.1,0.1]}"#), "status warnings q qd qdd u");
    assert_eq!(of("inverse-dynamics", r#"{"y":[0.1,0.1]}"#), "status warnings tau_y tau_u");
    assert_eq!(of("forward-dynamics", r#"{"y":[0.1,0.1],"tau_u":[1,1]}"#), "status warnings ydd");
    assert_eq!(of("kinematics", r#"{"y":[0.1,0.1],"want":[]}"#), "status warnings");
}

#[test]
fn fields_come_in_the_order_in_which_they_are_wanted() {
    let line = r#"{"want":["lambda","M_y","q","residual","frames","tau_u","y","iterations"],"frames":["BodyPitch_Link"],"y":[0.1,0.2]}"#;
    let frames = run(&["check", "--robot", "torso", "--format", "json"], b"");
    assert_eq!(frames.code, Some(0));
    let answer =
        ask("inverse-dynamics", "torso", &[&line.replace("BodyPitch_Link", &torso_link())]);
    assert_eq!(
        keys(&answer.json()[0]),
        [
            "status",
            "warnings",
            "lambda",
            "M_y",
            "q",
            "residual",
            "frames",
            "tau_u",
            "y",
            "iterations"
        ]
    );
}

/// A moving link of the torso.
fn torso_link() -> String {
    let urdf = sarrus_models::bundled_text("torso").unwrap().0;
    let child = urdf.split("<child link=\"").nth(1).unwrap();
    child.split('"').next().unwrap().to_owned()
}

#[test]
fn every_field_has_its_shape() {
    let line = r#"{"y":[0.1,0.2],"yd":[1,0],"want":["q","qd","y","u","G","g_bias","G_u","g_u","K","k_bias","lambda","M_y","C_y",
        "tau_q","tau_y","tau_u","tau_unactuated","residual","iterations","cond_Kd","cond_Gu","cond_My","sigma_min","nearest_y"]}"#;
    let answer = one("inverse-dynamics", "torso", &line.replace('\n', ""));
    assert_eq!(answer["status"], "ok");
    for (name, n) in [
        ("q", 8),
        ("qd", 8),
        ("y", 2),
        ("u", 2),
        ("g_bias", 8),
        ("g_u", 2),
        ("k_bias", 6),
        ("lambda", 6),
        ("C_y", 2),
    ] {
        assert_eq!(answer[name].as_array().unwrap().len(), n, "{name}");
    }
    for (name, n) in
        [("tau_q", 8), ("tau_y", 2), ("tau_u", 2), ("tau_unactuated", 2), ("nearest_y", 2)]
    {
        assert_eq!(answer[name].as_array().unwrap().len(), n, "{name}");
    }
    for (name, rows, columns) in [("G", 8, 2), ("G_u", 2, 2), ("K", 6, 8), ("M_y", 2, 2)] {
        assert_eq!(shape(&answer[name]), (rows, columns), "{name}");
    }
    for name in ["residual", "cond_Kd", "cond_Gu", "cond_My", "sigma_min"] {
        assert!(answer[name].is_f64(), "{name}");
    }
    assert!(answer["iterations"].is_u64(), "a count is a whole number");
    // a matrix with one number is still a list of rows
    assert_eq!(
        shape(&one("inverse-dynamics", "lambda", r#"{"y":[0],"want":["M_y"]}"#)["M_y"]),
        (1, 1)
    );
    // no loop, no rows
    let folder = Folder::new("shape");
    let urdf = folder.file("a.urdf", FLOATING);
    let line = r#"{"y":[0,0,0,0,0,0,1,0.5],"want":["K","lambda","G_u"]}"#;
    let answer =
        run(&["ask", "inverse-dynamics", "--urdf", &urdf], line.as_bytes()).json().remove(0);
    assert_eq!((&answer["K"], &answer["lambda"]), (&json!([]), &json!([])));
    assert_eq!(shape(&answer["G_u"]), (1, 7));
}

#[test]
fn frames_come_by_link_in_the_order_asked_without_being_wanted() {
    let line = r#"{"y":[0.3],"yd":[1],"frames":["ElbowAct_Link","Elbow_Link","base_link"]}"#;
    let answer = one("kinematics", "lambda", line);
    assert_eq!(keys(&answer), ["status", "warnings", "q", "qd", "qdd", "u", "frames"]);
    assert_eq!(keys(&answer["frames"]), ["ElbowAct_Link", "Elbow_Link", "base_link"]);
    for link in ["ElbowAct_Link", "Elbow_Link", "base_link"] {
        let frame = &answer["frames"][link];
        assert_eq!(keys(frame), ["p", "quat", "twist", "acc"]);
        assert_eq!(
            ["p", "quat", "twist", "acc"].map(|part| frame[part].as_array().unwrap().len()),
            [3, 4, 6, 6]
        );
        let quat = numbers(&frame["quat"]);
        assert!((quat.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14);
    }
    let p = [0.0; 3];
    let zero = [0.0; 6];
    let still = json!({"p": p, "quat": [0.0, 0.0, 0.0, 1.0], "twist": zero, "acc": zero});
    assert_eq!(answer["frames"]["base_link"], still);
    assert_eq!(one("kinematics", "lambda", r#"{"y":[0.3],"frames":[]}"#)["frames"], json!({}));
}

#[test]
fn quantities_of_the_links_have_their_shapes_and_names() {
    let line = r#"{"y":[0.1,0.2],"yd":[1,-2],"frames":["L"],"want":["com","com_jacobian","com_bias","momentum","centroidal","energy","Jd_yd"]}"#;
    let answer = one("kinematics", "torso", &line.replace('L', &torso_link()));
    for (name, n) in [("com", 3), ("com_bias", 3), ("momentum", 6)] {
        assert_eq!(answer[name].as_array().unwrap().len(), n, "{name}");
    }
    for (name, size) in [("com_jacobian", (3, 2)), ("centroidal", (6, 2)), ("Jd_yd", (1, 6))] {
        assert_eq!(shape(&answer[name]), size, "{name}");
    }
    assert_eq!(keys(&answer["energy"]), ["kinetic", "potential"]);
    assert!(answer["energy"]["kinetic"].as_f64().unwrap() > 0.0);
    let without = ask("kinematics", "torso", &[r#"{"y":[0,0],"want":["Jd_yd"]}"#]).json();
    let words = without[0]["error"].as_str().unwrap();
    assert!(words.contains("`Jd_yd` is wanted of no link"), "{words}");
}

#[test]
fn what_the_motors_allow_has_its_shapes_and_names() {
    let line = r#"{"y":[0.1,0.2],"yd":[0,0],"ydd":[1,2],"directions":[[1,0],[0,-1],[1,1]],
        "gains_u":{"stiffness":[100,200],"damping":[5,6]},"want":["torque_vertices",
        "torque_vertices_net","torque_support","torque_support_net","speed_vertices",
        "reflected_inertia","reflected_damping","reflected_force","gains_y","margin","clip",
        "clip_nearest","binding"]}"#;
    let answer = one("inverse-dynamics", "torso", &line.replace('\n', ""));
    for name in ["torque_vertices", "torque_vertices_net", "speed_vertices"] {
        assert_eq!(shape(&answer[name]), (4, 2), "{name}");
    }
    for (name, n) in [
        ("torque_support", 3),
        ("torque_support_net", 3),
        ("reflected_force", 2),
        ("clip", 2),
        ("clip_nearest", 2),
    ] {
        assert_eq!(numbers(&answer[name]).len(), n, "{name}");
    }
    for name in ["reflected_inertia", "reflected_damping"] {
        assert_eq!(shape(&answer[name]), (2, 2), "{name}");
    }
    assert_eq!(keys(&answer["gains_y"]), ["stiffness", "damping", "force"]);
    assert_eq!(shape(&answer["gains_y"]["stiffness"]), (2, 2));
    assert!(answer["margin"].as_f64().unwrap() > 0.0);
    assert_eq!(answer["binding"].as_array().unwrap().len(), 1);
    // without a limit: names and nulls
    let line = r#"{"y":[0.1],"want":["torque_vertices"]}"#;
    let limited = ask("kinematics", "lambda", &[line]).json().remove(0);
    assert_eq!(limited["status"], "ok");
    for (line, word) in [
        (r#"{"y":[0,0],"want":["torque_support"]}"#, "directions"),
        (r#"{"y":[0,0],"want":["gains_y"]}"#, "gains_u"),
        (r#"{"y":[0,0],"directions":[[1]],"want":["torque_support"]}"#, "2"),
        (r#"{"y":[0,0],"directions":[],"want":["torque_support"]}"#, "a direction"),
        (r#"{"y":[0,0],"friction":1}"#, "true or false"),
    ] {
        let answer = ask("kinematics", "torso", &[line]).json().remove(0);
        assert_ne!(answer["status"], "ok", "{line}");
        assert!(answer["error"].as_str().unwrap().contains(word), "{answer}");
    }
    let whole = r#"{"y":[0,0,0,0,0,0],"want":["speed_vertices"]}"#;
    let answer = ask("kinematics", "stewart", &[whole]).json().remove(0);
    assert_eq!(answer["status"], "bad_request");
    assert!(answer["error"].as_str().unwrap().contains("at most 4"), "{answer}");
}

#[test]
fn second_derivatives_and_base_parameters_have_their_shapes_and_reasons() {
    let along = r#""y":[0.1,0.2],"direction":{"y":[1,0],"tau":[0,1]}"#;
    let line = format!(r#"{{{along},"want":["d2_tau_y_v","base_parameters"]}}"#);
    let answer = one("inverse-dynamics", "torso", &line);
    assert_eq!(shape(&answer["d2_tau_y_v"]), (2, 4));
    let base = answer["base_parameters"].as_array().unwrap();
    let known = base.iter().filter(|x| x.is_number()).count();
    assert!(known >= 36 && known < base.len(), "{known} of {}", base.len());
    let line = format!(r#"{{{along},"tau_u":[1,2],"want":["d2_ydd_v"]}}"#);
    assert_eq!(shape(&one("forward-dynamics", "torso", &line)["d2_ydd_v"]), (2, 6));
    let line = format!(r#"{{{along},"multipliers":[1,2],"want":["d2_tau_y_v"]}}"#);
    assert_eq!(numbers(&one("inverse-dynamics", "torso", &line)["d2_tau_y_v"]).len(), 4);
    for (line, status, word) in [
        (r#"{"y":[0,0],"want":["d2_tau_y_v"]}"#, "bad_request", "give direction"),
        (r#"{"y":[0,0],"direction":[1,0],"want":["d2_tau_y_v"]}"#, "bad_request", "an object"),
        (r#"{"y":[0,0],"direction":{"q":[1]},"want":["d2_tau_y_v"]}"#, "bad_request", "\"tau\""),
        (r#"{"y":[0,0],"direction":{"y":[1]},"want":["d2_tau_y_v"]}"#, "wrong_size", "expected 2"),
        (
            r#"{"u":[0,0],"direction":{"y":[1,0]},"want":["d2_tau_y_v"]}"#,
            "bad_request",
            "goes along",
        ),
    ] {
        let answer = ask("inverse-dynamics", "torso", &[line]).json().remove(0);
        assert_eq!(answer["status"], status, "{line}");
        assert!(answer["error"].as_str().unwrap().contains(word), "{answer}");
    }
}

#[test]
fn an_observer_goes_from_line_to_line_and_finds_the_force_of_a_robot_that_stands() {
    let hold = one("inverse-dynamics", "torso", r#"{"y":[0.1,0.05],"want":["tau_y"]}"#);
    let tau: Vec<f64> = numbers(&hold["tau_y"]).iter().map(|x| x - 2.0).collect();
    let mut line = json!({"y": [0.1, 0.05], "yd": [0, 0], "tau_y": tau, "dt": 0.1, "gain": 20});
    let mut forces = Vec::new();
    for _ in 0..20 {
        let answer = one("observe", "torso", &line.to_string());
        forces.push(numbers(&answer["tau_external"])[0]);
        line["observer"] = answer["observer"].clone();
    }
    assert_eq!(forces[0], 0.0);
    // the actuators lack 2 N m that hold the robot: something else gives them
    for (k, force) in forces.iter().enumerate() {
        assert!((force - 2.0 * (1.0 - (-2.0 * k as f64).exp())).abs() < 1e-12, "{forces:?}");
    }
    for (more, word) in [
        (r#""dt":-1,"gain":1"#, "dt as a number"),
        (r#""dt":[1],"gain":1"#, "dt as a number"),
        (r#""dt":1"#, "give dt and gain"),
        (r#""dt":1,"gain":1,"observer":[[0,0,0]]"#, "2 times a row of the observer of 3"),
        (r#""dt":1,"gain":1,"observer":[[0,0],[0,0,0]]"#, "has 2 numbers, expected 3"),
    ] {
        let line = format!(r#"{{"y":[0,0],"yd":[0,0],"tau_u":[0,0],{more}}}"#);
        let answer = ask("observe", "torso", &[&line]).json().remove(0);
        assert!(answer["error"].as_str().unwrap().contains(word), "{answer}");
    }
}

#[test]
fn maps_of_motors_are_the_fields_at_their_points() {
    let mapped = run(&["capability", "--robot", "torso", "--grid", "3"], b"");
    let map = mapped.json().remove(0);
    assert_eq!(map["points"].as_array().unwrap().len(), 9);
    assert_eq!(map["no_limit"], json!([]));
    for k in 0..9 {
        if map["reachable"][k] == json!(false) {
            assert!(map["sigma_min"][k].is_null());
            continue;
        }
        let y = map["points"][k].clone();
        let line = json!({"y": y, "directions": [[1, 0], [0, 1]],
            "want": ["torque_support", "reflected_inertia", "sigma_min", "speed_vertices", "G_u"]});
        let answer = one("kinematics", "torso", &line.to_string());
        assert_eq!(map["torque_max"][k], answer["torque_support"]);
        assert_eq!(map["reflected_inertia"][k], answer["reflected_inertia"]);
        assert_eq!(map["sigma_min"][k], answer["sigma_min"]);
        let line = json!({"y": y, "tau_y": [1, 0], "want": ["margin"]});
        let alone = one("map", "torso", &line.to_string())["margin"].as_f64().unwrap();
        let mapped = map["torque_alone"][k][0].as_f64().unwrap();
        assert!((alone - mapped).abs() < 1e-9 * alone, "{alone} {mapped}");
        let vertices = answer["speed_vertices"].as_array().unwrap();
        let most = vertices.iter().map(|row| numbers(row)[0]).fold(0.0, f64::max);
        let mapped = map["speed_free"][k][0].as_f64().unwrap();
        assert!((most - mapped).abs() < 1e-9 * most, "{most} {mapped}");
    }
    for (arguments, word) in [
        (&["--grid", "1001"][..], "1002001 points"),
        (&["--grid", "1"][..], "2 or more"),
        (&["--joints", "Elbow"][..], "no independent joint"),
        (&["--at", "{}"][..], "no line with y"),
        (&["--at", "{\"y\": [1]}"][..], "expected 2"),
    ] {
        let refused = run(&[&["capability", "--robot", "torso"], arguments].concat(), b"");
        assert_eq!(refused.code, Some(2), "{arguments:?}");
        assert!(refused.err.contains(word), "{}", refused.err);
    }
}

#[test]
fn frames_have_the_axes_and_the_reference_that_a_line_names() {
    let of = |more: &str| {
        let line = r#"{"y":[0.3],"yd":[1],"frames":["ElbowAct_Link"],"want":["frames"]MORE}"#;
        one("kinematics", "lambda", &line.replace("MORE", more))["frames"]["ElbowAct_Link"].clone()
    };
    let plain = of("");
    assert_eq!(of(r#","axes":"mixed""#), plain);
    let still = of(r#","relative_to":"ElbowAct_Link""#);
    assert!(numbers(&still["p"]).iter().all(|x| x.abs() < 1e-15), "{still}");
    assert_eq!(numbers(&still["twist"]), [0.0; 6]);
    let [local, world] = ["local", "world"].map(|axes| of(&format!(r#","axes":"{axes}""#)));
    let size = |x: &Value| numbers(x)[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((size(&local["twist"]) - size(&plain["twist"])).abs() < 1e-14);
    assert_ne!(local["twist"], plain["twist"]);
    assert_eq!(numbers(&world["twist"])[..3], numbers(&plain["twist"])[..3]);
    for more in [r#","axes":"body""#, r#","axes":1"#, r#","relative_to":"Elbow""#] {
        let line = format!(r#"{{"y":[0.3],"frames":["ElbowAct_Link"]{more}}}"#);
        let answer = ask("kinematics", "lambda", &[&line]).json().remove(0);
        assert_eq!(answer["status"], "bad_request", "{more}");
    }
}

#[test]
fn lines_that_cannot_be_answered_name_their_own_fault() {
    let task = r#""tasks":[{"frame":"Elbow_Link","TASK":[0,0,0,0,0,0]}]"#;
    let [twist, acc] = ["twist", "acc"].map(|name| task.replace("TASK", name));
    let still = r#""contacts":["ElbowAct_Link","Elbow_Link"]"#;
    for (request, line, words) in [
        ("diff-ik", format!(r#"{{"y":[0.3],"dt":0,{twist}}}"#), "dt is 0"),
        ("step", format!(r#"{{"y":[0.3],"dt":0.0,{acc}}}"#), "dt is 0"),
        ("step", r#"{"y":[0.3],"dt":0.1,"tasks":[]}"#.to_owned(), "one or more"),
        ("step", r#"{"y":[0.3],"dt":0.1,"frames":[]}"#.to_owned(), "no part of a step"),
        ("ik", r#"{"tasks":[]}"#.to_owned(), "one or more"),
        ("inverse-dynamics", r#"{"y":[0.3],"yd":[1e308]}"#.to_owned(), "so large"),
        ("step", format!(r#"{{"y":[0.3],"yd":[0.5],"dt":0.1,{still}}}"#), "no limit"),
    ] {
        let answer = ask(request, "lambda", &[&line]).json().remove(0);
        let told = answer["error"].as_str().unwrap_or_default();
        assert!(told.contains(words), "{request} {line}: {answer}");
    }
}

#[test]
fn each_mechanism_of_a_robot_is_one_map_of_all_its_freedoms() {
    let robot = "rh5v2_upper_body";
    let model = &Case::bundled(robot).compiled.model;
    let info = model.info();
    let mut of_size = [0; 5];
    let four = ["ALShoulder1", "ALShoulder2", "ALShoulder3", "ALElbow"].join(",");
    for more in [&[][..], &["--joints", &four]] {
        let arguments = ["capability", "--robot", robot, "--grid", "2"];
        let mapped = run(&[&arguments, more].concat(), b"").json();
        for map in &mapped {
            let joints: Vec<&str> =
                map["joints"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
            let p = joints.len();
            let place = |name: &&str| info.independent.iter().position(|of| of == name).unwrap();
            let places: Vec<usize> = joints.iter().map(place).collect();
            assert_eq!(map["points"].as_array().unwrap().len(), 1 << p);
            of_size[p] += 1;
            for k in (0..1 << p).filter(|k| map["reachable"][*k] == json!(true)) {
                let mut y = vec![0.0; info.independent.len()];
                for (at, x) in places.iter().zip(numbers(&map["points"][k])) {
                    y[*at] = x;
                }
                let line = json!({"y": y, "want": ["G_u", "torque_vertices"], "joints": joints});
                let answer = one("kinematics", robot, &line.to_string());
                // each row of G_uᵀ by itself: the largest of every choice of limits
                let line = json!({"y": y, "want": ["G_u"]});
                let G_u = one("kinematics", robot, &line.to_string())["G_u"].clone();
                for (i, at) in places.iter().enumerate() {
                    let of = |(u, name): (usize, &String)| {
                        let v = info.tree.iter().position(|of| of == name).unwrap();
                        let effort = info.limits[v].unwrap().effort.unwrap();
                        numbers(&G_u[u])[*at].abs() * effort
                    };
                    let most: f64 = info.active.iter().enumerate().map(of).sum();
                    let vertices = answer["torque_vertices"].as_array().unwrap();
                    let of_vertices = vertices.iter().map(|row| numbers(row)[i]);
                    let of_vertices = of_vertices.fold(0.0, f64::max);
                    for found in [numbers(&map["torque_max"][k])[i], of_vertices] {
                        assert!((found - most).abs() < 1e-9 * most, "{joints:?} {found} {most}");
                    }
                }
            }
        }
    }
    println!("maps by their freedoms {of_size:?}");
    assert!(of_size[1..].iter().all(|n| *n > 0), "{of_size:?}");
}

#[test]
fn jacobians_come_by_link_and_give_the_twist() {
    let line = r#"{"y":[0.3],"yd":[2],"frames":["ElbowAct_Link"],"want":["jacobians","qd","ud"]}"#;
    let answer = one("kinematics", "lambda", line);
    let link = &answer["jacobians"]["ElbowAct_Link"];
    assert_eq!(keys(link), ["tree", "independent", "actuator"]);
    assert_eq!(
        [shape(&link["tree"]), shape(&link["independent"]), shape(&link["actuator"])],
        [(6, 3), (6, 1), (6, 1)]
    );
    let twist = numbers(&answer["frames"]["ElbowAct_Link"]["twist"]);
    for (part, rates) in
        [("tree", &answer["qd"]), ("independent", &json!([2.0])), ("actuator", &answer["ud"])]
    {
        for (row, expected) in link[part].as_array().unwrap().iter().zip(&twist) {
            let found: f64 =
                numbers(row).iter().zip(numbers(rates)).map(|(j, rate)| j * rate).sum();
            assert!((found - expected).abs() < 1e-13, "{part}: {found} {expected}");
        }
    }
}

#[test]
fn actuators_that_do_not_tell_the_motion_leave_everything_else() {
    let folder = Folder::new("actuators");
    let urdf = folder.file("a.urdf", FLOATING);
    let ask = |request: &str, line: &str| run(&["ask", request, "--urdf", &urdf], line.as_bytes());
    let answer =
        ask("kinematics", r#"{"y":[0,0,0,0,0,0,1,0.5],"frames":["arm"],"want":["jacobians"]}"#)
            .json()
            .remove(0);
    assert_eq!(
        (&answer["status"], &answer["jacobians"]["arm"]["actuator"]),
        (&json!("ok"), &Value::Null)
    );
    assert_eq!(shape(&answer["jacobians"]["arm"]["tree"]), (6, 7));
    let answer = ask("map", r#"{"u":[0.5],"want":["y","iterations"]}"#);
    assert_eq!((answer.code, answer.statuses()), (Some(0), vec!["singular_actuation".to_owned()]));
    assert_eq!(answer.json()[0]["y"], Value::Null);
    // a quaternion far from unit length is a bad request
    let answer = ask("kinematics", r#"{"y":[0,0,0,0,0,0,2,0.5]}"#);
    assert_eq!((answer.code, answer.statuses()), (Some(1), vec!["bad_request".to_owned()]));
    assert_eq!(answer.json()[0]["column"], 2);
}

#[test]
fn failed_states_say_why_and_have_null_for_their_numbers() {
    let lines = [r#"{"y":[3,1],"want":["q","G","u"]}"#, r#"{"y":[0.1,0.1],"want":["q"]}"#];
    let answer = ask("kinematics", "wrist", &lines);
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    assert_eq!(answer.statuses(), ["unreachable", "ok"]);
    assert_eq!(
        answer.out.lines().next(),
        Some(r#"{"status":"unreachable","warnings":[],"q":null,"G":null,"u":null}"#)
    );
}

#[test]
fn limits_are_a_warning_that_changes_nothing_else() {
    let answer = one("kinematics", "lambda", r#"{"y":[3.0],"want":["y"]}"#);
    assert_eq!(answer, json!({"status": "ok", "warnings": ["limits_exceeded"], "y": [3.0]}));
}

#[test]
fn an_exceeded_force_has_the_limit_at_its_speed() {
    let folder = Folder::new("motor");
    let urdf = folder.file(
        "a.urdf",
        r#"<robot name="arm"><link name="base"/><link name="bob"><inertial>
        <origin xyz="0 0 -0.5"/><mass value="2"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
        <joint name="pivot" type="continuous"><parent link="base"/><child link="bob"/>
        <axis xyz="0 1 0"/></joint></robot>"#,
    );
    let yml = folder.file(
        "a.yml",
        "submechanisms:\n- {type: 1R, contextual_name: arm, jointnames_spanningtree: [pivot], \
         jointnames_independent: [pivot], jointnames_active: [pivot]}\nactuators:\n- joint: pivot\n  \
         torque_speed: [[10, 20], [30, 10]]\n",
    );
    let files = ["--urdf", &urdf, "--submechanisms", &yml];
    let of = |want: Value| {
        let line = json!({"y": [0.0], "yd": [20.0], "ydd": [32.0], "want": want}).to_string();
        let arguments = [&["ask", "inverse-dynamics"], &files[..]].concat();
        run(&arguments, line.as_bytes()).json().remove(0)
    };
    let answer = of(json!(["limits", "tau_u", "margin"]));
    assert_eq!(answer["warnings"], json!(["limits_exceeded"]));
    let tau = numbers(&answer["tau_u"])[0];
    let limit = &answer["limits"][0];
    assert_eq!((&limit["name"], &limit["what"]), (&json!("pivot"), &json!("effort")));
    assert_eq!((&limit["value"], &limit["lower"]), (&json!(tau), &json!(-20.0)));
    assert!((limit["upper"].as_f64().unwrap() - 15.0).abs() < 1e-12, "{limit}");
    assert!((answer["margin"].as_f64().unwrap() * tau - 15.0).abs() < 1e-12, "{answer}");
    // without `tau_u` the same warning, and no value
    let answer = of(json!(["limits", "margin"]));
    assert_eq!(answer["warnings"], json!(["limits_exceeded"]));
    assert_eq!(
        (&answer["limits"][0]["value"], answer["limits"][0]["what"].as_str()),
        (&Value::Null, Some("effort"))
    );
}

#[test]
fn numbers_survive_the_journey_bit_by_bit() {
    let cases = [
        0.1 + 0.2,
        5e-324,
        -0.0,
        1.0 / 3.0,
        1.797_693_134_862_315_7e-300,
        f64::MIN_POSITIVE,
        12_345.678_901_234_567,
    ];
    for number in cases {
        let answer = one(
            "kinematics",
            "lambda",
            &format!("{{\"y\":[0],\"yd\":[{number:?}],\"want\":[\"yd\"]}}"),
        );
        assert_eq!(answer["yd"][0].as_f64().unwrap().to_bits(), number.to_bits(), "{number:?}");
    }
    // more digits than a double holds are rounded to the nearest one
    let answer = one(
        "kinematics",
        "lambda",
        r#"{"y":[0.1000000000000000055511151231257827021181583404541015625000001],"want":["y"]}"#,
    );
    assert_eq!(answer["y"][0].as_f64(), Some(0.1));
    let answer = ask("kinematics", "lambda", &[r#"{"y":[0.1],"want":["y"]}"#]);
    assert_eq!(
        answer.out, "{\"status\":\"ok\",\"warnings\":[],\"y\":[0.1]}\n",
        "the shortest digits"
    );
}

#[test]
fn wrenches_act_and_their_order_does_not_matter() {
    let [a, b] = [r#""Elbow_Link":[0.1,0.2,0.3,4,5,6]"#, r#""ElbowAct_Link":[1,0,0,0,7,0]"#];
    let lines = [
        format!("{{\"y\":[0.3],\"wrenches\":{{{a},{b}}}}}"),
        format!("{{\"y\":[0.3],\"wrenches\":{{{b},{a}}}}}"),
    ];
    let answer = ask(
        "inverse-dynamics",
        "lambda",
        &[&lines[0], &lines[1], r#"{"y":[0.3]}"#, r#"{"y":[0.3],"wrenches":{}}"#],
    );
    let lines: Vec<&str> = answer.out.lines().collect();
    assert_eq!((lines[0], lines[2]), (lines[1], lines[3]));
    assert_ne!(lines[0], lines[2]);
}

#[test]
fn gravity_is_an_option_of_the_model() {
    let ask = |gravity: &str| {
        run(
            &["ask", "inverse-dynamics", "--robot", "lambda", "--gravity", gravity],
            b"{\"y\":[0.3],\"want\":[\"tau_y\"]}",
        )
    };
    let of = |gravity: &str| numbers(&ask(gravity).json()[0]["tau_y"])[0];
    assert_eq!(of("0,0,0"), 0.0);
    assert!((of("0,0,-9.81") + of("0,0,9.81")).abs() < 1e-12 && of("0,0,9.81") != 0.0);
    assert_eq!(ask("-1,0,0").code, Some(0), "a leading minus is no flag");
}
