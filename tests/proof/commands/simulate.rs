//! `sarrus simulate` as scripts use it.

use std::process::Command;

use sarrus_report::csv_rows;
use serde_json::Value;

use super::{Folder, Run, sarrus};

fn folder(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("sarrus-simulate-{name}-{}", std::process::id()))
}

fn simulate(name: &str, arguments: &[&str]) -> Run {
    Run::of(
        Command::new(sarrus()).arg("simulate").args(arguments).arg("--out").arg(folder(name)),
        b"",
    )
}

#[test]
fn the_squeezer_arrives_from_the_command_line() {
    let spring = ["--spring", "ground:0.014,0.072,0", "K3:0.02,-0.018,0", "4530,0,0.07785"];
    let rest = [
        "--robot",
        "squeezer",
        "--method",
        "radau5",
        "--duration",
        "0.03",
        "--rtol",
        "1e-11",
        "--atol",
        "1e-11",
        "--tau-u",
        "0.033",
    ];
    let run = simulate(
        "squeezer",
        &[&rest[..], &spring, &["--every", "0.01", "--format", "json"]].concat(),
    );
    assert_eq!(run.code, Some(0), "{}", run.err);
    let answer: Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(
        (answer["status"].as_str(), answer["method"].as_str()),
        (Some("finished"), Some("radau5"))
    );
    assert!((answer["yd"]["beta"].as_f64().unwrap() - 1139.920302151208).abs() < 1e-5, "{answer}");
    assert!(
        answer["drift"].as_f64().unwrap() < 1e-8 && answer["residual"].as_f64().unwrap() < 1e-12,
        "{answer}"
    );
    // four rows under a header, and a page without other files
    let table = std::fs::read_to_string(folder("squeezer").join("motion.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("time,y.beta,yd.beta,q.beta,")
            && lines[0].ends_with(",kinetic,potential,work,residual"),
        "{}",
        lines[0]
    );
    assert_eq!(lines.len(), 5);
    assert!(lines[4].starts_with("0.03,15.87248508"), "{}", lines[4]);
    // the page has the samples, the command, and no curves of forces beside a spring
    let page = std::fs::read_to_string(folder("squeezer").join("motion.html")).unwrap();
    assert!(page.contains("\"samples\":4,") && page.contains("sarrus simulate --robot squeezer"));
    assert!(page.contains("are not drawn beside springs") && !page.contains("Loop forces"));
    std::fs::remove_dir_all(folder("squeezer")).unwrap();
}

#[test]
fn the_page_of_a_motion_has_forces_and_limits_and_stands_in_a_folder_of_its_own() {
    let home = Folder::new("simulate-page");
    let mut command = Command::new(sarrus());
    command.args(["simulate", "--robot", "lambda", "--duration", "0.1", "--show"]);
    let run = Run::of(command.current_dir(&home.0), b"");
    assert_eq!((run.code, run.out.as_str()), (Some(0), "lambda-simulation/motion.html\n"));
    let page = std::fs::read_to_string(home.0.join(run.out.trim())).unwrap();
    let robot = page.split_once("const robot = ").unwrap().1.split_once(";</script>").unwrap().0;
    let robot: Value = serde_json::from_str(robot).unwrap();
    let charts = robot["run"]["charts"].as_array().unwrap();
    let titles: Vec<&str> = charts.iter().map(|chart| chart["title"].as_str().unwrap()).collect();
    for part in ["y, rad", "ẏ, rad/s", "u, m", "τ_u", "λ", "Energy, J", "should be zero"] {
        assert!(titles.iter().any(|title| title.contains(part)), "{titles:?}");
    }
    assert_eq!(charts[0]["curves"][0]["name"], "Elbow");
    assert_eq!(charts[0]["curves"][0]["upper"], 1.5);
    assert_eq!(robot["run"]["checks"].as_array().unwrap().len(), 2);
    assert!(page.len() < 3_000_000);
}

/// Numbers of single precision from base64, as a page has them.
fn floats(text: &str) -> Vec<f32> {
    let alphabet = ('A'..='Z').chain('a'..='z').chain('0'..='9').chain(['+', '/']);
    let alphabet: Vec<char> = alphabet.collect();
    let letters = text.chars().filter_map(|c| alphabet.iter().position(|of| *of == c));
    let bits: Vec<bool> =
        letters.flat_map(|x| (0..6).rev().map(move |k| x >> k & 1 == 1)).collect();
    let byte = |bits: &[bool]| bits.iter().fold(0, |byte: u8, bit| byte << 1 | u8::from(*bit));
    let bytes: Vec<u8> = bits.chunks_exact(8).map(byte).collect();
    bytes.chunks_exact(4).map(|x| f32::from_le_bytes([x[0], x[1], x[2], x[3]])).collect()
}

#[test]
fn the_page_of_a_path_in_time_has_the_curves_of_its_table_with_limits() {
    let home = Folder::new("time-page");
    std::fs::write(home.0.join("path.csv"), "Elbow\n0\n0.3\n-0.2\n").unwrap();
    let of = |flags: &[&str]| {
        let mut command = Command::new(sarrus());
        command.args(["time", "path.csv", "--robot", "lambda", "--show", "path.html"]).args(flags);
        let run = Run::of(command.current_dir(&home.0), b"");
        assert_eq!(run.code, Some(0), "{}", run.err);
        run.out
    };
    // a result does not replace an input
    for out in [&["--out", "path.csv"][..], &["--out=path.csv"]] {
        let mut command = Command::new(sarrus());
        command.args(["time", "path.csv", "--robot", "lambda"]).args(out).current_dir(&home.0);
        let run = Run::of(&mut command, b"");
        assert!(run.code == Some(2) && run.err.contains("path.csv is read"), "{}", run.err);
    }
    // on stdout the table stands alone
    let table = of(&[]);
    let said = of(&["--out", "motion.csv"]);
    assert_eq!(std::fs::read_to_string(home.0.join("motion.csv")).unwrap(), table);
    assert!(said.contains("motion.csv: ") && said.contains("path.html: "), "{said}");
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let page = std::fs::read_to_string(home.0.join("path.html")).unwrap();
    let robot = page.split_once("const robot = ").unwrap().1.split_once(";</script>").unwrap().0;
    let robot: Value = serde_json::from_str(robot).unwrap();
    let run = &robot["run"];
    assert_eq!(run["samples"], rows.len());
    assert!(run["command"].as_str().unwrap().starts_with("sarrus time path.csv"), "{run}");
    assert_eq!(run["sigma_min"].as_array().unwrap().len(), rows.len());
    // y, ẏ and τ_u are the columns 1, 2 and 4; u is not in the table
    let charts = run["charts"].as_array().unwrap();
    for (chart, (title, column, limits)) in charts.iter().zip([
        ("y, rad", Some(1), [-1.5, 1.5]),
        ("ẏ, rad/s", Some(2), [-10.0, 10.0]),
        ("u, m", None, [-0.1, 0.1]),
        ("τ_u of this motion, N", Some(4), [-1000.0, 1000.0]),
    ]) {
        let curve = &chart["curves"][0];
        assert_eq!(chart["title"], title);
        assert_eq!([&curve["lower"], &curve["upper"]].map(|x| x.as_f64().unwrap()), limits);
        let found = floats(curve["values"].as_str().unwrap());
        assert_eq!(found.len(), rows.len(), "{title}");
        if let Some(column) = column {
            let expected: Vec<f32> = rows.iter().map(|row| row[column] as f32).collect();
            assert_eq!(found, expected, "{title}");
        }
    }
    assert_eq!(charts.len(), 4);
    // poses of both ends, with which the page compares its own
    assert_eq!(run["checks"].as_array().unwrap().len(), 2);
}

#[test]
fn joints_that_are_held_are_no_columns_of_the_motion() {
    let run = simulate(
        "held",
        &[
            "--robot",
            "torso",
            "--lock",
            "BodyRoll=0.1",
            "--method",
            "dop853",
            "--duration",
            "0.02",
            "--every",
            "0.01",
        ],
    );
    assert_eq!(run.code, Some(0), "{}", run.err);
    let table = std::fs::read_to_string(folder("held").join("motion.csv")).unwrap();
    assert!(table.starts_with("time,y.BodyPitch,yd.BodyPitch,q.BodyPitch,"), "{table}");
    assert!(!table.contains("BodyRoll") && table.lines().count() == 4, "{table}");
    std::fs::remove_dir_all(folder("held")).unwrap();

    // no joint is free to move
    for method in ["euler", "radau5"] {
        let rigid = ["--robot", "lambda", "--lock", "Elbow", "--duration", "1", "--method", method];
        let run = simulate("rigid", &rigid);
        assert_eq!(run.code, Some(2), "{}", run.err);
        assert!(run.err.contains("the robot has no degree of freedom"), "{}", run.err);
    }
}

#[test]
fn a_name_with_a_comma_is_one_column_of_the_motion_and_of_the_forces() {
    let home = Folder::new("simulate-quoted");
    let (urdf, yaml) = sarrus_models::bundled_text("five_bar").unwrap();
    let urdf = urdf.replace("\"left_motor\"", "\"left, &quot;motor&quot;\"");
    let yaml = yaml.replace("left_motor", "'left, \"motor\"'");
    let forces = [("time", "right_motor", "left, \"motor\""), ("0", "0", "1"), ("0.1", "0", "2")]
        .map(|(a, b, c)| vec![a.to_owned(), b.to_owned(), c.to_owned()]);
    let run = simulate(
        "quoted",
        &[
            "--urdf",
            &home.file("five.urdf", urdf),
            "--submechanisms",
            &home.file("five.yml", yaml),
            "--input",
            &home.file("forces.csv", csv_rows::write(&forces).unwrap()),
            "--duration",
            "0.1",
            "--method",
            "rk4",
            "--step",
            "1e-3",
            "--format",
            "json",
        ],
    );
    assert_eq!(run.code, Some(0), "{}", run.err);
    let answer: Value = serde_json::from_str(&run.out).unwrap();
    let text = std::fs::read_to_string(folder("quoted").join("motion.csv")).unwrap();
    let rows = csv_rows::read(&text).unwrap();
    let name = "y.left, \"motor\"";
    let column = rows[0].cells.iter().position(|cell| cell == name).unwrap();
    assert!(rows.iter().all(|row| row.cells.len() == rows[0].cells.len()));
    // the last row equals the answer bit by bit
    let last: f64 = rows.last().unwrap().cells[column].parse().unwrap();
    let same = answer["y"]["left, \"motor\""].as_f64().unwrap();
    assert!(last.to_bits() == same.to_bits() && last != 0.0, "{last:e} and {same:e}");
    std::fs::remove_dir_all(folder("quoted")).unwrap();
}

#[test]
fn forces_come_from_a_file() {
    std::fs::create_dir_all(folder("file")).unwrap();
    let path = folder("file").join("forces.csv");
    let given = path.to_str().unwrap();
    let ask = |text: &str| {
        std::fs::write(&path, text).unwrap();
        simulate(
            "file",
            &[
                "--robot",
                "five_bar",
                "--duration",
                "0.1",
                "--method",
                "rk4",
                "--step",
                "1e-3",
                "--format",
                "json",
                "--input",
                given,
            ],
        )
    };
    // columns may have any order, and a joint without one has no force
    let [a, b] =
        ["time,right_motor,left_motor\n0,0,1\n0.1,0,2\n", "time,left_motor\n0,1\n\n0.1,2\n"]
            .map(ask);
    assert_eq!((a.code, b.code), (Some(0), Some(0)), "{} {}", a.err, b.err);
    assert_eq!(a.out, b.out);
    for (text, words) in [
        ("", ["forces.csv:1", "time,NAME"]),
        ("t,left_motor\n0,1\n", ["forces.csv:1", "time,NAME"]),
        ("time,left\n0,1\n", ["forces.csv:1", "`left`"]),
        ("time,left_motor\n0\n", ["forces.csv:2:1", "found 1 cell(s), expected 2"]),
        ("time,left_motor\n0,1\n0.1,x\n", ["forces.csv:3:2", "`x`"]),
        ("time,left_motor\n0,nan\n", ["forces.csv:2:2", "`nan`"]),
        ("time,left_motor\n1,0\n0,1\n", ["row 2", "not after the one before"]),
        ("time,left_motor\n", ["row 1", "without a force"]),
    ] {
        let run = ask(text);
        assert_eq!(run.code, Some(2), "{text:?}: {}", run.out);
        assert!(words.iter().all(|word| run.err.contains(word)), "{text:?}: {}", run.err);
    }
    std::fs::remove_dir_all(folder("file")).unwrap();
    let missing = simulate("file", &["--robot", "five_bar", "--input", given]);
    assert_eq!(missing.code, Some(2));
    assert!(
        missing.err.contains("cannot read") && missing.err.contains("forces.csv"),
        "{}",
        missing.err
    );
}

#[test]
fn exit_codes_say_whether_it_ran_ended_early_or_was_refused() {
    let lambda = ["--robot", "lambda"];
    for (more, code, words) in [
        (&["--y", "0.1", "--duration", "0.1"][..], 0, ""),
        (&["--y", "0.1,0.2"], 2, "found 2 number(s), expected 1 (Elbow)"),
        (&["--y", "nan"], 2, "not finite"),
        (&["--y", "a"], 2, "`a` is no number"),
        (&["--method", "rk4"], 2, "does not find its own"),
        (&["--method", "rk4", "--step", "-1"], 2, "the step is -1"),
        (&["--duration", "0"], 2, "the duration is 0"),
        (&["--rtol", "0"], 2, "relative tolerance"),
        (&["--tau-u", "1,2"], 2, "found 2 number(s), expected 1 (ElbowAct)"),
        (&["--kp", "1,2"], 2, "kp in y"),
        (&["--spring", "hand", "base_link", "1,0,0"], 2, "there is no link `hand`"),
        (&["--spring", "base_link:0,0", "Elbow_Link", "1,0,0"], 2, "expected x,y,z"),
        (
            &["--spring", "base_link", "Elbow_Link", "1,0"],
            2,
            "expected stiffness, damping and rest length",
        ),
        (&["--spring", "base_link", "Elbow_Link", "-1,0,0"], 2, "stiffness of -1"),
        (&["--method", "euler", "--step", "1", "--duration", "1e4", "--kp", "1e9"], 1, ""),
    ] {
        let run = simulate("codes", &[&lambda[..], more].concat());
        assert_eq!(run.code, Some(code), "{more:?}: {}{}", run.out, run.err);
        assert!(run.err.contains(words), "{more:?}: {}", run.err);
    }
    let unknown = simulate("codes", &["--robot", "lamda"]);
    assert_eq!(unknown.code, Some(2));
    assert!(unknown.err.contains("did you mean `lambda`"), "{}", unknown.err);
    std::fs::remove_dir_all(folder("codes")).unwrap();
}

#[test]
fn a_stop_half_way_is_told_with_its_status_and_leaves_the_rows_up_to_there() {
    // both motors work against each other until the elbows are aligned
    let run = simulate(
        "early",
        &[
            "--robot",
            "five_bar",
            "--tau-u",
            "40,-40",
            "--duration",
            "5",
            "--no-switching",
            "--method",
            "rk4",
            "--step",
            "1e-3",
            "--format",
            "json",
        ],
    );
    assert_eq!(run.code, Some(1), "{}", run.out);
    let answer: Value = serde_json::from_str(&run.out).unwrap();
    assert_ne!(answer["status"], "finished");
    assert!(
        answer["time"].as_f64().unwrap() < 5.0 && answer["steps"].as_u64().unwrap() > 10,
        "{answer}"
    );
    let rows = std::fs::read_to_string(folder("early").join("motion.csv")).unwrap().lines().count();
    assert!(rows > 3, "{rows} rows");
    std::fs::remove_dir_all(folder("early")).unwrap();
}

#[test]
fn the_example_of_the_readme_stays_within_limits_and_a_free_swing_does_not() {
    let page = include_str!("../../../README.md");
    let line = page.lines().find_map(|line| line.strip_prefix("sarrus simulate ")).unwrap();
    let (example, _) = line.split_once(" --out ").unwrap();
    let arguments: Vec<&str> = example.split_whitespace().collect();
    let limits = |arguments: &[&str]| {
        let run = simulate("limits", &[arguments, &["--format", "json"]].concat());
        assert_eq!(run.code, Some(0), "{}", run.err);
        let answer: Value = serde_json::from_str(&run.out).unwrap();
        answer["limits"].as_array().unwrap().len()
    };
    assert_eq!(limits(&arguments), 0, "{example}");
    assert!(limits(&["--robot", "lambda", "--y", "0.3", "--duration", "5"]) > 0);
    std::fs::remove_dir_all(folder("limits")).unwrap();
}
