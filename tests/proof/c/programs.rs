//! Programs that are compiled and run: the examples, misuse, memory.

use sarrus_models::{Options, Source, load};
use sarrus_tests::run::Robot;

use super::{C, CPP, Program, SANITIZERS, folder, present, with_sanitizers};
use crate::examples::{HAND, Server, assert_alike, hand_of};
use sarrus_dynamics::{Field, Request};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Calls of each kind; a longer run has 10^6.
const CALLS: &str = "20000";

/// Flags of valgrind: any wrong access and any memory that nothing points to is a failure.
const LEAKS: &[&str] =
    &["-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"];

fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/c").join(name)
}

fn calls() -> String {
    std::env::var("SARRUS_C_CALLS").unwrap_or_else(|_| CALLS.to_owned())
}

/// Forces of the example's motion, computed in Rust.
fn expected(name: &str) -> Vec<(String, f64)> {
    let loaded = load(&Source::Bundled(name.into()), &Options::default()).unwrap();
    let model = loaded.compiled.model;
    let names = model.info().active.clone();
    let scaled = |scale: f64| {
        let n = model.sizes().n_vy;
        (0..n).map(|k| scale * (k + 1) as f64).collect::<Vec<_>>()
    };
    let y = scaled(0.01);
    let yd = scaled(0.1);
    let ydd = scaled(-0.2);
    let given = [(Field::Y, &y[..]), (Field::Yd, &yd), (Field::Ydd, &ydd)];
    let answer = Robot::new(model).ask(Request::InverseDynamics, &given, &[Field::TauU]).ok();
    names.into_iter().zip(answer.get(Field::TauU).to_vec()).collect()
}

fn printed(output: &str) -> Vec<(String, f64)> {
    let row = |line: &str| {
        let (name, number) = line.rsplit_once(": ").unwrap();
        (name.to_owned(), number.parse().unwrap())
    };
    output.lines().map(row).collect()
}

#[test]
fn the_example_in_c_has_the_bits_of_rust_in_process_and_connected() {
    let path = folder().join("examples/inverse_dynamics.c");
    let sanitized = with_sanitizers(&C);
    for compiler in present(&C) {
        let program = Program::compile(compiler, &path, &[]);
        for robot in ["lambda", "torso", "ankle", "stewart", "wrist", "rh5v2_upper_body"] {
            let found = printed(&program.run(&[robot]));
            let expected = expected(robot);
            assert_eq!(found, expected, "{robot}");
        }
        let server = format!("c-{compiler}");
        let _server = Server::start(&server);
        let connected = program.run(&["--connect", &server]);
        assert_eq!(printed(&connected), expected("lambda"));
        if !sanitized.contains(&compiler) {
            continue;
        }
        // the sanitizers find no leak and no undefined behaviour
        let program = Program::compile(compiler, &path, SANITIZERS);
        assert_eq!(program.run(&["--connect", &server]), connected);
        assert_eq!(printed(&program.run(&["torso"])), expected("torso"));
    }
}

#[test]
fn the_hand_in_cpp_moves_as_that_in_rust() {
    let path = folder().join("examples/hand_1khz.cpp");
    let _server = Server::of("rh5v2_upper_body", "c-hand", &[]);
    let expected = hand_of("c-hand");
    for compiler in present(&CPP) {
        let program = Program::compile(compiler, &path, &[]);
        assert_alike(&program.run(&["c-hand", HAND, "1"]), &expected);
    }
}

#[test]
fn what_a_program_does_wrong_is_a_status_and_never_the_end_of_it() {
    for compiler in with_sanitizers(&C) {
        Program::compile(compiler, &source("checks.c"), SANITIZERS).run(&[]);
    }
    // header and programs are valid C++ too
    for compiler in present(&CPP) {
        Program::compile(compiler, &source("calls.cpp"), &["-fno-exceptions"]);
    }
}

#[test]
fn the_transmission_and_the_node_of_ros_work_against_a_stub_of_its_headers() {
    let ros = Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/ros2");
    let include = |folder: &str| format!("-I{}", ros.join(folder).display());
    let flags = [include("tests/stub"), include("include")];
    let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
    for compiler in present(&CPP) {
        Program::compile(compiler, &ros.join("tests/check.cpp"), &flags).run(&[]);
    }
}

#[test]
fn valgrind_finds_no_wrong_access_and_no_leak_in_the_library() {
    if Command::new("valgrind").arg("--version").output().is_err() {
        return println!("not run: valgrind is missing");
    }
    for compiler in present(&C) {
        let program = Program::compile(compiler, &source("checks.c"), &["-g"]);
        let output = program.under("valgrind", LEAKS).output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{compiler}: {text}");
    }
}

#[test]
fn a_server_that_dies_is_a_status() {
    for compiler in present(&C) {
        let program = Program::compile(compiler, &source("checks.c"), &[]);
        let name = format!("dies-{compiler}");
        let server = Server::start(&name);
        let mut talk = program.talk(&[&name]);
        assert_eq!(talk.line(), "kill");
        drop(server);
        talk.tell("");
        talk.end();
    }
}

#[test]
fn a_forked_child_gets_no_answer_through_the_connection_of_its_parent() {
    let _server = Server::start("forks");
    for compiler in present(&C) {
        Program::compile(compiler, &source("fork.c"), &["-D_GNU_SOURCE"]).run(&["forks"]);
    }
}

#[test]
fn nothing_allocates_after_set_up_and_memory_does_not_grow() {
    let Some(compiler) = present(&C).into_iter().next() else { return };
    let program = Program::compile(compiler, &source("steady.c"), &["-D_GNU_SOURCE"]);
    let _server = Server::start("steady");
    let calls = calls();
    for arguments in [&[calls.as_str()][..], &[calls.as_str(), "steady"]] {
        let output = program.run(arguments);
        println!("{arguments:?}: {}", output.trim_end());
        let number = |label: &str| -> i64 {
            let (_, rest) = output.split_once(label).unwrap();
            rest.split([',', '\n']).next().unwrap().trim().parse().unwrap()
        };
        assert!(number("set-up ") > 100, "the counter does not count: {output}");
        assert_eq!(number("after "), 0, "{output}");
        // pages of the program that are touched for the first time
        assert!(number("pages ") < 256, "{output}");
    }
}

#[test]
fn a_batch_without_memory_is_a_status() {
    // without a sanitizer, which would need more memory than the limit leaves
    for compiler in present(&C) {
        Program::compile(compiler, &source("memory.c"), &["-D_GNU_SOURCE"]).run(&[]);
    }
}

#[test]
fn calls_leak_nothing() {
    let flags = &[SANITIZERS, &["-D_POSIX_C_SOURCE=200809L"]].concat();
    let _server = Server::start("leaks");
    for compiler in with_sanitizers(&C) {
        let program = Program::compile(compiler, &source("calls.c"), flags);
        for arguments in [&[][..], &["leaks"]] {
            let mut talk = program.talk(arguments);
            let _answer = talk.line();
            talk.tell(&calls());
            let _nanoseconds = talk.line();
            // the sanitizer turns a leak into the program's exit code
            talk.end();
            println!("{compiler} {arguments:?}: {} calls, no leak", calls());
        }
    }
}
