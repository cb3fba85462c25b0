//! Who answers: the model in this process, or a server.

use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use sarrus_client::{
    Answer, ConnectError, ConnectOptions, Error, PlanId, Query, Robot, Status, Transport, Warnings,
};
use sarrus_proto::ServerName;

/// Plans that are kept: scripts use few, and one that uses a new one for each line must fill
/// neither the memory nor a server's table.
const PLANS: usize = 64;
/// How long a server that is gone is not looked for again.
const PAUSE: Duration = Duration::from_secs(1);

/// What came of a request; with words where nobody computed anything.
#[derive(Clone, Debug)]
pub(super) struct Reply {
    pub(super) answer: Answer,
    pub(super) words: Option<String>,
}

/// A robot, here or connected, with the plans of the lines so far.
pub(super) struct Engine {
    robot: Robot,
    plans: Vec<(Query, PlanId)>,
    /// When and how the server was found to be gone.
    lost: Option<(Instant, Status, String)>,
    was_lost: bool,
}

impl Engine {
    pub(super) fn new(robot: Robot) -> Engine {
        Engine { robot, plans: Vec::new(), lost: None, was_lost: false }
    }

    /// Connects through a lane, or through the service when all lanes are taken.
    pub(super) fn connect(name: &str) -> Result<Engine, ConnectError> {
        // a bad name is reported before anything is made
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

    pub(super) fn robot(&self) -> &Robot {
        &self.robot
    }

    /// True when the server was gone at some time.
    pub(super) fn was_lost(&self) -> bool {
        self.was_lost
    }

    /// Asks for so many states of one query: rows in, rows out, packed as it says.
    pub(super) fn ask(
        &mut self,
        query: &Query,
        rows: usize,
        input: &[f64],
        output: &mut [f64],
    ) -> Vec<Reply> {
        // each look for a lost server takes a second: the lines between two looks are answered at
        // once
        if let Some((since, status, words)) = &self.lost
            && since.elapsed() < PAUSE
        {
            return vec![Reply::failed(*status, words.clone()); rows];
        }
        let nothing = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut answers = vec![nothing; rows];
        let outcome = match (self.plan(query), &mut answers[..]) {
            (Err(error), _) => Err(error),
            (Ok(plan), [answer]) => {
                self.robot.ask(plan, input, output).map(|answered| *answer = answered)
            }
            (Ok(plan), answers) => {
                self.robot.batch(plan, NonZeroUsize::MIN, input, output, answers)
            }
        };
        let Err(error) = outcome else {
            self.lost = None;
            return answers.into_iter().map(|answer| Reply { answer, words: None }).collect();
        };
        let words = error.to_string();
        let status = match error {
            Error::Query(_) | Error::TooLarge { .. } => {
                return vec![Reply::failed(Status::BadRequest, words); rows];
            }
            Error::TooManyPlans { .. } => {
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
        // those before the server went have their answers
        let reply = |answer: Answer| match answer.status {
            Status::UnknownRequest => Reply::failed(status, words.clone()),
            _ => Reply { answer, words: None },
        };
        answers.into_iter().map(reply).collect()
    }

    /// The plan of a query; where too many are kept, they are released first.
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
