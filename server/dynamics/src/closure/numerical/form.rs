//! The closed form that replaces Newton's method inside the cells of a table of seeds.

use sarrus_proto::Status;

use crate::closure::numerical::Numerical;
use crate::closure::numerical::seeds::Seeds;
use crate::closure::{Dyads, Level, Local, Outcome, Planar, Platform, Rods, Rrpr, Validity};
use crate::mechanism::{Body, Cluster, Dof, Winding};
use crate::scalar::{Real, constants};

/// 1/sin² of the angle that vanishes at a singular pose beyond which the rows themselves answer:
/// there a form enlarges the misfit that it may have.
const MOST_GAIN: f64 = 1e4;

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
    /// A platform on legs, or on cranks and rods.
    Platform(Platform<T>),
    /// A plane loop with one slider.
    Planar(Planar<T>),
    Rrpr(Rrpr<T>),
    /// Plane loops that pairs of links close one after the other.
    Dyads(Dyads<T>),
    /// Rods that only hold a distance, from a seed.
    Rods(Rods<T>),
}

impl<C: nalgebra::Scalar + Copy> Form<C> {
    /// The form in another scalar.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Form<D> {
        match self {
            Form::Platform(platform) => Form::Platform(platform.map(f)),
            Form::Planar(planar) => Form::Planar(planar.map(f)),
            Form::Rrpr(rrpr) => Form::Rrpr(rrpr.map(f)),
            Form::Dyads(dyads) => Form::Dyads(dyads.map(f)),
            Form::Rods(rods) => Form::Rods(rods.map(f)),
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
        if form.seeded().is_empty() {
            seeds.cell(local.start, local.q)?;
        } else if !seeds.find(local.start, local.q) {
            return None;
        }
        let outcome = form.close(cluster, bodies, local, level);
        let is_sound = outcome.status == Status::Ok && outcome.gain < MOST_GAIN;
        is_sound.then_some(outcome)
    }

    /// The seeds that the form asks for, from the zero pose turned by whole turns; `None` where it
    /// does not hold.
    #[inline]
    pub(crate) fn begin_form(&self, start: &[T], q: &mut [T]) -> Option<()> {
        let seeds = self.seeds.as_deref()?;
        match self.form()?.seeded() {
            [] => seeds.cell(start, q).map(|_| ()),
            _ => seeds.find(start, q).then_some(()),
        }
    }
}

impl<T> Formed<T> {
    /// The freedoms that it starts from, which alone are in the table then.
    pub(crate) fn seeded(&self) -> &[Dof] {
        match &self.form {
            Form::Rods(rods) => &rods.unknowns,
            Form::Platform(_) | Form::Planar(_) | Form::Rrpr(_) | Form::Dyads(_) => &[],
        }
    }

    /// Takes more steps from the table; false where it takes most or none.
    pub(crate) fn lengthen(&mut self) -> bool {
        match &mut self.form {
            Form::Rods(rods) => rods.lengthen(),
            _ => false,
        }
    }
}

impl<T: Real> Formed<T> {
    /// The dependents that the table leaves out, from those that it has.
    pub(crate) fn complete(
        &self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
    ) {
        if let Form::Rods(rods) = &self.form {
            rods.complete(cluster, bodies, local);
            self.wind(local);
        }
    }

    /// Angles beyond half a turn.
    #[inline(always)]
    fn wind(&self, local: &mut Local<'_, T>) {
        for joint in &self.windings {
            local.q[joint.coordinate] = joint.continued(local.start, local.q);
        }
    }

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
            other => return self.close_apart(other, cluster, bodies, local, level),
        };
        self.wind(local);
        validity.into()
    }

    /// All levels of the other forms, out of line so that they lengthen no code of these.
    #[inline(never)]
    fn close_apart(
        &self,
        form: &Form<T>,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Outcome {
        let (validity, iterations) = match form {
            Form::Planar(planar) => (planar.close(local, level), 0),
            Form::Rrpr(rrpr) => (rrpr.close(local, level), 0),
            Form::Rods(rods) => (rods.close(cluster, bodies, local, level), rods.steps as u32),
            Form::Platform(_) | Form::Dyads(_) => (Validity::fine(), 0),
        };
        self.wind(local);
        Outcome { iterations, ..validity.into() }
    }
}
