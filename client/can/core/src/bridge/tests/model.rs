//! Each closed mechanism of the upper body assessed as one.

use super::robot::{RobotBench, as_it_is, heavier};
use super::*;

/// Cycles of 2 ms in which a fault must be seen: 20 ms.
const SOON: usize = 10;

/// Swings all independents, and nothing is found.
fn swing(bench: &mut RobotBench, cycles: usize) {
    for cycle in 0..cycles {
        let swing = 0.2 * (std::f64::consts::TAU * cycle as f64 / 2000.0).sin();
        bench.target.fill(swing);
        bench.step();
        for name in ["BodyActL", "ALElbowAct", "ALShoulder1", "ARWristRoll"] {
            assert_eq!(bench.state(name), (MechanismState::Enabled, Reason::None), "{cycle}");
        }
    }
}

#[test]
fn a_swing_with_noise_and_lost_answers_raises_no_alarm() {
    let mut bench = RobotBench::new(as_it_is, "model: {effort: 0.3}");
    bench.arm();
    swing(&mut bench, 10_000);
    assert!((bench.y("BodyPitch") - bench.target[0]).abs() < 0.05);
}

#[test]
fn masses_that_the_model_is_wrong_by_a_fifth_of_raise_no_alarm() {
    for factor in [0.8, 1.2] {
        let robot = RobotBench::new(heavier(factor), "");
        let mut bench = RobotBench::new(as_it_is, "model: {effort: 0.3}").over(robot);
        bench.arm();
        swing(&mut bench, 6000);
    }
}

#[test]
fn actuators_more_than_degrees_of_freedom_show_that_one_slipped() {
    let mut bench = RobotBench::redundant();
    bench.arm();
    swing(&mut bench, 4000);
    // the elbow's own sensor slips by 2 mrad a cycle, which its motor follows
    let elbow = bench.actuator("ALElbow");
    for _ in 0..25 {
        bench.shafts[elbow].lock().unwrap().slip += 0.002;
        bench.step();
    }
    assert_eq!(bench.state("ALElbow"), (MechanismState::Fault, Reason::LoopResidual));
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Fault, Reason::LoopResidual));
    assert_eq!(bench.state("BodyActL"), (MechanismState::Enabled, Reason::None));
}

#[test]
fn gravity_is_what_holds_the_robot_where_it_is() {
    let mut bench = RobotBench::new(as_it_is, "");
    bench.arm();
    bench.target.fill(0.1);
    bench.steps(1000);
    for (actuator, most) in [("BodyActL", 10.0), ("ALElbowAct", 10.0), ("ALShoulder2", 0.5)] {
        let place = bench.actuator(actuator);
        let effort = bench.shafts[place].lock().unwrap().effort;
        let motor = bench.bridge.motors.iter().find(|motor| motor.config.actuator == place);
        let gravity = motor.unwrap().gravity;
        assert!((effort - gravity).abs() < most, "{actuator}: {effort} for {gravity}");
        assert!(gravity.abs() > most / 4.0);
    }
}

#[test]
fn an_independent_beyond_its_limit_stops_its_mechanism() {
    let narrow = |urdf: &str| {
        let (before, after) = urdf.split_once("joint name=\"BodyPitch\"").unwrap();
        format!(
            "{before}joint name=\"BodyPitch\"{}",
            after.replacen("upper=\"1.5\"", "upper=\"0.3\"", 1)
        )
    };
    let mut bench = RobotBench::new(narrow, "");
    bench.arm();
    let pitch = bench.independent("BodyPitch");
    while bench.y("BodyPitch") < 0.28 {
        bench.target[pitch] += 0.0002;
        bench.step();
        assert_eq!(bench.state("BodyActL").1, Reason::None);
    }
    bench.target[pitch] = 0.6;
    bench.until_it_stops("BodyActL", 500);
    assert!(bench.y("BodyPitch") < 0.33, "{}", bench.y("BodyPitch"));
    assert_eq!(bench.state("BodyActR"), (MechanismState::Stopping, Reason::MechanismLimit));
    // another mechanism follows on
    assert_eq!(bench.state("ALElbowAct").0, MechanismState::Enabled);
    bench.steps(400);
    assert!(bench.y("BodyPitch") < 0.36, "{}", bench.y("BodyPitch"));
}

#[test]
fn commands_that_no_pose_has_do_not_press_the_screws_against_each_other() {
    let mut bench = RobotBench::new(as_it_is, "model: {clearance: 0}");
    bench.arm();
    let mut commanded = vec![0.0; bench.names.len()];
    let left = bench.actuator("BodyActL");
    let right = bench.actuator("BodyActR");
    // both as far as their limits let them: the torso cannot bend so far
    (commanded[left], commanded[right]) = (0.085, 0.085);
    bench.commanded = Some(commanded);
    let cycles = bench.until_it_stops("BodyActL", 1500);
    assert!(cycles > 100, "{cycles}");
    assert_eq!(bench.state("BodyActL").1, Reason::MechanismLimit);
}

#[test]
fn a_mechanism_that_comes_near_a_singular_pose_is_stopped_and_may_come_back() {
    let mut bench = RobotBench::new(as_it_is, "");
    bench.arm();
    let elbow = bench.independent("ALElbow");
    for _ in 0..2000 {
        bench.target[elbow] -= 0.0005;
        bench.step();
        if bench.state("ALElbowAct").0 != MechanismState::Enabled {
            break;
        }
    }
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Stopping, Reason::NearSingular));
    // the elbow's screw loses its lever at -0.8
    let stopped = bench.y("ALElbow");
    assert!((-0.75..-0.6).contains(&stopped), "{stopped}");
    bench.steps(400);
    assert!((bench.y("ALElbow") - stopped).abs() < 0.05, "{}", bench.y("ALElbow"));
    assert_eq!(bench.state("ALElbowAct").0, MechanismState::Fault);
    // it comes back, while somebody carries the forearm: gains begin at zero
    bench.push("ALElbow", 6.4);
    bench.target[elbow] = bench.y("ALElbow");
    bench.bridge.operate(bench.now_ns, Operation::Reset);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    for _ in 0..1000 {
        bench.target[elbow] += 0.0005;
        bench.step();
    }
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Enabled, Reason::None));
}

#[test]
fn a_fast_mechanism_stops_before_its_limit_and_before_a_singular_pose() {
    for (speed, end) in [(0.4, 0.5), (0.8, 0.5), (1.25, -0.8), (0.8, -0.8)] {
        let narrow = |urdf: &str| {
            let (before, after) = urdf.split_once("joint name=\"ALElbow\"").unwrap();
            format!(
                "{before}joint name=\"ALElbow\"{}",
                after.replacen("upper=\"1.5\"", "upper=\"0.5\"", 1)
            )
        };
        let keys = "monitors: {jump: off, velocity: off, position: off, following_ms: off}";
        let mut bench = RobotBench::new(narrow, keys);
        let elbow_act = bench.actuator("ALElbowAct");
        let motors = &mut bench.bridge.motors;
        let motor = motors.iter_mut().find(|motor| motor.config.actuator == elbow_act).unwrap();
        motor.config.limits.velocity = 1.0;
        bench.arm();
        let elbow = bench.independent("ALElbow");
        let mut farthest = 0.0_f64;
        for _ in 0..1500 {
            bench.target[elbow] += speed * f64::signum(end) * 2e-3;
            bench.step();
            farthest = farthest.max(bench.y("ALElbow") * f64::signum(end));
            if bench.state("ALElbowAct").0 != MechanismState::Enabled {
                bench.steps(300);
                break;
            }
        }
        farthest = farthest.max(bench.y("ALElbow") * f64::signum(end));
        let reason = if end > 0.0 { Reason::MechanismLimit } else { Reason::NearSingular };
        println!("{speed} rad/s to {end}: {farthest:.3}");
        assert_eq!(bench.state("ALElbowAct"), (MechanismState::Fault, reason), "{speed} {end}");
        let most = if end > 0.0 { end + 0.02 } else { 0.78 };
        assert!(farthest < most, "{speed} {end}: {farthest}");
    }
}

#[test]
fn positions_that_no_pose_has_are_a_fault_and_are_not_armed() {
    // the monitors of single motors would be first
    let keys = "monitors: {jump: off, velocity: off, position: off}";
    let mut bench = RobotBench::new(as_it_is, keys);
    bench.arm();
    let left = bench.actuator("BodyActL");
    bench.shafts[left].lock().unwrap().slip = 0.5;
    bench.until_it_stops("BodyActL", SOON);
    assert_eq!(bench.state("BodyActL"), (MechanismState::Fault, Reason::Unreachable));
    bench.bridge.operate(bench.now_ns, Operation::Reset);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(1200);
    // the same position is outside the limits of its actuator
    assert_eq!(bench.state("BodyActL"), (MechanismState::Disabled, Reason::OutsideLimits));
}

#[test]
fn efforts_that_contradict_the_model_stop_the_mechanism() {
    // somebody holds the elbow: 60 N m at 0.1 m are 600 N more than the model knows of
    let mut bench = RobotBench::new(as_it_is, "model: {effort: 0.3}");
    bench.arm();
    bench.steps(500);
    bench.push("ALElbow", 60.0);
    bench.until_it_stops("ALElbowAct", 2 * SOON);
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Stopping, Reason::ModelEffort));

    // the effort of one of the torso's twins does not arrive, and the other carries the load
    let mut bench = RobotBench::new(as_it_is, "model: {effort: 0.1}");
    bench.arm();
    let pitch = bench.independent("BodyPitch");
    let left = bench.actuator("BodyActL");
    for _ in 0..1000 {
        bench.target[pitch] += 0.0005;
        bench.step();
    }
    assert_eq!(bench.state("BodyActL"), (MechanismState::Enabled, Reason::None));
    bench.shafts[left].lock().unwrap().is_limp = true;
    bench.until_it_stops("BodyActL", 2 * SOON);

    // and where efforts are not compared nothing is said
    let mut bench = RobotBench::new(as_it_is, "");
    bench.arm();
    bench.push("ALElbow", 60.0);
    bench.steps(100);
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Enabled, Reason::None));
}

#[test]
fn a_missing_motor_keeps_only_its_own_mechanism_from_arming() {
    let mut bench = RobotBench::new(as_it_is, "");
    bench.silent = vec![bench.actuator("BodyActR"), bench.actuator("ARWristRoll")];
    bench.steps(20);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(1100);
    for (name, expected) in [
        ("BodyActL", (MechanismState::Disabled, Reason::FeedbackStale)),
        ("ARWristRoll", (MechanismState::Disabled, Reason::FeedbackStale)),
        ("ALElbowAct", (MechanismState::Enabled, Reason::None)),
        ("BodyYaw", (MechanismState::Enabled, Reason::None)),
    ] {
        assert_eq!(bench.state(name), expected, "{name}");
    }
}

#[test]
fn an_encoder_beside_the_motors_shows_that_a_sensor_slipped() {
    let keys = "encoders:\n- {joint: ALElbow, bus: left_arm, id: 0x181, byte: 1, bits: 16, scale: \
        1e-4, margin: 0.03}";
    let mut bench = RobotBench::new(as_it_is, keys);
    bench.encoder = Some(0.0);
    bench.arm();
    let elbow = bench.independent("ALElbow");
    for cycle in 0..2000 {
        bench.target[elbow] = 0.2 * (std::f64::consts::TAU * cycle as f64 / 1000.0).sin();
        bench.step();
        assert_eq!(bench.state("ALElbowAct").1, Reason::None, "{cycle}");
    }
    // the motor's sensor slips by a tenth of a millimetre a cycle, too little for anybody else
    let actuator = bench.actuator("ALElbowAct");
    for _ in 0..100 {
        bench.shafts[actuator].lock().unwrap().slip += 0.0001;
        bench.step();
    }
    assert_eq!(bench.state("ALElbowAct"), (MechanismState::Fault, Reason::LoopResidual));
    assert_eq!(bench.state("BodyActL").0, MechanismState::Enabled);
    // it is not armed as long as they contradict, nor when the encoder is silent
    for (encoder, reason) in [(Some(0.0), Reason::LoopResidual), (None, Reason::FeedbackStale)] {
        bench.encoder = encoder;
        bench.bridge.operate(bench.now_ns, Operation::Reset);
        bench.bridge.operate(bench.now_ns, Operation::Arm);
        bench.steps(1200);
        assert_eq!(bench.state("ALElbowAct"), (MechanismState::Disabled, reason));
    }
}
