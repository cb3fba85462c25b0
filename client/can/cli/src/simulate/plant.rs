//! The motors of all simulated buses, and what they move.

use sarrus_can_core::config::Configuration;
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Simulated};
use serde_json::{Value, json};

use super::Dynamics;
use super::robot::Moving;

/// Step of the robot's integration `[ns]`.
const STEP_NS: u64 = 1_000_000;
/// A gap longer than this is not made up for: the program was stopped, and so was the world `[ns]`.
const LONGEST_NS: u64 = 100_000_000;

/// All motors.
pub(super) struct Plant {
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
    told: Told,
}

/// What was told of a motor last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Told {
    power: bool,
    fault: u32,
    tripped_ns: Option<u64>,
    has_setpoint: bool,
}

impl Plant {
    /// The motors of the chosen buses.
    pub(super) fn new(
        configuration: &Configuration,
        buses: &[usize],
        physics: Physics,
        dynamics: Dynamics,
    ) -> Result<Plant, String> {
        let mut motors = Vec::new();
        for config in configuration.motors.iter().filter(|motor| buses.contains(&motor.bus)) {
            let name = configuration.actuators.get(config.actuator).cloned().unwrap_or_default();
            let simulated =
                Simulated::new(config.protocol.name, &config.settings, config.common, physics)
                    .ok_or_else(|| {
                        format!("{name}: the protocol {} is not simulated", config.protocol.name)
                    })?;
            let (mapping, unasked) = (config.mapping, FrameQueue::new(16));
            motors.push(Motor {
                name,
                actuator: config.actuator,
                bus: config.bus,
                mapping,
                simulated,
                unasked,
                told: Told::default(),
            });
        }
        let robot = match dynamics {
            Dynamics::Motor => None,
            Dynamics::Robot if buses.len() < configuration.buses.len() => {
                return Err("--dynamics robot moves all motors together: simulate all buses in one process, without --bus".to_owned());
            }
            Dynamics::Robot => Some(Moving::new(configuration, physics)?),
        };
        let mut plant = Plant { motors, robot, moved_ns: None };
        plant.carry();
        Ok(plant)
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
                    robot.drive(motor.actuator, &motor.mapping, &motor.simulated.body);
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
            motor.simulated.body.carry(sign * gear * (u - offset), sign * gear * ud);
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

    /// What happened since the last time, as JSON lines.
    pub(super) fn news(&mut self, now_ns: u64) -> Vec<String> {
        let mut news = Vec::new();
        for motor in &mut self.motors {
            let body = &motor.simulated.body;
            let told = Told {
                power: body.power,
                fault: body.fault,
                tripped_ns: body.tripped_ns,
                has_setpoint: body.n_setpoints > 0,
            };
            if told == motor.told {
                continue;
            }
            let name = &motor.name;
            let mut tell = |event: &str, t: u64, more: Value| {
                news.push(json!({"event": event, "motor": name, "t": t, "value": more}).to_string())
            };
            if told.power != motor.told.power {
                tell("power", now_ns, json!(told.power));
            }
            if told.has_setpoint && told.power && !(motor.told.has_setpoint && motor.told.power) {
                tell("first_setpoint", now_ns, json!(setpoint(&motor.simulated)));
            }
            if let (Some(tripped_ns), true) =
                (told.tripped_ns, told.tripped_ns != motor.told.tripped_ns)
            {
                tell("watchdog", tripped_ns, json!(true));
            }
            if told.fault != motor.told.fault {
                tell("fault", now_ns, json!(told.fault));
            }
            motor.told = told;
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
        let body = &self.simulated.body;
        let heard = self.simulated.last_heard();
        json!({
            "motor": self.name,
            "power": body.power,
            "fault": body.fault,
            "frame": heard.map(|(_, frame)| frame.to_string()),
            "frame_age_ms": heard.map(|(heard_ns, _)| now_ns.saturating_sub(heard_ns) as f64 * 1e-6),
            "frames": self.simulated.n_heard(),
            "setpoints": body.n_setpoints,
            "setpoint": setpoint(&self.simulated),
            "watchdog_ms": body.watchdog_ns as f64 * 1e-6,
            "tripped": body.tripped_ns.is_some(),
            "tripped_t": body.tripped_ns,
            "position": body.measured(),
            "velocity": body.velocity,
            "torque": body.torque,
            "actuator_position": self.mapping.sign * body.measured() / self.mapping.gear + self.mapping.offset,
            "actuator_velocity": self.mapping.sign * body.velocity / self.mapping.gear,
        })
    }
}

/// What a motor follows; nothing without power.
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
