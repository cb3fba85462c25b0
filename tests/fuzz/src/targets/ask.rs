//! Lines of `sarrus ask`, sent to the program itself as a script would send them.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use sarrus_proto::{Field, Status};
use serde_json::Value;

use super::{Check, Target, corpus, kind, law};

/// Request and robot of each session; an input selects one of them.
const SESSIONS: [[&str; 2]; 4] = [
    ["kinematics", "stewart_floating"],
    ["inverse-dynamics", "lambda"],
    ["forward-dynamics", "lambda"],
    ["map", "r3_lambda_r"],
];

pub(super) const ASK: Target = Target {
    name: "ask",
    seeds: corpus!("ask/plain.jsonl", "ask/frames.jsonl", "ask/floating.jsonl", "ask/faulty.jsonl"),
    tokens: &[
        "{\"y\":[0.1]}",
        "\"y\":",
        "\"yd\":[1]",
        "\"ydd\":[1]",
        "\"q\":[0,0,0]",
        "\"u\":[0]",
        "\"q_guess\":[0,0,0]",
        "\"tau_u\":[1]",
        "\"tau_y\":[1]",
        "\"want\":[",
        "\"lambda\"",
        "\"G\"",
        "\"frames\":[\"root\"]",
        "\"frames\"",
        "\"jacobians\"",
        "\"wrenches\":{\"rod\":[0,0,0,0,0,1]}",
        "\"nearest_y\"",
        "\"branch\"",
        "\"cond_Kd\"",
        "null",
        "true",
        "[[",
        "\\u0000",
        "\\ud800",
        "\\",
        "\"",
        "1e999",
        "{}",
        "[]",
        ",",
        ":",
    ],
    start: || {
        let program = program()?;
        let mut sessions = Vec::new();
        for [request, robot] in SESSIONS {
            sessions.push(Session::start(&program, request, robot)?);
        }
        let check: Check = Box::new(move |input| {
            let mut kinds = 0;
            for line in input.split(|byte| *byte == b'\n').take(16) {
                if !line.trim_ascii().is_empty() {
                    let session = crate::hash(line) as usize % sessions.len();
                    kinds ^= sessions[session].check(line)?.rotate_left(session as u32);
                }
            }
            Ok(kinds)
        });
        Ok(check)
    },
};

/// The program of this build: in the folder of this executable, or above it for tests.
fn program() -> Result<PathBuf, String> {
    let here = std::env::current_exe().map_err(|error| error.to_string())?;
    here.ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join("sarrus"))
        .find(|path| path.is_file())
        .ok_or("there is no `sarrus` yet: cargo build --release -p sarrus-server".to_owned())
}

/// A running `sarrus ask`.
struct Session {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Session {
    fn start(program: &Path, request: &str, robot: &str) -> Result<Session, String> {
        let mut child = Command::new(program)
            .args(["ask", request, "--robot", robot])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("{}: {error}", program.display()))?;
        let input = child.stdin.take();
        let output = child.stdout.take();
        let (Some(input), Some(output)) = (input, output) else {
            return Err("a process without pipes".to_owned());
        };
        Ok(Session { child, input, output: BufReader::new(output) })
    }

    /// The answer to a line.
    fn ask(&mut self, line: &[u8]) -> Result<String, String> {
        let mut answer = String::new();
        let line = [line, b"\n"].concat();
        let written = self.input.write_all(&line).and_then(|()| self.input.flush());
        let read = written.and_then(|()| self.output.read_line(&mut answer));
        match read {
            Ok(length) if length > 0 => Ok(answer),
            _ => Err(format!("`sarrus ask` ended: {:?}", self.child.try_wait())),
        }
    }

    fn check(&mut self, line: &[u8]) -> Result<u64, String> {
        let answer = self.ask(line)?;
        let about = |words: &str| format!("{words}: {answer}");
        let again = self.ask(line)?;
        law(answer == again, || about("two answers to one line"))?;

        // one object with a known status
        let members: Value =
            serde_json::from_str(&answer).map_err(|error| about(&error.to_string()))?;
        let members = members.as_object().ok_or_else(|| about("an answer that is no object"))?;
        let name = members.get("status").and_then(Value::as_str).unwrap_or_default();
        let status = Status::ALL.iter().find(|status| status.name() == name);
        let status = *status.ok_or_else(|| about("no status"))?;
        let error = members.get("error").and_then(Value::as_str);

        // a bad request has a reason and a place
        if status == Status::BadRequest {
            law(error.is_some_and(|words| !words.is_empty()), || about("no reason"))?;
            let text = String::from_utf8_lossy(line);
            let columns = text.chars().count() as u64 + 1;
            let column = members.get("column").and_then(Value::as_u64);
            law(column.is_some_and(|at| (1..=columns).contains(&at)), || about("no column"))?;
            return Ok(kind(error.unwrap_or_default()));
        }

        // numbers on success; no numbers on failure, but for the fields that survive one
        for (key, value) in members {
            let Some(field) = Field::from_name(key) else { continue };
            let survives = status == Status::Ok || field.survives_failure();
            law(survives || value.is_null(), || about("numbers of a failed answer"))?;
        }
        if status == Status::Ok {
            self.numbers_come_back(line, members)?;
        }
        Ok(status as u64 ^ (members.len() as u64) << 8)
    }

    /// A wanted y that was given comes back with its bits.
    fn numbers_come_back(
        &self,
        line: &[u8],
        members: &serde_json::Map<String, Value>,
    ) -> Result<(), String> {
        let Ok(given) = serde_json::from_slice::<Value>(line) else { return Ok(()) };
        let (Some(given), Some(answered)) = (given.get("y"), members.get("y")) else {
            return Ok(());
        };
        let numbers = |value: &Value| -> Vec<Option<f64>> {
            value.as_array().into_iter().flatten().map(Value::as_f64).collect()
        };
        // quaternions are normalised
        let is_rotation = numbers(given).len() > 6;
        let [given, answered] = [numbers(given), numbers(answered)];
        law(is_rotation || given == answered, || format!("{given:?} comes back as {answered:?}"))
    }
}
