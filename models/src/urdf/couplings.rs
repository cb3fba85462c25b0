//! Assigns couplings and rotors to their joints, and checks them.

use std::collections::{BTreeMap, BTreeSet};

use sarrus_dynamics::description::{JointKind, Terms};

use super::dynamics::{self, Rotor};
use super::joint::{JointEntry, Master};
use super::transmission::{self, Dependence, Gear};
use super::xml::{self, Reader};
use super::{MOST_JOINTS, Urdf, Version};
use crate::report::{Diagnostics, Span, quoted};
use crate::text::Text;

impl Urdf {
    /// Takes over the couplings of another URDF, that of a submechanism alone, for those of
    /// `joints` that have none yet.
    pub(crate) fn couple_from(
        &mut self,
        text: &Text,
        joints: &BTreeSet<&str>,
        diagnostics: &mut Diagnostics,
    ) {
        let Some(document) = xml::parse(text, diagnostics) else { return };
        let mut reader = Reader { text, diagnostics, version: Version(1, 2) };
        let mut dependences: Vec<Dependence> = Vec::new();
        for node in document.root_element().children() {
            if node.has_tag_name("transmission") {
                dependences.extend(transmission::read(&mut reader, node));
            } else if node.has_tag_name("joint") {
                dependences.extend(transmission::of_mimic(&mut reader, node));
            }
        }
        let missing = |dependence: &Dependence| {
            joints.contains(dependence.joint.as_str())
                && self.joint(&dependence.joint).is_some_and(|joint| joint.masters.is_empty())
        };
        dependences.retain(missing);
        self.couple(dependences, diagnostics);
    }

    /// The joint above each link.
    pub(crate) fn above(&self) -> Vec<Option<usize>> {
        let mut above = vec![None; self.links.len()];
        for (j, joint) in self.joints.iter().enumerate() {
            if let Some(link) = self.link_at(&joint.child) {
                above[link] = Some(j);
            }
        }
        above
    }

    /// The link at an end of a joint, if it is known.
    pub(crate) fn link_at(&self, end: &Option<(String, Span)>) -> Option<usize> {
        end.as_ref().and_then(|(name, _)| self.link_index.get(name)).copied()
    }

    /// The moving joints from each of two links up to the body that carries both, the nearest
    /// first; `above` is that of [`Urdf::above`].
    pub(crate) fn paths(&self, above: &[Option<usize>], links: [usize; 2]) -> [Vec<usize>; 2] {
        let [mut a, mut b] = links.map(|link| {
            let mut chain = Vec::new();
            let mut link = Some(link);
            // a cycle has been or will be reported
            while let Some(j) = link.and_then(|link| above[link])
                && chain.len() <= self.joints.len()
            {
                chain.push(j);
                link = self.link_at(&self.joints[j].parent);
            }
            chain
        });
        while a.last().is_some() && a.last() == b.last() {
            a.pop();
            b.pop();
        }
        [a, b].map(|path| path.into_iter().filter(|j| self.moves(*j)).collect())
    }

    /// Whether a name is that of a joint of several axes, which cannot be coupled; reports it.
    fn is_compound(&self, name: &str, span: Span, diagnostics: &mut Diagnostics) -> bool {
        let Some(parts) = self.parts.get(name) else { return false };
        let found = format!("the joint {}, which has several axes", quoted(name));
        let help = "name one of them";
        diagnostics.error(span, found, format!("one of {}", parts.join(", ")), help);
        true
    }

    /// The joint of one axis that a transmission names; `None` after an error, which says what
    /// names the joint.
    fn named_joint(
        &mut self,
        name: &str,
        span: Span,
        what: &str,
        diagnostics: &mut Diagnostics,
    ) -> Option<&mut JointEntry> {
        if self.is_compound(name, span, diagnostics) {
            return None;
        }
        let Some(joint) = self.joint_index.get(name) else {
            let found = format!("{what} the joint {}, which does not exist", quoted(name));
            let expected = "a joint of this file";
            let known = self.joint_names();
            diagnostics.unknown(span, found, expected, name, known, "correct the name");
            return None;
        };
        self.joints.get_mut(*joint)
    }

    /// Assigns the dependences of transmissions to their joints.
    pub(super) fn couple(&mut self, dependences: Vec<Dependence>, diagnostics: &mut Diagnostics) {
        for Dependence { joint, span, masters } in dependences {
            let what = "the transmission names";
            let Some(joint) = self.named_joint(&joint, span, what, diagnostics) else { continue };
            if joint.masters.is_empty() {
                joint.masters = masters;
            } else {
                let found = format!("the joint {} is coupled a second time", quoted(&joint.name));
                let expected = "one mimic or one transmission";
                diagnostics.error(span, found, expected, "remove one of them");
            }
        }
    }

    /// As [`Urdf::couple`], of dependences that may repeat a `<mimic>` for another program.
    pub(super) fn couple_again(
        &mut self,
        mut dependences: Vec<Dependence>,
        diagnostics: &mut Diagnostics,
    ) {
        let same = |a: &Master, b: &Master| {
            (&a.joint, a.multiplier, a.offset) == (&b.joint, b.multiplier, b.offset)
        };
        dependences.retain(|of| {
            let known = self.joint(&of.joint).map_or(&[][..], |joint| &joint.masters);
            !matches!((known, &of.masters[..]), ([a], [b]) if same(a, b))
        });
        self.couple(dependences, diagnostics);
    }

    /// Assigns the couplings of URDF+ to the following joints one by one: each takes a joint that
    /// does not follow another yet.
    pub(super) fn mesh(&mut self, gears: &[Gear], diagnostics: &mut Diagnostics) {
        let chains = gears.iter().take(MOST_JOINTS);
        let above = self.above();
        let chains: Vec<_> = chains.map(|gear| gear.terms(self, &above, diagnostics)).collect();
        for (gear, terms) in gears.iter().zip(chains) {
            let dependence = terms.and_then(|terms| gear.dependence(&terms, self, diagnostics));
            self.couple(Vec::from_iter(dependence), diagnostics);
        }
        if let Some(gear) = gears.get(MOST_JOINTS) {
            let found = format!("the robot has {} couplings", gears.len());
            let help = "remove those that repeat others";
            diagnostics.error(gear.span, found, format!("at most {MOST_JOINTS}"), help);
        }
    }

    /// Assigns the rotors of transmissions to their joints.
    pub(super) fn add_rotors(&mut self, rotors: &[Rotor], diagnostics: &mut Diagnostics) {
        for Rotor { joint, span, inertia, ratio } in rotors {
            let what = "the rotor belongs to";
            let Some(joint) = self.named_joint(joint, *span, what, diagnostics) else { continue };
            let terms = Terms { rotor_inertia: *inertia, gear_ratio: *ratio, ..joint.terms };
            if joint.terms.rotor_inertia != 0.0 {
                let found = format!("the joint {} has a second rotor", quoted(&joint.name));
                let help = "add both inertias up, each times its ratio squared";
                diagnostics.error(*span, found, "one", help);
            } else if dynamics::accepts(joint.kind, &joint.name, &terms, *span, diagnostics) {
                joint.terms = terms;
            }
        }
    }

    /// Assigns the springs of Gazebo, stiffness and reference, to their joints.
    pub(super) fn add_springs(
        &mut self,
        springs: &BTreeMap<String, (Span, [f64; 2])>,
        diagnostics: &mut Diagnostics,
    ) {
        for (name, (span, [stiffness, rest])) in springs {
            let what = "the spring belongs to";
            let Some(joint) = self.named_joint(name, *span, what, diagnostics) else { continue };
            let terms = Terms { stiffness: *stiffness, rest: *rest, ..joint.terms };
            if *stiffness == 0.0 && joint.terms.stiffness == 0.0 {
                continue;
            }
            if *stiffness < 0.0 {
                let found = format!("`springStiffness` is {stiffness}");
                diagnostics.error(*span, found, "zero or more", "correct the value");
            } else if joint.terms.stiffness != 0.0 && joint.terms != terms {
                let found = format!("the joint {} has a second spring", quoted(&joint.name));
                diagnostics.error(*span, found, "one", "add both up, or remove one of them");
            } else if dynamics::accepts(joint.kind, &joint.name, &terms, *span, diagnostics) {
                joint.terms = terms;
            }
        }
    }

    /// Checks every coupling; a fixed joint loses its own.
    pub(crate) fn check_couplings(&mut self, diagnostics: &mut Diagnostics) {
        for joint in &mut self.joints {
            if joint.kind == Some(JointKind::Fixed) && !joint.masters.is_empty() {
                let found = format!("the fixed joint {} is coupled", quoted(&joint.name));
                let help = "remove the mimic or change the type; the coupling is not read";
                diagnostics.warning(joint.span, found, "a joint that moves", help);
                joint.masters.clear();
            }
        }
        for joint in &self.joints {
            for master in &joint.masters {
                if self.is_compound(&master.joint, master.span, diagnostics) {
                    continue;
                }
                let who =
                    format!("the joint {} follows {}", quoted(&joint.name), quoted(&master.joint));
                let known = self.joint_index.get(&master.joint);
                let (found, help) = match known {
                    None => {
                        let known = self.joint_names();
                        let help =
                            diagnostics.did_you_mean(&master.joint, known, "correct the name");
                        (format!("{who}, which does not exist"), help)
                    }
                    Some(_) if master.joint == joint.name => {
                        (format!("{who}, which is itself"), "name another joint".to_owned())
                    }
                    Some(i) if !self.moves(*i) => {
                        (format!("{who}, which is fixed"), "name a joint that moves".to_owned())
                    }
                    Some(_) => continue,
                };
                diagnostics.error(master.span, found, "another moving joint of this robot", help);
            }
            if !joint.masters.is_empty()
                && matches!(joint.kind, Some(JointKind::Floating | JointKind::Spherical))
            {
                let found = format!("the joint {} is coupled", quoted(&joint.name));
                let help = "remove the mimic or change the type";
                diagnostics.error(joint.span, found, "a coupling of joints with one axis", help);
            }
        }
    }
}
