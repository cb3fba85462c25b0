//! Finds motors without a configuration, with a drive for every identifier of a protocol.
//!
//! A candidate is a drive made from its protocol, a variant and an identifier; its other settings
//! are placeholders, so it may probe for a motor but must not power it.

use core::fmt::Write;

use sarrus_models::Diagnostics;
use sarrus_models::yaml;

use crate::drive::{Drive, Mode, Receipt};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::{Common, Made, Protocol};
use crate::settings::{KeyKind, Settings};

/// The settings that hold a motor's identifier, and the one that holds that of its replies.
const IDENTIFIERS: [&str; 2] = ["id", "node"];
const REPLY: &str = "reply_id";
/// Greatest identifier to probe where a frame could be a command to a motor of another protocol.
const LAST_SHORT: i64 = 255;

/// A possible motor.
#[derive(Debug)]
pub struct Candidate {
    protocol: &'static Protocol,
    word: String,
    id: i64,
    drive: Box<dyn Drive>,
}

/// The words between which a protocol's frames differ, by the setting that has them: variants of
/// MIT mode, models of a CyberGear. Empty for a protocol without.
pub fn variants(protocol: &Protocol) -> &'static [&'static str] {
    let mut keys = protocol.keys.iter();
    match keys.find(|key| matches!(key.name, "variant" | "model")).map(|key| key.kind) {
        Some(KeyKind::Word(words)) => words,
        _ => &[],
    }
}

/// The least and greatest identifier that a protocol's motors may have; `None` for a protocol whose
/// motors cannot be asked.
pub fn identifiers(protocol: &'static Protocol, variant: &str) -> Option<(i64, i64)> {
    let key = protocol.keys.iter().find(|key| IDENTIFIERS.contains(&key.name))?;
    let KeyKind::Integer(least, most) = key.kind else { return None };
    let mut out = FrameQueue::new(32);
    Candidate::new(protocol, variant, least)?.probe(&mut out);
    let first = out.frames().first()?;
    // a question on the motor's own short identifier may be another device's frame
    let is_own = |id: Id| matches!(id, Id::Standard(number) if i64::from(number) == least);
    Some((least, if is_own(first.id) { most.min(LAST_SHORT) } else { most }))
}

impl Candidate {
    /// A motor of this identifier; `None` where the protocol makes no drive of it. Allocates.
    pub fn new(protocol: &'static Protocol, variant: &str, id: i64) -> Option<Candidate> {
        // an identifier for replies that is not the motor's own
        let drive = drive(protocol, variant, id, i64::from(id == 0))?;
        Some(Candidate { protocol, word: variant.to_owned(), id, drive })
    }

    /// Asks the motor for an answer; gives no power and changes nothing.
    pub fn probe(&mut self, out: &mut FrameQueue) {
        self.drive.probe(out);
    }

    /// Whether a frame is this motor's answer, on any identifier for replies.
    pub fn hears(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let receipt = self.drive.receive(now_ns, frame);
        if receipt != Receipt::NotMine || !self.protocol.keys.iter().any(|key| key.name == REPLY) {
            return receipt;
        }
        let Id::Standard(reply) = frame.id else { return receipt };
        match drive(self.protocol, &self.word, self.id, i64::from(reply)) {
            Some(mut drive) => drive.receive(now_ns, frame),
            None => receipt,
        }
    }
}

/// A drive whose settings are an identifier, and for the rest the least that is valid.
fn drive(protocol: &'static Protocol, variant: &str, id: i64, reply: i64) -> Made {
    let mut text = String::new();
    for key in protocol.keys {
        let value = match (key.name, key.kind, key.default) {
            (name, ..) if IDENTIFIERS.contains(&name) => id.to_string(),
            (REPLY, ..) => reply.to_string(),
            ("variant" | "model", ..) if !variant.is_empty() => variant.to_owned(),
            (_, _, Some(default)) if !default.is_empty() => continue,
            (_, KeyKind::Integer(least, _), None) => least.to_string(),
            // ranges that RobStride motors must be told have no default either
            (_, KeyKind::Number(least, most), _) => 10.0_f64.clamp(least, most).to_string(),
            (_, KeyKind::Word([first, ..]), None) => (*first).to_owned(),
            (_, _, None) => return None,
            _ => continue,
        };
        // writing to a string cannot fail
        let _ = writeln!(text, "{}: {value}", key.name);
    }
    let mut diagnostics = Diagnostics::new(false);
    let node = yaml::read("candidate", text.into_bytes(), "settings", &mut diagnostics)?;
    let no_file = |_: &str| Err(String::new());
    let settings =
        Settings::read(&node, "the drive", protocol.keys, &[], &no_file, &mut diagnostics)?;
    let mode = protocol.modes.first().copied().unwrap_or(Mode::Torque);
    let common =
        Common { mode, watchdog_ms: 0, torque_limit: 0.0, velocity_limit: 0.0, period_ns: 0 };
    (protocol.make)(&settings, common, &mut diagnostics)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{PROTOCOLS, protocol};

    #[test]
    fn every_identifier_of_every_protocol_that_can_be_asked_has_a_candidate() {
        let mut asked = Vec::new();
        for protocol in PROTOCOLS {
            let words = variants(protocol);
            let words = if words.is_empty() { &[""] } else { words };
            for word in words {
                let Some((least, most)) = identifiers(protocol, word) else { continue };
                asked.push(format!("{} {word} {least} {most}", protocol.name));
                for id in least..=most {
                    let mut out = FrameQueue::new(32);
                    let mut candidate = Candidate::new(protocol, word, id)
                        .unwrap_or_else(|| panic!("{} {word} {id}", protocol.name));
                    candidate.probe(&mut out);
                    assert!(!out.frames().is_empty());
                }
            }
        }
        for expected in ["mit damiao 1 2046", "mit mini_cheetah 1 255", "cybergear robstride 0 127"]
        {
            assert!(asked.iter().any(|known| known == expected), "{asked:?}");
        }
        assert!(!asked.iter().any(|known| known.starts_with("dbc")), "{asked:?}");
    }

    #[test]
    fn an_answer_is_known_on_whatever_identifier_it_comes() {
        let mit = protocol("mit").unwrap();
        let answer = |id: u8, reply: u16| {
            Frame::classic(Id::Standard(reply), &[id, 0x80, 0, 0x80, 8, 0, 30, 30]).unwrap()
        };
        let mut candidate = Candidate::new(mit, "robstride", 9).unwrap();
        assert!(matches!(candidate.hears(0, &answer(9, 0x2A)), Receipt::Measured(_)));
        assert_eq!(candidate.hears(0, &answer(8, 0x2A)), Receipt::NotMine);
    }
}
