//! The bridge's half of the protocol.

use std::f64::consts::TAU;

use sarrus_models::Diagnostics;

use super::setup::{self, Desired, PARAMETERS, Setup};
use super::states::{
    DISABLE_VOLTAGE, ENABLE, FORGET_FAULT, QUICK_STOP, SHUTDOWN, SWITCH_ON, State,
};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Pairing, Parameter, Power, Receipt, Reply,
    Setpoint, Shared,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::number::{limited, steps, steps_toward_zero};
use crate::protocol::power_up::{Action, PowerUp, Stage};
use crate::protocol::turns::Unwrapped;
use crate::protocol::{Common, Made, Settings, fault};
use crate::state::state;

const SYNC: u16 = 0x080;
/// A drive that is set up and silent for this time is set up again `[ns]`.
const SILENCE_NS: u64 = 500_000_000;
/// That time for a drive that reports not to be operational `[ns]`.
const STOPPED_NS: u64 = 100_000_000;

/// Time between two heartbeats for each millisecond of the drive's watchdog, an eighth, so that
/// lost ones do not end it `[ns]`.
const HEARTBEAT_NS: u64 = 125_000;

#[derive(Debug)]
struct Cia402 {
    desired: Desired,
    torque_limit: f64,
    counts: f64,
    velocity_counts: f64,
    setup: Setup,
    state: Option<State>,
    power_up: PowerUp,
    emergency: u16,
    /// The drive stopped following, and no cycle has reacted yet.
    emergency_holds: bool,
    /// The position `[counts]`.
    counted: Unwrapped,
    /// First PDOs that came, and not yet the second one of their cycle.
    n_new: u8,
    /// When it last reported its status, or was set up `[ns]`.
    heard_ns: Option<u64>,
    /// When the last position came `[ns]`.
    position_ns: Option<u64>,
    torque: f64,
    heartbeat_ns: Option<u64>,
}

pub(super) fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let node = settings.integer("node") as u16;
    let master = settings.integer("master") as u16;
    if node == master {
        let found = format!("`master` is {node} like `node`");
        let help = "give this side a free one";
        return settings.wrong(diagnostics, "master", found, "another node", help);
    }
    let counts = settings.number("counts_per_turn");
    let rated_torque = settings.number("rated_torque");
    let desired = Desired {
        node,
        master,
        mode: common.mode,
        watchdog_ms: common.watchdog_ms.min(0xFFFF) as u16,
        torque_limit: (common.torque_limit / rated_torque * 1000.0).floor(),
        rated_torque,
        torque_offset: settings.flag("torque_offset") && common.mode != Mode::Torque,
        velocity_feedback: settings.flag("velocity_feedback"),
        configure: settings.flag("configure"),
        period_ns: common.period_ns,
    };
    Some(Box::new(Cia402 {
        desired,
        torque_limit: common.torque_limit,
        counts,
        velocity_counts: settings.number_or("velocity_counts_per_turn", counts),
        setup: Setup::new(desired),
        state: None,
        power_up: PowerUp::at_once(),
        emergency: 0,
        emergency_holds: false,
        counted: Unwrapped::new(1 << 32, i64::from(i32::MAX)),
        n_new: 0,
        heard_ns: None,
        position_ns: None,
        torque: f64::NAN,
        heartbeat_ns: None,
    }))
}

impl Cia402 {
    fn frame(&self, base: u16, bytes: &[u8]) -> Option<Frame> {
        Frame::classic(Id::Standard(base + self.desired.node), bytes)
    }

    /// The control word with a set-point.
    fn command(&self, control: u16, setpoint: &Setpoint) -> Option<Frame> {
        let per_mille = self.desired.rated_torque / 1000.0;
        let torque = limited(setpoint.torque, self.torque_limit);
        let torque = (steps_toward_zero(torque, per_mille, 32_767) as i16).to_le_bytes();
        let [low, high] = control.to_le_bytes();
        let target = match self.desired.mode {
            Mode::Position => steps(setpoint.position, TAU / self.counts, i32::MAX),
            Mode::Velocity => steps(setpoint.velocity, TAU / self.velocity_counts, i32::MAX),
            Mode::Torque | Mode::Impedance => {
                return self.frame(0x200, &[low, high, torque[0], torque[1]]);
            }
        };
        let [a, b, c, d] = target.to_le_bytes();
        let n_bytes = if self.desired.torque_offset { 8 } else { 6 };
        self.frame(0x200, [low, high, a, b, c, d, torque[0], torque[1]].get(..n_bytes)?)
    }

    /// Set-point that keeps the motor where it is.
    fn neutral(&self) -> Setpoint {
        Setpoint {
            position: self.counted.whole().map_or(0.0, |whole| whole as f64 * TAU / self.counts),
            ..Setpoint::default()
        }
    }

    /// The heartbeat of this side, eight times in the time that the drive waits for it.
    fn beat(&mut self, now_ns: u64, out: &mut FrameQueue) {
        let Some((frame, period_ns)) = self.heartbeat() else { return };
        if self.heartbeat_ns.is_none_or(|last| now_ns.saturating_sub(last) >= period_ns) {
            self.heartbeat_ns = Some(now_ns);
            out.push(frame);
        }
    }

    /// Whether it should have reported its status for this time.
    fn is_silent(&self, now_ns: u64, time_ns: u64) -> bool {
        self.setup.is_done()
            && self.heard_ns.is_some_and(|heard| now_ns.saturating_sub(heard) > time_ns)
    }

    /// It has lost its settings.
    fn set_up_again(&mut self) {
        self.lose();
        (self.state, self.n_new) = (None, 0);
        self.setup.again();
    }

    fn lose(&mut self) {
        self.emergency_holds |= self.power_up.stage == Stage::On;
        self.power_up.lose();
    }

    fn idle(&mut self, now_ns: u64, out: &mut FrameQueue) {
        self.emergency_holds = false;
        if self.is_silent(now_ns, SILENCE_NS) {
            self.set_up_again();
        }
        if !self.setup.is_done() {
            self.heard_ns = Some(now_ns);
        }
        out.push_some(self.command(DISABLE_VOLTAGE, &self.neutral()));
        out.push_some(self.setup.request(now_ns, false));
    }

    fn status(&mut self, status: u16) {
        let state = State::of(status);
        self.state = Some(state);
        self.emergency_holds |= self.power_up.report(state == State::Enabled);
        let follows = self.power_up.stage == Stage::On || self.emergency_holds;
        if state != State::Faulty && self.emergency != 0 && !follows {
            // reported by EMCY and gone without one
            self.emergency = 0;
        }
    }

    /// Whether only a master sends it: a set-point, a request by SDO, an NMT command, the heartbeat
    /// of this side.
    fn is_command(&self, id: u16, bytes: &[u8]) -> bool {
        let is_addressed = |node: u8| node == 0 || u16::from(node) == self.desired.node;
        let is_network = id == 0 && matches!(bytes, [_, node, ..] if is_addressed(*node));
        let is_heartbeat = id == 0x700 + self.desired.master && self.desired.watchdog_ms > 0;
        is_network
            || is_heartbeat
            || id == 0x200 + self.desired.node
            || id == 0x600 + self.desired.node
    }

    fn measured(&self, velocity: f64) -> Receipt {
        let position = self.neutral().position;
        Receipt::Measured(Measurement {
            position,
            velocity,
            torque: self.torque,
            ..Measurement::NONE
        })
    }
}

impl Drive for Cia402 {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        self.beat(now_ns, out);
        let is_ready = self.setup.is_done() && self.state.is_some() && self.state().fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(_) | Action::Withhold => self.idle(now_ns, out),
            Action::Reset => {
                (self.emergency, self.emergency_holds) = (0, false);
                if self.setup.fault != 0 {
                    self.setup.again();
                }
                out.push_some(self.command(FORGET_FAULT, &self.neutral()));
            }
            Action::Prime(setpoint)
            | Action::Ask(setpoint)
            | Action::Await(setpoint)
            | Action::Follow(setpoint) => {
                let control = match self.state {
                    Some(State::Disabled) => SHUTDOWN,
                    Some(State::Ready) => SWITCH_ON,
                    Some(State::SwitchedOn | State::Enabled) => ENABLE,
                    _ => DISABLE_VOLTAGE,
                };
                out.push_some(self.command(control, &setpoint));
                out.push_some(self.setup.request(now_ns, true));
            }
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.command(ENABLE, setpoint));
    }

    /// The control word by PDO with a SYNC that makes it count, and by SDO, which a drive takes in
    /// every network state but stopped.
    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.command(DISABLE_VOLTAGE, &self.neutral()));
        out.push_some(self.sync());
        out.push_some(setup::write(self.desired.node, 0x6040, 0, 2, 0));
    }

    /// The ramp and the reaction after it are the drive's, 6085 and 605A; so is its brake.
    fn quick_stop(&mut self, now_ns: u64, out: &mut FrameQueue) -> bool {
        self.beat(now_ns, out);
        // power that goes by this command is not lost
        self.power_up.forget();
        out.push_some(self.command(QUICK_STOP, &self.neutral()));
        true
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let Id::Standard(id) = frame.id else { return Receipt::NotMine };
        if self.is_command(id, frame.data()) {
            return Receipt::Foreign;
        }
        let Some(base) = id.checked_sub(self.desired.node) else { return Receipt::NotMine };
        if !matches!(base, 0x080 | 0x180 | 0x280 | 0x580 | 0x700) {
            return Receipt::NotMine;
        }
        match (base, frame.data()) {
            _ if frame.is_fd() => Receipt::Malformed,
            (0x080, [low, high, _, ..]) => {
                self.emergency = u16::from_le_bytes([*low, *high]);
                Receipt::Noted
            }
            // the content of a PDO is known once it is set up
            (0x180, [_, _, _, _, _, _, _, _]) | (0x280, [_, _, _, _]) if !self.setup.is_done() => {
                Receipt::Noted
            }
            (0x180, [low, high, a, b, c, d, e, f]) => {
                (self.n_new, self.heard_ns) = ((self.n_new + 1).min(2), Some(now_ns));
                self.position_ns = Some(now_ns);
                self.status(u16::from_le_bytes([*low, *high]));
                self.counted.follow(i64::from(i32::from_le_bytes([*a, *b, *c, *d])));
                self.torque =
                    f64::from(i16::from_le_bytes([*e, *f])) * self.desired.rated_torque / 1000.0;
                if self.desired.velocity_feedback {
                    Receipt::Noted
                } else {
                    self.measured(f64::NAN)
                }
            }
            (0x280, [a, b, c, d]) if self.desired.velocity_feedback && self.n_new > 0 => {
                self.n_new -= 1;
                self.measured(
                    f64::from(i32::from_le_bytes([*a, *b, *c, *d])) * TAU / self.velocity_counts,
                )
            }
            (0x280, [_, _, _, _]) => Receipt::Noted,
            (0x580, _) => match frame.exactly::<8>() {
                Some(bytes) => self.setup.answered(bytes),
                None => Receipt::Malformed,
            },
            (0x700, [state]) => {
                match state & 0x7F {
                    // it booted: its settings are lost
                    0 => {
                        self.set_up_again();
                        self.counted.forget();
                    }
                    // stopped or pre-operational, and not just commanded to be operational
                    0x04 | 0x7F if self.is_silent(now_ns, STOPPED_NS) => self.set_up_again(),
                    _ => {}
                }
                Receipt::Noted
            }
            _ => Receipt::Malformed,
        }
    }

    fn state(&self) -> DriveState {
        let power = match self.state {
            None => Power::Unknown,
            Some(State::Enabled | State::QuickStop) if self.setup.is_mode_shown() => Power::On,
            Some(_) if self.power_up.is_asked() => Power::Starting,
            Some(_) => Power::Off,
        };
        let is_faulty = self.state == Some(State::Faulty);
        let is_beyond = self.desired.mode == Mode::Position
            && self.counted.whole().is_some_and(|whole| i32::try_from(whole).is_err());
        let fault = fault::first([
            u32::from(self.emergency),
            fault::when(is_faulty, fault::UNKNOWN),
            self.setup.fault,
            self.power_up.fault(),
            fault::when(is_beyond, fault::OUT_OF_RANGE),
        ]);
        DriveState { power, fault, watchdog: self.setup.watchdog }
    }

    fn prepare(&mut self) {
        self.set_up_again();
    }

    fn forget(&mut self) {
        self.counted.forget();
        (self.heard_ns, self.heartbeat_ns) = (None, None);
        self.power_up.forget();
        (self.emergency, self.emergency_holds, self.torque) = (0, false, f64::NAN);
        self.prepare();
    }

    fn identifiers(&self) -> Vec<Id> {
        [0x080, 0x180, 0x200, 0x280, 0x580, 0x600, 0x700]
            .map(|base| Id::Standard(base + self.desired.node))
            .to_vec()
    }

    fn shared_identifiers(&self) -> Vec<Shared> {
        // frames of the master to all
        [0, SYNC, 0x700 + self.desired.master]
            .map(|id| Shared { id: Id::Standard(id), tag: self.desired.node, mask: 0x7F })
            .to_vec()
    }

    fn steps(&self) -> Setpoint {
        let torque = self.desired.rated_torque / 1000.0;
        Setpoint::of_motion(TAU / self.counts, TAU / self.velocity_counts, torque)
    }

    fn position_ns(&self) -> Option<u64> {
        self.position_ns
    }

    fn pairing(&self) -> Pairing {
        Pairing::once(self.setup.is_done() && self.state.is_some())
    }

    fn replies(&self) -> Vec<Reply> {
        let reply = |base: u16, len| Reply::classic(Id::Standard(base + self.desired.node), len);
        let velocity = self.desired.velocity_feedback.then(|| reply(0x280, 4));
        [reply(0x180, 8)].into_iter().chain(velocity).collect()
    }

    fn sync(&self) -> Option<Frame> {
        Frame::classic(Id::Standard(SYNC), &[])
    }

    fn heartbeat(&self) -> Option<(Frame, u64)> {
        let frame = Frame::classic(Id::Standard(0x700 + self.desired.master), &[0x05])?;
        (self.desired.watchdog_ms > 0)
            .then(|| (frame, u64::from(self.desired.watchdog_ms) * HEARTBEAT_NS))
    }

    /// Asks for the device's type, object 1000.
    fn probe(&mut self, out: &mut FrameQueue) {
        out.push_some(setup::read(self.desired.node, 0x1000, 0));
    }

    fn parameters(&self) -> &'static [Parameter] {
        PARAMETERS
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        let Some(parameter) = PARAMETERS.get(parameter) else { return };
        out.push_some(setup::read(self.desired.node, parameter.address as u16, 0));
    }
}

state!(Cia402 {
    setup, state, power_up, emergency, emergency_holds, counted, n_new, heard_ns, position_ns,
    torque, heartbeat_ns;
    desired, torque_limit, counts, velocity_counts
});
