//! The robot that answers: in this process, or of a server.

use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use sarrus_client::{
    Answer, ConnectError, ConnectOptions, Error, PlanId, Query, Robot, Status, Transport, Warnings,
};
use sarrus_proto::ServerName;

/// Most plans in the cache: a script with a new query in each line must not fill the memory or a
/// server's table.
const PLANS: usize = 64;
/// Time between two attempts to reach a lost server.
const PAUSE: Duration = Duration::from_secs(1);

/// The answer to a request, with a reason if nothing was computed.
#[derive(Clone, Debug)]
pub(super) struct Reply {
    pub(super) answer: Answer,
    pub(super) words: Option<String>,
}

/// A robot in this process or a connected one, with the plans of earlier lines.
pub(super) struct Engine {
    pub(super) robot: Robot,
    plans: Vec<(Query, PlanId)>,
    /// The time, status and reason of the last failed attempt to reach the server.
    lost: Option<(Instant, Status, String)>,
    /// True if the server was lost at some time.
    pub(super) was_lost: bool,
}

impl Engine {
    pub(super) fn new(robot: Robot) -> Engine {
        Engine { robot, plans: Vec::new(), lost: None, was_lost: false }
    }

    /// Connects through a lane, or through the service when all lanes are taken.
    pub(super) fn connect(name: &str) -> Result<Engine, ConnectError> {
        // a bad name is reported before files are made
        ServerName::new(name)?;
        let robot = match Robot::connect(name) {
            Err(ConnectError::NoFreeSlot { .. }) => Robot::connect_with(
                name,
                ConnectOptions { transport: Transport::Service, ..ConnectOptions::default() },
            ),
            outcome => outcome,
        };
        robot.map(Engine::new)
    }

    /// Answers `rows` states of one query; `input` and `output` hold one packed row each. Rows with
    /// a deadline are asked one by one.
    pub(super) fn ask(
        &mut self,
        query: &Query,
        deadline: Option<Duration>,
        rows: usize,
        input: &[f64],
        output: &mut [f64],
    ) -> Vec<Reply> {
        // an attempt to reach a lost server takes a second: lines between two attempts fail at once
        if let Some((since, status, words)) = &self.lost
            && since.elapsed() < PAUSE
        {
            return vec![Reply::failed(*status, words.clone()); rows];
        }
        let nothing = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut answers = vec![nothing; rows];
        let outcome = self.plan(query).and_then(|plan| {
            self.robot.set_deadline(deadline);
            if rows > 1 && deadline.is_none() {
                return self.robot.batch(plan, NonZeroUsize::MIN, input, output, &mut answers);
            }
            let (n_in, n_out) = (input.len() / rows, output.len() / rows);
            for (row, answer) in answers.iter_mut().enumerate() {
                let input = &input[row * n_in..][..n_in];
                *answer = self.robot.ask(plan, input, &mut output[row * n_out..][..n_out])?;
            }
            Ok(())
        });
        let Err(error) = outcome else {
            self.lost = None;
            return answers.into_iter().map(|answer| Reply { answer, words: None }).collect();
        };
        let words = error.to_string();
        let status = match error {
            Error::Query(_) | Error::TooLarge { .. } => {
                return vec![Reply::failed(Status::BadRequest, words); rows];
            }
            Error::TooManyPlans { .. } | Error::Connect(ConnectError::TooManyOrders { .. }) => {
                return vec![Reply::failed(Status::Overloaded, words); rows];
            }
            Error::NoAnswer { .. } => Status::Overloaded,
            Error::Connect(ConnectError::WrongModel { .. }) => Status::WrongModel,
            _ => Status::ShuttingDown,
        };
        if self.lost.is_none() {
            eprintln!("sarrus ask: {words}");
        }
        self.was_lost = true;
        self.lost = Some((Instant::now(), status, words.clone()));
        // rows answered before the loss keep their answers
        let reply = |answer: Answer| match answer.status {
            Status::UnknownRequest => Reply::failed(status, words.clone()),
            _ => Reply { answer, words: None },
        };
        answers.into_iter().map(reply).collect()
    }

    /// The plan of a query; a full table is released first.
    fn plan(&mut self, query: &Query) -> Result<PlanId, Error> {
        if let Some((_, plan)) = self.plans.iter().find(|(known, _)| known == query) {
            return Ok(*plan);
        }
        if self.plans.len() == PLANS {
            for (_, plan) in std::mem::take(&mut self.plans) {
                self.robot.release(plan)?;
            }
        }
        let plan = self.robot.prepare(query)?;
        self.plans.push((*query, plan));
        Ok(plan)
    }
}

impl Reply {
    pub(super) fn failed(status: Status, words: String) -> Reply {
        Reply { answer: Answer { status, warnings: Warnings::NONE }, words: Some(words) }
    }
}
