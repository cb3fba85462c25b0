//! The robots of the cases: changed bundled ones, and small ones in code.

use std::collections::HashSet;

use sarrus_dynamics::description::{Cut, Description, Placement};
use sarrus_dynamics::{Compiled, Field, Method, Model};

use crate::Outcome;

use crate::robots::catalogue::closures;
pub(crate) use crate::robots::catalogue::{bundled, numerical};
pub(crate) use crate::robots::small::{Slide, Turn, X, Y, Z, cut, finish, joint, mechanism};

/// A robot ready for questions.
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) description: Description,
    pub(crate) compiled: Compiled,
    /// A length that is typical of it `[m]`: lengths are compared with angles in it.
    pub(crate) length: f64,
    /// Names of the joints that slide.
    slides: HashSet<String>,
}

impl Robot {
    /// From a description; the typical length is that of its largest loop, else of its longest
    /// link.
    pub(crate) fn new(name: &str, description: Description) -> Outcome<Robot> {
        let compiled = Model::compile(&description).map_err(|error| format!("{name}: {error}"))?;
        let loops =
            compiled.model.closures().iter().fold(0.0, |length: f64, of| length.max(of.length));
        let links = description.joints.iter().fold(0.0, |length: f64, joint| {
            joint.origin.xyz.iter().fold(length, |l, x| l.max(x.abs()))
        });
        let length = if loops > 0.0 { loops } else { links };
        let slides = description
            .joints
            .iter()
            .filter(|joint| joint.kind == Slide)
            .map(|joint| joint.name.clone())
            .collect();
        Ok(Robot {
            name: name.to_owned(),
            description,
            compiled,
            length: if length > 0.0 { length } else { 1.0 },
            slides,
        })
    }

    /// Its default method of forward dynamics.
    pub(crate) fn own_method(&self) -> [Method; 1] {
        [self.compiled.model.forward_method()]
    }

    /// The independent ones of all coordinates.
    pub(crate) fn independents(&self, q: &[f64]) -> Vec<f64> {
        let names = self.compiled.model.tree_q_names();
        let place = |name: &String| names.iter().position(|other| other == name);
        let independent = self.compiled.model.independent_q_names();
        independent.iter().filter_map(place).map(|place| q[place]).collect()
    }

    /// The kind of its closures, in a word.
    pub(crate) fn closures(&self) -> &'static str {
        closures(&self.compiled.model).unwrap_or("no loops")
    }

    /// The factors that make the n numbers of a field radians and moments.
    pub(crate) fn units_of(&self, field: Field, n: usize) -> Vec<f64> {
        use Field::*;
        let of = |field| self.units(field);
        let outer = |rows: Vec<f64>, columns: Vec<f64>| -> Vec<f64> {
            rows.iter().flat_map(|row| columns.iter().map(move |column| row / column)).collect()
        };
        let units = match field {
            G => outer(of(Qd), of(Yd)),
            GU => outer(of(Ud), of(Yd)),
            MY => outer(of(TauY), of(Yd)),
            GUBias => of(Udd),
            _ => of(field),
        };
        if units.len() == n { units } else { vec![1.0; n] }
    }

    /// The factors that make the coordinates, velocities or forces of a field radians and moments;
    /// none for other fields.
    pub(crate) fn units(&self, field: Field) -> Vec<f64> {
        use Field::*;
        let model = &self.compiled.model;
        let (names, force) = match field {
            Q => (model.tree_q_names(), false),
            Qd | Qdd | GBias => (model.tree_names(), false),
            TauQ => (model.tree_names(), true),
            Yd | Ydd => (model.independent_names(), false),
            TauY | CY | TauUnactuated => (model.independent_names(), true),
            U | Ud | Udd => (model.active_names(), false),
            TauU => (model.active_names(), true),
            _ => return vec![],
        };
        let moves = ["/x", "/y", "/z", "/tx", "/ty", "/tz"];
        let slides = |name: &String| {
            moves.iter().any(|end| name.ends_with(end)) || self.slides.contains(name)
        };
        let unit = |name| match (slides(name), force) {
            (false, _) => 1.0,
            (true, false) => 1.0 / self.length,
            (true, true) => self.length,
        };
        names.iter().map(unit).collect()
    }
}

/// Mass and inertia of the links that `which` names times a factor.
pub(crate) fn heavier(of: &mut Description, which: &dyn Fn(&str) -> bool, factor: f64) {
    for link in of.links.iter_mut().filter(|link| which(&link.name)) {
        if let Some(inertial) = &mut link.inertial {
            inertial.mass *= factor;
            inertial.inertia = inertial.inertia.map(|x| x * factor);
        }
    }
}

/// Every length times `lengths` and every mass times `masses`; times do not change, so gravity
/// scales with the lengths.
pub(crate) fn scaled(of: &mut Description, lengths: f64, masses: f64) {
    let place = |x: &mut Placement| x.xyz = x.xyz.map(|x| lengths * x);
    of.gravity = of.gravity.map(|x| lengths * x);
    for inertial in of.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        place(&mut inertial.origin);
        inertial.mass *= masses;
        inertial.inertia = inertial.inertia.map(|x| masses * lengths * lengths * x);
    }
    of.joints.iter_mut().for_each(|joint| place(&mut joint.origin));
    for cut in of.submechanisms.iter_mut().flat_map(|part| &mut part.loops) {
        if let Cut::Placed { predecessor, successor } = &mut cut.cut {
            place(predecessor);
            place(successor);
        }
    }
}
