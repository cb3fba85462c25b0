//! One run of a server: its end for requests, its liveness and its numbers of plans.

use std::time::{Duration, Instant};

use sarrus_proto::batch::{BatchHead, BatchShape, ClaimedBatch};
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::message::{RequestHead, ResponseHead, load_numbers, store_numbers};
use sarrus_proto::service::OpenedService;
use sarrus_proto::{Answer, Node, Status, Warnings, process_number};

use crate::control::{Control, deadline_after};
use crate::plan::Plans;
use crate::wait::Waiter;
use crate::{ConnectError, ConnectOptions, Error, Outcome, Transport, interrupt};

/// The state of a client for one run of the server.
pub(crate) struct Session {
    /// The server's number of each plan, by its slot.
    pub(crate) plans: Vec<Option<u32>>,
    /// The area for batches, after the first one, and their count; it ends with the end for
    /// requests.
    batch: Option<(ClaimedBatch, u64)>,
    // dropped before the connection: when that ends the server removes its side
    end: End,
    pub(crate) control: Control,
    /// [`process_number`] of the owner.
    process: u64,
}

impl Drop for Session {
    fn drop(&mut self) {
        // the ports are still the parent's: they neither close nor tell the server
        if process_number() != self.process {
            return std::mem::forget(std::mem::replace(&mut self.end, End::None));
        }
        // a port that closes while the server polls it is removed by the answering thread
        if matches!(self.end, End::Requests { .. }) && !self.control.is_over() {
            self.control.leave();
        }
    }
}

/// Ports are dropped before their node.
enum End {
    /// No end: a larger lane was requested and refused.
    None,
    Lane {
        lane: ClaimedLane,
        classes: [usize; 2],
        _node: Node,
    },
    Requests {
        client: Box<dyn OpenedService>,
        _node: Node,
    },
}

/// The reason why an exchange with the server has no answer.
pub(crate) enum Unanswered {
    /// The server may be gone.
    Lost,
    /// The server lives.
    TimedOut,
    /// The caller interrupted the wait.
    Interrupted,
    /// The server refuses it.
    Refused(ConnectError),
}

impl Session {
    /// Registers these plans with a run, and gets an end.
    pub(crate) fn open(
        control: Control,
        prepared: &Plans,
        transport: Transport,
        deadline: Instant,
    ) -> Result<Session, Error> {
        let mut plans = Vec::new();
        for (place, prepared) in prepared.iter() {
            plans.resize(place, None);
            plans.push(Some(control.plan(prepared, deadline)?));
        }
        let end = match transport {
            Transport::Lane => {
                let (node, lane, classes) = control.lane(prepared.needs(), deadline)?;
                End::Lane { lane, classes, _node: node }
            }
            Transport::Service => {
                let (node, client) = control.service(deadline)?;
                End::Requests { client, _node: node }
            }
        };
        Ok(Session { plans, batch: None, end, control, process: process_number() })
    }

    /// The server's number of the plan in this slot.
    #[inline]
    pub(crate) fn number(&self, place: usize) -> Option<u32> {
        self.plans.get(place).copied().flatten()
    }

    /// Replaces a lane that is too small with a larger one. The old lane is returned first: it may
    /// be the server's last.
    pub(crate) fn grow(&mut self, needs: [usize; 2], deadline: Instant) -> Outcome {
        if let End::Lane { classes, .. } = &self.end
            && (needs[0] > classes[0] || needs[1] > classes[1])
        {
            (self.end, self.batch) = (End::None, None);
            let (node, lane, classes) = self.control.lane(needs, deadline)?;
            self.end = End::Lane { lane, classes, _node: node };
        }
        Ok(())
    }

    pub(crate) fn exchange(
        &mut self,
        head: &RequestHead,
        input: &[f64],
        output: &mut [f64],
        options: &ConnectOptions,
        deadline: &mut Option<Instant>,
    ) -> Result<ResponseHead, Unanswered> {
        let control = &self.control;
        match &mut self.end {
            End::None => Err(Unanswered::Lost),
            End::Lane { lane, .. } => {
                if !store_numbers(lane.outbox.numbers(), input) {
                    return Err(Unanswered::Lost);
                }
                lane.outbox.publish(*head);
                wait(control, options, deadline, || {
                    let found = lane.inbox.poll();
                    Ok(found.and_then(|(answer, numbers)| {
                        take(head, answer, output, |output| copy(numbers, output))
                    }))
                })
            }
            End::Requests { client, .. } => {
                if !client.send(head, input) {
                    // the request was not taken: the server is gone, or busy with a cancelled
                    // request of this client
                    output.fill(f64::NAN);
                    let status = Status::Overloaded;
                    let answer = ResponseHead::new(status, Warnings::NONE, head.sequence);
                    let is_over = control.is_over();
                    return (!is_over).then(|| answer.checked(head, &[])).ok_or(Unanswered::Lost);
                }
                let end = wait(control, options, deadline, || {
                    let found = client.poll().map_err(|_| Unanswered::Lost)?;
                    Ok(found.and_then(|(answer, words)| {
                        take(head, answer, output, |output| load_numbers(words, output))
                    }))
                });
                client.cancel();
                end
            }
        }
    }

    /// Asks for the rows of a batch and waits for all of them; the status is that of the batch. The
    /// area has its own sequence.
    pub(crate) fn exchange_batch(
        &mut self,
        mut head: BatchHead,
        shape: &BatchShape,
        (input, output, answers): (&[f64], &mut [f64], &mut [Answer]),
        options: &ConnectOptions,
        deadline: &mut Option<Instant>,
    ) -> Result<Status, Unanswered> {
        let (area, sequence) = match &mut self.batch {
            Some(batch) => batch,
            none => {
                let until = *deadline.get_or_insert_with(|| deadline_after(options.timeout));
                let area = self.control.batch(until).map_err(|error| match error.may_pass() {
                    true => Unanswered::Lost,
                    false => Unanswered::Refused(error),
                })?;
                none.insert((area, 0))
            }
        };
        *sequence += 1;
        head.sequence = *sequence;
        area.send(&head, shape, input);
        let mut waiter = Waiter::new(options.wait_strategy);
        let mut done = area.done();
        loop {
            if let Some(status) = area.answer(head.sequence) {
                let status = Status::of_answer(status);
                match status {
                    Status::Ok => area.read(shape, answers, output),
                    _ => answers.fill(Answer { status, warnings: Warnings::NONE }),
                }
                // otherwise the server revoked the area meanwhile
                return area.has_kept(head.sequence).then_some(status).ok_or(Unanswered::Lost);
            }
            if let Some(waited) = waiter.pause() {
                // while rows are answered the server makes progress
                if done != area.done() {
                    done = area.done();
                    *deadline = Some(deadline_after(options.timeout));
                }
                look(&self.control, waited, options.timeout, deadline)?;
            }
        }
    }
}

/// Whether an answer of this sequence is taken for the request's. With a checksum any other number
/// is corrupt, except that of the previous answer, which may be seen twice.
#[inline]
fn is_for(request: &RequestHead, sequence: u64) -> bool {
    let is_older = sequence.wrapping_add(1) == request.sequence;
    sequence == request.sequence || request.checksum != 0 && !is_older
}

/// Reads the numbers of an answer that is taken for the request's.
#[inline]
fn take(
    request: &RequestHead,
    answer: ResponseHead,
    output: &mut [f64],
    read: impl FnOnce(&mut [f64]) -> bool,
) -> Option<ResponseHead> {
    if !is_for(request, answer.sequence) {
        return None;
    }
    if !read(output) {
        output.fill(f64::NAN);
    }
    Some(answer)
}

/// Copies the first numbers; false if there are too few.
#[inline]
fn copy(numbers: &[f64], output: &mut [f64]) -> bool {
    let numbers = numbers.get(..output.len());
    numbers.is_some_and(|numbers| {
        output.copy_from_slice(numbers);
        true
    })
}

/// Polls until there is an answer or the wait ends.
#[inline]
fn wait(
    control: &Control,
    options: &ConnectOptions,
    deadline: &mut Option<Instant>,
    mut poll: impl FnMut() -> Result<Option<ResponseHead>, Unanswered>,
) -> Result<ResponseHead, Unanswered> {
    let mut waiter = Waiter::new(options.wait_strategy);
    loop {
        if let Some(answer) = poll()? {
            return Ok(answer);
        }
        if let Some(waited) = waiter.pause() {
            look(control, waited, options.timeout, deadline)?;
        }
    }
}

/// Whether to continue waiting: the kernel reports at once when the server is gone; until then the
/// server may only be late.
#[cold]
fn look(
    control: &Control,
    waited: Duration,
    timeout: Duration,
    deadline: &mut Option<Instant>,
) -> Result<(), Unanswered> {
    if control.is_over() {
        return Err(Unanswered::Lost);
    }
    if interrupt::is_wanted() {
        return Err(Unanswered::Interrupted);
    }
    let deadline = *deadline.get_or_insert_with(|| deadline_after(timeout.saturating_sub(waited)));
    if Instant::now() < deadline { Ok(()) } else { Err(Unanswered::TimedOut) }
}
