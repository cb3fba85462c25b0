//! For comparison: all tree coordinates with the loops as constraints, by Runge and Kutta's method
//! with a fixed step.
//!
//! Baumgarte's stabilisation pulls the loops together while they drift apart; projection closes
//! them after each step. Springs between links are stretched as at the closed pose with the same
//! independents.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Field, FieldSet, ImplicitForm, Model, Planned, Query, Request, Status};

use crate::error::{Outcome, answered};
use crate::forces::inputs::OnTree;
use crate::forces::springs::Springs;
use crate::methods::runge_kutta::four_stages;
use crate::motion::rates::{Effects, Mechanism};

/// The right-hand side in x = [q; q̇; work].
pub(crate) struct Form<'a> {
    model: &'a Model<f64>,
    pub(crate) mechanism: Mechanism,
    pub(crate) form: ImplicitForm<f64>,
    /// Frames of the links that springs join.
    frames: Option<Planned<f64>>,
    tau_q: Vec<f64>,
    wrenches: Vec<f64>,
    /// Energy of the springs between links.
    pub(crate) stretched: f64,
    rate: f64,
}

impl<'a> Form<'a> {
    /// `rate` is α = β of Baumgarte's stabilisation.
    pub(crate) fn new(
        model: &'a Model<f64>,
        description: &Description,
        springs: Springs,
        inputs: Vec<OnTree>,
        rate: f64,
    ) -> Outcome<Form<'a>> {
        let mechanism = Mechanism::new(model, description, springs, inputs, Effects::default());
        let links = mechanism.springs.links.clone();
        let frames = if links.is_empty() {
            None
        } else {
            let given = FieldSet::of(&[Field::Q, Field::Qd]);
            let want = FieldSet::of(&[Field::FramePose, Field::FrameTwist]);
            let query = Query::new(Request::Kinematics, given, want).with_frames(&links);
            Some(Planned::new(model, &query)?)
        };
        Ok(Form {
            form: ImplicitForm::with_wrenches(model, &links),
            frames,
            tau_q: vec![0.0; mechanism.sizes.n_v],
            wrenches: vec![0.0; 6 * links.len()],
            stretched: 0.0,
            mechanism,
            model,
            rate,
        })
    }

    /// ẋ at t and x.
    pub(crate) fn evaluate(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Result<(), Status> {
        let n_q = self.mechanism.sizes.n_q;
        let n_v = self.mechanism.sizes.n_v;
        if !x.iter().all(|x| x.is_finite()) {
            return Err(Status::NonFiniteInput);
        }
        let mut unit = x[..n_q].to_vec();
        self.mechanism.q.normalise(&mut unit);
        let qd = &x[n_q..n_q + n_v];
        let mut loss = 0.0;
        if let Some(frames) = &mut self.frames {
            frames.give(Field::Q, &unit);
            frames.give(Field::Qd, qd);
            answered(frames.run(self.model).status)?;
            let poses = frames.get(Field::FramePose);
            let twists = frames.get(Field::FrameTwist);
            let effect = self.mechanism.springs.wrenches(poses, twists, &mut self.wrenches);
            (self.stretched, loss) = (effect.energy, effect.loss);
        }
        self.tau_q.fill(0.0);
        self.mechanism.inputs.iter().for_each(|input| input.add(t, &unit, qd, &mut self.tau_q));
        self.mechanism.q.rate(&x[..n_q], &unit, qd, &mut rate[..n_q]);
        let rates = (self.rate, self.rate);
        let status = self.form.accelerations(
            self.model,
            &unit,
            qd,
            &self.tau_q,
            &self.wrenches,
            rates,
            &mut rate[n_q..n_q + n_v],
        );
        if let Some(work) = rate.get_mut(n_q + n_v) {
            *work = self.mechanism.power(qd, &self.tau_q, loss);
        }
        answered(status)
    }

    /// One step, `projected` onto the closed states at its end; x is that before it where it has no
    /// answer.
    pub(crate) fn step(
        &mut self,
        t: f64,
        to: f64,
        x: &mut Vec<f64>,
        projected: bool,
    ) -> Result<(), Status> {
        let n_q = self.mechanism.sizes.n_q;
        let n_v = self.mechanism.sizes.n_v;
        let mut first = vec![0.0; x.len()];
        self.evaluate(t, x, &mut first)?;
        let rate = |at, x: &[f64], rate: &mut [f64]| self.evaluate(t + at, x, rate);
        let mut next = four_stages(x, to - t, first, rate)?;
        if !next.iter().all(|x| x.is_finite()) {
            return Err(Status::NonFiniteInput);
        }
        self.mechanism.q.normalise(&mut next[..n_q]);
        if projected {
            let (q, rest) = next.split_at_mut(n_q);
            answered(self.form.project(self.model, q, &mut rest[..n_v]))?;
        }
        *x = next;
        Ok(())
    }
}
