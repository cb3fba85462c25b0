//! The base of a robot: fixed in the world, or free.

use sarrus_dynamics::description::{
    Description, JointKind, Link, Placement, Submechanism, SubmechanismKind,
};

use crate::build::{self, Spans};
use crate::names::there_is;
use crate::report::{Diagnostics, quoted};
use crate::tree::Tree;

/// Name of the free joint of a floating base and of its submechanism.
const NAME: &str = "floating_base";

/// The connection of the root link to the world.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Base {
    /// The root link is the world.
    #[default]
    Fixed,
    /// An unactuated joint of six degrees of freedom, the first of all, connects the root link to
    /// the world: q = [p; x y z w], q̇ = [ω; v] in the root link, by the names `floating_base/rx` …
    /// `floating_base/tz`.
    Floating,
    /// As `Floating`, for the root link of this name; another link is a fault.
    FloatingAt(String),
}

impl Base {
    /// From the name of the floating link, as in flags and recordings: the empty name means any
    /// root, `None` a fixed base.
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
    let root = Tree::new(description).root;
    let links = || description.links.iter().map(|link| link.name.as_str());
    let root_name = &description.links[root].name;
    if let Some(wanted) = wanted.filter(|wanted| wanted != root_name) {
        let found = if links().any(|name| name == wanted) {
            format!("--floating-base at the link {}, which is not the root", quoted(wanted))
        } else {
            let near = there_is(wanted, links());
            format!("--floating-base at the link {}, which does not exist{near}", quoted(wanted))
        };
        let expected = format!("the root link {}", quoted(root_name));
        diagnostics.error(robot, found, expected, "name the root link, or none");
        return;
    }
    let is_taken = description.joints.iter().any(|joint| joint.name == NAME)
        || description.submechanisms.iter().any(|of| of.name == NAME);
    if is_taken {
        let found = format!("--floating-base of a robot that has a {} already", quoted(NAME));
        let help = "rename it, or leave out the flag";
        diagnostics.error(robot, found, "a name that is free", help);
        return;
    }

    // the world is no body; its name is free
    let mut world = "world".to_owned();
    while description.links.iter().any(|link| link.name == world) {
        world.insert(0, '_');
    }
    let joint = description.joints.len();
    let links = [description.links.len(), root];
    let place = Placement::default();
    description.joints.push(build::joint(NAME.to_owned(), JointKind::Floating, place, links));
    description.links.push(Link { name: world, inertial: None });
    let part = build::group(NAME.to_owned(), SubmechanismKind::Serial, vec![joint]);
    description.submechanisms.insert(0, Submechanism { independent: vec![joint], ..part });
    spans.put_first();
}
