//! The motors of all simulated buses, and their load.

use sarrus_can_core::config::Configuration;
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Plant, Simulated};
use serde_json::{Value, json};

use super::robot::Moving;
use super::{Dynamics, Error};

/// Step of the robot's integration `[ns]`.
const STEP_NS: u64 = 1_000_000;
/// A gap longer than this is not made up for: the program was stopped, and so was the world `[ns]`.
const LONGEST_NS: u64 = 100_000_000;

/// All motors.
pub(super) struct Motors {
    motors: Vec<Motor>,
    robot: Option<Moving>,
    /// Until when the robot was reckoned `[ns]`.
    moved_ns: Option<u64>,
}

struct Motor {
    name: String,
    actuator: usize,
    bus: usize,
    mapping: Mapping,
    simulated: Simulated,
    /// Frames that it sends by itself.
    unasked: FrameQueue,
    /// As last reported.
    reported: Plant,
}

impl Motors {
    /// The motors of the chosen buses.
    pub(super) fn new(
        configuration: &Configuration,
        buses: &[usize],
        physics: Physics,
        dynamics: Dynamics,
    ) -> Result<Motors, Error> {
        let mut motors = Vec::new();
        for config in configuration.motors.iter().filter(|motor| buses.contains(&motor.bus)) {
            let name = configuration.actuators.get(config.actuator).cloned().unwrap_or_default();
            let protocol = config.protocol.name;
            let simulated = Simulated::new(protocol, &config.settings, config.common, physics);
            let simulated = simulated
                .ok_or_else(|| format!("{name}: the protocol {protocol} is not simulated"))?;
            motors.push(Motor {
                name,
                actuator: config.actuator,
                bus: config.bus,
                mapping: config.mapping,
                simulated,
                unasked: FrameQueue::new(16),
                reported: Plant::new(physics),
            });
        }
        let robot = match dynamics {
            Dynamics::Motor => None,
            Dynamics::Robot if buses.len() < configuration.buses.len() => {
                return Err("--dynamics robot moves all motors together: simulate all buses in \
                            one process, without --bus"
                    .into());
            }
            Dynamics::Robot => Some(Moving::new(configuration, physics)?),
        };
        let mut motors = Motors { motors, robot, moved_ns: None };
        motors.carry();
        Ok(motors)
    }

    /// Lets time go by.
    pub(super) fn step(&mut self, now_ns: u64) {
        if self.robot.is_none() {
            for motor in &mut self.motors {
                motor.simulated.step(now_ns, &mut motor.unasked);
            }
            return;
        }
        let mut moved_ns = self.moved_ns.unwrap_or(now_ns).max(now_ns.saturating_sub(LONGEST_NS));
        while moved_ns + STEP_NS <= now_ns {
            moved_ns += STEP_NS;
            if let Some(robot) = &mut self.robot {
                for motor in &self.motors {
                    robot.drive(motor.actuator, &motor.mapping, &motor.simulated.plant);
                }
                robot.step(STEP_NS as f64 * 1e-9);
            }
            self.carry();
        }
        self.moved_ns = Some(moved_ns);
        for motor in &mut self.motors {
            motor.simulated.tick(now_ns, &mut motor.unasked);
        }
    }

    /// Takes the shafts to where the robot has them.
    fn carry(&mut self) {
        let Some(robot) = &self.robot else { return };
        for motor in &mut self.motors {
            let Mapping { sign, gear, offset, .. } = motor.mapping;
            let (u, ud) = robot.actuator(motor.actuator);
            motor.simulated.plant.carry(sign * gear * (u - offset), sign * gear * ud);
        }
    }

    /// Gives a frame to all motors of a bus.
    pub(super) fn receive(&mut self, now_ns: u64, bus: usize, frame: &Frame, out: &mut FrameQueue) {
        for motor in self.motors.iter_mut().filter(|motor| motor.bus == bus) {
            motor.simulated.receive(now_ns, frame, out);
        }
    }

    /// Frames that motors of a bus send by themselves.
    pub(super) fn collect(&mut self, bus: usize, out: &mut FrameQueue) {
        for motor in self.motors.iter_mut().filter(|motor| motor.bus == bus) {
            motor.unasked.frames().iter().for_each(|frame| out.push(*frame));
            motor.unasked.clear();
        }
    }

    /// Does something to a motor; false if there is none of that name.
    pub(super) fn with(&mut self, name: &str, act: impl FnOnce(&mut Simulated)) -> bool {
        let found = self.motors.iter_mut().find(|motor| motor.name == name);
        found.map(|motor| act(&mut motor.simulated)).is_some()
    }

    /// Events since the last call, as JSON lines.
    pub(super) fn news(&mut self, now_ns: u64) -> Vec<String> {
        let mut news = Vec::new();
        for motor in &mut self.motors {
            let plant = motor.simulated.plant.clone();
            let before = &motor.reported;
            let name = &motor.name;
            let mut tell = |event: &str, t: u64, more: Value| {
                news.push(json!({"event": event, "motor": name, "t": t, "value": more}).to_string())
            };
            if plant.power != before.power {
                tell("power", now_ns, json!(plant.power));
            }
            let follows = |plant: &Plant| plant.power && plant.n_setpoints > 0;
            if follows(&plant) && !follows(before) {
                tell("first_setpoint", now_ns, json!(setpoint(&motor.simulated)));
            }
            let is_new = plant.tripped_ns != before.tripped_ns;
            if let Some(tripped_ns) = plant.tripped_ns.filter(|_| is_new) {
                tell("watchdog", tripped_ns, json!(true));
            }
            if plant.fault != before.fault {
                tell("fault", now_ns, json!(plant.fault));
            }
            motor.reported = plant;
        }
        news
    }

    /// The state of every motor and of the buses as one JSON line.
    pub(super) fn report(&self, now_ns: u64, buses: Vec<Value>) -> String {
        let motors: Vec<Value> = self.motors.iter().map(|motor| motor.report(now_ns)).collect();
        json!({"event": "report", "t": now_ns, "motors": motors, "buses": buses}).to_string()
    }
}

impl Motor {
    fn report(&self, now_ns: u64) -> Value {
        let plant = &self.simulated.plant;
        let heard = self.simulated.heard;
        let mapping = &self.mapping;
        let age_ms = |heard_ns| now_ns.saturating_sub(heard_ns) as f64 * 1e-6;
        json!({
            "motor": self.name,
            "power": plant.power,
            "fault": plant.fault,
            "frame": heard.map(|(_, frame)| frame.to_string()),
            "frame_age_ms": heard.map(|(heard_ns, _)| age_ms(heard_ns)),
            "frames": self.simulated.n_heard,
            "setpoints": plant.n_setpoints,
            "setpoint": setpoint(&self.simulated),
            "watchdog_ms": plant.watchdog_ns as f64 * 1e-6,
            "tripped": plant.tripped_ns.is_some(),
            "tripped_t": plant.tripped_ns,
            "position": plant.measured(),
            "velocity": plant.velocity,
            "torque": plant.torque,
            "actuator_position": mapping.sign * plant.measured() / mapping.gear + mapping.offset,
            "actuator_velocity": mapping.sign * plant.velocity / mapping.gear,
        })
    }
}

/// Set-point that a motor follows; `None` without power.
fn setpoint(motor: &Simulated) -> Option<Value> {
    let law = motor.follows()?;
    Some(json!({
        "position": law.position,
        "velocity": law.velocity,
        "torque": law.torque,
        "stiffness": law.stiffness,
        "damping": law.damping,
    }))
}
