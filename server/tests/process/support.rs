//! Servers and clients as processes of their own, each in a domain of its own.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{ChildStderr, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard};

use rustix::process::Signal;
use sarrus_client::{
    ConnectError, ConnectOptions, Field, FieldSet, PlanId, Query, Request, Robot, Statistics,
    Status, Transport, WaitStrategy,
};
use sarrus_proto::Domain;
use sarrus_serve::pool;
use sarrus_torture::patience::{LIMIT, holds, poll};
use sarrus_torture::process::{Process, TemporaryDomain, files_of, serve_command, start_server};
use sarrus_torture::raw::Raw;

/// The query of every test: the whole state of the robot.
pub(crate) const STATE: Query = Query::new(
    Request::Kinematics,
    FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
    FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd, Field::U]),
);

/// The robot that every test serves.
pub(crate) const ROBOT: &str = "rh5v2_upper_body";

static ALONE: Mutex<()> = Mutex::new(());

/// A domain of one test; tests run one at a time as long as they hold it.
pub(crate) struct Sandbox {
    home: TemporaryDomain,
    _alone: Option<MutexGuard<'static, ()>>,
}

impl Sandbox {
    pub(crate) fn new() -> Sandbox {
        let alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        Sandbox::make(Some(alone))
    }

    /// Another domain of the same test.
    pub(crate) fn another(&self) -> Sandbox {
        Sandbox::make(None)
    }

    fn make(alone: Option<MutexGuard<'static, ()>>) -> Sandbox {
        Sandbox { home: TemporaryDomain::new().unwrap(), _alone: alone }
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.home.0
    }

    /// The root, as the first server or client makes it.
    pub(crate) fn make_root(&self) -> PathBuf {
        let root = self.domain().root().to_owned();
        fs::create_dir(&root).unwrap();
        fs::write(root.join("made"), "").unwrap();
        root
    }

    /// The files of the domain.
    pub(crate) fn leftovers(&self) -> Vec<PathBuf> {
        files_of(self.domain()).into_iter().collect()
    }

    pub(crate) fn serve(&self, name: &str, flags: &[&str]) -> Server {
        self.serve_robot(ROBOT, name, flags)
    }

    pub(crate) fn serve_robot(&self, robot: &str, name: &str, flags: &[&str]) -> Server {
        self.start(&mut self.command(robot, name, flags))
    }

    /// A server by its command line.
    pub(crate) fn start(&self, command: &mut Command) -> Server {
        let (mut server, stderr) = self.start_unread(command);
        let (heard, lines) = channel();
        let mut read = BufReader::new(stderr).lines();
        std::thread::spawn(move || read.all(|line| line.is_ok_and(|x| heard.send(x).is_ok())));
        server.lines = lines;
        server
    }

    /// A server by its command line, and its stderr.
    pub(crate) fn start_unread(&self, command: &mut Command) -> (Server, ChildStderr) {
        command.env("SARRUS_ROOT", self.domain().root());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::null());
        let (mut process, ready) = start_server(command).unwrap();
        let stderr = process.0.stderr.take().unwrap();
        (Server { process, ready, lines: channel().1 }, stderr)
    }

    pub(crate) fn command(&self, robot: &str, name: &str, flags: &[&str]) -> Command {
        let sarrus = Path::new(env!("CARGO_BIN_EXE_sarrus"));
        let mut command = serve_command(sarrus, self.domain(), robot, name);
        command.args(flags).stderr(Stdio::piped());
        command
    }

    /// Runs another command in the domain; exit code, stdout and stderr.
    pub(crate) fn sarrus(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
        command.args(arguments).env("SARRUS_ROOT", self.domain().root());
        let output = command.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    }

    /// A client made of protocol steps, which has greeted the server.
    pub(crate) fn raw(&self, name: &str) -> Raw {
        Raw::greet(self.domain(), name).unwrap()
    }

    pub(crate) fn connect(&self, name: &str, transport: Transport) -> Result<Robot, ConnectError> {
        self.connect_with(name, ConnectOptions { transport, ..options() })
    }

    pub(crate) fn connect_with(
        &self,
        name: &str,
        options: ConnectOptions,
    ) -> Result<Robot, ConnectError> {
        Robot::connect_in(self.domain().clone(), name, options)
    }

    /// A client that reports a lost server after one second instead of [`LIMIT`]; it connects again
    /// until a busy server answers within that time.
    pub(crate) fn attach_briefly(&self, name: &str, transport: Transport) -> Asker {
        let timeout = std::time::Duration::from_secs(1);
        self.attach(name, ConnectOptions { transport, timeout, ..options() })
    }

    /// A client with a time-out that a busy server may miss at first: tries until it is answered.
    pub(crate) fn attach(&self, name: &str, options: ConnectOptions) -> Asker {
        let attached = poll(|| {
            let mut robot = self.connect_with(name, options).ok()?;
            robot.prepare(&STATE).ok()?;
            let mut asker = Asker::new(robot);
            (asker.ask().ok()?.status == Status::Ok).then_some(asker)
        });
        attached.unwrap_or_else(|| panic!("no answer from `{name}` within {LIMIT:?}"))
    }

    /// Another process that connects, prepares and asks until it is killed; returns once it was
    /// answered.
    pub(crate) fn client(&self, name: &str, transport: Transport) -> Process {
        self.client_with(name, transport, None)
    }

    /// As [`Sandbox::client`], with batch after batch.
    pub(crate) fn flooding(&self, name: &str, transport: Transport) -> Process {
        self.other_process(name, transport, Some(("SARRUS_TEST_BATCHES", "1".to_owned())))
    }

    /// As [`Sandbox::client`], with a plan of its own beside that of the state.
    pub(crate) fn client_with(
        &self,
        name: &str,
        transport: Transport,
        query: Option<usize>,
    ) -> Process {
        let query = query.map(|number| ("SARRUS_TEST_QUERY", number.to_string()));
        self.other_process(name, transport, query)
    }

    fn other_process(
        &self,
        name: &str,
        transport: Transport,
        variable: Option<(&str, String)>,
    ) -> Process {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["the_other_process", "--exact", "--nocapture"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        command
            .env("SARRUS_ROOT", self.domain().root())
            .env("SARRUS_TEST_SERVER", name)
            .env("SARRUS_TEST_TRANSPORT", format!("{transport:?}"))
            .envs(variable);
        let mut client = Process(command.spawn().unwrap());
        let mut lines = BufReader::new(client.0.stdout.take().unwrap()).lines();
        assert!(
            lines.any(|line| line.is_ok_and(|line| line.contains("answered"))),
            "the other client was not answered"
        );
        client
    }
}

pub(crate) fn options() -> ConnectOptions {
    let wait_strategy = WaitStrategy::Polite;
    ConnectOptions { wait_strategy, timeout: LIMIT, ..ConnectOptions::default() }
}

/// Waits until a condition holds.
pub(crate) fn wait_until(state: &str, condition: impl FnMut() -> bool) {
    assert!(holds(condition), "not within {LIMIT:?}: {state}");
}

/// The server's statistics once they satisfy a condition; it publishes them now and then.
pub(crate) fn published(robot: &Robot, condition: impl Fn(&Statistics) -> bool) -> Statistics {
    let found = poll(|| robot.statistics().filter(&condition));
    found.unwrap_or_else(|| panic!("not within {LIMIT:?}: {:?}", robot.statistics()))
}

/// A served robot in another process; killed when dropped.
pub(crate) struct Server {
    process: Process,
    pub(crate) ready: String,
    /// Its stderr.
    lines: Receiver<String>,
}

impl Server {
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Waits for a line on stderr that has this text.
    pub(crate) fn wait_for_line(&self, text: &str) -> String {
        self.lines_to(text, |line| line.contains(text)).pop().unwrap()
    }

    /// The lines on stderr up to an awaited one.
    pub(crate) fn lines_to(&self, what: &str, mut last: impl FnMut(&str) -> bool) -> Vec<String> {
        let mut lines = Vec::new();
        loop {
            match self.lines.recv_timeout(LIMIT) {
                Ok(line) => lines.push(line),
                Err(error) => panic!("no line `{what}`, {error}: {lines:?}"),
            }
            if lines.last().is_some_and(|line| last(line)) {
                return lines;
            }
        }
    }

    pub(crate) fn kill(self) {
        self.process.kill();
    }

    /// Its remaining lines on stderr after a clean stop.
    pub(crate) fn errors(mut self) -> String {
        let lines = std::mem::replace(&mut self.lines, channel().1);
        assert!(self.stop().success());
        lines.iter().map(|line| line + "\n").collect()
    }

    /// Ends it in order.
    pub(crate) fn stop(self) -> ExitStatus {
        self.stop_by(Signal::TERM)
    }

    pub(crate) fn stop_by(self, signal: Signal) -> ExitStatus {
        self.process.stop(signal).unwrap_or_else(|| panic!("the server does not stop"))
    }
}

/// A robot with the state's plan and arrays that fit.
pub(crate) struct Asker {
    pub(crate) robot: Robot,
    pub(crate) plan: PlanId,
    pub(crate) input: Vec<f64>,
    pub(crate) output: Vec<f64>,
}

impl Asker {
    pub(crate) fn new(mut robot: Robot) -> Asker {
        let plan = robot.prepare(&STATE).unwrap();
        let prepared = robot.plan(plan).unwrap();
        let input = (0..prepared.given().len()).map(|k| 1e-3 * (k % 7) as f64).collect();
        let output = vec![0.0; prepared.want().len()];
        Asker { robot, plan, input, output }
    }

    pub(crate) fn ask(&mut self) -> Result<sarrus_client::Answer, sarrus_client::Error> {
        self.robot.ask(self.plan, &self.input, &mut self.output)
    }

    /// Asks a thousand times: how many answers were ok, and how many blocks this thread took from
    /// the pool and from the system for them.
    pub(crate) fn thousand(&mut self) -> (usize, u64, u64) {
        let before = pool::counts();
        let adopted = pool::adopt_thread();
        let good = (0..1000)
            .filter(|_| self.ask().is_ok_and(|answer| answer.status == Status::Ok))
            .count();
        drop(adopted);
        let after = pool::counts();
        (good, after.pool - before.pool, after.system - before.system)
    }

    pub(crate) fn bits(&self) -> Vec<u64> {
        self.output.iter().map(|number| number.to_bits()).collect()
    }
}
