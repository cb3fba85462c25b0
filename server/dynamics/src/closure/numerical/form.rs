//! The closed form that replaces Newton's method inside the cells of a table of seeds.

use sarrus_proto::Status;

use crate::closure::numerical::continuation::redundant_gap;
use crate::closure::numerical::seeds::Seeds;
use crate::closure::numerical::{Chain, Numerical, Steps};
use crate::closure::{
    Coupling, Dyads, Level, Local, Outcome, Planar, Platform, Rods, Rrpr, Validity,
};
use crate::mechanism::{Dof, Winding};
use crate::scalar::{Real, constants};

/// 1/sin² of the angle that vanishes at a singular pose beyond which the rows themselves answer:
/// there a form enlarges the misfit that it may have. Of blocks in a row it is the product of
/// theirs.
const MOST_GAIN: f64 = 1e4;
const MOST_GAIN_IN_ROW: f64 = 1e6;

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
    /// Of a block among others.
    Coupling(Coupling<T>),
    /// Blocks one after the other.
    Chain(Chain<T>),
    /// The rows themselves, by a fixed number of steps from a seed.
    Steps(Steps),
}

constants! { enum Form:
    map Platform Planar Rrpr Dyads Rods Coupling Chain Steps;
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
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Option<Outcome> {
        let form = self.form()?;
        if form.seeded().is_empty() {
            seeds.cell(local.start, local.q)?;
        } else if !seeds.find(local.start, local.q) {
            return None;
        }
        let outcome = form.close(local, level);
        let is_sound = outcome.status == Status::Ok && outcome.gain < form.most_gain();
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
            Form::Steps(steps) => &steps.unknowns,
            _ => &[],
        }
    }

    /// Dependents that it asks for of a table: those from which it starts, or no one where it has
    /// all from the independents; `None` where Newton's method may start from all.
    pub(crate) fn tabled(&self) -> Option<&[Dof]> {
        matches!(self.form, Form::Rods(_) | Form::Chain(_)).then(|| self.seeded())
    }

    /// The gain up to which it answers.
    pub(crate) fn most_gain(&self) -> f64 {
        if matches!(self.form, Form::Chain(_)) { MOST_GAIN_IN_ROW } else { MOST_GAIN }
    }

    /// Takes the signs of the blocks' determinants, which its steps keep.
    pub(crate) fn set_signs(&mut self, signs: &[f64]) {
        if let Form::Steps(steps) = &mut self.form {
            steps.signs = signs.to_vec();
        }
    }

    /// Takes more steps from the table; false where it takes most or none.
    pub(crate) fn lengthen(&mut self) -> bool {
        match &mut self.form {
            Form::Rods(rods) => rods.lengthen(),
            Form::Steps(steps) => steps.lengthen(),
            _ => false,
        }
    }
}

impl<T: Real> Formed<T> {
    /// The dependents that the table leaves out, from those that it has; false where there is none.
    pub(crate) fn complete(&self, local: &mut Local<'_, T>) -> bool {
        let is_there = match &self.form {
            Form::Rods(rods) => {
                rods.complete(local);
                true
            }
            Form::Chain(chain) => {
                let outcome = Outcome::from(chain.close(local, Level::Position));
                outcome.status == Status::Ok
            }
            _ => return true,
        };
        self.wind(local);
        is_there
    }

    /// The residual of redundant rows at the pose that it closed last, where it leaves them out.
    pub(crate) fn gap(&self, local: &mut Local<'_, T>) -> T {
        match &self.form {
            Form::Steps(_) => redundant_gap(local),
            _ => T::ZERO,
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
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Outcome {
        let (validity, iterations) = match &self.form {
            Form::Platform(platform) => (platform.close(local, level), 0),
            Form::Dyads(dyads) => (dyads.close(local, level), 0),
            other => other.close(local, level),
        };
        self.wind(local);
        Outcome { iterations, ..validity.into() }
    }
}

impl<T: Real> Form<T> {
    /// All levels, and the number of steps; out of line so that those of a form lengthen no code of
    /// another.
    #[inline(never)]
    pub(super) fn close(&self, local: &mut Local<'_, T>, level: Level) -> (Validity<T>, u32) {
        let validity = match self {
            Form::Platform(platform) => platform.close(local, level),
            Form::Planar(planar) => planar.close(local, level),
            Form::Rrpr(rrpr) => rrpr.close(local, level),
            Form::Dyads(dyads) => dyads.close(local, level),
            Form::Rods(rods) => return (rods.close(local, level), rods.steps as u32),
            Form::Coupling(coupling) => {
                coupling.close(local, level);
                Validity::fine()
            }
            Form::Chain(chain) => chain.close(local, level),
            Form::Steps(steps) => return (steps.close(local, level), steps.steps as u32),
        };
        (validity, 0)
    }
}
