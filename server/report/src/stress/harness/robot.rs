//! The robots of the cases: bundled ones that are changed, and small ones in code.

use std::collections::HashSet;

use sarrus_dynamics::description::{
    Cut, Description, Inertial, JointKind, Placement, SubmechanismKind as Kind,
};
use sarrus_dynamics::{Compiled, DescriptionBuilder, Field, LinkId, Model};
use sarrus_models::{Options, Source, load};

use crate::Outcome;

pub(crate) const X: [f64; 3] = [1.0, 0.0, 0.0];
pub(crate) const Y: [f64; 3] = [0.0, 1.0, 0.0];
pub(crate) const Z: [f64; 3] = [0.0, 0.0, 1.0];
pub(crate) use JointKind::{Prismatic as Slide, Revolute as Turn};

pub(crate) use crate::robots::catalogue::numerical;

/// A robot ready to be asked.
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) description: Description,
    pub(crate) compiled: Compiled,
    /// A length that is typical of it `[m]`: lengths are compared with angles in it.
    length: f64,
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

    /// A length that is typical of it `[m]`.
    pub(crate) fn length(&self) -> f64 {
        self.length
    }

    /// How its loops are closed, in a word.
    pub(crate) fn closures(&self) -> &'static str {
        use sarrus_dynamics::ClosureKind::{Analytic, Numerical};
        let has = |kind| self.compiled.model.closures().iter().any(|closure| closure.kind == kind);
        match (has(Analytic), has(Numerical)) {
            (true, true) => "hybrid",
            (true, false) => "analytic",
            (false, true) => "numerical",
            (false, false) => "no loops",
        }
    }

    /// The factor that makes each number of a field one of radians and moments; `None` where a
    /// field has one unit.
    pub(crate) fn units(&self, field: Field) -> Option<Vec<f64>> {
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
            _ => return None,
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
        Some(names.iter().map(unit).collect())
    }
}

/// The description of a bundled robot.
pub(crate) fn bundled(name: &str) -> Outcome<Description> {
    Ok(load(&Source::Bundled(name.to_owned()), &Options::default())?.description)
}

/// Mass and inertia of the links that `which` names times a factor.
pub(crate) fn heavier(
    mut of: Description,
    which: impl Fn(&str) -> bool,
    factor: f64,
) -> Description {
    for link in of.links.iter_mut().filter(|link| which(&link.name)) {
        if let Some(inertial) = &mut link.inertial {
            inertial.mass *= factor;
            inertial.inertia = inertial.inertia.map(|x| x * factor);
        }
    }
    of
}

/// Every length times `lengths` and every mass times `masses`; times stay, so gravity goes with the
/// lengths.
pub(crate) fn scaled(mut of: Description, lengths: f64, masses: f64) -> Description {
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
    of
}

/// A mechanism under way, every link of 1 kg.
pub(crate) fn mechanism(kind: Kind) -> DescriptionBuilder {
    let mut of = DescriptionBuilder::new("mechanism");
    let inertia = [0.2, 0.01, 0.02, 0.3, 0.0, 0.25];
    of.gravity([0.3, -9.7, 1.1]).default_inertial(Inertial::new(1.0, [0.1, 0.2, -0.1], inertia));
    of.submechanism("loop", kind);
    of
}

/// Joint k, at a point and along an axis of the root; returns its link, k + 1.
pub(crate) fn joint(
    of: &mut DescriptionBuilder,
    parent: LinkId,
    kind: JointKind,
    at: [f64; 3],
    axis: [f64; 3],
) -> LinkId {
    let k = of.n_joints();
    let joint = of.joint(format!("j{k}"), kind, parent).link_name(format!("link{}", k + 1));
    joint.at(at).axis(axis).link()
}

/// A cut at a point of the root with these rows: `xyz` along, `abc` about the axes of the root.
pub(crate) fn cut(
    of: &mut DescriptionBuilder,
    predecessor: LinkId,
    successor: LinkId,
    at: [f64; 3],
    which: &str,
) {
    let row = |c: char| std::array::from_fn(|k| f64::from("abcxyz".find(c) == Some(k)));
    let cut = of.cut("cut0", predecessor, successor).at(at);
    which.chars().fold(cut, |cut, c| cut.row(c, row(c)));
}

/// The description, with its independent and its active joints.
pub(crate) fn finish(
    mut of: DescriptionBuilder,
    independent: &[LinkId],
    active: &[LinkId],
) -> Outcome<Description> {
    of.independent(independent.iter().copied()).active(active.iter().copied());
    Ok(of.build()?)
}
