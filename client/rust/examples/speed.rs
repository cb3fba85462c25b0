//! Cost of inverse dynamics in Rust, compared with Python: `client/python/examples/speed.py` starts
//! this and both take turns.
//!
//! A line `ROBOT call N` or `ROBOT rows N THREADS` on stdin asks for N calls of one state, or for N
//! states as rows of a batch; a line on stdout has the nanoseconds of all of them.

use std::collections::HashMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::num::NonZero;
use std::time::{Duration, Instant};

use sarrus_client::{Answer, Options, PlanId, Request, Robot, Source, Status, Warnings};

/// A robot and its arrays for rows, which are made once.
struct Subject {
    robot: Robot,
    plan: PlanId,
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl Subject {
    fn load(name: &str) -> Result<Subject, Box<dyn Error>> {
        let mut robot = Robot::load(&Source::Bundled(name.into()), &Options::default())?;
        let query = robot.query(Request::InverseDynamics);
        let plan = query.given(["y", "yd", "ydd"]).want(["tau_u"]).prepare()?;
        Ok(Subject { robot, plan, input: Vec::new(), output: Vec::new(), answers: Vec::new() })
    }

    /// Answers one state so often.
    fn calls(&mut self, n: usize) -> Result<Duration, Box<dyn Error>> {
        let model = self.robot.model();
        let given = vec![0.05; model.independent.len()];
        let mut tau_u = vec![0.0; model.active.len()];
        let begin = Instant::now();
        for _ in 0..n {
            self.robot.inverse_dynamics(&given, &given, &given, &mut tau_u)?;
        }
        Ok(begin.elapsed())
    }

    /// Answers so many rows at once.
    fn rows(&mut self, n: usize, threads: NonZero<usize>) -> Result<Duration, Box<dyn Error>> {
        let model = self.robot.model();
        self.input.resize(3 * n * model.independent.len(), 0.05);
        self.output.resize(n * model.active.len(), 0.0);
        let none = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        self.answers.resize(n, none);
        let begin = Instant::now();
        let Subject { robot, plan, input, output, answers } = self;
        robot.batch(*plan, threads, input, output, answers)?;
        let taken = begin.elapsed();
        match answers.iter().find(|answer| answer.status != Status::Ok) {
            Some(answer) => Err(answer.status.name().into()),
            None => Ok(taken),
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut subjects = HashMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let name = *words.first().ok_or("expected the name of a robot")?;
        if !subjects.contains_key(name) {
            subjects.insert(name.to_owned(), Subject::load(name)?);
        }
        let Some(subject) = subjects.get_mut(name) else { continue };
        let taken = match words[1..] {
            ["call", n] => subject.calls(n.parse()?)?,
            ["rows", n, threads] => subject.rows(n.parse()?, threads.parse()?)?,
            _ => return Err("expected lines `ROBOT call N` or `ROBOT rows N THREADS`".into()),
        };
        println!("{}", taken.as_nanos());
        std::io::stdout().flush()?;
    }
    Ok(())
}
