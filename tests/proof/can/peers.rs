//! The protocols against other implementations: `moteus`, `canopen` and `cantools` from PyPI read
//! the bridge's frames, and the bridge reads theirs. The script `peers/peers.py` answers JSON
//! lines.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};

use sarrus_can_core::drive::{Drive, Mode, Receipt, Setpoint};
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings, protocol};
use sarrus_models::{Diagnostics, yaml};
use sarrus_tests::python::environment;
use sarrus_tests::seed::Seeded;
use serde_json::{Value, json};

/// Values of each exchange.
const ROUNDS: usize = 2_000;

/// The script in its own process.
struct Peers {
    child: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peers {
    fn new() -> Peers {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/proof/can/peers/peers.py");
        let mut child = environment()
            .command(&[script])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let questions = child.stdin.take().unwrap();
        let answers = BufReader::new(child.stdout.take().unwrap());
        Peers { child, questions, answers }
    }

    fn ask(&mut self, question: &Value) -> Value {
        writeln!(self.questions, "{question}").unwrap();
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        // Python writes NaN, which JSON lacks
        serde_json::from_str(&line.replace("NaN", "null"))
            .unwrap_or_else(|error| panic!("{question}: {error}: {line}"))
    }

    fn decode(&mut self, by: &str, frame: &Frame) -> Value {
        self.ask(&json!({"ask": by, "data": hex(frame.data())}))
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn drive(name: &str, text: &str, mode: Mode) -> Box<dyn Drive> {
    drive_of(name, text, mode, DBC)
}

fn drive_of(name: &str, text: &str, mode: Mode, file: &str) -> Box<dyn Drive> {
    let protocol = protocol(name).unwrap();
    let mut diagnostics = Diagnostics::new(false);
    let node =
        yaml::read("drive.yml", text.as_bytes().to_vec(), "a drive", &mut diagnostics).unwrap();
    let settings = Settings::read(
        &node,
        "the drive",
        protocol.keys,
        &[],
        &|_| Ok(file.to_owned()),
        &mut diagnostics,
    );
    let common = Common {
        mode,
        watchdog_ms: 50,
        torque_limit: f64::INFINITY,
        velocity_limit: f64::INFINITY,
        period_ns: 2_000_000,
    };
    let drive = settings.and_then(|settings| (protocol.make)(&settings, common, &mut diagnostics));
    drive.unwrap_or_else(|| panic!("{}", diagnostics.into_report()))
}

fn encode(drive: &dyn Drive, setpoint: Setpoint) -> Vec<Frame> {
    let mut queue = FrameQueue::new(8);
    drive.encode(&setpoint, &mut queue);
    queue.frames().to_vec()
}

/// A set-point within ± the largest position, velocity and torque, and up to the largest stiffness
/// and damping.
fn random_setpoint(seeded: &mut Seeded, largest: [f64; 5]) -> Setpoint {
    let [position, velocity, torque, stiffness, damping] =
        largest.map(|largest| seeded.within(-largest, largest));
    Setpoint { position, velocity, torque, stiffness: stiffness.abs(), damping: damping.abs() }
}

fn near(found: &Value, setpoint: f64, by: f64, what: &str) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{what}: {found}"));
    assert!(
        (found - setpoint).abs() <= by * (1.0 + 1e-9) + setpoint.abs() * 1e-7,
        "{what}: {found} is not {setpoint}"
    );
}

/// Torques and gains are rounded towards zero; next to zero a range has codes of half a step.
fn toward_zero(found: &Value, setpoint: f64, step: f64, what: &str) {
    near(found, setpoint, step * (1.0 + 1e-5), what);
    let size = found.as_f64().unwrap().abs();
    let most = setpoint.abs().max(0.5 * step);
    assert!(size <= most + 1e-5 * step + 1e-7 * most, "{what}: {found} is beyond {setpoint}");
}

#[test]
fn cantools_reads_mit_cybergear_and_odrive_commands() {
    let mut peers = Peers::new();
    let mut seeded = Seeded::new(1);
    let ranges = "position_range: 12.5, velocity_range: 45, torque_range: 18, stiffness_range: \
        500, damping_range: 5";
    let mit = drive(
        "mit",
        &format!("{{variant: mini_cheetah, id: 1, reply_id: 0, {ranges}}}"),
        Mode::Impedance,
    );
    let cybergear = drive("cybergear", "{id: 1, position_range: 12.5}", Mode::Impedance);
    let odrive = drive("odrive", "{node: 1}", Mode::Position);
    for _ in 0..ROUNDS {
        let setpoint = random_setpoint(&mut seeded, [12.5, 45.0, 18.0, 500.0, 5.0]);
        let read = peers.decode("mit", &encode(&*mit, setpoint)[0]);
        near(&read["position"], setpoint.position, 12.5 / 65535.0, "MIT position");
        near(&read["velocity"], setpoint.velocity, 45.0 / 4095.0, "MIT velocity");
        toward_zero(&read["torque"], setpoint.torque, 36.0 / 4095.0, "MIT torque");
        toward_zero(&read["stiffness"], setpoint.stiffness, 500.0 / 4095.0, "MIT stiffness");
        toward_zero(&read["damping"], setpoint.damping, 5.0 / 4095.0, "MIT damping");
        let setpoint = random_setpoint(&mut seeded, [12.5, 30.0, 12.0, 500.0, 5.0]);
        let read = peers.decode("cybergear", &encode(&*cybergear, setpoint)[0]);
        near(&read["position"], setpoint.position, 12.5 / 65535.0, "CyberGear position");
        near(&read["velocity"], setpoint.velocity, 30.0 / 65535.0, "CyberGear velocity");
        toward_zero(&read["stiffness"], setpoint.stiffness, 500.0 / 65535.0, "CyberGear stiffness");
        toward_zero(&read["damping"], setpoint.damping, 5.0 / 65535.0, "CyberGear damping");
        let setpoint = random_setpoint(&mut seeded, [100.0, 200.0, 30.0, 0.0, 0.0]);
        let read = peers.decode("odrive", &encode(&*odrive, setpoint)[0]);
        near(&read["position"], setpoint.position / std::f64::consts::TAU, 0.0, "ODrive position");
        near(
            &read["velocity"],
            setpoint.velocity / std::f64::consts::TAU,
            0.0005,
            "ODrive velocity",
        );
        toward_zero(&read["torque"], setpoint.torque, 0.001, "ODrive torque");
    }
}

#[test]
fn the_moteus_client_reads_commands_and_replies_as_the_bridge_does() {
    let mut peers = Peers::new();
    let mut seeded = Seeded::new(2);
    let tau = std::f64::consts::TAU;
    let mut moteus = drive("moteus", "{id: 1, kp: 4.0, kd: 0.05}", Mode::Impedance);
    for _ in 0..ROUNDS {
        let stiffness = 4.0 / tau * seeded.within(0.0, 1.0);
        let damping = 0.05 / 4.0 * stiffness * seeded.within(0.0, 1.0);
        let setpoint = Setpoint {
            stiffness,
            damping,
            ..random_setpoint(&mut seeded, [50.0, 100.0, 300.0, 0.0, 0.0])
        };
        let frame = encode(&*moteus, setpoint)[0];
        let read = peers.decode("moteus", &frame);
        assert_eq!(read["0"], 10);
        near(&read["32"], setpoint.position / tau, 0.0, "position");
        near(&read["33"], setpoint.velocity / tau, 0.0, "velocity");
        toward_zero(&read["34"], setpoint.torque, 0.01, "torque");
        toward_zero(&read["35"], stiffness * tau / 4.0, 1.0 / 32767.0, "stiffness");
        toward_zero(&read["36"], damping * tau / 0.05, 1.0 / 32767.0, "damping");
        assert!(read["37"].is_null(), "the controller's own largest torque");
        near(&read["39"], 0.05, 1e-9, "watchdog");
        // below 0: no limit
        near(&read["40"], -0.1, 1e-9, "velocity limit");
        near(&read["41"], -0.05, 1e-9, "acceleration limit");
        near(&read["43"], 0.0, 1e-9, "scale of the integrator's limit");

        let kind = seeded.below(3);
        let (head, len) = [(0x20_u8, 1), (0x24, 2), (0x28, 4)][kind];
        let mut bytes = vec![head, 4, 0];
        bytes.extend((0..4 * len).map(|i| {
            if i == 0 {
                10
            } else if i < len {
                0
            } else {
                seeded.within(-100.0, 100.0) as i8 as u8
            }
        }));
        let padded = [8, 12, 20][kind];
        bytes.resize(padded, 0x50);
        let read = peers.ask(&json!({"ask": "moteus_reply", "data": hex(&bytes)}));
        let frame = Frame::fd(Id::Standard(0x100), true, &bytes).unwrap();
        let Receipt::Measured(measured) = moteus.receive(0, &frame) else { panic!("{frame}") };
        near(&read["1"], measured.position / tau, 1e-9, "reported position");
        near(&read["2"], measured.velocity / tau, 1e-9, "reported velocity");
        near(&read["3"], measured.torque, 1e-9, "reported torque");
    }
}

#[test]
fn canopen_takes_every_request_of_the_set_up() {
    let mut peers = Peers::new();
    let mut drive =
        drive("cia402", "{node: 5, rated_torque: 2.0, counts_per_turn: 65536}", Mode::Position);
    let mut written = Vec::new();
    for _ in 0..60 {
        let mut queue = FrameQueue::new(8);
        drive.cycle(0, sarrus_can_core::drive::DriveCommand::Off, &mut queue);
        for frame in queue.frames().iter().filter(|frame| frame.id == Id::Standard(0x605)) {
            let bytes = frame.exactly::<8>().unwrap();
            let index = u16::from_le_bytes([bytes[1], bytes[2]]);
            let sub = bytes[3];
            let answer = match bytes[0] {
                0x40 => {
                    let value = if index == 0x6076 { 2000_u16 } else { 8 }.to_le_bytes();
                    hex(&[0x43, bytes[1], bytes[2], sub, value[0], value[1], 0, 0])
                }
                first => {
                    let n_bytes = 4 - (first >> 2 & 3);
                    let took = peers.ask(&json!({"ask": "sdo", "index": index, "sub": sub,
                    "bytes": n_bytes, "data": hex(&bytes)}));
                    written.push((index, sub, took["value"].as_u64().unwrap()));
                    assert_eq!(took["id"], 0x585);
                    took["answer"].as_str().unwrap().to_uppercase()
                }
            };
            let answer: Vec<u8> = (0..8)
                .map(|i| u8::from_str_radix(&answer[2 * i..2 * i + 2], 16).unwrap())
                .collect();
            drive.receive(0, &Frame::classic(Id::Standard(0x585), &answer).unwrap());
        }
    }
    assert!(
        written.contains(&(0x1400, 1, 0x205)) && written.contains(&(0x1600, 2, 0x607A_0020)),
        "{written:X?}"
    );
    assert!(
        written.contains(&(0x6060, 0, 8)) && written.contains(&(0x1016, 1, 0x7F_0032)),
        "{written:X?}"
    );

    // the steps of the state machine: canopen gives the same control words for each state
    let commands = peers.ask(&json!({"ask": "control402"}))["commands"].clone();
    let steps = [
        (0x0250_u16, "SWITCH ON DISABLED", "READY TO SWITCH ON"),
        (0x0231, "READY TO SWITCH ON", "SWITCHED ON"),
        (0x0233, "SWITCHED ON", "OPERATION ENABLED"),
        (0x0237, "OPERATION ENABLED", "OPERATION ENABLED"),
    ];
    for (word, state, next) in steps {
        assert_eq!(peers.ask(&json!({"ask": "state402", "word": word}))["state"], state);
        let [low, high] = word.to_le_bytes();
        drive.receive(
            0,
            &Frame::classic(Id::Standard(0x185), &[low, high, 0, 0, 0, 0, 0, 0]).unwrap(),
        );
        let mut queue = FrameQueue::new(8);
        drive.cycle(0, sarrus_can_core::drive::DriveCommand::On(Setpoint::default()), &mut queue);
        let sent =
            queue.frames().iter().find(|frame| frame.id == Id::Standard(0x205)).unwrap().data();
        assert_eq!(json!(u16::from_le_bytes([sent[0], sent[1]])), commands[next], "{state}");
    }
}

/// Intel and Motorola, signed, scaled and moved signals, and a switch.
const DBC: &str = r#"VERSION ""
NS_ :
BS_:
BU_: Host Motor
BO_ 257 Command: 8 Host
 SG_ Mux M : 0|4@1+ (1,0) [0|0] "" Motor
 SG_ Enable m1 : 4|1@1+ (1,0) [0|0] "" Motor
 SG_ Torque m1 : 15|16@0- (0.01,0) [0|0] "" Motor
 SG_ Position m2 : 10|21@1- (0.002,3) [0|0] "" Motor
 SG_ Velocity m2 : 36|13@0- (-0.05,1) [0|0] "" Motor
"#;

fn decode_dbc(peers: &mut Peers, file: &str, frames: &[Frame]) -> Vec<Value> {
    let ask = |frame: &Frame| {
        peers.ask(&json!({"ask": "dbc", "file": file, "id": 257,
        "data": hex(frame.data())}))["values"]
            .clone()
    };
    let mut read: Vec<Value> = frames.iter().map(ask).collect();
    // the frame with the power is sent last
    read.sort_by_key(|values| values["Mux"].as_u64());
    read
}

#[test]
fn cantools_reads_what_is_sent_by_a_dbc_file() {
    let mut peers = Peers::new();
    let mut seeded = Seeded::new(4);
    let text = "{file: motor.dbc, enable: Command.Enable, torque: Command.Torque, position: \
        Command.Position, velocity: Command.Velocity, \
                measured_position: Command.Position}";
    let drive = drive("dbc", text, Mode::Torque);
    for _ in 0..ROUNDS {
        let setpoint = random_setpoint(&mut seeded, [2000.0, 190.0, 327.0, 0.0, 0.0]);
        let read = decode_dbc(&mut peers, DBC, &encode(&*drive, setpoint));
        assert_eq!(
            (&read[0]["Mux"], &read[0]["Enable"], &read[1]["Mux"]),
            (&json!(1), &json!(1), &json!(2))
        );
        toward_zero(&read[0]["Torque"], setpoint.torque, 0.01, "torque");
        near(&read[1]["Position"], setpoint.position, 0.001, "position");
        near(&read[1]["Velocity"], setpoint.velocity, 0.025, "velocity");
    }
    // an Enable signal without a multiplexer switch is in both frames
    let file = DBC.replace("Enable m1", "Enable");
    let drive = drive_of("dbc", text, Mode::Torque, &file);
    let read = decode_dbc(
        &mut peers,
        &file,
        &encode(&*drive, random_setpoint(&mut seeded, [2000.0, 190.0, 327.0, 0.0, 0.0])),
    );
    assert_eq!((read.len(), &read[0]["Enable"], &read[1]["Enable"]), (2, &json!(1), &json!(1)));
}
