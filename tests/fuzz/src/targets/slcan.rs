//! Lines of serial CAN adapters.

use sarrus_can_core::frame::Frame;
use sarrus_can_core::slcan::{Line, Lines, MAX_LINE, length, read, write};

use super::{Check, Target, corpus, law};

pub(super) const SLCAN: Target = Target {
    name: "slcan",
    seeds: corpus!("slcan/frames.txt", "slcan/host.txt", "slcan/adapter.txt"),
    tokens: &[
        "\r",
        "\u{7}",
        "\n",
        "t1230\r",
        "T1FFFFFFF8",
        "d1239",
        "b123F",
        "B000000008",
        "r1230\r",
        "R",
        "O\r",
        "L\r",
        "C\r",
        "S8\r",
        "Y5\r",
        "V1013\r",
        "N\r",
        "F00\r",
        "sa000000\r",
        "sb255255\r",
        "e1o\r",
        "z\r",
        "Z1\r",
        "M00000000\r",
        "7FF",
        "800",
        "20000000",
        "FFFF",
    ],
    start: || {
        let check: Check = Box::new(check);
        Ok(check)
    },
};

fn check(input: &[u8]) -> Result<u64, String> {
    let mut lines = Lines::default();
    let mut kinds = 0;
    for byte in input {
        let Some(line) = lines.take(*byte) else { continue };
        kinds |= 1 << kind_of(&line);
        if let Line::Frame(frame) = line {
            comes_back(&frame)?;
        }
    }

    // each line alone gives the result that it has in the stream
    for line in input.split(|byte| *byte == b'\r') {
        let is_plain = line.len() < MAX_LINE && !line.iter().any(|byte| b"\x07\n".contains(byte));
        if is_plain {
            let mut lines = Lines::default();
            let streamed = line.iter().chain(b"\r").filter_map(|byte| lines.take(*byte)).last();
            law(streamed == Some(read(line)), || format!("read as {streamed:?}: {line:?}"))?;
        }
    }

    // the reader recovers: the next line is read after any input
    lines.take(b'\r');
    lines.take(b'O');
    let open = lines.take(b'\r');
    law(open == Some(Line::Open), || format!("{open:?} instead of the next line"))?;
    Ok(kinds)
}

/// A frame that was read is written and read again, in both notations.
fn comes_back(frame: &Frame) -> Result<(), String> {
    let mut line = [0; MAX_LINE];
    let used = write(frame, &mut line);
    law(used == length(frame.id, frame.data().len()), || format!("{used} bytes of {frame}"))?;
    let text = line.get(..used - 1).unwrap_or_default();
    law(read(text) == Line::Frame(*frame), || format!("{frame} is not read as written"))?;
    let same = Frame::from_text(&frame.to_string());
    law(same == Some(*frame), || format!("{frame} is {same:?} in candump's notation"))
}

fn kind_of(line: &Line) -> u32 {
    match line {
        Line::Frame(frame) => u32::from(frame.is_fd()),
        Line::Remote => 2,
        Line::Open => 3,
        Line::ListenOnly => 4,
        Line::Close => 5,
        Line::Bitrate(_) => 6,
        Line::DataBitrate(_) => 7,
        Line::Version => 8,
        Line::SerialNumber => 9,
        Line::Status => 10,
        Line::Setting(_) => 11,
        Line::Done => 12,
        Line::Answer(_) => 13,
        Line::Refused => 14,
        Line::State(state) => 15 + *state as u32,
        Line::Errors { overrun } => 20 + u32::from(*overrun),
        Line::Garbled => 22,
    }
}
