//! What inverse dynamics cost in Rust, beside Python: `client/python/examples/speed.py` starts this
//! and both take turns.
//!
//! A line `ROBOT call N` or `ROBOT rows N` on stdin asks for N calls of one state, or for N states
//! that lie in arrays; a line on stdout has the nanoseconds of all of them.

use std::collections::HashMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use sarrus_client::{Options, Robot, Source};

/// A robot and its arrays, the numbers of one state after those of the other.
struct Subject {
    robot: Robot,
    given: [Vec<f64>; 3],
    tau_u: Vec<f64>,
}

impl Subject {
    fn load(name: &str) -> Result<Subject, Box<dyn Error>> {
        let robot = Robot::load(&Source::Bundled(name.into()), &Options::default())?;
        Ok(Subject { robot, given: [const { Vec::new() }; 3], tau_u: Vec::new() })
    }

    /// Makes the arrays so long, which is not measured.
    fn resize(&mut self, rows: usize) {
        let (n_y, n_u) = (self.robot.model().independent.len(), self.robot.model().active.len());
        self.given.iter_mut().for_each(|array| array.resize(rows * n_y, 0.05));
        self.tau_u.resize(rows * n_u, 0.0);
    }

    /// Answers `calls` times `rows` states.
    fn run(&mut self, calls: usize, rows: usize) -> Result<(), Box<dyn Error>> {
        let (n_y, n_u) = (self.given[0].len() / rows, self.tau_u.len() / rows);
        let [y, yd, ydd] = &self.given;
        for _ in 0..calls {
            for row in 0..rows {
                let state = row * n_y..(row + 1) * n_y;
                self.robot.inverse_dynamics(
                    &y[state.clone()],
                    &yd[state.clone()],
                    &ydd[state],
                    &mut self.tau_u[row * n_u..(row + 1) * n_u],
                )?;
            }
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut subjects = HashMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (name, calls, rows) = match line.split_whitespace().collect::<Vec<_>>()[..] {
            [name, "call", n] => (name.to_owned(), n.parse()?, 1),
            [name, "rows", n] => (name.to_owned(), 1, n.parse()?),
            _ => return Err("expected lines `ROBOT call N` or `ROBOT rows N`".into()),
        };
        if !subjects.contains_key(&name) {
            subjects.insert(name.clone(), Subject::load(&name)?);
        }
        let Some(subject) = subjects.get_mut(&name) else { continue };
        subject.resize(rows);
        let begin = Instant::now();
        subject.run(calls, rows)?;
        println!("{}", begin.elapsed().as_nanos());
        std::io::stdout().flush()?;
    }
    Ok(())
}
