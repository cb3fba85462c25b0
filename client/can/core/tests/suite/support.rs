//! Drives from a few lines of YAML, random numbers with a fixed seed, shared checks.

use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Receipt, Setpoint};
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings, protocol};
use sarrus_models::{Diagnostics, yaml};

/// No limit, no watchdog.
pub(crate) const COMMON: Common = Common {
    mode: Mode::Impedance,
    watchdog_ms: 0,
    torque_limit: f64::INFINITY,
    velocity_limit: f64::INFINITY,
    period_ns: 0,
};

/// A drive of a protocol from the text of its settings, or the report of their faults.
pub(crate) fn try_drive(
    name: &str,
    yaml: &str,
    common: Common,
    file: &str,
) -> Result<Box<dyn Drive>, String> {
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
    let drive = settings.and_then(|settings| (protocol.make)(&settings, common, &mut diagnostics));
    let report = diagnostics.into_report();
    drive.ok_or_else(|| report.to_string())
}

/// A drive of a protocol.
pub(crate) fn drive(name: &str, yaml: &str, common: Common) -> Box<dyn Drive> {
    try_drive(name, yaml, common, "").unwrap_or_else(|report| panic!("{report}"))
}

/// The frames of one cycle, as `candump -L` writes them.
pub(crate) fn cycle(drive: &mut dyn Drive, command: DriveCommand) -> Vec<String> {
    let mut queue = FrameQueue::new(32);
    drive.cycle(0, command, &mut queue);
    assert!(queue.frames().len() < 32, "all have room");
    queue.frames().iter().map(Frame::to_string).collect()
}

/// The data of the last frame of one cycle.
pub(crate) fn last(drive: &mut dyn Drive, command: DriveCommand) -> Frame {
    let mut queue = FrameQueue::new(32);
    drive.cycle(0, command, &mut queue);
    *queue.frames().last().expect("a frame")
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

/// Gives a frame to a drive.
pub(crate) fn receive(drive: &mut dyn Drive, text: &str) -> Receipt {
    drive.receive(0, &frame(text))
}

/// A set-point of torque alone.
pub(crate) fn torque(torque: f64) -> Setpoint {
    Setpoint { torque, ..Setpoint::default() }
}

/// Whether `sent` is `value` or the next number of `step`s on the side of zero; beside zero, where
/// a range has no code for it, half a step.
pub(crate) fn is_toward_zero(sent: f64, value: f64, step: f64) -> bool {
    let slack = 1e-5 * step;
    (sent - value).abs() <= step + slack
        && (sent.abs() <= value.abs() + slack || sent.abs() <= 0.5 * step + slack)
}

/// Numbers from a fixed seed (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Between two numbers.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (self.bits() >> 11) as f64 / (1_u64 << 53) as f64 * (high - low)
    }

    /// A hostile frame: any length, any bytes, an identifier of `ids` or any other.
    pub(crate) fn frame(&mut self, ids: &[Id]) -> Frame {
        let mut bytes = [0_u8; 64];
        bytes.iter_mut().for_each(|byte| {
            *byte = [0, 0xFF, 0x7F, 0x80, self.bits() as u8][(self.bits() % 5) as usize]
        });
        let id = match self.bits() % 4 {
            0 => Id::Standard(self.bits() as u16 & 0x7FF),
            1 => Id::Extended(self.bits() as u32 & 0x1FFF_FFFF),
            _ => ids[self.bits() as usize % ids.len()],
        };
        let lens = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
        let len = lens[(self.bits() % 16) as usize];
        match len <= 8 && self.bits().is_multiple_of(2) {
            true => Frame::classic(id, &bytes[..len]),
            false => Frame::fd(id, true, &bytes[..len]),
        }
        .expect("a frame")
    }
}

/// Throws hostile frames at a drive between its cycles: it may believe none of them into numbers
/// that are not finite, and never sends more than the queue holds.
pub(crate) fn survives_hostile_frames(drive: &mut dyn Drive, seed: u64) {
    let mut random = Random(seed);
    let ids: Vec<Id> = drive
        .identifiers()
        .into_iter()
        .chain(drive.shared_identifiers().iter().map(|shared| shared.id))
        .collect();
    for round in 0..20_000 {
        let receipt = drive.receive(round, &random.frame(&ids));
        if let Receipt::Measured(measured) = receipt {
            for value in [measured.position, measured.velocity, measured.torque] {
                assert!(!value.is_infinite(), "{receipt:?}");
            }
        }
        let command = match random.bits() % 4 {
            0 => DriveCommand::Off,
            1 => DriveCommand::Reset,
            _ => DriveCommand::On(Setpoint {
                position: 1e300,
                velocity: -1e300,
                torque: 1e300,
                stiffness: 1e300,
                damping: f64::MAX,
            }),
        };
        let mut queue = FrameQueue::new(16);
        drive.cycle(round, command, &mut queue);
        assert!((1..16).contains(&queue.frames().len()), "all have room");
        if random.bits().is_multiple_of(1000) {
            drive.forget();
        }
    }
}
