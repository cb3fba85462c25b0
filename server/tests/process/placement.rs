//! Processors, priorities and memory of a served process, as the kernel sees them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use sarrus_client::{Status, Transport};

use crate::supervise::answering_thread;
use crate::support::{Asker, ROBOT, Sandbox, Server};

/// The words of a thread's `stat` from the third on: its policy is the 41st, its priority the 40th,
/// its page faults the 10th and the 12th.
fn stat(task: &Path) -> Vec<u64> {
    let stat = fs::read_to_string(task.join("stat")).unwrap();
    let (_, rest) = stat.rsplit_once(')').unwrap();
    rest.split_whitespace().map(|word| word.parse().unwrap_or(u64::MAX)).collect()
}

/// Policy and real-time priority.
fn policy(task: &Path) -> (u64, u64) {
    let words = stat(task);
    (words[38], words[37])
}

fn faults(task: &Path) -> u64 {
    let words = stat(task);
    words[7] + words[9]
}

fn processors(task: &Path) -> String {
    let status = fs::read_to_string(task.join("status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
    line.trim().to_owned()
}

fn main_thread(server: &Server) -> std::path::PathBuf {
    format!("/proc/{0}/task/{0}", server.id()).into()
}

/// Whether a program can be run here; prints the reason where it cannot.
fn works(program: &str, arguments: &[&str]) -> bool {
    let outcome = Command::new(program).args(arguments).output();
    let works = outcome.as_ref().is_ok_and(|output| output.status.success());
    if !works {
        println!("not run: `{program} {}`: {outcome:?}", arguments.join(" "));
    }
    works
}

/// The server started by another program, which replaces itself by it.
fn by(sandbox: &Sandbox, program: &[&str], flags: &[&str]) -> Command {
    let inner = sandbox.command(ROBOT, "placed", flags);
    let mut command = Command::new(program[0]);
    command.args(&program[1..]).arg(inner.get_program()).args(inner.get_args());
    command.env("SARRUS_ROOT", sandbox.domain().root());
    command
}

fn refused(output: &Output, words: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "{word}: {stderr}");
    }
}

#[test]
fn polling_on_the_only_processor_under_a_real_time_policy_is_refused_before_it_starts() {
    let sandbox = Sandbox::new();
    let starved = ["processor 0 is the only one", "--wait sleep", "second processor"];
    if works("taskset", &["-c", "0", "chrt", "-f", "1", "true"]) {
        let program = ["taskset", "-c", "0", "chrt", "-f", "1"];
        refused(&by(&sandbox, &program, &["--wait", "busy"]).output().unwrap(), &starved);
        let flags = ["--wait", "busy", "--cpu", "0"];
        refused(&by(&sandbox, &program, &flags).output().unwrap(), &starved);
        let flags = ["--wait", "busy", "--priority", "1"];
        refused(&by(&sandbox, &program[..3], &flags).output().unwrap(), &starved);
        // supervised, it is refused all the same
        let flags = ["--wait", "busy", "--supervise"];
        refused(&by(&sandbox, &program, &flags).output().unwrap(), &starved);
    }
}

#[test]
fn only_the_answering_thread_keeps_an_inherited_real_time_policy() {
    if !works("chrt", &["-f", "1", "true"]) {
        return;
    }
    let sandbox = Sandbox::new();
    let program = ["chrt", "-f", "1"];
    let server = sandbox.start(&mut by(&sandbox, &program, &["--wait", "sleep"]));
    let hot = answering_thread(server.id()).unwrap();
    assert_eq!((policy(&hot), policy(&main_thread(&server))), ((1, 1), (0, 0)));
    let mut asker = Asker::new(sandbox.connect("placed", Transport::Lane).unwrap());
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    assert!(server.stop().success());
}

#[test]
fn the_answering_thread_alone_has_the_processor_and_the_priority() {
    let sandbox = Sandbox::new();
    // the last of the processors of this process
    let own =
        processors(Path::new("/proc/self/task").join(std::process::id().to_string()).as_ref());
    let cpu = own.rsplit([',', '-']).next().unwrap();
    let server = sandbox.serve("placed", &["--wait", "sleep", "--cpu", cpu]);
    let hot = answering_thread(server.id()).unwrap();
    assert_eq!(processors(&hot), cpu);
    if own != cpu {
        let rest = processors(&main_thread(&server));
        assert!(!rest.split([',', '-']).any(|one| one == cpu), "{rest} and {cpu} of {own}");
    }
    assert!(server.stop().success());

    if works("chrt", &["-f", "7", "true"]) {
        let server = sandbox.serve("placed", &["--wait", "sleep", "--priority", "7"]);
        let hot = answering_thread(server.id()).unwrap();
        assert_eq!((policy(&hot), policy(&main_thread(&server))), ((1, 7), (0, 0)));
        assert!(server.stop().success());
    }
    let output = sandbox.command(ROBOT, "placed", &["--cpu", "1000"]).output().unwrap();
    refused(&output, &["processor 1000 cannot be had", "choose one of them with --cpu"]);
    assert_eq!(sandbox.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn missing_rights_are_named_with_their_limit() {
    let rights = ["--bounding-set", "-sys_nice,-ipc_lock", "--inh-caps", "-all"];
    let program =
        [&["prlimit", "--rtprio=0:0", "--memlock=65536:65536", "setpriv"], &rights[..]].concat();
    if !works(program[0], &[&program[1..], &["true"]].concat()) {
        return;
    }
    let sandbox = Sandbox::new();
    let run = |flags: &[&str]| by(&sandbox, &program, flags).output().unwrap();
    let words = ["priority 80", "RLIMIT_RTPRIO is 0", "CAP_SYS_NICE", "LimitRTPRIO=80"];
    refused(&run(&["--priority", "80"]), &words);
    let words = ["RLIMIT_MEMLOCK is 65536 bytes", "CAP_IPC_LOCK", "LimitMEMLOCK=infinity"];
    refused(&run(&["--lock-memory"]), &words);
}

#[test]
fn with_locked_memory_the_answering_thread_meets_no_page_fault() {
    let sandbox = Sandbox::new();
    let output = sandbox.command(ROBOT, "locked", &["--lock-memory", "--cpu", "1000"]).output();
    let words = String::from_utf8(output.unwrap().stderr).unwrap();
    if words.contains("memory cannot be locked") {
        println!("not run: {words}");
        return;
    }
    let mut found = Vec::new();
    for flags in [&["--lock-memory"][..], &[]] {
        let server = sandbox.serve("locked", flags);
        let hot = answering_thread(server.id()).unwrap();
        let before = faults(&hot);
        // lanes, plans and requests all come after `ready`
        let mut askers =
            [0, 1].map(|_| Asker::new(sandbox.connect("locked", Transport::Lane).unwrap()));
        for _ in 0..2000 {
            for asker in &mut askers {
                assert_eq!(asker.ask().unwrap().status, Status::Ok);
            }
        }
        found.push(faults(&hot) - before);
        drop(askers);
        assert!(server.stop().success());
    }
    println!("page faults of the answering thread, memory locked and not: {found:?}");
    assert_eq!(found[0], 0);
}

#[test]
fn systemd_accepts_the_unit() {
    let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("systemd/sarrus@.service");
    if !works("systemd-analyze", &["--version"]) {
        return;
    }
    // an instance of it, with this program where a package would put it
    let text = fs::read_to_string(unit).unwrap();
    let installed = "/usr/bin/sarrus";
    assert!(text.contains(installed));
    let text = text.replace(installed, env!("CARGO_BIN_EXE_sarrus"));
    let folder = std::env::temp_dir().join(format!("sarrus-unit-{}", std::process::id()));
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("sarrus@elbow.service"), text).unwrap();
    let mut command = Command::new("systemd-analyze");
    command.args(["verify", "--man=no"]).arg(folder.join("sarrus@elbow.service"));
    let output = command.output().unwrap();
    fs::remove_dir_all(&folder).unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    // other units of the machine may have faults of their own
    let ours: Vec<&str> = words.lines().filter(|line| line.contains("sarrus")).collect();
    assert!(ours.is_empty(), "{words}");
    assert!(output.status.success() || !words.is_empty(), "{output:?}");
}
