//! Frames as text: slcan, the protocol of serial CAN adapters and pseudo-terminals.
//!
//! A line ends with carriage return. Host and adapter use the same lines for frames: `tIIILDD…`
//! standard, `TIIIIIIIILDD…` extended, `r` and `R` remote; with CAN FD `d`, `D` without and `b`,
//! `B` with bit rate switch, where the length is FD's code in one hexadecimal digit. The host opens
//! (`O`, `L` listen only) and closes (`C`) the channel, sets bit rates (`S0` to `S8`, `Y2`, `Y5`),
//! and asks for version, serial number and status (`V`, `N`, `F`). The adapter answers an accepted
//! line with carriage return, perhaps after `z` or `Z`, and a refused one with bell. An adapter
//! that watches its bus sends `sXRRRTTT`: state active, warning, passive or bus-off with its error
//! counters.
//!
//! Source: LAWICEL, *CANUSB manual* (2007), for the classic lines; the firmware of CANable 2.0 for
//! FD; the driver `slcan` of Linux for `s`.

use crate::event::{BusEvent, BusState};
use crate::frame::{FD_LENGTHS, Frame, FrameKind, Id};

/// Most bytes of a line with its end: an extended FD frame of 64 bytes.
pub const MAX_LINE: usize = 1 + 8 + 1 + 128 + 1;

/// Bit rates `[bit/s]` of the lines `S0` to `S8`.
pub const BITRATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 750_000, 1_000_000];

/// Data bit rates `[bit/s]` with the number after `Y`.
pub const DATA_BITRATES: [(u8, u32); 2] = [(2, 2_000_000), (5, 5_000_000)];

/// Content of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Line {
    /// A data frame.
    Frame(Frame),
    /// A remote frame; motors use none.
    Remote,
    /// Open the channel.
    Open,
    /// Open the channel without sending.
    ListenOnly,
    /// Close the channel.
    Close,
    /// Bit rate by its number.
    Bitrate(u8),
    /// Data bit rate by its number.
    DataBitrate(u8),
    /// Asks for the version.
    Version,
    /// Asks for the serial number.
    SerialNumber,
    /// Asks for the status.
    Status,
    /// Another setting of the channel, by its letter (`s` timing registers, `Z` time stamps, `M`
    /// and `m` filters, `A`, `P`, `X`, `Q`, `W`).
    Setting(u8),
    /// The adapter took a line.
    Done,
    /// The adapter answers a question, by its letter.
    Answer(u8),
    /// The adapter refused a line.
    Refused,
    /// The adapter's state.
    State(BusState),
    /// The adapter saw errors on the bus; whether a frame was lost because it came too fast.
    Errors {
        /// A received frame was lost.
        overrun: bool,
    },
    /// None of these.
    Garbled,
}

impl Line {
    /// Event of the bus in a line of the adapter; a refusal is a dropped frame, an unreadable line
    /// a lost one.
    pub fn event(&self) -> Option<BusEvent> {
        match self {
            Line::State(state) => Some(state.event()),
            Line::Refused => Some(BusEvent::Dropped(1)),
            Line::Errors { overrun: true } | Line::Garbled => Some(BusEvent::Overrun(1)),
            _ => None,
        }
    }
}

/// Bytes of a frame's line with its end.
pub fn length(id: Id, len: usize) -> usize {
    let digits = if matches!(id, Id::Extended(_)) { 8 } else { 3 };
    1 + digits + 1 + 2 * len + 1
}

/// Writes a frame as a line with its end; the bytes used.
pub fn write(frame: &Frame, line: &mut [u8; MAX_LINE]) -> usize {
    let extended = matches!(frame.id, Id::Extended(_));
    let letter = match (frame.kind, extended) {
        (FrameKind::Classic, false) => b't',
        (FrameKind::Classic, true) => b'T',
        (FrameKind::Fd { bit_rate_switch: false }, false) => b'd',
        (FrameKind::Fd { bit_rate_switch: false }, true) => b'D',
        (FrameKind::Fd { bit_rate_switch: true }, false) => b'b',
        (FrameKind::Fd { bit_rate_switch: true }, true) => b'B',
    };
    let digits = if extended { 8 } else { 3 };
    let code = FD_LENGTHS
        .iter()
        .position(|&length| usize::from(length) == frame.data().len())
        .unwrap_or(0);
    let id = (0..digits).rev().map(|place| digit((frame.id.number() >> (4 * place)) as u8 & 0xF));
    let data = frame.data().iter().flat_map(|byte| [digit(byte >> 4), digit(byte & 0xF)]);
    let bytes =
        core::iter::once(letter).chain(id).chain([digit(code as u8)]).chain(data).chain([b'\r']);
    line.iter_mut().zip(bytes).map(|(place, byte)| *place = byte).count()
}

/// Reads a line without its end; a lone bell is [`Line::Refused`].
pub fn read(line: &[u8]) -> Line {
    let Some((&letter, rest)) = line.split_first() else { return Line::Done };
    match (letter, rest) {
        (b't', _) => frame(rest, 3, FrameKind::Classic),
        (b'T' | b'x', _) => frame(rest, 8, FrameKind::Classic),
        (b'd', _) => frame(rest, 3, FrameKind::Fd { bit_rate_switch: false }),
        (b'D', _) => frame(rest, 8, FrameKind::Fd { bit_rate_switch: false }),
        (b'b', _) => frame(rest, 3, FrameKind::Fd { bit_rate_switch: true }),
        (b'B', _) => frame(rest, 8, FrameKind::Fd { bit_rate_switch: true }),
        (b'r' | b'R', _) => Line::Remote,
        (0x07, _) => Line::Refused,
        (b'z' | b'Z', []) => Line::Done,
        (b'O', []) => Line::Open,
        (b'L', []) => Line::ListenOnly,
        (b'C', []) => Line::Close,
        (b'V', []) => Line::Version,
        (b'N', []) => Line::SerialNumber,
        (b'F', []) => Line::Status,
        (b'V' | b'N' | b'F', _) => Line::Answer(letter),
        (b'S', [code @ b'0'..=b'9']) => Line::Bitrate(code - b'0'),
        (b'Y', [code @ b'0'..=b'9']) => Line::DataBitrate(code - b'0'),
        (b's', [state, counters @ ..])
            if counters.len() == 6 && counters.iter().all(u8::is_ascii_digit) =>
        {
            match state {
                b'a' => Line::State(BusState::Active),
                b'w' => Line::State(BusState::Warning),
                b'p' => Line::State(BusState::Passive),
                b'b' => Line::State(BusState::Off),
                _ => Line::Garbled,
            }
        }
        (b'e', [_, errors @ ..]) if !errors.is_empty() => {
            Line::Errors { overrun: errors.contains(&b'o') }
        }
        (b's' | b'Z' | b'M' | b'm' | b'A' | b'P' | b'X' | b'Q' | b'W', _) => Line::Setting(letter),
        _ => Line::Garbled,
    }
}

/// A frame after its letter; four more digits are a time stamp.
fn frame(rest: &[u8], digits: usize, kind: FrameKind) -> Line {
    let read = || {
        let (id, rest) = rest.split_at_checked(digits)?;
        let id = id.iter().try_fold(0u32, |id, &byte| Some(id << 4 | u32::from(value(byte)?)))?;
        let id = if digits == 3 { Id::standard(id)? } else { Id::extended(id)? };
        let (&code, rest) = rest.split_first()?;
        let length = usize::from(*FD_LENGTHS.get(usize::from(value(code)?))?);
        let (text, stamp) = rest.split_at_checked(2 * length)?;
        if !(stamp.is_empty() || stamp.len() == 4 && stamp.iter().all(u8::is_ascii_hexdigit)) {
            return None;
        }
        let mut data = [0; crate::frame::MAX_DATA];
        let data = data.get_mut(..length)?;
        for (byte, pair) in data.iter_mut().zip(text.chunks_exact(2)) {
            *byte = pair.iter().try_fold(0, |byte, &half| Some(byte << 4 | value(half)?))?;
        }
        match kind {
            FrameKind::Classic => Frame::classic(id, data),
            FrameKind::Fd { bit_rate_switch } => Frame::fd(id, bit_rate_switch, data),
        }
    };
    read().map_or(Line::Garbled, Line::Frame)
}

fn digit(half: u8) -> u8 {
    if half < 10 { b'0' + half } else { b'A' + half - 10 }
}

fn value(byte: u8) -> Option<u8> {
    (byte as char).to_digit(16).map(|half| half as u8)
}

/// Cuts bytes as they come into lines. Bytes that make no line within [`MAX_LINE`] and a time stamp
/// are one garbled line.
#[derive(Clone, Debug)]
pub struct Lines {
    line: [u8; MAX_LINE + 4],
    used: usize,
    overlong: bool,
}

impl Default for Lines {
    fn default() -> Lines {
        Lines { line: [0; MAX_LINE + 4], used: 0, overlong: false }
    }
}

impl Lines {
    /// Takes one byte; returns the content of a line that it ends.
    pub fn take(&mut self, byte: u8) -> Option<Line> {
        match byte {
            b'\r' => {
                let line = if self.overlong {
                    Line::Garbled
                } else {
                    read(self.line.get(..self.used).unwrap_or_default())
                };
                *self = Lines::default();
                Some(line)
            }
            0x07 => {
                *self = Lines::default();
                Some(Line::Refused)
            }
            b'\n' => None,
            _ => {
                match self.line.get_mut(self.used) {
                    Some(place) => *place = byte,
                    None => self.overlong = true,
                }
                self.used = (self.used + 1).min(MAX_LINE + 4);
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(frame: &Frame) -> String {
        let mut line = [0; MAX_LINE];
        let used = write(frame, &mut line);
        String::from_utf8(line[..used].to_vec()).unwrap()
    }

    #[test]
    fn frames_are_the_lines_of_the_manual() {
        let standard = Frame::classic(Id::Standard(0x100), &[0x11, 0x22]).unwrap();
        assert_eq!(text(&standard), "t10021122\r");
        let extended = Frame::classic(Id::Extended(0x0100_0003), &[]).unwrap();
        assert_eq!(text(&extended), "T010000030\r");
        let fast = Frame::fd(Id::Standard(0x7FF), true, &[0xAB; 12]).unwrap();
        assert_eq!(text(&fast), format!("b7FF9{}\r", "AB".repeat(12)));
        assert_eq!(
            text(&Frame::fd(Id::Extended(0x1FFF_FFFF), false, &[1; 64]).unwrap()).len(),
            MAX_LINE
        );
    }

    #[test]
    fn every_frame_comes_back() {
        let ids =
            [Id::Standard(0), Id::Standard(0x7FF), Id::Extended(0), Id::Extended(0x1FFF_FFFF)];
        let bytes: Vec<u8> = (0..64u8).map(|byte| byte.wrapping_mul(37)).collect();
        let mut lines = Lines::default();
        for id in ids {
            for length in FD_LENGTHS {
                let data = &bytes[..usize::from(length)];
                let frames = [
                    Frame::classic(id, data),
                    Frame::fd(id, false, data),
                    Frame::fd(id, true, data),
                ];
                for frame in frames.into_iter().flatten() {
                    assert_eq!(text(&frame).len(), super::length(id, data.len()));
                    let back: Vec<Line> =
                        text(&frame).bytes().filter_map(|byte| lines.take(byte)).collect();
                    assert_eq!(back, [Line::Frame(frame)]);
                }
            }
        }
    }

    #[test]
    fn time_stamps_and_lower_case_are_read() {
        let frame = Frame::classic(Id::Standard(0x1AB), &[0xCD]).unwrap();
        assert_eq!(read(b"t1ab1cd"), Line::Frame(frame));
        assert_eq!(read(b"t1AB1CD1234"), Line::Frame(frame));
    }

    #[test]
    fn states_and_answers_are_told_apart() {
        assert_eq!(read(b"sb255255"), Line::State(BusState::Off));
        assert_eq!(read(b"sa057033"), Line::State(BusState::Active));
        assert_eq!(read(b"s031C"), Line::Setting(b's'));
        assert_eq!(read(b"e2bo"), Line::Errors { overrun: true });
        assert_eq!(read(b"V1013"), Line::Answer(b'V'));
        assert_eq!(read(b"z"), Line::Done);
        assert_eq!(read(b""), Line::Done);
    }

    #[test]
    fn hostile_lines_are_garbled_and_the_next_line_is_read() {
        let hostile: [&[u8]; 9] = [
            b"t",
            b"t8001FF",
            b"t1002112",
            b"t100911",
            b"T2000000000",
            b"tGGG0",
            b"t1001\xFF\xFF",
            b"b100F00",
            b"t10021122333",
        ];
        let mut lines = Lines::default();
        for line in hostile {
            assert_eq!(line.iter().find_map(|&byte| lines.take(byte)), None);
            assert_eq!(lines.take(b'\r'), Some(Line::Garbled), "{}", String::from_utf8_lossy(line));
            assert_eq!(b"O\r".iter().find_map(|&byte| lines.take(byte)), Some(Line::Open));
        }
        assert!((0..100_000).all(|_| lines.take(b't').is_none()));
        assert_eq!(lines.take(b'\r'), Some(Line::Garbled));
        assert_eq!(b"O\r".iter().find_map(|&byte| lines.take(byte)), Some(Line::Open));
    }

    #[test]
    fn random_bytes_never_stop_the_reader() {
        let mut lines = Lines::default();
        let mut state = 0x2545_F491_4F6C_DD1D_u64;
        let alphabet = b"tTdDbBrRsSeYVNFOCLz0123456789ABCDEFabcdef\r\x07\n\xFF";
        for _ in 0..200_000 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let byte = alphabet[(state >> 33) as usize % alphabet.len()];
            if let Some(Line::Frame(frame)) = lines.take(byte) {
                let mut line = [0; MAX_LINE];
                let used = write(&frame, &mut line);
                assert_eq!(read(&line[..used - 1]), Line::Frame(frame));
            }
        }
    }
}
