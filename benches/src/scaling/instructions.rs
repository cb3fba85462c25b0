//! Instructions of a call, by this program under callgrind.

use std::process::{Child, Command, Stdio};
use std::thread::available_parallelism;

use sarrus_report::Outcome;

/// States that a counted case goes through, and how many times.
pub(super) const STATES: usize = 4;
const REPEATS: usize = 2;

/// Instructions per call of each case; none where valgrind is missing.
pub(super) fn of(names: &[String]) -> Outcome<Vec<Option<f64>>> {
    let mut counts = Vec::new();
    for some in names.chunks(available_parallelism()?.get()) {
        let Ok(running) = some.iter().map(|name| start(name)).collect::<Result<Vec<_>, _>>() else {
            eprintln!("instructions not counted: valgrind does not start");
            return Ok(vec![None; names.len()]);
        };
        for (child, name) in running.into_iter().zip(some) {
            counts.push(Some(collected(child, name)?));
        }
    }
    Ok(counts)
}

fn start(name: &str) -> std::io::Result<Child> {
    let mut command = Command::new("valgrind");
    command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    command.arg("--toggle-collect=sarrus_benches::*::passes*");
    command.arg(std::env::current_exe()?).args(["--count", name, &REPEATS.to_string()]);
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()
}

fn collected(child: Child, name: &str) -> Outcome<f64> {
    let output = child.wait_with_output()?;
    let text = String::from_utf8_lossy(&output.stderr);
    let line = text.lines().find_map(|line| line.split_once("Collected :"));
    let count = line.and_then(|(_, count)| count.trim().parse::<f64>().ok());
    let count = count.filter(|count| *count > 0.0 && output.status.success());
    let last = text.lines().last().unwrap_or_default();
    let count = count.ok_or_else(|| format!("{name} is not counted: {last}"))?;
    Ok(count / (STATES * REPEATS) as f64)
}
