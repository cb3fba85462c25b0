//! The bus load of a configuration, from the longest form of its frames.

use super::configuration::Configuration;
use crate::bit_stuffing;
use crate::drive::Setpoint;
use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use crate::slcan;

/// A load above this fraction causes a warning.
pub const WARNED: f64 = 0.7;
/// A load above this fraction is refused.
pub const REFUSED: f64 = 0.9;

/// The load of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Frames in one cycle, commands and replies.
    pub frames: usize,
    /// Bus time of one cycle's frames `[s]`, with the most stuff bits; rare frames count with their
    /// share per cycle.
    pub busy: f64,
    /// The part of its time that the bus is busy.
    pub fraction: f64,
    /// The part of its time that the serial port of an slcan adapter is busy, one way or the other;
    /// 0 without a port's speed behind the channel's `@`.
    pub serial: f64,
    /// Bytes of a cycle's lines on such a port, out and in.
    bytes: [usize; 2],
}

/// Bits of a byte on a serial port, with start and stop.
const BITS_OF_A_BYTE: f64 = 10.0;

/// The load of each bus, in the order of the configuration.
pub fn loads(configuration: &Configuration) -> Vec<Load> {
    let mut loads = vec![Load::default(); configuration.buses.len()];
    let mut has_sync = vec![false; configuration.buses.len()];
    for motor in &configuration.motors {
        let (Some(bus), Some(load)) =
            (configuration.buses.get(motor.bus), loads.get_mut(motor.bus))
        else {
            continue;
        };
        let duration = |id: Id, kind: FrameKind, len: usize| {
            bit_stuffing::duration(id, kind, len, bus.bitrate, bus.data_bitrate)
        };
        let duration_of = |frame: &Frame| duration(frame.id, frame.kind, frame.data().len());
        if let Some((frame, time_ns)) = motor.drive.heartbeat() {
            load.busy += duration_of(&frame) * configuration.period_ns() as f64
                / time_ns.max(configuration.period_ns()) as f64;
        }
        let mut add = |frame: &Frame| {
            load.frames += 1;
            load.busy += duration_of(frame);
            load.bytes[0] += slcan::length(frame.id, frame.data().len());
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
            load.bytes[1] += slcan::length(reply.id, reply.len);
            load.busy += duration(reply.id, reply.kind, reply.len);
        }
    }
    for (load, bus) in loads.iter_mut().zip(&configuration.buses) {
        load.fraction = load.busy * configuration.rate_hz;
        let speed = bus.channel.rsplit_once('@').and_then(|(_, speed)| speed.parse::<f64>().ok());
        if let (Some(speed), "slcan") = (speed, bus.interface.as_str()) {
            let [out, back] = load.bytes;
            load.serial = out.max(back) as f64 * BITS_OF_A_BYTE * configuration.rate_hz / speed;
        }
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Surroundings;

    #[test]
    fn a_serial_port_that_is_too_slow_for_its_bus_is_refused() {
        let read = |channel: &str| {
            let text = format!(
                "rate_hz: 250\nbuses: [{{name: a, interface: slcan, channel: \
                    '{channel}'}}]\nmotors: [{{actuator: elbow, bus: a, watchdog_ms: 50, \
                 limits: {{position: [-1, 1], velocity: 1, effort: 1}}, offset: 0, drive: \
                 {{protocol: cybergear, id: 1, \
                 position_range: 12.5}}}}]\n"
            );
            let surroundings =
                Surroundings { file: &|_| Err(String::new()), robot: &|_| panic!("no robot") };
            Configuration::read("motors.yml", text.into_bytes(), &surroundings)
        };
        // 27 characters of ten bits, 250 times in a second
        let load = super::loads(&read("/dev/ttyS0@115200").unwrap())[0];
        assert!((load.serial - 67_500.0 / 115_200.0).abs() < 1e-12);
        assert_eq!(super::loads(&read("/dev/ttyACM0").unwrap())[0].serial, 0.0);
        assert!(
            read("/dev/ttyS0@57600")
                .unwrap_err()
                .to_string()
                .contains("serial port of `a` is loaded to 117 %")
        );
    }

    #[test]
    fn heartbeats_count_with_their_part_of_a_cycle() {
        let loads = |watchdog_ms: u32| {
            let text = format!(
                "rate_hz: 500\nbuses: [{{name: a, channel: can0}}]\nmotors: [{{actuator: elbow, \
                    bus: a, watchdog_ms: {watchdog_ms}, \
                 limits: {{position: [-1, 1], velocity: 1, effort: 1}}, drive: {{protocol: \
                 cia402, node: 5, rated_torque: 1, \
                 counts_per_turn: 1000}}}}]\n"
            );
            let surroundings =
                Surroundings { file: &|_| Err(String::new()), robot: &|_| panic!("no robot") };
            let configuration =
                Configuration::read("motors.yml", text.into_bytes(), &surroundings).unwrap();
            super::loads(&configuration)[0].busy
        };
        let heartbeat = bit_stuffing::duration(
            crate::frame::Id::Standard(0x77F),
            crate::frame::FrameKind::Classic,
            1,
            1_000_000,
            None,
        );
        // one in 10 ms, that is in 5 cycles; and one in each cycle, which is the most that there
        // can be
        assert!((loads(80) - loads(10_000) - heartbeat / 5.0).abs() < heartbeat * 2e-3);
        assert!((loads(4) - loads(10_000) - heartbeat).abs() < heartbeat * 2e-3);
    }
}
