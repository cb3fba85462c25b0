//! The closed form that replaces Newton's method inside the cells of a table of seeds.

use sarrus_proto::Status;

use crate::closure::numerical::Numerical;
use crate::closure::numerical::seeds::Seeds;
use crate::closure::platform::Platform;
use crate::closure::{Level, Local, Outcome};
use crate::mechanism::{Body, Cluster};
use crate::scalar::Real;

impl<T> Numerical<T> {
    /// The closed form, if it may be used at all: a tolerance requires Newton's method.
    pub(crate) fn form(&self) -> Option<&Platform<T>> {
        self.form.as_deref().filter(|_| self.end.tolerance.is_none())
    }
}

impl<T: Real> Numerical<T> {
    /// All levels by the closed form, where it holds.
    #[inline]
    pub(super) fn close_in_form(
        &self,
        seeds: &Seeds,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Option<Outcome> {
        let form = self.form()?;
        seeds.cell(local.start, local.q)?;
        let outcome = self.close_by(form, cluster, bodies, local, level);
        (outcome.status == Status::Ok).then_some(outcome)
    }

    /// True if it may be used, from the zero pose turned by whole turns.
    pub(crate) fn is_in_form(&self, start: &[T], q: &[T]) -> bool {
        let cell = |seeds: &Seeds| seeds.cell(start, q).is_some();
        self.form().is_some() && self.seeds.as_deref().is_some_and(cell)
    }

    /// All levels by the closed form, wherever that is.
    pub(crate) fn close_by(
        &self,
        form: &Platform<T>,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Outcome {
        let outcome = Outcome::from(form.close(cluster, bodies, local, level));
        // the start may be the zero pose turned round
        if !self.turns.is_empty() {
            for i in cluster.dependent.iter().map(|v| cluster.dofs[*v].q) {
                local.q[i] += local.start[i] - self.zero[i];
            }
        }
        outcome
    }
}
