//! A robot in another process: attached to a run of its server, and reattached to the next run.

use std::time::{Duration, Instant};

use sarrus_proto::batch::{BatchHead, BatchShape};
use sarrus_proto::message::Statistics;
use sarrus_proto::{
    Domain, FailedState, ModelInfo, PROTOCOL_VERSION, ServerName, Status, Warnings, process_number,
};

use crate::control::{Control, deadline_after};
use crate::head::{Seen, Terms};
use crate::plan::Plans;
use crate::session::{Session, Unanswered};
use crate::{Answer, ConnectError, ConnectOptions, Error, Outcome, interrupt};

/// Delay between two attempts to reattach, at first and after a while.
const RETRY: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(20)];
/// Duration of the short delays: a supervised server is back by then.
const QUICK: Duration = Duration::from_millis(250);

/// One attempt to exchange something with a run of the server.
struct Attempt<'a> {
    session: &'a mut Session,
    /// The number of the plan in this run.
    plan: u32,
    fingerprint: u64,
    sequence: &'a mut u64,
    options: &'a ConnectOptions,
    deadline: &'a mut Option<Instant>,
}

/// The connection to a server.
pub(crate) struct Remote {
    session: Option<Session>,
    domain: Domain,
    name: ServerName,
    options: ConnectOptions,
    fingerprint: u64,
    sequence: u64,
    /// [`process_number`] of the process that connected; a child of it must not use the connection.
    process: u64,
}

/// The answer to a forked child that uses the connection of its parent.
const INHERITED: Answer = Answer { status: Status::OtherProcess, warnings: Warnings::NONE };

impl Remote {
    pub(crate) fn connect(
        domain: Domain,
        name: &str,
        options: ConnectOptions,
    ) -> Outcome<(Remote, ModelInfo)> {
        let name = ServerName::new(name)?;
        let deadline = deadline_after(options.timeout);
        let waited = |error: ConnectError| error.waited(options.timeout);
        let control =
            Control::open(&domain, &name, options.fingerprint, deadline).map_err(waited)?;
        let info = control.model(deadline).map_err(waited)?;
        let fingerprint = control.fingerprint;
        let session = Session::open(control, &Plans::new(), options.transport, deadline);
        let session = Some(session.map_err(|error| match error {
            Error::Connect(error) => waited(error),
            // without plans only attaching can fail
            _ => ConnectError::BadAnswer("to an attach"),
        })?);
        let process = process_number();
        Ok((Remote { session, domain, name, options, fingerprint, sequence: 0, process }, info))
    }

    /// True in a child of the process that connected.
    #[inline]
    fn is_inherited(&self) -> bool {
        process_number() != self.process
    }

    /// The statistics of the server, as it answers.
    pub(crate) fn statistics(&self) -> Option<Statistics> {
        let deadline = deadline_after(self.options.timeout);
        let session = self.session.as_ref().filter(|_| !self.is_inherited());
        session.and_then(|session| session.control.statistics(deadline).ok())
    }

    /// Registers the plan in this slot with the server, and enlarges the lane if needed.
    pub(crate) fn register(&mut self, prepared: &Plans, place: usize) -> Result<(), Error> {
        if self.is_inherited() {
            return Err(FailedState { status: INHERITED.status }.into());
        }
        let deadline = deadline_after(self.options.timeout);
        if self.session.is_some() {
            match self.extend(prepared, place, deadline) {
                Err(Error::Connect(error)) if error.may_pass() => {}
                Err(Error::Connect(ConnectError::Interrupted)) => return self.interrupted(),
                outcome => return outcome,
            }
        }
        self.attach(prepared, deadline)
    }

    /// Releases the plan of this slot in the server. If that fails, the session ends, and the
    /// server frees all its resources.
    pub(crate) fn release(&mut self, place: usize) {
        if self.is_inherited() {
            return;
        }
        let Some(session) = &mut self.session else { return };
        let Some(number) = session.plans.get_mut(place).and_then(Option::take) else { return };
        let deadline = deadline_after(self.options.timeout);
        if session.control.release(number, deadline).is_err() {
            self.session = None;
        }
    }

    /// The deadline of single requests from now on.
    pub(crate) fn set_deadline(&mut self, deadline: Option<Duration>) {
        self.options.deadline = deadline;
    }

    /// Asks and waits. The request is sent again if the server restarts meanwhile.
    pub(crate) fn ask(
        &mut self,
        prepared: &Plans,
        place: usize,
        input: &[f64],
        output: &mut [f64],
        seen: &mut Seen,
    ) -> Result<Answer, Error> {
        if self.is_inherited() {
            output.fill(f64::NAN);
            return Ok(INHERITED);
        }
        let query = prepared.at(place).ok_or(Error::ReleasedPlan)?.query();
        let terms = Terms::of(query, self.options.deadline);
        self.exchange(prepared, place, |attempt| {
            let Attempt { session, plan, fingerprint, sequence, options, deadline } = attempt;
            *sequence += 1;
            let head = terms.head(plan, fingerprint, *sequence, input);
            let answer = session.exchange(&head, input, output, options, deadline)?;
            Ok(terms.read(&head, &answer, output, seen))
        })
    }

    /// Asks for the rows of a batch and waits, as [`Remote::ask`]. Rows of a refused batch have its
    /// status, and no numbers.
    pub(crate) fn batch(
        &mut self,
        prepared: &Plans,
        place: usize,
        shape: &BatchShape,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> Result<(), Error> {
        if self.is_inherited() {
            answers.fill(INHERITED);
            return Ok(());
        }
        self.exchange(prepared, place, |attempt| {
            let Attempt { session, plan, fingerprint, options, deadline, .. } = attempt;
            let version = PROTOCOL_VERSION;
            let rows = shape.rows() as u64;
            let head = BatchHead { version, plan, fingerprint, sequence: 0, rows };
            session.exchange_batch(head, shape, (input, output, answers), options, deadline)
        })?;
        Ok(())
    }

    /// Runs an exchange with the server, again if it restarts meanwhile.
    #[inline]
    fn exchange<T>(
        &mut self,
        prepared: &Plans,
        place: usize,
        mut attempt: impl FnMut(Attempt<'_>) -> Result<T, Unanswered>,
    ) -> Result<T, Error> {
        // the clock is read only if an exchange takes long
        let mut deadline = None;
        loop {
            if self.session.is_none() {
                let deadline =
                    *deadline.get_or_insert_with(|| deadline_after(self.options.timeout));
                self.attach(prepared, deadline)?;
            }
            let Remote { session: Some(session), options, fingerprint, sequence, .. } = self else {
                continue;
            };
            let plan = session.number(place).ok_or(Error::ReleasedPlan)?;
            let fingerprint = *fingerprint;
            let deadline = &mut deadline;
            match attempt(Attempt { session, plan, fingerprint, sequence, options, deadline }) {
                Ok(answer) => return Ok(answer),
                Err(Unanswered::Interrupted | Unanswered::Refused(ConnectError::Interrupted)) => {
                    return self.interrupted();
                }
                Err(Unanswered::Refused(error)) => return Err(error.into()),
                Err(Unanswered::Lost) => self.session = None,
                Err(Unanswered::TimedOut) => {
                    let life = session.control.life();
                    // discard the session so that a late reply cannot be misread
                    self.session = None;
                    return Err(Error::NoAnswer {
                        name: self.name.as_str().to_owned(),
                        timeout: self.options.timeout,
                        life,
                    });
                }
            }
        }
    }

    /// Ends the session so that the reply to the pending request cannot be misread.
    fn interrupted<T>(&mut self) -> Result<T, Error> {
        self.session = None;
        Err(ConnectError::Interrupted.into())
    }

    /// Adds a plan to a running session.
    fn extend(&mut self, prepared: &Plans, place: usize, deadline: Instant) -> Result<(), Error> {
        let (Some(session), Some(plan)) = (&mut self.session, prepared.at(place)) else {
            return Ok(());
        };
        let number = session.control.plan(plan, deadline)?;
        if let Err(error) = session.grow(prepared.needs(), deadline) {
            // without a lane, and with a plan unknown here: start a new session
            self.session = None;
            return Err(error.into());
        }
        session.plans.resize(session.plans.len().max(place + 1), None);
        session.plans[place] = Some(number);
        Ok(())
    }

    /// Reattaches, with retries until the deadline.
    fn attach(&mut self, prepared: &Plans, deadline: Instant) -> Result<(), Error> {
        self.session = None;
        let start = Instant::now();
        loop {
            if interrupt::is_wanted() {
                return self.interrupted();
            }
            let error = match self.try_attach(prepared, deadline) {
                Err(Error::Connect(error)) if error.may_pass() => error,
                outcome => return outcome,
            };
            let retry = RETRY[usize::from(start.elapsed() > QUICK)];
            if Instant::now() + retry >= deadline {
                return Err(match error {
                    ConnectError::NoServer(..) | ConnectError::ShuttingDown => {
                        Error::ServerGone(self.name.as_str().to_owned(), self.options.timeout)
                    }
                    other => other.waited(self.options.timeout).into(),
                });
            }
            std::thread::sleep(retry);
        }
    }

    fn try_attach(&mut self, prepared: &Plans, deadline: Instant) -> Result<(), Error> {
        let control = Control::open(&self.domain, &self.name, Some(self.fingerprint), deadline)?;
        let transport = self.options.transport;
        self.session = Some(Session::open(control, prepared, transport, deadline)?);
        Ok(())
    }
}
