//! libsarrus in programs in C and C++, compiled here with every installed compiler.
//!
//! Cargo builds the library before these tests run, since this crate depends on it without linking
//! it. A missing compiler is reported as "not run".

mod bridge;
mod header;
mod install;
mod page;
mod pipe;
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

/// Folder of this build's libsarrus.
fn libraries() -> PathBuf {
    // target/PROFILE/deps/proof-…
    let test = std::env::current_exe().unwrap();
    let deps = test.parent().unwrap();
    let folders = [deps, deps.parent().unwrap()];
    let has = |folder: &&Path| folder.join("libsarrus.so").exists();
    folders.into_iter().find(has).expect("cargo has not built libsarrus.so").to_owned()
}

/// The library's soname, which is the file name that programs load.
fn soname() -> String {
    let header = std::fs::read_to_string(folder().join("include/sarrus.h")).unwrap();
    let line = header.lines().find_map(|line| line.strip_prefix("#define SARRUS_ABI_VERSION "));
    format!("libsarrus.so.{}", line.unwrap())
}

/// The installed compilers of a list that can link sanitized programs; some systems have the
/// sanitizers in a separate package.
fn with_sanitizers(compilers: &[&'static str]) -> Vec<&'static str> {
    let folder = fresh_folder();
    let source = folder.join("empty.c");
    std::fs::write(&source, "int main(void) { return 0; }\n").unwrap();
    let links = |compiler: &&str| {
        let mut command = Command::new(compiler);
        command.args(SANITIZERS).arg(&source).arg("-o").arg(folder.join("empty"));
        let output = command.output();
        let links = output.unwrap().status.success();
        if !links {
            println!("not run: {compiler} has no sanitizers");
        }
        links
    };
    let found = present(compilers).into_iter().filter(links).collect();
    let _ = std::fs::remove_dir_all(&folder);
    found
}

/// The installed compilers of a list.
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

fn fresh_folder() -> PathBuf {
    static FOLDERS: AtomicU32 = AtomicU32::new(0);
    let number = FOLDERS.fetch_add(1, Relaxed);
    let folder = std::env::temp_dir().join(format!("sarrus-c-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A program and its folder.
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
    /// Compiles a source without warnings and links it with libsarrus.
    fn compile(compiler: &str, source: &Path, flags: &[&str]) -> Program {
        let folder = fresh_folder();
        let path = folder.join("program");
        let is_c = source.extension().is_some_and(|ending| ending == "c");
        // under its soname
        let library = libraries().join("libsarrus.so");
        std::os::unix::fs::symlink(&library, folder.join(soname())).unwrap();
        let mut command = Command::new(compiler);
        command.arg(if is_c { "-std=c99" } else { "-std=c++20" });
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-I"]);
        command.arg(self::folder().join("include")).args(flags).arg(source).arg("-o").arg(&path);
        command.arg(&library).arg(format!("-Wl,-rpath,{}", folder.display()));
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

    /// The program as an argument of another one.
    fn under(&self, outer: &str, flags: &[&str]) -> Command {
        let mut command = Command::new(outer);
        command.args(flags).arg(&self.path).env("SARRUS_ROOT", crate::examples::root());
        command
    }

    /// Runs the program, which must succeed, and returns its stdout.
    fn run(&self, arguments: &[&str]) -> String {
        let output = self.command(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        let first: Vec<&str> = errors.lines().take(40).collect();
        assert!(output.status.success(), "{:?}: {}", output.status, first.join("\n"));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Starts the program with pipes for stdin and stdout.
    fn talk(&self, arguments: &[&str]) -> Talk {
        let mut command = self.command(arguments);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let stdin = child.stdin.take();
        let stdout = BufReader::new(child.stdout.take().unwrap());
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
