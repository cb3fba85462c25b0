//! The state of a bridge at one time, for logs that begin there.

use super::Bridge;
use crate::config::Configuration;
use crate::state::{State, Words, state};

/// Factor of the room for frames on their way and numbers that are absent yet.
const ROOM: usize = 2;

impl Bridge {
    /// Room for [`Bridge::save`]. Allocates.
    pub fn room(&mut self) -> Vec<u64> {
        let mut room = Vec::with_capacity(1024);
        while !self.save(&mut room) {
            room = Vec::with_capacity(2 * room.capacity());
        }
        Vec::with_capacity(ROOM * room.capacity())
    }

    /// Writes all that later cycles depend on, between two inputs; false where there is no room.
    /// Counts are left out. Never allocates.
    pub fn save(&mut self, into: &mut Vec<u64>) -> bool {
        let mut words = Words::write(into);
        words.word(&mut of(&self.configuration));
        self.carry(&mut words);
        words.are_complete()
    }

    /// Goes on from a state that a bridge of the same configuration and version wrote; false for
    /// any other, after which this one is of no use.
    pub fn restore(&mut self, from: &[u64]) -> bool {
        let mut words = Words::read(from);
        let mut mark = 0;
        words.word(&mut mark);
        if mark != of(&self.configuration) {
            return false;
        }
        self.carry(&mut words);
        words.are_complete()
    }
}

/// A mark of this version and the names of a configuration (FNV-1a).
fn of(configuration: &Configuration) -> u64 {
    let names = configuration.actuators.iter().map(String::as_str);
    let bytes = names.chain([env!("CARGO_PKG_VERSION")]).flat_map(str::bytes);
    bytes.fold(configuration.period_ns() ^ 0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

state!(Bridge {
    motors, mechanisms, model, buses, command, armed_at, disarmed_at, disarmed, commanded, reset_ns,
    last_cycle_ns, uneven_ns;
    configuration, state, counters, faults, last_fault
});
