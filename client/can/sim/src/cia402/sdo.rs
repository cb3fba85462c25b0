//! SDO from the server's side: expedited transfers, which hold every object of this drive.
//!
//! | first byte | meaning |
//! |---|---|
//! | 40 | read; the answer is 4F, 4B, 47, 43 for one to four bytes |
//! | 2F, 2B, 27, 23 (22: length not said) | write of one to four bytes; the answer is 60 |
//! | 80 | refused, with a code; also the host's own end of a transfer |

use super::objects::{Abort, Objects};
use crate::standard;
use sarrus_can_core::frame::{Frame, FrameQueue};

/// Abort code of an unknown command.
const UNKNOWN: Abort = 0x0504_0001;

pub(super) fn answer(objects: &mut Objects, id: u32, frame: &Frame, out: &mut FrameQueue) {
    let Some([what, low, high, sub, a, b, c, d]) = frame.exactly::<8>() else { return };
    let index = u16::from_le_bytes([low, high]);
    let said = u32::from_le_bytes([a, b, c, d]);
    let answer = match what {
        0x40 => objects
            .upload(index, sub)
            .map(|(value, bytes)| (0x43 | (4 - bytes as u8) << 2, cut(value, bytes))),
        0x23 | 0x27 | 0x2B | 0x2F => {
            let bytes = 4 - usize::from(what >> 2 & 3);
            objects.download(index, sub, cut(said, bytes), bytes).map(|()| (0x60, 0))
        }
        0x22 => objects
            .upload(index, sub)
            .and_then(|(_, bytes)| objects.download(index, sub, said, bytes))
            .map(|()| (0x60, 0)),
        0x80 => return,
        _ => Err(UNKNOWN),
    };
    let (first, value) = answer.unwrap_or_else(|abort| (0x80, abort));
    let [a, b, c, d] = value.to_le_bytes();
    out.push_some(standard(id, &[first, low, high, sub, a, b, c, d]));
}

/// The lower bytes of a value.
fn cut(value: u32, bytes: usize) -> u32 {
    (u64::from(value) & ((1 << (8 * bytes)) - 1)) as u32
}
