//! A robot in another process: attached to a run of its server, and attached again when there is a
//! new one.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use sarrus_proto::board::{ClaimedLane, StatusReader};
use sarrus_proto::lane::{ComputeClient, Threadsafe, send_request};
use sarrus_proto::message::{Heartbeat, RequestHead, ResponseHead, Statistics};
use sarrus_proto::service::open_compute;
use sarrus_proto::{Domain, ModelInfo, PROTOCOL_VERSION, ServerName, Status, Warnings};

use crate::control::{Control, Hello};
use crate::wait::Waiter;
use crate::{Answer, ConnectError, ConnectOptions, Error, Prepared, Transport};

/// A server without a sign of life for this long is looked for anew.
const SILENCE: Duration = Duration::from_millis(100);
/// Between two attempts to attach again.
const RETRY: Duration = Duration::from_millis(20);

/// The connection to a server.
pub(crate) struct Remote {
    // before the node: ports go first
    session: Option<Session>,
    node: Option<Node<Threadsafe>>,
    domain: Domain,
    name: ServerName,
    options: ConnectOptions,
    fingerprint: u64,
    sequence: u64,
}

/// What holds for one run of the server.
struct Session {
    instance: u64,
    /// The server's number of each plan.
    plans: Vec<u32>,
    status: StatusReader,
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
enum Exchange {
    Answered(ResponseHead),
    /// The server may be gone.
    Lost,
    /// The server lives.
    TimedOut,
}

impl Remote {
    pub(crate) fn connect(
        domain: Domain,
        name: &str,
        options: ConnectOptions,
    ) -> Result<(Remote, ModelInfo), ConnectError> {
        let name = ServerName::new(name)?;
        let node = domain.node::<Threadsafe>()?;
        let mut remote = Remote {
            session: None,
            node: Some(node),
            domain,
            name,
            options,
            fingerprint: 0,
            sequence: 0,
        };
        let deadline = Instant::now() + options.timeout;
        let info = remote.first_session(deadline)?;
        Ok((remote, info))
    }

    /// The statistics of the server, as of its last note of them.
    pub(crate) fn statistics(&self) -> Option<Statistics> {
        self.session.as_ref().map(|session| session.status.statistics())
    }

    /// Registers the last of `prepared` with the server, and sees that the lane holds them all.
    pub(crate) fn register(&mut self, prepared: &[Prepared]) -> Result<(), Error> {
        let deadline = Instant::now() + self.options.timeout;
        let numbers = |session: &Session| session.plans.len();
        if self.session.as_ref().is_some_and(|session| numbers(session) + 1 == prepared.len()) {
            match self.extend(prepared, deadline) {
                Err(Error::Connect(error)) if error.may_pass() => {}
                outcome => return outcome,
            }
        }
        self.attach(prepared, deadline)
    }

    /// Asks and waits. The request goes out again when the server was restarted meanwhile.
    pub(crate) fn ask(
        &mut self,
        prepared: &[Prepared],
        plan: usize,
        input: &[f64],
        output: &mut [f64],
    ) -> Result<Answer, Error> {
        // the clock is read only where something takes long
        let mut deadline = None;
        loop {
            if self.session.is_none() {
                let deadline =
                    *deadline.get_or_insert_with(|| Instant::now() + self.options.timeout);
                self.attach(prepared, deadline)?;
            }
            let Some(session) = &mut self.session else { continue };
            self.sequence += 1;
            let number =
                session.plans.get(plan).copied().ok_or(Error::UnknownPlan { index: plan })?;
            let head = RequestHead {
                version: PROTOCOL_VERSION,
                plan: number,
                fingerprint: self.fingerprint,
                sequence: self.sequence,
            };
            match session.exchange(&head, input, output, &self.options, &mut deadline) {
                Exchange::Answered(head) => {
                    let status = Status::of_answer(head.status);
                    if status == Status::UnknownStatus {
                        // numbers without a known meaning
                        output.fill(f64::NAN);
                    }
                    return Ok(Answer { status, warnings: Warnings(head.warnings) });
                }
                Exchange::Lost => self.session = None,
                Exchange::TimedOut => {
                    // an answer that comes late must meet nobody
                    self.session = None;
                    return Err(Error::NoAnswer {
                        name: self.name.as_str().to_owned(),
                        timeout: self.options.timeout,
                    });
                }
            }
        }
    }

    /// Attaches for the first time.
    fn first_session(&mut self, deadline: Instant) -> Result<ModelInfo, ConnectError> {
        let Some(node) = &self.node else {
            return Err(ConnectError::NoServer { name: self.name.as_str().to_owned() });
        };
        let (control, hello) = Control::open(node, &self.name, self.options.fingerprint, deadline)?;
        let info = control.model(&hello)?;
        let session = Session::open(
            node,
            &self.name,
            &control,
            &hello,
            Vec::new(),
            [0; 2],
            self.options.transport,
        )?;
        drop(control);
        self.fingerprint = hello.fingerprint;
        self.session = Some(session);
        Ok(info)
    }

    /// Adds the last plan to a session that goes on.
    fn extend(&mut self, prepared: &[Prepared], deadline: Instant) -> Result<(), Error> {
        let (Some(node), Some(session), Some(last)) =
            (&self.node, &mut self.session, prepared.last())
        else {
            return Ok(());
        };
        let (control, hello) = Control::open(node, &self.name, Some(self.fingerprint), deadline)?;
        if hello.instance != session.instance {
            return Err(ConnectError::NoServer { name: self.name.as_str().to_owned() }.into());
        }
        let number = control.plan(last)?;
        session.grow(&control, needs(prepared))?;
        session.plans.push(number);
        Ok(())
    }

    /// Attaches again, as often as it takes until the deadline.
    fn attach(&mut self, prepared: &[Prepared], deadline: Instant) -> Result<(), Error> {
        self.session = None;
        loop {
            let error = match self.try_attach(prepared, deadline) {
                Err(Error::Connect(error)) if error.may_pass() => error,
                outcome => return outcome,
            };
            if Instant::now() + RETRY >= deadline {
                return Err(match error {
                    ConnectError::Service(_) => error.into(),
                    _ => Error::ServerGone {
                        name: self.name.as_str().to_owned(),
                        timeout: self.options.timeout,
                    },
                });
            }
            std::thread::sleep(RETRY);
        }
    }

    fn try_attach(&mut self, prepared: &[Prepared], deadline: Instant) -> Result<(), Error> {
        let node = match &mut self.node {
            Some(node) => node,
            none => none.insert(self.domain.node::<Threadsafe>().map_err(ConnectError::from)?),
        };
        // a dead server still holds its ports until somebody clears them away
        node.try_cleanup_dead_nodes();
        let attempt = deadline.min(Instant::now() + 10 * RETRY);
        let (control, hello) = Control::open(node, &self.name, Some(self.fingerprint), attempt)?;
        let plans = prepared
            .iter()
            .map(|prepared| control.plan(prepared))
            .collect::<Result<Vec<u32>, Error>>()?;
        self.session = Some(Session::open(
            node,
            &self.name,
            &control,
            &hello,
            plans,
            needs(prepared),
            self.options.transport,
        )?);
        Ok(())
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        self.session = None;
        self.node = None;
        self.domain.tidy();
    }
}

/// How many numbers go in and come out at most.
fn needs(prepared: &[Prepared]) -> [usize; 2] {
    let most = |n: fn(&Prepared) -> usize| prepared.iter().map(n).max().unwrap_or(0);
    [most(|prepared| prepared.given().len()), most(|prepared| prepared.want().len())]
}

impl Session {
    fn open(
        node: &Node<Threadsafe>,
        name: &ServerName,
        control: &Control<'_>,
        hello: &Hello,
        plans: Vec<u32>,
        needs: [usize; 2],
        transport: Transport,
    ) -> Result<Session, ConnectError> {
        let service = |error| ConnectError::of_service(name.as_str(), error);
        let status = StatusReader::open(node, name, hello.instance).map_err(service)?;
        let end = match transport {
            Transport::Lane => {
                let (lane, classes) = control.lane(needs)?;
                End::Lane { lane, classes }
            }
            Transport::Service => {
                End::Requests { client: open_compute(node, name, hello.instance).map_err(service)? }
            }
        };
        Ok(Session { instance: hello.instance, plans, status, end })
    }

    /// Gets a larger lane where this one is too small, which goes back first: it may be the
    /// server's last.
    fn grow(&mut self, control: &Control<'_>, needs: [usize; 2]) -> Result<(), ConnectError> {
        if let End::Lane { classes, .. } = &self.end
            && (needs[0] > classes[0] || needs[1] > classes[1])
        {
            self.end = End::None;
            let (lane, classes) = control.lane(needs)?;
            self.end = End::Lane { lane, classes };
        }
        Ok(())
    }

    fn exchange(
        &mut self,
        head: &RequestHead,
        input: &[f64],
        output: &mut [f64],
        options: &ConnectOptions,
        deadline: &mut Option<Instant>,
    ) -> Exchange {
        let mut waiter = Waiter::new(options.wait_strategy);
        let mut watch = Watch::new();
        let overloaded = ResponseHead::new(Status::Overloaded, Warnings::NONE, head.sequence);
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
                        && answer.sequence == head.sequence
                    {
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
                        Exchange::Answered(overloaded)
                    } else {
                        Exchange::Lost
                    };
                };
                loop {
                    match pending.receive() {
                        Ok(Some(response)) => {
                            let answer = response.payload();
                            if answer.head.sequence == head.sequence {
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
