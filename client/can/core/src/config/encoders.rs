//! Encoders in addition to those of the motors: on joints of closed mechanisms or gear outputs.

use sarrus_models::yaml::{Node, quoted};
use sarrus_proto::actuators::MAX_ACTUATORS;

use super::configuration::BusConfig;
use super::keys::ENCODER;
use super::reader::{Read, Reader, Robot};
use super::values::EncoderConfig;
use crate::frame::Id;

impl Reader<'_, '_> {
    /// The encoders of the list `encoders`, if there is one.
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
            let Some(bus) = buses.and_then(|buses| self.bus(&read, buses)) else { continue };
            let number = read.integer("id") as u32;
            let id = Id::standard(number).unwrap_or(Id::Extended(number));
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
