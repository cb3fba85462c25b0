//! End to end: 13 simulated motors on three buses, a bridge and a controller, each a separate
//! process. The tests judge the motors' reports: the last command, and the time of the safe state.

use std::time::{Duration, Instant};

use serde_json::Value;

use super::harness::{
    Allowance, BUSES, FRONTENDS, Frontend, N_U, Process, Stage, gear, sign, takes_power, wait_for,
};

/// Motors, a bridge and a controller, with power on all motors.
struct System {
    // in the order in which they end
    controller: Process,
    bridge: Process,
    motors: Vec<Process>,
    stage: Stage,
}

impl System {
    fn new(frontend: Frontend) -> System {
        let stage = Stage::new();
        let motors = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
        let bridge = stage.bridge(frontend);
        let controller = stage.controller();
        System { controller, bridge, motors, stage }
    }

    fn armed(frontend: Frontend) -> System {
        let mut system = System::new(frontend);
        system.arm();
        system
    }

    fn arm(&mut self) {
        self.controller.tell("arm");
        wait_for("power", || {
            let state = self.controller.state()["state"].clone();
            if state == "fault" {
                // of a late process; a fault of a motor comes back
                self.controller.tell("reset");
                self.controller.tell("arm");
            }
            (state == "enabled").then_some(())
        });
        assert_eq!(self.report().len(), N_U);
        assert!(self.report().iter().all(|motor| motor["power"] == true));
    }

    fn controller_sees(&mut self, expected: &str) {
        let mut state = Value::Null;
        let mut allowance = Allowance::new();
        while allowance.is_left() {
            state = self.controller.state();
            if state["state"] == expected {
                return;
            }
        }
        panic!("the bridge is not {expected}: {state}");
    }

    /// Reports of all motors, in the order of u.
    fn report(&mut self) -> Vec<Value> {
        self.motors.iter_mut().flat_map(Process::report).collect()
    }

    /// Waits until no motor has power. `check` judges the time that each motor went without
    /// set-points, by the motor's own clock.
    fn safe(&mut self) -> Vec<Value> {
        wait_for("motors without power", || {
            let report = self.report();
            report.iter().all(|motor| motor["power"] == false).then_some(report)
        })
    }

    /// Checks that no motor gets power for longer than every time-out.
    fn stays_safe(&mut self) {
        let end = Instant::now() + Duration::from_millis(2 * self.stage.times[1]);
        while Instant::now() < end {
            assert!(self.report().iter().all(|motor| motor["power"] == false));
        }
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn motors_get_power_only_when_armed_and_first_where_they_are() {
    for frontend in FRONTENDS {
        let mut system = System::new(frontend);
        // commands alone do not switch the power on
        system.controller_sees("disabled");
        system.stays_safe();
        for motors in &system.motors {
            assert!(motors.said().iter().all(|event| event["event"] != "power"), "{frontend:?}");
        }
        system.controller.tell("target 0.02");
        system.controller.tell("arm");
        system.controller_sees("enabled");
        // no motor jumps: the way from its position and the gains grow together, so that a motor
        // that is busy when power comes sees both at the same share
        let mut place = 0;
        for (motors, (bus, actuators)) in system.motors.iter().zip(BUSES) {
            for actuator in actuators {
                let is_first = |event: &Value| {
                    event["event"] == "first_setpoint" && event["motor"] == *actuator
                };
                let first = &motors.until(is_first)["value"];
                let gear = gear(actuator);
                let way = number(&first["position"]) / (sign(place) * gear * 0.02);
                let gain = number(&first["stiffness"])
                    / (if gear > 50.0 { 5000.0 } else { 20.0 } / (gear * gear));
                assert!(
                    (way - gain).abs() < 0.05 && (-0.01..=1.01).contains(&way),
                    "{frontend:?} {bus} {actuator}: {way} {gain} {first}"
                );
                assert!(number(&first["torque"]).abs() <= 20.0 / 4095.0, "{first}");
                place += 1;
            }
        }
    }
}

#[test]
fn motors_follow_the_commands_of_the_actuators() {
    for frontend in FRONTENDS {
        let mut system = System::armed(frontend);
        for target in [0.03, -0.02] {
            system.controller.tell(&format!("target {target}"));
            // gear, sign and codec agree on both sides: a motor's set-point is the command within
            // half a step of the codec, and half a step more for the measured start
            let actuators: Vec<&str> =
                BUSES.iter().flat_map(|(_, actuators)| actuators.iter().copied()).collect();
            wait_for("motors at the target", || {
                let report = system.report();
                if report.iter().any(|motor| motor["power"] == false) {
                    system.arm();
                    return None;
                }
                let good = |(place, motor): (usize, &Value)| {
                    assert_eq!(motor["motor"], actuators[place]);
                    let desired = sign(place) * gear(actuators[place]) * target;
                    let given = motor["setpoint"]["position"].as_f64();
                    let is_given =
                        given.is_some_and(|given| (given - desired).abs() <= 25.1 / 65535.0);
                    is_given && (number(&motor["actuator_position"]) - target).abs() < 2e-3
                };
                report.iter().enumerate().all(good).then_some(())
            });
            // the controller receives the motors' positions
            let state = system.controller.state();
            for place in 0..N_U {
                assert!(
                    (number(&state["position"][place]) - target).abs() < 4e-3,
                    "{frontend:?} {state}"
                );
            }
        }
    }
}

#[test]
fn commands_that_are_none_bring_damping_then_no_power_and_never_reach_a_motor() {
    for frontend in FRONTENDS {
        for order in ["nan 7", "old", "quiet"] {
            let mut system = System::armed(frontend);
            system.controller.tell(order);
            // in between every motor is damped: no stiffness, some damping
            let report = wait_for("damping", || {
                let report = system.report();
                report
                    .iter()
                    .any(|motor| {
                        motor["power"] == false || number(&motor["setpoint"]["stiffness"]) == 0.0
                    })
                    .then_some(report)
            });
            for motor in &report {
                if motor["power"] == true {
                    let finite = |key: &str| motor["setpoint"][key].is_number();
                    assert!(
                        ["position", "velocity", "torque", "stiffness", "damping"]
                            .iter()
                            .all(|key| finite(key)),
                        "{order}: {motor}"
                    );
                    assert!(
                        number(&motor["setpoint"]["torque"]).abs() <= 20.0 / 4095.0,
                        "{order}: {motor}"
                    );
                }
            }
            // the bridge's frames did it, and no watchdog had to
            let report = system.safe();
            assert!(
                report.iter().all(|motor| motor["tripped"] == false && takes_power(motor)),
                "{frontend:?} {order}: {report:?}"
            );
            // valid commands do not restore the power
            system.controller.tell("good");
            system.stays_safe();
            system.controller_sees("disabled");
            // an operator does
            system.arm();
        }
    }
}

#[test]
fn motors_go_safe_when_the_controller_is_stopped_or_killed() {
    for frontend in FRONTENDS {
        let mut system = System::armed(frontend);
        system.controller.signal("-STOP");
        let report = system.safe();
        assert!(
            report.iter().all(|motor| motor["tripped"] == false && takes_power(motor)),
            "{frontend:?}: {report:?}"
        );
        system.controller.signal("-CONT");
        system.stays_safe();
        system.arm();
        system.controller.signal("-KILL");
        let report = system.safe();
        assert!(
            report.iter().all(|motor| motor["tripped"] == false && takes_power(motor)),
            "{frontend:?}: {report:?}"
        );
        // another controller may connect, and an operator may arm again
        system.controller = system.stage.controller();
        system.stays_safe();
        system.arm();
    }
}

#[test]
fn motors_go_safe_by_themselves_when_the_bridge_is_stopped_or_killed() {
    for frontend in FRONTENDS {
        let mut system = System::armed(frontend);
        system.bridge.signal("-STOP");
        let report = system.safe();
        assert!(report.iter().all(|motor| motor["tripped"] == true), "{frontend:?}: {report:?}");
        for motor in &report {
            assert!(number(&motor["watchdog_ms"]) == system.stage.times[2] as f64, "{motor}");
        }
        system.bridge.signal("-CONT");
        system.stays_safe();
        let mut system = System::armed({
            drop(system);
            frontend
        });
        system.bridge.signal("-KILL");
        let report = system.safe();
        assert!(
            report.iter().all(|motor| motor["tripped"] == true && !takes_power(motor)),
            "{frontend:?}: {report:?}"
        );
    }
}

#[test]
fn the_bridge_takes_the_power_on_every_way_out() {
    for frontend in FRONTENDS {
        for signal in ["-INT", "-TERM", "-HUP", "-QUIT", "-TSTP"] {
            let mut system = System::armed(frontend);
            system.bridge.signal(signal);
            assert_eq!(system.bridge.end().code(), Some(0), "{frontend:?} {signal}");
            let report = system.report();
            let taken = |motor: &Value| {
                motor["power"] == false && motor["tripped"] == false && takes_power(motor)
            };
            assert!(report.iter().all(taken), "{frontend:?} {signal}: {report:?}");
        }
        // the parent dies: kills the shell that started the bridge
        let stage = Stage::new();
        let motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
        let inner = stage.bridge_command(frontend);
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", "\"$@\" & wait", "sh"]).arg(inner.get_program()).args(inner.get_args());
        shell.envs(inner.get_envs().filter_map(|(name, value)| Some((name, value?))));
        let bridge = Process::start("shell", shell);
        assert!(bridge.line().starts_with("ready "));
        let controller = stage.controller();
        let mut system = System { controller, bridge, motors, stage };
        system.arm();
        system.bridge.signal("-KILL");
        let report = system.safe();
        assert!(
            report.iter().all(|motor| motor["tripped"] == false && takes_power(motor)),
            "{frontend:?}: {report:?}"
        );
    }
}

#[test]
fn motors_of_other_buses_go_on_when_those_of_one_bus_are_stopped_or_killed() {
    for frontend in FRONTENDS {
        for signal in ["-STOP", "-KILL"] {
            let mut system = System::armed(frontend);
            let [torso, left, right] = [0, 1, 2];
            system.motors[torso].signal(signal);
            system.controller_sees("fault");
            // the torso's mechanisms are in fault, those of the arms follow
            let state = system.controller.state();
            let states = state["states"].as_array().unwrap();
            let (of_torso, of_arms) = states.split_at(BUSES[torso].1.len());
            assert!(
                of_torso.iter().all(|state| state == "fault"),
                "{frontend:?} {signal}: {state}"
            );
            assert!(
                of_arms.iter().all(|state| state == "enabled"),
                "{frontend:?} {signal}: {state}"
            );
            system.controller.tell("target 0.03");
            for bus in [left, right] {
                wait_for("arms at the target", || {
                    let near = |motor: &Value| {
                        motor["power"] == true
                            && (number(&motor["actuator_position"]) - 0.03).abs() < 2e-3
                    };
                    system.motors[bus].report().iter().all(near).then_some(())
                });
            }
            if signal == "-STOP" {
                // meanwhile the torso's motors have tripped their watchdogs, and they get no power
                system.motors[torso].signal("-CONT");
                let end = Instant::now() + Duration::from_millis(2 * system.stage.times[1]);
                wait_for("the torso without power", || {
                    system.motors[torso]
                        .report()
                        .iter()
                        .all(|motor| motor["power"] == false)
                        .then_some(())
                });
                while Instant::now() < end {
                    assert!(
                        system.motors[torso].report().iter().all(|motor| motor["power"] == false)
                    );
                }
            }
        }
    }
}

#[test]
fn a_fault_and_a_silent_motor_stop_their_mechanism_and_wait_for_a_reset() {
    for frontend in FRONTENDS {
        for (break_it, fix_it) in [
            ("fault ALElbowAct 0xA", "fault ALElbowAct 0"),
            ("silence ALElbowAct on", "silence ALElbowAct off"),
        ] {
            let mut system = System::armed(frontend);
            system.motors[1].tell(break_it);
            system.controller_sees("fault");
            let state = system.controller.state();
            for (place, state) in state["states"].as_array().unwrap().iter().enumerate() {
                assert_eq!(
                    *state,
                    if place == 6 { "fault" } else { "enabled" },
                    "{frontend:?} {break_it} {place}: {state}"
                );
            }
            system.motors[1].tell(fix_it);
            system.controller.tell("arm");
            std::thread::sleep(Duration::from_millis(200));
            assert_eq!(
                system.controller.state()["states"][6],
                "fault",
                "{frontend:?}: an arming does not reset"
            );
            system.controller.tell("reset");
            wait_for("the reset", || {
                (system.controller.state()["states"][6] == "disabled").then_some(())
            });
            system.arm();
        }
    }
}

#[test]
fn a_bus_has_one_owner() {
    for frontend in FRONTENDS {
        let system = System::new(frontend);
        for other in FRONTENDS {
            let mut command = system.stage.bridge_command(other);
            command.env("SARRUS_ROOT", system.stage.folder.join("elsewhere"));
            let output = command.output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{frontend:?} {other:?}");
            let text = String::from_utf8(output.stderr).unwrap();
            assert!(text.contains("in use by another program"), "{frontend:?} {other:?}: {text}");
        }
    }
}
