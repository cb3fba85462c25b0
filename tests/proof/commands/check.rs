//! `check`, `robots`, and completions and pages for shells and `man`.

use sarrus_tests::reference::{ROBOTS, vectors};
use serde_json::{Value, json};

use super::{FLOATING, Folder, run};

fn report(arguments: &[&str]) -> (Option<i32>, Value) {
    let run = run(&[&["check", "--format", "json"], arguments].concat(), b"");
    assert_eq!((run.err.as_str(), run.out.lines().count()), ("", 1), "{run:?}");
    (run.code, run.json().remove(0))
}

#[test]
fn a_valid_robot_is_one_object_with_every_order() {
    for name in ROBOTS {
        let (code, report) = report(&["--robot", name]);
        let keys: Vec<&str> = report.as_object().unwrap().keys().map(String::as_str).collect();
        let expected = [
            "robot",
            "fingerprint",
            "tree",
            "tree_q",
            "independent",
            "active",
            "loops",
            "closures",
            "bound",
            "actuators",
            "dimensions",
            "warnings",
            "errors",
        ];
        assert_eq!((code, keys), (Some(0), expected.to_vec()));
        let bound = &report["bound"];
        let ns = bound["ns"].as_f64().unwrap();
        assert!(bound["steps"].is_u64() && ns > 0.0 && ns <= 500_000.0, "{name}: {bound}");
        let file = vectors(name);
        assert_eq!(
            [&report["tree"], &report["independent"], &report["active"]],
            [&file["tree"], &file["ind"], &file["act"]]
        );
        assert_eq!(report["fingerprint"].as_str().unwrap().len(), 16);
        assert_eq!((&report["errors"], &report["robot"]), (&json!([]), &json!(name)));
        for closure in report["closures"].as_array().unwrap() {
            let keys: Vec<&str> = closure.as_object().unwrap().keys().map(String::as_str).collect();
            assert_eq!(keys[..6], ["name", "type", "kind", "rows", "rank", "misfit"]);
            assert_eq!(
                keys[6..],
                [
                    "redundant",
                    "idle",
                    "branch",
                    "sigma_min",
                    "cond_Kd",
                    "singular",
                    "seed_cells",
                    "seed_bytes",
                    "parts"
                ]
            );
        }
    }
}

#[test]
fn a_quaternion_joint_has_one_name_more_among_the_positions() {
    let folder = Folder::new("quaternion");
    let (code, report) = report(&["--urdf", &folder.file("a.urdf", FLOATING)]);
    assert_eq!(code, Some(0));
    assert_eq!(
        report["tree"],
        json!(["float/rx", "float/ry", "float/rz", "float/tx", "float/ty", "float/tz", "turn"])
    );
    assert_eq!(report["tree_q"].as_array().unwrap().len(), 8);
}

#[test]
fn every_fault_of_the_files_is_told_at_once_and_ends_with_1() {
    let folder = Folder::new("faults");
    let urdf = folder.file(
        "bad.urdf",
        FLOATING
            .replacen("mass value=\"1\"", "mass value=\"-1\"", 1)
            .replace("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 x 0\"/>"),
    );
    let (code, report) = report(&["--urdf", &urdf]);
    assert_eq!((code, report["errors"].as_array().unwrap().len()), (Some(1), 2), "{report}");
    let errors = report["errors"].as_array().unwrap();
    for error in errors {
        let keys: Vec<&str> = error.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, ["file", "line", "column", "found", "expected", "help"]);
    }
    // text: one line for each message, with its place first, on stdout
    let text = run(&["check", "--urdf", &urdf], b"");
    assert_eq!((text.code, text.err.as_str(), text.out.lines().count()), (Some(1), "", 2));
    for (line, error) in text.out.lines().zip(errors) {
        assert!(
            line.starts_with(&format!("{urdf}:{}:{}: ", error["line"], error["column"])),
            "{line}"
        );
    }
    // other commands print the same report on stderr
    for command in [&["ask", "kinematics", "--urdf", &urdf][..], &["serve", "--urdf", &urdf]] {
        let refused = run(command, b"{\"y\":[0]}");
        assert_eq!(
            (refused.code, refused.out.as_str(), refused.err.as_str()),
            (Some(1), "", text.out.as_str()),
            "{command:?}"
        );
    }
}

#[test]
fn content_that_is_no_text_is_a_fault_and_a_missing_file_is_not() {
    let folder = Folder::new("content");
    for (name, bytes) in [
        ("a.urdf", &b"\xff\xfe"[..]),
        ("b.urdf", b""),
        ("c.urdf", b"not xml"),
        ("d.urdf", b"<robot>"),
    ] {
        let (code, report) = report(&["--urdf", &folder.file(name, bytes)]);
        assert_eq!(
            (code, report["errors"].as_array().unwrap().is_empty()),
            (Some(1), false),
            "{name}"
        );
        assert_eq!(report["fingerprint"], Value::Null);
    }
    let good = folder.file("good.urdf", FLOATING);
    let (code, _) = report(&["--urdf", &good, "--submechanisms", &folder.file("bad.yml", "a: [")]);
    assert_eq!(code, Some(1));
    for arguments in [
        &["--urdf", "/no/such.urdf"][..],
        &["--urdf", &good, "--submechanisms", "/no/such.yml"],
        &["--robot", "none"],
    ] {
        let run = run(&[&["check", "--format", "json"], arguments].concat(), b"");
        assert_eq!((run.code, run.out.as_str()), (Some(2), ""));
        assert!(run.err.starts_with("sarrus check: "), "{}", run.err);
    }
}

#[test]
fn warnings_leave_a_robot_valid() {
    let folder = Folder::new("warnings");
    // no body has such principal moments
    let urdf = folder.file("a.urdf", FLOATING.replacen("ixx=\"1\"", "ixx=\"5\"", 1));
    assert_eq!(report(&["--urdf", &urdf]).0, Some(1));
    let (code, lenient) = report(&["--urdf", &urdf, "--lenient"]);
    assert_eq!(
        (code, lenient["warnings"].as_array().unwrap().is_empty()),
        (Some(0), false),
        "{lenient}"
    );
    let text = run(&["check", "--urdf", &urdf, "--lenient"], b"");
    assert_eq!(text.code, Some(0));
    assert!(
        text.out.contains("valid, ")
            && text.out.contains(&format!("{urdf}:3:"))
            && text.out.contains(": warning: "),
        "{}",
        text.out
    );
}

#[test]
fn a_corpus_is_a_line_for_each_robot_and_its_counts() {
    let folder = Folder::new("corpus");
    let path = folder.0.to_str().unwrap().to_owned();
    for extension in ["urdf", "yml"] {
        let lambda = format!("../models/robots/lambda/lambda.{extension}");
        folder.file(&format!("lambda.{extension}"), std::fs::read(lambda).unwrap());
    }
    folder.file("manifest.xml", "<package><name>robots</name></package>");
    folder.file("part.xml", "<mujocoinclude/>");
    std::fs::create_dir(folder.0.join("b")).unwrap();
    folder.file("b/heavy.urdf", FLOATING.replacen("ixx=\"1\"", "ixx=\"5\"", 1));
    folder.file("b/scene.xml", "<mujoco><worldbody><body/></worldbody></mujoco>");
    let half = folder.file("half.urdf", &FLOATING[..FLOATING.len() / 2]);
    // a link to the folder itself is not followed
    std::os::unix::fs::symlink(&folder.0, folder.0.join("again")).unwrap();
    let found = run(&["check", "--corpus", &path], b"");
    assert_eq!((found.code, found.err.as_str()), (Some(1), ""), "{found:?}");
    let lines: Vec<&str> = found.out.lines().collect();
    assert!(
        lines[0].starts_with("lenient  b/heavy.urdf  ") && lines[0].contains(":3:"),
        "{lines:?}"
    );
    assert!(lines[1].starts_with("refused  b/scene.xml  "), "{lines:?}");
    assert!(lines[2].starts_with(&format!("refused  half.urdf  {half}:")), "{lines:?}");
    assert_eq!(lines[3], "ok       lambda.urdf");
    assert_eq!(lines[4..], ["4 robots: 1 ok, 1 with --lenient, 2 refused"]);
    // the submechanism file of the same name was read
    folder.file("lambda.yml", "submechanisms: [");
    let found = run(&["check", "--corpus", &path], b"");
    assert!(found.out.contains("refused  lambda.urdf") && found.out.ends_with("3 refused\n"));
    let missing = run(&["check", "--corpus", "/no/such"], b"");
    assert_eq!((missing.code, missing.out.as_str()), (Some(2), ""));
}

#[test]
fn a_valid_robot_in_words_names_closures_and_sizes() {
    let text = run(&["check", "--robot", "rh5v2_upper_body"], b"");
    assert_eq!((text.code, text.err.as_str()), (Some(0), ""));
    for words in [
        "tree           23  BodyPitch",
        "independent    13",
        "loop rows      10",
        "ALElbow       RRPR     analytic",
        "valid, no warnings",
    ] {
        assert!(text.out.contains(words), "{words}\n{}", text.out);
    }
}

#[test]
fn files_are_taken_with_and_without_flags() {
    let folder = Folder::new("positional");
    let (urdf, yaml) = sarrus_models::bundled_text("lambda").unwrap();
    let urdf = folder.file("a.urdf", urdf);
    let yaml = folder.file("a.yml", yaml);
    let flags = report(&["--urdf", &urdf, "--submechanisms", &yaml]);
    assert_eq!(flags.0, Some(0));
    assert_eq!(report(&[&urdf, &yaml]), flags);
    assert_eq!(report(&[&urdf, "--submechanisms", &yaml]), flags);
    assert_eq!(report(&[&urdf]), report(&["--urdf", &urdf]));
    // wherever a robot is chosen
    let [without, with] = [vec![&*urdf, &yaml], vec!["--urdf", &urdf, "--submechanisms", &yaml]];
    let line = r#"{"y": [0.2], "yd": [1], "want": ["q", "tau_y"]}"#;
    let query = r#"{"request": "kinematics", "y": [0.2], "want": ["q"]}"#;
    let [positional, flagged] = ["positional", "flagged"].map(|name| folder.0.join(name));
    for arguments in [
        &["ask", "inverse-dynamics"][..],
        &["simulate", "--duration", "0.01", "--format", "json"],
        &["generate", "--query", query],
    ] {
        let of = |files: &[&str], out: &std::path::Path| {
            let out = ["--out", out.to_str().unwrap()];
            let out = if arguments[0] == "ask" { &[][..] } else { &out };
            let run = run(&[arguments, files, out].concat(), line.as_bytes());
            assert_eq!(run.code, Some(0), "{arguments:?}: {run:?}");
        };
        of(&without, &positional);
        of(&with, &flagged);
        let ask = |files: &[&str]| run(&[arguments, files].concat(), line.as_bytes()).out;
        if arguments[0] == "ask" {
            assert_eq!(ask(&without), ask(&with));
        }
    }
    for wrong in [
        &[][..],
        &[&urdf, "--robot", "lambda"],
        &[&urdf, "--urdf", &urdf],
        &[&urdf, &yaml, "--submechanisms", &yaml],
        &[&urdf, &yaml, &yaml],
        &["--submechanisms", &yaml],
        &["--robot", "lambda", "--submechanisms", &yaml],
    ] {
        assert_eq!(run(&[&["check"], wrong].concat(), b"").code, Some(2), "{wrong:?}");
    }
}

#[test]
fn robots_lists_the_bundled_ones() {
    let text = run(&["robots"], b"");
    assert_eq!((text.code, text.err.as_str()), (Some(0), ""));
    let list = run(&["robots", "--format", "json"], b"").json().remove(0);
    for (robot, line) in list.as_array().unwrap().iter().zip(text.out.lines().skip(1)) {
        assert!(
            line.starts_with(robot["robot"].as_str().unwrap())
                && line.ends_with(robot["about"].as_str().unwrap())
        );
    }
    let names: Vec<&str> =
        list.as_array().unwrap().iter().map(|robot| robot["robot"].as_str().unwrap()).collect();
    let mut expected: Vec<&str> = sarrus_models::bundled().map(|(name, _)| name).collect();
    expected.sort_unstable();
    assert_eq!(
        {
            let mut names = names.clone();
            names.sort_unstable();
            names
        },
        expected
    );
    let upper =
        list.as_array().unwrap().iter().find(|robot| robot["robot"] == "rh5v2_upper_body").unwrap();
    assert_eq!(
        upper["sizes"],
        json!({
            "n_q": 23, "n_v": 23, "n_qy": 13, "n_vy": 13, "n_u": 13, "n_c": 10, "n_branches": 3,
            "n_bodies": 23, "n_cuts": 4
        })
    );
}

#[test]
fn help_and_version_are_results() {
    for arguments in [
        &["--help"][..],
        &["--version"],
        &["check", "--help"],
        &["ask", "--help"],
        &["serve", "--help"],
        &["demo", "--help"],
        &["ask", "--fields"],
    ] {
        let run = run(arguments, b"");
        assert_eq!(
            (run.code, run.err.as_str(), run.out.is_empty()),
            (Some(0), "", false),
            "{arguments:?}"
        );
    }
    assert_eq!(run(&["--version"], b"").out, format!("sarrus {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_floating_base_is_six_coordinates_more_wherever_a_robot_is_chosen() {
    // the bundled robot has a root with mass
    let (code, fixed) = report(&["--robot", "stewart"]);
    assert_eq!(code, Some(0));
    let (code, floating) = report(&["--robot", "stewart", "--floating-base"]);
    assert_eq!(code, Some(0), "{floating}");
    let names = |report: &Value, key: &str| report[key].as_array().unwrap().clone();
    let first = ["rx", "ry", "rz", "tx", "ty", "tz"].map(|x| json!(format!("floating_base/{x}")));
    assert_eq!(names(&floating, "independent")[..6], first);
    assert_eq!(names(&floating, "independent")[6..], names(&fixed, "independent"));
    assert_eq!(floating["active"], fixed["active"]);
    assert_eq!(report(&["--robot", "stewart", "--floating-base", "none"]).0, Some(1));
    let y = [&[0.0; 6][..], &[1.0], &[0.0; 6]].concat();
    let line = json!({"y": y, "want": ["q"]}).to_string();
    let asked =
        run(&["ask", "kinematics", "--robot", "stewart", "--floating-base"], line.as_bytes());
    assert_eq!((asked.code, asked.statuses()), (Some(0), vec!["ok".to_owned()]), "{asked:?}");
    // a running server's robot cannot be changed
    let connected = ["ask", "map", "--connect", "none", "--floating-base"];
    assert_eq!(run(&connected, b"").code, Some(2));
}

#[test]
fn what_a_scene_holds_still_or_leaves_out_is_no_part_of_the_robot_wherever_one_is_chosen() {
    let (code, whole) = report(&["--robot", "rh5v2_full"]);
    assert_eq!(code, Some(0));
    let arms = ["--robot", "rh5v2_full", "--lock", "Body*", "--lock", "HeadPitch=-0.2"];
    let (code, held) = report(&arms);
    assert_eq!(code, Some(0), "{held}");
    let names = |report: &Value, key: &str| -> Vec<String> {
        let list = report[key].as_array().unwrap();
        list.iter().map(|name| name.as_str().unwrap().to_owned()).collect()
    };
    let is_held = |name: &String| name.starts_with("Body") || name == "HeadPitch";
    for key in ["tree", "independent", "active"] {
        let rest: Vec<String> = names(&whole, key).into_iter().filter(|x| !is_held(x)).collect();
        assert_eq!(names(&held, key), rest, "{key}");
    }
    assert_ne!(held["fingerprint"], whole["fingerprint"]);
    assert!(held["closures"].as_array().unwrap().iter().all(|of| of["name"] != "Torso"));
    let (code, hand) = report(&["--robot", "rh5v2_full", "--only", "ALWrist*"]);
    assert_eq!(code, Some(0), "{hand}");
    let is_other = |name: &String| name.starts_with("AR") || name.starts_with("Head");
    assert!(!names(&hand, "tree").iter().any(is_other));
    assert!(names(&hand, "tree").iter().any(|name| name == "BodyActL"));

    // `ask` computes with the same robot
    let line = json!({"y": vec![0.0; names(&held, "independent").len()], "want": ["tau_u"]});
    let asked =
        run(&[&["ask", "inverse-dynamics"][..], &arms].concat(), line.to_string().as_bytes());
    assert_eq!((asked.code, asked.statuses()), (Some(0), vec!["ok".to_owned()]), "{asked:?}");
    let connected = ["ask", "map", "--connect", "none", "--lock", "a"];
    assert_eq!(run(&connected, b"").code, Some(2));
    for command in ["--assemble", "--suggest"] {
        assert_eq!(run(&[&["check", command][..], &arms].concat(), b"").code, Some(2));
    }
}

#[test]
fn locks_that_mean_nothing_are_faults_that_name_what_would() {
    let said = |flags: &[&str]| {
        let (code, report) = report(&[&["--robot", "torso"][..], flags].concat());
        (code, report["errors"].to_string() + &report["warnings"].to_string())
    };
    let (code, text) = said(&["--lock", "BodyPich"]);
    assert_eq!(code, Some(1));
    assert!(text.contains("BodyPitch"), "{text}");
    let (code, text) = said(&["--lock", "Leg*"]);
    assert_eq!(code, Some(1));
    assert!(text.contains("no independent joint fits"), "{text}");
    let (code, text) = said(&["--only", "BodyRoll_Lnk"]);
    assert_eq!(code, Some(1));
    assert!(text.contains("BodyRoll_Link"), "{text}");
    let (code, wrist) = report(&["--robot", "wrist", "--lock", "WristRoll=2"]);
    assert_eq!(code, Some(1));
    assert!(wrist["errors"][0]["found"].as_str().unwrap().contains("WristRoll at 2"), "{wrist}");
    // beyond the joint's limits
    let (code, text) = said(&["--lock", "BodyPitch=1.6"]);
    assert_eq!(code, Some(0));
    assert!(text.contains("the joint BodyPitch held at 1.6"), "{text}");
    // redundant actuators are a warning and no error
    let (code, text) = said(&["--lock", "BodyRoll"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("least norm"), "{text}");
    for flags in [&["--lock", "BodyRoll=x"][..], &["--lock", "=1"], &["--lock"], &["--only"]] {
        assert_eq!(said_code(flags), Some(2), "{flags:?}");
    }
}

/// Exit code of `check` with these flags on the torso.
fn said_code(flags: &[&str]) -> Option<i32> {
    run(&[&["check", "--robot", "torso"][..], flags].concat(), b"").code
}

#[test]
fn an_exported_robot_is_the_bundled_one_and_no_file_is_written_over() {
    let folder = Folder::new("robots-export");
    let into = folder.file("kept", "").replace("kept", "mine");
    let export = |name: &str| run(&["robots", "--export", name, &into], b"");
    let done = export("torso");
    let files: Vec<&str> = done.out.lines().collect();
    assert_eq!(
        (done.code, &files[..]),
        (Some(0), &[&*format!("{into}/torso.urdf"), &*format!("{into}/torso.yml")][..])
    );
    let fingerprint = |arguments: &[&str]| {
        run(&[&["check", "--format", "json"], arguments].concat(), b"").json().remove(0)
            ["fingerprint"]
            .clone()
    };
    assert_eq!(fingerprint(&files), fingerprint(&["--robot", "torso"]));

    // the second file exists, so the first one must not remain
    std::fs::remove_file(files[0]).unwrap();
    std::fs::write(files[1], "somebody's").unwrap();
    let refused = export("torso");
    assert!(refused.code == Some(2) && refused.err.contains("torso.yml cannot be written"));
    assert!(!std::path::Path::new(files[0]).exists());
    assert_eq!(std::fs::read_to_string(files[1]).unwrap(), "somebody's");
    assert_eq!(export("tors").code, Some(2));
}

#[test]
fn shells_and_man_know_every_command() {
    let help = run(&["--help"], b"").out;
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let commands: Vec<&str> = commands
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(commands.contains(&"serve") && commands.contains(&"check"), "{commands:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = run(&["completions", shell], b"");
        assert_eq!((script.code, script.err.as_str()), (Some(0), ""), "{shell}");
        for command in &commands {
            assert!(script.out.contains(command), "{shell}: {command}");
        }
        assert!(script.out.contains("floating-base"), "{shell}");
    }
    let folder = Folder::new("man");
    let pages = folder.file("kept", "").replace("kept", "man1");
    assert_eq!(run(&["man", &pages], b"").code, Some(0));
    for command in &commands {
        let page = std::fs::read_to_string(format!("{pages}/sarrus-{command}.1")).unwrap();
        assert!(page.starts_with(".ie") && page.contains(".SH OPTIONS"), "{command}: {page}");
    }
    assert!(std::fs::read_to_string(format!("{pages}/sarrus.1")).unwrap().contains("SUBCOMMANDS"));
    assert_eq!(run(&["man", &folder.file("plain", "")], b"").code, Some(2));
}

#[test]
fn show_writes_a_page_and_the_gallery_one_of_each_robot() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("pages");
    let _ = std::fs::remove_dir_all(&folder);
    let place = folder.to_str().unwrap();
    let gallery = run(&["robots", "--gallery", place], b"");
    assert_eq!((gallery.code, gallery.err.as_str()), (Some(0), ""));
    let index = std::fs::read_to_string(folder.join("index.html")).unwrap();
    let names: Vec<&str> = sarrus_models::bundled().map(|(name, _)| name).collect();
    for name in &names {
        assert!(index.contains(&format!("href=\"{name}.html\"")), "{name}");
        assert!(folder.join(format!("{name}.html")).is_file(), "{name}");
    }
    for mechanism in ["lambda_lengths", "ankle_lengths"] {
        assert!(index.contains(&format!("href=\"{mechanism}.html\"")), "{mechanism}");
    }
    assert_eq!(gallery.out.lines().count(), names.len() + 3);
    // never over an existing file
    assert_eq!(run(&["robots", "--gallery", place], b"").code, Some(2));
    let page = folder.join("own.html");
    let path = page.to_str().unwrap();
    let shown = run(&["show", "--robot", "lambda", "--swing", "--out", path], b"");
    assert_eq!((shown.code, shown.out.as_str()), (Some(0), format!("{path}\n").as_str()));
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("\"swing\":true") && text.contains("--robot lambda"));
    assert_eq!(run(&["show", "--robot", "lambda", "--out", place], b"").code, Some(2));
    assert_eq!(run(&["show", "--robot", "lambd"], b"").code, Some(2));
}
