//! A robot under way: the right-hand side with the last accepted state, from which closures
//! continue.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Answer, Compiled, Field, Model, PlanScalar, Status, Warnings};

use crate::coordinates::largest;
use crate::error::Outcome;
use crate::forces::inputs::OnTree;
use crate::forces::springs::{Effect, Springs};
use crate::motion::rates::{Effects, Mechanism, Rates};

/// Farthest that a coordinate of the guess is taken along the tangent `[rad, m]`.
const REACH: f64 = 0.5;

/// Share of the fastest joint's distance in a step by which a smooth motion is not off the mean of
/// its velocities.
const JUMP: f64 = 0.3;

/// Step of a difference quotient as a share of a coordinate or of the floor: √ε.
const STEP: f64 = 1.5e-8;

/// Least size of a coordinate for its step `[rad, m, rad/s, m/s]`.
const STEP_FLOOR: f64 = 0.1;

/// Counts of evaluations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Accepted steps.
    pub steps: u64,
    /// Steps that were taken back because the error was too large or Newton's method did not
    /// converge.
    pub rejected: u64,
    /// Steps that were taken back because the right-hand side had no answer.
    pub failed: u64,
    /// Evaluations of the right-hand side.
    pub evaluations: u64,
    /// Evaluations in double-double, near a singularity.
    pub precise: u64,
    /// Jacobians of the right-hand side.
    pub jacobians: u64,
    /// Factorisations of the matrices of an implicit method.
    pub factorisations: u64,
}

/// The right-hand side of one robot with one set of independents.
pub(crate) struct Engine {
    pub(crate) description: Description,
    pub(crate) compiled: Compiled,
    pub(crate) mechanism: Mechanism,
    rates: Rates<f64>,
    precise: Option<Box<Precise>>,
    pub(crate) anchor: Anchor,
    guess: Vec<f64>,
    /// Offset from the anchor, in ẏ and in q̇.
    offset: (Vec<f64>, Vec<f64>),
    pub(crate) counts: Counts,
    /// Where double precision would lose digits, double-double is used; and it is known to be here.
    pub(crate) may_be_precise: bool,
    pub(crate) is_delicate: bool,
    /// Why the last evaluation that failed did, until it is taken; and for ever.
    failure: Option<Status>,
    pub(crate) last_failure: Option<Status>,
}

/// The last accepted state.
#[derive(Clone, Debug)]
pub(crate) struct Anchor {
    pub(crate) t: f64,
    pub(crate) y: Vec<f64>,
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) G: Vec<f64>,
    /// ẋ there.
    pub(crate) rate: Vec<f64>,
    /// The springs' forces at this state.
    pub(crate) springs: Effect<f64>,
}

/// The right-hand side in double-double, with its numbers.
struct Precise {
    rates: Rates<Dd>,
    x: Vec<Dd>,
    rate: Vec<Dd>,
    q: Vec<Dd>,
    qd: Vec<Dd>,
}

impl Precise {
    fn new(model: Model<Dd>, mechanism: &Mechanism) -> Outcome<Precise> {
        let zero = |n: usize| vec![Dd::ZERO; n];
        let (x, q, qd) =
            (zero(mechanism.n()), zero(mechanism.sizes.n_q), zero(mechanism.sizes.n_v));
        Ok(Precise { rates: Rates::new(model, mechanism)?, rate: x.clone(), x, q, qd })
    }

    fn evaluate(&mut self, mechanism: &Mechanism, t: f64) -> Answer {
        self.rates.evaluate(mechanism, t, &self.x, (&self.q, &self.qd), &mut self.rate)
    }

    /// Takes over a state and a guess as constants.
    fn set(&mut self, x: &[f64], q: &[f64], qd: &[f64]) {
        for (to, from) in [(&mut self.x, x), (&mut self.q, q), (&mut self.qd, qd)] {
            to.iter_mut().zip(from).for_each(|(to, x)| *to = Dd::from_f64(*x));
        }
    }
}

impl Engine {
    /// A robot whose closures start from a pose at t = 0.
    pub(crate) fn new(
        (description, compiled): (Description, Compiled),
        springs: Springs,
        inputs: Vec<OnTree>,
        effects: Effects,
        q: &[f64],
    ) -> Outcome<Engine> {
        let model = &compiled.model;
        let mechanism = Mechanism::new(model, &description, springs, inputs, effects);
        let rates = Rates::new(model.clone(), &mechanism)?;
        let zero = |n: usize| vec![0.0; n];
        let n_v = mechanism.sizes.n_v;
        let n_vy = mechanism.sizes.n_vy;
        let G = zero(if mechanism.follows_G() { n_v * n_vy } else { 0 });
        let anchor = Anchor {
            t: 0.0,
            y: mechanism.y.zero(),
            q: q.to_vec(),
            qd: zero(n_v),
            G,
            rate: zero(mechanism.n()),
            springs: rates.effect(),
        };
        Ok(Engine {
            description,
            compiled,
            mechanism,
            rates,
            precise: None,
            anchor,
            guess: q.to_vec(),
            offset: (zero(n_vy), zero(n_v)),
            counts: Counts::default(),
            may_be_precise: true,
            is_delicate: false,
            failure: None,
            last_failure: None,
        })
    }

    /// ẋ at t and x; NaN, and noted, where it has no answer.
    pub(crate) fn rate(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Result<(), Status> {
        self.evaluate(t, x, rate).map(|_| ())
    }

    /// As above, with whether it was computed in double-double.
    fn evaluate(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Result<bool, Status> {
        self.counts.evaluations += 1;
        if !x.iter().all(|x| x.is_finite()) {
            rate.fill(f64::NAN);
            return self.note(Status::NonFiniteInput);
        }
        self.extrapolate(t, x);
        if !(self.may_be_precise && self.is_delicate) {
            let answer =
                self.rates.evaluate(&self.mechanism, t, x, (&self.guess, &self.anchor.qd), rate);
            let fine = answer.status == Status::Ok
                && !(self.may_be_precise && answer.warnings.contains(Warnings::ILL_CONDITIONED));
            if fine || answer.status == Status::NonFiniteInput {
                return self.note(answer.status);
            }
        }
        if self.may_be_precise && self.evaluate_precisely(t, x, rate) == Status::Ok {
            return Ok(true);
        }
        // a tangent may lead astray; the accepted pose itself does not
        let answer =
            self.rates.evaluate(&self.mechanism, t, x, (&self.anchor.q, &self.anchor.qd), rate);
        self.note(answer.status)
    }

    fn evaluate_precisely(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Status {
        self.counts.precise += 1;
        if self.precise.is_none() {
            // a query that can be planned over doubles can be planned over any scalar
            let Ok(precise) = Precise::new(self.compiled.exact.clone(), &self.mechanism) else {
                return Status::BadRequest;
            };
            self.precise = Some(Box::new(precise));
        }
        let Some(precise) = &mut self.precise else { return Status::BadRequest };
        precise.set(x, &self.guess, &self.anchor.qd);
        let status = precise.evaluate(&self.mechanism, t).status;
        rate.iter_mut().zip(&precise.rate).for_each(|(to, x)| *to = x.to_f64());
        status
    }

    /// The end of an evaluation in doubles: notes a failure.
    fn note(&mut self, status: Status) -> Result<bool, Status> {
        if status == Status::Ok {
            return Ok(false);
        }
        (self.failure, self.last_failure) = (Some(status), Some(status));
        Err(status)
    }

    /// Why an evaluation failed since this was last asked.
    pub(crate) fn take_failure(&mut self) -> Option<Status> {
        self.failure.take()
    }

    /// Accepts a state: quaternions to unit length, ẋ, q and q̇ there; nothing changes where it has
    /// no answer.
    pub(crate) fn settle(&mut self, t: f64, x: &mut [f64]) -> Result<(), Status> {
        let n_qy = self.mechanism.sizes.n_qy;
        let mut settled = x.to_vec();
        self.mechanism.y.normalise(&mut settled[..n_qy]);
        let mut rate = vec![0.0; x.len()];
        let precisely = self.evaluate(t, &settled, &mut rate)?;
        x.copy_from_slice(&settled);
        let anchor = &mut self.anchor;
        (anchor.t, anchor.rate) = (t, rate);
        anchor.y.copy_from_slice(&x[..n_qy]);
        match &self.precise {
            Some(precise) if precisely => anchor.take(&precise.rates),
            _ => anchor.take(&self.rates),
        }
        Ok(())
    }

    /// Accepts `next` as the new state x at t; x stays where it has no answer.
    pub(crate) fn accept(&mut self, t: f64, next: &mut [f64], x: &mut [f64]) -> Result<(), Status> {
        self.settle(t, next)?;
        x.copy_from_slice(next);
        Ok(())
    }

    /// ∂ẋ/∂x at t and x, row by row, by forward differences: an iteration matrix needs no more.
    pub(crate) fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        jacobian: &mut [f64],
    ) -> Result<(), Status> {
        self.counts.jacobians += 1;
        let n = x.len();
        let (mut at, mut rate, mut moved) = (x.to_vec(), vec![0.0; n], vec![0.0; n]);
        self.rate(t, x, &mut rate)?;
        for j in 0..n {
            at[j] += STEP * x[j].abs().max(STEP_FLOOR);
            let step = at[j] - x[j];
            self.rate(t, &at, &mut moved)?;
            at[j] = x[j];
            (0..n).for_each(|i| jacobian[i * n + j] = (moved[i] - rate[i]) / step);
        }
        Ok(())
    }

    /// The guess: the accepted pose moved along its tangent to the independents of x, or by the
    /// time where the robot is too large for that.
    fn extrapolate(&mut self, t: f64, x: &[f64]) {
        let Anchor { t: from, y, q, qd, G, .. } = &self.anchor;
        self.guess.copy_from_slice(q);
        if self.mechanism.sizes.n_c == 0 {
            return;
        }
        let dy = &mut self.offset.0;
        let dq = &mut self.offset.1;
        if self.mechanism.follows_G() {
            self.mechanism.y.difference(y, &x[..y.len()], dy);
            dq.iter_mut()
                .zip(G.chunks_exact(dy.len().max(1)))
                .for_each(|(to, row)| *to = row.iter().zip(&*dy).map(|(g, y)| g * y).sum());
        } else {
            dq.iter_mut().zip(qd).for_each(|(to, v)| *to = (t - from) * v);
        }
        let farthest = largest(dq.iter().copied());
        let part = if farthest > REACH { REACH / farthest } else { 1.0 };
        self.mechanism.q.advance(&mut self.guess, dq, part);
    }
}

impl Engine {
    /// True where the tree's motion contradicts its velocities: it turned back or took another
    /// branch at a singularity within the step.
    pub(crate) fn jumped(&self, before: &Anchor) -> bool {
        let Anchor { t, q, qd, .. } = &self.anchor;
        let h = t - before.t;
        let mut moved = vec![0.0; qd.len()];
        self.mechanism.q.difference(&before.q, q, &mut moved);
        let fastest = largest(qd.iter().chain(&before.qd).copied());
        let expected = before.qd.iter().zip(qd).map(|(a, b)| 0.5 * h * (a + b));
        let off = largest(moved.iter().zip(expected).map(|(a, b)| a - b));
        off > JUMP * h * fastest
    }
}

impl Anchor {
    fn take<T: PlanScalar>(&mut self, from: &Rates<T>) {
        for (to, field) in
            [(&mut self.q, Field::Q), (&mut self.qd, Field::Qd), (&mut self.G, Field::G)]
        {
            to.iter_mut().zip(from.get(field)).for_each(|(to, x)| *to = x.to_f64());
        }
        let Effect { energy, loss } = from.effect();
        self.springs = Effect { energy: energy.to_f64(), loss: loss.to_f64() };
    }
}
