//! Checksums, times and deadlines in heads, through both transports.

use std::time::{Duration, Instant};

use sarrus_client::{
    ConnectOptions, Options, QueryOptions, Robot, Source, Status, Transport, Warnings,
};
use sarrus_proto::PROTOCOL_VERSION;
use sarrus_proto::checksum::of_request;
use sarrus_proto::message::{RequestHead, ResponseHead, store_numbers};

use sarrus_torture::patience::LIMIT;

use crate::support::{Asker, ROBOT, STATE, Sandbox, options, published};

const BOTH: QueryOptions = QueryOptions::CHECKSUM.with(QueryOptions::TIMES);

fn local() -> Robot {
    Robot::load(&Source::Bundled(ROBOT.into()), &Options::default()).unwrap()
}

#[test]
fn checksums_and_times_change_no_bit_and_times_are_within_the_round_trip() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("heads", &[]);
    let mut plain = Asker::new(local());
    let [lane, service] =
        [Transport::Lane, Transport::Service].map(|way| sandbox.connect("heads", way).unwrap());
    for (robot, is_here) in [(local(), true), (lane, false), (service, false)] {
        let mut asker = Asker::new(robot);
        let without = asker.plan;
        asker.plan = asker.robot.prepare(&STATE.with_options(BOTH)).unwrap();
        assert_ne!(asker.plan, without, "another query is another plan");
        for k in 0..200 {
            for asker in [&mut plain, &mut asker] {
                let numbers = asker.input.iter_mut().enumerate();
                numbers.for_each(|(i, x)| *x = 1e-3 * ((k * 29 + i * 13) % 103) as f64);
            }
            assert_eq!(plain.ask().unwrap().status, Status::Ok);
            assert_eq!(plain.robot.times(), None);
            let start = Instant::now();
            assert_eq!(asker.ask().unwrap().status, Status::Ok);
            let round_trip = start.elapsed().as_nanos() as u64;
            assert_eq!(asker.bits(), plain.bits());

            let times = asker.robot.times().unwrap();
            let age = u64::from(times.age_ns);
            let took = u64::from(times.took_ns);
            // the processor's counter runs like the clock to a thousandth
            assert!(took > 0 && age + took <= round_trip + round_trip / 1000, "{times:?}");
            assert!(!is_here || age == 0, "{times:?}");
        }
        // a query without the option has no times
        assert_eq!(asker.robot.ask(without, &asker.input, &mut asker.output).unwrap().ok(), {
            Ok(Warnings::NONE)
        });
        assert_eq!((asker.robot.times(), asker.robot.late()), (None, 0));
    }
}

#[test]
fn checked_and_timed_requests_allocate_nothing_through_a_lane() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("spare", &["--wait", "busy"]);
    let deadline = Some(LIMIT);
    let robot = sandbox.connect_with("spare", ConnectOptions { deadline, ..options() }).unwrap();
    for robot in [local(), robot] {
        let mut asker = Asker::new(robot);
        asker.plan = asker.robot.prepare(&STATE.with_options(BOTH)).unwrap();
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
        assert_eq!(asker.thousand(), (1000, 0, 0));
        if let Some(robot) = Some(&asker.robot).filter(|robot| robot.statistics().is_some()) {
            let statistics = published(robot, |statistics| statistics.answered(Status::Ok) >= 1001);
            assert_eq!(statistics.system_allocations, 0, "{statistics:?}");
            assert_eq!(statistics.answered(Status::Ok), 1001, "{statistics:?}");
        }
    }
}

#[test]
fn late_answers_are_counted_on_both_sides_and_have_no_numbers() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("late", &[]);
    let mut late = 0;
    for transport in [Transport::Lane, Transport::Service] {
        for (deadline, is_late) in [(Duration::from_nanos(1), true), (Duration::MAX, false)] {
            let deadline = Some(deadline);
            let options = ConnectOptions { transport, deadline, ..options() };
            let mut asker = Asker::new(sandbox.connect_with("late", options).unwrap());
            for _ in 0..50 {
                let expected = if is_late { Status::Late } else { Status::Ok };
                assert_eq!(asker.ask().unwrap().status, expected);
                assert_eq!(asker.robot.times(), None);
            }
            assert_eq!(asker.robot.late(), if is_late { 50 } else { 0 });
            late += asker.robot.late();
            let statistics = published(&asker.robot, |statistics| statistics.counts.late >= late);
            assert_eq!(statistics.counts.late, late);
        }
    }
}

#[test]
fn a_request_that_was_changed_is_answered_corrupt_answer() {
    let sandbox = Sandbox::new();
    let _server = sandbox.serve("changed", &[]);
    let honest = Asker::new(sandbox.connect("changed", Transport::Lane).unwrap());
    let numbers = &honest.input;
    let n_out = honest.output.len();

    // the plan that needs a checksum beside the one that does not: both take and give the same
    let mut holder = sandbox.connect("changed", Transport::Service).unwrap();
    let _plan = holder.prepare(&STATE.with_options(QueryOptions::CHECKSUM)).unwrap();
    let liar = sandbox.raw("changed");
    let [checked, plain] = [QueryOptions::CHECKSUM, QueryOptions::NONE]
        .map(|options| liar.plan(&STATE.with_options(options)).unwrap().0);
    assert_ne!(checked, plain);
    let (_node, mut lane) = liar.take_lane([numbers.len(), n_out]).unwrap();

    let mut sequence = 0;
    let mut ask = |head: &RequestHead, numbers: &[f64]| -> (ResponseHead, Vec<f64>) {
        assert!(store_numbers(lane.outbox.numbers(), numbers));
        lane.outbox.publish(*head);
        let start = Instant::now();
        loop {
            if let Some((answer, numbers)) = lane.inbox.poll() {
                return (answer, numbers[..n_out].to_vec());
            }
            assert!(start.elapsed() < LIMIT, "no answer to {head:?}");
        }
    };
    let mut sealed = |plan| {
        sequence += 1;
        let fingerprint = honest.robot.model().fingerprint;
        let version = PROTOCOL_VERSION;
        let head = RequestHead { version, plan, fingerprint, sequence, ..RequestHead::default() };
        RequestHead { checksum: of_request(&head, numbers), ..head }
    };

    // as it was sent
    let right = sealed(checked);
    let (answer, output) = ask(&right, numbers);
    assert_eq!(answer.status, Status::Ok as u32);
    assert!(answer.is_intact(&right, &output));

    // a number, the head, no checksum
    let mut changed = numbers.clone();
    changed[3] = -changed[3];
    let flipped = {
        let head = sealed(checked);
        RequestHead { deadline_ns: 1 << 40, ..head }
    };
    let bare = RequestHead { checksum: 0, ..sealed(checked) };
    for (head, numbers) in [(sealed(checked), &changed), (flipped, numbers), (bare, numbers)] {
        let (answer, output) = ask(&head, numbers);
        assert_eq!(answer.status, Status::CorruptAnswer as u32, "{head:?}");
        assert!(output.iter().all(|number| number.is_nan()), "{head:?}");
    }

    // the number of a plan without checksums: answered, and the client does not take it
    let meant = sealed(checked);
    let (answer, output) = ask(&RequestHead { plan: plain, ..meant }, numbers);
    assert_eq!((answer.status, answer.checksum), (Status::Ok as u32, 0));
    assert!(!answer.is_intact(&meant, &output));
}
