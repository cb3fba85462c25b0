//! Times and checksum in the head of an answer: age of the request, time to answer it, checksum
//! over head and numbers.
//!
//! The clock is read only for a request with a stamp. Client and thread share CLOCK_MONOTONIC,
//! which the kernel's page in this process provides without a system call.

use quanta::Clock;
use sarrus_proto::heartbeat::monotonic_ns;
use sarrus_proto::message::{RequestHead, ResponseHead};

/// A request that the answering thread has taken.
pub(crate) struct RequestTiming<'a> {
    clock: &'a Clock,
    head: &'a RequestHead,
    stamped: Option<Stamped>,
}

/// The times of a request with a stamp.
struct Stamped {
    /// The processor's counter at [`RequestTiming::new`].
    now: u64,
    /// Age when it was taken, and from then to `now` `[ns]`.
    age: u64,
    waited: u64,
}

impl<'a> RequestTiming<'a> {
    /// A request taken at count `found` of the processor's counter.
    #[inline]
    pub(crate) fn new(clock: &'a Clock, head: &'a RequestHead, found: u64) -> RequestTiming<'a> {
        let stamped = (head.stamp_ns != 0).then(|| Stamped::of(clock, head.stamp_ns, found));
        RequestTiming { clock, head, stamped }
    }

    /// True if the request's deadline had passed when it was taken.
    #[inline]
    pub(crate) fn is_late(&self) -> bool {
        let is_older = |stamped: &Stamped| stamped.age > self.head.deadline_ns;
        self.head.deadline_ns != 0 && self.stamped.as_ref().is_some_and(is_older)
    }

    /// The head of the answer with its times and, if the request and these numbers have one, the
    /// checksum. Call it right before the publication.
    #[inline]
    pub(crate) fn close(&self, mut answer: ResponseHead, numbers: Option<&[f64]>) -> ResponseHead {
        if let Some(Stamped { now, age, waited }) = self.stamped {
            let since = self.clock.delta_as_nanos(now, self.clock.raw());
            answer.age_ns = saturated(age);
            answer.took_ns = saturated(waited.saturating_add(since));
        }
        match numbers {
            Some(numbers) => answer.checked(self.head, numbers),
            None => answer,
        }
    }
}

impl Stamped {
    fn of(clock: &Clock, stamp_ns: u64, found: u64) -> Stamped {
        let now_ns = monotonic_ns();
        let now = clock.raw();
        // a stamp in the future counts as now
        let since = now_ns.saturating_sub(stamp_ns);
        let waited = clock.delta_as_nanos(found, now).min(since);
        Stamped { now, age: since - waited, waited }
    }
}

/// True if an answer came after the deadline of its request.
#[inline]
pub(crate) fn is_late(request: &RequestHead, answer: &ResponseHead) -> bool {
    request.deadline_ns != 0
        && u64::from(answer.age_ns) + u64::from(answer.took_ns) > request.deadline_ns
}

fn saturated(ns: u64) -> u32 {
    u32::try_from(ns).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sarrus_proto::{Status, Warnings};

    fn request(stamp_ns: u64, deadline_ns: u64) -> RequestHead {
        RequestHead { sequence: 1, stamp_ns, deadline_ns, ..RequestHead::default() }
    }

    fn answer(request: &RequestHead, clock: &Clock, found: u64) -> ResponseHead {
        let answer = ResponseHead::new(Status::Ok, Warnings::NONE, request.sequence);
        RequestTiming::new(clock, request, found).close(answer, Some(&[]))
    }

    #[test]
    fn age_and_time_together_are_the_time_since_the_stamp() {
        let clock = Clock::new();
        for _ in 0..100 {
            let stamp = monotonic_ns() - 3_000_000;
            let found = clock.raw();
            std::thread::sleep(std::time::Duration::from_millis(1));
            let request = request(stamp, 0);
            let answer = answer(&request, &clock, found);
            let since = monotonic_ns() - stamp;
            let age = u64::from(answer.age_ns);
            let took = u64::from(answer.took_ns);
            // the two clocks run alike to a thousandth
            assert!(age >= 2_990_000 && took >= 990_000, "{age} and {took}");
            assert!(age + took <= since + since / 1000, "{age} and {took} of {since}");
        }
    }

    #[test]
    fn without_a_stamp_there_are_no_times_and_a_stamp_of_the_future_is_of_now() {
        let clock = Clock::new();
        let found = clock.raw();
        let unstamped = answer(&request(0, 1), &clock, found);
        assert_eq!((unstamped.age_ns, unstamped.took_ns, unstamped.checksum), (0, 0, 0));
        assert_eq!(answer(&request(u64::MAX, 0), &clock, found).age_ns, 0);
        assert_eq!(answer(&request(1, 0), &clock, found).age_ns, u32::MAX);
    }

    #[test]
    fn an_answer_after_the_deadline_is_late() {
        let clock = Clock::new();
        let stamp = monotonic_ns() - 1_000_000;
        for (deadline, late) in [(0, false), (1, true), (900_000, true), (60_000_000_000, false)] {
            let request = request(stamp, deadline);
            let answer = answer(&request, &clock, clock.raw());
            assert_eq!(is_late(&request, &answer), late, "{deadline} ns");
        }
    }
}
