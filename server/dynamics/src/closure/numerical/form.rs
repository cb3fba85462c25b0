//! The closed form that answers for Newton's method inside the cells of a table of seeds.

use sarrus_proto::Status;

use crate::closure::numerical::Numerical;
use crate::closure::numerical::seeds::Seeds;
use crate::closure::{Level, Local, Outcome};
use crate::mechanism::{Body, Cluster};
use crate::scalar::Scalar;

impl<C: Scalar> Numerical<C> {
    /// All levels by the closed form, where it holds; a tolerance asks for Newton's method.
    #[inline]
    pub(super) fn close_in_form(
        &self,
        seeds: &Seeds,
        cluster: &Cluster<C>,
        bodies: &[Body<C>],
        local: &mut Local<'_, C>,
        level: Level,
    ) -> Option<Outcome> {
        let form = self.form.as_ref().filter(|_| self.end.tolerance.is_none())?;
        seeds.cell(local.start, local.q)?;
        let outcome = Outcome::from(form.close(cluster, bodies, local, level));
        // the start may be the zero pose turned round
        if !self.turns.is_empty() {
            for i in cluster.dependent.iter().map(|v| cluster.dofs[*v].q) {
                local.q[i] += local.start[i] - self.zero[i];
            }
        }
        (outcome.status == Status::Ok).then_some(outcome)
    }
}
