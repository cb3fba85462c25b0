//! A fixed number of inputs for every target, from a fixed seed; ten times as many with
//! `SARRUS_THOROUGH`.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::path::{Path, PathBuf};
use std::process::Command;

use sarrus_fuzz::{Limits, TARGETS, hash, run};

const SEED: u64 = 0x5a44;

/// Runs a target; a failing input is written to a file and reported with the command to replay it.
fn keeps_its_laws(name: &str, inputs: u64) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let times = if std::env::var_os("SARRUS_THOROUGH").is_some() { 10 } else { 1 };
    let inputs = times * inputs;
    let limits = Limits { seed: SEED, inputs, time: None };
    let outcome = run(target, limits, &mut |_| ()).unwrap_or_else(|words| panic!("{words}"));
    let slowest = outcome.slowest.0;
    println!("{name}: seed {SEED:#x}, {inputs} inputs, {} kinds of outcomes", outcome.kinds);
    println!("{name}: the slowest input took {slowest:?} of processor time");
    let Some(failure) = outcome.failure else { return };
    let file = folder().join(format!("{name}-{:016x}", hash(&failure.input)));
    std::fs::write(&file, &failure.input).unwrap();
    let file = file.display();
    let words = failure.words;
    panic!("{words}\ncargo run --release -p sarrus-fuzz -- {name} --replay {file}");
}

/// The target folder of this build, `TARGET/PROFILE`.
fn folder() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent().and_then(Path::parent).unwrap().to_owned()
}

#[test]
fn urdf_is_read_or_told() {
    keeps_its_laws("urdf", 4_000);
}

#[test]
fn mjcf_is_read_or_told() {
    keeps_its_laws("mjcf", 1_000);
}

#[test]
fn sdf_is_read_or_told() {
    keeps_its_laws("sdf", 1_000);
}

#[test]
fn the_files_of_gepetto_are_read_or_told() {
    keeps_its_laws("gepetto", 500);
}

#[test]
fn submechanisms_are_read_or_told() {
    keeps_its_laws("submechanisms", 4_000);
}

#[test]
fn configurations_of_buses_are_read_or_told() {
    keeps_its_laws("configuration", 3_000);
}

#[test]
fn dbc_files_are_read_or_told_and_their_motors_take_any_frame() {
    keeps_its_laws("dbc", 8_000);
}

#[test]
fn lines_of_a_log_are_read_or_told_and_replay_alike() {
    keeps_its_laws("log", 2_000);
}

#[test]
fn lines_of_serial_adapters_are_read_and_written_alike() {
    keeps_its_laws("slcan", 20_000);
}

#[test]
fn lines_of_ask_are_answered_one_for_one() {
    // a build of the whole workspace has the program; otherwise it is built here
    let program = folder().join("sarrus");
    if !program.exists() {
        let mut build = Command::new(env!("CARGO"));
        build.args(["build", "--locked", "-p", "sarrus-server", "--target-dir"]);
        build.arg(folder().parent().unwrap());
        if folder().ends_with("release") {
            build.arg("--release");
        }
        assert!(build.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success());
    }
    keeps_its_laws("ask", 8_000);
}

#[test]
fn queries_are_planned_or_refused_and_plans_take_any_numbers() {
    keeps_its_laws("query", 20_000);
}

#[test]
fn a_server_answers_whatever_a_client_says() {
    keeps_its_laws("server", 1_500);
}

/// The search finds failures: a law that fails for one byte is found and the input reduced.
#[test]
fn a_broken_law_is_found_and_its_input_made_small() {
    let target = sarrus_fuzz::Target {
        name: "broken",
        seeds: || vec![b"a plain seed of some length".to_vec()],
        tokens: &[],
        start: || {
            Ok(Box::new(|input: &[u8]| match input.contains(&b'#') {
                true => panic!("a reader that panics"),
                false => Ok(0),
            }))
        },
    };
    let limits = Limits { seed: SEED, inputs: 100_000, time: None };
    let failure = run(&target, limits, &mut |_| ()).unwrap().failure.unwrap();
    assert_eq!(failure.input, b"#");
    assert!(failure.words.contains("a reader that panics"), "{}", failure.words);
}
