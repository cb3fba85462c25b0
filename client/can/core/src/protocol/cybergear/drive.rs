//! The bridge's half of the protocol.

use super::keys::{
    FAULTS, FEEDBACK, INDICES, LIMIT_TORQUE, PARAMETERS, POWER_OFF, POWER_ON, READ, RUN_MODE, RUNS,
    SAVE, SET_ID, SETPOINT, TIMEOUT_PER_MS, WHO, WRITE, ZERO,
};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Parameter, Power, Receipt, Reply, Setpoint,
    Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::codes::Codes;
use crate::protocol::fault;
use crate::protocol::power_up::{Action, PowerUp, Stage};
use crate::protocol::turns::Turns;

/// Settings that are written and read before the motor gets power, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    WriteMode,
    ReadMode,
    WriteLimit,
    ReadLimit,
    WriteTimeout,
    ReadTimeout,
    Done,
}

#[derive(Debug)]
pub(super) struct CyberGear {
    pub(super) id: u32,
    pub(super) host: u32,
    /// Its zero can be stored; a CyberGear forgets it.
    pub(super) can_save: bool,
    pub(super) mode: Mode,
    pub(super) torque_limit: f64,
    pub(super) codes: Codes,
    /// Limit of the torque in the motor `[N m]`, where there is one.
    pub(super) limit: Option<f32>,
    pub(super) watchdog_index: u16,
    pub(super) watchdog_ms: u32,
    pub(super) watchdog: Watchdog,
    pub(super) step: Step,
    pub(super) power_up: PowerUp,
    /// Feedback's mode.
    pub(super) runs: Option<u32>,
    /// Faults of the feedback, and those that the motor reported by themselves.
    pub(super) motor_fault: u32,
    pub(super) reported_fault: u32,
    /// The setting that the motor refused, as a fault; 0 without one.
    pub(super) refused: u32,
    pub(super) turns: Turns,
    /// Position and velocity as last measured `[rad, rad/s]`.
    pub(super) measured: Option<[f64; 2]>,
    pub(super) odd: bool,
}

pub(super) const fn unknown(watchdog_index: u16) -> Watchdog {
    if watchdog_index == 0 { Watchdog::Unreadable } else { Watchdog::Unknown }
}

impl CyberGear {
    fn frame(&self, kind: u32, data: u32, bytes: [u8; 8]) -> Option<Frame> {
        Frame::classic(Id::Extended(kind << 24 | data << 8 | self.id), &bytes)
    }

    fn power_off(&self, forget_faults: u8) -> Option<Frame> {
        self.frame(POWER_OFF, self.host, [forget_faults, 0, 0, 0, 0, 0, 0, 0])
    }

    fn parameter(&self, kind: u32, index: u16, value: u32) -> Option<Frame> {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        self.frame(kind, self.host, [low, high, 0, 0, a, b, c, d])
    }

    fn setpoint(&self, setpoint: &Setpoint) -> Option<Frame> {
        let setpoint = match self.mode {
            Mode::Torque => Setpoint { torque: setpoint.torque, ..Setpoint::default() },
            _ => *setpoint,
        };
        let codes = self.codes.of(&setpoint, self.torque_limit, self.measured, self.odd);
        let [position, velocity, stiffness, damping, torque] = codes;
        let [a, b] = position.to_be_bytes();
        let [c, d] = velocity.to_be_bytes();
        let [e, f] = stiffness.to_be_bytes();
        let [g, h] = damping.to_be_bytes();
        self.frame(SETPOINT, u32::from(torque), [a, b, c, d, e, f, g, h])
    }

    /// A set-point; codes beside zero alternate from one to the next.
    fn follow(&mut self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.setpoint(setpoint));
        self.odd = !self.odd;
    }

    /// The watchdog's time in its units.
    fn timeout(&self) -> u32 {
        self.watchdog_ms.saturating_mul(TIMEOUT_PER_MS)
    }

    fn request(&self) -> Option<Frame> {
        match self.step {
            Step::WriteMode => self.parameter(WRITE, RUN_MODE, 0),
            Step::ReadMode => self.parameter(READ, RUN_MODE, 0),
            Step::WriteLimit => {
                self.parameter(WRITE, LIMIT_TORQUE, self.limit.unwrap_or_default().to_bits())
            }
            Step::ReadLimit => self.parameter(READ, LIMIT_TORQUE, 0),
            Step::WriteTimeout => self.parameter(WRITE, self.watchdog_index, self.timeout()),
            Step::ReadTimeout => self.parameter(READ, self.watchdog_index, 0),
            Step::Done => None,
        }
    }

    /// Cycle `n` without power; settings to be written and read take every other one.
    fn idle(&mut self, n: u64, out: &mut FrameQueue) {
        if !n.is_multiple_of(2) {
            return out.push_some(self.power_off(0));
        }
        out.push_some(self.request().or_else(|| self.power_off(0)));
        // a write has no answer of its own: the value that is read afterwards counts
        self.step = match self.step {
            Step::WriteMode => Step::ReadMode,
            Step::WriteLimit => Step::ReadLimit,
            Step::WriteTimeout => Step::ReadTimeout,
            step => step,
        };
    }

    fn after_limit(&self) -> Step {
        match (self.watchdog_index, self.watchdog_ms) {
            (0, _) => Step::Done,
            (_, 0) => Step::ReadTimeout,
            _ => Step::WriteTimeout,
        }
    }

    fn read(&mut self, bytes: [u8; 8]) -> Receipt {
        let [low, high, _, _, a, b, c, d] = bytes;
        let index = u16::from_le_bytes([low, high]);
        let number = u32::from_le_bytes([a, b, c, d]);
        if index == RUN_MODE && self.step == Step::ReadMode {
            self.refused = if a != 0 { fault::MODE_REFUSED } else { 0 };
            self.step = match self.limit {
                // the write may have been lost
                _ if self.refused != 0 => Step::WriteMode,
                Some(_) => Step::WriteLimit,
                None => self.after_limit(),
            };
        }
        if index == LIMIT_TORQUE && self.step == Step::ReadLimit {
            let held = f32::from_bits(number);
            let is_held = self.limit.is_some_and(|limit| held.abs() <= limit);
            self.refused = if is_held { 0 } else { fault::LIMIT_REFUSED };
            self.step = if is_held { self.after_limit() } else { Step::WriteLimit };
        }
        if index == self.watchdog_index && index != 0 {
            if self.step == Step::ReadTimeout {
                self.watchdog = Watchdog::of_counts(number, TIMEOUT_PER_MS);
                let is_desired = self.watchdog_ms == 0 || number == self.timeout();
                self.step = if is_desired { Step::Done } else { Step::WriteTimeout };
            }
            return Receipt::Parameter(INDICES.len(), f64::from(number));
        }
        match INDICES.iter().position(|known| *known == index) {
            Some(0) => Receipt::Parameter(0, f64::from(a)),
            Some(parameter) => {
                Receipt::Parameter(parameter, f64::from(f32::from_le_bytes([a, b, c, d])))
            }
            None => Receipt::Noted,
        }
    }

    fn feedback(&mut self, data: u32, bytes: [u8; 8]) -> Receipt {
        let mode = data >> 14 & 3;
        let faults = data >> 8 & 0x3F;
        let [a, b, c, d, e, f, g, h] = bytes;
        self.runs = Some(mode);
        self.motor_fault = faults;
        if self.power_up.report(mode == RUNS) {
            self.prepare();
        }
        let whole = self.turns.follow(u16::from_be_bytes([a, b]));
        let position = self.codes.position.value_at(whole);
        let velocity = self.codes.velocity.value(u16::from_be_bytes([c, d]));
        self.measured = Some([position, velocity]);
        Receipt::Measured(Measurement {
            position,
            velocity,
            torque: self.codes.torque.value(u16::from_be_bytes([e, f])),
            temperature: f64::from(i16::from_be_bytes([g, h])) / 10.0,
        })
    }
}

impl Drive for CyberGear {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        let is_ready = self.step == Step::Done && self.runs.is_some() && self.state().fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(n) => self.idle(n, out),
            Action::Reset => {
                self.reported_fault = 0;
                self.prepare();
                out.push_some(self.power_off(1));
            }
            // nothing but a torque of zero waits in the motor when it gets power
            Action::Prime(_) => self.follow(&Setpoint::default(), out),
            Action::Ask(_) | Action::Await(_) => {
                out.push_some(self.frame(POWER_ON, self.host, [0; 8]));
            }
            Action::Follow(setpoint) => self.follow(&setpoint, out),
            Action::Withhold => out.push_some(self.power_off(0)),
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.setpoint(setpoint));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.power_off(0));
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        let Id::Extended(id) = frame.id else { return Receipt::NotMine };
        let kind = id >> 24;
        let data = id >> 8 & 0xFFFF;
        let receiver = id & 0xFF;
        // a set-point has no room for the host's identifier: its answer goes to the one that the
        // motor keeps, 0 as delivered
        // kinds that only a host sends, to this motor; reads have the same kind as their answers
        if receiver == self.id && matches!(kind, SETPOINT | POWER_ON | POWER_OFF | ZERO | WRITE) {
            return Receipt::Foreign;
        }
        let is_ours = receiver == self.host || (kind == FEEDBACK && receiver == 0);
        let is_answer = matches!(kind, FEEDBACK | READ | FAULTS) && is_ours;
        let is_who = kind == WHO && receiver == 0xFE;
        if data & 0xFF != self.id || !(is_answer || is_who) {
            return Receipt::NotMine;
        }
        let Some(bytes) = frame.exactly::<8>().filter(|_| !frame.is_fd()) else {
            return Receipt::Malformed;
        };
        match kind {
            FEEDBACK => self.feedback(data, bytes),
            // the upper half of the data is set where the parameter does not exist
            READ if data >> 8 != 0 => {
                let [low, high, ..] = bytes;
                let is_limit = u16::from_le_bytes([low, high]) == LIMIT_TORQUE;
                if is_limit && self.step == Step::ReadLimit {
                    self.refused = fault::LIMIT_REFUSED;
                }
                Receipt::Noted
            }
            READ => self.read(bytes),
            FAULTS => {
                let [a, b, c, d, ..] = bytes;
                self.reported_fault = u32::from_le_bytes([a, b, c, d]);
                Receipt::Noted
            }
            _ => Receipt::Noted,
        }
    }

    fn state(&self) -> DriveState {
        let power = match self.runs {
            None => Power::Unknown,
            Some(RUNS) => Power::On,
            Some(_) if self.power_up.is_starting() => Power::Starting,
            Some(_) => Power::Off,
        };
        let fault = match self.power_up.stage() {
            _ if self.reported_fault != 0 => self.reported_fault,
            _ if self.motor_fault != 0 => self.motor_fault,
            _ if self.refused != 0 => self.refused,
            Stage::Lost => fault::POWER_LOST,
            _ => self.turns.fault(self.mode),
        };
        DriveState { power, fault, watchdog: self.watchdog }
    }

    fn prepare(&mut self) {
        (self.step, self.refused) = (Step::WriteMode, 0);
        self.watchdog = unknown(self.watchdog_index);
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.runs, self.motor_fault, self.reported_fault) = (None, 0, 0);
        self.measured = None;
        self.turns.forget();
        self.prepare();
    }

    /// Power on, and feedback without faults: they stand for all kinds of frames of this motor.
    fn identifiers(&self) -> Vec<Id> {
        vec![
            Id::Extended(POWER_ON << 24 | self.host << 8 | self.id),
            Id::Extended(FEEDBACK << 24 | self.id << 8 | self.host),
        ]
    }

    fn steps(&self) -> Setpoint {
        self.codes.steps()
    }

    fn largest_gains(&self) -> [f64; 2] {
        self.codes.largest_gains()
    }

    fn is_paired(&self) -> bool {
        self.step == Step::Done
    }

    fn replies(&self) -> Vec<Reply> {
        vec![Reply::classic(Id::Extended(FEEDBACK << 24 | self.id << 8 | self.host), 8)]
    }

    fn probe(&mut self, out: &mut FrameQueue) {
        out.push_some(self.frame(WHO, self.host, [0; 8]));
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.frame(ZERO, self.host, [1, 0, 0, 0, 0, 0, 0, 0]));
        self.turns = Turns::default();
        true
    }

    fn parameters(&self) -> &'static [Parameter] {
        let n_known = if self.watchdog_index == 0 { INDICES.len() } else { PARAMETERS.len() };
        PARAMETERS.get(..n_known).unwrap_or_default()
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        let index = INDICES.get(parameter).copied().unwrap_or(self.watchdog_index);
        out.push_some(self.parameter(READ, index, 0));
    }

    fn ranges(&self) -> [f64; 3] {
        self.codes.ranges()
    }

    fn save_zero(&mut self, out: &mut FrameQueue) -> bool {
        if self.can_save {
            out.push_some(self.frame(SAVE, self.host, [1, 2, 3, 4, 5, 6, 7, 8]));
        }
        self.can_save
    }

    fn set_id(&mut self, id: u32, out: &mut FrameQueue) -> bool {
        let frame = self.frame(SET_ID, id << 8 | self.host, [0; 8]);
        out.push_some(frame.filter(|_| id <= 127));
        id <= 127
    }
}
