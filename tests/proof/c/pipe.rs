//! The page for any language: its programs talk to `sarrus ask`; the time of an answer is printed.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use super::{CPP, Program, fresh_folder, present};

/// Pairs of states in the longer run.
const PAIRS: usize = 2000;

/// The page's first block in a language.
fn block(language: &str) -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/README.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (_, rest) = page.split_once(&format!("```{language}\n")).unwrap();
    rest.split("```").next().unwrap().to_owned()
}

/// The program with its two states repeated.
fn repeated(text: &str, states: &str, again: &str) -> String {
    assert_eq!(text.matches(states).count(), 1, "{text}");
    text.replace(states, again)
}

/// Output lines of a program, and its run time `[s]`.
fn run(command: &mut Command) -> (Vec<String>, f64) {
    let programs = crate::examples::folder();
    let path = std::env::var("PATH").unwrap_or_default();
    let start = Instant::now();
    let output = command.env("PATH", format!("{}:{path}", programs.display())).output().unwrap();
    let took = start.elapsed().as_secs_f64();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    (text.lines().map(str::to_owned).collect(), took)
}

/// Checks the forces of both runs of a program and prints the time of an answer.
fn compare(language: &str, [short, long]: [&mut Command; 2], mut force: impl FnMut(&str) -> f64) {
    let ((two, before), (many, after)) = (run(short), run(long));
    let two: Vec<f64> = two.iter().map(|line| force(line)).collect();
    assert!(two.len() == 2 && (two[1] - 16.8023).abs() < 1e-4, "{two:?}");
    assert_eq!(many.len(), 2 * PAIRS);
    for (k, line) in many.iter().enumerate() {
        assert_eq!(force(line), two[k % 2]);
    }
    let each = (after - before) / (2 * PAIRS - 2) as f64;
    println!("{language}: {:.1} µs from a line written to its answer read", 1e6 * each);
}

#[test]
fn the_pipe_of_the_page_answers_in_cpp() {
    let text = block("cpp");
    let states = "for (double y : {0.1, 0.2}) {";
    let again = format!("for (int k = 0; k < {PAIRS}; ++k) {states}");
    let folder = fresh_folder();
    for compiler in present(&CPP) {
        let [mut short, mut long] =
            [("two", text.clone()), ("many", repeated(&text, states, &again))].map(
                |(name, text)| {
                    let source = folder.join(format!("{name}.cpp"));
                    std::fs::write(&source, text).unwrap();
                    Program::compile(compiler, &source, &[])
                },
            );
        let commands = [&mut short, &mut long].map(|program| program.command(&[]));
        let [mut short, mut long] = commands;
        compare(compiler, [&mut short, &mut long], |line| {
            let answer: serde_json::Value = serde_json::from_str(line).unwrap();
            assert_eq!(answer["status"], "ok");
            answer["tau_u"][0].as_f64().unwrap()
        });
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_pipe_of_the_page_answers_in_python() {
    if Command::new("python3").arg("--version").output().is_err() {
        return println!("not run: python3 is missing");
    }
    let text = block("python");
    let again = repeated(&text, "[0.1, 0.2]", &format!("[0.1, 0.2] * {PAIRS}"));
    let [mut short, mut long] = [text, again].map(|text| {
        let mut command = Command::new("python3");
        command.args(["-c", &text]);
        command
    });
    compare("Python", [&mut short, &mut long], |line| {
        line.trim_matches(['[', ']']).parse().unwrap()
    });
}
