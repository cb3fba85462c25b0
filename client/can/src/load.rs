//! How busy a configuration makes its buses, by the longest that its frames can be.

use crate::bits;
use crate::config::Configuration;
use crate::drive::Setpoint;
use crate::frame::{Frame, FrameQueue};

/// Above this fraction of its time a bus is warned about.
pub const WARNED: f64 = 0.7;
/// Above this fraction of its time a bus is refused.
pub const REFUSED: f64 = 0.9;

/// How busy a bus is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Frames in one cycle, commands and replies.
    pub frames: usize,
    /// Time of one cycle's frames on the bus, with the most stuff bits that they can have `[s]`.
    pub busy: f64,
    /// The part of its time that the bus is busy.
    pub fraction: f64,
}

/// The load of each bus, in the order of the configuration.
pub fn loads(configuration: &Configuration) -> Vec<Load> {
    let mut loads = vec![Load::default(); configuration.buses.len()];
    let mut has_sync = vec![false; configuration.buses.len()];
    for motor in &configuration.motors {
        let (Some(bus), Some(load)) = (configuration.buses.get(motor.bus), loads.get_mut(motor.bus)) else { continue };
        let mut add = |frame: &Frame| {
            load.frames += 1;
            load.busy += bits::duration(frame.id, frame.kind, frame.data().len(), bus.bitrate, bus.data_bitrate);
        };
        let mut commands = FrameQueue::new(16);
        motor.drive.encode(&Setpoint::default(), &mut commands);
        commands.frames().iter().for_each(&mut add);
        if let (Some(sync), Some(false)) = (motor.drive.sync(), has_sync.get(motor.bus)) {
            add(&sync);
            has_sync.get_mut(motor.bus).into_iter().for_each(|has| *has = true);
        }
        for reply in motor.drive.replies() {
            load.frames += 1;
            load.busy += bits::duration(reply.id, reply.kind, reply.len, bus.bitrate, bus.data_bitrate);
        }
    }
    for load in &mut loads {
        load.fraction = load.busy * configuration.rate_hz;
    }
    loads
}
