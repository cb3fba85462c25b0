//! What `serve` logs, at which level, and that nobody has to read it.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::time::Duration;

use sarrus_client::{ConnectError, ConnectOptions, QueryOptions, Status, Transport};

use crate::support::{Asker, ROBOT, STATE, Sandbox, options};

/// One client with late answers, one that is refused; what a server with these flags logs of them.
fn logged(flags: &[&str], variable: Option<&str>) -> String {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(ROBOT, "talker", &[&["--lanes", "1"], flags].concat());
    let server = sandbox.start(match variable {
        Some(level) => command.env("SARRUS_LOG", level),
        None => command.env_remove("SARRUS_LOG"),
    });
    let deadline = Some(Duration::from_nanos(1));
    let options = ConnectOptions { transport: Transport::Lane, deadline, ..options() };
    let mut asker = Asker::new(sandbox.connect_with("talker", options).unwrap());
    for _ in 0..3 {
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
    }
    let refused = sandbox.connect("talker", Transport::Lane).err().unwrap();
    assert!(matches!(refused, ConnectError::NoFreeSlot { .. }), "{refused}");
    // late answers are looked at once a second
    std::thread::sleep(Duration::from_millis(1200));
    drop(asker);
    std::thread::sleep(Duration::from_millis(100));
    server.errors()
}

const WORDS: [&str; 8] =
    ["refused", "late", "serving", "attached", "plan registered", "detached", "stopping", "lane"];

#[test]
fn each_level_logs_what_its_help_says_and_nothing_is_logged_by_default() {
    for silent in [(&[][..], None), (&["--log", "off"], Some("debug")), (&[], Some("error"))] {
        assert_eq!(logged(silent.0, silent.1), "", "{silent:?}");
    }
    for (flags, variable, n_words) in [
        (&["--log", "warn"][..], None, 2),
        (&[], Some("info"), 7),
        (&["--log", "debug"], Some("off"), 8),
    ] {
        let log = logged(flags, variable);
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
        assert!(log.contains("NoLane { limit: 1 }") && log.contains("answers=3"), "{log}");
    }
}

#[test]
fn a_line_of_json_has_level_message_and_fields() {
    let log = logged(&["--log", "info", "--log-format", "json"], None);
    let lines: Vec<serde_json::Value> =
        log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |message: &str| lines.iter().find(|line| line["message"] == message).unwrap();
    assert_eq!(
        (&of("serving")["level"], &of("serving")["name"]),
        (&"INFO".into(), &"talker".into())
    );
    assert_eq!(of("late")["answers"], 3);
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
    // several times what a pipe holds
    let mut robot = sandbox.connect("unread", Transport::Lane).unwrap();
    let plan = robot.prepare(&STATE).unwrap();
    let other = STATE.with_options(QueryOptions::TIMES);
    for _ in 0..2000 {
        let other = robot.prepare(&other).unwrap();
        robot.release(other).unwrap();
    }
    assert!(robot.plan(plan).is_some());
    // what was lost is counted in the first line that there is room for
    let mut text = vec![0; 16 << 10];
    stderr.read_exact(&mut text).unwrap();
    let _robot = sandbox.connect("unread", Transport::Lane).unwrap();
    let mut lines = stderr.lines().map(Result::unwrap);
    let lost = lines.find_map(|line| Some(line.split_once("lines lost lines=")?.1.to_owned()));
    assert!(lost.unwrap().parse::<u32>().unwrap() > 100);
}
