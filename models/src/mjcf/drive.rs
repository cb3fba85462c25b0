//! Fixed tendons and actuators: which coordinates are driven, with which force at most.
//!
//! A tendon that is driven, that has a spring, damping, dry friction, armature or a range, or whose
//! length others follow along a curve, becomes a joint of its own without mass, which follows the
//! joints of the tendon: its coordinate is the tendon's length less that in the file's pose.

use sarrus_dynamics::description::Terms;

use super::body::{Joint, Kind, Tree, largest};
use super::compiler::Compiler;
use super::item::Item;
use super::source::Source;
use crate::report::{Diagnostics, Span, quoted};

/// A fixed tendon.
pub(super) struct Tendon {
    pub(super) name: String,
    /// The joint that it becomes where it acts, and whether others follow that.
    pub(super) joint: String,
    pub(super) leads: bool,
    span: Span,
    /// Joints and their coefficients.
    pub(super) terms: Vec<(String, f64)>,
    dynamics: Terms,
    range: Option<[f64; 2]>,
    effort: f64,
    /// The sum of its actuators' largest forces; `None` where it is not driven.
    drive: Option<f64>,
}

/// The elements of an actuator; a class holds its defaults under any of these names.
const ACTUATORS: &str = "general motor position velocity intvelocity damper cylinder muscle \
    adhesion dcmotor";

/// Adds the fixed tendons of a file; others are reported.
pub(super) fn tendons(
    source: &mut Source<'_>,
    tree: &Tree,
    tendons: &mut Vec<Tendon>,
    diagnostics: &mut Diagnostics,
) {
    let root = source.root;
    for element in root.all("tendon").flat_map(|of| &of.children) {
        if source.leaves_out(element, |tag, name| tree.has(tag, name), diagnostics) {
            continue;
        }
        let Source { classes, compiler, .. } = &*source;
        let item = classes.item(element, &["tendon"], None, diagnostics);
        let name = source.refers(&item, "name").unwrap_or_default();
        diagnostics.named(item.span(), "tendon", &name);
        let linear = ["stiffness", "damping"].map(|of| item.linear(of, diagnostics));
        let armature = item.number("armature", diagnostics).unwrap_or(0.0);
        if item.tag() != "fixed" {
            element.read_all();
            if linear != [0.0; 2] || armature != 0.0 {
                let found = format!("the spatial tendon {} with a spring", quoted(&name));
                diagnostics.dynamics(item.span(), found, "a fixed tendon", "remove it");
            }
            continue;
        }
        let mut terms = Vec::new();
        let [mut at_zero, mut at_rest] = [0.0; 2];
        for of in element.all("joint").map(Item::plain) {
            let joint = source.refers(&of, "joint").unwrap_or_default();
            let factor = of.number("coef", diagnostics).unwrap_or(0.0);
            match tree.joint(&joint).and_then(|j| tree.joints.get(j)).filter(|of| of.is_single()) {
                Some(known) => {
                    at_zero += factor * known.reference;
                    at_rest += factor * known.terms.rest;
                    terms.push((known.name.clone(), factor));
                }
                None => {
                    let found = format!("{} is no hinge or slide of this file", quoted(&joint));
                    diagnostics.error(of.at("joint"), found, "a joint", "correct the name");
                }
            }
        }
        // −1: the length where the springs of its joints are at rest
        let rest = item.list("springlength", 2, diagnostics).unwrap_or_default();
        if linear[0] != 0.0 && matches!(rest[..], [a, b] if a != b) {
            let found = format!("the spring of the tendon {} has a dead band", quoted(&name));
            diagnostics.dynamics(item.at("springlength"), found, "one length", "remove it");
        }
        let rest =
            rest.first().copied().filter(|of| *of != -1.0).map_or(at_rest, |of| of - at_zero);
        let range = compiler.range(&item, "range", "limited", diagnostics);
        let effort = compiler.range(&item, "actuatorfrcrange", "actuatorfrclimited", diagnostics);
        let mut joint = name.clone();
        let is_taken = |name: &str| tendons.iter().any(|of| of.joint == name);
        while joint.is_empty() || tree.joint(&joint).is_some() || is_taken(&joint) {
            joint.push_str("tendon");
        }
        tendons.push(Tendon {
            name,
            joint,
            leads: false,
            span: item.span(),
            terms,
            dynamics: Terms {
                damping: linear[1],
                stiffness: linear[0],
                rest,
                rotor_inertia: armature,
                friction: item.dry_friction(diagnostics),
                ..Terms::default()
            },
            range: range.map(|range| range.map(|of| of - at_zero)),
            effort: effort.map_or(f64::INFINITY, largest),
            drive: None,
        });
    }
}

/// Reads the actuators into their joints and tendons.
pub(super) fn actuators(
    source: &mut Source<'_>,
    tree: &mut Tree,
    tendons: &mut [Tendon],
    diagnostics: &mut Diagnostics,
) {
    let tags: Vec<&str> = ACTUATORS.split(' ').collect();
    let root = source.root;
    for element in root.all("actuator").flat_map(|of| &of.children) {
        if source.leaves_out(element, |tag, name| tree.has(tag, name), diagnostics) {
            continue;
        }
        let Source { classes, compiler, .. } = &*source;
        let item = classes.item(element, &tags, None, diagnostics);
        let name = item.text("name").unwrap_or_default();
        diagnostics.named(item.span(), "actuator", &source.name(name, &source.suffix));
        let gear = item.list("gear", 6, diagnostics).unwrap_or_default();
        let gear = gear.first().copied().unwrap_or(1.0);
        let limit = limit(&item, compiler, diagnostics);
        let armature = item.number("armature", diagnostics).unwrap_or(0.0);
        let damping = item.linear("damping", diagnostics);
        let [joint, inparent, on_tendon] =
            ["joint", "jointinparent", "tendon"].map(|of| source.refers(&item, of));
        let on_joint = joint.or(inparent);
        let joint = tree.joints.iter_mut().find(|of| Some(&of.name) == on_joint.as_ref());
        let joint = joint.filter(|of| of.is_single()).map(|of| (&mut of.terms, &mut of.drive));
        let tendon = tendons.iter_mut().find(|of| Some(&of.name) == on_tendon.as_ref());
        let tendon = tendon.map(|of| (&mut of.dynamics, &mut of.drive));
        let Some((terms, drive)) = joint.or(tendon) else {
            element.read_all();
            let found =
                format!("the actuator {} drives no hinge, slide or fixed tendon", quoted(name));
            diagnostics.dynamics(item.span(), found, "one of them", "remove it");
            continue;
        };
        // τ = gear · force; its rotor turns gear times as fast
        terms.damping += gear * gear * damping;
        terms.rotor_inertia += gear * gear * armature;
        if drive.is_some() {
            let found = format!("the actuator {} drives the joint of another one", quoted(name));
            diagnostics.note(item.span(), found, "their forces are one here");
        }
        *drive = Some(drive.unwrap_or(0.0) + gear.abs() * limit);
        if gear != 1.0 {
            let found = format!("the gear of the actuator {} is {gear}", quoted(name));
            let help = "τ_u is the force on the joint: gear times that of the actuator";
            diagnostics.note(item.span(), found, help);
        }
    }
}

/// The largest force of an actuator before its gear.
fn limit(item: &Item<'_>, compiler: &Compiler, diagnostics: &mut Diagnostics) -> f64 {
    let force = compiler.range(item, "forcerange", "forcelimited", diagnostics);
    let control = compiler.range(item, "ctrlrange", "ctrllimited", diagnostics);
    // the control of a motor is its force
    let gain = item.list("gainprm", 10, diagnostics).and_then(|of| of.first().copied());
    let is_force = match item.tag() {
        "motor" => true,
        "general" => {
            item.text("gaintype").is_none_or(|of| of == "fixed")
                && item.text("biastype").is_none_or(|of| of == "none")
                && item.text("dyntype").is_none_or(|of| of == "none")
        }
        _ => false,
    };
    let gain = if item.tag() == "motor" { 1.0 } else { gain.unwrap_or(1.0) };
    let by_control =
        control.filter(|_| is_force).map_or(f64::INFINITY, |of| gain.abs() * largest(of));
    force.map_or(f64::INFINITY, largest).min(by_control)
}

/// Turns the tendons that act into joints without mass.
pub(super) fn into_joints(tendons: Vec<Tendon>, tree: &mut Tree, diagnostics: &mut Diagnostics) {
    for tendon in tendons {
        let Tendon { joint, leads, span, terms, dynamics, range, effort, drive, .. } = tendon;
        let is_free = dynamics == Terms { rest: dynamics.rest, ..Terms::default() };
        let acts = !is_free || leads || range.is_some() || drive.is_some();
        if !acts || terms.is_empty() {
            continue;
        }
        let found = format!("the tendon {} becomes a joint without mass", quoted(&joint));
        let help = "it follows the joints of the tendon";
        diagnostics.note(span, found, help);
        let body = tree.add_body(format!("{joint}/tendon"), span, &terms);
        tree.add_joint(Joint {
            body,
            range,
            effort,
            terms: dynamics,
            coupling: Some((terms, 0.0)),
            drive,
            ..Joint::new(joint, span, Kind::Slide)
        });
    }
}
