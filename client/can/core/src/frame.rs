//! CAN frames, classic and FD, as plain values.

use crate::state::{State, Words};

/// Most data bytes of a frame.
pub const MAX_DATA: usize = 64;

/// Lengths of FD frames, by their codes.
pub(crate) const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// The identifier of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Id {
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

impl Id {
    /// A standard identifier; `None` beyond 11 bits.
    pub const fn standard(id: u32) -> Option<Id> {
        if id < 1 << 11 { Some(Id::Standard(id as u16)) } else { None }
    }

    /// An extended identifier; `None` beyond 29 bits.
    pub const fn extended(id: u32) -> Option<Id> {
        if id < 1 << 29 { Some(Id::Extended(id)) } else { None }
    }

    /// The number of either width.
    pub const fn number(self) -> u32 {
        match self {
            Id::Standard(id) => id as u32,
            Id::Extended(id) => id,
        }
    }
}

/// Kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// At most 8 bytes.
    Classic,
    /// CAN FD, at most 64 bytes.
    Fd {
        /// The data bytes go at the faster bit rate.
        bit_rate_switch: bool,
    },
}

/// One data frame.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// Identifier.
    pub id: Id,
    /// Classic or FD.
    pub kind: FrameKind,
    len: u8,
    data: [u8; MAX_DATA],
}

impl Frame {
    /// No content and the least identifier.
    pub(crate) const EMPTY: Frame =
        Frame { id: Id::Standard(0), kind: FrameKind::Classic, len: 0, data: [0; MAX_DATA] };

    /// A classic frame; `None` beyond 8 bytes.
    pub fn classic(id: Id, bytes: &[u8]) -> Option<Frame> {
        if bytes.len() <= 8 { Frame::of(id, FrameKind::Classic, bytes) } else { None }
    }

    /// An FD frame; `None` for a length that FD has not (0 to 8, 12, 16, 20, 24, 32, 48, 64).
    pub fn fd(id: Id, bit_rate_switch: bool, bytes: &[u8]) -> Option<Frame> {
        let good = matches!(bytes.len(), 0..=8 | 12 | 16 | 20 | 24 | 32 | 48 | 64);
        if good { Frame::of(id, FrameKind::Fd { bit_rate_switch }, bytes) } else { None }
    }

    fn of(id: Id, kind: FrameKind, bytes: &[u8]) -> Option<Frame> {
        let mut data = [0; MAX_DATA];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Frame { id, kind, len: bytes.len() as u8, data })
    }

    /// Reads the text that [`Frame`] displays, the notation of `candump -L`; `None` for any other.
    pub fn from_text(text: &str) -> Option<Frame> {
        let (id, rest) = text.split_once('#')?;
        // numbers here have no signs
        if text.contains(['+', '-']) {
            return None;
        }
        let number = u32::from_str_radix(id, 16).ok()?;
        let id = match id.len() {
            3 => Id::standard(number)?,
            8 => Id::extended(number)?,
            _ => return None,
        };
        let (flags, digits) = match rest.strip_prefix('#') {
            Some(rest) => (Some(rest.get(..1)?), rest.get(1..)?),
            None => (None, rest),
        };
        if !digits.len().is_multiple_of(2) || digits.len() > 2 * MAX_DATA {
            return None;
        }
        let mut bytes = [0; MAX_DATA];
        for (i, byte) in bytes.iter_mut().enumerate().take(digits.len() / 2) {
            *byte = u8::from_str_radix(digits.get(2 * i..2 * i + 2)?, 16).ok()?;
        }
        let bytes = bytes.get(..digits.len() / 2)?;
        match flags {
            None => Frame::classic(id, bytes),
            Some(flags) => Frame::fd(id, u8::from_str_radix(flags, 16).ok()? & 1 != 0, bytes),
        }
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or_default()
    }

    /// The data bytes, if there are exactly `N` of them.
    pub fn exactly<const N: usize>(&self) -> Option<[u8; N]> {
        self.data().try_into().ok()
    }

    /// Whether it is an FD frame.
    pub fn is_fd(&self) -> bool {
        self.kind != FrameKind::Classic
    }
}

impl core::fmt::Display for Frame {
    /// As `candump -L` writes it: `123#0011` for a classic frame, `123##10011` for FD; extended
    /// identifiers have eight digits.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.id {
            Id::Standard(id) => write!(f, "{id:03X}")?,
            Id::Extended(id) => write!(f, "{id:08X}")?,
        }
        match self.kind {
            FrameKind::Classic => f.write_str("#")?,
            FrameKind::Fd { bit_rate_switch } => write!(f, "##{}", u8::from(bit_rate_switch))?,
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl core::fmt::Debug for Frame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

/// A fixed number of frames that wait to be sent; nothing allocates after [`FrameQueue::new`].
#[derive(Clone, Debug)]
pub struct FrameQueue {
    frames: Vec<Frame>,
    capacity: usize,
}

impl FrameQueue {
    /// An empty queue with room for `capacity` frames.
    pub fn new(capacity: usize) -> FrameQueue {
        FrameQueue { frames: Vec::with_capacity(capacity), capacity }
    }

    /// Adds a frame; one that finds no room is dropped.
    pub fn push(&mut self, frame: Frame) {
        if self.frames.len() < self.capacity {
            self.frames.push(frame);
        }
    }

    /// Adds a frame that was made under a condition; `None` adds nothing.
    pub fn push_some(&mut self, frame: Option<Frame>) {
        frame.into_iter().for_each(|frame| self.push(frame));
    }

    /// The frames, oldest first.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Empties the queue.
    pub fn clear(&mut self) {
        self.frames.clear();
    }
}

impl State for FrameQueue {
    fn carry(&mut self, words: &mut Words<'_>) {
        let mut n = self.frames.len();
        n.carry(words);
        self.frames.resize(n.min(self.capacity), Frame::EMPTY);
        self.frames.carry(words);
    }
}

impl State for Frame {
    fn carry(&mut self, words: &mut Words<'_>) {
        let is_extended = matches!(self.id, Id::Extended(_));
        let is_switched = self.kind == FrameKind::Fd { bit_rate_switch: true };
        let mut head = [
            u64::from(self.id.number()),
            u64::from(is_extended) | u64::from(self.is_fd()) << 1 | u64::from(is_switched) << 2,
            self.data().len() as u64,
        ];
        head.carry(words);
        let [number, flags, len] = head;
        let mut bytes = [0; MAX_DATA];
        let len = (len as usize).min(bytes.len());
        bytes.iter_mut().zip(self.data()).for_each(|(byte, own)| *byte = *own);
        for chunk in bytes.chunks_exact_mut(8).take(len.div_ceil(8)) {
            let mut word = chunk.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
            word.carry(words);
            chunk.copy_from_slice(&word.to_le_bytes());
        }
        let number = number as u32;
        let id = if flags & 1 != 0 { Id::extended(number) } else { Id::standard(number) };
        let data = bytes.get(..len).unwrap_or_default();
        let frame = id.and_then(|id| match flags & 2 != 0 {
            true => Frame::fd(id, flags & 4 != 0, data),
            false => Frame::classic(id, data),
        });
        *self = frame.unwrap_or(*self);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_read_as_they_are_written() {
        for text in [
            "123#0011AAFF",
            "7FF#",
            "00000123#00",
            "1FFFFFFF##1000102030405060708090A0B",
            "001##0FF",
        ] {
            assert_eq!(
                Frame::from_text(text).map(|frame| frame.to_string()).as_deref(),
                Some(text)
            );
        }
        for text in [
            "",
            "#",
            "12#00",
            "800#00",
            "20000000#00",
            "123#0",
            "123#0g",
            "123#001122334455667788",
            "123##",
            "123##1000102030405060708090A",
            "123#R",
            "+12#00",
            "123#+f",
        ] {
            assert_eq!(Frame::from_text(text), None, "{text}");
        }
    }
}
