//! Heads of requests and answers: checksum, stamp and deadline of a request; checksum and times of
//! its answer.

use std::time::Duration;

use sarrus_proto::checksum::of_request;
use sarrus_proto::message::{RequestHead, ResponseHead};
use sarrus_proto::{PROTOCOL_VERSION, Query, QueryOptions, Status, Warnings};

use crate::Answer;
use crate::bridge::now_ns;

/// The times in the head of an answer; see [`crate::Robot::times`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Times {
    /// Age of the request when the server took it `[ns]`; saturates at 4.3 s.
    pub age_ns: u32,
    /// From then to the publication of the answer `[ns]`; saturates likewise.
    pub took_ns: u32,
}

impl Times {
    /// Start of a request in process, if its times are wanted `[ns]`.
    #[inline]
    pub(crate) fn stamp(query: &Query) -> Option<u64> {
        query.options.contains(QueryOptions::TIMES).then(now_ns)
    }

    /// The times of a request in process that began at `stamp`.
    pub(crate) fn in_process(stamp: u64) -> Times {
        let took = now_ns().saturating_sub(stamp);
        Times { age_ns: 0, took_ns: u32::try_from(took).unwrap_or(u32::MAX) }
    }
}

/// Times of a robot's last answer, and counts over all its answers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) times: Option<Times>,
    pub(crate) late: u64,
}

/// The options of one request's heads, constant through all attempts to send it.
pub(crate) struct Terms {
    checked: bool,
    timed: bool,
    /// Without the numbers of the request.
    head: RequestHead,
}

impl Terms {
    /// Reads the clock if times or a deadline need it.
    #[inline]
    pub(crate) fn of(query: &Query, deadline: Option<Duration>) -> Terms {
        let timed = query.options.contains(QueryOptions::TIMES);
        let stamp_ns = if timed || deadline.is_some() { now_ns().max(1) } else { 0 };
        // 0 would mean no stamp
        let ns = |span: Duration| u64::try_from(span.as_nanos()).unwrap_or(u64::MAX).max(1);
        let deadline_ns = deadline.map_or(0, ns);
        let version = PROTOCOL_VERSION;
        let head = RequestHead { version, stamp_ns, deadline_ns, ..RequestHead::default() };
        Terms { checked: query.options.contains(QueryOptions::CHECKSUM), timed, head }
    }

    /// The head of a request with these numbers.
    #[inline]
    pub(crate) fn head(
        &self,
        plan: u32,
        fingerprint: u64,
        sequence: u64,
        input: &[f64],
    ) -> RequestHead {
        let mut head = RequestHead { plan, fingerprint, sequence, ..self.head };
        if self.checked {
            head.checksum = of_request(&head, input);
        }
        head
    }

    /// Reads the head of an answer; an answer whose checksum fails is `corrupt_answer`, and its
    /// numbers are NaN. A late one is counted.
    #[inline]
    pub(crate) fn read(
        &self,
        request: &RequestHead,
        answer: &ResponseHead,
        output: &mut [f64],
        seen: &mut Seen,
    ) -> Answer {
        let RequestHead { stamp_ns, deadline_ns, .. } = self.head;
        if deadline_ns != 0 && now_ns().saturating_sub(stamp_ns) > deadline_ns {
            seen.late += 1;
        }
        if self.checked && !answer.is_intact(request, output) {
            output.fill(f64::NAN);
            // a refusal has no numbers
            let refused = answer.status != Status::Ok as u32 && answer.is_intact(request, &[]);
            if !refused {
                return Answer { status: Status::CorruptAnswer, warnings: Warnings::NONE };
            }
        }
        let status = Status::of_answer(answer.status);
        if status == Status::UnknownStatus {
            // numbers without a known meaning
            output.fill(f64::NAN);
        }
        if self.timed {
            seen.times = Some(Times { age_ns: answer.age_ns, took_ns: answer.took_ns });
        }
        Answer { status, warnings: Warnings(answer.warnings) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FieldSet, Request};

    const INPUT: [f64; 3] = [0.1, -0.2, 0.3];
    const OUTPUT: [f64; 2] = [4.0, 5.0];

    fn terms(options: QueryOptions) -> Terms {
        let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::EMPTY);
        Terms::of(&query.with_options(options), None)
    }

    fn read(terms: &Terms, request: &RequestHead, answer: &ResponseHead) -> (Answer, [f64; 2]) {
        let mut output = OUTPUT;
        (terms.read(request, answer, &mut output, &mut Seen::default()), output)
    }

    #[test]
    fn an_answer_that_was_changed_is_corrupt_and_has_no_numbers() {
        let terms = terms(QueryOptions::CHECKSUM);
        let request = terms.head(3, 42, 7, &INPUT);
        assert_ne!(request.checksum, 0);
        let ok = ResponseHead::new(Status::Ok, Warnings::ILL_CONDITIONED, 7);
        let right = ok.checked(&request, &OUTPUT);
        let (answer, output) = read(&terms, &request, &right);
        assert_eq!((answer.status, answer.warnings), (Status::Ok, Warnings::ILL_CONDITIONED));
        assert_eq!(output, OUTPUT);

        let other_plan = terms.head(4, 42, 7, &INPUT);
        let corrupt = [
            // without a checksum, of nothing, of other numbers, of another request
            ok,
            ok.checked(&request, &[]),
            ok.checked(&request, &[4.0, -5.0]),
            ok.checked(&other_plan, &OUTPUT),
            // changed afterwards
            ResponseHead { checksum: right.checksum ^ 1, ..right },
            ResponseHead { status: Status::Unreachable as u32, ..right },
            ResponseHead { warnings: 0, ..right },
            ResponseHead { sequence: 8, ..right },
            ResponseHead { took_ns: 1, ..right },
            ResponseHead { sequence: 8, ..ok }.checked(&request, &OUTPUT),
        ];
        for answer in corrupt {
            let (ended, output) = read(&terms, &request, &answer);
            assert_eq!(ended.status, Status::CorruptAnswer, "{answer:?}");
            assert!(output.iter().all(|number| number.is_nan()), "{answer:?}");
        }
    }

    #[test]
    fn a_refusal_keeps_its_status_and_has_no_numbers() {
        let terms = terms(QueryOptions::CHECKSUM);
        let request = terms.head(3, 42, 7, &INPUT);
        let refused = ResponseHead::new(Status::ShuttingDown, Warnings::NONE, 7);
        let (answer, output) = read(&terms, &request, &refused.checked(&request, &[]));
        assert_eq!(answer.status, Status::ShuttingDown);
        assert!(output.iter().all(|number| number.is_nan()));
        assert_eq!(read(&terms, &request, &refused).0.status, Status::CorruptAnswer);
    }

    #[test]
    fn a_head_carries_what_the_query_asks_and_nothing_else() {
        let plain = terms(QueryOptions::NONE).head(3, 42, 7, &INPUT);
        let bare = RequestHead {
            version: PROTOCOL_VERSION,
            plan: 3,
            fingerprint: 42,
            sequence: 7,
            ..RequestHead::default()
        };
        assert_eq!(plain, bare);
        let timed = terms(QueryOptions::TIMES).head(3, 42, 7, &INPUT);
        assert!(timed.stamp_ns > 0);
        assert_eq!(RequestHead { stamp_ns: 0, ..timed }, bare);
    }

    #[test]
    fn late_answers_are_counted() {
        let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::EMPTY);
        let mut seen = Seen::default();
        for (deadline, late) in [(Duration::MAX, 0), (Duration::ZERO, 1), (Duration::MAX, 1)] {
            let terms = Terms::of(&query, Some(deadline));
            let request = terms.head(3, 42, 7, &INPUT);
            assert!(request.stamp_ns > 0 && request.deadline_ns > 0);
            std::thread::sleep(Duration::from_micros(10));
            let ok = ResponseHead::new(Status::Ok, Warnings::NONE, 7);
            let answer = terms.read(&request, &ok, &mut [], &mut seen);
            assert_eq!((answer.status, seen.late, seen.times), (Status::Ok, late, None));
        }
    }
}
