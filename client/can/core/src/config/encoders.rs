//! Encoders besides those of the motors: on joints of closed mechanisms, or on outputs of gears.

use sarrus_models::yaml::{Node, quoted};

use super::keys::ENCODER;
use super::motors::Robot;
use super::read::{Read, Reader};
use super::{BusConfig, MAX_ACTUATORS};
use crate::frame::Id;

/// An encoder that reports by itself: a signed number, least byte first, in frames of one
/// identifier.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderConfig {
    /// The joint that it measures.
    pub joint: String,
    /// Place of the bus.
    pub bus: usize,
    /// Identifier of its frames.
    pub id: Id,
    /// First byte and count of bytes of the number.
    pub bytes: [usize; 2],
    /// What one step is `[rad, m]`.
    pub scale: f64,
    /// Where the joint is when the number is 0 `[rad, m]`.
    pub offset: f64,
    /// By how much it may contradict the motors' encoders `[rad, m]`.
    pub margin: f64,
}

impl EncoderConfig {
    /// The joint's position that a frame tells; `None` for one that is too short `[rad, m]`.
    pub fn position(&self, data: &[u8]) -> Option<f64> {
        let [first, n] = self.bytes;
        let bytes = data.get(first..first + n)?;
        let number = bytes.iter().rev().fold(0_i64, |number, byte| number << 8 | i64::from(*byte));
        let unused = 64 - 8 * n as u32;
        Some((number << unused >> unused) as f64 * self.scale + self.offset)
    }
}

impl Reader<'_, '_> {
    /// The encoders of `encoders`, where there are some.
    pub(super) fn encoders(
        &mut self,
        root: &Node,
        buses: Option<&[BusConfig]>,
        robot: Option<&Robot>,
        motors: &[(String, Read)],
    ) -> Vec<EncoderConfig> {
        if root.get("encoders").is_none() {
            return Vec::new();
        }
        let mut encoders: Vec<EncoderConfig> = Vec::new();
        for node in self.list(root, "encoders", MAX_ACTUATORS) {
            let Some(read) = self.settings(node, "the encoder", ENCODER, &[]) else { continue };
            let joint = read.text("joint").to_owned();
            let joints = robot.map_or(&[][..], |robot| robot.loaded.compiled.model.tree_names());
            if !joints.contains(&joint) {
                let known = joints.iter().map(String::as_str);
                let help = self.diagnostics.did_you_mean(&joint, known, "correct the name");
                let found = format!("the robot has no joint {}", quoted(&joint));
                self.diagnostics.error(read.place("joint"), found, "a joint of `robot`", help);
                continue;
            }
            let bus =
                buses.and_then(|buses| buses.iter().position(|bus| bus.name == read.text("bus")));
            let Some(bus) = bus else {
                let found = format!("there is no bus {}", quoted(read.text("bus")));
                self.diagnostics.error(read.place("bus"), found, "a bus of `buses`", "correct it");
                continue;
            };
            let number = read.integer("id") as u32;
            let id = match u16::try_from(number) {
                Ok(number) if number < 0x800 => Id::Standard(number),
                _ => Id::Extended(number),
            };
            let of_motor = motors.iter().find(|(_, other)| {
                other.motor.bus == bus && other.motor.drive.identifiers().contains(&id)
            });
            if let Some((name, _)) = of_motor {
                let found = format!("the identifier 0x{number:X} is also that of {}", quoted(name));
                let help = "give one of them another id";
                self.diagnostics.error(read.place("id"), found, "one of its own on a bus", help);
            }
            let number = |key: &str| read.integer(key) as usize;
            encoders.push(EncoderConfig {
                joint,
                bus,
                id,
                bytes: [number("byte"), number("bits").div_ceil(8)],
                scale: read.number("scale"),
                offset: read.number("offset"),
                margin: read.number("margin"),
            });
        }
        encoders
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_signed_and_begin_with_the_least_byte() {
        let encoder = EncoderConfig {
            joint: String::new(),
            bus: 0,
            id: Id::Standard(1),
            bytes: [1, 3],
            scale: 0.5,
            offset: 10.0,
            margin: 1.0,
        };
        assert_eq!(encoder.position(&[9, 1, 1, 0]), Some(0.5 * 257.0 + 10.0));
        assert_eq!(encoder.position(&[9, 0xFE, 0xFF, 0xFF, 7]), Some(9.0));
        assert_eq!(encoder.position(&[9, 0xFE, 0xFF]), None);
    }
}
