//! The Python package's dynamics: bits equal to Rust's, connected robots, and its pages' examples.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use sarrus_dynamics::{Field, Request};
use sarrus_tests::cases::Case;
use sarrus_tests::python::environment;
use sarrus_tests::run::Robot;
use serde_json::{Value, json};

use crate::examples;

/// A folder of the Python package.
fn package(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/python").join(folder)
}

/// Runs a script of these tests with the input; it must succeed.
fn run(mut command: Command, input: &str) -> String {
    command.env("SARRUS_ROOT", examples::root());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&stderr);
    assert!(status.success(), "{command:?}: {status}\n{text}");
    String::from_utf8(stdout).unwrap()
}

/// A script beside this file.
fn script(name: &str, arguments: &[&str]) -> Command {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/python").join(name);
    let mut command = environment().command(&["-W", "error"]);
    command.arg(path).args(arguments);
    command
}

#[test]
fn answers_in_python_have_the_bits_of_rust() {
    use Field::*;
    const ROBOTS: [&str; 6] =
        ["lambda", "torso", "stewart", "rh5v2_upper_body", "rh5v2_full", "stewart_floating"];
    const STATES: u64 = 20;
    let questions: [(&str, Request, &[Field], &[Field]); 7] = [
        ("inverse_dynamics", Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU]),
        ("forward_dynamics", Request::ForwardDynamics, &[Y, Yd, TauU], &[Ydd]),
        ("state", Request::Kinematics, &[Y, Yd, Ydd], &[Q, Qd, Qdd]),
        ("to_actuators", Request::Kinematics, &[Y, Yd, Ydd], &[U, Ud, Udd]),
        ("mass_matrix", Request::InverseDynamics, &[Y], &[MY]),
        ("bias_force", Request::InverseDynamics, &[Y, Yd], &[CY]),
        ("to_independent", Request::Map, &[U, Ud, Udd], &[Y, Yd, Ydd]),
    ];
    let mut asked = Vec::new();
    let mut expected = Vec::new();
    for name in ROBOTS {
        let case = Case::bundled(name);
        let mut robot = Robot::new(case.compiled.model.clone());
        let mut states = Vec::new();
        let mut answers = vec![Vec::new(); questions.len()];
        let n_u = robot.model.active_names().len();
        for k in 0..STATES {
            let state = case.state(k);
            let mut known = vec![(Y, state.y), (Yd, state.yd), (Ydd, state.ydd)];
            known.push((TauU, (0..n_u).map(|i| 3.0 - i as f64).collect()));
            let mut found: Vec<Vec<u64>> = Vec::new();
            for (_, request, given, want) in questions {
                let numbers = |field: &Field| {
                    let (_, numbers) = known.iter().find(|known| known.0 == *field).unwrap();
                    (*field, numbers.as_slice())
                };
                let given: Vec<(Field, &[f64])> = given.iter().map(numbers).collect();
                let answer = robot.ask(request, &given, want);
                if answer.answer.ok().is_err() {
                    break;
                }
                let fields = want.iter().map(|field| (*field, answer.get(*field).to_vec()));
                let fields: Vec<_> = fields.collect();
                found.push(fields.iter().flat_map(|(_, numbers)| bits(numbers)).collect());
                if want.contains(&U) {
                    known.extend(fields);
                }
            }
            // Python raises an exception for a state without an answer
            if found.len() < questions.len() {
                continue;
            }
            let fields = known.iter().map(|(field, numbers)| (field.name(), bits(numbers)));
            states.push(fields.collect::<BTreeMap<_, _>>());
            answers.iter_mut().zip(found).for_each(|(answers, found)| answers.push(found));
        }
        assert!(states.len() as u64 > STATES / 2, "{name}: {} states", states.len());
        asked.push(json!({ "robot": name, "states": states }));
        expected.push(answers);
    }
    let output = run(script("answers.py", &[]), &json!(asked).to_string());
    let found: Vec<Value> = serde_json::from_str(&output).unwrap();
    for ((name, found), expected) in ROBOTS.iter().zip(found).zip(expected) {
        for ((question, ..), expected) in questions.iter().zip(expected) {
            for way in ["single", "rows"] {
                assert_eq!(found[question][way], json!(expected), "{name}: {question}, {way}");
            }
        }
    }
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

/// Number of plans of a server's clients, from `sarrus top`.
fn plans_held(server: &str) -> u64 {
    let mut top = Command::new(examples::folder().join("sarrus"));
    top.args(["top", server, "--format", "json"]);
    let top: Value = serde_json::from_str(&run(top, "")).unwrap();
    let clients = top["clients"].as_array().unwrap();
    clients.iter().map(|client| client["plans"].as_u64().unwrap()).sum()
}

#[test]
fn a_connected_robot_answers_as_one_in_process_and_outlives_its_server() {
    let mut server = Some(examples::Server::start("python"));
    let mut command = script("connected.py", &["python"]);
    command.env("SARRUS_ROOT", examples::root());
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    let mut stdin = child.stdin.take().unwrap();
    while let Some(line) = lines.next().transpose().unwrap() {
        match line.as_str() {
            "stop the server" => drop(server.take()),
            "start the server" => server = Some(examples::Server::start("python")),
            "pause the server" => server.as_ref().unwrap().signal("-STOP"),
            "resume the server" => server.as_ref().unwrap().signal("-CONT"),
            "count the plans" => {
                writeln!(stdin, "{}", plans_held("python")).unwrap();
                continue;
            }
            other => panic!("{other}"),
        }
        writeln!(stdin, "done").unwrap();
    }
    assert!(child.wait().unwrap().success());
}

#[test]
fn programs_on_the_page_of_the_package_run() {
    let pages = ["README.md", "policy.md"].map(|page| std::fs::read_to_string(package(page)));
    let page = pages.map(Result::unwrap).concat();
    let blocks = page.split("```python\n").skip(1).filter_map(|rest| rest.split("```").next());
    let _server = examples::Server::start("python-page");
    // a user's own robot
    let folder = std::env::temp_dir().join(format!("sarrus-python-page-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (urdf, submechanisms) = sarrus_models::bundled_text("parallelogram").unwrap();
    std::fs::write(folder.join("crank.urdf"), urdf).unwrap();
    std::fs::write(folder.join("crank.yml"), submechanisms).unwrap();
    let mut count = 0;
    for block in blocks.filter(|block| !block.contains("sarrus.can")) {
        let optional = ["dask", "casadi"].iter().any(|package| block.contains(package));
        if optional && !environment().has_optional_packages() {
            continue;
        }
        let block = block.replace("connect(\"elbow\"", "connect(\"python-page\"");
        // one program demonstrates a warning
        let mut command = environment().command(&["-c", &block]);
        command.current_dir(&folder);
        run(command, "");
        count += 1;
    }
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(count >= 5, "{count} programs");
}

#[test]
fn examples_of_the_package_run() {
    let mut count = 0;
    for entry in std::fs::read_dir(package("examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "py") {
            let mut command = environment().command(&["-W", "error"]);
            command.arg(&path).current_dir(package("examples"));
            if path.ends_with("speed.py") {
                command.arg("--rust").arg(examples::folder().join("examples/speed"));
            }
            if path.ends_with("hand.py") {
                let _server = examples::Server::of("rh5v2_upper_body", "python-hand", &[]);
                command.args(["python-hand", examples::HAND, "1"]);
                let expected = examples::hand_of("python-hand");
                examples::assert_alike(&run(command, ""), &expected);
                count += 1;
                continue;
            }
            run(command, "");
            count += 1;
        }
    }
    assert!(count > 0);
}

#[test]
fn cells_of_the_notebook_of_a_hand_run_without_jupyter() {
    let path = package("examples").join("hand.ipynb");
    let output = run(script("cells.py", &[path.to_str().unwrap()]), "");
    assert!(output.ends_with("5 cells\n"), "{output}");
}

#[test]
fn notebooks_of_the_package_run_and_show_tables_and_pictures() {
    if !environment().has_optional_packages() {
        return;
    }
    let mut count = 0;
    for entry in std::fs::read_dir(package("examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "ipynb") {
            let mut command = script("notebook.py", &[]);
            command.arg(&path);
            run(command, "");
            count += 1;
        }
    }
    assert!(count > 0);
}

#[test]
fn rows_on_workers_of_dask_have_the_bits_of_one_process_also_when_a_worker_is_killed() {
    if environment().has_optional_packages() {
        // warnings of dask itself are allowed
        let mut command = environment().command(&[]);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/python/cluster.py"));
        run(command, "");
    }
}

#[test]
fn a_log_of_a_bridge_becomes_mcap_and_moves_a_robot_in_a_browser() {
    if environment().has_optional_packages() {
        let folder = std::env::temp_dir().join(format!("sarrus-show-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        // warnings of viser itself are allowed
        let mut command = environment().command(&[]);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/python/show.py"));
        command.arg(&folder);
        let text = run(command, "");
        assert!(text.contains("bridge.mcap"), "{text}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn a_server_and_its_recording_move_a_robot_in_a_browser() {
    if environment().has_optional_packages() {
        let folder = std::env::temp_dir().join(format!("sarrus-shown-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("served.rec");
        let file = file.to_str().unwrap();
        let _server = examples::Server::start_with("shown", &["--record", file]);
        for arguments in [&["recorded", "shown", file][..], &["served", "shown"]] {
            // warnings of viser itself are allowed
            let mut command = environment().command(&[]);
            command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/python/shown.py"));
            command.args(arguments);
            run(command, "");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn importing_the_package_on_an_older_processor_raises_what_that_lacks() {
    // emulated processors that lack some or all of x86-64-v3, and one that has all of it
    let emulator = "qemu-x86_64";
    if !cfg!(all(target_arch = "x86_64", target_feature = "avx2")) {
        return println!("not run: this build is for any processor");
    }
    let version = Command::new(emulator).arg("--version").output();
    let version = version.map_or(String::new(), |output| String::from_utf8(output.stdout).unwrap());
    // `qemu-x86_64 version 7.2.22 (…)`; AVX2 is emulated since 7.2
    let number = version.split(' ').nth(2).unwrap_or_default();
    let number: Vec<u32> = number.split('.').filter_map(|part| part.parse().ok()).collect();
    if number.as_slice() < &[7, 2] {
        return println!("not run: {emulator} 7.2 or newer is missing (Debian: qemu-user)");
    }
    let import = "try:\n    import sarrus.can\nexcept ImportError as error:\n    print(error)";
    for (processor, reported) in [
        ("Nehalem", "this processor has no FMA; sarrus is built for x86-64-v3"),
        ("max,-avx2", "this processor has no AVX2; sarrus is built for x86-64-v3"),
        ("max", ""),
    ] {
        let python = environment().command(&["-c", import]);
        let mut command = Command::new(emulator);
        command.args(["-cpu", processor]).arg(python.get_program()).args(python.get_args());
        command.envs(python.get_envs().filter_map(|(name, value)| Some((name, value?))));
        let output = run(command, "");
        assert!(output.starts_with(reported), "{processor}: {output}");
        assert_eq!(output.is_empty(), reported.is_empty(), "{processor}: {output}");
    }
}

#[test]
fn what_docstrings_show_is_true() {
    let modules = "import doctest, sys, sarrus, sarrus.robot as robot\n\
                   sys.exit(any(doctest.testmod(m).failed for m in (sarrus, robot)))";
    run(environment().command(&["-W", "error", "-c", modules]), "");
}
