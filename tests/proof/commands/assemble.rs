//! `check --assemble`, and the fields of `ask` that have names.

use sarrus_models::bundled_text;
use sarrus_tests::reference::ROBOTS;
use serde_json::{Value, json};

use super::{Folder, Run, ask, run};

fn assemble(arguments: &[&str]) -> (Option<i32>, Value) {
    let run = run(&[&["check", "--assemble", "--format", "json"], arguments].concat(), b"");
    assert_eq!(run.out.lines().count(), 1, "{run:?}");
    (run.code, run.json().remove(0))
}

/// The lambda elbow with a cut that is placed by hand, with a small error.
fn open_files(folder: &Folder) -> (String, String) {
    let (urdf, yaml) = bundled_text("lambda").unwrap();
    let placed = "    predecessor_placement: {xyz: [0, 0.26, 0.01], rpy: [0, 0, 0]}\n    \
        successor_placement: {xyz: [0, 0, 0], rpy: [0, 0, 0]}\n";
    let yaml = yaml.replace("    constraint_axes:", &format!("{placed}    constraint_axes:"));
    (folder.file("open.urdf", urdf), folder.file("open.yml", yaml))
}

#[test]
fn every_bundled_robot_is_closed_where_it_is() {
    for name in ROBOTS {
        let (code, report) = assemble(&["--robot", name]);
        let assembled = &report["assembled"];
        assert!(
            code == Some(0) && assembled["distance"].as_f64().unwrap() < 1e-15,
            "{name} {assembled}"
        );
        let names: Vec<&str> =
            report["tree_q"].as_array().unwrap().iter().map(|x| x.as_str().unwrap()).collect();
        let found = assembled["q"].as_object().unwrap();
        assert!(
            names.iter().all(|name| found[*name].is_number()) && names.len() == found.len(),
            "{name}"
        );
        assert!(assembled["residual"].as_f64().unwrap() < 1e-12);
        // the key is absent without the flag
        assert!(
            run(&["check", "--format", "json", "--robot", name], b"").json()[0]
                .get("assembled")
                .is_none()
        );
    }
}

#[test]
fn a_pose_near_a_given_one_is_closed_and_may_be_given_back() {
    let folder = Folder::new("near");
    let (code, report) = assemble(&["--robot", "lambda", "--near", "q=0.3,0.1,0"]);
    let of = &report["assembled"];
    assert_eq!((code, &report["errors"]), (Some(0), &json!([])));
    assert!(
        of["residual_before"].as_f64().unwrap() > 0.1 && of["residual"].as_f64().unwrap() < 1e-12
    );
    assert!(of["distance"].as_f64().unwrap() > 0.01 && of["iterations"].as_u64().unwrap() > 0);
    // by name, as a list, as a file, as the report itself
    let list = folder.file("list.json", "[0.3, 0.1, 0]");
    let named = folder.file("named.json", r#"{"ElbowB11": 0.1, "Elbow": 0.3}"#);
    for near in ["Elbow=0.3,ElbowB11=0.1", "0.3,0.1,0", &list, &named] {
        assert_eq!(assemble(&["--robot", "lambda", "--near", near]).1["assembled"], *of, "{near}");
    }
    let (_, again) =
        assemble(&["--robot", "lambda", "--near", &folder.file("report.json", report.to_string())]);
    assert!(again["assembled"]["distance"].as_f64().unwrap() < 1e-12);
    // the pose is a state of the robot: the closed form gives the same slider position
    let q = &of["q"];
    let line = json!({"y": [q["Elbow"]], "want": ["q"]}).to_string();
    let answer = ask("kinematics", "lambda", &[&line]).json().remove(0);
    for (k, name) in ["Elbow", "ElbowB11", "ElbowAct"].iter().enumerate() {
        assert!(
            (answer["q"][k].as_f64().unwrap() - q[*name].as_f64().unwrap()).abs() < 1e-13,
            "{name}"
        );
    }
    // an infinite weight keeps a joint
    let kept =
        assemble(&["--robot", "lambda", "--near", "q=0.3,0.1,0", "--weights", "ElbowB11=inf"]).1;
    assert_eq!(kept["assembled"]["q"]["ElbowB11"], json!(0.1));
    // the text has the same numbers
    let text = run(&["check", "--robot", "lambda", "--assemble", "--near", "q=0.3,0.1,0"], b"");
    assert_eq!((text.code, text.err.as_str()), (Some(0), ""));
    for name in ["Elbow", "ElbowB11", "ElbowAct"] {
        let number = q[name].to_string();
        assert!(
            text.out.lines().any(|line| line.starts_with(name) && line.contains(&number)),
            "{}",
            text.out
        );
    }
}

#[test]
fn what_cannot_be_assembled_ends_with_1_and_the_nearest_pose() {
    let arguments =
        ["--robot", "lambda", "--near", "ElbowAct=0.05", "--weights", "Elbow=inf,ElbowAct=inf"];
    let (code, report) = assemble(&arguments);
    let of = &report["assembled"];
    assert_eq!((code, &of["q"]["ElbowAct"]), (Some(1), &json!(0.05)));
    assert!(
        of["residual"].as_f64().unwrap() > 1e-3
            && of["error"].as_str().unwrap().contains("no closed pose"),
        "{of}"
    );
    let text = run(&[&["check", "--assemble"], &arguments[..]].concat(), b"");
    assert_eq!(text.code, Some(1));
    assert!(
        text.err.starts_with("sarrus check: no closed pose")
            && text.out.contains("not assembled: "),
        "{text:?}"
    );
}

#[test]
fn wrong_poses_and_weights_are_wrong_flags() {
    let folder = Folder::new("wrong");
    let robot = ["check", "--robot", "lambda", "--assemble"];
    let code = |flags: &[&str]| -> Run { run(&[&robot, flags].concat(), b"") };
    let faults = [
        ["--near", "q=1,2"],
        ["--near", "Elbo=1"],
        ["--near", "/no/such.json"],
        ["--weights", "Elbow=-1"],
        ["--weights", "1,1,nan"],
    ];
    for flags in faults {
        let run = code(&flags);
        assert_eq!((run.code, run.out.as_str()), (Some(2), ""), "{flags:?} {run:?}");
        assert!(run.err.starts_with("sarrus check: "), "{run:?}");
    }
    for text in ["[1, 2]", "not json", "{\"Elbo\": 1}", "[1, 2, \"x\"]"] {
        assert_eq!(code(&["--near", &folder.file("bad.json", text)]).code, Some(1), "{text}");
    }
    // `--near` needs an assembly
    assert_eq!(run(&["check", "--robot", "lambda", "--near", "q=0,0,0"], b"").code, Some(2));
}

#[test]
fn files_that_are_open_at_zero_are_faulty_until_they_are_assembled() {
    let folder = Folder::new("open");
    let (urdf, yaml) = open_files(&folder);
    let files = ["--urdf", &urdf, "--submechanisms", &yaml];
    let plain = run(&[&["check"], &files[..]].concat(), b"");
    assert_eq!(plain.code, Some(1));
    assert!(plain.out.contains("open by"), "{}", plain.out);

    let (code, report) = assemble(&files);
    let of = &report["assembled"];
    assert_eq!(
        (code, &report["errors"], report["warnings"].as_array().unwrap().len()),
        (Some(0), &json!([]), 1)
    );
    assert!(
        of["residual_before"].as_f64().unwrap() > 1e-3 && of["residual"].as_f64().unwrap() < 1e-12,
        "{of}"
    );
    let text = run(&[&["check", "--assemble"], &files[..]].concat(), b"");
    assert_eq!((text.code, text.err.as_str()), (Some(0), ""));
    assert!(
        text.out.contains("<origin xyz=") && text.out.contains("successor_placement: {xyz: ["),
        "{}",
        text.out
    );

    // the printed placements close the zero pose
    let at = &of["at_zero"]["successors"]["Lambda/ElbowAct"];
    let fixed = std::fs::read_to_string(&yaml).unwrap().replace(
        "successor_placement: {xyz: [0, 0, 0], rpy: [0, 0, 0]}",
        &format!("successor_placement: {{xyz: {}, rpy: {}}}", at["xyz"], at["rpy"]),
    );
    let fixed =
        run(&["check", "--urdf", &urdf, "--submechanisms", &folder.file("fixed.yml", fixed)], b"");
    assert!(!fixed.out.contains("open by"), "{}", fixed.out);

    // and so do the printed origins
    let mut written = std::fs::read_to_string(&urdf).unwrap();
    for (joint, origin) in of["new_zero"]["origins"].as_object().unwrap() {
        let list = |key: &str| {
            origin[key]
                .as_array()
                .unwrap()
                .iter()
                .map(Value::to_string)
                .collect::<Vec<_>>()
                .join(" ")
        };
        let at = written.find(&format!("<joint name=\"{joint}\"")).unwrap();
        let from = at + written[at..].find("<origin").unwrap();
        let to = from + written[from..].find("/>").unwrap() + 2;
        written.replace_range(
            from..to,
            &format!("<origin xyz=\"{}\" rpy=\"{}\"/>", list("xyz"), list("rpy")),
        );
    }
    let closed = run(
        &["check", "--urdf", &folder.file("closed.urdf", written), "--submechanisms", &yaml],
        b"",
    );
    assert_eq!((closed.code, closed.err.as_str()), (Some(0), ""), "{}", closed.out);
}

#[test]
fn an_assembly_is_written_and_the_file_is_closed() {
    let folder = Folder::new("write");
    let (urdf, yaml) = open_files(&folder);
    let out = folder.0.join("out.urdf").to_str().unwrap().to_owned();
    let (code, report) = assemble(&[&urdf, &yaml, "--write", &out]);
    assert_eq!((code, &report["assembled"]["written"]), (Some(0), &json!([out])));
    let closed = run(&["check", &out, &yaml], b"");
    assert_eq!((closed.code, closed.err.as_str()), (Some(0), ""), "{}", closed.out);
    // `--write` needs an assembly and an existing folder
    assert_eq!(run(&["check", &urdf, &yaml, "--write", &out], b"").code, Some(2));
    let nowhere = ["--assemble", "--write", "/no/such/folder/out.urdf"];
    assert_eq!(run(&[&["check", &urdf, &yaml], &nowhere[..]].concat(), b"").code, Some(2));
}

#[test]
fn faults_of_the_text_stay_faults_with_an_assembly() {
    let folder = Folder::new("faulty");
    let (urdf, _) = open_files(&folder);
    let bad = folder.file("bad.yml", "submechanisms: 3");
    for arguments in [&["check"][..], &["check", "--assemble"]] {
        let run = run(&[arguments, &["--urdf", &urdf, "--submechanisms", &bad]].concat(), b"");
        assert_eq!((run.code, run.out.contains("bad.yml:1:")), (Some(1), true), "{run:?}");
    }
}

#[test]
fn branch_reactions_and_good_independents_have_plain_forms() {
    let line =
        r#"{"y":[0.1],"want":["branch","lambda_determinate","good_independents","uncontrolled"]}"#;
    let answer = ask("inverse-dynamics", "lambda", &[line]).json().remove(0);
    assert_eq!(answer["status"], "ok");
    assert!(answer["branch"] == json!([1]) || answer["branch"] == json!([-1]), "{answer}");
    assert_eq!(answer["lambda_determinate"], json!([true, true]));
    let good = answer["good_independents"].as_array().unwrap();
    assert!(good.len() == 1 && good[0].as_str().unwrap().starts_with("Elbow"), "{answer}");
    assert_eq!(answer["uncontrolled"].as_array().unwrap().len(), 1);
    // one sign for each mechanism with two assemblies
    let full = ask(
        "kinematics",
        "rh5v2_upper_body",
        &[&json!({"y": vec![0.0; 13], "want": ["branch"]}).to_string()],
    )
    .json()
    .remove(0);
    assert_eq!(full["branch"].as_array().unwrap().len(), 3, "{full}");
}
