//! The last positions of motors, kept in a file from one start of a bridge to the next: a motor
//! that lost its zero meanwhile is recognised.
//!
//! A file belongs to the motors, by the channels of their buses and their identifiers, for any name
//! of the bridge: `NAME POSITION` in rad at the motor's own shaft, one line each. Motors behind
//! pseudo-terminals and virtual buses are simulated and begin anew: they have none.

use std::fmt::Write as _;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::{BusConfig, Configuration};

use crate::bus::is_pseudo_terminal;
use crate::stderr::say;

/// Time between two looks at the positions, and cycles between two notes of them.
const PAUSE: Duration = Duration::from_millis(500);
const CYCLES: u64 = 32;

/// Positions as the cycle notes them, by place in u; NaN where there is none.
#[derive(Clone, Debug)]
pub(crate) struct Noted(Arc<[AtomicU64]>);

impl Noted {
    /// Takes the positions of a bridge now and then.
    pub(crate) fn note(&self, bridge: &Bridge) {
        if bridge.counters().cycles.is_multiple_of(CYCLES) {
            for (actuator, position) in bridge.positions() {
                if let Some(slot) = self.0.get(actuator) {
                    slot.store(position.to_bits(), Relaxed);
                }
            }
        }
    }
}

/// The file of the positions of one set of motors.
#[derive(Debug)]
pub(crate) struct Positions {
    file: PathBuf,
    /// By place in u.
    names: Vec<String>,
    /// Where the cycle notes them.
    pub(crate) noted: Noted,
}

impl Positions {
    /// The file of a configuration's motors in a folder; `None` where all are simulated.
    pub(crate) fn new(folder: &Path, configuration: &Configuration) -> Option<Positions> {
        let real = |motor: &&sarrus_can_core::config::MotorConfig| {
            configuration.buses.get(motor.bus).is_some_and(|bus| !is_simulated(bus))
        };
        let motors: Vec<_> = configuration.motors.iter().filter(real).collect();
        if motors.is_empty() {
            return None;
        }
        let mut hasher = DefaultHasher::new();
        let mut names = vec![String::new(); configuration.actuators.len()];
        for motor in motors {
            let channel = configuration.buses.get(motor.bus).map(|bus| &bus.channel);
            let ids: Vec<u32> = motor.numbers().collect();
            (channel, motor.protocol.name, ids).hash(&mut hasher);
            let name = configuration.actuators.get(motor.actuator);
            if let (Some(slot), Some(name)) = (names.get_mut(motor.actuator), name) {
                name.clone_into(slot);
            }
        }
        let file = folder.join(format!("{:016x}", hasher.finish()));
        let nothing = f64::NAN.to_bits();
        let noted = names.iter().map(|_| AtomicU64::new(nothing)).collect();
        Some(Positions { file, names, noted: Noted(noted) })
    }

    /// Gives a bridge the positions of its last start. A file that is not there is none, and so is
    /// a line that is none.
    pub(crate) fn remember(&self, bridge: &mut Bridge) {
        for line in fs::read_to_string(&self.file).unwrap_or_default().lines() {
            let Some((name, number)) = line.rsplit_once(' ') else { continue };
            let place = self.names.iter().position(|known| known == name);
            if let (Some(place), Ok(position)) = (place, number.parse::<f64>())
                && position.is_finite()
            {
                bridge.remember(place, position);
            }
        }
    }

    /// Writes the file as long as the positions change, and once more at the end.
    pub(crate) fn run(self, is_over: &AtomicBool) {
        let mut written = String::new();
        let mut has_failed = false;
        loop {
            let is_last = is_over.load(Relaxed);
            let text = self.text();
            if text != written {
                if let Err(error) = write_whole(&self.file, &text)
                    && !has_failed
                {
                    has_failed = true;
                    say(format_args!("the positions of motors: {}: {error}", self.file.display()));
                }
                written = text;
            }
            if is_last {
                return;
            }
            thread::sleep(PAUSE);
        }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for (name, bits) in self.names.iter().zip(self.noted.0.iter()) {
            let position = f64::from_bits(bits.load(Relaxed));
            if !name.is_empty() && position.is_finite() {
                // writing to a string cannot fail
                let _ = writeln!(text, "{name} {position:.4}");
            }
        }
        text
    }
}

/// Writes a file that is whole at any time, and its folder where that is missing.
///
/// # Errors
/// The system's message; an older file is then as it was.
pub fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let new = path.with_extension("new");
    let mut file = fs::File::create(&new)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    fs::rename(&new, path)
}

/// Nothing real is on a virtual bus or behind a pseudo-terminal.
fn is_simulated(bus: &BusConfig) -> bool {
    bus.interface == "virtual" || is_pseudo_terminal(&bus.channel)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that fails panics")]

    use super::*;
    use sarrus_can_core::frame::{Frame, Id};

    fn configuration(folder: &Path, interface: &str) -> Configuration {
        let text = format!(
            "rate_hz: 250\nbuses: [{{name: a, interface: {interface}, channel: can0}}]\nmotors: \
             [{{actuator: the elbow, bus: a, gear: 2, watchdog_ms: 50, watchdog: believed, offset: \
             0.5, limits: {{position: [-3, 3], velocity: 5, effort: 2}}, drive: {{protocol: mit, \
             variant: mini_cheetah, id: 1, reply_id: 17, position_range: 12.5, velocity_range: 30, \
             torque_range: 10, stiffness_range: 500, damping_range: 5}}}}]\n"
        );
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join("motors.yml"), text).unwrap();
        Configuration::load(&folder.join("motors.yml")).unwrap()
    }

    /// The bridge after the motor reported a code of its position.
    fn heard(folder: &Path, position: [u8; 2]) -> Bridge {
        let configuration = configuration(folder, "socketcan");
        let positions = Positions::new(folder, &configuration).unwrap();
        let mut bridge = Bridge::new(configuration);
        positions.remember(&mut bridge);
        let [high, low] = position;
        let frame = Frame::classic(Id::Standard(17), &[1, high, low, 0x7F, 0xF7, 0xFF]).unwrap();
        for cycle in 1..=CYCLES {
            bridge.receive(cycle * 4_000_000, 0, &frame);
            bridge.cycle(cycle * 4_000_000 + 1);
        }
        positions.noted.note(&bridge);
        positions.run(&AtomicBool::new(true));
        bridge
    }

    #[test]
    fn a_motor_that_lost_its_zero_between_two_starts_is_recognised() {
        let folder = std::env::temp_dir().join(format!("sarrus-positions-{}", std::process::id()));
        let is_elsewhere = |bridge: &Bridge| {
            bridge.state().flags[0] & sarrus_client::actuators::flag::POSITION_CHANGED != 0
        };
        assert!(!is_elsewhere(&heard(&folder, [0x90, 0])));
        assert!(!is_elsewhere(&heard(&folder, [0x90, 8])));
        assert!(is_elsewhere(&heard(&folder, [0xA0, 0])));
        // as long as nobody confirms it
        assert!(is_elsewhere(&heard(&folder, [0xA0, 0])));
        assert!(!is_elsewhere(&heard(&folder, [0x90, 0])));
        assert!(Positions::new(&folder, &configuration(&folder, "virtual")).is_none());
        fs::remove_dir_all(&folder).unwrap();
    }
}
