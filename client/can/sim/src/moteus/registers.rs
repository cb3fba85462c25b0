//! Values of registers in their types, and the bytes of answers.

use sarrus_can_core::frame::{Frame, Id, MAX_DATA};

/// A type of values, and its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Int8,
    Int16,
    Int32,
    Float,
}

/// Units of one count in int8, int16 and int32.
pub(super) type Units = [f64; 3];
const TURNS: Units = [0.01, 0.0001, 0.00001];
const SPEEDS: Units = [0.1, 0.00025, 0.00001];
const ACCELERATIONS: Units = [0.05, 0.001, 0.00001];
const TORQUES: Units = [0.5, 0.01, 0.001];
const SCALES: Units = [1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2_147_483_647.0];
const TEMPERATURES: Units = [1.0, 0.1, 0.001];
const VOLTAGES: Units = [0.5, 0.1, 0.001];
const CURRENTS: Units = [1.0, 0.1, 0.001];
const TIMES: Units = [0.01, 0.001, 0.000001];
pub(super) const COUNTS: Units = [1.0; 3];

/// The units of a register.
pub(super) fn units(register: u32) -> Option<Units> {
    Some(match register {
        0x000 | 0x00B | 0x00C | 0x00F | 0x100 | 0x101 | 0x102 | 0x110 | 0x130 | 0x131 | 0x132 => {
            COUNTS
        }
        0x001 | 0x006 | 0x020 | 0x026 | 0x038 | 0x040 | 0x041 => TURNS,
        0x002 | 0x021 | 0x028 | 0x039 => SPEEDS,
        0x029 => ACCELERATIONS,
        0x003 | 0x022 | 0x025 | 0x030..=0x034 | 0x03A => TORQUES,
        0x004 | 0x005 => CURRENTS,
        0x023 | 0x024 | 0x02B => SCALES,
        0x027 => TIMES,
        0x00A | 0x00E => TEMPERATURES,
        0x00D => VOLTAGES,
        _ => return None,
    })
}

impl Kind {
    pub(super) fn of(bits: u8) -> Kind {
        match bits & 3 {
            0 => Kind::Int8,
            1 => Kind::Int16,
            2 => Kind::Int32,
            _ => Kind::Float,
        }
    }

    /// Bytes and unit of whole numbers.
    fn whole(self, units: Units) -> Option<(usize, f64)> {
        let [small, middle, large] = units;
        match self {
            Kind::Int8 => Some((1, small)),
            Kind::Int16 => Some((2, middle)),
            Kind::Int32 => Some((4, large)),
            Kind::Float => None,
        }
    }

    pub(super) fn take(self, rest: &mut &[u8], units: Units) -> Option<f64> {
        let Some((len, unit)) = self.whole(units) else {
            return Some(f64::from(f32::from_le_bytes(chunk(rest)?)));
        };
        let (head, tail) = rest.split_at_checked(len)?;
        *rest = tail;
        let number = head.iter().rev().fold(0_i64, |number, byte| number << 8 | i64::from(*byte));
        let unused = 64 - 8 * len;
        let number = number << unused >> unused;
        let least = -1 << (8 * len - 1);
        Some(if number == least { f64::NAN } else { number as f64 * unit })
    }

    pub(super) fn put(self, number: f64, units: Units, answer: &mut Answer) {
        let Some((len, unit)) = self.whole(units) else {
            return answer.put(&(number as f32).to_le_bytes());
        };
        let most = (1_i64 << (8 * len - 1)) - 1;
        let nearest = ((number / unit).round() as i64).clamp(-most, most);
        let whole = if number.is_nan() { -most - 1 } else { nearest };
        answer.put(whole.to_le_bytes().get(..len).unwrap_or_default());
    }
}

/// Bytes of an answer.
pub(super) struct Answer {
    pub(super) bytes: [u8; MAX_DATA],
    pub(super) used: usize,
}

impl Answer {
    pub(super) fn put(&mut self, bytes: &[u8]) {
        if let Some(place) = self.bytes.get_mut(self.used..self.used + bytes.len()) {
            place.copy_from_slice(bytes);
            self.used += bytes.len();
        }
    }

    pub(super) fn put_varuint(&mut self, mut number: u32) {
        while number > 0x7F {
            self.put(&[number as u8 | 0x80]);
            number >>= 7;
        }
        self.put(&[number as u8]);
    }

    /// Filled up to a length that FD has, with sub-frames of nothing.
    pub(super) fn frame(&mut self, id: Id) -> Option<Frame> {
        let length = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]
            .into_iter()
            .find(|&length| length >= self.used)?;
        let bytes = self.bytes.get_mut(..length)?;
        bytes.iter_mut().skip(self.used).for_each(|byte| *byte = 0x50);
        Frame::fd(id, true, bytes)
    }
}

pub(super) fn chunk<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk::<N>()?;
    *rest = tail;
    Some(*head)
}

pub(super) fn varuint(rest: &mut &[u8]) -> Option<u32> {
    let mut number = 0;
    for shift in [0, 7, 14, 21] {
        let [byte] = chunk(rest)?;
        number |= u32::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}
