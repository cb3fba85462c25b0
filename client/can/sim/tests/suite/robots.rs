//! Bundled robots with closed mechanisms that motors of any protocol move: their dynamics, their
//! configurations by chance, and the motion that their limits allow.

use std::sync::Arc;

use sarrus_can_core::cholesky::Cholesky;
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Workspace};
use sarrus_models::{LoadError, Loaded, Options, Source, load};

use super::world::{Chance, Shaft};

/// A robot, the box of its independents in which it moves, and a joint that may have an encoder.
struct Kind {
    name: &'static str,
    half: &'static [f64],
    encoder: Option<&'static str>,
}

const KINDS: &[Kind] = &[
    Kind { name: "lambda", half: &[0.55], encoder: Some("Elbow") },
    Kind { name: "parallelogram", half: &[0.8], encoder: Some("ParFollower") },
    Kind { name: "ankle", half: &[0.35, 0.3], encoder: Some("AnklePitch") },
    Kind { name: "torso", half: &[0.3, 0.3], encoder: Some("BodyRoll") },
    Kind { name: "wrist", half: &[0.3, 0.3], encoder: Some("WristLRocker") },
    Kind { name: "five_bar", half: &[0.4, 0.4], encoder: Some("left_elbow") },
    Kind { name: "delta", half: &[0.35, 0.35, 0.35], encoder: None },
    Kind { name: "r3_lambda_r", half: &[0.6, 0.6, 0.6, 0.55, 1.0], encoder: Some("ALElbow") },
    Kind { name: "stewart", half: &[0.04, 0.04, 0.04, 0.1, 0.1, 0.1], encoder: None },
];

/// The deviation of an encoder from the robot that is no contradiction `[rad]`.
pub(crate) const MARGIN: f64 = 0.05;
/// Identifier of the frames of an encoder.
pub(crate) const ENCODER_ID: u16 = 0x6F0;
/// One step of it `[rad]`.
pub(crate) const ENCODER_STEP: f64 = 1e-4;
/// Greatest effort of a motor, at its own shaft, in the protocol's numbers `[N m]`.
const MOTOR_EFFORT: f64 = 2.0;
/// Part of speed, effort and braking distance that a move needs.
const PART: f64 = 0.8;
/// A speed that counts as none beside dry friction, as part of the greatest one.
const STILL: f64 = 0.01;

/// Places of the numbers of a pose: u, u̇, G_u, M_y, C_y and q.
struct Places {
    u: usize,
    ud: usize,
    jacobian: usize,
    mass: usize,
    bias: usize,
    q: usize,
}

/// A robot that moves.
pub(crate) struct Robot {
    model: Arc<Model>,
    workspace: Workspace<f64>,
    plan: Plan,
    places: Places,
    forces: Plan,
    pub(crate) y: Vec<f64>,
    yd: Vec<f64>,
    input: Vec<f64>,
    output: Vec<f64>,
    system: Cholesky,
    side: Vec<f64>,
    /// The place in q of the joint with an encoder.
    encoder: Option<usize>,
    /// External forces along the independents, unknown to the bridge.
    pub(crate) push: Vec<f64>,
}

impl Robot {
    pub(crate) fn new(model: Arc<Model>, encoder: Option<&str>) -> Robot {
        use Field::{CY, GU, MY, Q, TauU, U, Ud, Y, Yd, Ydd};
        let plan = |given: &[Field], want: &[Field]| {
            let query =
                Query::new(Request::InverseDynamics, FieldSet::of(given), FieldSet::of(want));
            Plan::new(&model, &query).expect("a plan")
        };
        let state = plan(&[Y, Yd, Ydd], &[U, Ud, GU, MY, CY, Q]);
        let place = |field| state.want().slot(field).expect("a wanted field").range().start;
        let n = model.sizes().n_vy;
        let joint = encoder.map(|name| {
            model.tree_q_names().iter().position(|known| known == name).expect("a joint")
        });
        let mut robot = Robot {
            workspace: Workspace::new(&model),
            places: Places {
                u: place(U),
                ud: place(Ud),
                jacobian: place(GU),
                mass: place(MY),
                bias: place(CY),
                q: place(Q),
            },
            forces: plan(&[Y, Yd, Ydd], &[U, Ud, TauU]),
            y: vec![0.0; n],
            yd: vec![0.0; n],
            push: vec![0.0; n],
            input: vec![0.0; 3 * n],
            output: vec![0.0; state.want().len()],
            system: Cholesky::new(n),
            side: vec![0.0; n],
            encoder: joint,
            plan: state,
            model,
        };
        assert!(robot.evaluate());
        robot
    }

    /// False, and nothing changed, where no pose is there.
    fn evaluate(&mut self) -> bool {
        let n = self.y.len();
        self.input[..n].copy_from_slice(&self.y);
        self.input[n..2 * n].copy_from_slice(&self.yd);
        self.input[2 * n..].fill(0.0);
        let answer = self.plan.run(&self.model, &mut self.workspace, &self.input, &mut self.output);
        answer.ok().is_ok()
    }

    pub(crate) fn n_u(&self) -> usize {
        self.model.sizes().n_u
    }

    /// Position and velocity of an actuator.
    fn actuator(&self, u: usize) -> [f64; 2] {
        [self.output[self.places.u + u], self.output[self.places.ud + u]]
    }

    pub(crate) fn row(&self, u: usize) -> &[f64] {
        let n = self.y.len();
        &self.output[self.places.jacobian + u * n..][..n]
    }

    /// Position and velocity of a motor's shaft.
    pub(crate) fn shaft(&self, shaft: &Shaft) -> [f64; 2] {
        let [position, velocity] = self.actuator(shaft.actuator);
        let factor = shaft.mapping.sign * shaft.mapping.gear;
        [factor * (position - shaft.mapping.offset), factor * velocity]
    }

    /// The joint with an encoder.
    pub(crate) fn encoder(&self) -> Option<f64> {
        self.encoder.map(|place| self.output[self.places.q + place])
    }

    /// Goes on by `h` seconds under the torques of the shafts: one step of the Euler method, which
    /// is implicit in the friction,
    ///
    /// ```text
    /// (M_y + Gᵀ (R + h D) G) ẏ⁺ = M_y ẏ + Gᵀ (R u̇ + h τ) − h c
    /// ```
    pub(crate) fn step(&mut self, shafts: &[Shaft], h: f64) {
        if shafts.iter().all(|shaft| shaft.is_braked) {
            self.yd.fill(0.0);
            let places = &self.places;
            self.output[places.ud..places.ud + self.model.sizes().n_u].fill(0.0);
            return;
        }
        let n = self.y.len();
        let mass = &self.output[self.places.mass..][..n * n];
        self.system.matrix.copy_from_slice(mass);
        for i in 0..n {
            let momentum: f64 = (0..n).map(|j| mass[i * n + j] * self.yd[j]).sum();
            self.side[i] = momentum - h * (self.output[self.places.bias + i] - self.push[i]);
        }
        for shaft in shafts {
            let mapping = &shaft.mapping;
            // as the actuator feels them
            let square = mapping.gear * mapping.gear * mapping.torque_constant;
            let [_, velocity] = self.actuator(shaft.actuator);
            let still = STILL * shaft.limits.velocity;
            let dry = shaft.dry * mapping.gear * mapping.torque_constant;
            let is_blocked = shaft.is_blocked || shaft.is_braked;
            let blocked = if is_blocked { 1e9 * shaft.inertia } else { 0.0 };
            let damping = square * (shaft.friction + blocked) + dry / velocity.abs().max(still);
            let weight = square * shaft.inertia + h * damping;
            let effort = mapping.sign * mapping.gear * mapping.torque_constant * shaft.torque;
            let push = square * shaft.inertia * velocity + h * effort;
            let row = &self.output[self.places.jacobian + shaft.actuator * n..][..n];
            for i in 0..n {
                self.side[i] += row[i] * push;
                for j in 0..n {
                    self.system.matrix[i * n + j] += row[i] * weight * row[j];
                }
            }
        }
        assert!(self.system.factorise());
        self.system.solve(&mut self.side);
        self.yd.copy_from_slice(&self.side);
        let before = self.y.clone();
        self.y.iter_mut().zip(&self.yd).for_each(|(y, yd)| *y += h * yd);
        if !self.evaluate() {
            // at the end of its reach
            self.y = before;
            self.yd.fill(0.0);
            assert!(self.evaluate());
        }
    }

    /// u, u̇ and the efforts of a motion.
    pub(crate) fn efforts(&mut self, [y, yd, ydd]: [&[f64]; 3], out: &mut Vec<f64>) {
        out.resize(self.forces.want().len(), 0.0);
        let input = [y, yd, ydd].concat();
        let answer = self.forces.run(&self.model, &mut self.workspace, &input, out);
        answer.ok().unwrap_or_else(|status| panic!("{status:?} at {y:?}"));
    }

    /// The inertia that an actuator feels where all others stand still, (G⁻ᵀ M G⁻¹)_uu.
    fn inertia(&mut self, u: usize) -> f64 {
        let n = self.y.len();
        self.system.matrix.fill(0.0);
        for u in 0..self.n_u() {
            let row = &self.output[self.places.jacobian + u * n..][..n];
            for i in 0..n {
                for j in 0..n {
                    self.system.matrix[i * n + j] += row[i] * row[j];
                }
            }
        }
        assert!(self.system.factorise());
        let mut way = self.row(u).to_vec();
        self.system.solve(&mut way);
        let mass = &self.output[self.places.mass..][..n * n];
        (0..n).map(|i| way[i] * (0..n).map(|j| mass[i * n + j] * way[j]).sum::<f64>()).sum()
    }

    /// How much lighter than these inertias together a motion of all actuators is: the greatest
    /// eigenvalue of D G M⁻¹ Gᵀ, by 30 rounds of the power method.
    fn lightness(&mut self, inertia: &[f64]) -> f64 {
        let n = self.y.len();
        self.system.matrix.copy_from_slice(&self.output[self.places.mass..][..n * n]);
        assert!(self.system.factorise());
        let mut push: Vec<f64> = (0..self.n_u()).map(|u| 1.0 + 0.1 * u as f64).collect();
        let mut factor = 1.0;
        for _ in 0..30 {
            let mut way: Vec<f64> =
                (0..n).map(|i| (0..push.len()).map(|u| self.row(u)[i] * push[u]).sum()).collect();
            self.system.solve(&mut way);
            for u in 0..push.len() {
                push[u] =
                    inertia[u] * self.row(u).iter().zip(&way).map(|(g, y)| g * y).sum::<f64>();
            }
            factor = push.iter().fold(0.0, |most: f64, push| most.max(push.abs()));
            push.iter_mut().for_each(|push| *push /= factor);
        }
        factor
    }
}

/// A robot with a configuration of its motors by chance.
pub(crate) struct Drawn {
    pub(crate) name: &'static str,
    pub(crate) text: String,
    pub(crate) half: &'static [f64],
    pub(crate) encoder: Option<&'static str>,
    /// Inertia that each actuator feels.
    pub(crate) inertia: Vec<f64>,
    /// How much lighter a motion of all of them is, at most.
    pub(crate) lightness: f64,
    /// The drive of each bus.
    pub(crate) drives: Vec<&'static str>,
}

/// Loads a robot of [`KINDS`].
pub(crate) fn loaded(name: &str) -> Result<Loaded, LoadError> {
    load(&Source::Bundled(name.to_owned()), &Options::default())
}

/// A drive of the table for the k-th motor of its bus.
fn numbered(drive: &str, k: usize) -> String {
    let mut text = drive.replace("reply_id: 20", &format!("reply_id: {}", 32 + k));
    for key in [" id: ", " node: "] {
        if let Some(begin) = text.find(key).map(|at| at + key.len()) {
            let end = begin + text[begin..].find([',', '}']).unwrap_or(0);
            text.replace_range(begin..end, &format!("{}", 1 + k));
        }
    }
    text
}

/// Draws a robot, its buses and its motors; `rate` is that of the bridge.
pub(crate) fn draw(chance: &mut Chance, drives: &[(&'static str, String)], rate: u32) -> Drawn {
    let kind = &KINDS[(chance.bits() % KINDS.len() as u64) as usize];
    let model = Arc::new(loaded(kind.name).expect("a robot").compiled.model);
    let mut robot = Robot::new(model.clone(), None);
    let n_u = robot.n_u();

    // positions and weights of its actuators in the box
    let mut range = vec![[f64::INFINITY, f64::NEG_INFINITY]; n_u];
    let mut inertia = vec![0.0_f64; n_u];
    let mut gravity = vec![0.0_f64; n_u];
    let mut numbers = Vec::new();
    let zero = vec![0.0; kind.half.len()];
    let home: Vec<f64> = (0..n_u).map(|u| robot.actuator(u)[0]).collect();
    let n_corners = 1 << kind.half.len();
    let mut lightness = 1.0_f64;
    for k in 0..n_corners + 32 {
        for (i, half) in kind.half.iter().enumerate() {
            let end = if k >> i & 1 == 0 { 1.0 } else { -1.0 };
            robot.y[i] = half * if k < n_corners { end } else { chance.within(-1.0, 1.0) };
        }
        assert!(robot.evaluate());
        let y = robot.y.clone();
        robot.efforts([&y, &zero, &zero], &mut numbers);
        for u in 0..n_u {
            let [low, high] = range[u];
            range[u] = [low.min(numbers[u]), high.max(numbers[u])];
            gravity[u] = gravity[u].max(numbers[2 * n_u + u].abs());
            inertia[u] = inertia[u].max(robot.inertia(u));
        }
        lightness = lightness.max(robot.lightness(&inertia));
    }

    // buses and motors
    let n_buses = if n_u > 1 { 1 + (chance.bits() % 2) as usize } else { 1 };
    let several: Vec<&(&'static str, String)> =
        drives.iter().filter(|(name, _)| !name.contains("dbc")).collect();
    let of_bus: Vec<_> =
        (0..n_buses).map(|_| several[(chance.bits() % several.len() as u64) as usize]).collect();
    let mut text = format!(
        "robot: {}\ncommissioning: none\nrate_hz: {rate}\nramp_ms: 20\nmodel: {{effort: 0.3}}\nbuses:\n",
        kind.name
    );
    for bus in 0..n_buses {
        text += &format!(
            "- {{name: b{bus}, interface: none, channel: c{bus}, bitrate: 1000000, data_bitrate: \
             5000000}}\n"
        );
    }
    let encoder = kind.encoder.filter(|_| chance.within(0.0, 1.0) < 0.5);
    if let Some(joint) = encoder {
        text += &format!(
            "encoders:\n- {{joint: {joint}, bus: b0, id: {ENCODER_ID}, byte: 1, bits: 16, scale: \
             {ENCODER_STEP}, margin: {MARGIN}}}\n"
        );
    }
    text += "motors:\n";
    for (u, name) in model.active_names().iter().enumerate() {
        let [low, high] = range[u];
        let margin = 0.1 * (high - low);
        let lower = low - margin;
        let upper = high + margin;
        let velocity = (high - low) / chance.within(0.8, 2.0);
        let effort = 2.0 * gravity[u] + inertia[u] * velocity / 0.25;
        // some motors know their turn at the first report by being at most half a turn from 0
        let offset = home[u];
        let gear = chance.within(6.0, 11.0) / (upper - offset).max(offset - lower);
        let bus = u % n_buses;
        let (_, drive) = of_bus[bus];
        let sign = if chance.bits().is_multiple_of(2) { 1 } else { -1 };
        let torque_constant = effort / (gear * MOTOR_EFFORT);
        text += &format!(
            "- actuator: {name}\n  bus: b{bus}\n  drive: {}\n  sign: {sign}\n  gear: {gear}\n  \
             offset: {offset}\n  torque_constant: {torque_constant}\n  limits: {{position: \
             [{lower}, {upper}], velocity: {velocity}, effort: {effort}}}\n  watchdog_ms: 50\n  \
             watchdog: believed\n",
            numbered(drive, u / n_buses)
        );
    }
    Drawn {
        name: kind.name,
        text,
        half: kind.half,
        encoder,
        inertia,
        lightness,
        drives: of_bus.iter().map(|(name, _)| *name).collect(),
    }
}

/// Whether the limits of the actuators and of the independents allow a pose with its motion: part
/// of the speeds and of the efforts, and a distance to the limits in which it stops.
pub(crate) fn is_allowed(shafts: &[Shaft], numbers: &[f64], period_ns: u64) -> bool {
    let n_u = numbers.len() / 3;
    shafts.iter().all(|shaft| {
        let u = shaft.actuator;
        let limits = &shaft.limits;
        let [position, velocity, effort] = [numbers[u], numbers[n_u + u], numbers[2 * n_u + u]];
        let speed = velocity.abs();
        let room = if velocity > 0.0 { limits.upper - position } else { position - limits.lower };
        let delay = 0.04 + 4e-9 * period_ns as f64;
        let way = speed * (0.5 * speed * 0.4 / limits.velocity + delay);
        speed < PART * limits.velocity && effort.abs() < PART * limits.effort && way < PART * room
    })
}
