//! The robots of the cases: bundled ones that are changed, and small ones in code.

use std::collections::HashSet;

use sarrus_dynamics::description::{
    Cut, Description, Inertial, Joint, JointKind, Link, Loop, Placement, Row, Submechanism,
    SubmechanismKind as Kind, Terms,
};
use sarrus_dynamics::{Compiled, Field, Model};
use sarrus_models::{Options, Source, load};

use crate::Outcome;

pub(crate) const X: [f64; 3] = [1.0, 0.0, 0.0];
pub(crate) const Y: [f64; 3] = [0.0, 1.0, 0.0];
pub(crate) const Z: [f64; 3] = [0.0, 0.0, 1.0];
pub(crate) use JointKind::{Prismatic as Slide, Revolute as Turn};

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

/// What the files of a bundled robot say.
pub(crate) fn bundled(name: &str) -> Outcome<Description> {
    Ok(load(&Source::Bundled(name.to_owned()), &Options::default())?.description)
}

/// The same robot with every loop closed by Newton's method.
pub(crate) fn numerical(mut of: Description) -> Description {
    of.submechanisms
        .iter_mut()
        .filter(|part| !part.loops.is_empty())
        .for_each(|part| part.kind = Kind::Numerical);
    of
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

/// A mechanism in code: every frame parallel to the root's at zero, so that a joint is a point, a
/// kind and an axis. Link 0 is the base.
pub(crate) struct Draft {
    at: Vec<[f64; 3]>,
    pub(crate) description: Description,
}

impl Draft {
    pub(crate) fn new(kind: Kind) -> Draft {
        let part = Submechanism {
            name: "loop".into(),
            kind,
            type_name: format!("{kind:?}"),
            spanning_tree: vec![],
            independent: vec![],
            active: vec![],
            loops: vec![],
        };
        let description = Description {
            name: "mechanism".into(),
            links: vec![Link { name: "base".into(), inertial: None }],
            joints: vec![],
            submechanisms: vec![part],
            gravity: [0.3, -9.7, 1.1],
        };
        Draft { at: vec![[0.0; 3]], description }
    }

    /// A joint at a point of the root, which carries a link of 1 kg; returns the link.
    pub(crate) fn joint(
        &mut self,
        parent: usize,
        kind: JointKind,
        at: [f64; 3],
        axis: [f64; 3],
    ) -> usize {
        let child = self.at.len();
        let origin =
            Placement { xyz: std::array::from_fn(|k| at[k] - self.at[parent][k]), rpy: [0.0; 3] };
        let inertial = Inertial {
            origin: Placement { xyz: [0.1, 0.2, -0.1], rpy: [0.0; 3] },
            mass: 1.0,
            inertia: [0.2, 0.01, 0.02, 0.3, 0.0, 0.25],
        };
        self.description
            .links
            .push(Link { name: format!("link{child}"), inertial: Some(inertial) });
        self.description.joints.push(Joint {
            name: format!("j{}", child - 1),
            kind,
            parent,
            child,
            origin,
            axis,
            limits: None,
            coupling: None,
            terms: Terms::default(),
        });
        self.description.submechanisms[0].spanning_tree.push(child - 1);
        self.at.push(at);
        child
    }

    /// A cut at a point of the root with these rows: `xyz` along, `abc` about the axes of the root.
    pub(crate) fn cut(&mut self, predecessor: usize, successor: usize, at: [f64; 3], which: &str) {
        let on = |link: usize| Placement {
            xyz: std::array::from_fn(|k| at[k] - self.at[link][k]),
            rpy: [0.0; 3],
        };
        let row = |c: char| Row {
            name: c.to_string(),
            axis: std::array::from_fn(|k| if "abcxyz".find(c) == Some(k) { 1.0 } else { 0.0 }),
            against: None,
        };
        let cut = Cut::Placed { predecessor: on(predecessor), successor: on(successor) };
        let loops = &mut self.description.submechanisms[0].loops;
        loops.push(Loop {
            name: format!("cut{}", loops.len()),
            predecessor,
            successor,
            cut,
            rows: which.chars().map(row).collect(),
        });
    }

    pub(crate) fn finish(mut self, independent: &[usize], active: &[usize]) -> Description {
        self.description.submechanisms[0].independent = independent.to_vec();
        self.description.submechanisms[0].active = active.to_vec();
        self.description
    }
}
