//! Whole bridges whose commands end at 4 rad/s, with a motor of every protocol and mode.

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::{Configuration, Surroundings};
use sarrus_can_core::drive::Mode;
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_sim::{Physics, Simulated};
use sarrus_models::LoadError;
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Operation, Reason};

use crate::closed_loop::{DBC, DBC_FILE, RANGES};

const MS: u64 = 1_000_000;
const EFFORT: f64 = 5.0;

/// A bridge at 500 Hz and its motor.
struct System {
    bridge: Bridge,
    motor: Simulated,
    now_ns: u64,
    command: ActuatorCommand,
    /// Greatest torque of the motor since it last was forgotten `[N m]`.
    torque: f64,
}

impl System {
    fn new(protocol: &str, keys: &str, mode: Mode, stop: &str) -> System {
        let text = format!(
            "rate_hz: 500\nramp_ms: 50\n{stop}\nbuses:\n- {{name: bus, channel: bus, \
             data_bitrate: 5000000}}\nmotors:\n- actuator: motor\n  bus: bus\n  drive: \
             {{protocol: {protocol}, mode: {}, {keys}}}\n  offset: 0\n  limits: {{position: [-9, \
             9], effort: {EFFORT}, velocity: 6}}\n  watchdog_ms: 100\n  watchdog: believed\n",
            mode.name()
        );
        let file = |_: &str| Ok(DBC_FILE.to_owned());
        let robot = |_: &_| Err(LoadError::Open("robot".into(), "absent".into()));
        let surroundings = Surroundings { file: &file, robot: &robot };
        let config = Configuration::read("stop.yml", text.into_bytes(), &surroundings)
            .unwrap_or_else(|report| panic!("{report}"));
        let physics = Physics { inertia: 0.02, friction: 0.01, torque_limit: f64::INFINITY };
        let motor = &config.motors[0];
        let motor =
            Simulated::new(motor.protocol.name, &motor.settings, motor.common, physics).unwrap();
        let command = ActuatorCommand { n_u: 1, ..ActuatorCommand::default() };
        let bridge = Bridge::new(config);
        System { bridge, motor, now_ns: 100 * MS, command, torque: 0.0 }
    }

    fn step(&mut self, velocity: Option<f64>) {
        self.now_ns += 2 * MS;
        if let Some(velocity) = velocity {
            self.command.sequence += 1;
            self.command.stamp_ns = self.now_ns;
            self.command.position[0] += velocity * 2e-3;
            self.command.velocity[0] = velocity;
            (self.command.stiffness[0], self.command.damping[0]) = (5.0, 1.0);
            self.bridge.command(self.now_ns, &self.command);
        }
        self.bridge.cycle(self.now_ns);
        let mut out = FrameQueue::new(64);
        for frame in self.bridge.frames(0) {
            self.motor.receive(self.now_ns, frame, &mut out);
        }
        self.motor.step(self.now_ns + MS, &mut out);
        self.torque = self.torque.max(self.motor.plant.torque.abs());
        out.frames().iter().for_each(|frame| self.bridge.receive(self.now_ns + MS, 0, frame));
    }

    fn state(&self) -> (MechanismState, Reason) {
        let state = self.bridge.state();
        let reason = Reason::from_code(state.reason).unwrap();
        (MechanismState::from_code(state.state).unwrap(), reason)
    }

    /// Armed, and as fast as can be stopped within the limits of the position.
    fn fast(&mut self, name: &str) {
        (0..300).for_each(|_| self.step(Some(0.0)));
        self.bridge.operate(self.now_ns, Operation::Arm);
        (0..600).for_each(|_| self.step(Some(0.0)));
        assert_eq!(self.state(), (MechanismState::Enabled, Reason::None), "{name}");
        (0..200).for_each(|_| self.step(Some(4.0)));
        if name.contains("velocity_feedback: false") {
            // whose gains have no velocity to damp
            let position = self.motor.plant.position;
            self.motor.plant.carry(position, 4.0);
            self.step(Some(4.0));
        }
        let velocity = self.motor.plant.velocity;
        assert!((velocity - 4.0).abs() < 0.5, "{name}: {velocity}");
        self.torque = 0.0;
    }

    /// The speed when the power went, and how long that took without commands.
    fn end(&mut self) -> (f64, u64) {
        let begin = self.now_ns;
        while self.motor.plant.power && self.now_ns - begin < 5000 * MS {
            self.step(None);
        }
        (self.motor.plant.velocity.abs(), self.now_ns - begin)
    }
}

fn every_mode() -> Vec<(&'static str, String, Mode)> {
    let damiao = format!("variant: damiao, id: 4, reply_id: 20, {RANGES}");
    let mini_cheetah = format!("variant: mini_cheetah, id: 4, reply_id: 20, {RANGES}");
    let cia402 = "node: 5, rated_torque: 2.0, counts_per_turn: 65536";
    let without_velocity = format!("{cia402}, velocity_feedback: false");
    let odrive = "node: 3, watchdog_timeout_endpoint: 300, enable_watchdog_endpoint: 301, \
        motor_torque_constant: 1";
    let dbc = DBC.trim_matches(['{', '}']);
    vec![
        ("mit", damiao.clone(), Mode::Impedance),
        ("mit", damiao, Mode::Torque),
        ("mit", mini_cheetah, Mode::Impedance),
        ("cybergear", "id: 10, position_range: 12.5".to_owned(), Mode::Impedance),
        ("moteus", "id: 1, kp: 4.0, kd: 0.05".to_owned(), Mode::Impedance),
        ("moteus", "id: 1".to_owned(), Mode::Torque),
        ("odrive", odrive.to_owned(), Mode::Torque),
        ("odrive", odrive.to_owned(), Mode::Velocity),
        ("odrive", odrive.to_owned(), Mode::Position),
        ("cia402", cia402.to_owned(), Mode::Torque),
        ("cia402", without_velocity, Mode::Torque),
        ("cia402", cia402.to_owned(), Mode::Velocity),
        ("cia402", cia402.to_owned(), Mode::Position),
        ("dbc", dbc.to_owned(), Mode::Torque),
    ]
}

#[test]
fn every_motor_whose_commands_end_stands_still_before_its_power_goes() {
    for (protocol, keys, mode) in every_mode() {
        let name = format!("{protocol} {} {keys}", mode.name());
        println!("{name}");
        // gains without a velocity swing beyond the limit before they are stopped
        let is_undamped = name.contains("velocity_feedback: false");
        let more = if is_undamped { "\nmonitors: {velocity: off, jump: off}" } else { "" };
        let mut system = System::new(protocol, &keys, mode, &format!("stop_ms: 400{more}"));
        system.fast(&name);
        let (speed, time_ns) = system.end();
        assert_eq!(system.state(), (MechanismState::Disabled, Reason::CommandLost), "{name}");
        assert!(speed < 0.1, "{name}: {speed}");
        assert!((490 * MS..520 * MS).contains(&time_ns), "{name}: {time_ns}");
        // drives that follow positions or velocities have efforts of their own
        let is_own = matches!(mode, Mode::Position | Mode::Velocity);
        assert!(is_own || system.torque <= 1.01 * EFFORT, "{name}: {}", system.torque);
    }
}

#[test]
fn a_load_of_many_times_the_inertia_stands_still_when_the_stop_is_over() {
    // the greatest effort stops 4 and 8 times the inertia in 64 and 128 ms of 400
    for factor in [4.0, 8.0] {
        for (protocol, keys, mode) in every_mode() {
            // where the drive's own loops stop, or nothing measures the speed, the bridge cannot
            let is_own = matches!(mode, Mode::Position | Mode::Velocity);
            if is_own || keys.contains("velocity_feedback: false") {
                continue;
            }
            for disarms in [false, true] {
                let name = format!("{factor} {protocol} {} {disarms}", mode.name());
                let mut system = System::new(protocol, &keys, mode, "stop_ms: 400");
                system.fast(&name);
                system.motor.plant.physics.inertia *= factor;
                if disarms {
                    system.bridge.operate(system.now_ns, Operation::Disarm);
                }
                let (speed, time_ns) = system.end();
                println!("{name}: {speed:.3} rad/s after {} ms", time_ns / MS);
                assert_eq!(system.state().0, MechanismState::Disabled, "{name}");
                assert!(speed < 0.1, "{name}: {speed}");
                // limited by the last measurement; the motor's own damper goes on until the next
                assert!(system.torque <= 1.05 * EFFORT, "{name}: {}", system.torque);
            }
        }
    }
}

#[test]
fn a_drive_that_stops_by_itself_brakes_and_has_no_power_then() {
    let keys = "node: 5, rated_torque: 2.0, counts_per_turn: 65536";
    for mode in [Mode::Torque, Mode::Velocity, Mode::Position] {
        let mut system = System::new("cia402", keys, mode, "stop_function: quick_stop");
        system.fast(mode.name());
        system.bridge.operate(system.now_ns, Operation::Disarm);
        system.step(None);
        assert_eq!(system.state(), (MechanismState::Stopping, Reason::Disarmed), "{mode:?}");
        let (speed, time_ns) = system.end();
        assert!(speed < 0.1, "{mode:?}: {speed} {:?}", system.state());
        // as soon as the drive is done, before `stop_ms`
        assert!(time_ns < 300 * MS, "{mode:?}: {time_ns}");
        (0..5).for_each(|_| system.step(None));
        assert_eq!(system.state(), (MechanismState::Disabled, Reason::Disarmed), "{mode:?}");
    }
}

#[test]
fn a_stop_that_a_protocol_or_a_robot_cannot_do_is_refused() {
    let refused = |stop: &str| {
        let text = format!(
            "rate_hz: 500\n{stop}\nbuses:\n- {{name: bus, channel: bus}}\nmotors:\n- actuator: \
             motor\n  bus: bus\n  drive: {{protocol: cybergear, id: 10, position_range: 12.5}}\n  \
             offset: 0\n  limits: {{position: [-100, 100], velocity: 50, effort: 5}}\n  \
             watchdog_ms: 100\n"
        );
        let robot = |_: &_| Err(LoadError::Open("robot".into(), "absent".into()));
        let surroundings = Surroundings { file: &|_| Err("absent".into()), robot: &robot };
        match Configuration::read("stop.yml", text.into_bytes(), &surroundings) {
            Ok(config) => format!("{:?}", config.stops[0]),
            Err(report) => report.to_string(),
        }
    };
    for (stop, found) in [
        ("stop_function: quick_stop", "cybergear has no command"),
        ("mechanisms: [{actuator: motor, stop_function: quick_stop}]", "cybergear has no command"),
        ("stop_function: lower", "without a model"),
        ("stop_function: brake", "ss1, ss2, quick_stop, lower, sto"),
        ("mechanisms: [{actuator: other}]", "there is no actuator"),
        ("mechanisms: [{actuator: motor}, {actuator: motor}]", "a second entry"),
        ("stop_ms: 300", "Ss1, stop_ns: 300000000, hold_ns: 0,"),
        (
            "stop_ms: 300\nmechanisms: [{actuator: motor, stop_function: ss2, hold_ms: 80}]",
            "Ss2, stop_ns: 300000000, hold_ns: 80000000,",
        ),
    ] {
        let given = refused(stop);
        assert!(given.contains(found), "{stop}: {given}");
    }
}
