//! Processes of the end-to-end tests: the motors of each bus, a bridge, a controller. Tests run one
//! at a time.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, OnceLock};

use sarrus_proto::Domain;
use sarrus_tests::python::environment;
use serde_json::Value;

pub(super) use super::allowance::{Allowance, wait_for};
use super::allowance::{next, slowness};
use crate::examples::signal;

/// Buses of the end-to-end tests, and the actuators of the upper body on them.
pub(super) const BUSES: [(&str, &[&str]); 3] = [
    ("torso", &["BodyActL", "BodyActR", "BodyYaw"]),
    ("left", &["ALShoulder1", "ALShoulder2", "ALShoulder3", "ALElbowAct", "ALWristRoll"]),
    ("right", &["ARShoulder1", "ARShoulder2", "ARShoulder3", "ARElbowAct", "ARWristRoll"]),
];
/// Actuators of the upper body.
pub(super) const N_U: usize = 13;
/// T1, T2 and the motors' watchdog `[ms]` on an idle computer; on a busy one they grow with its
/// delays, up to the longest times that a configuration may have.
const TIMES: [u64; 3] = [200, 800, 2000];
const LONGEST: f64 = 5.0;

/// Motor turn per actuator motion: rad/m for the linear ones, rad/rad for the others.
pub(super) fn gear(actuator: &str) -> f64 {
    if actuator.contains("Act") { 100.0 } else { 6.0 }
}

/// Sign of an actuator; every second one moves against its motor.
pub(super) fn sign(place: usize) -> f64 {
    if place.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The program `sarrus-can` of this build.
pub(super) fn sarrus_can() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        // target/PROFILE/deps/proof-…
        let test = std::env::current_exe().unwrap();
        let folder = test.parent().and_then(Path::parent).unwrap();
        let path = folder.join("sarrus-can");
        // of the whole workspace, so that features match and nothing is compiled twice
        let mut build = Command::new(env!("CARGO"));
        build
            .args([
                "build",
                "--quiet",
                "--locked",
                "--workspace",
                "--bin",
                "sarrus-can",
                "--bin",
                "sarrus",
                "--example",
                "follow",
                "--example",
                "hold",
                "--target-dir",
            ])
            .arg(folder.parent().unwrap());
        if folder.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success());
        path
    })
}

/// Program of a bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frontend {
    /// `python -m sarrus.can run`.
    Python,
    /// `sarrus-can run`.
    Rust,
}

/// All frontends.
pub(super) const FRONTENDS: [Frontend; 2] = [Frontend::Rust, Frontend::Python];

/// A folder, a domain and a configuration of one test; end-to-end tests do not overlap.
pub(super) struct Stage {
    pub(super) folder: PathBuf,
    pub(super) configuration: String,
    /// T1, T2 and the motors' watchdog `[ms]`.
    pub(super) times: [u64; 3],
    _alone: Option<MutexGuard<'static, ()>>,
}

impl Stage {
    pub(super) fn new() -> Stage {
        let alone = Stage::alone();
        Stage::with(Some(alone), slowness().min(LONGEST))
    }

    /// A stage with the longest times, for tests that do not judge times.
    pub(super) fn of_long_times() -> Stage {
        Stage::with(Some(Stage::alone()), LONGEST)
    }

    fn alone() -> MutexGuard<'static, ()> {
        static ALONE: Mutex<()> = Mutex::new(());
        ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// A stage for simulated time, which is never late.
    pub(super) fn of_simulated_time() -> Stage {
        Stage::with(None, 1.0)
    }

    /// Another, separate stage of the same test.
    pub(super) fn beside(&self) -> Stage {
        Stage::with(None, slowness().min(LONGEST))
    }

    fn with(alone: Option<MutexGuard<'static, ()>>, slowness: f64) -> Stage {
        static STAGES: AtomicU32 = AtomicU32::new(0);
        let folder = std::env::temp_dir().join(format!(
            "sarrus-can-{}-{}",
            std::process::id(),
            STAGES.fetch_add(1, Relaxed)
        ));
        std::fs::create_dir_all(&folder).unwrap();
        let configuration = folder.join("robot.yml");
        let times = TIMES.map(|ms| (ms as f64 * slowness) as u64);
        std::fs::write(&configuration, upper_body(&folder, times)).unwrap();
        let configuration = configuration.to_str().unwrap().to_owned();
        Stage { configuration, folder, times, _alone: alone }
    }

    /// Root of the stage's domain.
    pub(super) fn root(&self) -> PathBuf {
        self.folder.join("domain")
    }

    /// A command with the shared memory and fault logs of this stage.
    pub(super) fn at_home(&self, mut command: Command) -> Command {
        command.env("SARRUS_ROOT", self.root());
        command.env("XDG_STATE_HOME", self.folder.join("state"));
        command
    }

    /// The motors of one bus.
    pub(super) fn motors(&self, bus: &str) -> Process {
        let mut command = Command::new(sarrus_can());
        command.args(["simulate", &self.configuration, "--bus", bus, "--pty"]);
        let motors = Process::start(bus, self.at_home(command));
        let ready = motors.line();
        assert!(ready.starts_with(&format!("ready {bus} ")), "{ready}");
        motors
    }

    /// The command of a bridge.
    pub(super) fn bridge_command(&self, frontend: Frontend) -> Command {
        self.at_home(match frontend {
            Frontend::Python => environment().can(&[
                "run",
                &self.configuration,
                "--name",
                "end_to_end",
                "--no-realtime",
            ]),
            Frontend::Rust => {
                let mut command = Command::new(sarrus_can());
                command.args(["run", &self.configuration, "--name", "end_to_end"]);
                command
            }
        })
    }

    /// A bridge that is ready.
    pub(super) fn bridge(&self, frontend: Frontend) -> Process {
        let bridge = Process::start("bridge", self.bridge_command(frontend));
        let ready = bridge.line();
        assert!(ready.starts_with("ready end_to_end "), "{ready}");
        bridge
    }

    /// A controller that sends commands.
    pub(super) fn controller(&self) -> Process {
        let actuators = || BUSES.iter().flat_map(|(_, actuators)| *actuators);
        let numbers = |linear: f64, turning: f64| {
            let of = |actuator: &&str| if actuator.contains("Act") { linear } else { turning };
            serde_json::to_string(&actuators().map(of).collect::<Vec<f64>>()).unwrap()
        };
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/can/controller.py");
        let arguments =
            [script.to_str().unwrap(), "end_to_end", &numbers(5000.0, 20.0), &numbers(1400.0, 5.0)];
        let controller =
            Process::start("controller", self.at_home(environment().command(&arguments)));
        assert_eq!(controller.line(), "ready");
        controller
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let prefix = Domain::at(&self.root()).map(|domain| domain.prefix());
        let _ = std::fs::remove_dir_all(&self.folder);
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if prefix.as_ref().is_ok_and(|prefix| {
                entry.file_name().to_string_lossy().starts_with(prefix.as_str())
            }) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// The upper body's 13 actuators on three slcan buses, with Damiao motors. The monitors that judge
/// the lateness of answers are off: they would see how busy this computer is, and have tests of
/// their own on simulated time.
fn upper_body(folder: &Path, times: [u64; 3]) -> String {
    let [damping_ms, disable_ms, watchdog_ms] = times;
    let feedback_ms = disable_ms * 7 / 8;
    let mut text = format!(
        "robot: rh5v2_upper_body\ncommissioning: none\nrate_hz: 250\nramp_ms: 200\n\
         monitors: {{late_ms: off, second_answer: off}}\n\
         timeouts: {{damping_ms: {damping_ms}, disable_ms: {disable_ms}, feedback_ms: \
         {feedback_ms}, arming_ms: 60000}}\nbuses:\n"
    );
    for (bus, _) in BUSES {
        let channel = folder.join(bus);
        text += &format!(
            "- {{name: {bus}, interface: slcan, channel: {}, bitrate: 1000000}}\n",
            channel.display()
        );
    }
    text += "motors:\n";
    for (place, (bus, actuator)) in BUSES
        .iter()
        .flat_map(|(bus, actuators)| actuators.iter().map(move |name| (bus, name)))
        .enumerate()
    {
        let id = place + 1;
        let sign = sign(place);
        let gear = gear(actuator);
        let most = if actuator.contains("Act") { 0.09 } else { 1.4 };
        text += &format!(
            "- actuator: {actuator}\n  bus: {bus}\n  drive: {{protocol: mit, variant: damiao, id: \
                {id}, reply_id: {}, position_range: 12.5, \
             velocity_range: 30, torque_range: 10, stiffness_range: 50, damping_range: 5}}\n  \
             sign: {sign}\n  gear: {gear}\n  offset: 0\n  \
             limits: {{position: [-{most}, {most}], effort: 500, velocity: 5}}\n  damping: 1\n  \
             watchdog_ms: {watchdog_ms}\n",
            id + 0x100
        );
    }
    text
}

/// The command under SCHED_FIFO, where the system permits it: other tests and programs then delay
/// no motor, bridge or controller.
fn in_real_time(command: Command) -> Command {
    static PERMITTED: OnceLock<bool> = OnceLock::new();
    let chrt = || {
        let mut chrt = Command::new("chrt");
        chrt.args(["--fifo", "5"]);
        chrt
    };
    let tried = || chrt().arg("true").output().is_ok_and(|output| output.status.success());
    if !PERMITTED.get_or_init(tried) {
        return command;
    }
    let mut urgent = chrt();
    urgent.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => urgent.env(name, value),
            None => urgent.env_remove(name),
        };
    }
    urgent
}

/// True if the motor's last frame takes its power away, or sets a parameter, which the bridge does
/// without power only.
pub(super) fn takes_power(motor: &Value) -> bool {
    let takes = |frame: &str| frame.ends_with("#FFFFFFFFFFFFFFFD") || frame.starts_with("7FF#");
    motor["frame"].as_str().is_some_and(takes)
}

/// A process with a thread that reads its lines; killed when dropped.
pub(super) struct Process {
    name: String,
    child: Child,
    stdin: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Process {
    pub(super) fn start(name: &str, command: Command) -> Process {
        let mut command = in_real_time(command);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap_or_else(|error| panic!("{command:?}: {error}"));
        let (sender, lines) = channel();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Process { name: name.to_owned(), stdin: child.stdin.take(), child, lines }
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its next line.
    pub(super) fn line(&self) -> String {
        next(&self.lines, &format!("line of {}", self.name))
    }

    /// The next line that fits, as JSON; other lines are skipped.
    pub(super) fn until(&self, desired: impl Fn(&Value) -> bool) -> Value {
        let mut allowance = Allowance::new();
        while allowance.is_left() {
            let line = self.line();
            let value: Value = serde_json::from_str(&line)
                .unwrap_or_else(|error| panic!("{}: {error}: {line}", self.name));
            if desired(&value) {
                return value;
            }
        }
        panic!("{} does not say it", self.name)
    }

    /// All lines that have arrived, as JSON.
    pub(super) fn said(&self) -> Vec<Value> {
        self.lines.try_iter().map(|line| serde_json::from_str(&line).unwrap()).collect()
    }

    pub(super) fn tell(&mut self, line: &str) {
        writeln!(self.stdin.as_mut().unwrap(), "{line}")
            .unwrap_or_else(|error| panic!("{}: {error}", self.name));
    }

    /// Reports of the motors of a simulated bus.
    pub(super) fn report(&mut self) -> Vec<Value> {
        self.tell("report");
        self.until(|value| value["event"] == "report")["motors"].as_array().unwrap().clone()
    }

    /// State of the bridge as the controller receives it.
    pub(super) fn state(&mut self) -> Value {
        self.tell("state");
        self.until(|value| value["states"].is_array())
    }

    pub(super) fn signal(&self, name: &str) {
        signal(self.id(), name);
    }

    pub(super) fn end(&mut self) -> ExitStatus {
        drop(self.stdin.take());
        wait_for(&format!("the end of {}", self.name), || self.child.try_wait().unwrap())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
