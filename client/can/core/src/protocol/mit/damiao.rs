//! Registers of Damiao motors: read, written and compared while the motor has no power.
//!
//! Source: DM-J4310-2EC manual V1.1 and the register table of the debugging tool. Requests go to
//! 7FF as [id low, id high, 33 read | 55 write | AA store, register, 4 bytes little-endian]; the
//! motor answers with the same 8 bytes on its reply identifier.

use crate::drive::{Parameter, Receipt, Watchdog};
use crate::frame::{Frame, Id};
use crate::protocol::fault;
use crate::state::state;

const READ: u8 = 0x33;
const WRITE: u8 = 0x55;
const SAVE: u8 = 0xAA;
const ESC_ID: u8 = 8;
const TIMEOUT: u8 = 9;
const CONTROL_MODE: u8 = 10;
const PMAX: u8 = 21;
const VMAX: u8 = 22;
const TMAX: u8 = 23;
/// Control mode 1 is MIT.
const MIT: u32 = 1;
/// Units of TIMEOUT in a millisecond: one is 50 µs.
const TIMEOUT_PER_MS: u32 = 20;
/// Relative deviation allowed between a range and the configured one.
const SAME_RANGE: f64 = 1e-4;
/// Number of registers.
const LAST: u8 = 81;

pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter::whole(TIMEOUT as u32, "TIMEOUT", "50 µs"),
    Parameter::whole(CONTROL_MODE as u32, "CTRL_MODE", ""),
    Parameter::single(PMAX as u32, "PMAX", "rad"),
    Parameter::single(VMAX as u32, "VMAX", "rad/s"),
    Parameter::single(TMAX as u32, "TMAX", "N m"),
    Parameter::whole(7, "MST_ID", ""),
    Parameter::whole(8, "ESC_ID", ""),
    Parameter::whole(14, "sw_ver", ""),
    Parameter::single(20, "Gr", ""),
    Parameter::single(0, "UV_Value", "V"),
];

/// Registers that are written and read before the motor gets power, in this order.
const STEPS: [(u8, u8); 7] = [
    (WRITE, CONTROL_MODE),
    (WRITE, TIMEOUT),
    (READ, TIMEOUT),
    (READ, CONTROL_MODE),
    (READ, PMAX),
    (READ, VMAX),
    (READ, TMAX),
];

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Registers {
    id: u16,
    watchdog_ms: u32,
    ranges: [f64; 3],
    /// Place in [`STEPS`].
    next: usize,
    pub(super) watchdog: Watchdog,
    /// The fault, or 0.
    pub(super) fault: u32,
}

impl Registers {
    /// For a motor with ranges of ± `ranges` of position, velocity and torque in the configuration.
    pub(super) fn new(id: u16, watchdog_ms: u32, ranges: [f64; 3]) -> Registers {
        Registers { id, watchdog_ms, ranges, next: 0, watchdog: Watchdog::Unknown, fault: 0 }
    }

    /// Begins again.
    pub(super) fn forget(&mut self) {
        *self = Registers::new(self.id, self.watchdog_ms, self.ranges);
    }

    /// Whether all is set and read.
    pub(super) fn done(&self) -> bool {
        self.next == STEPS.len()
    }

    /// The request of this step; repeated until it is answered.
    pub(super) fn request(&self) -> Option<Frame> {
        let (what, register) = *STEPS.get(self.next)?;
        let value = match (what, register) {
            (WRITE, CONTROL_MODE) => MIT,
            (WRITE, TIMEOUT) => self.watchdog_ms.saturating_mul(TIMEOUT_PER_MS),
            _ => 0,
        };
        self.frame(what, register, value.to_le_bytes())
    }

    /// A request that changes nothing.
    pub(super) fn probe(&self) -> Option<Frame> {
        self.read(CONTROL_MODE)
    }

    /// Asks for a parameter by its place.
    pub(super) fn read_parameter(&self, parameter: usize) -> Option<Frame> {
        self.read(PARAMETERS.get(parameter)?.address as u8)
    }

    /// Writes another identifier.
    pub(super) fn set_id(&self, id: u16) -> Option<Frame> {
        self.frame(WRITE, ESC_ID, u32::from(id).to_le_bytes())
    }

    /// Asks the motor of this identifier to store its registers and its zero.
    pub(super) fn save(&self, id: u16) -> Option<Frame> {
        Registers { id, ..*self }.frame(SAVE, 1, [0; 4])
    }

    fn read(&self, register: u8) -> Option<Frame> {
        self.frame(READ, register, [0; 4])
    }

    fn frame(&self, what: u8, register: u8, value: [u8; 4]) -> Option<Frame> {
        let [low, high] = self.id.to_le_bytes();
        let [a, b, c, d] = value;
        Frame::classic(Id::Standard(0x7FF), &[low, high, what, register, a, b, c, d])
    }

    /// Takes the motor's answer; `None` when the bytes are none.
    ///
    /// An answer looks like the feedback of a motor without power that stands at the lower end of
    /// its range. There every request's answer, also a late one, must be taken for an answer: as
    /// feedback it would be a jump.
    pub(super) fn receive(&mut self, bytes: [u8; 8]) -> Option<Receipt> {
        let [low, high, what, register, a, b, c, d] = bytes;
        let mine = [low, high] == self.id.to_le_bytes()
            && matches!(what, READ | WRITE | SAVE)
            && register <= LAST;
        if !mine {
            return None;
        }
        let number = u32::from_le_bytes([a, b, c, d]);
        let real = f64::from(f32::from_le_bytes([a, b, c, d]));
        if STEPS.get(self.next) == Some(&(what, register)) {
            if what == READ {
                self.assess(register, number, real);
            }
            // a watchdog of 0 is left alone
            let is_skipped = self.next == 0 && self.watchdog_ms == 0;
            self.next += if is_skipped { 2 } else { 1 };
        }
        Some(match what {
            READ => Parameter::receipt(PARAMETERS, u32::from(register), number, 32),
            _ => Receipt::Noted,
        })
    }

    /// Compares a register that was read.
    fn assess(&mut self, register: u8, number: u32, real: f64) {
        let [position, velocity, torque] = self.ranges;
        let is_same = |configured: f64| (real - configured).abs() <= SAME_RANGE * configured;
        let fault = match register {
            TIMEOUT => {
                self.watchdog = Watchdog::of_counts(number, TIMEOUT_PER_MS);
                0
            }
            CONTROL_MODE => fault::when(number != MIT, fault::MODE_REFUSED),
            PMAX => fault::when(!is_same(position), fault::RANGES_DIFFER),
            VMAX => fault::when(!is_same(velocity), fault::RANGES_DIFFER),
            _ => fault::when(!is_same(torque), fault::RANGES_DIFFER),
        };
        // the last one counts
        self.fault = if fault == 0 { self.fault } else { fault };
    }
}

state!(Registers { next, watchdog, fault; id, watchdog_ms, ranges });
