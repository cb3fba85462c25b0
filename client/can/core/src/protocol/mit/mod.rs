//! MIT mode: position, velocity, gains and torque in one classic frame of 8 bytes, the state in the
//! reply.
//!
//! Sources: mini cheetah motor controller firmware (Katz, MIT, CAN_com); CubeMars AK series manual
//! V1.0.8 (`t_motor`); Damiao DM-J4310-2EC manual V1.1 (`damiao`); RobStride 00 manual, chapter
//! "MIT protocol" (`robstride`).
//!
//! - Command, standard identifier = `id`, big-endian bits: position 16, velocity 12, stiffness 12,
//!   damping 12, torque 12. Code 0 is the low end of a range and all ones the high end: ±
//!   `position_range` rad, ± `velocity_range` rad/s, 0 … `stiffness_range` N m/rad, 0 …
//!   `damping_range` N m s/rad, ± `torque_range` N m. Ranges belong to the motor's firmware; public
//!   tables for one motor differ.
//! - Special commands: FF ×7, then FC power on, FD power off, FE zero here, FB forget faults
//!   (Damiao and RobStride only: the others would take FB for a set-point). To a RobStride FF ×6,
//!   00, FB asks for its faults.
//! - Reply on `reply_id`: byte 0 the motor's id (Damiao: id in the low, state in the high half),
//!   position 16, velocity 12, torque 12; then nothing or the voltage of its supply and one byte
//!   more at most (`mini_cheetah`, whose firmware sends 7 bytes since July 2023), nothing or
//!   temperature + 40 °C and error (`t_motor`), temperatures of bridge and winding (`damiao`), or
//!   the winding's temperature × 10 in 16 bits (`robstride`). Faults of a RobStride: its id, 32
//!   bits, none of which is set without a fault.
//!
//! A set-point with position, velocity and gains all at their maximum could equal a special command
//! byte for byte: then the torque code FFA is sent, and to a RobStride, which reads more such
//! commands, a position one step lower. Around zero a range has no code for zero: the two codes
//! beside it are sent in turn. Beyond ± `position_range` the feedback wraps around: it is unwrapped
//! and reported as a fault, since set-points have no code there.

mod damiao;
mod robstride;

use super::codes::{Coded, Codes};
use super::keys::{RANGES, range};
use super::power_up::{Action, PowerUp, Stage};
use super::{Common, Key, Made, Protocol, Settings, fault};
use crate::drive::{
    Drive, DriveCommand, DriveState, Mode, Pairing, Parameter, Power, Receipt, Reply, Setpoint,
    Shared, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::state::state;
use damiao::Registers;
use robstride::Question;
use sarrus_models::Diagnostics;

/// MIT mode.
pub(super) const MIT: Protocol = Protocol {
    name: "mit",
    about: "MIT mode: mini cheetah, T-Motor AK, Damiao, RobStride",
    modes: &[Mode::Impedance, Mode::Torque],
    fd: false,
    keys: &[
        Key::word("variant", &Variant::NAMES, "whose MIT mode it is"),
        Key::integer("id", 1, 0x7FE, "identifier of the motor's commands"),
        Key::integer("reply_id", 0, 0x7FE, "identifier of the motor's replies"),
        range("position_range", "position at the end of the range [rad]"),
        range("velocity_range", "velocity at the end of the range [rad/s]"),
        range("torque_range", "torque at the end of the range [N m]"),
        range("stiffness_range", "largest stiffness [N m/rad]"),
        range("damping_range", "largest damping [N m s/rad]"),
    ],
    make,
};

const POWER_ON: u8 = 0xFC;
const POWER_OFF: u8 = 0xFD;
const ZERO: u8 = 0xFE;
const FORGET_FAULT: u8 = 0xFB;

sarrus_proto::named_enum! {
    /// Whose MIT mode a motor has.
    pub enum Variant {
        /// The mini cheetah.
        MiniCheetah = "mini_cheetah",
        /// T-Motor.
        TMotor = "t_motor",
        /// Damiao.
        Damiao = "damiao",
        /// RobStride.
        RobStride = "robstride",
    }
}

/// Replies after which a motor that does not report its state counts as having power: earlier ones
/// may answer older commands.
const REPLIES_TO_POWER: u8 = 4;

#[derive(Debug)]
struct Mit {
    variant: Variant,
    id: u16,
    reply_id: u16,
    coded: Coded,
    registers: Option<Registers>,
    /// Faults of a RobStride.
    question: Option<Question>,
    power_up: PowerUp,
    power: Power,
    motor_fault: u32,
}

fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let variant = Variant::ALL.into_iter().find(|of| of.name() == settings.text("variant"))?;
    let id = settings.integer("id") as u16;
    let reply_id = settings.integer("reply_id") as u16;
    if id == reply_id {
        let found = format!("`id` and `reply_id` are both {id}");
        let help = "set the motor's reply to another one";
        return settings.wrong(diagnostics, "reply_id", found, "two identifiers", help);
    }
    let ranges = RANGES.map(|key| settings.number(key));
    let [position, velocity, torque, ..] = ranges;
    Some(Box::new(Mit {
        variant,
        id,
        reply_id,
        coded: Coded::new(Codes::new(ranges, 12), common),
        registers: (variant == Variant::Damiao)
            .then(|| Registers::new(id, common.watchdog_ms, [position, velocity, torque])),
        question: (variant == Variant::RobStride).then(|| Question::new(id)),
        power_up: PowerUp::primed(),
        power: Power::Unknown,
        motor_fault: 0,
    }))
}

impl Mit {
    fn special(&self, command: u8) -> Option<Frame> {
        Frame::classic(Id::Standard(self.id), &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, command])
    }

    /// A set-point, special command or request for a register that was sent to this motor.
    fn is_command(&self, frame: &Frame) -> bool {
        let is_request = self.registers.is_some()
            && frame.id == Id::Standard(0x7FF)
            && frame.data().starts_with(&self.id.to_le_bytes());
        frame.id == Id::Standard(self.id) || is_request
    }

    /// Bits of the identifier that a reply has room for.
    fn id_mask(&self) -> u16 {
        if self.variant == Variant::Damiao { 0x0F } else { 0xFF }
    }

    fn ready(&self) -> bool {
        self.power != Power::Unknown
            && self.state().fault == 0
            && self.registers.is_none_or(|registers| registers.done())
    }

    /// Cycle `n` without power; settings to be written and read take every other one.
    fn idle(&self, n: u64) -> Option<Frame> {
        let registers = self.registers.filter(|_| n.is_multiple_of(2));
        registers.and_then(|registers| registers.request()).or_else(|| self.special(POWER_OFF))
    }

    fn follow(&mut self, setpoint: &Setpoint, out: &mut FrameQueue) {
        self.encode(setpoint, out);
        self.coded.alternate();
    }

    /// Takes the motor's own word of its state, where the reply has one.
    fn learn(&mut self, state: u8, error: u8) {
        match self.variant {
            Variant::Damiao => {
                self.motor_fault = if state > 1 { u32::from(state) } else { 0 };
                if self.power_up.report(state == 1) {
                    self.prepare();
                }
                self.power = if state == 1 { Power::On } else { Power::Off };
            }
            Variant::MiniCheetah | Variant::TMotor | Variant::RobStride => {
                self.motor_fault =
                    self.question.map_or(u32::from(error), |question| question.fault);
                self.power_up.count_reply(REPLIES_TO_POWER);
                let is_on = self.power_up.stage == Stage::On;
                self.power = if is_on { Power::On } else { Power::Off };
            }
        }
    }
}

impl Drive for Mit {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        // a motor with power is not assessed again
        let is_ready = self.power_up.stage != Stage::Off || self.ready();
        if let Some(question) = &mut self.question {
            out.push_some(question.ask(now_ns));
        }
        match self.power_up.action(command, is_ready) {
            Action::Idle(n) => out.push_some(self.idle(n)),
            Action::Reset => {
                self.prepare();
                if let Some(question) = &mut self.question {
                    question.forget();
                    self.motor_fault = 0;
                }
                if matches!(self.variant, Variant::Damiao | Variant::RobStride) {
                    out.push_some(self.special(FORGET_FAULT));
                }
                out.push_some(self.special(POWER_OFF));
            }
            // nothing but a torque of zero waits in the motor when it gets power
            Action::Prime(_) => self.follow(&Setpoint::default(), out),
            Action::Ask(_) | Action::Await(_) => out.push_some(self.special(POWER_ON)),
            Action::Follow(setpoint) => self.follow(&setpoint, out),
            Action::Withhold => out.push_some(self.special(POWER_OFF)),
        }
    }

    /// A set-point in its 8 bytes, never those of a special command.
    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        let [position, velocity, stiffness, damping, torque] = self.coded.setpoint(setpoint);
        let [p_high, p_low] = position.to_be_bytes();
        let [v_high, v_low] = (velocity << 4).to_be_bytes();
        let [k_high, k_low] = stiffness.to_be_bytes();
        let [d_high, d_low] = (damping << 4).to_be_bytes();
        let [t_high, t_low] = torque.to_be_bytes();
        let mut bytes =
            [p_high, p_low, v_high, v_low | k_high, k_low, d_high, d_low | t_high, t_low];
        match (&mut bytes, self.variant) {
            ([0xFF, low @ 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, ..], Variant::RobStride) => *low = 0xFE,
            ([0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last @ 0xFB..=0xFE], _) => *last = 0xFA,
            _ => {}
        }
        out.push_some(Frame::classic(Id::Standard(self.id), &bytes));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.special(POWER_OFF));
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        let bytes = frame.data();
        if self.is_command(frame) {
            return Receipt::Foreign;
        }
        if frame.id != Id::Standard(self.reply_id) {
            return Receipt::NotMine;
        }
        let first = bytes.first().copied().unwrap_or_default();
        if !bytes.is_empty() && (u16::from(first) ^ self.id) & self.id_mask() != 0 {
            return Receipt::NotMine;
        }
        let is_expected = match self.variant {
            Variant::MiniCheetah => matches!(bytes.len(), 6..=8),
            Variant::TMotor => matches!(bytes.len(), 6 | 8),
            Variant::Damiao | Variant::RobStride => bytes.len() == 8,
        };
        if !is_expected || frame.is_fd() {
            return Receipt::Malformed;
        }
        let short = bytes.len() < 8;
        let mut all = [0; 8];
        all.iter_mut().zip(bytes).for_each(|(byte, given)| *byte = *given);
        let bytes = all;
        if let Some(question) = &mut self.question
            && question.answers(bytes)
        {
            self.motor_fault = question.fault;
            return Receipt::Noted;
        }
        if let Some(receipt) =
            self.registers.as_mut().and_then(|registers| registers.receive(bytes))
        {
            return receipt;
        }
        let [state, p_high, p_low, v_high, v_low, t_low, g, h] = bytes;
        let (state, error, temperature) = match self.variant {
            Variant::MiniCheetah => (0, 0, f64::NAN),
            Variant::TMotor if short => (0, 0, f64::NAN),
            Variant::TMotor => (0, h, f64::from(g) - 40.0),
            Variant::Damiao => (state >> 4, 0, f64::from(g.max(h))),
            Variant::RobStride => (0, 0, f64::from(u16::from_be_bytes([g, h])) / 10.0),
        };
        self.learn(state, error);
        let position = u16::from_be_bytes([p_high, p_low]);
        let velocity = u16::from_be_bytes([v_high, v_low]) >> 4;
        let torque = u16::from_be_bytes([v_low & 0x0F, t_low]);
        self.coded.measure([position, velocity, torque], temperature)
    }

    fn state(&self) -> DriveState {
        let registers = self.registers.map_or(0, |registers| registers.fault);
        let faults = [self.motor_fault, registers, self.power_up.fault(), self.coded.fault()];
        let power = self.power_up.reported(self.power);
        let watchdog = self.registers.map_or(Watchdog::Unreadable, |registers| registers.watchdog);
        DriveState { power, fault: fault::first(faults), watchdog }
    }

    fn prepare(&mut self) {
        self.registers.iter_mut().for_each(Registers::forget);
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.power, self.motor_fault) = (Power::Unknown, 0);
        self.question.iter_mut().for_each(Question::forget);
        self.coded.forget();
        self.prepare();
    }

    fn identifiers(&self) -> Vec<Id> {
        vec![Id::Standard(self.id)]
    }

    fn shared_identifiers(&self) -> Vec<Shared> {
        let shared = |id, mask| Shared { id: Id::Standard(id), tag: self.id, mask };
        let reply = shared(self.reply_id, self.id_mask());
        if self.registers.is_some() { vec![reply, shared(0x7FF, 0xFFFF)] } else { vec![reply] }
    }

    fn steps(&self) -> Setpoint {
        self.coded.codes.steps()
    }

    fn largest_gains(&self) -> [f64; 2] {
        self.coded.codes.largest_gains()
    }

    fn pairing(&self) -> Pairing {
        Pairing::once(self.registers.is_none_or(|registers| registers.done()))
    }

    fn replies(&self) -> Vec<Reply> {
        let len = if self.variant == Variant::MiniCheetah { 7 } else { 8 };
        vec![Reply::classic(Id::Standard(self.reply_id), len)]
    }

    fn heartbeat(&self) -> Option<(Frame, u64)> {
        Some((self.question?.frame()?, robstride::PERIOD_NS))
    }

    /// Damiao motors are asked for a register; the others answer set-points and special commands
    /// only, of which power off is the one that cannot do harm.
    fn probe(&mut self, out: &mut FrameQueue) {
        match &self.registers {
            Some(registers) => out.push_some(registers.probe()),
            None => out.push_some(self.special(POWER_OFF)),
        }
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.special(ZERO));
        self.coded.set_zero();
        true
    }

    fn parameters(&self) -> &'static [Parameter] {
        if self.registers.is_some() { damiao::PARAMETERS } else { &[] }
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        out.push_some(self.registers.and_then(|registers| registers.read_parameter(parameter)));
    }

    fn ranges(&self) -> [f64; 3] {
        self.coded.codes.ranges()
    }

    fn save_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.registers.and_then(|registers| registers.save(self.id)));
        self.registers.is_some()
    }

    fn set_id(&mut self, id: u32, out: &mut FrameQueue) -> bool {
        let Some((registers, id)) = self.registers.zip(u16::try_from(id).ok()) else {
            return false;
        };
        if !(1..=0x7FE).contains(&id) || id == self.reply_id {
            return false;
        }
        out.push_some(registers.set_id(id));
        // whether it listens to its new identifier already, or after it has stored it
        out.push_some(registers.save(self.id));
        out.push_some(registers.save(id));
        true
    }
}

state!(Mit { coded, registers, question, power_up, power, motor_fault; variant, id, reply_id });
