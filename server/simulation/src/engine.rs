//! A robot under way: the right-hand side with the last accepted state, from which closures continue.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::Dual;
use sarrus_dynamics::{Field, FieldSet, Model, Request, Status, Wanted, Workspace};


use crate::asked::Asked;
use crate::error::SimulationError;
use crate::input::OnTree;
use crate::rates::{Mechanism, Rates};
use crate::springs::{Effect, Springs};

/// Farthest that a coordinate of the guess is taken along the tangent `[rad, m]`.
const REACH: f64 = 0.5;

/// What was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Accepted steps.
    pub steps: u64,
    /// Steps that were taken back because the error was too large or Newton's method did not converge.
    pub rejected: u64,
    /// Steps that were taken back because the right-hand side had no answer.
    pub failed: u64,
    /// Evaluations of the right-hand side.
    pub evaluations: u64,
    /// Jacobians of it.
    pub jacobians: u64,
    /// Factorisations of the matrices of an implicit method.
    pub factorisations: u64,
}

/// The right-hand side of one robot with one set of independents.
pub(crate) struct Engine {
    pub(crate) description: Description,
    pub(crate) model: Model<f64>,
    pub(crate) mechanism: Mechanism,
    rates: Rates<f64>,
    duals: Option<Box<Tangent>>,
    pub(crate) anchor: Anchor,
    guess: Vec<f64>,
    pub(crate) counts: Counts,
    /// Why the last evaluation that failed did, until it is taken.
    failure: Option<Status>,
    /// The last of them.
    pub(crate) last_failure: Option<Status>,
}

/// The last accepted state.
#[derive(Clone, Debug)]
pub(crate) struct Anchor {
    pub(crate) t: f64,
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    /// ẋ there.
    pub(crate) rate: Vec<f64>,
    /// What the springs did there.
    pub(crate) springs: Effect<f64>,
}

/// The right-hand side over duals.
struct Tangent {
    rates: Rates<Dual<f64>>,
    x: Vec<Dual<f64>>,
    rate: Vec<Dual<f64>>,
    q: Vec<Dual<f64>>,
    qd: Vec<Dual<f64>>,
}

impl Engine {
    /// A robot whose closures start from a pose at t = 0.
    pub(crate) fn new(
        (description, model): (Description, Model<f64>),
        springs: Springs,
        inputs: Vec<OnTree>,
        q: Option<&[f64]>,
    ) -> Result<Engine, SimulationError> {
        let mechanism = Mechanism::new(&model, &description, springs, inputs);
        let rates = Rates::new(model.clone(), &mechanism)?;
        let q = q.map_or_else(|| mechanism.q.zero(), <[f64]>::to_vec);
        let (guess, qd, rate) = (q.clone(), vec![0.0; mechanism.sizes.n_v], vec![0.0; mechanism.n()]);
        let anchor = Anchor { t: 0.0, q, qd, rate, springs: rates.effect() };
        Ok(Engine { description, model, mechanism, rates, duals: None, anchor, guess, counts: Counts::default(), failure: None, last_failure: None })
    }

    /// ẋ at t and x; NaN, and noted, where it has no answer.
    pub(crate) fn rate(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Status {
        self.extrapolate(t);
        self.counts.evaluations += 1;
        let mut status = self.rates.evaluate(&self.mechanism, t, x, (&self.guess, &self.anchor.qd), rate);
        // a tangent may lead astray; the accepted pose itself does not
        if status != Status::Ok && status != Status::NonFiniteInput && self.guess != self.anchor.q {
            self.counts.evaluations += 1;
            status = self.rates.evaluate(&self.mechanism, t, x, (&self.anchor.q, &self.anchor.qd), rate);
        }
        if status != Status::Ok {
            (self.failure, self.last_failure) = (Some(status), Some(status));
        }
        status
    }

    /// Why an evaluation failed since this was last asked.
    pub(crate) fn take_failure(&mut self) -> Option<Status> {
        self.failure.take()
    }

    /// The first state of all where no closed pose is known: closures start from their own zero.
    pub(crate) fn settle_from_zero(&mut self, x: &mut [f64]) -> Result<Status, SimulationError> {
        let mut asked = Asked::new(&self.model, &Wanted::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q])))?;
        asked.give(Field::Y, &x[..self.mechanism.sizes.n_qy]);
        let status = asked.run(&self.model, &mut Workspace::for_plans(&self.model, [asked.plan()]));
        if status != Status::Ok {
            return Ok(status);
        }
        self.anchor.q.copy_from_slice(asked.get(Field::Q));
        Ok(self.settle(0.0, x))
    }

    /// Accepts a state: quaternions to unit length, ẋ, q and q̇ there; nothing changes where it has no answer.
    pub(crate) fn settle(&mut self, t: f64, x: &mut [f64]) -> Status {
        let n_qy = self.mechanism.sizes.n_qy;
        let mut rate = std::mem::take(&mut self.anchor.rate);
        let mut settled = x.to_vec();
        self.mechanism.y.normalise(&mut settled[..n_qy]);
        let mut next = rate.clone();
        let status = self.rate(t, &settled, &mut next);
        if status == Status::Ok {
            x.copy_from_slice(&settled);
            rate.copy_from_slice(&next);
            let (q, qd) = self.rates.tree();
            self.anchor.q.copy_from_slice(q);
            self.anchor.qd.copy_from_slice(qd);
            self.anchor.t = t;
            self.anchor.springs = self.rates.effect();
        }
        self.anchor.rate = rate;
        status
    }

    /// ∂ẋ/∂x at t and x, row by row, by dual numbers: one evaluation for each column.
    pub(crate) fn jacobian(&mut self, t: f64, x: &[f64], jacobian: &mut [f64]) -> Status {
        self.extrapolate(t);
        self.counts.jacobians += 1;
        let n = x.len();
        if self.duals.is_none() {
            // what could be planned over doubles can be over duals
            let Ok(rates) = Rates::new(self.model.convert(Dual::constant), &self.mechanism) else { return Status::BadRequest };
            let zero = |n: usize| vec![Dual::constant(0.0); n];
            let (q, qd) = (zero(self.mechanism.sizes.n_q), zero(self.mechanism.sizes.n_v));
            self.duals = Some(Box::new(Tangent { rates, x: zero(n), rate: zero(n), q, qd }));
        }
        let Some(tangent) = &mut self.duals else { return Status::BadRequest };
        let constant = |from: &[f64], to: &mut [Dual<f64>]| to.iter_mut().zip(from).for_each(|(to, x)| *to = Dual::constant(*x));
        constant(&self.guess, &mut tangent.q);
        constant(&self.anchor.qd, &mut tangent.qd);
        for j in 0..n {
            constant(x, &mut tangent.x);
            tangent.x[j].du = 1.0;
            let status = tangent.rates.evaluate(&self.mechanism, t, &tangent.x, (&tangent.q, &tangent.qd), &mut tangent.rate);
            if status != Status::Ok {
                (self.failure, self.last_failure) = (Some(status), Some(status));
                return status;
            }
            (0..n).for_each(|i| jacobian[i * n + j] = tangent.rate[i].du);
        }
        Status::Ok
    }

    /// The guess at a time: the accepted pose moved along its velocity.
    fn extrapolate(&mut self, t: f64) {
        let Anchor { t: from, q, qd, .. } = &self.anchor;
        self.guess.copy_from_slice(q);
        let fastest = qd.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let mut ahead = t - from;
        if fastest * ahead.abs() > REACH {
            ahead = ahead.signum() * REACH / fastest;
        }
        if ahead != 0.0 {
            self.mechanism.q.advance(&mut self.guess, qd, ahead);
        }
    }
}
