//! The program `sarrus` as scripts use it.

mod answers;
mod assemble;
mod check;
mod closures_page;
mod corpus;
mod export;
mod generate;
mod import;
mod lines;
mod load_warnings;
mod parts;
mod report;
mod served;
mod simulate;
mod streams;
mod tasks;
mod vectors;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

/// The program of this build, which is built if it is missing.
fn sarrus() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        // target/PROFILE/deps/proof-…
        let test = std::env::current_exe().unwrap();
        let folder = test.parent().and_then(Path::parent).unwrap();
        let path = folder.join("sarrus");
        if !path.exists() {
            let mut build = Command::new(env!("CARGO"));
            build
                .args(["build", "--locked", "-p", "sarrus-server", "--target-dir"])
                .arg(folder.parent().unwrap());
            if folder.ends_with("release") {
                build.arg("--release");
            }
            assert!(build.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success());
        }
        path
    })
}

/// Exit code and output of a command.
#[derive(Debug)]
struct Run {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Run {
    /// Runs a command to its end.
    fn of(command: &mut Command, input: &[u8]) -> Run {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_owned();
        // a command that exits early closes its stdin
        let writer = std::thread::spawn(move || drop(stdin.write_all(&input)));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Run { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// The lines of stdout as JSON.
    fn json(&self) -> Vec<Value> {
        self.out
            .lines()
            .map(|line| {
                serde_json::from_str(line)
                    .unwrap_or_else(|error| panic!("{error}: {line}\n{self:?}"))
            })
            .collect()
    }

    /// The statuses of the answers.
    fn statuses(&self) -> Vec<String> {
        self.json().iter().map(|answer| answer["status"].as_str().unwrap().to_owned()).collect()
    }
}

/// Runs `sarrus` with arguments and an input.
fn run(arguments: &[&str], input: &[u8]) -> Run {
    Run::of(Command::new(sarrus()).args(arguments), input)
}

/// Asks a bundled robot with several lines.
fn ask(request: &str, robot: &str, lines: &[&str]) -> Run {
    run(&["ask", request, "--robot", robot], lines.join("\n").as_bytes())
}

/// A kinematics line with the k-th of 2048 sets of wanted fields.
fn subset(k: usize) -> String {
    let names = ["y", "yd", "ydd", "q", "qd", "qdd", "u", "ud", "udd", "G", "K"];
    let want: Vec<&str> = names
        .into_iter()
        .enumerate()
        .filter(|(bit, _)| k >> bit & 1 == 1)
        .map(|(_, name)| name)
        .collect();
    serde_json::json!({"y": [0.1], "want": want}).to_string()
}

/// A test's folder of files; removed when dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let folder = Folder(
            std::env::temp_dir().join(format!("sarrus-commands-{}-{name}", std::process::id())),
        );
        std::fs::create_dir_all(&folder.0).unwrap();
        folder
    }

    /// Writes a file and returns its path.
    fn file(&self, name: &str, text: impl AsRef<[u8]>) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A floating body with a joint: a quaternion, and fewer actuators than degrees of freedom.
const FLOATING: &str = r#"<robot name="floating">
<link name="world"/>
<link name="body"><inertial><origin xyz="0 0 1"/><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="arm"><inertial><origin xyz="0 0 1"/><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="float" type="floating"><parent link="world"/><child link="body"/></joint>
<joint name="turn" type="revolute"><parent link="body"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>
"#;
