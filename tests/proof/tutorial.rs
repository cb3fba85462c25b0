//! Writes the tutorial's files, runs its commands and compares their outputs with the page.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use sarrus_tests::python::environment;

use crate::examples;

const PAGE: &str = include_str!("../../server/docs/tutorial.md");
/// The largest difference of numbers, relative above 1 and absolute below.
const TOLERANCE: f64 = 1e-6;

/// A folder and the servers started in it; both end with the test.
struct Session {
    folder: PathBuf,
    servers: Vec<Child>,
}

impl Drop for Session {
    fn drop(&mut self) {
        for server in &mut self.servers {
            let _ = Command::new("kill").arg(server.id().to_string()).status();
            let _ = server.wait();
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

impl Session {
    /// `sh` in the folder, with `sarrus` and `python3` of this build.
    fn shell(&self, line: &str) -> Command {
        let python = environment();
        let programs = [examples::folder(), python.python().parent().unwrap()];
        let path = std::env::var_os("PATH").unwrap();
        let path = programs.into_iter().map(Into::into).chain(std::env::split_paths(&path));
        let mut shell = Command::new("sh");
        for (key, value) in python.command(&[]).get_envs() {
            match value {
                Some(value) => shell.env(key, value),
                None => shell.env_remove(key),
            };
        }
        shell.args(["-c", line]).current_dir(&self.folder);
        shell.env("PATH", std::env::join_paths::<Vec<PathBuf>, _>(path.collect()).unwrap());
        shell.env("SARRUS_ROOT", self.folder.join("domain"));
        shell
    }

    /// Lines that a command prints; of a command in the background only the first line.
    fn run(&mut self, line: &str) -> Vec<String> {
        let Some(server) = line.strip_suffix(" &") else {
            let output = self.shell(line).output().unwrap();
            print!("$ {line}\n{}", String::from_utf8_lossy(&output.stderr));
            let text = String::from_utf8(output.stdout).unwrap();
            return text.lines().map(str::to_owned).collect();
        };
        // replaces the shell, so that signals reach the server
        let mut shell = self.shell(&format!("exec {server}"));
        let mut server = shell.stdout(Stdio::piped()).spawn().unwrap();
        let mut output = String::new();
        let stdout = server.stdout.take().unwrap();
        self.servers.push(server);
        BufReader::new(stdout).read_line(&mut output).unwrap();
        vec![output]
    }
}

/// True if two words are equal or two numbers are close.
fn agree(shown: &str, found: &str) -> bool {
    match (shown.parse::<f64>(), found.parse::<f64>()) {
        (Ok(shown), Ok(found)) => (shown - found).abs() <= TOLERANCE * shown.abs().max(1.0),
        _ => shown == found,
    }
}

/// True if the page shows a printed line; `...` at the end of the page's line matches the rest.
fn is_shown(shown: &str, found: &str) -> bool {
    let words = |line: &str| -> Vec<String> {
        let words = line.split(|letter: char| letter.is_whitespace() || "{}[]:,".contains(letter));
        words.filter(|word| !word.is_empty()).map(str::to_owned).collect()
    };
    let beginning = words(shown.trim_end_matches("..."));
    let found = words(found);
    let complete = shown.ends_with("...") || beginning.len() == found.len();
    complete
        && beginning.len() <= found.len()
        && beginning.iter().zip(&found).all(|(shown, found)| agree(shown, found))
}

/// Compares an output with the page, where a line `...` matches any number of lines.
fn compare(command: &str, shown: &[&str], found: &[String]) {
    let mut rest = found.iter();
    let mut any = false;
    for shown in shown {
        if *shown == "..." {
            any = true;
            continue;
        }
        let place = if any {
            rest.any(|line| is_shown(shown, line))
        } else {
            rest.next().is_some_and(|line| is_shown(shown, line))
        };
        assert!(place, "`{command}` does not print `{shown}` there:\n{}", found.join("\n"));
        any = false;
    }
    assert!(any || rest.next().is_none(), "`{command}` prints more:\n{}", found.join("\n"));
}

#[test]
fn the_tutorial_prints_its_outputs() {
    let folder = std::env::temp_dir().join(format!("sarrus-tutorial-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut session = Session { folder, servers: Vec::new() };
    let mut n_commands = 0;
    for block in PAGE.split("```").skip(1).step_by(2) {
        let (head, text) = block.split_once('\n').unwrap();
        if let Some((_, file)) = head.split_once(' ') {
            std::fs::write(session.folder.join(file), text).unwrap();
        }
        if head != "console" {
            continue;
        }
        for step in format!("\n{text}").split("\n$ ").skip(1) {
            let mut lines: Vec<&str> = step.lines().collect();
            let n_continued =
                lines.iter().skip(1).take_while(|line| line.starts_with("> ")).count();
            let output = lines.split_off(1 + n_continued);
            let command: Vec<&str> =
                lines.iter().map(|line| line.strip_prefix("> ").unwrap_or(line)).collect();
            let command = command.join("\n");
            compare(&command, &output, &session.run(&command));
            n_commands += 1;
        }
    }
    assert_eq!(n_commands, 11, "commands of the page");
}
