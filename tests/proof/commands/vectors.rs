//! The reference vectors of the robots through `ask`, by size at 1e-12.

use sarrus_tests::compare::{assert_close, largest};
use sarrus_tests::reference::{ROBOTS, cases, numbers, vectors};
use serde_json::{Value, json};

use super::run;

/// Lines that ask for every field of a file's cases, with one kind of request.
pub(super) fn lines(file: &Value, request: &str) -> String {
    let line = |case: &Value| match request {
        "kinematics" => json!({"y": case["y"], "yd": case["yd"], "ydd": case["ydd"],
            "want": ["q", "qd", "qdd", "u", "G", "g_bias", "K", "k_bias", "residual"]}),
        "inverse-dynamics" => {
            json!({"y": case["y"], "yd": case["yd"], "ydd": case["ydd"], "want": ["tau_q", "tau_y", "tau_u", "lambda"]})
        }
        _ => {
            json!({"y": case["y"], "yd": case["yd"], "tau_u": case["tau_fd"], "want": ["ydd", "qdd", "lambda", "M_y", "C_y"]})
        }
    };
    cases(file).iter().map(|case| line(case).to_string() + "\n").collect()
}

/// Compares answers with the file: each field by its key in the file and its least size.
fn check(name: &str, file: &Value, request: &str, answers: &[Value]) {
    assert_eq!(answers.len(), cases(file).len());
    for (k, (case, answer)) in cases(file).iter().zip(answers).enumerate() {
        assert_eq!(answer["status"], "ok", "{name} {k}");
        let square = largest(&numbers(&case["qd"])).powi(2);
        let fields: &[(&str, &str, f64)] = match request {
            "kinematics" => &[
                ("q", "q", 1.0),
                ("qd", "qd", 1.0),
                ("qdd", "qdd", 1.0),
                ("G", "G", 1.0),
                ("g_bias", "g", square),
                ("K", "K", 1.0),
            ],
            "inverse-dynamics" => &[
                ("tau_q", "tau_tree", 0.0),
                ("tau_y", "tau_y", 0.0),
                ("tau_u", "tau_u", 0.0),
                ("lambda", "lambda_id", 0.0),
            ],
            _ => &[
                ("ydd", "ydd_fd", 0.0),
                ("qdd", "qdd_fd", 0.0),
                ("lambda", "lambda_fd", 0.0),
                ("M_y", "M_y", 0.0),
                ("C_y", "C_y", 0.0),
            ],
        };
        for (ours, theirs, least) in fields {
            assert_close(
                &format!("{name} {k} {ours}"),
                &numbers(&answer[ours]),
                &numbers(&case[theirs]),
                *least,
                1e-12,
            );
        }
        if request == "kinematics" {
            // the file's k has the opposite sign
            let k_bias: Vec<f64> = numbers(&case["k"]).into_iter().map(|x| -x).collect();
            let size = largest(&numbers(&case["K"])) * square;
            assert_close(
                &format!("{name} {k} k_bias"),
                &numbers(&answer["k_bias"]),
                &k_bias,
                size,
                1e-12,
            );
            assert!(answer["residual"].as_f64().unwrap() < 1e-12);
        }
    }
}

#[test]
fn every_reference_vector_is_met_through_ask() {
    for name in ROBOTS {
        let file = vectors(name);
        for request in ["kinematics", "inverse-dynamics", "forward-dynamics"] {
            let answer = run(&["ask", request, "--robot", name], lines(&file, request).as_bytes());
            assert_eq!(answer.code, Some(0), "{name}: {}", answer.err);
            assert!(answer.err.lines().all(|line| line.contains(": warning: ")), "{}", answer.err);
            check(name, &file, request, &answer.json());
        }
    }
}

#[test]
fn actuator_coordinates_lead_back_to_where_they_came_from() {
    for name in ["lambda", "torso", "rh5v2_upper_body"] {
        let file = vectors(name);
        let there =
            run(&["ask", "kinematics", "--robot", name], lines(&file, "kinematics").as_bytes())
                .json();
        let back: String = there
            .iter()
            .map(|answer| json!({"u": answer["u"], "want": ["y"]}).to_string() + "\n")
            .collect();
        for (case, answer) in
            cases(&file).iter().zip(run(&["ask", "map", "--robot", name], back.as_bytes()).json())
        {
            assert_eq!(answer["status"], "ok");
            assert_close(name, &numbers(&answer["y"]), &numbers(&case["y"]), 1.0, 1e-12);
        }
    }
}
