//! A CiA 402 drive with a motor that loses frames, pauses and boots.

use crate::closed_loop::Bench;
use crate::support::torque;
use sarrus_can_core::drive::{DriveCommand, Mode, Power, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::fault;

fn bench() -> Bench {
    let mut bench =
        Bench::new("cia402", "{node: 5, rated_torque: 2.0, counts_per_turn: 65536}", Mode::Torque);
    (0..200).for_each(|_| bench.cycle(DriveCommand::Off));
    assert_eq!(
        (bench.drive.state().power, bench.drive.state().watchdog),
        (Power::Off, Watchdog::Set(50))
    );
    bench
}

#[test]
fn a_pause_of_the_bridge_is_made_good() {
    let mut bench = bench();
    bench.pass(&FrameQueue::new(1), 200);
    assert_eq!(bench.drive.state().fault, 0x8130);
    bench.measured = None;
    (0..20).for_each(|_| bench.cycle(DriveCommand::Off));
    assert_eq!(bench.measured, None, "the motor went back to pre-operational by itself");
    (0..500).for_each(|_| bench.cycle(DriveCommand::Off));
    assert!(bench.measured.is_some());
    bench.power_on(torque(0.1));
}

#[test]
fn a_start_that_was_lost_is_made_good() {
    let mut bench =
        Bench::new("cia402", "{node: 5, rated_torque: 2.0, counts_per_turn: 65536}", Mode::Torque);
    let mut is_lost = false;
    for cycle in 0..1000_u64 {
        let mut sent = FrameQueue::new(32);
        bench.drive.cycle(1_000_000_000 + cycle * 2_000_000, DriveCommand::Off, &mut sent);
        bench.drive.sync().into_iter().for_each(|sync| sent.push(sync));
        let mut passed = FrameQueue::new(32);
        for frame in sent.frames() {
            if frame.to_string() == "000#0105" && !is_lost {
                is_lost = true;
            } else {
                passed.push(*frame);
            }
        }
        bench.pass(&passed, 2);
    }
    assert!(is_lost);
    assert_eq!((bench.drive.state().power, bench.drive.state().fault), (Power::Off, 0));
    assert!(bench.measured.is_some());
}

#[test]
fn a_drive_that_boots_is_set_up_anew() {
    let mut bench = bench();
    bench.motor.reboot();
    bench.cycle(DriveCommand::Off);
    assert_eq!(
        (bench.drive.state().power, bench.drive.state().watchdog),
        (Power::Unknown, Watchdog::Unknown)
    );
    bench.power_on(torque(0.1));
    assert_eq!(
        (bench.motor.plant.watchdog_ns, bench.drive.state().watchdog),
        (50_000_000, Watchdog::Set(50))
    );
    bench.motor.reboot();
    (0..200).for_each(|_| bench.cycle(DriveCommand::On(torque(0.1))));
    assert!(bench.motor.follows().is_none(), "it has power again by itself");
    assert_eq!(bench.drive.state().fault, fault::POWER_LOST);
    bench.power_on(torque(0.1));
}
