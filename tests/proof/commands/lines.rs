//! Input of `ask`: invalid lines, requests without an answer, lines of any length.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use serde_json::Value;

use super::{Run, ask, run, sarrus, subset};

/// The column of the only invalid line.
fn refused(request: &str, robot: &str, line: &[u8]) -> (u64, String) {
    let answer = run(&["ask", request, "--robot", robot], line);
    assert_eq!(
        (answer.code, answer.statuses()),
        (Some(1), vec!["bad_request".to_owned()]),
        "{answer:?}"
    );
    let answer = answer.json().remove(0);
    let keys: Vec<&str> = answer.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["status", "warnings", "column", "error"]);
    (answer["column"].as_u64().unwrap(), answer["error"].as_str().unwrap().to_owned())
}

#[test]
fn every_kind_of_bad_line_has_its_column_and_its_reason() {
    let cases: [(&str, u64, &str); 34] = [
        ("nonsense", 2, "not JSON: expected ident"),
        (r#"{"y":[0.1 0.2]}"#, 11, "not JSON: expected `,` or `]`"),
        (r#"{"y":[NaN]}"#, 7, "not JSON: expected value"),
        (r#"{"y":[0.1]} {}"#, 13, "not JSON: trailing characters"),
        (r#"{"y":[0.1],}"#, 12, "not JSON: key must be a string"),
        ("[0.1]", 1, "a list, expected an object such as {\"y\": [0.1]}"),
        ("7", 1, "a number, expected an object such as {\"y\": [0.1]}"),
        (
            r#"{"yy":[0.1]}"#,
            2,
            "`yy` is no key of a request, expected one of y, yd, ydd, u, ud, udd, q, qd, qdd, \
             q_guess, qd_guess, tau_u, tau_y, tau_q, y_guess, y_preferred, multipliers, wrenches, \
             directions, gains_u, direction, dt, gain, observer, frames, joints, want",
        ),
        (r#"{"y":[0.1],"G":[1]}"#, 12, "`G` is no key of a request"),
        (r#"{"y":[0.1],"y":[0.2]}"#, 12, "`y` stands here twice"),
        (r#"{"y":[0.1],"\u0079":[0.2]}"#, 12, "`y` stands here twice"),
        (r#"{"y":0.1}"#, 6, "a number, expected y as a list of 1 numbers"),
        (r#"{"y":{"0":1}}"#, 6, "an object, expected y as a list of 1 numbers"),
        (r#"{"y":[0.1],"yd":null}"#, 17, "null, expected yd as a list of 1 numbers"),
        (r#"{"y":["0.1"]}"#, 7, "text, expected y as a list of 1 numbers"),
        (r#"{"y":[true]}"#, 7, "true or false, expected y as a list of 1 numbers"),
        (r#"{"y":[[0.1]]}"#, 7, "a list, expected y as a list of 1 numbers"),
        (r#"{"yd":[0.1]}"#, 1, "nothing says where the robot is: give y, q or u"),
        (r#"{}"#, 1, "nothing says where the robot is"),
        (r#"{"y":[0.1],"u":[0]}"#, 12, "`y` and `u` exclude each other; give one"),
        (r#"{"y":[0.1],"tau_u":[0]}"#, 12, "`tau_u` is no input of this request"),
        (
            r#"{"y":[0.1],"wrenches":{"Elbow_Link":[0,0,0,0,0,0]}}"#,
            12,
            "`wrenches` is no input of this request",
        ),
        (r#"{"y":[0.1],"want":"q"}"#, 19, "text, expected want as a list of names"),
        (r#"{"y":[0.1],"want":[1]}"#, 20, "a number, expected want as a list of names"),
        (
            r#"{"y":[0.1],"want":["q","Q"]}"#,
            24,
            "`Q` cannot be wanted, expected some of y, yd, ydd, q,",
        ),
        (r#"{"y":[0.1],"want":["frame_pose"]}"#, 20, "`frame_pose` cannot be wanted"),
        (r#"{"y":[0.1],"want":["q","q"]}"#, 24, "`q` stands here twice"),
        (r#"{"y":[0.1],"want":["q","tau_u"]}"#, 24, "`tau_u` is no output of this request"),
        (r#"{"y":[0.1],"want":["q_guess"]}"#, 20, "`q_guess` is no output of this request"),
        (
            r#"{"y":[0.1],"want":["frames"]}"#,
            20,
            "`frames` is wanted of no link, expected \"frames\": [\"link\"] beside it",
        ),
        (r#"{"y":[0.1],"want":["jacobians"]}"#, 20, "`jacobians` is wanted of no link"),
        (r#"{"y":[0.1],"frames":["hand"]}"#, 22, "`hand` is none of the 4 links of lambda"),
        (
            r#"{"y":[0.1],"frames":["Elbow_Link","Elbow_Link"]}"#,
            35,
            "`Elbow_Link` stands here twice",
        ),
        (r#"{"y":[0.1],"frames":"Elbow_Link"}"#, 21, "text, expected frames as a list of links"),
    ];
    for (line, column, words) in cases {
        let (at, error) = refused("kinematics", "lambda", line.as_bytes());
        assert!(error.starts_with(words), "{line}\n{error}");
        assert_eq!(at, column, "{line}\n{error}");
    }
}

#[test]
fn columns_count_characters_and_bytes_that_are_no_text_are_told() {
    assert_eq!(
        refused("kinematics", "lambda", "{\"y\":[0.1],\"frames\":[\"äöü\",1]}".as_bytes()).0,
        28
    );
    assert_eq!(refused("kinematics", "lambda", "  {\"ä\":1}".as_bytes()).0, 4);
    assert_eq!(
        refused("kinematics", "lambda", b"{\"y\":[0.1],\"\xff\":1}"),
        (13, "a byte that is no UTF-8".to_owned())
    );
    assert_eq!(refused("kinematics", "lambda", br#"{"\ud800":1}"#).0, 2);
}

#[test]
fn wrenches_and_forces_are_checked_like_everything_else() {
    for (line, column) in [
        (r#"{"y":[0.1],"wrenches":[1]}"#, 23),
        (r#"{"y":[0.1],"wrenches":{"hand":[0,0,0,0,0,0]}}"#, 24),
        (r#"{"y":[0.1],"wrenches":{"Elbow_Link":0}}"#, 37),
        (r#"{"y":[0.1],"wrenches":{"Elbow_Link":[0,0,0,0,0,1],"Elbow_Link":[0,0,0,0,0,1]}}"#, 51),
        (r#"{"y":[0.1],"tau_y":[0.1]}"#, 12),
    ] {
        assert_eq!(refused("inverse-dynamics", "lambda", line.as_bytes()).0, column, "{line}");
    }
    let (column, error) = refused("forward-dynamics", "lambda", br#"{"y":[0.1]}"#);
    assert_eq!(
        (column, error.as_str()),
        (1, "nothing says the forces: give tau_u, tau_y or tau_q")
    );
    assert_eq!(
        refused("forward-dynamics", "lambda", br#"{"y":[0.1],"ydd":[0],"tau_u":[1]}"#).0,
        12
    );
}

#[test]
fn a_wrong_count_and_an_infinite_number_are_failed_states() {
    let lines = [
        r#"{"y":[0.1,0.2],"want":["q","residual"]}"#,
        r#"{"y":[]}"#,
        r#"{"y":[1e999]}"#,
        r#"{"y":[0.1],"yd":[-1e400],"ydd":[1,2]}"#,
        r#"{"y":[0.1],"frames":["Elbow_Link"],"q_guess":[0]}"#,
    ];
    let answer = ask("kinematics", "lambda", &lines);
    assert_eq!(answer.code, Some(0), "a failed state is an answer");
    assert_eq!(
        answer.statuses(),
        ["wrong_size", "wrong_size", "non_finite_input", "wrong_size", "wrong_size"]
    );
    let first = r#"{"status":"wrong_size","warnings":[],"q":null,"residual":null,"column":6,"error":"y has 2 numbers, expected 1"}"#;
    assert_eq!(answer.out.lines().next(), Some(first));
    let columns: Vec<u64> =
        answer.json().iter().map(|answer| answer["column"].as_u64().unwrap()).collect();
    assert_eq!(columns, [6, 6, 7, 32, 46]);
    assert_eq!(answer.json()[4]["frames"], Value::Null);
    let wrench =
        ask("inverse-dynamics", "lambda", &[r#"{"y":[0.1],"wrenches":{"Elbow_Link":[1,2]}}"#]);
    assert_eq!(wrench.json()[0]["error"], "the wrench on `Elbow_Link` has 2 numbers, expected 6");
}

#[test]
fn lines_are_answered_one_for_one_and_blank_ones_skipped() {
    let text = "\n{\"y\":[0.1]}\r\n   \nbad\n{\"y\":[9e999]}\n\t\n{\"y\":[0.2]}";
    let answer = run(&["ask", "kinematics", "--robot", "lambda"], text.as_bytes());
    assert_eq!((answer.code, answer.err.as_str()), (Some(1), ""));
    assert_eq!(answer.statuses(), ["ok", "bad_request", "non_finite_input", "ok"]);
    let nothing = run(&["ask", "kinematics", "--robot", "lambda"], b"");
    assert_eq!((nothing.code, nothing.out.as_str(), nothing.err.as_str()), (Some(0), "", ""));
}

#[test]
fn every_answer_comes_before_the_next_question() {
    for batch in ["1", "4"] {
        let mut command = Command::new(sarrus());
        command
            .args(["ask", "kinematics", "--robot", "lambda", "--batch", batch])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut stdin = child.stdin.take().unwrap();
        // two complete lines are answered before the rest of a third one arrives
        for k in 0..3 {
            write!(stdin, "{{\"y\":[0.{k}]}}\n{{\"y\":[0.1{k}]}}\n\n{{\"y\":").unwrap();
            for _ in 0..2 {
                assert!(lines.next().unwrap().unwrap().starts_with("{\"status\":\"ok\""));
            }
            writeln!(stdin, "[0.2]}}").unwrap();
            assert!(lines.next().unwrap().unwrap().starts_with("{\"status\":\"ok\""));
        }
        drop(stdin);
        assert_eq!(child.wait().unwrap().code(), Some(0));
    }
}

#[test]
fn answers_of_a_batch_are_those_of_lines_one_by_one() {
    // alternating questions, failures, wants that may fail alone, invalid lines
    let frames = "\"frames\":[\"Elbow_Link\"],\"want\":[\"jacobians\",\"q\"]";
    let mut text = String::new();
    for k in 0..100 {
        let y = f64::from(k) * 0.01;
        text += &format!("{{\"y\":[{y}]}}\n{{\"y\":[{y}],{frames}}}\nbad\n");
        text += &format!("{{\"y\":[-{y}]}}\n\n{{\"y\":[9e999]}}\n{{\"u\":[{y}]}}\n");
        text += &format!("{{\"y\":[{y}],\"yd\":[1],\"want\":[\"K\",\"k_bias\"]}}\n");
    }
    text += "{\"y\":[7]}";
    let batch =
        |n: &str| run(&["ask", "kinematics", "--robot", "lambda", "--batch", n], text.as_bytes());
    let one_by_one = batch("1");
    assert_eq!((one_by_one.code, one_by_one.statuses().len()), (Some(1), 701));
    for n in ["2", "7", "400", "1000000"] {
        let together = batch(n);
        assert_eq!((together.code, together.out == one_by_one.out), (Some(1), true), "{n}");
    }
    assert_eq!(batch("0").code, Some(2));
}

#[test]
fn a_reader_that_leaves_ends_the_command_in_silence() {
    let mut command = Command::new(sarrus());
    command
        .args(["ask", "kinematics", "--robot", "lambda"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let mut stdin = child.stdin.take().unwrap();
    let _ = stdin.write_all(&b"{\"y\":[0.1]}\n".repeat(10_000));
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0));
}

#[test]
fn long_and_deep_lines_are_lines_like_others() {
    let long = format!("{{\"y\":[{}]}}", "0.125,".repeat(3_000_000) + "1");
    let deep = format!("{{\"y\":{}{}}}", "[".repeat(5_000_000), "]".repeat(5_000_000));
    let open = "{\"y\":".repeat(2_000_000);
    let digits = format!("{{\"y\":[0.{}]}}", "1".repeat(5_000_000));
    let keys = format!("{{{}\"y\":[0]}}", "\"yd\":[0],".repeat(500_000));
    let wants = format!("{{\"y\":[0],\"want\":[{}\"q\"]}}", "\"q\",".repeat(500_000));
    let text = [long, deep, open, digits, keys, wants, "{\"y\":[0.1]}".to_owned()].join("\n");
    let answer = run(&["ask", "kinematics", "--robot", "lambda"], text.as_bytes());
    assert_eq!(answer.code, Some(1));
    assert_eq!(
        answer.statuses(),
        ["wrong_size", "bad_request", "bad_request", "ok", "bad_request", "bad_request", "ok"]
    );
    assert_eq!(answer.json()[0]["error"], "y has 3000001 numbers, expected 1");
    assert!(answer.out.len() < 5000, "no answer repeats a long line");
}

#[test]
fn more_plans_than_are_kept_are_answered_all_the_same() {
    let lines: Vec<String> = (0..256).chain(0..256).map(subset).collect();
    let answer = ask("kinematics", "lambda", &lines.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(answer.code, Some(0));
    let (first, second) = answer.out.split_at(answer.out.len() / 2);
    assert_eq!(first, second);
}

#[test]
fn flags_that_make_no_sense_end_with_2_and_say_why() {
    let cases: [&[&str]; 12] = [
        &[],
        &["asks"],
        &["ask"],
        &["ask", "dynamics", "--robot", "lambda"],
        &["ask", "kinematics"],
        &["ask", "kinematics", "--robot", "lambda", "--connect", "x"],
        &["ask", "kinematics", "--connect", "x", "--gravity", "0,0,0"],
        &["ask", "kinematics", "--robot", "lambda", "--submechanisms", "x.yml"],
        &["ask", "kinematics", "--robot", "lambda", "--gravity", "0,0"],
        &["ask", "kinematics", "--robot", "lamda"],
        &["ask", "kinematics", "--urdf", "/no/such/file"],
        &["check", "--robot", "lambda", "--format", "xml"],
    ];
    for arguments in cases {
        let Run { code, out, err } = run(arguments, b"{\"y\":[0]}");
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(!err.is_empty(), "{arguments:?}");
    }
    assert!(
        run(&["ask", "kinematics", "--robot", "lamda"], b"").err.contains("did you mean `lambda`?")
    );
}
