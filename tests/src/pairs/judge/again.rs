//! Answers are asked for again: from q, from a guess, from u, in a batch and from the nearest y.

use std::f64::consts::TAU;

use sarrus_dynamics::description::{Joint, JointKind};
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{
    Answer, Batch, Field, FieldSet, Plan, Query, QueryOptions, Request, Status, Warnings, Workspace,
};

use super::{Asked, Judge, Ledger};
use crate::seed::Seeded;
use Field::{FramePose, Limits, NearestY, Q, QGuess, Qd, Qdd, TauY, U, Y, Yd, Ydd};

impl Judge<'_> {
    /// A given q with other turns keeps them.
    pub(super) fn given_q(
        &self,
        asked: &Asked,
        units: &[f64],
        seeded: &mut Seeded,
        ledger: &mut Ledger,
    ) {
        let model = self.model;
        let independent = model.independent_names();
        let coupled = |name: &String| {
            self.of.joints.iter().any(|joint| {
                joint.coupling.as_ref().is_some_and(|coupling| {
                    joint.name == *name
                        || coupling.terms.iter().any(|(k, _)| self.of.joints[*k].name == *name)
                        || coupling.curves.iter().any(|(k, _)| self.of.joints[*k].name == *name)
                })
            })
        };
        let mut q = asked.get(Q).to_vec();
        for (k, name) in model.tree_q_names().iter().enumerate() {
            let dependent = !independent.contains(name) && !coupled(name);
            let turns = |joint: &Joint| joint.name == *name && joint.kind == JointKind::Revolute;
            if dependent && self.of.joints.iter().any(turns) && seeded.chance(0.5) {
                q[k] += TAU * (seeded.below(7) as f64 - 3.0);
            }
        }
        let qd = asked.get(Qd).to_vec();
        let qdd = asked.get(Qdd).to_vec();
        let given: [(Field, &[f64]); 3] = [(Q, &q), (Qd, &qd), (Qdd, &qdd)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Q, Qd, Qdd], &[]) else {
            return;
        };
        ledger.count(&format!("given q: {}", again.answer.status.name()));
        if !again.ok() {
            if !asked.warned(Warnings::ILL_CONDITIONED) {
                ledger.refused.push(format!(
                    "{}, {}: {}: given q: {}",
                    self.pair,
                    self.seed,
                    self.drawn.name,
                    again.answer.status.name()
                ));
            }
            return;
        }
        let exact: Vec<Dd> = q.iter().map(|x| Dd::from(*x)).collect();
        if asked.warned(Warnings::ILL_CONDITIONED) {
            return;
        }
        self.compare(ledger, &again, "q given", again.get(Q), &exact, units, 1.0);

        // and so does a guess
        let y: Vec<f64> = model
            .independent_q_names()
            .iter()
            .filter_map(|name| Some(q[model.tree_q_names().iter().position(|x| x == name)?]))
            .collect();
        let given: [(Field, &[f64]); 2] = [(Y, &y), (QGuess, &q)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Q], &[]) else { return };
        ledger.count(&format!("guess: {}", again.answer.status.name()));
        if again.ok() {
            self.compare(ledger, &again, "q from a guess", again.get(Q), &exact, units, 1.0);
        } else {
            ledger.refused.push(format!(
                "{}, {}: {}: guess: {}",
                self.pair,
                self.seed,
                self.drawn.name,
                again.answer.status.name()
            ));
        }
    }

    /// States side by side have the bits of one alone.
    pub(super) fn abreast(&self, motion: &[(Field, &[f64]); 3], ledger: &mut Ledger) {
        const ROWS: usize = 5;
        let want = [Q, Qd, Qdd, TauY, Limits, FramePose];
        let query =
            Query::new(Request::InverseDynamics, FieldSet::of(&[Y, Yd, Ydd]), FieldSet::of(&want));
        let query = query.with_options(QueryOptions::SEARCH).with_frames(&[0]);
        let Ok(plan) = Plan::new(self.model, &query) else { return };
        let mut batch = Batch::new(&self.shared, &plan);
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let mut input = vec![0.0; ROWS * n_in];
        for (row, input) in input.chunks_mut(n_in.max(1)).enumerate() {
            let part = 1.0 - 0.2 * row as f64;
            for (field, numbers) in motion {
                let Some(slot) = plan.given().slot(*field) else { return };
                // the quaternions of all rows are those of the state
                let part = if *field == Y && self.has_quaternions() { 1.0 } else { part };
                input[slot.range()].iter_mut().zip(*numbers).for_each(|(to, x)| *to = part * x);
            }
        }
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut output = vec![0.0; ROWS * n_out];
        let mut answers = [unknown; ROWS];
        batch.run(&input, &mut output, &mut answers);
        let mut workspace = Workspace::for_plans(self.model, [&plan]);
        let mut alone = vec![0.0; n_out];
        let bits = |x: &f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
        for row in 0..ROWS {
            let input = &input[row * n_in..][..n_in];
            let answer = plan.run(self.model, &mut workspace, input, &mut alone);
            let same = output[row * n_out..][..n_out].iter().map(bits).eq(alone.iter().map(bits));
            if answer != answers[row] || !same {
                self.report(ledger, &format!("row {row} of a batch differs"), 1.0);
            }
        }
    }

    pub(super) fn has_quaternions(&self) -> bool {
        let sizes = self.model.sizes();
        sizes.n_qy > sizes.n_vy
    }

    /// u of an answer leads to a pose with this u.
    pub(super) fn given_u(&self, asked: &Asked, ledger: &mut Ledger) {
        let model = self.model;
        if model.sizes().n_u != model.sizes().n_qy || model.sizes().n_u == 0 {
            return;
        }
        let u = asked.get(U).to_vec();
        let guess = asked.get(Q).to_vec();
        let given: [(Field, &[f64]); 2] = [(U, &u), (QGuess, &guess)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Y, U], &[]) else { return };
        ledger.count(&format!("given u: {}", again.answer.status.name()));
        if again.ok() {
            let units = self.units(model.active_names());
            let exact: Vec<Dd> = u.iter().map(|x| Dd::from(*x)).collect();
            self.compare(ledger, &again, "u given", again.get(U), &exact, &units, 1.0);
        }
    }

    /// The nearest y is answered.
    pub(super) fn nearest(&self, y: &[f64], ledger: &mut Ledger) {
        let Some(asked) = self.ask(Request::Kinematics, None, &[(Y, y)], &[NearestY], &[]) else {
            return;
        };
        let nearest = asked.get(NearestY).to_vec();
        if asked.ok() || nearest.iter().any(|x| x.is_nan()) {
            ledger.count("no nearest y");
            return;
        }
        let there = self.ask(Request::Kinematics, None, &[(Y, &nearest)], &[Q], &[]);
        if there.is_some_and(|there| !there.ok()) {
            self.report(ledger, "the nearest y has no answer", 1.0);
        } else {
            ledger.count("nearest y answered");
        }
    }
}
