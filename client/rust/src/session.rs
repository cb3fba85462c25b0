//! One run of a server: where it takes requests, whether it is alive, how its plans are numbered.

use std::time::{Duration, Instant};

use sarrus_proto::batch::{BatchHead, BatchShape, ClaimedBatch};
use sarrus_proto::board::ClaimedLane;
use sarrus_proto::message::{RequestHead, ResponseHead};
use sarrus_proto::service::OpenedService;
use sarrus_proto::{Answer, Node, Status, Warnings};

use crate::control::{Control, deadline_after};
use crate::plan::Plans;
use crate::wait::Waiter;
use crate::{ConnectError, ConnectOptions, Error, Transport, interrupt};

/// The state of a client for one run of the server.
pub(crate) struct Session {
    /// The server's number of each plan, by its place.
    pub(crate) plans: Vec<Option<u32>>,
    /// Where batches go, once one was asked, and how many went; it goes with the end.
    batch: Option<(ClaimedBatch, u64)>,
    // dropped before the connection, at whose end the server takes its side down
    end: End,
    pub(crate) control: Control,
}

impl Drop for Session {
    fn drop(&mut self) {
        // a port that goes while the server polls it is taken down by the thread that answers
        // others
        if matches!(self.end, End::Requests { .. }) && !self.control.is_over() {
            self.control.leave();
        }
    }
}

/// Ports go before their node.
enum End {
    /// Given up for a larger lane that did not come.
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

/// Why an exchange with the server has no answer.
pub(crate) enum Unanswered {
    /// The server may be gone.
    Lost,
    /// The server lives.
    TimedOut,
    /// The caller does not wait any longer.
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
        Ok(Session { plans, batch: None, end, control })
    }

    /// The server's number of the plan in this place.
    #[inline]
    pub(crate) fn number(&self, place: usize) -> Option<u32> {
        self.plans.get(place).copied().flatten()
    }

    /// Gets a larger lane where this one is too small, which goes back first: it may be the
    /// server's last.
    pub(crate) fn grow(
        &mut self,
        needs: [usize; 2],
        deadline: Instant,
    ) -> Result<(), ConnectError> {
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
                let numbers = lane.outbox.numbers().get_mut(..input.len());
                numbers.ok_or(Unanswered::Lost)?.copy_from_slice(input);
                lane.outbox.publish(*head);
                wait(control, options, deadline, || Ok(take(head, lane.inbox.poll(), output)))
            }
            End::Requests { client, .. } => {
                if !client.send(head, input) {
                    // the request was not taken: the server is gone, or busy with a request that
                    // this client gave up
                    output.fill(f64::NAN);
                    let status = Status::Overloaded;
                    let answer = ResponseHead::new(status, Warnings::NONE, head.sequence);
                    let is_over = control.is_over();
                    return (!is_over).then(|| answer.checked(head, &[])).ok_or(Unanswered::Lost);
                }
                let end = wait(control, options, deadline, || {
                    let found = client.poll().map_err(|_| Unanswered::Lost)?;
                    Ok(take(head, found, output))
                });
                client.cancel();
                end
            }
        }
    }

    /// Asks for rows that go together and waits for all of them; the status is that of the batch.
    /// The sequence is the area's own.
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
                // else the server took it back meanwhile
                return area.has_kept(head.sequence).then_some(status).ok_or(Unanswered::Lost);
            }
            if let Some(waited) = waiter.pause() {
                // as long as rows are answered the server is at it
                if done != area.done() {
                    done = area.done();
                    *deadline = Some(deadline_after(options.timeout));
                }
                look(&self.control, waited, options.timeout, deadline)?;
            }
        }
    }
}

/// Whether an answer of this sequence is taken for the request's. With a checksum another number is
/// a changed one, but for that of the answer before, which may be seen twice.
#[inline]
fn is_for(request: &RequestHead, sequence: u64) -> bool {
    let is_older = sequence.wrapping_add(1) == request.sequence;
    sequence == request.sequence || request.checksum != 0 && !is_older
}

/// Copies the numbers of an answer that is taken for the request's.
#[inline]
fn take(
    request: &RequestHead,
    found: Option<(ResponseHead, &[f64])>,
    output: &mut [f64],
) -> Option<ResponseHead> {
    let (answer, numbers) = found.filter(|(answer, _)| is_for(request, answer.sequence))?;
    match numbers.get(..output.len()) {
        Some(numbers) => output.copy_from_slice(numbers),
        None => output.fill(f64::NAN),
    }
    Some(answer)
}

/// Polls until there is an answer, or no longer a reason to wait for it.
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

/// Whether to go on waiting: the kernel reports at once when the server is gone, and as long as it
/// does not, the server may only be late.
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
