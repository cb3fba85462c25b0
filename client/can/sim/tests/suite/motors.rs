//! Drives and motors against each other: both were written from the makers' manuals, neither from
//! the other.

use sarrus_can_core::drive::{
    Drive, DriveCommand, Measurement, Mode, Power, Receipt, Setpoint, Watchdog,
};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, Settings, protocol};
use sarrus_can_sim::{Physics, Simulated};
use sarrus_models::{Diagnostics, yaml};

const MS: u64 = 1_000_000;
const WATCHDOG_MS: u32 = 50;

/// A drive and a motor on one wire.
struct Pair {
    drive: Box<dyn Drive>,
    motor: Simulated,
    now_ns: u64,
    out: FrameQueue,
    back: FrameQueue,
    measured: Option<Measurement>,
    malformed: usize,
}

/// A protocol, its settings, a mode, and by how much a measurement may be off: one step of
/// position, velocity and torque.
struct Case {
    protocol: &'static str,
    settings: &'static str,
    mode: Mode,
    step: [f64; 3],
}

const MIT_STEP: [f64; 3] = [25.0 / 65535.0, 60.0 / 4095.0, 20.0 / 4095.0];

macro_rules! mit {
    ($variant:literal) => {
        concat!(
            "{variant: ",
            $variant,
            ", id: 3, reply_id: 19, position_range: 12.5, velocity_range: 30, torque_range: 10, \
                stiffness_range: 500, damping_range: 5}"
        )
    };
}

/// Signals of both byte orders, with and without signs, of IEEE 754, behind switches, in standard
/// and extended messages.
const DBC_FILE: &str = r#"VERSION ""
BU_: Host Motor
BO_ 257 Command: 8 Host
 SG_ Page M : 0|4@1+ (1,0) [0|15] "" Motor
 SG_ Enable m1 : 4|2@1+ (1,0) [0|3] "" Motor
 SG_ Torque m1 : 15|16@0- (0.001,0) [-32|32] "Nm" Motor
 SG_ Position m2 : 8|24@1- (0.001,0) [-8000|8000] "deg" Motor
 SG_ Velocity m2 : 39|20@0- (0.01,0) [-5000|5000] "deg/s" Motor
BO_ 2147483905 Gains: 8 Host
 SG_ Stiffness : 0|32@1- (1,0) [0|0] "" Motor
 SG_ Damping : 39|12@0+ (0.001,0) [0|4] "" Motor
BO_ 2147484673 State: 8 Motor
 SG_ Page M : 60|4@1+ (1,0) [0|15] "" Host
 SG_ Position m3 : 7|32@0- (1,0) [0|0] "deg" Host
 SG_ Speed m5 : 4|17@1- (0.01,0) [0|0] "deg/s" Host
 SG_ Torque m5 : 31|16@0- (0.001,0) [0|0] "Nm" Host
BO_ 3 Health: 3 Motor
 SG_ On : 1|2@1+ (1,0) [0|3] "" Host
 SG_ Fault : 15|8@0+ (1,0) [0|255] "" Host
 SG_ Winding : 16|8@1+ (1,-40) [-40|215] "degC" Host
SIG_VALTYPE_ 2147483905 Stiffness : 1;
SIG_VALTYPE_ 2147484673 Position : 1;
"#;

fn cases() -> Vec<Case> {
    let case = |protocol, settings, mode, step| Case { protocol, settings, mode, step };
    let exact = [1e-5, 1e-5, 1e-5];
    let ranged = "{id: 7, position_range: 12.5, velocity_range: 30, torque_range: 12, \
        stiffness_range: 500, damping_range: 5}";
    let other = "{model: robstride, id: 8, position_range: 20, velocity_range: 44, torque_range: \
        17, stiffness_range: 300, damping_range: 3}";
    let cybergear = [25.0 / 65535.0, 60.0 / 65535.0, 24.0 / 65535.0];
    let odrive = "{node: 5, torque_feedback: true, enable_watchdog_endpoint: 11, \
        watchdog_timeout_endpoint: 12}";
    let moteus = [1e-5, 1e-5, 0.01];
    let cia402 = "{node: 6, rated_torque: 10, counts_per_turn: 65536, torque_offset: true}";
    let counted = [std::f64::consts::TAU / 65536.0, std::f64::consts::TAU / 65536.0, 0.01];
    let dbc = "{file: motor.dbc, enable: Command.Enable, enable_value: 2, disable_value: 1, \
        position: Command.Position, \
        velocity: Command.Velocity, torque: Command.Torque, stiffness: Gains.Stiffness, damping: \
        Gains.Damping, \
        measured_position: State.Position, measured_velocity: State.Speed, measured_torque: \
        State.Torque, temperature: Health.Winding, \
        fault: Health.Fault, enabled: Health.On, enabled_value: 3, position_unit: \
        0.017453292519943295, velocity_unit: 0.017453292519943295}";
    let vesc = "{id: 23, motor_torque_constant: 0.1, pole_pairs: 7}";
    let degrees = [1.75e-5, 1.75e-4, 1e-3];
    vec![
        case("mit", mit!("mini_cheetah"), Mode::Impedance, MIT_STEP),
        case("mit", mit!("t_motor"), Mode::Impedance, MIT_STEP),
        case("mit", mit!("damiao"), Mode::Impedance, MIT_STEP),
        case("mit", mit!("robstride"), Mode::Impedance, MIT_STEP),
        case("mit", mit!("damiao"), Mode::Torque, MIT_STEP),
        case("cybergear", ranged, Mode::Impedance, cybergear),
        case("cybergear", other, Mode::Impedance, [40.0 / 65535.0, 88.0 / 65535.0, 34.0 / 65535.0]),
        case("odrive", odrive, Mode::Torque, exact),
        case("odrive", odrive, Mode::Velocity, exact),
        case("odrive", odrive, Mode::Position, exact),
        case("moteus", "{id: 4, kp: 300, kd: 10}", Mode::Impedance, moteus),
        case("moteus", "{id: 4}", Mode::Torque, moteus),
        case("cia402", cia402, Mode::Torque, counted),
        case("cia402", cia402, Mode::Velocity, counted),
        case("cia402", cia402, Mode::Position, counted),
        case("rmd", "{id: 5, motor_torque_constant: 2}", Mode::Torque, [1.75e-4, 0.0175, 0.02]),
        case("vesc", vesc, Mode::Velocity, [3.5e-4, 0.015, 0.01]),
        case("vesc", vesc, Mode::Position, [3.5e-4, 0.015, 0.01]),
        case("dbc", dbc, Mode::Impedance, degrees),
        case("dbc", dbc, Mode::Position, degrees),
        case("dbc", dbc, Mode::Velocity, degrees),
        case("dbc", dbc, Mode::Torque, degrees),
    ]
}

impl Pair {
    fn new(case: &Case) -> Pair {
        let common = Common {
            mode: case.mode,
            watchdog_ms: WATCHDOG_MS,
            torque_limit: f64::INFINITY,
            velocity_limit: f64::INFINITY,
            period_ns: 2 * MS,
        };
        let protocol = protocol(case.protocol).unwrap();
        let mut diagnostics = Diagnostics::new(false);
        let node =
            yaml::read("drive.yml", case.settings.as_bytes().to_vec(), "a drive", &mut diagnostics)
                .unwrap();
        let settings = Settings::read(
            &node,
            "the drive",
            protocol.keys,
            &[],
            &|_| Ok(DBC_FILE.to_owned()),
            &mut diagnostics,
        );
        let drive = settings
            .as_ref()
            .and_then(|settings| (protocol.make)(settings, common, &mut diagnostics));
        let drive = drive.unwrap_or_else(|| panic!("{}", diagnostics.into_report()));
        let physics = Physics { inertia: 0.01, friction: 0.01, torque_limit: f64::INFINITY };
        let motor = Simulated::new(case.protocol, &settings.unwrap(), common, physics).unwrap();
        Pair {
            drive,
            motor,
            now_ns: 1_000 * MS,
            out: FrameQueue::new(64),
            back: FrameQueue::new(64),
            measured: None,
            malformed: 0,
        }
    }

    /// Two milliseconds in which the drive commands something; nothing where it is silent.
    fn cycle(&mut self, command: Option<DriveCommand>) {
        self.out.clear();
        if let Some(command) = command {
            self.drive.cycle(self.now_ns, command, &mut self.out);
        }
        self.out.push_some(self.drive.sync().filter(|_| command.is_some()));
        self.exchange();
        self.now_ns += 2 * MS;
        self.motor.step(self.now_ns, &mut self.back);
        self.exchange();
    }

    fn exchange(&mut self) {
        for frame in self.out.frames() {
            self.motor.receive(self.now_ns, frame, &mut self.back);
        }
        self.out.clear();
        for frame in self.back.frames() {
            match self.drive.receive(self.now_ns, frame) {
                Receipt::Measured(measured) => self.measured = Some(measured),
                Receipt::Malformed => self.malformed += 1,
                _ => {}
            }
        }
        self.back.clear();
        assert_eq!(self.malformed, 0);
    }

    fn cycles(&mut self, n: usize, command: DriveCommand) {
        (0..n).for_each(|_| self.cycle(Some(command)));
    }

    fn enabled(case: &Case, setpoint: Setpoint) -> Pair {
        let mut pair = Pair::new(case);
        pair.cycles(150, DriveCommand::Off);
        pair.cycles(150, DriveCommand::On(setpoint));
        assert!(pair.motor.plant.power, "{} {}", case.protocol, case.settings);
        assert_eq!(pair.drive.state().power, Power::On, "{} {}", case.protocol, case.settings);
        assert_eq!(pair.drive.state().fault, 0, "{} {}", case.protocol, case.settings);
        pair
    }
}

const HOLD: Setpoint =
    Setpoint { position: 0.5, velocity: 0.0, torque: 0.0, stiffness: 20.0, damping: 1.0 };

#[test]
fn every_motor_gets_power_only_when_it_shall_and_follows() {
    for case in cases() {
        let mut pair = Pair::new(&case);
        pair.cycles(150, DriveCommand::Off);
        assert!(!pair.motor.plant.power, "{}", case.settings);
        assert_eq!(pair.drive.state().power, Power::Off, "{}", case.settings);
        let pair = Pair::enabled(&case, Setpoint { velocity: 0.25, torque: 0.125, ..HOLD });
        let law = pair.motor.plant.law;
        let near =
            |got: f64, expected: f64, step: f64| (got - expected).abs() <= 0.51 * step + 1e-6;
        // torques and gains are rounded towards zero
        let below = |got: f64, expected: f64, step: f64| {
            near(got, expected, 2.0 * step) && got.abs() <= expected.abs() + 1e-6
        };
        let [p, v, t] = case.step;
        let follows = match case.mode {
            // its damping cannot be scaled above its stiffness: the rest of it comes as torque
            Mode::Impedance if case.protocol == "moteus" => {
                near(law.position, 0.5, p)
                    && near(law.stiffness, 20.0, 0.01)
                    && near(law.torque + law.damping * law.velocity, 0.125 + 1.0 * 0.25, 2.0 * t)
            }
            Mode::Impedance => {
                near(law.position, 0.5, p)
                    && near(law.velocity, 0.25, v)
                    && below(law.torque, 0.125, t)
                    && below(law.stiffness, 20.0, 500.0 / 4095.0)
                    && below(law.damping, 1.0, 5.0 / 4095.0)
            }
            // and a VESC nothing beside either
            Mode::Position if case.protocol == "vesc" => near(law.position, 0.5, p),
            Mode::Velocity if case.protocol == "vesc" => near(law.velocity, 0.25, v),
            // a CANopen drive takes no velocity beside a position
            Mode::Position if case.protocol == "cia402" => {
                near(law.position, 0.5, p) && below(law.torque, 0.125, t)
            }
            Mode::Position => {
                near(law.position, 0.5, p)
                    && near(law.velocity, 0.25, 0.001 * 6.3)
                    && below(law.torque, 0.125, 0.001)
            }
            Mode::Velocity => near(law.velocity, 0.25, v) && below(law.torque, 0.125, t),
            Mode::Torque => below(law.torque, 0.125, t),
        };
        assert!(follows, "{} {} {:?}: {law:?}", case.protocol, case.settings, case.mode);
    }
}

#[test]
fn what_a_motor_measures_is_what_its_drive_tells() {
    for case in cases() {
        let mut pair = Pair::new(&case);
        pair.cycles(150, DriveCommand::Off);
        // a shaft that somebody turns past the end of the range and back
        for place in (0..200).chain((0..200).rev()) {
            let position = f64::from(place) * 0.1;
            pair.motor.plant.carry(position, 0.0);
            pair.cycles(2, DriveCommand::Off);
            let measured = pair.measured.unwrap();
            let [p, v, _] = case.step;
            assert!(
                (measured.position - position).abs() <= p,
                "{} {}: {position} {measured:?}",
                case.protocol,
                case.settings
            );
            assert!(
                measured.velocity.abs() <= v,
                "{} {}: {measured:?}",
                case.protocol,
                case.settings
            );
        }
    }
}

#[test]
fn a_motor_that_hears_nothing_lets_go_in_its_time() {
    for case in cases() {
        let mut pair = Pair::enabled(&case, HOLD);
        let silent_ns = pair.now_ns;
        let read_back = pair.drive.state().watchdog;
        assert!(
            matches!(read_back, Watchdog::Set(WATCHDOG_MS) | Watchdog::Unreadable),
            "{} {read_back:?}",
            case.settings
        );
        while pair.motor.plant.tripped_ns.is_none() && pair.now_ns < silent_ns + 1_000 * MS {
            pair.cycle(None);
        }
        let tripped_ns = pair
            .motor
            .plant
            .tripped_ns
            .unwrap_or_else(|| panic!("{} {}", case.protocol, case.settings));
        let took_ms = (tripped_ns - silent_ns) / MS;
        // a CANopen drive waits for the master's heartbeat, which is rarer than set-points
        let least_ms = if case.protocol == "cia402" { 20 } else { 48 };
        assert!(
            (least_ms..=54).contains(&took_ms),
            "{} {}: {took_ms} ms",
            case.protocol,
            case.settings
        );
        let law = pair.motor.plant.law;
        assert!(
            !pair.motor.plant.power || (law.torque, law.stiffness) == (0.0, 0.0),
            "{} {}: {law:?}",
            case.protocol,
            case.settings
        );
    }
}

#[test]
fn a_fault_reaches_the_drive_stays_and_is_reset() {
    for case in cases() {
        if case.settings.contains("mini_cheetah") || case.protocol == "vesc" {
            // their replies have no word for faults
            continue;
        }
        let mut pair = Pair::enabled(&case, HOLD);
        pair.motor.fault(if case.settings.contains("damiao") { 9 } else { 2 });
        pair.cycles(100, DriveCommand::On(HOLD));
        assert_ne!(pair.drive.state().fault, 0, "{} {}", case.protocol, case.settings);
        assert!(!pair.motor.plant.power, "{} {}", case.protocol, case.settings);
        pair.motor.fault(0);
        pair.cycles(150, DriveCommand::Reset);
        pair.cycles(10, DriveCommand::Off);
        assert_eq!(pair.drive.state().fault, 0, "{} {}", case.protocol, case.settings);
        assert!(!pair.motor.plant.power, "{} {}", case.protocol, case.settings);
        pair.cycles(150, DriveCommand::On(HOLD));
        assert!(pair.motor.plant.power, "{} {}", case.protocol, case.settings);
    }
}

#[test]
fn the_disable_frames_take_power_whatever_was_said_before() {
    for case in cases() {
        let mut pair = Pair::enabled(&case, HOLD);
        pair.out.clear();
        let Pair { drive, out, .. } = &mut pair;
        drive.disable(out);
        pair.exchange();
        assert!(!pair.motor.plant.power, "{} {}", case.protocol, case.settings);
    }
}

#[test]
fn a_motor_that_answers_under_another_identifier_is_not_heard() {
    for case in cases() {
        let mut pair = Pair::new(&case);
        pair.motor.answer_wrongly(true);
        pair.cycles(150, DriveCommand::Off);
        assert_eq!(pair.measured, None, "{} {}", case.protocol, case.settings);
        assert_eq!(pair.drive.state().power, Power::Unknown, "{} {}", case.protocol, case.settings);
    }
}
