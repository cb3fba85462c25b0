//! What a robot stands on: the world itself, or a free joint.

use std::collections::BTreeSet;

use sarrus_dynamics::description::{
    Description, Joint, JointKind, Link, Placement, Submechanism, SubmechanismKind, Terms,
};

use crate::build::Spans;
use crate::nearest::nearest;
use crate::report::{Diagnostics, quoted};

/// Name of the free joint of a floating base and of its submechanism.
const NAME: &str = "floating_base";

/// What a robot stands on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Base {
    /// The root link is the world.
    #[default]
    Fixed,
    /// The root link hangs on the world by an unactuated joint of six degrees of freedom, the first
    /// of all: q = [p; x y z w], q̇ = [ω; v] in the root link, by the names `floating_base/rx` …
    /// `floating_base/tz`.
    Floating,
    /// The same for the root link of this name; another link is a fault.
    FloatingAt(String),
}

impl Base {
    /// From the name of the link that floats, as flags and recordings write it: empty for the root
    /// whatever it is called, none for a fixed base.
    pub fn of_flag(link: Option<&str>) -> Base {
        match link {
            None => Base::Fixed,
            Some("") => Base::Floating,
            Some(link) => Base::FloatingAt(link.to_owned()),
        }
    }
}

/// Puts the free joint below the root link.
pub(crate) fn put(
    base: &Base,
    description: &mut Description,
    spans: &mut Spans,
    diagnostics: &mut Diagnostics,
) {
    let wanted = match base {
        Base::Fixed => return,
        Base::Floating => None,
        Base::FloatingAt(name) => Some(name.as_str()),
    };
    let robot = spans.of(sarrus_dynamics::Site::Robot);
    let children: BTreeSet<usize> = description.joints.iter().map(|joint| joint.child).collect();
    let Some(root) = (0..description.links.len()).find(|link| !children.contains(link)) else {
        return;
    };
    let links = || description.links.iter().map(|link| link.name.as_str());
    let root_name = &description.links[root].name;
    if let Some(wanted) = wanted.filter(|wanted| wanted != root_name) {
        let found = if links().any(|name| name == wanted) {
            format!("--floating-base at the link {}, which is not the root", quoted(wanted))
        } else {
            let near = nearest(wanted, links()).map(quoted);
            let near = near.map_or(String::new(), |near| format!(" (there is {near})"));
            format!("--floating-base at the link {}, which does not exist{near}", quoted(wanted))
        };
        diagnostics.error(
            robot,
            found,
            format!("the root link {}", quoted(root_name)),
            "name the root link, or none",
        );
        return;
    }
    let is_taken = description.joints.iter().any(|joint| joint.name == NAME)
        || description.submechanisms.iter().any(|of| of.name == NAME);
    if is_taken {
        diagnostics.error(
            robot,
            format!("--floating-base of a robot that has a {} already", quoted(NAME)),
            "a name that is free",
            "rename it, or leave out the flag",
        );
        return;
    }

    // the world is no body, whatever it is called
    let mut world = "world".to_owned();
    while description.links.iter().any(|link| link.name == world) {
        world.insert(0, '_');
    }
    let joint = description.joints.len();
    description.joints.push(Joint {
        name: NAME.to_owned(),
        kind: JointKind::Floating,
        parent: description.links.len(),
        child: root,
        origin: Placement::default(),
        axis: [1.0, 0.0, 0.0],
        limits: None,
        coupling: None,
        terms: Terms::default(),
    });
    description.links.push(Link { name: world, inertial: None });
    description.submechanisms.insert(
        0,
        Submechanism {
            name: NAME.to_owned(),
            kind: SubmechanismKind::Serial,
            type_name: "SERIAL".to_owned(),
            spanning_tree: vec![joint],
            independent: vec![joint],
            active: Vec::new(),
            loops: Vec::new(),
        },
    );
    spans.put_first();
}
