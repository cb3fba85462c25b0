//! MIT mode: settings before power, and how power and faults are seen.

use crate::mit::{MOST, RANGES, enabled, mit};
use crate::support::{COMMON, cycle, drive, receive};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, fault};

#[test]
fn a_damiao_gets_its_watchdog_and_shows_its_ranges_before_it_gets_power() {
    let mut drive = mit("damiao", Common { watchdog_ms: 50, ..COMMON });
    assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFD"]);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(MOST)),
        ["7FF#0100550A01000000"],
        "no power before all is known"
    );
    receive(&mut *drive, "011#0100550A01000000");
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["001#FFFFFFFFFFFFFFFD"]);
    for _ in 0..3 {
        assert_eq!(
            cycle(&mut *drive, DriveCommand::Off),
            ["7FF#01005509E8030000"],
            "1000 times 50 µs, until it answers"
        );
        assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["001#FFFFFFFFFFFFFFFD"]);
    }
    receive(&mut *drive, "011#01005509E8030000");
    assert_eq!(drive.state().watchdog, Watchdog::Unknown, "what was written was not yet read");
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["7FF#0100330900000000"]);
    assert_eq!(receive(&mut *drive, "011#01003309E8030000"), Receipt::Parameter(0, 1000.0));
    assert_eq!(drive.state().watchdog, Watchdog::Set(50));
    assert_eq!(
        receive(&mut *drive, "011#01003309E8030000"),
        Receipt::Parameter(0, 1000.0),
        "a late answer is no measurement"
    );
    receive(&mut *drive, "011#0100330A01000000");
    receive(&mut *drive, "011#0100331500004841");
    receive(&mut *drive, "011#0100331600003442");
    assert_eq!(drive.state().fault, 0);
    receive(&mut *drive, "011#010033170000A041");
    assert_eq!(drive.state().fault, fault::RANGES_DIFFER, "20 N m are not 18");
    receive(&mut *drive, "011#0180007FF7FF1E1E");
    assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFD"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Reset)[0], "001#FFFFFFFFFFFFFFFB");
    drive.forget();
    assert_eq!((drive.state().fault, drive.state().watchdog), (0, Watchdog::Unknown));
}

#[test]
fn a_motor_that_lets_go_gets_no_power_again_by_itself() {
    let mut drive = enabled("damiao", COMMON);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)).len(), 1);
    receive(&mut *drive, "011#D180007FF7FF1E1E");
    assert_eq!((drive.state().power, drive.state().fault), (Power::Off, 0xD));
    for _ in 0..10 {
        assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFD"]);
        receive(&mut *drive, "011#0180007FF7FF1E1E");
        assert_eq!(drive.state().fault, fault::POWER_LOST);
    }
    cycle(&mut *drive, DriveCommand::Reset);
    assert_eq!(drive.state().fault, 0);
}

#[test]
fn only_motors_that_know_the_command_are_told_to_forget_faults() {
    for (variant, frames) in [("mini_cheetah", 1), ("t_motor", 1), ("robstride", 2)] {
        let mut drive = enabled(variant, COMMON);
        let sent = cycle(&mut *drive, DriveCommand::Reset);
        assert_eq!(sent.len(), frames, "{variant}");
        assert_eq!(sent.last().map(String::as_str), Some("001#FFFFFFFFFFFFFFFD"));
        assert_eq!(drive.state().watchdog, Watchdog::Unreadable);
    }
}

#[test]
fn motors_that_replies_cannot_tell_apart_are_told_apart_here() {
    let motor = |variant: &str, id: u16| {
        drive("mit", &format!("{{variant: {variant}, id: {id}, reply_id: 0, {RANGES}}}"), COMMON)
    };
    let collide = |a: &dyn Drive, b: &dyn Drive| {
        a.shared_identifiers()
            .iter()
            .any(|one| b.shared_identifiers().iter().any(|other| one.collides(other)))
    };
    assert!(collide(&*motor("damiao", 1), &*motor("damiao", 0x11)), "four bits");
    assert!(!collide(&*motor("damiao", 1), &*motor("damiao", 2)));
    assert!(!collide(&*motor("mini_cheetah", 1), &*motor("mini_cheetah", 0x11)), "eight bits");
    assert!(collide(&*motor("mini_cheetah", 1), &*motor("mini_cheetah", 0x101)));
    assert!(collide(&*motor("damiao", 1), &*motor("t_motor", 0x21)), "the fewer bits of the two");
}

#[test]
fn a_motor_that_was_outside_its_range_when_it_fell_silent_is_a_fault_until_it_has_a_new_zero() {
    let mut drive = enabled("mini_cheetah", Common { mode: Mode::Torque, ..COMMON });
    for code in ["C000", "FFF0", "0010"] {
        receive(&mut *drive, &format!("011#01{code}7FF7FF"));
    }
    assert_eq!(drive.state().fault, 0, "torques need no position");
    drive.forget();
    receive(&mut *drive, "011#0100107FF7FF");
    assert_eq!(drive.state().fault, fault::OUT_OF_RANGE, "it may be a whole range away");
    cycle(&mut *drive, DriveCommand::Reset);
    receive(&mut *drive, "011#0100107FF7FF");
    assert_eq!(drive.state().fault, fault::OUT_OF_RANGE, "a reset tells nothing of where it is");
    let mut frames = FrameQueue::new(4);
    assert!(drive.set_zero(&mut frames));
    receive(&mut *drive, "011#0180007FF7FF");
    assert_eq!(drive.state().fault, 0);
}

#[test]
fn a_damiao_gets_another_identifier_and_stores_by_the_frames_of_others() {
    let mut drive = mit("damiao", COMMON);
    let mut out = FrameQueue::new(8);
    assert!(drive.set_id(0x17, &mut out));
    let sent: Vec<String> = out.frames().iter().map(ToString::to_string).collect();
    // write_register(8, 0x17) and store_parameters() of PyPI's damiao-motor 1.0.6, the latter also
    // with the motor's new identifier; the register is written alike by pydamiao 0.1.4, whose frame
    // to store has 0 in byte 3
    assert_eq!(sent, ["7FF#0100550817000000", "7FF#0100AA0100000000", "7FF#1700AA0100000000"]);
}
