//! `ask --connect` and `demo`: other processes, and the files they leave. Tests run one at a time.

use std::io::{BufRead, BufReader, Lines, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use sarrus_proto::Domain;
use sarrus_tests::reference::vectors;

use super::vectors::lines;
use super::{Run, run, sarrus, subset};
use crate::examples::signal;

/// A test's domain.
struct Place {
    root: PathBuf,
    prefix: String,
    _alone: MutexGuard<'static, ()>,
}

impl Place {
    fn new() -> Place {
        static ALONE: Mutex<()> = Mutex::new(());
        static PLACES: AtomicU32 = AtomicU32::new(0);
        let alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let root = std::env::temp_dir().join(format!(
            "sarrus-ask-{}-{}",
            std::process::id(),
            PLACES.fetch_add(1, Relaxed)
        ));
        let prefix = Domain::at(&root).unwrap().prefix();
        Place { root, prefix, _alone: alone }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(sarrus());
        command
            .args(arguments)
            .env("SARRUS_ROOT", &self.root)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn serve(&self, robot: &str, name: &str) -> Process {
        let mut server =
            Process::start(&mut self.command(&["serve", "--robot", robot, "--name", name]));
        let ready = server.line();
        assert!(ready.starts_with(&format!("ready {name} ")), "{ready}");
        server
    }

    fn leftovers(&self) -> Vec<PathBuf> {
        let shared =
            std::fs::read_dir("/dev/shm").into_iter().flatten().flatten().map(|entry| entry.path());
        let ours = shared
            .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(&self.prefix));
        ours.chain(self.root.exists().then(|| self.root.clone())).collect()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for path in self.leftovers() {
            let _ = if path.is_dir() {
                std::fs::remove_dir_all(&path)
            } else {
                std::fs::remove_file(&path)
            };
        }
    }
}

/// A process with pipes; killed when dropped.
struct Process {
    child: Child,
    stdin: Option<ChildStdin>,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Process {
    fn start(command: &mut Command) -> Process {
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Process { stdin: child.stdin.take(), child, lines }
    }

    fn line(&mut self) -> String {
        self.lines.next().unwrap().unwrap()
    }

    fn ask(&mut self, line: &str) -> String {
        writeln!(self.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.line()
    }

    fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }

    fn end(&mut self) -> ExitStatus {
        drop(self.stdin.take());
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(20) {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("it does not end");
    }

    fn stop(mut self) {
        self.signal("-TERM");
        assert!(self.end().success());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn through_a_server_the_text_is_the_same() {
    let place = Place::new();
    let odd = "bad\n{\"y\":[1]}\n{\"yy\":1}\n{\"y\":[1e999]}\n\n{\"u\":[9]}\n\
        {\"want\":[\"q\"],\"u\":[1e9]}\n[]\n{\"y\":[2,2],\"search\":true,\"deadline_us\":90000000}\n\
        {\"y\":[2,2]}\n{\"search\":1}\n{\"deadline_us\":0}\n";
    for robot in ["torso", "wrist", "rh5v2_upper_body"] {
        let server = place.serve(robot, "same");
        let file = vectors(robot);
        let frames = format!(
            "{{\"y\":{},\"frames\":[{:?}],\"want\":[\"jacobians\",\"G_u\"]}}\n",
            file["cases"][0]["y"],
            link(robot)
        );
        for request in ["kinematics", "inverse-dynamics", "forward-dynamics", "map"] {
            let text = lines(&file, request) + odd + &frames;
            let here = run(&["ask", request, "--robot", robot], text.as_bytes());
            let there = Run::of(
                &mut place.command(&["ask", request, "--connect", "same"]),
                text.as_bytes(),
            );
            assert_eq!(here.code, there.code);
            assert_eq!(here.out, there.out, "{robot} {request}");
            assert_eq!((here.err.as_str(), there.err.as_str()), ("", ""));
            // several lines at a time
            for flags in [["--robot", robot], ["--connect", "same"]] {
                let command = [&["ask", request, "--batch", "50"][..], &flags].concat();
                let together = Run::of(&mut place.command(&command), text.as_bytes());
                assert_eq!((together.code, together.err.as_str()), (here.code, ""));
                assert!(together.out == here.out, "{robot} {request} {flags:?}");
            }
        }
        if robot == "torso" {
            let along = r#""y":[0.1,0.2],"yd":[1,-1],"direction":{"y":[1,2],"yd":[3,4]}"#;
            let observe = r#"{"y":[0.1,0.2],"yd":[1,-1],"tau_u":[3,4],"dt":0.1,"gain":9,
                "observer":[[1,2,3],[4,5,6]]}"#;
            let inverse = format!(r#"{{{along},"want":["tau_u","d2_tau_y_v","base_parameters"]}}"#);
            let forward = r#""tau_u":[3,4],"multipliers":[5,6],"want":["d2_ydd_v"]"#;
            let lines = [
                ("observe", observe.replace('\n', "")),
                ("inverse-dynamics", inverse),
                ("forward-dynamics", format!("{{{along},{forward}}}")),
            ];
            for (request, line) in lines {
                let text = (line + "\n").repeat(3);
                let here = run(&["ask", request, "--robot", robot], text.as_bytes());
                assert_eq!(here.out.matches("\"status\":\"ok\"").count(), 3, "{}", here.out);
                for flags in [&["--connect", "same"][..], &["--connect", "same", "--batch", "3"]] {
                    let command = [&["ask", request][..], flags].concat();
                    let there = Run::of(&mut place.command(&command), text.as_bytes());
                    assert_eq!((here.code, &here.out), (Some(0), &there.out));
                }
            }
        }
        let top = Run::of(&mut place.command(&["top", "same", "--format", "json"]), b"");
        assert!(top.json()[0]["requests"]["batch"].as_u64().unwrap() > 0, "{}", top.out);
        server.stop();
    }
    assert_eq!(place.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn a_state_that_takes_longer_than_its_deadline_is_late_through_a_server() {
    let place = Place::new();
    let server = place.serve("wrist", "late");
    // hundreds of microseconds
    let line = |deadline: &str| {
        format!("{{\"y\":[2,2],\"want\":[\"nearest_y\"],\"search\":true{deadline}}}\n")
    };
    let text = line("") + &line(",\"deadline_us\":1") + &line(",\"deadline_us\":100000000");
    for (flags, expected) in [
        (["--robot", "wrist"], ["unreachable", "unreachable", "unreachable"]),
        (["--connect", "late"], ["unreachable", "late", "unreachable"]),
    ] {
        for batch in ["1", "3"] {
            let command = [&["ask", "kinematics", "--batch", batch][..], &flags].concat();
            let answers = Run::of(&mut place.command(&command), text.as_bytes()).json();
            let statuses: Vec<&str> =
                answers.iter().map(|answer| answer["status"].as_str().unwrap()).collect();
            assert_eq!(statuses, expected, "{flags:?}");
            for (answer, status) in answers.iter().zip(statuses) {
                assert_eq!(answer["nearest_y"].is_null(), status == "late", "{answer}");
            }
        }
    }
    server.stop();
}

/// A moving link.
fn link(robot: &str) -> &'static str {
    let urdf = sarrus_models::bundled_text(robot).unwrap().0;
    urdf.split("<child link=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap()
}

#[test]
fn without_a_server_there_is_nothing_to_ask() {
    let place = Place::new();
    let refused =
        Run::of(&mut place.command(&["ask", "kinematics", "--connect", "nobody"]), b"{\"y\":[0]}");
    assert_eq!((refused.code, refused.out.as_str()), (Some(2), ""));
    let root = place.root.display();
    assert_eq!(
        refused.err,
        format!(
            "sarrus ask: no server named `nobody` runs below {root}; start one with `sarrus serve \
             --name nobody`, or name its folder in SARRUS_ROOT\n"
        )
    );
    let refused = Run::of(&mut place.command(&["ask", "kinematics", "--connect", "no/body"]), b"");
    assert_eq!((refused.code, refused.out.as_str()), (Some(2), ""));
    assert_eq!(place.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn lines_that_a_server_leaves_are_told_and_a_new_one_takes_over() {
    let place = Place::new();
    let server = place.serve("lambda", "gone");
    let mut asking =
        Process::start(&mut place.command(&["ask", "kinematics", "--connect", "gone"]));
    let line = r#"{"y":[0.1],"want":["y"]}"#;
    let good = r#"{"status":"ok","warnings":[],"y":[0.1]}"#;
    assert_eq!(asking.ask(line), good);
    server.stop();
    for _ in 0..3 {
        assert!(asking.ask(line).starts_with(
            r#"{"status":"shutting_down","warnings":[],"y":null,"error":"the server `gone` is gone"#
        ));
    }
    let until = |asking: &mut Process, start: &str| {
        let begin = Instant::now();
        while !asking.ask(line).starts_with(start) {
            assert!(begin.elapsed() < Duration::from_secs(10), "no {start}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let server = place.serve("lambda", "gone");
    until(&mut asking, good);
    server.stop();
    let server = place.serve("parallelogram", "gone");
    until(&mut asking, r#"{"status":"wrong_model","warnings":[],"y":null,"error":"#);
    assert_eq!(asking.end().code(), Some(2));
    server.stop();
    assert_eq!(place.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn more_queries_than_a_server_holds_plans_are_all_answered() {
    let place = Place::new();
    let server = place.serve("lambda", "plans");
    let text: String = (0..1026).chain([7]).map(|k| subset(k) + "\n").collect();
    let answer =
        Run::of(&mut place.command(&["ask", "kinematics", "--connect", "plans"]), text.as_bytes());
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""));
    let statuses = answer.statuses();
    assert_eq!(statuses.len(), 1027);
    assert!(statuses.iter().all(|status| status == "ok"));
    server.stop();
}

#[test]
fn more_askers_than_lanes_are_answered_through_the_service() {
    let place = Place::new();
    let mut server = Process::start(
        &mut place.command(&["serve", "--robot", "lambda", "--name", "full", "--lanes", "1"]),
    );
    server.line();
    let mut askers: Vec<Process> = (0..3)
        .map(|_| Process::start(&mut place.command(&["ask", "map", "--connect", "full"])))
        .collect();
    for asker in &mut askers {
        assert_eq!(
            asker.ask(r#"{"y":[0.1],"want":["y"]}"#),
            r#"{"status":"ok","warnings":[],"y":[0.1]}"#
        );
    }
    for asker in &mut askers {
        assert!(asker.end().success());
    }
    server.stop();
}

#[test]
fn the_demo_is_good_and_leaves_a_page_alone() {
    let place = Place::new();
    let temporary = place.root.with_extension("pages");
    std::fs::create_dir_all(&temporary).unwrap();
    let mut command = place.command(&["demo", "--format", "json"]);
    let demo = Run::of(command.env("TMPDIR", &temporary), b"");
    assert_eq!((demo.code, demo.err.as_str()), (Some(0), ""), "{demo:?}");
    let report = demo.json().remove(0);
    assert_eq!(
        (report["robot"].as_str(), report["good"].as_bool()),
        (Some("rh5v2_upper_body"), Some(true))
    );
    assert!(report["worst_error"].as_f64().unwrap() < 1e-12);
    let ways: Vec<&str> =
        report["ways"].as_array().unwrap().iter().map(|way| way["way"].as_str().unwrap()).collect();
    assert_eq!(ways[..2], ["lane", "service"]);
    assert!(
        report["ways"]
            .as_array()
            .unwrap()
            .iter()
            .all(|way| way["requests"].as_u64().unwrap() >= 5001 && way["failed"] == 0)
    );
    assert_eq!(place.leftovers(), Vec::<PathBuf>::new());
    let page = Path::new(report["page"].as_str().unwrap());
    let text = std::fs::read_to_string(page).unwrap();
    assert!(text.starts_with("<!DOCTYPE html>") && text.contains("rh5v2_upper_body"));
    let left: Vec<_> = std::fs::read_dir(&temporary).unwrap().flatten().collect();
    assert_eq!((left.len(), left[0].path().as_path()), (1, page));
    std::fs::remove_dir_all(temporary).unwrap();
}

#[test]
fn an_interrupted_demo_leaves_nothing_behind() {
    let place = Place::new();
    for signal in ["-INT", "-TERM", "-HUP"] {
        let mut demo = Process::start(&mut place.command(&["demo"]));
        // the server exists or will start soon
        let start = Instant::now();
        while !processes().iter().any(|line| line.contains(&format!("demo-{}", demo.child.id()))) {
            assert!(
                start.elapsed() < Duration::from_secs(30)
                    && demo.child.try_wait().unwrap().is_none(),
                "no server comes"
            );
            std::thread::sleep(Duration::from_millis(5));
        }
        demo.signal(signal);
        assert_eq!(demo.end().code(), Some(130), "{signal}");
        assert!(
            !processes().iter().any(|line| line.contains(&format!("demo-{}", demo.child.id()))),
            "{signal}"
        );
        assert_eq!(place.leftovers(), Vec::<PathBuf>::new(), "{signal}");
    }
}

/// The command lines of all processes.
fn processes() -> Vec<String> {
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    entries
        .filter_map(|entry| std::fs::read(entry.path().join("cmdline")).ok())
        .map(|line| String::from_utf8_lossy(&line).into_owned())
        .collect()
}
