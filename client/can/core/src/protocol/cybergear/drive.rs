//! The bridge's half of the protocol.

use sarrus_models::Diagnostics;

use super::keys::{
    FAULTS, FEEDBACK, LAST, LIMIT_TORQUE, PARAMETERS, POWER_OFF, POWER_ON, READ, RUN_MODE, RUNS,
    SAVE, SET_ID, SETPOINT, TIMEOUT_PER_MS, WHO, WRITE, ZERO,
};
use crate::drive::{
    Drive, DriveCommand, DriveState, Pairing, Parameter, Power, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::codes::{Coded, Codes};
use crate::protocol::keys::RANGES;
use crate::protocol::number::single;
use crate::protocol::power_up::{Action, PowerUp};
use crate::protocol::{Common, Made, Settings, fault};
use crate::state::state;

/// A parameter that is read before the motor gets power, and first written if it has a desired
/// value.
#[derive(Clone, Copy, Debug)]
struct Step {
    index: u16,
    desired: Option<u32>,
}

#[derive(Debug)]
struct CyberGear {
    id: u32,
    host: u32,
    /// Its zero can be stored; a CyberGear forgets it.
    can_save: bool,
    coded: Coded,
    watchdog_index: u16,
    watchdog: Watchdog,
    /// The set-up, its present step, and whether that step was written and awaits its read-back.
    steps: Vec<Step>,
    next: usize,
    is_written: bool,
    power_up: PowerUp,
    /// By the feedback's mode.
    power: Power,
    /// Faults of the feedback, and those that the motor reported by themselves.
    motor_fault: u32,
    reported_fault: u32,
    /// The setting that the motor refused, as a fault; 0 without one.
    refused: u32,
}

/// Ranges of a CyberGear, in the order of [`RANGES`].
const CYBERGEAR_RANGES: [f64; 5] = [f64::NAN, 30.0, 12.0, 500.0, 5.0];

pub(super) fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let is_cybergear = settings.text("model") == "cybergear";
    let mut ranges = CYBERGEAR_RANGES;
    let mut good = true;
    for (key, range) in RANGES.iter().zip(&mut ranges) {
        if settings.has(key) {
            *range = settings.number(key);
        } else if !is_cybergear {
            let found = format!("the drive has no `{key}`");
            let help = "add it from the motor's manual";
            let place = settings.place("model");
            diagnostics.error(place, found, "the range of this RobStride", help);
            good = false;
        }
    }
    let watchdog_index = match settings.has("watchdog_index") {
        true => settings.integer("watchdog_index") as u16,
        false if is_cybergear => 0x200C,
        false => 0x7028,
    };
    let mut steps = vec![Step { index: RUN_MODE, desired: Some(0) }];
    if common.torque_limit.is_finite() {
        let [_, _, torque, ..] = ranges;
        let limit = single(common.torque_limit.clamp(0.0, torque));
        steps.push(Step { index: LIMIT_TORQUE, desired: Some(limit.to_bits()) });
    }
    if watchdog_index != 0 {
        let counts = common.watchdog_ms.saturating_mul(TIMEOUT_PER_MS);
        steps.push(Step { index: watchdog_index, desired: Some(counts).filter(|n| *n > 0) });
    }
    good.then(|| {
        Box::new(CyberGear {
            id: settings.integer("id") as u32,
            host: settings.integer("host_id") as u32,
            can_save: !is_cybergear,
            coded: Coded::new(Codes::new(ranges, 16), common),
            watchdog_index,
            watchdog: unknown(watchdog_index),
            steps,
            next: 0,
            is_written: false,
            power_up: PowerUp::primed(),
            power: Power::Unknown,
            motor_fault: 0,
            reported_fault: 0,
            refused: 0,
        }) as Box<dyn Drive>
    })
}

const fn unknown(watchdog_index: u16) -> Watchdog {
    if watchdog_index == 0 { Watchdog::Unreadable } else { Watchdog::Unknown }
}

impl CyberGear {
    fn frame(&self, kind: u32, data: u32, bytes: &[u8]) -> Option<Frame> {
        Frame::classic(Id::Extended(kind << 24 | data << 8 | self.id), bytes)
    }

    fn power_off(&self, forget_faults: u8) -> Option<Frame> {
        self.frame(POWER_OFF, self.host, &[forget_faults, 0, 0, 0, 0, 0, 0, 0])
    }

    fn parameter(&self, kind: u32, index: u16, value: u32) -> Option<Frame> {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        self.frame(kind, self.host, &[low, high, 0, 0, a, b, c, d])
    }

    fn follow(&mut self, setpoint: &Setpoint, out: &mut FrameQueue) {
        self.encode(setpoint, out);
        self.coded.alternate();
    }

    fn is_done(&self) -> bool {
        self.next == self.steps.len()
    }

    fn request(&self) -> Option<Frame> {
        let step = self.steps.get(self.next)?;
        match step.desired.filter(|_| !self.is_written) {
            Some(value) => self.parameter(WRITE, step.index, value),
            None => self.parameter(READ, step.index, 0),
        }
    }

    /// The step whose parameter is read now, if this is its index.
    fn read_step(&self, index: u16) -> Option<Step> {
        let is_read = |step: &Step| self.is_written || step.desired.is_none();
        self.steps.get(self.next).copied().filter(|step| step.index == index && is_read(step))
    }

    /// Cycle `n` without power; settings to be written and read take every other one.
    fn idle(&mut self, n: u64, out: &mut FrameQueue) {
        if !n.is_multiple_of(2) {
            return out.push_some(self.power_off(0));
        }
        out.push_some(self.request().or_else(|| self.power_off(0)));
        // a write has no answer of its own: the value that is read afterwards counts
        self.is_written = true;
    }

    fn read(&mut self, bytes: [u8; 8]) -> Receipt {
        let [low, high, _, _, a, b, c, d] = bytes;
        let index = u16::from_le_bytes([low, high]);
        let number = u32::from_le_bytes([a, b, c, d]);
        let held = f32::from_bits(number);
        if let Some(Step { desired, .. }) = self.read_step(index) {
            let (is_held, fault) = match index {
                RUN_MODE => (a == 0, fault::MODE_REFUSED),
                LIMIT_TORQUE => {
                    let is_within = |limit| held.abs() <= f32::from_bits(limit);
                    (desired.is_some_and(is_within), fault::LIMIT_REFUSED)
                }
                _ => {
                    self.watchdog = Watchdog::of_counts(number, TIMEOUT_PER_MS);
                    (desired.is_none_or(|desired| number == desired), 0)
                }
            };
            // where it is not held the write may have been lost
            self.next += usize::from(is_held);
            (self.is_written, self.refused) = (false, fault::when(!is_held, fault));
        }
        match index {
            0 => Receipt::Noted,
            _ if index == self.watchdog_index => Receipt::Parameter(LAST, f64::from(number)),
            RUN_MODE => Receipt::Parameter(0, f64::from(a)),
            _ => Parameter::receipt(PARAMETERS, u32::from(index), number, 32),
        }
    }

    fn feedback(&mut self, data: u32, bytes: [u8; 8]) -> Receipt {
        let mode = data >> 14 & 3;
        let faults = data >> 8 & 0x3F;
        let [a, b, c, d, e, f, g, h] = bytes;
        self.power = if mode == RUNS { Power::On } else { Power::Off };
        self.motor_fault = faults;
        if self.power_up.report(mode == RUNS) {
            self.prepare();
        }
        let codes = [[a, b], [c, d], [e, f]].map(u16::from_be_bytes);
        self.coded.measure(codes, f64::from(i16::from_be_bytes([g, h])) / 10.0)
    }
}

impl Drive for CyberGear {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        let is_ready = self.is_done() && self.power != Power::Unknown && self.state().fault == 0;
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
                out.push_some(self.frame(POWER_ON, self.host, &[0; 8]));
            }
            Action::Follow(setpoint) => self.follow(&setpoint, out),
            Action::Withhold => out.push_some(self.power_off(0)),
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        let [position, velocity, stiffness, damping, torque] = self.coded.setpoint(setpoint);
        let bytes = [position, velocity, stiffness, damping].map(u16::to_be_bytes);
        out.push_some(self.frame(SETPOINT, u32::from(torque), bytes.as_flattened()));
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
                let index = u16::from_le_bytes([low, high]);
                if index == LIMIT_TORQUE && self.read_step(index).is_some() {
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
        let lost = self.power_up.fault();
        let faults =
            [self.reported_fault, self.motor_fault, self.refused, lost, self.coded.fault()];
        let power = self.power_up.reported(self.power);
        DriveState { power, fault: fault::first(faults), watchdog: self.watchdog }
    }

    fn prepare(&mut self) {
        (self.next, self.is_written, self.refused) = (0, false, 0);
        self.watchdog = unknown(self.watchdog_index);
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.power, self.motor_fault, self.reported_fault) = (Power::Unknown, 0, 0);
        self.coded.forget();
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
        self.coded.codes.steps()
    }

    fn largest_gains(&self) -> [f64; 2] {
        self.coded.codes.largest_gains()
    }

    fn pairing(&self) -> Pairing {
        Pairing::once(self.is_done())
    }

    fn replies(&self) -> Vec<Reply> {
        vec![Reply::classic(Id::Extended(FEEDBACK << 24 | self.id << 8 | self.host), 8)]
    }

    fn probe(&mut self, out: &mut FrameQueue) {
        out.push_some(self.frame(WHO, self.host, &[0; 8]));
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.frame(ZERO, self.host, &[1, 0, 0, 0, 0, 0, 0, 0]));
        self.coded.set_zero();
        true
    }

    fn parameters(&self) -> &'static [Parameter] {
        let n_known = if self.watchdog_index == 0 { LAST } else { PARAMETERS.len() };
        PARAMETERS.get(..n_known).unwrap_or_default()
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        let known = PARAMETERS.get(parameter).filter(|known| known.address != 0);
        let index = known.map_or(self.watchdog_index, |known| known.address as u16);
        out.push_some(self.parameter(READ, index, 0));
    }

    fn ranges(&self) -> [f64; 3] {
        self.coded.codes.ranges()
    }

    fn save_zero(&mut self, out: &mut FrameQueue) -> bool {
        if self.can_save {
            out.push_some(self.frame(SAVE, self.host, &[1, 2, 3, 4, 5, 6, 7, 8]));
        }
        self.can_save
    }

    fn set_id(&mut self, id: u32, out: &mut FrameQueue) -> bool {
        let frame = self.frame(SET_ID, id << 8 | self.host, &[0; 8]);
        out.push_some(frame.filter(|_| id <= 127));
        id <= 127
    }
}

state!(CyberGear {
    coded, watchdog, next, is_written, power_up, power, motor_fault, reported_fault, refused;
    id, host, can_save, watchdog_index, steps
});
