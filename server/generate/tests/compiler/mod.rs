//! The C compiler of this machine, and what it makes.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use sarrus_generate::{FLAGS, Outcome, Source};

const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-Wconversion", "-Werror"];

/// The compiler, if there is one.
pub(crate) fn compiler() -> Option<String> {
    let cc = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let version = Command::new(&cc).arg("--version").stdout(Stdio::null()).status();
    version.is_ok_and(|status| status.success()).then_some(cc)
}

/// True where the compiler has these flags and what they need.
pub(crate) fn takes(cc: &str, flags: &[&str]) -> bool {
    let out = folder().join("takes");
    let mut child = Command::new(cc)
        .args(flags)
        .args(["-x", "c", "-", "-o"])
        .arg(out)
        .stdin(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(b"int main(void) { return 0; }\n").unwrap();
    child.wait().unwrap().success()
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// The test program of generated code.
pub(crate) struct Compiled {
    program: PathBuf,
    pub(crate) seconds: f64,
    /// Of the function's machine code with its constants.
    pub(crate) bytes: u64,
}

impl Compiled {
    /// Compiles with warnings as errors.
    pub(crate) fn new(cc: &str, source: &Source, flags: &[&str]) -> Compiled {
        let folder = folder().join(format!("{}{}", source.name, flags.len()));
        std::fs::create_dir_all(&folder).unwrap();
        let name = &source.name;
        let file = |ending: &str| folder.join(format!("{name}{ending}"));
        std::fs::write(file(".h"), &source.header).unwrap();
        std::fs::write(file(".c"), &source.function).unwrap();
        std::fs::write(file("_test.c"), &source.test).unwrap();
        let baseline = if cfg!(target_arch = "x86_64") { &["-march=x86-64-v3"][..] } else { &[] };
        let run = |arguments: &[&Path]| {
            let output = Command::new(cc)
                .args(FLAGS)
                .args(baseline)
                .args(WARNINGS)
                .args(flags)
                .args(arguments)
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        };
        let (o, out) = (Path::new("-c"), Path::new("-o"));
        let start = Instant::now();
        run(&[o, &file(".c"), out, &file(".o")]);
        let seconds = start.elapsed().as_secs_f64();
        let program = file("_test");
        run(&[&file(".o"), &file("_test.c"), out, &program, Path::new("-lm")]);
        let bytes = std::fs::metadata(file(".o")).unwrap().len();
        Compiled { program, seconds, bytes }
    }

    /// Runs the golden answers; what it prints.
    pub(crate) fn test(&self) -> String {
        let output = Command::new(&self.program).output().unwrap();
        let words = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        assert!(output.status.success(), "{words} {}", String::from_utf8_lossy(&output.stderr));
        words
    }

    /// Its answers to states.
    pub(crate) fn answers(&self, states: &[Vec<f64>], outputs: usize) -> Vec<(Outcome, Vec<f64>)> {
        let bytes: Vec<u8> = states.iter().flatten().flat_map(|x| x.to_ne_bytes()).collect();
        let mut child = Command::new(&self.program)
            .arg("states")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || stdin.write_all(&bytes).unwrap());
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        assert!(output.status.success());
        let numbers: Vec<f64> = output
            .stdout
            .chunks_exact(8)
            .map(|bytes| f64::from_ne_bytes(bytes.try_into().unwrap()))
            .collect();
        assert_eq!(numbers.len(), states.len() * (outputs + 1));
        let answer = |numbers: &[f64]| {
            let outcome = match numbers[0] {
                0.0 => Outcome::Ok,
                1.0 => Outcome::LimitsExceeded,
                _ => Outcome::NotAnswered,
            };
            (outcome, numbers[1..].to_vec())
        };
        numbers.chunks_exact(outputs + 1).map(answer).collect()
    }
}
