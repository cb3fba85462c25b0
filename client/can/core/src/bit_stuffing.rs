//! The longest time that a frame occupies a bus.
//!
//! Source: ISO 11898-1:2015, frame formats and bit stuffing; the bound on stuff bits as in Davis,
//! Burns, Bril and Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted,
//! revisited and revised", 2007, equation 1: every fourth bit after the first five.

use crate::frame::{FrameKind, Id};

/// Bits that always follow the data and its checksum: delimiter, acknowledgement and its delimiter,
/// end of frame, space to the next frame.
const TAIL: usize = 1 + 1 + 1 + 7 + 3;

/// The longest time that a frame and the interframe space take, for any data `[s]`.
///
/// `bitrate` and `data_bitrate` in bit/s; an FD frame with bit rate switch sends its data at the
/// second, if there is one.
pub fn duration(
    id: Id,
    kind: FrameKind,
    len: usize,
    bitrate: u32,
    data_bitrate: Option<u32>,
) -> f64 {
    let (slow, fast) = bits(id, kind, len);
    let fast_rate = match kind {
        FrameKind::Fd { bit_rate_switch: true } => data_bitrate.unwrap_or(bitrate),
        _ => bitrate,
    };
    slow as f64 / f64::from(bitrate) + fast as f64 / f64::from(fast_rate)
}

/// Most bits at the first and at the second bit rate.
fn bits(id: Id, kind: FrameKind, len: usize) -> (usize, usize) {
    let data = 8 * len;
    match kind {
        FrameKind::Classic => {
            // start, identifier, control bits, checksum
            let head = match id {
                Id::Standard(_) => 1 + 11 + 3 + 4 + 15,
                Id::Extended(_) => 1 + 11 + 2 + 18 + 3 + 4 + 15,
            };
            (head + data + stuffed(head + data) + TAIL, 0)
        }
        FrameKind::Fd { .. } => {
            // up to the bit that switches the rate
            let head = match id {
                Id::Standard(_) => 1 + 11 + 5,
                Id::Extended(_) => 1 + 11 + 2 + 18 + 4,
            };
            // error state and length, then the data
            let rest = 1 + 4 + data;
            // count of stuff bits and checksum, with stuff bits at fixed places: before the first
            // and after each fourth bit
            let checksum = 4 + if len <= 16 { 17 } else { 21 };
            let fixed = 1 + checksum / 4;
            let early = stuffed(head);
            (head + early + TAIL, rest + stuffed(head + rest) - early + checksum + fixed)
        }
    }
}

/// Most stuff bits that `bits` bits can need.
fn stuffed(bits: usize) -> usize {
    (bits - 1) / 4
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTOR: Id = Id::Standard(1);
    const LONG: Id = Id::Extended(0x8001);
    const FD: FrameKind = FrameKind::Fd { bit_rate_switch: true };

    fn micros(id: Id, kind: FrameKind, len: usize) -> f64 {
        duration(id, kind, len, 1_000_000, Some(5_000_000)) * 1e6
    }

    #[test]
    fn commands_and_replies_take_the_times_of_the_table() {
        let mit = micros(MOTOR, FrameKind::Classic, 8) + micros(MOTOR, FrameKind::Classic, 6);
        let odrive = 2.0 * micros(MOTOR, FrameKind::Classic, 8);
        let cybergear = 2.0 * micros(LONG, FrameKind::Classic, 8);
        let moteus = micros(LONG, FD, 20) + micros(MOTOR, FD, 24);
        assert_eq!([mit, odrive, cybergear, moteus].map(f64::round), [250.0, 270.0, 320.0, 194.0]);
        // motors on a bus at 70 % and at 90 % of its time
        let motors =
            |time: f64, rate: f64| [0.7, 0.9].map(|part| (part * 1e6 / rate / time).floor());
        assert_eq!(
            [1000.0, 500.0, 250.0].map(|rate| motors(mit, rate)),
            [[2.0, 3.0], [5.0, 7.0], [11.0, 14.0]]
        );
        assert_eq!([1000.0, 500.0].map(|rate| motors(odrive, rate)), [[2.0, 3.0], [5.0, 6.0]]);
        assert_eq!([1000.0, 500.0].map(|rate| motors(cybergear, rate)), [[2.0, 2.0], [4.0, 5.0]]);
        assert_eq!([1000.0, 500.0].map(|rate| motors(moteus, rate)), [[3.0, 4.0], [7.0, 9.0]]);
    }

    #[test]
    fn classic_frames_have_the_bits_of_the_standard() {
        // without stuff bits 47 + 8 n and 67 + 8 n, space included
        for len in 0..=8 {
            let bits_of = |id| bits(id, FrameKind::Classic, len).0;
            assert_eq!(bits_of(MOTOR), 47 + 8 * len + (34 + 8 * len - 1) / 4);
            assert_eq!(bits_of(LONG), 67 + 8 * len + (54 + 8 * len - 1) / 4);
        }
    }

    #[test]
    fn without_its_switch_an_fd_frame_goes_at_one_rate() {
        let slow = FrameKind::Fd { bit_rate_switch: false };
        assert!(
            duration(MOTOR, slow, 64, 1_000_000, Some(5_000_000))
                > 2.0 * duration(MOTOR, FD, 64, 1_000_000, Some(5_000_000))
        );
        assert_eq!(duration(MOTOR, slow, 8, 500_000, None), duration(MOTOR, FD, 8, 500_000, None));
    }
}
