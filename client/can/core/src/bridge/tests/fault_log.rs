//! The log of a fault gives the fault again.

use super::bench::{Bench, MS};
use super::*;
use crate::fault_log::FaultLog;
use crate::log::{Line, What};

/// Runs plain motors for some milliseconds after arming, and then through faults by `change`; gives
/// the bridge and the log of its last fault.
fn run(after: u64, change: impl Fn(&mut Bench)) -> (Bridge, Vec<Line>) {
    let mut bench = Bench::new(|_| {});
    let mut log = FaultLog::default();
    let mut lines = Vec::new();
    let mut faults = 0;
    for ms in 0..after + 200 {
        bench.now_ns += MS;
        bench.sequence += 1;
        let t = bench.now_ns;
        if ms == after {
            change(&mut bench);
        }
        let mut inputs = Vec::new();
        if ms == 100 {
            inputs.push(What::Operate(Operation::Arm, None));
        }
        if bench.commands {
            inputs.push(What::Command(Box::new(bench.command())));
        }
        inputs.push(What::Cycle);
        for what in inputs {
            let line = Line { t, what };
            line.apply(&mut bench.bridge);
            log.push(line);
        }
        if ms % 1000 == 999 {
            let mut room = bench.bridge.room();
            assert!(bench.bridge.save(&mut room));
            drop(log.state(t, room));
        }
        if bench.bridge.faults().0 != faults {
            faults = bench.bridge.faults().0;
            lines = log.lines().collect();
        }
        for (bus, frame) in bench.replies() {
            let line = Line { t: t + MS / 4, what: What::Frame(bus, frame) };
            line.apply(&mut bench.bridge);
            log.push(line);
        }
    }
    (bench.bridge, lines)
}

#[test]
fn what_led_to_a_fault_gives_the_same_fault_again() {
    for after in [500, 1900, 30_000] {
        for (change, reason) in [
            ((|bench: &mut Bench| bench.fault[2] = 4) as fn(&mut Bench), Reason::MotorFault),
            (|bench: &mut Bench| bench.answers[0] = false, Reason::FeedbackStale),
        ] {
            let (bridge, lines) = run(after, change);
            assert_eq!(bridge.faults().1.map(|(_, reason)| reason), Some(reason), "{after}");
            let mut again = Bench::new(|_| {}).bridge;
            let configuration = again.configuration().without_motors();
            for line in &lines {
                let text = line.text(&configuration);
                assert_eq!(again.faults().0, 0, "{text}");
                assert!(Line::read(&text, &configuration).unwrap().apply(&mut again));
            }
            assert_eq!(again.faults().1, bridge.faults().1, "{after}");
        }
    }
}

#[test]
fn a_state_of_another_configuration_is_refused_and_one_of_its_own_is_complete() {
    let mut bench = Bench::armed();
    bench.steps(150);
    let mut words = bench.bridge.room();
    let room = words.capacity();
    assert!(bench.bridge.save(&mut words));
    assert_eq!(words.capacity(), room, "nothing allocates");
    let mut other = Bench::new(|configuration| configuration.actuators[0] = "z".into());
    assert!(!other.bridge.restore(&words));
    let mut shorter = words.clone();
    shorter.pop();
    assert!(!Bench::new(|_| {}).bridge.restore(&shorter));
    assert!(!Bench::new(|_| {}).bridge.restore(&[]));
    let mut again = Bench::new(|_| {}).bridge;
    assert!(again.restore(&words));
    let mut same = again.room();
    assert!(again.save(&mut same));
    assert_eq!(same, words);
    // and no room is no state
    assert!(!again.save(&mut Vec::with_capacity(10)));
}
