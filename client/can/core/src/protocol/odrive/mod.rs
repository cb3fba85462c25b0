//! ODrive, CANSimple.
//!
//! Source: ODrive documentation 0.6.10, "CAN protocol"
//! (docs.odriverobotics.com/v/latest/manual/can-protocol.html).
//!
//! - Standard identifier = `node` << 5 | command; numbers are little-endian, floats IEEE 754
//!   singles. Positions in turns, velocities in turns/s, torques in N m.
//! - Sent: 07 state u32 (1 idle, 8 closed loop), 0B control and input mode u32 u32, 0C position
//!   f32, velocity i16 × `velocity_scale` turns/s, torque i16 × `torque_scale` N m, 0D velocity
//!   f32, torque f32, 0E torque f32, 0F largest velocity f32 and current f32 [A], 18 forget errors,
//!   19 position is now f32, 04 write or read an endpoint: u8 1 | 0, endpoint u16, 0, value.
//! - Received: 01 heartbeat: errors u32, state u8, three more; 03 errors u32, reason of the last
//!   fall u32; 05 endpoint: 0, endpoint u16, 0, value; 09 position f32, velocity f32; 15
//!   temperatures of bridge and motor f32 f32; 1C desired and estimated torque f32 f32.
//!
//! In the modes position and velocity the ODrive's own loops produce the torque, within its current
//! limit, `limits.effort` / `motor_torque_constant`, which is sent with the largest velocity. The
//! frame has no answer, so it is repeated while the motor has no power, and sent once more before
//! it gets power. Without all three numbers these modes are refused.
//!
//! An ODrive sends its position cyclically: set `encoder_msg_rate_ms` (and `torques_msg_rate_ms` if
//! needed) to the bridge's cycle. The velocity beside a position saturates at ± 32767 steps (32.8
//! turns/s) where other masters overflow. The endpoints of its watchdog have other numbers in each
//! firmware (`flat_endpoints.json`): with both of them the watchdog is set and read back.

mod echo;
mod setup;

use std::f64::consts::TAU;

use super::keys::motor_torque_constant;
use super::number::{limited, single, steps, steps_toward_zero};
use super::power_up::{Action, PowerUp, Stage};
use super::{Common, Key, Made, Protocol, Settings, fault};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Parameter, Power, Receipt, Reply, Setpoint,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::state::state;
use echo::Echo;
use sarrus_models::Diagnostics;
use setup::Setup;

/// ODrive CANSimple.
pub(super) const ODRIVE: Protocol = Protocol {
    name: "odrive",
    about: "ODrive, CANSimple",
    modes: &[Mode::Torque, Mode::Position, Mode::Velocity],
    fd: false,
    keys: &[
        Key::integer("node", 0, 62, "node_id of the axis"),
        scale(
            "velocity_scale",
            "1 / input_vel_scale: one step of the velocity beside a position [turn/s]",
        ),
        scale(
            "torque_scale",
            "1 / input_torque_scale: one step of the torque beside a position [N m]",
        ),
        motor_torque_constant(
            "axis0.config.motor.torque_constant [N m/A], for the limit of current",
        )
        .optional(),
        Key::flag("torque_feedback", "whether the ODrive tells its torque every cycle").or("false"),
        Key::integer(
            "watchdog_timeout_endpoint",
            1,
            0xFFFF,
            "endpoint of axis0.config.watchdog_timeout",
        )
        .optional(),
        Key::integer(
            "enable_watchdog_endpoint",
            1,
            0xFFFF,
            "endpoint of axis0.config.enable_watchdog",
        )
        .optional(),
    ],
    make,
};

const fn scale(name: &'static str, about: &'static str) -> Key {
    Key::number(name, 1e-6, 1.0, about).or("0.001")
}

const HEARTBEAT: u16 = 0x01;
const ERRORS: u16 = 0x03;
const ENDPOINT_REPLY: u16 = 0x05;
const STATE: u16 = 0x07;
const ESTIMATES: u16 = 0x09;
const CONTROL_MODE: u16 = 0x0B;
const POSITION: u16 = 0x0C;
const VELOCITY: u16 = 0x0D;
const TORQUE: u16 = 0x0E;
const LIMITS: u16 = 0x0F;
const TEMPERATURES: u16 = 0x15;
const FORGET_ERRORS: u16 = 0x18;
const POSITION_IS: u16 = 0x19;
const TORQUES: u16 = 0x1C;

const IDLE: u32 = 1;
const CLOSED_LOOP: u32 = 8;
/// Without a heartbeat for this time nothing is known of the motor's state `[ns]`.
const HEARTBEAT_LOST_NS: u64 = 500_000_000;
/// Input mode 1 passes set-points on as they are.
const PASSTHROUGH: u32 = 1;

#[derive(Debug)]
struct ODrive {
    node: u16,
    /// Largest velocity and current `[turn/s, A]`.
    limits: Option<[f64; 2]>,
    common: Common,
    velocity_scale: f64,
    torque_scale: f64,
    torque_feedback: bool,
    setup: Setup,
    echo: Echo,
    power_up: PowerUp,
    axis_state: Option<u8>,
    /// When its last heartbeat came `[ns]`.
    heard_ns: u64,
    errors: u32,
    not_finite: bool,
    /// As last reported; the velocity comes with each position.
    measured: Measurement,
}

fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let endpoint = |key| settings.has(key).then(|| settings.integer(key) as u16);
    const TIMEOUT: &str = "watchdog_timeout_endpoint";
    let [timeout, enable] = [TIMEOUT, "enable_watchdog_endpoint"].map(endpoint);
    if timeout.is_some() != enable.is_some() {
        let found = "one of the watchdog's two endpoints";
        let help = "add the other one from flat_endpoints.json";
        return settings.wrong(diagnostics, TIMEOUT, found, "both or none", help);
    }
    let node = settings.integer("node") as u16;
    let current = common.torque_limit / settings.number("motor_torque_constant");
    let limits = Some([common.velocity_limit / TAU, current]);
    let limits = limits.filter(|limits| limits.iter().all(|limit| limit.is_finite()));
    if common.mode.has_own_loops() && common.torque_limit.is_finite() && limits.is_none() {
        let found =
            format!("nothing limits the torque of the ODrive's mode {}", common.mode.name());
        let expected = "`motor_torque_constant`, and `limits` with `velocity`";
        let help =
            "add axis0.config.motor.torque_constant and the greatest speed, or use the mode torque";
        return settings.wrong(diagnostics, "motor_torque_constant", found, expected, help);
    }
    Some(Box::new(ODrive {
        node,
        limits,
        common,
        velocity_scale: settings.number("velocity_scale"),
        torque_scale: settings.number("torque_scale"),
        torque_feedback: settings.flag("torque_feedback"),
        setup: Setup::new(node, timeout.zip(enable), common.watchdog_ms),
        echo: Echo::default(),
        power_up: PowerUp::primed(),
        axis_state: None,
        heard_ns: 0,
        errors: 0,
        not_finite: false,
        measured: Measurement::NONE,
    }))
}

impl ODrive {
    fn frame(&self, command: u16, bytes: &[u8]) -> Option<Frame> {
        Frame::classic(Id::Standard(self.node << 5 | command), bytes)
    }

    fn state_request(&self, state: u32) -> Option<Frame> {
        self.frame(STATE, &state.to_le_bytes())
    }

    fn setpoint(&self, setpoint: &Setpoint) -> Option<Frame> {
        let torque = limited(setpoint.torque, self.common.torque_limit);
        let velocity = setpoint.velocity / TAU;
        match self.common.mode {
            Mode::Position => {
                let [a, b, c, d] = single(setpoint.position / TAU).to_le_bytes();
                let [e, f] = (steps(velocity, self.velocity_scale, 32_767) as i16).to_le_bytes();
                let torque = steps_toward_zero(torque, self.torque_scale, 32_767) as i16;
                let [g, h] = torque.to_le_bytes();
                self.frame(POSITION, &[a, b, c, d, e, f, g, h])
            }
            Mode::Velocity => {
                let numbers = [velocity, torque].map(|number| single(number).to_le_bytes());
                self.frame(VELOCITY, numbers.as_flattened())
            }
            Mode::Torque | Mode::Impedance => self.frame(TORQUE, &single(torque).to_le_bytes()),
        }
    }

    /// Sets the mode. Nothing answers it, so it is sent again and again while the motor has no
    /// power.
    fn control_mode(&self) -> Option<Frame> {
        let mode: u32 = match self.common.mode {
            Mode::Torque | Mode::Impedance => 1,
            Mode::Velocity => 2,
            Mode::Position => 3,
        };
        self.frame(CONTROL_MODE, [mode, PASSTHROUGH].map(u32::to_le_bytes).as_flattened())
    }

    fn limits(&self) -> Option<Frame> {
        self.frame(LIMITS, self.limits?.map(|limit| single(limit).to_le_bytes()).as_flattened())
    }

    /// Cycle `n` without power: in turn the set-point that feeds the watchdog, the request to idle,
    /// and the settings to be written and read.
    fn idle(&mut self, now_ns: u64, n: u64, out: &mut FrameQueue) {
        let frame = match n % 3 {
            1 => self.state_request(IDLE),
            2 => self.setpoint(&Setpoint::still(self.measured.position)),
            _ => {
                self.setup.request().or_else(|| self.question(now_ns, n)).or_else(|| match n % 2 {
                    0 => self.limits().or_else(|| self.control_mode()),
                    _ => self.control_mode(),
                })
            }
        };
        out.push_some(frame);
    }

    /// Every fourth time, once all is set and read: a request that measures the answer's time.
    fn question(&mut self, now_ns: u64, n: u64) -> Option<Frame> {
        let is_due = n.is_multiple_of(12) && !self.setup.parameters().is_empty();
        let parameter = is_due.then(|| self.echo.ask(now_ns)).flatten()?;
        self.setup.read_parameter(parameter)
    }

    fn heartbeat(&mut self, now_ns: u64, errors: u32, state: u8) {
        self.errors = errors;
        self.axis_state = Some(state);
        self.heard_ns = now_ns;
        let is_on = u32::from(state) == CLOSED_LOOP;
        let stage = self.power_up.stage;
        match stage {
            // the request was lost, or the heartbeat is older than it
            Stage::Asked(_) if !is_on && errors == 0 => self.power_up.ask_again(),
            Stage::Asked(_) if !is_on => self.power_up.lose(),
            _ if self.power_up.report(is_on) => self.prepare(),
            _ => {}
        }
    }
}

/// Two singles.
fn pair(frame: &Frame) -> Option<(f64, f64)> {
    let [a, b, c, d, e, f, g, h] = frame.exactly::<8>()?;
    Some((f64::from(f32::from_le_bytes([a, b, c, d])), f64::from(f32::from_le_bytes([e, f, g, h]))))
}

impl Drive for ODrive {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        if self.axis_state.is_some() && now_ns.saturating_sub(self.heard_ns) > HEARTBEAT_LOST_NS {
            // measurements alone do not show whether it has power, or errors
            self.axis_state = None;
            self.power_up.lose();
        }
        let is_ready = self.setup.is_done() && self.axis_state.is_some() && self.state().fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(n) => self.idle(now_ns, n, out),
            Action::Reset => {
                self.power_up.forget();
                self.not_finite = false;
                self.prepare();
                // a set-point, so that the watchdog does not bite again at once
                out.push_some(self.setpoint(&Setpoint::still(self.measured.position)));
                out.push_some(self.frame(FORGET_ERRORS, &[0]));
            }
            Action::Prime(setpoint) => {
                out.push_some(self.limits());
                out.push_some(self.control_mode());
                out.push_some(self.setpoint(&setpoint));
            }
            Action::Ask(_) => out.push_some(self.state_request(CLOSED_LOOP)),
            Action::Await(setpoint) | Action::Follow(setpoint) => {
                out.push_some(self.setpoint(&setpoint));
            }
            Action::Withhold => out.push_some(self.state_request(IDLE)),
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.setpoint(setpoint));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.state_request(IDLE));
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let Id::Standard(id) = frame.id else { return Receipt::NotMine };
        if id >> 5 != self.node {
            return Receipt::NotMine;
        }
        if frame.is_fd() {
            return Receipt::Malformed;
        }
        match (id & 0x1F, frame.data()) {
            (HEARTBEAT, [a, b, c, d, state, _, _, ..]) => {
                self.heartbeat(now_ns, u32::from_le_bytes([*a, *b, *c, *d]), *state);
                Receipt::Noted
            }
            (ERRORS, [a, b, c, d, _, _, _, _]) => {
                self.errors = u32::from_le_bytes([*a, *b, *c, *d]);
                Receipt::Noted
            }
            (ENDPOINT_REPLY, [_, low, high, _, value @ ..]) => {
                let receipt = self.setup.answered(u16::from_le_bytes([*low, *high]), value);
                if let Receipt::Parameter(parameter, _) = receipt {
                    self.echo.answered(now_ns, parameter);
                }
                receipt
            }
            (ESTIMATES, _) => {
                let Some((position, velocity)) = pair(frame) else { return Receipt::Malformed };
                self.not_finite = !(position.is_finite() && velocity.is_finite());
                if self.not_finite {
                    return Receipt::Malformed;
                }
                self.measured.position = position * TAU;
                Receipt::Measured(Measurement { velocity: velocity * TAU, ..self.measured })
            }
            (TEMPERATURES, _) => pair(frame).map_or(Receipt::Malformed, |(bridge, motor)| {
                self.measured.temperature = bridge.max(motor);
                Receipt::Noted
            }),
            (TORQUES, _) => match pair(frame) {
                Some((_, estimate)) if estimate.is_finite() => {
                    self.measured.torque = estimate;
                    Receipt::Noted
                }
                _ => Receipt::Malformed,
            },
            (HEARTBEAT | ERRORS | ENDPOINT_REPLY, _) => Receipt::Malformed,
            // endpoints are left out: earlier firmware reports errors of its encoder there
            (STATE | CONTROL_MODE..=LIMITS | FORGET_ERRORS | POSITION_IS, _) => Receipt::Foreign,
            _ => Receipt::Noted,
        }
    }

    fn state(&self) -> DriveState {
        let power = match (self.axis_state.map(u32::from), self.power_up.stage) {
            (None, _) => Power::Unknown,
            // a heartbeat from before the request is no evidence
            (Some(CLOSED_LOOP), Stage::Off | Stage::On | Stage::Lost) => Power::On,
            (Some(IDLE | 0), Stage::Off | Stage::Lost) => Power::Off,
            _ => Power::Starting,
        };
        let not_finite = fault::when(self.not_finite, fault::NOT_FINITE);
        let fault = fault::first([self.errors, not_finite, self.power_up.fault()]);
        DriveState { power, fault, watchdog: self.setup.watchdog }
    }

    fn prepare(&mut self) {
        self.setup.again();
        self.echo = Echo::default();
    }

    fn round_trip_ns(&self, now_ns: u64) -> Option<u64> {
        (!self.setup.parameters().is_empty()).then(|| self.echo.round_trip_ns(now_ns))
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.axis_state, self.errors, self.not_finite) = (None, 0, false);
        self.measured = Measurement::NONE;
        self.prepare();
    }

    /// All commands of the node.
    fn identifiers(&self) -> Vec<Id> {
        (0..32).map(|command| Id::Standard(self.node << 5 | command)).collect()
    }

    fn replies(&self) -> Vec<Reply> {
        let reply = |command| Reply::classic(Id::Standard(self.node << 5 | command), 8);
        let torques = self.torque_feedback.then(|| reply(TORQUES));
        [reply(ESTIMATES)].into_iter().chain(torques).collect()
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.frame(POSITION_IS, &[0; 4]));
        true
    }

    fn parameters(&self) -> &'static [Parameter] {
        self.setup.parameters()
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        out.push_some(self.setup.read_parameter(parameter));
    }
}

state!(ODrive {
    setup, echo, power_up, axis_state, heard_ns, errors, not_finite, measured;
    node, limits, common, velocity_scale, torque_scale, torque_feedback
});
