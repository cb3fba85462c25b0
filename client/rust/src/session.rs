//! One run of a server: where it takes requests, whether it is alive, how its plans are numbered.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use sarrus_proto::board::{ClaimedLane, StatusReader};
use sarrus_proto::lane::{ComputeClient, Threadsafe, send_request};
use sarrus_proto::message::{Heartbeat, RequestHead, ResponseHead};
use sarrus_proto::service::open_compute;
use sarrus_proto::{ServerName, Status, Warnings};

use crate::control::{Control, Hello};
use crate::plan::Plans;
use crate::wait::Waiter;
use crate::{ConnectError, ConnectOptions, Error, Transport};

/// A server without a sign of life for this long is looked for anew.
const SILENCE: Duration = Duration::from_millis(100);

/// What holds for one run of the server.
pub(crate) struct Session {
    pub(crate) instance: u64,
    /// The server's number of each plan, by its place.
    pub(crate) plans: Vec<Option<u32>>,
    /// Read as long as the session: the server holds this client's plans meanwhile.
    pub(crate) status: StatusReader,
    end: End,
}

enum End {
    /// Given up for a larger lane that did not come.
    None,
    Lane {
        lane: ClaimedLane,
        classes: [usize; 2],
    },
    Requests {
        client: ComputeClient<Threadsafe>,
    },
}

/// How an exchange with the server ended.
pub(crate) enum Exchange {
    Answered(ResponseHead),
    /// The server may be gone.
    Lost,
    /// The server lives.
    TimedOut,
}

impl Session {
    /// Attaches to a run and registers these plans.
    pub(crate) fn open(
        node: &Node<Threadsafe>,
        name: &ServerName,
        control: &Control<'_>,
        hello: &Hello,
        prepared: &Plans,
        transport: Transport,
    ) -> Result<Session, Error> {
        let service = |error| ConnectError::of_service(name.as_str(), error);
        // before the plans: the server holds a plan for those who read its status
        let status = StatusReader::open(node, name, hello.instance).map_err(service)?;
        let mut plans = Vec::new();
        for (place, prepared) in prepared.iter() {
            plans.resize(place, None);
            plans.push(Some(control.plan(prepared)?));
        }
        let end = match transport {
            Transport::Lane => {
                let (lane, classes) = control.lane(prepared.needs())?;
                End::Lane { lane, classes }
            }
            Transport::Service => {
                End::Requests { client: open_compute(node, name, hello.instance).map_err(service)? }
            }
        };
        Ok(Session { instance: hello.instance, plans, status, end })
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
        control: &Control<'_>,
        needs: [usize; 2],
    ) -> Result<(), ConnectError> {
        if let End::Lane { classes, .. } = &self.end
            && (needs[0] > classes[0] || needs[1] > classes[1])
        {
            self.end = End::None;
            let (lane, classes) = control.lane(needs)?;
            self.end = End::Lane { lane, classes };
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
    ) -> Exchange {
        let mut waiter = Waiter::new(options.wait_strategy);
        let mut watch = Watch::new();
        match &mut self.end {
            End::None => Exchange::Lost,
            End::Lane { lane, .. } => {
                let Some(numbers) = lane.outbox.numbers().get_mut(..input.len()) else {
                    return Exchange::Lost;
                };
                numbers.copy_from_slice(input);
                lane.outbox.publish(*head);
                loop {
                    if let Some((answer, numbers)) = lane.inbox.poll()
                        && (answer.sequence == head.sequence || head.checksum != 0)
                    {
                        // with a checksum another number is no older answer, but a changed one
                        copy_or_nan(numbers, output);
                        return Exchange::Answered(answer);
                    }
                    if let Some(waited) = waiter.pause()
                        && let Some(end) =
                            watch.look(&self.status, waited, options.timeout, deadline)
                    {
                        return end;
                    }
                }
            }
            End::Requests { client } => {
                let Some(pending) = send_request(client, head, input) else {
                    // nobody took it: the server is gone, or busy with a request that this client
                    // gave up
                    output.fill(f64::NAN);
                    return if watch.is_alive(&self.status) {
                        let answer =
                            ResponseHead::new(Status::Overloaded, Warnings::NONE, head.sequence);
                        Exchange::Answered(answer.checked(head, &[]))
                    } else {
                        Exchange::Lost
                    };
                };
                loop {
                    match pending.receive() {
                        Ok(Some(response)) => {
                            let answer = response.payload();
                            if answer.head.sequence == head.sequence || head.checksum != 0 {
                                copy_or_nan(&answer.numbers, output);
                                return Exchange::Answered(answer.head);
                            }
                        }
                        Ok(None) => {}
                        Err(_) => return Exchange::Lost,
                    }
                    if let Some(waited) = waiter.pause()
                        && let Some(end) =
                            watch.look(&self.status, waited, options.timeout, deadline)
                    {
                        return end;
                    }
                }
            }
        }
    }
}

fn copy_or_nan(numbers: &[f64], output: &mut [f64]) {
    match numbers.get(..output.len()) {
        Some(numbers) => output.copy_from_slice(numbers),
        None => output.fill(f64::NAN),
    }
}

/// Looks for the server's sign of life during a wait.
struct Watch {
    last: Option<(Heartbeat, Duration)>,
}

impl Watch {
    fn new() -> Watch {
        Watch { last: None }
    }

    /// Whether to give the wait up, and why.
    #[cold]
    fn look(
        &mut self,
        status: &StatusReader,
        waited: Duration,
        timeout: Duration,
        deadline: &mut Option<Instant>,
    ) -> Option<Exchange> {
        let deadline =
            *deadline.get_or_insert_with(|| Instant::now() + timeout.saturating_sub(waited));
        let now = status.heartbeat();
        match self.last {
            _ if now.stopped != 0 => return Some(Exchange::Lost),
            Some((last, since)) if last == now => {
                if waited.saturating_sub(since) > SILENCE {
                    return Some(Exchange::Lost);
                }
            }
            _ => self.last = Some((now, waited)),
        }
        (Instant::now() >= deadline).then_some(Exchange::TimedOut)
    }

    /// Whether the server gives a sign of life within a few beats.
    fn is_alive(&self, status: &StatusReader) -> bool {
        let first = status.heartbeat();
        first.stopped == 0
            && (0..20).any(|_| {
                std::thread::sleep(Duration::from_millis(1));
                status.heartbeat().beats != first.beats
            })
    }
}
