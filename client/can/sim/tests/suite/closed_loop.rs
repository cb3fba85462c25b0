//! Each drive with a simulated motor of its protocol, which was written from the makers' manuals
//! alone: power, set-points, watchdog.

use crate::support::{settled, torque};
use sarrus_can_core::drive::{
    Drive, DriveCommand, Measurement, Mode, Power, Receipt, Setpoint, Watchdog,
};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::Common;
use sarrus_can_sim::{Physics, Simulated};

pub(crate) const RANGES: &str = "position_range: 12.5, velocity_range: 45, torque_range: 18, \
    stiffness_range: 500, damping_range: 5";
const MS: u64 = 1_000_000;
/// A motor whose torque is Motorola and whose measurements are Intel.
pub(crate) const DBC_FILE: &str = "BO_ 32 Set: 8 Host\n SG_ Power : 0|1@1+ (1,0) [0|1] \"\" Motor\n SG_ \
    Torque : 23|16@0- (0.001,0) [0|0] \"Nm\" Motor\n\
    BO_ 33 Is: 8 Motor\n SG_ Power : 0|1@1+ (1,0) [0|1] \"\" Host\n SG_ Fault : 1|7@1+ (1,0) \
    [0|0] \"\" Host\n\
     SG_ Turn : 8|24@1- (0.0001,0) [0|0] \"rad\" Host\n SG_ Speed : 32|16@1- (0.01,0) [0|0] \
     \"rad/s\" Host\n";
pub(crate) const DBC: &str = "{file: motor.dbc, enable: Set.Power, torque: Set.Torque, measured_position: \
    Is.Turn, measured_velocity: Is.Speed, \
    fault: Is.Fault, enabled: Is.Power}";

const VESC: &str = "{id: 23, motor_torque_constant: 0.1, pole_pairs: 7}";

/// A bus with one motor, at 500 Hz.
pub(crate) struct Bench {
    pub(crate) drive: Box<dyn Drive>,
    pub(crate) motor: Simulated,
    now_ns: u64,
    pub(crate) measured: Option<Measurement>,
    replies: FrameQueue,
}

impl Bench {
    pub(crate) fn new(protocol: &str, yaml: &str, mode: Mode) -> Bench {
        let common = Common {
            mode,
            watchdog_ms: 50,
            torque_limit: 5.0,
            velocity_limit: 50.0,
            period_ns: 2 * MS,
        };
        let (drive, settings) = settled(protocol, yaml, common, DBC_FILE).unwrap();
        let motor = Simulated::new(
            protocol,
            &settings,
            common,
            Physics { inertia: 0.05, friction: 0.5, torque_limit: 10.0 },
        )
        .expect("a simulated motor");
        Bench { drive, motor, now_ns: 1_000 * MS, measured: None, replies: FrameQueue::new(256) }
    }

    pub(crate) fn cycle(&mut self, command: DriveCommand) {
        let mut sent = FrameQueue::new(32);
        self.drive.cycle(self.now_ns, command, &mut sent);
        self.drive.sync().into_iter().for_each(|sync| sent.push(sync));
        self.pass(&sent, 2);
    }

    /// Frames go to the motor, time passes, answers come back.
    pub(crate) fn pass(&mut self, sent: &FrameQueue, ms: u64) {
        sent.frames().iter().for_each(|frame| {
            self.motor.receive(self.now_ns, frame, &mut self.replies);
        });
        for _ in 0..ms {
            self.now_ns += MS;
            self.motor.step(self.now_ns, &mut self.replies);
        }
        for frame in self.replies.frames() {
            match self.drive.receive(self.now_ns, frame) {
                Receipt::Measured(measured) => self.measured = Some(measured),
                Receipt::Malformed => panic!("the motor's {frame} is malformed"),
                _ => {}
            }
        }
        self.replies.clear();
    }

    pub(crate) fn power_on(&mut self, setpoint: Setpoint) {
        (0..200).for_each(|_| self.cycle(DriveCommand::Off));
        assert_eq!((self.drive.state().power, self.drive.state().fault), (Power::Off, 0));
        assert!(self.motor.follows().is_none());
        assert!(self.measured.is_some(), "a motor without power tells where it is");
        (0..120).for_each(|_| self.cycle(DriveCommand::On(setpoint)));
        assert_eq!((self.drive.state().power, self.drive.state().fault), (Power::On, 0));
    }
}

fn benches() -> Vec<(&'static str, Bench)> {
    let mit = |variant: &str| {
        Bench::new(
            "mit",
            &format!("{{variant: {variant}, id: 4, reply_id: 20, {RANGES}}}"),
            Mode::Torque,
        )
    };
    vec![
        ("mini_cheetah", mit("mini_cheetah")),
        ("t_motor", mit("t_motor")),
        ("damiao", mit("damiao")),
        ("robstride", mit("robstride")),
        ("cybergear", Bench::new("cybergear", "{id: 10, position_range: 12.5}", Mode::Torque)),
        (
            "odrive",
            Bench::new(
                "odrive",
                "{node: 3, watchdog_timeout_endpoint: 300, enable_watchdog_endpoint: 301}",
                Mode::Torque,
            ),
        ),
        ("moteus", Bench::new("moteus", "{id: 1}", Mode::Torque)),
        (
            "cia402",
            Bench::new(
                "cia402",
                "{node: 5, rated_torque: 2.0, counts_per_turn: 65536}",
                Mode::Torque,
            ),
        ),
        ("rmd", Bench::new("rmd", "{id: 2, motor_torque_constant: 2.0}", Mode::Torque)),
        ("vesc", Bench::new("vesc", VESC, Mode::Torque)),
        (
            "ak_servo",
            Bench::new(
                "ak_servo",
                "{id: 6, motor_torque_constant: 1.0, pole_pairs: 21, reduction: 9}",
                Mode::Torque,
            ),
        ),
        ("dbc", Bench::new("dbc", DBC, Mode::Torque)),
    ]
}

#[test]
fn every_motor_gets_power_and_follows_a_torque() {
    for (name, mut bench) in benches() {
        println!("{name}");
        let setpoint = Setpoint { torque: 0.5, ..Setpoint::default() };
        bench.power_on(setpoint);
        let follows = bench.motor.follows().expect("power");
        // rounded towards zero
        assert!((0.49..=0.5 + 1e-6).contains(&follows.torque), "{name}: {follows:?}");
        assert!((follows.stiffness, follows.damping) == (0.0, 0.0), "{name}: {follows:?}");
        let measured = bench.measured.unwrap();
        assert!(
            (measured.position - bench.motor.plant.position).abs() < 0.2,
            "{name}: {measured:?} {}",
            bench.motor.plant.position
        );
        assert!(measured.position > 0.0, "{name}: it turns the way it is told");
    }
}

#[test]
fn a_motor_whose_supply_was_away_is_set_up_anew() {
    for (name, mut bench) in benches() {
        println!("{name}");
        let watchdog =
            |bench: &Bench| (bench.drive.state().watchdog, bench.motor.plant.watchdog_ns);
        bench.power_on(Setpoint::default());
        let before = watchdog(&bench);
        // while it had power: nothing is powered again by itself; where each frame is a whole
        // command, as a DBC file's is here, that a motor was away is seen by its silence, which is
        // the bridge's to assess
        bench.motor.reboot();
        (0..200).for_each(|_| bench.cycle(DriveCommand::On(Setpoint::default())));
        assert!(bench.motor.follows().is_none() || name == "dbc", "{name}");
        // while it was off
        for reset in [true, false] {
            (0..20).for_each(|_| {
                bench.cycle(if reset { DriveCommand::Reset } else { DriveCommand::Off })
            });
            bench.motor.reboot();
            bench.drive.prepare();
            let state = bench.drive.state();
            assert!(
                matches!(state.watchdog, Watchdog::Unknown | Watchdog::Unreadable)
                    || before.1 == 0
                    || name == "rmd",
                "{name}: {state:?}"
            );
            bench.power_on(Setpoint::default());
            assert_eq!(watchdog(&bench), before, "{name}");
        }
    }
}

#[test]
fn every_watchdog_that_can_be_read_was_set_and_acts() {
    for (name, mut bench) in benches() {
        println!("{name}");
        // some have power for a torque that is not zero only
        bench.power_on(torque(0.1));
        let watchdog = bench.drive.state().watchdog;
        let is_readable =
            !matches!(name, "mini_cheetah" | "t_motor" | "robstride" | "dbc" | "vesc" | "ak_servo");
        assert_eq!(
            watchdog,
            if is_readable { Watchdog::Set(50) } else { Watchdog::Unreadable },
            "{name}"
        );
        bench.pass(&FrameQueue::new(1), 30);
        assert!(bench.motor.follows().is_some(), "{name}");
        bench.pass(&FrameQueue::new(1), 25);
        let is_off =
            bench.motor.follows().is_none_or(|law| law.torque == 0.0 && law.stiffness == 0.0);
        assert!(is_off, "{name}: {:?}", bench.motor.follows());
    }
}

#[test]
fn every_motor_turns_its_torque_off_by_the_frames_of_the_way_out() {
    for (name, mut bench) in benches() {
        bench.power_on(Setpoint { torque: 0.1, ..Setpoint::default() });
        let mut frames = FrameQueue::new(8);
        bench.drive.disable(&mut frames);
        bench.pass(&frames, 2);
        assert!(bench.motor.follows().is_none(), "{name}");
    }
}

#[test]
fn a_motor_with_a_fault_is_told_and_reset() {
    for (name, mut bench) in benches() {
        // their replies have no room for a fault
        if matches!(name, "mini_cheetah" | "vesc") {
            continue;
        }
        bench.power_on(Setpoint::default());
        bench.motor.fault(if name == "damiao" { 0xA } else { 4 });
        (0..60).for_each(|_| bench.cycle(DriveCommand::On(Setpoint::default())));
        assert!(bench.drive.state().fault != 0, "{name}");
        assert!(bench.motor.follows().is_none(), "{name} has power again by itself");
        bench.motor.fault(0);
        bench.cycle(DriveCommand::Reset);
        (0..200).for_each(|_| bench.cycle(DriveCommand::Off));
        bench.power_on(Setpoint::default());
    }
}

#[test]
fn every_parameter_that_a_drive_reads_is_answered() {
    for (name, mut bench) in benches() {
        (0..200).for_each(|_| bench.cycle(DriveCommand::Off));
        for (place, parameter) in bench.drive.parameters().iter().enumerate() {
            let mut asked = FrameQueue::new(4);
            bench.drive.read_parameter(place, &mut asked);
            asked.frames().iter().for_each(|frame| {
                bench.motor.receive(bench.now_ns, frame, &mut bench.replies);
            });
            let found = bench.replies.frames().iter().find_map(|frame| {
                match bench.drive.receive(bench.now_ns, frame) {
                    Receipt::Parameter(found, value) if found == place => Some(value),
                    _ => None,
                }
            });
            assert!(found.is_some_and(f64::is_finite), "{name}: {} {found:?}", parameter.name);
            bench.replies.clear();
        }
    }
}

#[test]
fn impedance_goes_through_every_protocol_that_has_it() {
    let setpoint =
        Setpoint { position: 0.3, velocity: 0.1, torque: 0.2, stiffness: 0.5, damping: 0.005 };
    let mit = format!("{{variant: damiao, id: 4, reply_id: 20, {RANGES}}}");
    for (protocol, yaml) in [
        ("mit", mit.as_str()),
        ("cybergear", "{id: 10, position_range: 12.5}"),
        ("moteus", "{id: 1, kp: 4.0, kd: 0.05}"),
    ] {
        let mut bench = Bench::new(protocol, yaml, Mode::Impedance);
        bench.power_on(setpoint);
        let law = bench.motor.follows().expect("power");
        let near = |a: f64, b: f64, by: f64| assert!((a - b).abs() < by, "{protocol}: {a} {b}");
        near(law.position, 0.3, 1e-3);
        near(law.velocity, 0.1, 0.012);
        // rounded towards zero
        near(law.torque, 0.2, 0.011);
        near(law.stiffness, 0.5, 0.125);
        near(law.damping, 0.005, 1.3e-3);
    }
}
