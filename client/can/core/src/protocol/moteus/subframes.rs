//! Sub-frames: building a frame's bytes, and the values of registers in their types.

use crate::frame::FD_LENGTHS;

/// Register of the board's temperature.
pub(super) const TEMPERATURE: u32 = 0x00E;

/// Bytes of one frame.
pub(super) struct Payload {
    bytes: [u8; 64],
    len: usize,
}

/// Registers that are written, and the first of each group that is read together: the mode, then
/// position, velocity and torque.
pub(super) const MODE: u32 = 0x000;
/// Then temperature, fault.
pub(super) const VOLTAGE: u32 = 0x00D;
/// The desired position; then velocity.
pub(super) const POSITION: u32 = 0x020;
/// The desired torque; then scales of stiffness and damping, largest torque.
pub(super) const TORQUE: u32 = 0x022;
/// Then limits of velocity and acceleration.
pub(super) const WATCHDOG: u32 = 0x027;
pub(super) const INTEGRATOR_SCALE: u32 = 0x02B;
/// Its value becomes the present position.
pub(super) const OUTPUT_EXACT: u32 = 0x131;

const READ: u8 = 0x10;
/// Types of values.
pub(super) const INT8: u8 = 0x00;
pub(super) const INT16: u8 = 0x04;
pub(super) const SINGLE: u8 = 0x0C;

impl Payload {
    /// Writes registers from `first` on, with the bytes of each value.
    pub(super) fn write<const N: usize>(self, kind: u8, first: u32, values: &[[u8; N]]) -> Payload {
        self.head(kind, first, values.len()).add(values.as_flattened())
    }

    /// Reads registers from `first` on.
    pub(super) fn read(self, kind: u8, first: u32, count: usize) -> Payload {
        self.head(READ | kind, first, count)
    }

    /// The head of a sub-frame: a count beyond three has a byte of its own, and a register at most
    /// two with seven bits in each.
    fn head(self, kind: u8, first: u32, count: usize) -> Payload {
        let count = count as u8;
        let payload = if count <= 3 { self.add(&[kind | count]) } else { self.add(&[kind, count]) };
        let [low, high] = [(first & 0x7F) as u8, (first >> 7) as u8];
        if high == 0 { payload.add(&[low]) } else { payload.add(&[low | 0x80, high]) }
    }

    fn add(mut self, bytes: &[u8]) -> Payload {
        if let Some(room) = self.bytes.get_mut(self.len..self.len + bytes.len()) {
            room.copy_from_slice(bytes);
            self.len += bytes.len();
        }
        self
    }

    /// The bytes up to a length that FD has.
    pub(super) fn padded(&self) -> &[u8] {
        let mut lengths = FD_LENGTHS.iter().map(|len| usize::from(*len));
        let len = lengths.find(|len| *len >= self.len).unwrap_or(64);
        self.bytes.get(..len).unwrap_or_default()
    }
}

/// A payload of nothing.
pub(super) const EMPTY: Payload = Payload { bytes: [0x50; 64], len: 0 };

/// Gives each register of an answer with its value; `None` for bytes that are no sub-frames.
pub(super) fn each_value(mut rest: &[u8], mut give: impl FnMut(u32, f64)) -> Option<()> {
    while let [kind, more @ ..] = rest {
        rest = more;
        match kind {
            0x50 => {}
            // the report of an error: its register and number
            0x30 | 0x31 => rest = varuint(varuint(rest)?.1)?.1,
            0x20..=0x2F => {
                let (count, more) = match u32::from(kind & 3) {
                    0 => varuint(rest)?,
                    count => (count, rest),
                };
                let (first, more) = varuint(more)?;
                rest = more;
                for i in 0..count {
                    let register = first.checked_add(i)?;
                    let (number, len) = value(kind >> 2 & 3, register, rest)?;
                    rest = rest.get(len..)?;
                    give(register, number);
                }
            }
            _ => return None,
        }
    }
    Some(())
}

/// The value of a register in the type of its sub-frame, in the register's unit; and how many bytes
/// it takes.
fn value(kind: u8, register: u32, bytes: &[u8]) -> Option<(f64, usize)> {
    let (whole, lowest, len) = match (kind, bytes) {
        (0, [a, ..]) => (i64::from(*a as i8), i64::from(i8::MIN), 1),
        (1, [a, b, ..]) => (i64::from(i16::from_le_bytes([*a, *b])), i64::from(i16::MIN), 2),
        (2, [a, b, c, d, ..]) => {
            (i64::from(i32::from_le_bytes([*a, *b, *c, *d])), i64::from(i32::MIN), 4)
        }
        (3, [a, b, c, d, ..]) => return Some((f64::from(f32::from_le_bytes([*a, *b, *c, *d])), 4)),
        _ => return None,
    };
    let units = match register {
        1 => [0.01, 1e-4, 1e-5],
        2 => [0.1, 2.5e-4, 1e-5],
        3 => [0.5, 0.01, 1e-3],
        0x00A | TEMPERATURE => [1.0, 0.1, 1e-3],
        0x00D => [0.5, 0.1, 1e-3],
        0x027 => [0.01, 1e-3, 1e-6],
        _ => [1.0; 3],
    };
    let unit = units.get(usize::from(kind)).copied()?;
    // mode and fault are numbers of something, without a value for nothing
    let has_nan = register != 0x000 && register != 0x00F;
    Some((if has_nan && whole == lowest { f64::NAN } else { whole as f64 * unit }, len))
}

/// A number of seven bits a byte, and the bytes after it.
fn varuint(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let mut number = 0_u64;
    for (i, byte) in bytes.iter().enumerate().take(5) {
        number |= u64::from(byte & 0x7F) << (7 * i);
        if byte & 0x80 == 0 {
            return Some((u32::try_from(number).ok()?, bytes.get(i + 1..)?));
        }
    }
    None
}
