//! A robot in another process: attached to a run of its server, and attached again when there is a
//! new one.

use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::message::Statistics;
use sarrus_proto::{Domain, ModelInfo, ServerName};

use crate::control::Control;
use crate::head::{Seen, Terms};
use crate::plan::Plans;
use crate::session::{Exchange, Session};
use crate::{Answer, ConnectError, ConnectOptions, Error};

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

    /// Registers the plan in this place with the server, and sees that the lane holds them all.
    pub(crate) fn register(&mut self, prepared: &Plans, place: usize) -> Result<(), Error> {
        let deadline = Instant::now() + self.options.timeout;
        if self.session.is_some() {
            match self.extend(prepared, place, deadline) {
                Err(Error::Connect(error)) if error.may_pass() => {}
                outcome => return outcome,
            }
        }
        self.attach(prepared, deadline)
    }

    /// Tells the server that the plan in this place is held no more. Where it does not hear that,
    /// the session ends, and with it all that the server holds for it.
    pub(crate) fn release(&mut self, place: usize) {
        let (Some(node), Some(session)) = (&self.node, &mut self.session) else { return };
        let Some(number) = session.plans.get_mut(place).and_then(Option::take) else { return };
        let deadline = Instant::now() + self.options.timeout;
        let (fingerprint, instance) = (self.fingerprint, session.instance);
        let control = Control::resume(node, &self.name, fingerprint, instance, deadline);
        if control.and_then(|control| control.release(number)).is_err() {
            self.session = None;
        }
    }

    /// Asks and waits. The request goes out again when the server was restarted meanwhile.
    pub(crate) fn ask(
        &mut self,
        prepared: &Plans,
        place: usize,
        input: &[f64],
        output: &mut [f64],
        seen: &mut Seen,
    ) -> Result<Answer, Error> {
        let query = prepared.at(place).ok_or(Error::ReleasedPlan)?.query();
        let terms = Terms::of(query, self.options.deadline);
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
            let number = session.number(place).ok_or(Error::ReleasedPlan)?;
            let head = terms.head(number, self.fingerprint, self.sequence, input);
            match session.exchange(&head, input, output, &self.options, &mut deadline) {
                Exchange::Answered(answer) => return Ok(terms.read(&head, &answer, output, seen)),
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
        let transport = self.options.transport;
        let session = Session::open(node, &self.name, &control, &hello, &Plans::new(), transport);
        drop(control);
        self.fingerprint = hello.fingerprint;
        self.session = Some(session.map_err(|error| match error {
            Error::Connect(error) => error,
            // nothing but attaching can fail without plans
            _ => ConnectError::BadAnswer { what: "to an attach" },
        })?);
        Ok(info)
    }

    /// Adds a plan to a session that goes on.
    fn extend(&mut self, prepared: &Plans, place: usize, deadline: Instant) -> Result<(), Error> {
        let (Some(node), Some(session), Some(plan)) =
            (&self.node, &mut self.session, prepared.at(place))
        else {
            return Ok(());
        };
        let (fingerprint, instance) = (self.fingerprint, session.instance);
        let control = Control::resume(node, &self.name, fingerprint, instance, deadline)?;
        let number = control.plan(plan)?;
        if let Err(error) = session.grow(&control, prepared.needs()) {
            // without a lane, and with a plan that nobody knows here: begin anew
            self.session = None;
            return Err(error.into());
        }
        session.plans.resize(session.plans.len().max(place + 1), None);
        session.plans[place] = Some(number);
        Ok(())
    }

    /// Attaches again, as often as it takes until the deadline.
    fn attach(&mut self, prepared: &Plans, deadline: Instant) -> Result<(), Error> {
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

    fn try_attach(&mut self, prepared: &Plans, deadline: Instant) -> Result<(), Error> {
        let node = match &mut self.node {
            Some(node) => node,
            none => none.insert(self.domain.node::<Threadsafe>().map_err(ConnectError::from)?),
        };
        // a dead server still holds its ports until somebody clears them away
        node.try_cleanup_dead_nodes();
        let attempt = deadline.min(Instant::now() + 10 * RETRY);
        let (control, hello) = Control::open(node, &self.name, Some(self.fingerprint), attempt)?;
        let transport = self.options.transport;
        let session = Session::open(node, &self.name, &control, &hello, prepared, transport)?;
        self.session = Some(session);
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
