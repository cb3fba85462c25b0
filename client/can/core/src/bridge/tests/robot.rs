//! The bundled upper body as a plant under a bridge: motors that answer at once, in exact numbers
//! with noise of two codes, and forward dynamics between them.

use std::path::Path;
use std::sync::{Arc, Mutex};

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Workspace};
use sarrus_models::{LoadError, Loaded, Options, Source, bundled_text, load};
use sarrus_proto::actuators::{MechanismState, Operation};

use super::super::*;
use super::bench::{DIRECT, MS};
use crate::config::Surroundings;
use crate::drive::{Drive, DriveState, Measurement, Power, Reply, Setpoint, Watchdog};
use crate::frame::Id;

/// One cycle `[ns]`.
const PERIOD: u64 = 2 * MS;
/// Steps of the plant in one cycle.
const STEPS: usize = 20;
/// Friction that a rotor adds to its actuator: of a screw `[N s/m]`, of a joint `[N m s/rad]`.
const FRICTION: [f64; 2] = [40.0, 0.05];

/// State that a motor and its drive share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shaft {
    pub(super) setpoint: Option<Setpoint>,
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
    /// It has power and says that it gives efforts, but none comes through.
    pub(super) is_limp: bool,
    /// Error of its encoder.
    pub(super) slip: f64,
}

/// A drive that reads and writes a shaft.
#[derive(Debug)]
struct Direct {
    id: u16,
    shaft: Arc<Mutex<Shaft>>,
    power: Power,
}

impl Drive for Direct {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, _out: &mut FrameQueue) {
        let setpoint = match command {
            DriveCommand::On(setpoint) => Some(setpoint),
            _ => None,
        };
        self.shaft.lock().unwrap().setpoint = setpoint;
        self.power = if setpoint.is_some() { Power::On } else { Power::Off };
    }
    fn encode(&self, _setpoint: &Setpoint, _out: &mut FrameQueue) {}
    fn disable(&self, _out: &mut FrameQueue) {}
    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        if frame.id != Id::Standard(self.id) {
            return Receipt::NotMine;
        }
        let shaft = *self.shaft.lock().unwrap();
        Receipt::Measured(Measurement {
            position: shaft.position,
            velocity: shaft.velocity,
            torque: shaft.effort,
            temperature: 30.0,
        })
    }
    fn state(&self) -> DriveState {
        DriveState { power: self.power, fault: 0, watchdog: Watchdog::Set(100) }
    }
    fn forget(&mut self) {}
    fn identifiers(&self) -> Vec<Id> {
        vec![Id::Standard(self.id)]
    }
    fn replies(&self) -> Vec<Reply> {
        Vec::new()
    }
}

crate::state::state!(Direct { power; id, shaft });

/// The robot.
struct Plant {
    model: Arc<Model>,
    workspace: Workspace<f64>,
    forward: Plan,
    pose: Plan,
    y: Vec<f64>,
    yd: Vec<f64>,
    /// External forces on the independents.
    push: Vec<f64>,
    /// Independents that a brake holds.
    held: Vec<bool>,
    /// u, u̇ and G_u.
    u: Vec<f64>,
    ud: Vec<f64>,
    jacobian: Vec<f64>,
}

impl Plant {
    fn new(model: Arc<Model>) -> Plant {
        use Field::{GU, TauY, U, Ud, Y, Yd, Ydd};
        let plan = |request, given: &[Field], want: &[Field]| {
            Plan::new(&model, &Query::new(request, FieldSet::of(given), FieldSet::of(want)))
                .unwrap()
        };
        let n_y = model.sizes().n_vy;
        let n_u = model.sizes().n_u;
        let mut plant = Plant {
            workspace: Workspace::new(&model),
            forward: plan(Request::ForwardDynamics, &[Y, Yd, TauY], &[Ydd]),
            pose: plan(Request::Kinematics, &[Y, Yd], &[U, Ud, GU]),
            y: vec![0.0; n_y],
            yd: vec![0.0; n_y],
            push: vec![0.0; n_y],
            held: vec![false; n_y],
            u: vec![0.0; n_u],
            ud: vec![0.0; n_u],
            jacobian: vec![0.0; n_u * n_y],
            model,
        };
        plant.evaluate();
        plant
    }

    fn evaluate(&mut self) {
        let input = [self.y.clone(), self.yd.clone()].concat();
        let mut output = vec![0.0; self.pose.want().len()];
        self.pose.run(&self.model, &mut self.workspace, &input, &mut output).ok().unwrap();
        let n_u = self.u.len();
        self.u.copy_from_slice(&output[..n_u]);
        self.ud.copy_from_slice(&output[n_u..2 * n_u]);
        self.jacobian.copy_from_slice(&output[2 * n_u..]);
    }

    /// Holds the independents that an actuator moves.
    fn brake(&mut self, actuator: usize) {
        let n_y = self.y.len();
        let row = &self.jacobian[actuator * n_y..(actuator + 1) * n_y];
        let moved = self.held.iter_mut().zip(row).filter(|(_, entry)| entry.abs() > 1e-9);
        moved.for_each(|(held, _)| *held = true);
    }

    /// Goes on by `h` seconds under actuator forces.
    fn step(&mut self, tau_u: &[f64], h: f64) {
        let n_y = self.y.len();
        let mut tau_y = self.push.clone();
        for (u, tau) in tau_u.iter().enumerate() {
            for i in 0..n_y {
                tau_y[i] += self.jacobian[u * n_y + i] * tau;
            }
        }
        let input = [self.y.clone(), self.yd.clone(), tau_y].concat();
        let mut ydd = vec![0.0; n_y];
        self.forward.run(&self.model, &mut self.workspace, &input, &mut ydd).ok().unwrap();
        for i in 0..n_y {
            self.yd[i] = if self.held[i] { 0.0 } else { self.yd[i] + h * ydd[i] };
            self.y[i] += h * self.yd[i];
        }
        self.held.fill(false);
        self.evaluate();
    }
}

/// A bridge over the robot.
pub(super) struct RobotBench {
    pub(super) bridge: Bridge,
    pub(super) shafts: Vec<Arc<Mutex<Shaft>>>,
    pub(super) now_ns: u64,
    /// Independents that the controller wants, and where it is to be believed that they are.
    pub(super) target: Vec<f64>,
    /// Commanded actuators instead of those of the target.
    pub(super) commanded: Option<Vec<f64>>,
    /// Whether there is an encoder on the left elbow, and by how much it is wrong.
    pub(super) encoder: Option<f64>,
    /// Actuators that do not answer.
    pub(super) silent: Vec<usize>,
    pub(super) names: Vec<String>,
    pub(super) independents: Vec<String>,
    plant: Plant,
    wanted: Plant,
    sequence: u64,
    seed: u64,
}

impl RobotBench {
    /// The bundled upper body; `urdf` changes its file, `keys` are added to the configuration.
    pub(super) fn new(urdf: impl Fn(&str) -> String, keys: &str) -> RobotBench {
        RobotBench::with(urdf, as_it_is, keys, "")
    }

    /// A bench with a motor on the left elbow itself, beside that of its screw: two actuators of
    /// one degree of freedom.
    pub(super) fn redundant() -> RobotBench {
        let active = |submechanisms: &str| {
            let (before, after) =
                ("jointnames_active: [ALElbowAct]", "jointnames_active: [ALElbow, ALElbowAct]");
            assert!(submechanisms.contains(before));
            submechanisms.replace(before, after)
        };
        let motor = "- actuator: ALElbow\n  bus: left_arm\n  drive: {protocol: mit, variant: \
            t_motor, id: 6, reply_id: 22, position_range: 12.5, velocity_range: 30, torque_range: \
            120, stiffness_range: 500, damping_range: 5}\n  offset: 0\n  limits: {position: \
            [-1.4, 1.4], velocity: 8, effort: 110}\n  damping: 2\n  watchdog_ms: 100\n  \
            watchdog: believed\n";
        RobotBench::with(as_it_is, active, "", motor)
    }

    /// With changed files of the robot, and motors more.
    fn with(
        urdf: impl Fn(&str) -> String,
        submechanism_file: impl Fn(&str) -> String,
        keys: &str,
        motors: &str,
    ) -> RobotBench {
        let text = include_str!("../../../../examples/rh5v2_upper_body.yml");
        let text = format!("{keys}\n{text}{motors}");
        let (robot, submechanisms) = bundled_text("rh5v2_upper_body").unwrap();
        let submechanisms = &submechanism_file(submechanisms);
        let folder = std::env::temp_dir().join(format!(
            "sarrus-can-core-{}-{:?}",
            std::process::id(),
            std::thread::current().id()
        ));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let source = Source::Files {
            urdf: write("robot.urdf", &urdf(robot)),
            submechanisms: Some(write("robot.yml", submechanisms)),
        };
        let robot =
            |_: &Source| -> Result<Loaded, LoadError> { load(&source, &Options::default()) };
        let surroundings = Surroundings { file: &|_| Err("absent".into()), robot: &robot };
        let mut configuration = Configuration::read("robot.yml", text.into_bytes(), &surroundings)
            .unwrap_or_else(|report| panic!("{report}"));
        std::fs::remove_dir_all(Path::new(&folder)).unwrap();
        let shaft = Shaft {
            setpoint: None,
            position: 0.0,
            velocity: 0.0,
            effort: 0.0,
            is_limp: false,
            slip: 0.0,
        };
        let shafts: Vec<Arc<Mutex<Shaft>>> =
            configuration.actuators.iter().map(|_| Arc::new(Mutex::new(shaft))).collect();
        for motor in &mut configuration.motors {
            motor.mapping = DIRECT;
            motor.drive = Box::new(Direct {
                id: motor.actuator as u16,
                shaft: shafts[motor.actuator].clone(),
                power: Power::Off,
            });
        }
        let model = configuration.model.clone().unwrap();
        let names = configuration.actuators.clone();
        RobotBench {
            bridge: Bridge::new(configuration),
            shafts,
            now_ns: 10 * MS,
            target: vec![0.0; model.sizes().n_vy],
            commanded: None,
            encoder: None,
            silent: Vec::new(),
            independents: model.independent_names().to_vec(),
            names,
            plant: Plant::new(model.clone()),
            wanted: Plant::new(model),
            sequence: 0,
            seed: 1,
        }
    }

    /// The bridge over another robot than it knows.
    pub(super) fn over(self, other: RobotBench) -> RobotBench {
        RobotBench { plant: other.plant, ..self }
    }

    pub(super) fn actuator(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap()
    }

    pub(super) fn independent(&self, name: &str) -> usize {
        self.independents.iter().position(|known| known == name).unwrap()
    }

    pub(super) fn y(&self, name: &str) -> f64 {
        self.plant.y[self.independent(name)]
    }

    pub(super) fn push(&mut self, name: &str, effort: f64) {
        let place = self.independent(name);
        self.plant.push[place] = effort;
    }

    /// A number of at most 1.
    fn noise(&mut self) -> f64 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn is_screw(&self, actuator: usize) -> bool {
        self.names[actuator].ends_with("Act")
            || self.names[actuator].ends_with("ActL")
            || self.names[actuator].ends_with("ActR")
    }

    /// One cycle: a command, the bridge, the robot until the next one, and the motors' answers.
    pub(super) fn step(&mut self) {
        self.now_ns += PERIOD;
        self.sequence += 1;
        let n_u = self.names.len();
        self.wanted.y.copy_from_slice(&self.target);
        self.wanted.evaluate();
        let mut command = ActuatorCommand {
            sequence: self.sequence,
            stamp_ns: self.now_ns,
            fingerprint: self.bridge.configuration().fingerprint,
            n_u: n_u as u64,
            ..ActuatorCommand::default()
        };
        for u in 0..n_u {
            let (stiffness, damping) =
                if self.is_screw(u) { (200_000.0, 10_000.0) } else { (300.0, 15.0) };
            command.position[u] =
                self.commanded.as_ref().map_or(self.wanted.u[u], |commanded| commanded[u]);
            command.stiffness[u] = stiffness;
            command.damping[u] = damping;
        }
        self.bridge.command(self.now_ns, &command);
        self.bridge.cycle(self.now_ns);
        self.report_encoder();

        // the robot under its motors, each with its own law
        let mut efforts = vec![0.0; n_u];
        let mut reported = vec![0.0; n_u];
        let mut limits = vec![0.0; n_u];
        for motor in &self.bridge.motors {
            limits[motor.config.actuator] = motor.config.limits.effort;
        }
        let is_live = self.shafts.iter().any(|shaft| shaft.lock().unwrap().setpoint.is_some());
        for _ in 0..if is_live { STEPS } else { 0 } {
            for u in 0..n_u {
                let shaft = *self.shafts[u].lock().unwrap();
                let position = self.plant.u[u] + shaft.slip;
                let velocity = self.plant.ud[u];
                let effort = shaft.setpoint.map_or(0.0, |setpoint| {
                    setpoint.torque
                        + setpoint.stiffness * (setpoint.position - position)
                        + setpoint.damping * (setpoint.velocity - velocity)
                });
                let friction = FRICTION[usize::from(!self.is_screw(u))];
                reported[u] = effort.clamp(-limits[u], limits[u]);
                efforts[u] = if shaft.is_limp { 0.0 } else { reported[u] } - friction * velocity;
                // without power a brake holds
                if shaft.setpoint.is_none() {
                    self.plant.brake(u);
                }
            }
            let efforts = efforts.clone();
            self.plant.step(&efforts, PERIOD as f64 * 1e-9 / STEPS as f64);
        }
        for u in 0..n_u {
            // two codes of positions, velocities and efforts
            let size = if self.is_screw(u) { [9e-6, 7e-5, 7.0] } else { [7.6e-4, 0.029, 0.12] };
            let noise = [self.noise(), self.noise(), self.noise()];
            {
                let mut shaft = self.shafts[u].lock().unwrap();
                shaft.position = self.plant.u[u] + shaft.slip + size[0] * noise[0];
                shaft.velocity = self.plant.ud[u] + size[1] * noise[1];
                shaft.effort = reported[u] + size[2] * noise[2];
            }
            // one answer in a hundred is lost
            if self.noise() > -0.98 && !self.silent.contains(&u) {
                let bus = self.bridge.motors.iter().find(|motor| motor.config.actuator == u);
                let bus = bus.unwrap().config.bus;
                let answer = Frame::classic(Id::Standard(u as u16), &[0]).unwrap();
                self.bridge.receive(self.now_ns + PERIOD / 2, bus, &answer);
            }
        }
    }

    /// Sends the frame of the left elbow's encoder, in steps of 0.1 mrad, on bus 1.
    fn report_encoder(&mut self) {
        if let Some(wrong) = self.encoder {
            let number = ((self.y("ALElbow") + wrong) * 1e4).round() as i16;
            let data = number.to_le_bytes();
            let frame = Frame::classic(Id::Standard(0x181), &[0, data[0], data[1]]).unwrap();
            self.bridge.receive(self.now_ns + PERIOD / 2, 1, &frame);
        }
    }

    pub(super) fn steps(&mut self, n: usize) {
        (0..n).for_each(|_| self.step());
    }

    /// Arms, and waits until gains have grown.
    pub(super) fn arm(&mut self) {
        self.steps(70);
        self.bridge.operate(self.now_ns, Operation::Arm);
        self.steps(100);
        for name in self.names.clone() {
            assert_eq!(self.state(&name), (MechanismState::Enabled, Reason::None), "{name}");
        }
    }

    pub(super) fn state(&self, name: &str) -> (MechanismState, Reason) {
        let place = self.actuator(name);
        let state = self.bridge.state();
        (
            MechanismState::from_code(state.states[place]).unwrap(),
            Reason::from_code(state.reasons[place]).unwrap(),
        )
    }

    /// Cycles until a mechanism is no longer enabled; gives how many.
    pub(super) fn until_it_stops(&mut self, name: &str, most: usize) -> usize {
        for cycle in 1..=most {
            self.step();
            if self.state(name).0 != MechanismState::Enabled {
                return cycle;
            }
        }
        panic!("{name} is still enabled after {most} cycles");
    }
}

/// Nothing of the robot's file changes.
pub(super) fn as_it_is(urdf: &str) -> String {
    urdf.to_owned()
}

/// All masses of the robot's file are this many times as large.
pub(super) fn heavier(factor: f64) -> impl Fn(&str) -> String {
    move |urdf| {
        let mut parts = urdf.split("<mass value=\"");
        let mut text = parts.next().unwrap().to_owned();
        for part in parts {
            let (mass, rest) = part.split_once('"').unwrap();
            let mass = factor * mass.parse::<f64>().unwrap();
            text += &format!("<mass value=\"{mass}\"{rest}");
        }
        text
    }
}
