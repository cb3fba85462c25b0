//! Checks names and numbers of a description made in code, which no reader of files has checked.

use std::collections::HashSet;

use crate::description::{Cut, Description, Friction, Joint, Placement, Terms};
use crate::diagnostic::{Diagnostic, Site};

/// Reports empty or duplicate names, numbers that are not finite, contradictory limits and loops
/// without rows.
pub(super) fn check(description: &Description) -> Vec<Diagnostic> {
    let mut faults = Faults(Vec::new());
    faults.finite(Site::Robot, "gravity", description.gravity);

    let links = description.links.iter().enumerate();
    faults.names(links.clone().map(|(k, link)| (Site::Link(k), "link", &link.name)));
    for (k, link) in links {
        let Some(inertial) = &link.inertial else { continue };
        let site = Site::Link(k);
        let what = format!("the inertia of link {}", link.name);
        faults.finite(site, &what, placed(&inertial.origin).chain(inertial.inertia));
        if !(inertial.mass >= 0.0 && inertial.mass.is_finite()) {
            let found = format!("link {} with a mass of {} kg", link.name, inertial.mass);
            faults.add(site, found, "a mass of zero or more", "correct it");
        }
    }

    let joints = description.joints.iter().enumerate();
    faults.names(joints.clone().map(|(k, joint)| (Site::Joint(k), "joint", &joint.name)));
    joints.for_each(|(k, joint)| faults.joint(Site::Joint(k), joint));

    for (s, part) in description.submechanisms.iter().enumerate() {
        for (l, cut) in part.loops.iter().enumerate() {
            let site = Site::Loop(s, l);
            if let Cut::Placed { predecessor, successor } = &cut.cut {
                let both = placed(predecessor).chain(placed(successor));
                faults.finite(site, &format!("the place of cut {}", cut.name), both);
            }
            if cut.rows.is_empty() {
                let found = format!("cut {} without rows", cut.name);
                faults.add(site, found, "one to six rows", "give it a cut joint or rows");
            }
            let rows = cut.rows.iter().flat_map(|row| row.axis);
            let against = cut.rows.iter().filter_map(|row| row.against).flatten();
            faults.finite(site, &format!("the rows of cut {}", cut.name), rows.chain(against));
        }
    }
    faults.0
}

struct Faults(Vec<Diagnostic>);

impl Faults {
    fn add(&mut self, site: Site, found: String, expected: &str, help: &str) {
        self.0.push(Diagnostic::new(site, found, expected, help));
    }

    fn names<'a>(&mut self, names: impl Iterator<Item = (Site, &'static str, &'a String)>) {
        let mut seen = HashSet::new();
        for (site, what, name) in names {
            if name.is_empty() {
                self.add(site, format!("a {what} without a name"), "a name", "give it one");
            } else if !seen.insert(name) {
                let found = format!("two {what}s of the name {name}");
                self.add(site, found, "names that are unique", "rename one of them");
            }
        }
    }

    fn finite(&mut self, site: Site, what: &str, numbers: impl IntoIterator<Item = f64>) {
        if let Some(x) = numbers.into_iter().find(|x| !x.is_finite()) {
            self.add(site, format!("{x} in {what}"), "finite numbers", "correct it");
        }
    }

    fn joint(&mut self, site: Site, joint: &Joint) {
        let name = &joint.name;
        self.finite(site, &format!("the origin of joint {name}"), placed(&joint.origin));
        self.finite(site, &format!("the axis of joint {name}"), joint.axis);
        let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio, friction } = joint.terms;
        let Friction { coulomb, viscous, speed } = friction;
        let terms = [damping, stiffness, rest, rotor_inertia, gear_ratio, coulomb, viscous];
        self.finite(site, &format!("the friction of joint {name}"), [1.0 / speed]);
        self.finite(site, &format!("the spring, damper or rotor of joint {name}"), terms);
        if let Some(coupling) = &joint.coupling {
            let numbers = coupling.terms.iter().map(|term| term.1).chain([coupling.offset]);
            self.finite(site, &format!("the coupling of joint {name}"), numbers);
        }
        if let Some(limits) = joint.limits {
            let ordered = limits.lower <= limits.upper;
            if !(ordered && limits.velocity >= 0.0 && limits.effort >= 0.0) {
                let found = format!(
                    "joint {name} with limits {} to {}, velocity {}, effort {}",
                    limits.lower, limits.upper, limits.velocity, limits.effort
                );
                self.add(site, found, "lower ≤ upper, the others not negative", "correct them");
            }
        }
    }
}

fn placed(x: &Placement) -> impl Iterator<Item = f64> {
    x.xyz.into_iter().chain(x.rpy)
}
