//! The log of `serve`: its levels, and a log that is not read.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

use sarrus_client::{ConnectError, ConnectOptions, QueryOptions, Status, Transport};

use crate::support::{Asker, ROBOT, STATE, Sandbox, options};

/// Answers that are late by the client's deadline.
const LATE: u64 = 3;

/// The log of a server with these flags: one client has late answers, another one is refused.
/// `awaited` are events that it logs in its own time: answers were `late`, both have `detached`.
fn logged(flags: &[&str], variable: Option<&str>, awaited: &[&str]) -> String {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(ROBOT, "talker", &[&["--lanes", "1"], flags].concat());
    let server = sandbox.start(match variable {
        Some(level) => command.env("SARRUS_LOG", level),
        None => command.env_remove("SARRUS_LOG"),
    });
    let deadline = Some(Duration::from_nanos(1));
    let options = ConnectOptions { transport: Transport::Lane, deadline, ..options() };
    let mut asker = Asker::new(sandbox.connect_with("talker", options).unwrap());
    for _ in 0..LATE {
        assert_eq!(asker.ask().unwrap().status, Status::Late);
    }
    let refused = sandbox.connect("talker", Transport::Lane).err().unwrap();
    assert!(matches!(refused, ConnectError::NoFreeSlot { .. }), "{refused}");
    let mut late = 0;
    let mut detached = 0;
    let mut log = Vec::new();
    let mut wait = |what: &str, log: &mut Vec<String>| {
        let mut last = |line: &str| {
            late += answers_late(line);
            detached += u32::from(line.contains("detached"));
            if what == "late" { late == LATE } else { detached == 2 }
        };
        if awaited.contains(&what) {
            log.extend(server.lines_to(what, &mut last));
        }
    };
    wait("late", &mut log);
    drop(asker);
    wait("detached", &mut log);
    log.iter().map(|line| format!("{line}\n")).collect::<String>() + &server.errors()
}

/// The answers that a line reports as late, as text or JSON.
fn answers_late(line: &str) -> u64 {
    let number = |rest: &str| {
        rest.split(|letter: char| !letter.is_ascii_digit()).find_map(|word| word.parse().ok())
    };
    line.split_once("answers").and_then(|(_, rest)| number(rest)).unwrap_or(0)
}

const WORDS: [&str; 8] =
    ["refused", "late", "serving", "attached", "plan registered", "detached", "stopping", "lane"];

#[test]
fn each_level_logs_what_its_help_says_and_nothing_is_logged_by_default() {
    for silent in [(&[][..], None), (&["--log", "off"], Some("debug")), (&[], Some("error"))] {
        assert_eq!(logged(silent.0, silent.1, &[]), "", "{silent:?}");
    }
    for (flags, variable, awaited, n_words) in [
        (&["--log", "warn"][..], None, &["late"][..], 2),
        (&[], Some("info"), &["late", "detached"], 7),
        (&["--log", "debug"], Some("off"), &["late", "detached"], 8),
    ] {
        let log = logged(flags, variable, awaited);
        // time, level, words, key=value
        let words: BTreeSet<&str> = log
            .lines()
            .map(|line| {
                let mut columns = line.split_whitespace();
                assert!(columns.next().unwrap().ends_with('Z'), "{line}");
                let level = columns.next().unwrap();
                assert!(["WARN", "INFO", "DEBUG"].contains(&level), "{line}");
                let rest = line.split_once(level).unwrap().1.trim_start();
                WORDS.into_iter().find(|word| rest.starts_with(&format!("{word} "))).unwrap_or(line)
            })
            .collect();
        assert_eq!(words, WORDS[..n_words].iter().copied().collect(), "{log}");
        assert!(log.contains("NoLane { limit: 1 }"), "{log}");
        assert_eq!(log.lines().map(answers_late).sum::<u64>(), LATE, "{log}");
    }
}

#[test]
fn a_line_of_json_has_level_message_and_fields() {
    let flags = ["--log", "info", "--log-format", "json"];
    let log = logged(&flags, None, &["late", "detached"]);
    let lines: Vec<serde_json::Value> =
        log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |message: &str| lines.iter().find(|line| line["message"] == message).unwrap();
    assert_eq!(
        (&of("serving")["level"], &of("serving")["name"]),
        (&"INFO".into(), &"talker".into())
    );
    assert!(of("late")["answers"].as_u64().unwrap() > 0);
    assert_eq!(of("attached")["process"], std::process::id());
    assert!(of("plan registered")["n_in"].as_u64().unwrap() > 0);
}

#[test]
fn an_unknown_level_is_refused() {
    let sandbox = Sandbox::new();
    for (flags, variable) in [(&["--log", "loud"][..], ""), (&[], "loud")] {
        let mut command = sandbox.command(ROBOT, "loud", flags);
        let output = command.env("SARRUS_LOG", variable).output().unwrap();
        let words = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
        assert!(words.contains("expected off, error, warn, info or debug"), "{words}");
    }
}

#[test]
fn a_log_that_nobody_reads_keeps_no_client_from_attaching() {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(ROBOT, "unread", &["--log", "debug"]);
    let (_server, stderr) = sandbox.start_unread(&mut command);
    let mut stderr = BufReader::new(stderr);
    // several times the size of a pipe
    let mut robot = sandbox.connect("unread", Transport::Lane).unwrap();
    let plan = robot.prepare(&STATE).unwrap();
    let other = STATE.with_options(QueryOptions::TIMES);
    for _ in 0..2000 {
        let other = robot.prepare(&other).unwrap();
        robot.release(other).unwrap();
    }
    assert!(robot.plan(plan).is_some());
    // the first line with room has the number of lost lines
    let mut text = vec![0; 16 << 10];
    stderr.read_exact(&mut text).unwrap();
    let _robot = sandbox.connect("unread", Transport::Lane).unwrap();
    let mut lines = stderr.lines().map(Result::unwrap);
    let lost = lines.find_map(|line| Some(line.split_once("lines lost lines=")?.1.to_owned()));
    assert!(lost.unwrap().parse::<u32>().unwrap() > 100);
}
