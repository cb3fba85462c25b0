//! Drives from a few lines of YAML, frames from text.

use sarrus_can_core::drive::{Drive, Setpoint};
use sarrus_can_core::frame::{Frame, Id};
use sarrus_can_core::protocol::{Common, Settings, protocol};
use sarrus_models::{Diagnostics, yaml};

/// A drive of a protocol from the text of its settings, and the settings, of which its motor is
/// made; or the report of their faults.
pub(crate) fn settled(
    name: &str,
    yaml: &str,
    common: Common,
    file: &str,
) -> Result<(Box<dyn Drive>, Settings), String> {
    let protocol = protocol(name).expect("a protocol");
    let mut diagnostics = Diagnostics::new(false);
    let node = yaml::read("drive.yml", yaml.as_bytes().to_vec(), "a drive", &mut diagnostics)
        .expect("YAML");
    let settings = Settings::read(
        &node,
        "the drive",
        protocol.keys,
        &[],
        &|_| Ok(file.to_owned()),
        &mut diagnostics,
    );
    let drive = settings.and_then(|settings| {
        Some(((protocol.make)(&settings, common, &mut diagnostics)?, settings))
    });
    let report = diagnostics.into_report();
    drive.ok_or_else(|| report.to_string())
}

/// A frame from the text of `candump -L`.
pub(crate) fn frame(text: &str) -> Frame {
    let (id, data) = text.split_once('#').expect("#");
    let number = u32::from_str_radix(id, 16).expect("an identifier");
    let id = if id.len() == 8 { Id::extended(number) } else { Id::standard(number) }
        .expect("an identifier");
    let bytes = |text: &str| -> Vec<u8> {
        (0..text.len() / 2)
            .map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).expect("two digits"))
            .collect()
    };
    match data.strip_prefix('#') {
        Some(fd) => Frame::fd(id, &fd[..1] == "1", &bytes(&fd[1..])),
        None => Frame::classic(id, &bytes(data)),
    }
    .expect("a frame")
}

/// A set-point of torque alone.
pub(crate) fn torque(torque: f64) -> Setpoint {
    Setpoint { torque, ..Setpoint::default() }
}
