//! How long frames occupy a bus at worst.
//!
//! Source: ISO 11898-1. In the stuffed part of a frame a fifth equal bit is followed by one of the other value, so that a stuffed part
//! of n bits has at most ⌊(n − 1) / 4⌋ more. The check sum of an FD frame has fixed stuff bits instead.

use crate::frame::{FrameKind, Id};

/// What follows the check sum and is never stuffed: its delimiter, the acknowledgement and its delimiter, the end of frame.
const TAIL: usize = 3 + 7;
/// The pause between two frames.
const PAUSE: usize = 3;

/// The longest time that a frame of `len` data bytes can take, the pause after it included `[s]`; `bitrate` and `data_bitrate` in bit/s.
pub fn duration(id: Id, kind: FrameKind, len: usize, bitrate: u32, data_bitrate: Option<u32>) -> f64 {
    let [nominal, data] = bits(id, kind, len);
    let fast = match kind {
        FrameKind::Fd { bit_rate_switch: true } => data_bitrate.unwrap_or(bitrate),
        _ => bitrate,
    };
    nominal as f64 / f64::from(bitrate) + data as f64 / f64::from(fast)
}

/// Bits at the nominal bit rate, and those at the bit rate of the data.
fn bits(id: Id, kind: FrameKind, len: usize) -> [usize; 2] {
    let stuffed = |bits: usize| bits + (bits - 1) / 4;
    match kind {
        FrameKind::Classic => {
            // start, identifier and its marks, length, data, check sum
            let header = match id {
                Id::Standard(_) => 1 + 11 + 3 + 4,
                Id::Extended(_) => 1 + 29 + 5 + 4,
            };
            [stuffed(header + 8 * len + 15) + TAIL + PAUSE, 0]
        }
        FrameKind::Fd { .. } => {
            let header = match id {
                Id::Standard(_) => 1 + 11 + 5,
                Id::Extended(_) => 1 + 29 + 6,
            };
            // error state, length and data; then the count of stuff bits, the check sum, and a fixed stuff bit before each four of them
            let check = if len <= 16 { 4 + 17 + 6 } else { 4 + 21 + 7 };
            let dynamic = (header + 5 + 8 * len - 1) / 4 - (header - 1) / 4;
            [stuffed(header) + TAIL + PAUSE, 5 + 8 * len + dynamic + check]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEGABIT: u32 = 1_000_000;

    fn classic(id: Id, lens: [usize; 2]) -> f64 {
        lens.map(|len| duration(id, FrameKind::Classic, len, MEGABIT, None) * 1e6).iter().sum()
    }

    #[test]
    fn command_and_reply_take_what_the_standard_says() {
        let [standard, extended] = [Id::Standard(1), Id::Extended(1)];
        // a standard frame of 8 bytes has 108 bits and at most 24 stuff bits, an extended one 128 and 29; three of pause
        assert!((classic(standard, [8, 8]) - 270.0).abs() < 1e-9);
        assert!((classic(standard, [8, 6]) - 250.0).abs() < 1e-9);
        assert!((classic(extended, [8, 8]) - 320.0).abs() < 1e-9);
        // 20 bytes to an extended identifier and 24 back on a standard one
        let fd = FrameKind::Fd { bit_rate_switch: true };
        let moteus = duration(extended, fd, 20, MEGABIT, Some(5 * MEGABIT)) + duration(standard, fd, 24, MEGABIT, Some(5 * MEGABIT));
        assert!((moteus * 1e6 - 194.0).abs() < 0.5, "{moteus}");
    }
}
