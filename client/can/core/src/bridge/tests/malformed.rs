//! Motors that answer, and say something else than their protocol does.

use sarrus_proto::actuators::Reason;

use super::bench::{Bench, MS};
use crate::frame::{Frame, Id};
use crate::protocol::fault;

#[test]
fn a_motor_that_answers_something_else_is_told_from_a_silent_one() {
    let mut bench = Bench::armed();
    bench.answers[2] = false;
    for _ in 0..25 {
        bench.step();
        let answer = Frame::classic(Id::Standard(18), &[1, 2]).unwrap();
        bench.bridge.receive(bench.now_ns + MS / 4, 1, &answer);
    }
    assert_eq!(bench.reason(2), Reason::FeedbackStale);
    assert_eq!(bench.bridge.state().faults[..3], [0, 0, fault::MALFORMED]);
    // and no more once it answers
    bench.answers[2] = true;
    bench.steps(2);
    assert_eq!(bench.bridge.state().faults[2], 0);
}
