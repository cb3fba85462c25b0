//! libsarrus as programs in C and C++ use it: compiled here by the compilers that are there.
//!
//! Cargo builds the library before these tests run, since this crate depends on it without linking
//! it. A compiler that is absent is said to be "not run".

mod bridge;
mod header;
mod page;
mod programs;
mod timing;

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

const C: [&str; 2] = ["gcc", "clang"];
const CPP: [&str; 2] = ["g++", "clang++"];
const SANITIZERS: &[&str] =
    &["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-O1"];

/// `client/c`.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/c")
}

/// Where this build has libsarrus.
fn libraries() -> PathBuf {
    // target/PROFILE/deps/proof-…
    let test = std::env::current_exe().unwrap();
    let deps = test.parent().unwrap();
    let folders = [deps, deps.parent().unwrap()];
    let has = |folder: &&Path| folder.join("libsarrus.so").exists();
    folders.into_iter().find(has).expect("cargo has not built libsarrus.so").to_owned()
}

/// The compilers of a list that are there.
fn present(compilers: &[&'static str]) -> Vec<&'static str> {
    let is_there = |compiler: &&str| {
        let found = Command::new(compiler).arg("--version").output().is_ok();
        if !found {
            println!("not run: {compiler} is missing");
        }
        found
    };
    compilers.iter().copied().filter(is_there).collect()
}

/// A program, and the folder that goes with it.
struct Program {
    path: PathBuf,
    folder: PathBuf,
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

impl Program {
    /// Compiles a source, without a warning, and links it with libsarrus.
    fn compile(compiler: &str, source: &Path, flags: &[&str]) -> Program {
        static PROGRAMS: AtomicU32 = AtomicU32::new(0);
        let number = PROGRAMS.fetch_add(1, Relaxed);
        let name = format!("sarrus-c-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("program");
        let is_c = source.extension().is_some_and(|ending| ending == "c");
        let libraries = libraries();
        let mut command = Command::new(compiler);
        command.arg(if is_c { "-std=c99" } else { "-std=c++20" });
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-I"]);
        command.arg(self::folder().join("include")).args(flags).arg(source).arg("-o").arg(&path);
        command.arg("-L").arg(&libraries).arg("-lsarrus");
        command.arg(format!("-Wl,-rpath,{}", libraries.display()));
        let program = Program { path, folder };
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{compiler} {}: {text}", source.display());
        program
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.path);
        command.args(arguments).env("SARRUS_ROOT", crate::examples::root());
        command
    }

    /// What it prints; it must end well.
    fn run(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        let first: Vec<&str> = errors.lines().take(40).collect();
        assert!(output.status.success(), "{:?}: {}", output.status, first.join("\n"));
        String::from_utf8(output.stdout).unwrap()
    }

    /// The program as a process with which one can talk.
    fn talk(&self, arguments: &[&str]) -> Talk {
        let mut command = self.command(arguments);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (stdin, stdout) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        Talk { child, stdin, stdout }
    }
}

/// A running program.
struct Talk {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
}

impl Talk {
    fn line(&mut self) -> String {
        let mut line = String::new();
        assert_ne!(self.stdout.read_line(&mut line).unwrap(), 0, "the program ended");
        line.trim_end().to_owned()
    }

    fn tell(&mut self, line: &str) {
        writeln!(self.stdin.as_mut().unwrap(), "{line}").unwrap();
    }

    fn end(mut self) {
        drop(self.stdin.take());
        assert!(self.child.wait().unwrap().success());
    }
}
