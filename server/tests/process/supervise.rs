//! A supervised server: killed, it is back; stopped, nothing remains; hopeless, it is given up.

use std::fs;
use std::io::{BufRead, BufReader, PipeReader, PipeWriter, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use sarrus_client::{Status, Transport};
use sarrus_proto::{ServerName, supervision};

use sarrus_torture::patience::LIMIT;
use sarrus_torture::process::{Process, send_signal};

use crate::support::{Asker, ROBOT, Sandbox, Server};

pub(crate) fn until<T>(what: &str, mut probe: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    while start.elapsed() < LIMIT {
        if let Some(found) = probe() {
            return found;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what}: not within {LIMIT:?}");
}

/// The child processes of a process, without zombies.
fn children(parent: u32) -> Vec<u32> {
    let is_child = |process: &u32| {
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        let rest = stat.rsplit_once(')').map(|(_, rest)| rest.to_owned()).unwrap_or_default();
        let mut words = rest.split_whitespace();
        words.next() != Some("Z") && words.next() == Some(&parent.to_string())
    };
    let entries = fs::read_dir("/proc").unwrap().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_child).collect()
}

/// The thread that answers in a process.
pub(crate) fn answering_thread(process: u32) -> Option<PathBuf> {
    let tasks = fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    tasks.map(|task| task.path()).find(|task| {
        fs::read_to_string(task.join("comm")).is_ok_and(|name| name.trim() == "sarrus-hot")
    })
}

/// The process that serves under a supervisor.
pub(crate) fn serving(supervisor: u32) -> u32 {
    until("a process that serves", || {
        children(supervisor).into_iter().find(|child| answering_thread(*child).is_some())
    })
}

pub(crate) fn kill(process: u32) {
    send_signal(process, Signal::KILL);
}

/// The process that serves after another one, once clients can attach.
fn next_server(sandbox: &Sandbox, name: &str, last: u32) -> u32 {
    until("the next server", || {
        let robot = sandbox.connect(name, Transport::Lane).ok()?;
        let process = robot.statistics()?.process as u32;
        (process != last).then_some(process)
    })
}

fn name(text: &str) -> ServerName {
    ServerName::new(text).unwrap()
}

pub(crate) fn supervised(sandbox: &Sandbox, name: &str, flags: &[&str]) -> Server {
    sandbox.serve(name, &[&["--supervise"], flags].concat())
}

#[test]
fn ready_is_printed_once_for_all_servers_of_a_supervisor() {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(ROBOT, "once", &["--supervise", "--short-life", "0"]);
    let child = command.spawn().unwrap();
    let mut process = 0;
    for _ in 0..3 {
        process = next_server(&sandbox, "once", process);
        kill(process);
    }
    next_server(&sandbox, "once", process);
    send_signal(child.id(), Signal::INT);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let words = String::from_utf8(output.stdout).unwrap();
    assert_eq!(words.lines().count(), 1, "{words}");
    assert!(words.starts_with("ready once "), "{words}");
    // a line for each death, with its cause and the lifetime
    let words = String::from_utf8(output.stderr).unwrap();
    let deaths = words.lines().filter(|line| line.contains("was killed by signal 9 after "));
    assert_eq!(deaths.count(), 3, "{words}");
}

/// Three servers of a supervisor with this stderr, then a clean stop.
fn three_servers(name: &str, stderr: PipeWriter) {
    let sandbox = Sandbox::new();
    let mut command = sandbox.command(ROBOT, name, &["--supervise", "--short-life", "0"]);
    let mut child = command.stderr(stderr).spawn().unwrap();
    let mut process = 0;
    for _ in 0..3 {
        process = next_server(&sandbox, name, process);
        kill(process);
    }
    next_server(&sandbox, name, process);
    send_signal(child.id(), Signal::TERM);
    let status = until("the supervisor's end", || child.try_wait().unwrap());
    assert_eq!(status.code(), Some(0), "{status:?}");
}

/// The reading end of a pipe, and its writing end without room.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (unread, mut full) = std::io::pipe().unwrap();
    rustix::io::ioctl_fionbio(&full, true).unwrap();
    while full.write(&[b'x'; 4096]).is_ok() {}
    rustix::io::ioctl_fionbio(&full, false).unwrap();
    (unread, full)
}

#[test]
fn a_closed_stderr_ends_no_supervisor() {
    let (_, closed) = std::io::pipe().unwrap();
    three_servers("closed", closed);
}

#[test]
fn a_full_stderr_stops_no_supervisor() {
    let (unread, full) = full_pipe();
    three_servers("full", full);
    drop(unread);
}

#[test]
fn a_server_that_refuses_with_a_full_stderr_is_given_up() {
    let sandbox = Sandbox::new();
    let root = sandbox.make_root();
    let (unread, stderr) = full_pipe();
    let mut command = sandbox.command(ROBOT, "mute", &["--supervise"]);
    let mut child = command.stdout(Stdio::null()).stderr(stderr).spawn().unwrap();
    let process = next_server(&sandbox, "mute", 0);
    // a file in place of the domain's folder
    let away = root.with_extension("away");
    fs::rename(&root, &away).unwrap();
    fs::write(&root, "").unwrap();
    kill(process);
    let status = until("the supervisor's end", || child.try_wait().unwrap());
    assert_eq!(status.code(), Some(2), "{status:?}");
    fs::remove_dir_all(&away).unwrap();
    drop(unread);
}

#[test]
fn clients_go_on_when_the_server_is_killed() {
    let sandbox = Sandbox::new();
    let server = supervised(&sandbox, "cat", &["--short-life", "0"]);
    for transport in [Transport::Lane, Transport::Service] {
        let mut asker = Asker::new(sandbox.connect("cat", transport).unwrap());
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        let bits = asker.bits();
        let mut gaps: Vec<Duration> = (0..10)
            .map(|_| {
                assert_eq!(asker.ask().unwrap().status, Status::Ok);
                let process = serving(server.id());
                let start = Instant::now();
                kill(process);
                let _ =
                    until("an answer", || asker.ask().ok().filter(|one| one.status == Status::Ok));
                assert_eq!(asker.bits(), bits);
                start.elapsed()
            })
            .collect();
        gaps.sort();
        println!("{transport:?}: from the kill to the next answer, sorted: {gaps:.1?}");
    }
    assert!(server.stop().success());
}

/// A pendulum of this mass.
fn pendulum(mass: f64) -> String {
    let inertial = format!(
        r#"<inertial><origin xyz="0 0 -0.5"/><mass value="{mass}"/>
        <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"#
    );
    format!(
        r#"<robot name="pendulum"><link name="base"/><link name="bar">{inertial}</link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="bar"/>
        <axis xyz="0 1 0"/></joint></robot>"#
    )
}

#[test]
fn the_robot_that_was_announced_is_served_again_whatever_its_files_say() {
    let sandbox = Sandbox::new();
    let root = sandbox.make_root();
    let [urdf, record] = ["pendulum.urdf", "pendulum.rec"].map(|name| root.join(name));
    fs::write(&urdf, pendulum(1.0)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
    command.args(["serve", "--name", "filed", "--supervise", "--short-life", "0", "--lanes", "1"]);
    command.args(["--record-seconds", "1", "--record"]).arg(&record);
    let server = sandbox.start(command.arg("--urdf").arg(&urdf));
    let fingerprint = server.ready.trim_end().rsplit(' ').next().unwrap();
    let mut process = serving(server.id());
    for text in [pendulum(2.0), pendulum(3.0), "no robot".to_owned()] {
        fs::write(&urdf, text).unwrap();
        kill(process);
        server.wait_for_line("the robot's files have changed; the robot as first loaded is served");
        process = next_server(&sandbox, "filed", process);
        let robot = sandbox.connect("filed", Transport::Lane).unwrap();
        assert_eq!(format!("{:016x}", robot.model().fingerprint), fingerprint);
    }
    fs::remove_file(&urdf).unwrap();
    kill(process);
    next_server(&sandbox, "filed", process);
    // a recording holds the robot that is served
    let (code, _, words) = sandbox.sarrus(&["replay", record.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{words}");
    assert!(server.stop().success());
    for n in ["", ".1", ".2", ".3", ".4"] {
        let _ = fs::remove_file(format!("{}{n}", record.display()));
    }
}

/// Two joints, and their coupling by a further file.
const PAIR: &str = r#"<robot name="pair"><link name="base"/><link name="one"/>
    <link name="two"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
    <joint name="a" type="continuous"><parent link="base"/><child link="one"/>
    <axis xyz="0 1 0"/></joint><joint name="b" type="continuous"><parent link="one"/>
    <child link="two"/><axis xyz="0 1 0"/></joint></robot>"#;
const COUPLED: &str = "submechanisms: [{name: t, type: TRANSMISSION, contextual_name: t, \
    file_path: more.urdf, jointnames: [a, b], jointnames_active: [a], \
    jointnames_independent: [a], jointnames_spanningtree: [a, b]}]";

/// The further file, with this ratio.
fn coupling(ratio: u32) -> String {
    format!(
        r#"<robot name="more"><joint name="b"><mimic joint="a" multiplier="{ratio}"/></joint>
        </robot>"#
    )
}

#[test]
fn a_robot_of_further_files_is_given_up_when_these_change() {
    let sandbox = Sandbox::new();
    let root = sandbox.make_root();
    let files = ["pair.urdf", "pair.yml", "more.urdf"].map(|name| root.join(name));
    fs::write(&files[0], PAIR).unwrap();
    fs::write(&files[1], COUPLED).unwrap();
    fs::write(&files[2], coupling(2)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
    command.args(["serve", "--name", "more", "--supervise", "--short-life", "0", "--urdf"]);
    let server = sandbox.start(command.arg(&files[0]).arg("--submechanisms").arg(&files[1]));
    fs::write(&files[2], coupling(3)).unwrap();
    kill(serving(server.id()));
    let reason = "the robot's files have changed (fingerprint ";
    server.wait_for_line(reason);
    server.wait_for_line("given up: five times within a minute");
    let reason_of_clients = supervision::given_up(&root, &name("more")).unwrap();
    assert!(reason_of_clients.contains(reason), "{reason_of_clients}");
    files.iter().for_each(|file| fs::remove_file(file).unwrap());
    drop(server);
    assert!(sandbox.serve("more", &[]).stop().success());
}

#[test]
fn a_stop_of_the_supervisor_leaves_nothing() {
    for signal in [Signal::TERM, Signal::INT] {
        let sandbox = Sandbox::new();
        let server = supervised(&sandbox, "stop", &[]);
        let mut asker = Asker::new(sandbox.connect("stop", Transport::Lane).unwrap());
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        let processes = children(server.id());
        drop(asker);
        assert!(server.stop_by(signal).success());
        for process in processes {
            assert!(!fs::exists(format!("/proc/{process}")).unwrap(), "{process}");
        }
        assert_eq!(sandbox.leftovers(), Vec::<PathBuf>::new());
    }
}

#[test]
fn a_stop_between_two_servers_leaves_nothing() {
    for _ in 0..3 {
        let sandbox = Sandbox::new();
        let server = supervised(&sandbox, "gap", &[]);
        let [process] = children(server.id())[..] else { panic!("one server") };
        kill(process);
        until("the next server", || {
            let next = children(server.id());
            (!next.is_empty() && !next.contains(&process)).then_some(())
        });
        assert!(server.stop().success());
        assert_eq!(sandbox.leftovers(), Vec::<PathBuf>::new());
    }
}

#[test]
fn the_server_dies_with_its_supervisor() {
    let sandbox = Sandbox::new();
    let server = supervised(&sandbox, "orphan", &[]);
    let processes = children(server.id());
    assert_eq!(processes.len(), 1);
    server.kill();
    until("the end of the server", || {
        let ended = |process: &u32| {
            let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
            stat.is_empty() || stat.contains(") Z ")
        };
        processes.iter().all(ended).then_some(())
    });
    // and the name is free
    assert!(sandbox.serve("orphan", &[]).stop().success());
}

#[test]
fn a_server_without_its_supervisor_does_not_start() {
    let sandbox = Sandbox::new();
    let output = sandbox.command(ROBOT, "stray", &["--supervisor", "1"]).output().unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{output:?}");
}

#[test]
fn a_bad_model_is_given_up_with_its_first_fault() {
    let sandbox = Sandbox::new();
    let root = sandbox.make_root();
    let file = root.join("bad.urdf");
    fs::write(&file, "<robot name=\"bad\"><link name=\"a\"/><link name=\"b\"/></robot>").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
    command.args(["serve", "--supervise", "--name", "bad", "--urdf"]).arg(&file);
    let output = command.env("SARRUS_ROOT", &root).stdin(Stdio::null()).output().unwrap();
    fs::remove_file(&file).unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{words}");
    let reason = supervision::given_up(&root, &name("bad")).unwrap();
    assert!(reason.contains("bad.urdf:1:"), "{reason}");
    assert!(words.contains(&format!("given up: {reason}")), "{words}");
    // the next start that succeeds takes it back
    assert!(sandbox.serve("bad", &[]).stop().success());
    assert_eq!(supervision::given_up(&root, &name("bad")), None);
    assert_eq!(sandbox.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn a_name_that_is_taken_is_refused_and_not_given_up() {
    let sandbox = Sandbox::new();
    let first = sandbox.serve("taken", &[]);
    let second = sandbox.command(ROBOT, "taken", &["--supervise"]).output().unwrap();
    let words = String::from_utf8(second.stderr).unwrap();
    assert_eq!((second.status.code(), second.stdout.len()), (Some(2), 0), "{words}");
    assert!(words.contains("a server named `taken` is running already"), "{words}");
    assert_eq!(supervision::given_up(sandbox.domain().root(), &name("taken")), None);
    assert!(first.stop().success());
}

#[test]
fn five_deaths_soon_after_a_start_are_given_up() {
    let sandbox = Sandbox::new();
    let child = sandbox.command(ROBOT, "frail", &["--supervise"]).spawn().unwrap();
    let mut last = 0;
    for _ in 0..5 {
        last = until("another process", || Some(serving(child.id())).filter(|id| *id != last));
        // a process that is killed before clients can attach dies soon as well
        kill(last);
    }
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{words}");
    let reason = supervision::given_up(sandbox.domain().root(), &name("frail")).unwrap();
    assert!(reason.starts_with("five times within a minute"), "{reason}");
    assert!(reason.ends_with("was killed by signal 9"), "{reason}");
    assert!(sandbox.serve("frail", &[]).stop().success());
    assert_eq!(supervision::given_up(sandbox.domain().root(), &name("frail")), None);
}

/// Stops a process, which may go on before this returns.
fn stop(process: u32) {
    kill_process(Pid::from_raw(process as i32).unwrap(), Signal::STOP).unwrap();
}

#[test]
fn a_stopped_server_or_supervisor_is_continued_by_the_other_one() {
    let sandbox = Sandbox::new();
    let server = supervised(&sandbox, "halted", &["--short-life", "0"]);
    let mut asker = sandbox.attach_briefly("halted", Transport::Lane);
    let process = serving(server.id());
    let mut gaps: Vec<Duration> = (0..5)
        .map(|_| {
            stop(process);
            let start = Instant::now();
            let _ = until("an answer", || asker.ask().ok().filter(|one| one.status == Status::Ok));
            let gap = start.elapsed();
            server.wait_for_line(&format!("stopped the server (process {process}): continued"));
            gap
        })
        .collect();
    gaps.sort();
    println!("from SIGSTOP of the server to the next answer, sorted: {gaps:.1?}");
    assert_eq!(serving(server.id()), process);

    stop(server.id());
    let start = Instant::now();
    server.wait_for_line("a signal had stopped the supervisor: continued");
    println!("from SIGSTOP of the supervisor to its next run: {:.1?}", start.elapsed());
    kill(process);
    next_server(&sandbox, "halted", process);
    // nor does a stop of the whole wait for a server that is stopped
    stop(serving(server.id()));
    assert!(server.stop().success());
}

/// strace that delays this system call of a thread for a minute.
fn hang(thread: &str, call: &str) -> Option<Process> {
    delay(thread, call, 60_000)
}

/// strace that delays this system call of a thread by so many milliseconds.
fn delay(thread: &str, call: &str, ms: u32) -> Option<Process> {
    let mut command = Command::new("strace");
    command.args(["-e", &format!("trace={call}"), "-p", thread, "-e"]);
    command.arg(format!("inject={call}:delay_enter={ms}000"));
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut strace = Process(command.spawn().ok()?);
    let mut said = String::new();
    BufReader::new(strace.0.stderr.as_mut()?).read_line(&mut said).ok()?;
    said.contains("attached").then_some(strace)
}

#[test]
fn a_hanging_thread_ends_a_supervised_server_and_a_hanging_upkeep_thread_no_other() {
    let sandbox = Sandbox::new();
    let [server, other] = ["kept", "hot"]
        .map(|name| supervised(&sandbox, name, &["--short-life", "0", "--wait", "sleep"]));
    let alone = sandbox.serve("alone", &[]);
    let mut asker = sandbox.attach_briefly("alone", Transport::Lane);
    let [process, hot] = [&server, &other].map(|server| serving(server.id()));
    let thread = answering_thread(hot).unwrap();
    let thread = thread.file_name().unwrap().to_str().unwrap();
    let hanging = [(&*process.to_string(), "ppoll"), (&alone.id().to_string(), "ppoll")];
    let hanging = hanging.into_iter().chain([(thread, "clock_nanosleep")]);
    let hanging: Option<Vec<Process>> = hanging.map(|(thread, call)| hang(thread, call)).collect();
    let Some(mut hanging) = hanging else {
        return println!("not run: no strace, or no right to use it");
    };
    let start = Instant::now();
    let said = "the upkeep thread hangs: no step for 10 s";
    alone.wait_for_line(said);
    server.wait_for_line(said);
    println!("from the hang of upkeep to its line: {:.1?}", start.elapsed());
    // a traced thread ends with its tracer
    drop(hanging.remove(0));
    next_server(&sandbox, "kept", process);
    println!("from the hang of upkeep to the next server: {:.1?}", start.elapsed());
    server.wait_for_line("was killed by signal 9");
    other.wait_for_line("the answering thread hangs: no heartbeat for 10 s");
    drop(hanging.pop());
    next_server(&sandbox, "hot", hot);
    println!("from the hang of the answering thread to the next server: {:.1?}", start.elapsed());
    // attached clients are answered still
    assert_eq!(asker.ask().unwrap().status, Status::Ok);
    drop(hanging);
    assert!([server, other, alone].into_iter().all(|server| server.stop().success()));
}

#[test]
fn clients_that_attach_at_once_on_a_slow_disk_are_no_hanging_thread() {
    let sandbox = Sandbox::new();
    let server = supervised(&sandbox, "slow", &["--short-life", "0", "--lanes", "64"]);
    let process = serving(server.id());
    // a disk on which the calls of all of them take longer than a thread that hangs
    let Some(disk) = delay(&process.to_string(), "fsync", 60) else {
        return println!("not run: no strace, or no right to use it");
    };
    std::thread::scope(|scope| {
        let connect = || sandbox.connect("slow", Transport::Lane).map(drop);
        let clients: Vec<_> = (0..40).map(|_| scope.spawn(connect)).collect();
        clients.into_iter().for_each(|client| client.join().unwrap().unwrap());
    });
    assert_eq!(serving(server.id()), process);
    drop(disk);
    assert!(server.stop().success());
}
