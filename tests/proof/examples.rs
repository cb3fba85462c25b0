//! The examples of the Rust client do as their pages promise.

use std::fs::{self, DirEntry};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::thread;
use std::time::Duration;

use sarrus_dynamics::{Field, Request};
use sarrus_models::{Options, Source, load};
use sarrus_tests::run::Robot;

const EXAMPLES: [&str; 8] = [
    "inverse_dynamics",
    "forward_dynamics",
    "jacobian",
    "own_robot",
    "loop_1khz",
    "hand",
    "simulation",
    "speed",
];

/// The folder of this build: the examples are in `examples`, the programs beside it.
pub(super) fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        // target/PROFILE/deps/proof-…
        let test = std::env::current_exe().unwrap();
        let folder = test.parent().and_then(Path::parent).unwrap();
        // of the whole workspace, so that features match and nothing is compiled twice
        let mut build = Command::new(env!("CARGO"));
        build.args(["build", "--quiet", "--locked", "--workspace", "--bin", "sarrus"]);
        build.args(EXAMPLES.iter().flat_map(|example| ["--example", example]));
        build.arg("--target-dir").arg(folder.parent().unwrap());
        if folder.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success());
        folder.to_owned()
    })
}

/// Domain of these tests' servers.
pub(crate) fn root() -> PathBuf {
    std::env::temp_dir().join(format!("sarrus-examples-{}", std::process::id()))
}

/// Runs an example, which must succeed, and returns its stdout.
fn run(example: &str, arguments: &[&str]) -> String {
    let mut command = Command::new(folder().join("examples").join(example));
    let output = command.args(arguments).env("SARRUS_ROOT", root()).output().unwrap();
    assert!(output.status.success(), "{example}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The numbers of a line that begins with `label`.
fn numbers(output: &str, label: &str) -> Vec<f64> {
    let line = output.lines().find_map(|line| line.strip_prefix(label)?.strip_prefix(": "));
    let line = line.unwrap_or_else(|| panic!("no line `{label}` in {output}"));
    line.trim_matches(['[', ']']).split(", ").map(|number| number.parse().unwrap()).collect()
}

/// A server process, which is killed when dropped.
pub(crate) struct Server(Child);

impl Server {
    pub(crate) fn start(name: &str) -> Server {
        Server::start_with(name, &[])
    }

    pub(crate) fn start_with(name: &str, flags: &[&str]) -> Server {
        Server::of("lambda", name, flags)
    }

    pub(crate) fn of(robot: &str, name: &str, flags: &[&str]) -> Server {
        let mut command = Command::new(folder().join("sarrus"));
        command.args(["serve", "--robot", robot, "--name", name]).args(flags);
        command.env("SARRUS_ROOT", root());
        command.stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert!(line.starts_with("ready "), "{line}");
        Server(child)
    }

    /// Sends the process a signal.
    pub(crate) fn signal(&self, name: &str) {
        signal(self.0.id(), name);
    }
}

/// Sends a process a signal by its name in `kill`; after `-STOP` every thread has stopped.
pub(crate) fn signal(process: u32, name: &str) {
    let kill = Command::new("kill").args([name, &process.to_string()]).status();
    assert!(kill.unwrap().success());
    let has_stopped = |thread: DirEntry| {
        let Ok(stat) = fs::read_to_string(thread.path().join("stat")) else {
            return true; // it ended meanwhile
        };
        stat.rsplit_once(") ").unwrap().1.starts_with(['T', 'Z', 'X'])
    };
    let threads = format!("/proc/{process}/task");
    while name == "-STOP"
        && !fs::read_dir(&threads).unwrap().all(|thread| has_stopped(thread.unwrap()))
    {
        thread::sleep(Duration::from_millis(1));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // a paused server continues first
        let id = self.0.id().to_string();
        let _ = Command::new("kill").args(["-CONT", &id]).status();
        let stopped = Command::new("kill").arg(id).status();
        if !stopped.is_ok_and(|status| status.success()) {
            let _ = self.0.kill();
        }
        let _ = self.0.wait();
    }
}

#[test]
fn inverse_dynamics_prints_the_same_force_in_process_and_connected() {
    let lambda = load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    let given = [(Field::Y, &[0.2][..]), (Field::Yd, &[1.0]), (Field::Ydd, &[0.0])];
    let mut robot = Robot::new(lambda.compiled.model);
    let answer = robot.ask(Request::InverseDynamics, &given, &[Field::TauU]).ok();
    let here = run("inverse_dynamics", &[]);
    assert_eq!(numbers(&here, "ElbowAct"), answer.get(Field::TauU));
    let _server = Server::start("elbow");
    assert_eq!(run("inverse_dynamics", &["--connect", "elbow"]), here);
}

#[test]
fn forward_dynamics_prints_that_the_robot_is_held() {
    let output = run("forward_dynamics", &[]);
    assert!(numbers(&output, "held").iter().all(|ydd| ydd.abs() < 1e-9), "{output}");
    assert!(numbers(&output, "let go").iter().any(|ydd| ydd.abs() > 0.1), "{output}");
}

#[test]
fn the_jacobian_gives_the_twist() {
    let output = run("jacobian", &[]);
    let (_, difference) = output.trim_end().rsplit_once(' ').unwrap();
    assert!(difference.parse::<f64>().unwrap() < 1e-12, "{output}");
}

#[test]
fn the_robot_in_code_is_a_parallelogram() {
    let output = run("own_robot", &[]);
    let q = numbers(&output, "q");
    // the coupler keeps its direction, the rocker follows the crank
    for (found, expected) in q.iter().zip([0.3, -0.3, 0.3]) {
        assert!((found - expected).abs() < 1e-12, "{output}");
    }
    assert!(numbers(&output, "tau_u")[0].is_finite());
}

#[test]
fn the_loop_of_1_khz_counts_its_cycles() {
    let _server = Server::start("loop");
    let output = run("loop_1khz", &["loop", "0.3"]);
    assert!(output.starts_with("300 cycles, "), "{output}");
}

/// The hand's farthest distance from its target, and the last forces, of the example in each
/// language; they move it alike.
pub(crate) fn hand_of(server: &str) -> [Vec<f64>; 2] {
    hand_in(&run("hand", &[server, HAND, "1"]))
}

pub(crate) const HAND: &str = "ALWristRoll_Link";

pub(crate) fn hand_in(output: &str) -> [Vec<f64>; 2] {
    assert!(output.starts_with("1000 cycles, "), "{output}");
    [numbers(output, "farthest from its target"), numbers(output, "tau_u")]
}

/// Whether another language moves the hand as Rust does: its sines and sums round otherwise.
pub(crate) fn assert_alike(found: &str, [distance, tau_u]: &[Vec<f64>; 2]) {
    let [other, forces] = hand_in(found);
    assert!((other[0] - distance[0]).abs() < 1e-9, "{found}");
    assert_eq!(forces.len(), tau_u.len());
    let size = tau_u.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    for (found, expected) in forces.iter().zip(tau_u) {
        assert!((found - expected).abs() < 1e-6 * size, "{forces:?} {tau_u:?}");
    }
}

#[test]
fn the_hand_stays_near_its_target_by_forces_within_limits() {
    let _server = Server::of("rh5v2_upper_body", "hand", &[]);
    let [farthest, tau_u] = hand_of("hand");
    // of 100 mm
    assert!(farthest[0] > 1e-9 && farthest[0] < 1e-4, "{farthest:?}");
    let loaded = load(&Source::Bundled("rh5v2_upper_body".into()), &Options::default()).unwrap();
    let info = loaded.compiled.model.info();
    assert_eq!(tau_u.len(), info.active.len());
    for (name, tau) in info.active.iter().zip(tau_u) {
        let row = info.tree.iter().position(|of| of == name).unwrap();
        let most = info.limits[row].and_then(|of| of.effort).unwrap();
        assert!(tau.abs() <= most * (1.0 + 1e-12), "{name}: {tau} of {most}");
    }
}

#[test]
fn the_simulation_keeps_its_energy() {
    let output = run("simulation", &[]);
    let drift = output.trim_end().strip_suffix(" J").and_then(|line| line.rsplit(' ').next());
    assert!(drift.unwrap().parse::<f64>().unwrap() < 1e-8, "{output}");
}
