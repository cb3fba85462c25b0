//! Families as data: their names, parameters, robots and values.

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};

use super::harness::{At, Cases, Robot, bundled, heavier, numerical, seeds};
use super::mechanisms::{four_bar, rods};
use crate::Outcome;
use crate::measure::Effort;

/// A family of cases: its name, and the source of its cases.
pub(crate) struct Family(pub(crate) &'static str, pub(crate) Fill);

/// The source of a family's cases.
pub(crate) enum Fill {
    /// Robots at values of the parameter.
    Swept(&'static Sweep),
    /// By one function from seeds: those below the first number in a quick report, below the second
    /// in a full one, and these in both.
    Drawn([u64; 2], &'static [u64], fn(&mut Cases, u64) -> Outcome),
    /// Robots under a change.
    Changed(fn(&mut Cases, &Effort, Change) -> Outcome, Change),
    /// By a separate function.
    Own(fn(&mut Cases, &Effort) -> Outcome),
}

/// Robots, values of a parameter, and the questions at each.
#[derive(Clone, Copy)]
pub(crate) struct Sweep {
    pub(crate) values: fn(&Effort) -> Vec<f64>,
    pub(crate) robots: &'static [Subject],
    pub(crate) ask: Ask,
}

/// Asks a robot at a value of the parameter.
pub(crate) type Ask = fn(&mut Cases, &Robot, f64) -> Outcome;

/// A robot of a sweep.
#[derive(Clone, Copy)]
pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) design: Design,
    pub(crate) change: Change,
}

/// The source of a description.
#[derive(Clone, Copy)]
pub(crate) enum Design {
    Bundled(&'static str),
    /// A bundled robot with every loop closed by Newton's method.
    Numerical(&'static str),
    /// Its points, its kind and the rows of its cut.
    FourBar([[f64; 2]; 4], Kind, &'static str),
    Rods(usize),
    Made(fn() -> Outcome<Description>),
}

/// The effect of the parameter's value on a description.
#[derive(Clone, Copy)]
pub(crate) enum Change {
    /// None: it changes the state or the question.
    Nothing,
    /// It multiplies mass and inertia of the links whose names end with this.
    Masses(&'static [&'static str]),
    By(fn(&mut Description, f64)),
}

impl Family {
    /// Adds the family's cases.
    pub(crate) fn run(&self, cases: &mut Cases, effort: &Effort) -> Outcome {
        let Family(name, fill) = self;
        let mut rows = include_str!("families.tsv").lines().filter_map(|row| row.split_once('\t'));
        let (_, parameter) = rows.find(|(of, _)| of == name).ok_or("a family without parameter")?;
        cases.family(name, parameter);
        match fill {
            Fill::Swept(Sweep { values, robots, ask }) => {
                let values = values(effort);
                robots.iter().try_for_each(|subject| subject.ask(cases, &values, *ask))
            }
            Fill::Drawn(counts, also, one) => {
                seeds(effort, *counts, also).into_iter().try_for_each(|seed| one(cases, seed))
            }
            Fill::Changed(run, change) => run(cases, effort, *change),
            Fill::Own(run) => run(cases, effort),
        }
    }
}

impl Subject {
    pub(crate) const fn new(name: &'static str, design: Design, change: Change) -> Subject {
        Subject { name, design, change }
    }

    /// A robot that does not depend on the value.
    pub(crate) const fn plain(name: &'static str, design: Design) -> Subject {
        Subject::new(name, design, Change::Nothing)
    }

    /// The unchanged robot.
    pub(crate) fn robot(&self) -> Outcome<Robot> {
        Robot::new(self.name, self.design.description()?)
    }

    /// Asks the robot at each value; a robot refused at a value is a separate case.
    pub(crate) fn ask(&self, cases: &mut Cases, values: &[f64], ask: Ask) -> Outcome {
        if let Change::Nothing = self.change {
            let robot = self.robot()?;
            return values.iter().try_for_each(|value| ask(cases, &robot, *value));
        }
        let plain = self.design.description()?;
        for &value in values {
            let mut of = plain.clone();
            self.change.apply(&mut of, value);
            let at = At { value, method: "-" };
            if let Some(robot) = cases.load(self.name, at, of) {
                ask(cases, &robot, value)?;
            }
        }
        Ok(())
    }
}

impl Design {
    pub(crate) fn description(self) -> Outcome<Description> {
        match self {
            Design::Bundled(name) => bundled(name),
            Design::Numerical(name) => Ok(numerical(bundled(name)?)),
            Design::FourBar(points, kind, rows) => four_bar(points, kind, rows),
            Design::Rods(n) => rods(n),
            Design::Made(make) => make(),
        }
    }
}

impl Change {
    fn apply(self, of: &mut Description, value: f64) {
        match self {
            Change::Nothing => {}
            Change::Masses(ends) => {
                heavier(of, &|link| ends.iter().any(|end| link.ends_with(end)), value);
            }
            Change::By(change) => change(of, value),
        }
    }
}
