//! The closed form that replaces Newton's method inside the cells of a table of seeds.

use sarrus_proto::Status;

use crate::closure::numerical::Numerical;
use crate::closure::numerical::seeds::Seeds;
use crate::closure::{Dyads, Level, Local, Outcome, Platform};
use crate::mechanism::{Body, Cluster, Winding};
use crate::scalar::{Real, constants};

/// The closed form of a cluster that the rows of Newton's method describe.
#[derive(Clone, Debug)]
pub(crate) struct Formed<T> {
    pub(crate) form: Form<T>,
    /// The coordinates that leave (−π, π] in the table or with whole turns.
    pub(crate) windings: Vec<Winding>,
}

constants! { Formed:
    keep windings;
    map form;
}

/// A form that no type names.
#[derive(Clone, Debug)]
pub(crate) enum Form<T> {
    /// Cranks and rods.
    Platform(Platform<T>),
    /// Plane loops that pairs of links close one after the other.
    Dyads(Dyads<T>),
}

impl<C: nalgebra::Scalar + Copy> Form<C> {
    /// The form in another scalar.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Form<D> {
        match self {
            Form::Platform(platform) => Form::Platform(platform.map(f)),
            Form::Dyads(dyads) => Form::Dyads(dyads.map(f)),
        }
    }
}

impl<T> Numerical<T> {
    /// The closed form, if it may be used at all: a tolerance requires Newton's method.
    pub(crate) fn form(&self) -> Option<&Formed<T>> {
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
        let outcome = form.close(cluster, bodies, local, level);
        (outcome.status == Status::Ok).then_some(outcome)
    }

    /// True if it may be used, from the zero pose turned by whole turns.
    pub(crate) fn is_in_form(&self, start: &[T], q: &[T]) -> bool {
        let cell = |seeds: &Seeds| seeds.cell(start, q).is_some();
        self.form().is_some() && self.seeds.as_deref().is_some_and(cell)
    }
}

impl<T: Real> Formed<T> {
    /// All levels, wherever that is.
    #[inline]
    pub(crate) fn close(
        &self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Outcome {
        let validity = match &self.form {
            Form::Platform(platform) => platform.close(cluster, bodies, local, level),
            Form::Dyads(dyads) => dyads.close(cluster, local, level),
        };
        for joint in &self.windings {
            local.q[joint.coordinate] = joint.continued(local.start, local.q);
        }
        validity.into()
    }
}
