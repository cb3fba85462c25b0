//! Who answers: the model in this process, or a server.

use std::time::{Duration, Instant};

use sarrus_client::{
    Answer, ConnectError, ConnectOptions, Error, PlanId, Query, Robot, Status, Transport, Warnings,
};
use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_proto::ServerName;

/// Plans that are kept: scripts use few, and one that uses a new one for each line must fill
/// neither the memory nor a server's table.
const PLANS: usize = 64;
/// How long a server that is gone is not looked for again.
const PAUSE: Duration = Duration::from_secs(1);

/// Who answers.
pub(super) enum Engine {
    Here(Box<Here>),
    There(Box<There>),
}

/// What came of a request; with words where nobody computed anything.
pub(super) struct Reply {
    pub(super) answer: Answer,
    pub(super) words: Option<String>,
}

impl Engine {
    /// Asks for `output`, packed as `wanted` says, from `input`.
    pub(super) fn ask(&mut self, query: &Query, input: &[f64], output: &mut [f64]) -> Reply {
        match self {
            Engine::Here(here) => here.ask(query, input, output),
            Engine::There(there) => there.ask(query, input, output),
        }
    }

    /// True when the server was gone at some time.
    pub(super) fn was_lost(&self) -> bool {
        matches!(self, Engine::There(there) if there.was_lost)
    }
}

/// The model in this process.
pub(super) struct Here {
    model: Model<f64>,
    workspace: Workspace<f64>,
    plans: Vec<Plan>,
}

impl Here {
    pub(super) fn new(model: Model<f64>) -> Here {
        Here { workspace: Workspace::new(&model), model, plans: Vec::new() }
    }

    fn ask(&mut self, query: &Query, input: &[f64], output: &mut [f64]) -> Reply {
        let known = self.plans.iter().position(|plan| plan.query() == query);
        let index =
            match known.map_or_else(|| Plan::new(&self.model, query).map(Some), |_| Ok(None)) {
                Err(error) => return Reply::failed(Status::BadRequest, error.to_string()),
                Ok(Some(plan)) => {
                    if self.plans.len() == PLANS {
                        self.plans.clear();
                    }
                    self.plans.push(plan);
                    self.plans.len() - 1
                }
                Ok(None) => known.unwrap_or(0),
            };
        let answer = self
            .plans
            .get(index)
            .map(|plan| plan.run(&self.model, &mut self.workspace, input, output));
        Reply {
            answer: answer
                .unwrap_or(Answer { status: Status::UnknownRequest, warnings: Warnings::NONE }),
            words: None,
        }
    }
}

/// A server.
pub(super) struct There {
    pub(super) robot: Robot,
    plans: Vec<(Query, PlanId)>,
    /// When and how the server was found to be gone.
    lost: Option<(Instant, Status, String)>,
    was_lost: bool,
}

impl There {
    /// Connects through a lane, or through the service when all lanes are taken.
    pub(super) fn connect(name: &str) -> Result<There, ConnectError> {
        // a bad name is reported before anything is made
        ServerName::new(name)?;
        let robot = match Robot::connect(name) {
            Err(ConnectError::NoFreeSlot { .. }) => Robot::connect_with(
                name,
                ConnectOptions { transport: Transport::Service, ..ConnectOptions::default() },
            ),
            outcome => outcome,
        };
        Ok(There { robot: robot?, plans: Vec::new(), lost: None, was_lost: false })
    }

    fn ask(&mut self, query: &Query, input: &[f64], output: &mut [f64]) -> Reply {
        // each look for a lost server takes a second: the lines between two looks are answered at
        // once
        if let Some((since, status, words)) = &self.lost
            && since.elapsed() < PAUSE
        {
            return Reply::failed(*status, words.clone());
        }
        let error = match self.plan(query).and_then(|plan| self.robot.ask(plan, input, output)) {
            Ok(answer) => {
                self.lost = None;
                return Reply { answer, words: None };
            }
            Err(error) => error,
        };
        let words = error.to_string();
        let status = match error {
            Error::Query(_) | Error::TooLarge { .. } => {
                return Reply::failed(Status::BadRequest, words);
            }
            Error::TooManyPlans { .. } => return Reply::failed(Status::Overloaded, words),
            Error::NoAnswer { .. } => Status::Overloaded,
            Error::Connect(ConnectError::WrongModel { .. }) => Status::WrongModel,
            _ => Status::ShuttingDown,
        };
        if self.lost.is_none() {
            eprintln!("sarrus ask: {words}");
        }
        self.was_lost = true;
        self.lost = Some((Instant::now(), status, words.clone()));
        Reply::failed(status, words)
    }
}

impl There {
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
