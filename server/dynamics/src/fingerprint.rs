//! The fingerprint of a description: FNV-1a over its canonical bytes.
//!
//! Every request and every actuator command carries it, and a command for another model is refused.
//! It depends on the description alone: on no name in this source, no compiler, no machine. Two
//! descriptions have equal canonical bytes exactly when they are equal, with 0 and −0 taken as one
//! number.
//!
//! # Canonical bytes
//! [`VERSION`], then the fields of [`Description`] in the order of its declaration, recursively:
//!
//! | value | bytes |
//! |---|---|
//! | text | length in bytes, then UTF-8 |
//! | number (`f64`) | its 64 bits, little-endian; −0 as 0 |
//! | index, length | `u64`, little-endian |
//! | array of fixed length | its elements |
//! | list | length, then its elements in order |
//! | option | 0, or 1 and the value |
//! | variant | its number in this file, one byte, then its fields |
//!
//! The zero pose comes last and is omitted if it is empty.
//!
//! They include names (types as written too), orders, every constant, limits and gravity. They
//! exclude everything outside a description (file names, positions, comments, warnings,
//! `--lenient`) and the choices of a version of sarrus (closed forms, tolerances, order of
//! elimination): the fingerprint distinguishes robots, not versions.

use sarrus_proto::fnv1a_64;

use crate::description::{
    Coupling, Curve, Cut, Description, Friction, Inertial, Joint, JointKind, Limits, Link, Loop,
    Motor, Placement, Row, Submechanism, SubmechanismKind, Terms,
};

/// Version of the canonical bytes, their first byte; another encoding is another version.
const VERSION: u8 = 1;

impl Description {
    /// A number that differs whenever any name, order or constant differs, up to collisions of 64
    /// bits: FNV-1a 64 of [`Description::canonical_bytes`]. Stable across builds, machines and
    /// versions. Allocates.
    pub fn fingerprint(&self) -> u64 {
        fnv1a_64(&self.canonical_bytes())
    }

    /// The description as bytes that are equal exactly when descriptions are, with 0 and −0 taken
    /// as one number; the head of `fingerprint.rs` has the format. Allocates.
    pub fn canonical_bytes(&self) -> Vec<u8> {
        let mut bytes = CanonicalBytes(vec![VERSION]);
        bytes.description(self);
        bytes.0
    }
}

/// The writer. Every structure is taken apart without `..`: a field that is added does not compile
/// until it is written here.
struct CanonicalBytes(Vec<u8>);

impl CanonicalBytes {
    // primitives

    fn variant(&mut self, number: u8) {
        self.0.push(number);
    }

    fn index(&mut self, index: usize) {
        self.0.extend((index as u64).to_le_bytes());
    }

    fn number(&mut self, number: f64) {
        // −0 + 0 = 0, and any other number stays itself
        self.0.extend((number + 0.0).to_bits().to_le_bytes());
    }

    fn numbers(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.number(*number));
    }

    fn text(&mut self, text: &str) {
        self.index(text.len());
        self.0.extend(text.as_bytes());
    }

    fn list<T>(&mut self, list: &[T], element: impl Fn(&mut Self, &T)) {
        self.index(list.len());
        list.iter().for_each(|each| element(self, each));
    }

    fn indices(&mut self, indices: &[usize]) {
        self.list(indices, |bytes, index| bytes.index(*index));
    }

    fn option<T>(&mut self, option: &Option<T>, value: impl Fn(&mut Self, &T)) {
        self.variant(option.is_some().into());
        option.iter().for_each(|some| value(self, some));
    }

    // the robot

    fn description(&mut self, description: &Description) {
        let Description { name, links, joints, submechanisms, gravity, zero_pose } = description;
        self.text(name);
        self.list(links, Self::link);
        self.list(joints, Self::joint);
        self.list(submechanisms, Self::submechanism);
        self.numbers(gravity);
        // bytes that end here are those of a robot whose joints are at rest at zero
        if !zero_pose.is_empty() {
            self.list(zero_pose, |bytes, (joint, coordinates)| {
                bytes.index(*joint);
                bytes.list(coordinates, |bytes, x| bytes.number(*x));
            });
        }
    }

    fn link(&mut self, Link { name, inertial }: &Link) {
        self.text(name);
        self.option(inertial, Self::inertial);
    }

    fn inertial(&mut self, Inertial { origin, mass, inertia }: &Inertial) {
        self.placement(origin);
        self.number(*mass);
        self.numbers(inertia);
    }

    fn placement(&mut self, Placement { xyz, rpy }: &Placement) {
        self.numbers(xyz);
        self.numbers(rpy);
    }

    fn joint(&mut self, joint: &Joint) {
        let Joint { name, kind, parent, child, origin, axis, limits, coupling, terms, motor } =
            joint;
        self.text(name);
        self.variant(match kind {
            JointKind::Fixed => 0,
            JointKind::Revolute => 1,
            JointKind::Continuous => 2,
            JointKind::Prismatic => 3,
            JointKind::Spherical => 4,
            JointKind::Floating => 5,
        });
        self.index(*parent);
        self.index(*child);
        self.placement(origin);
        self.numbers(axis);
        self.option(limits, Self::limits);
        self.option(coupling, Self::coupling);
        self.terms(terms);
        // robots without motors keep their fingerprints
        if let Some(motor) = motor {
            let Motor { continuous, thermal_time, series_stiffness, power, .. } = motor;
            let Motor { driving, braking, efficiency, .. } = motor;
            self.numbers(&[*continuous, *power, *thermal_time, *series_stiffness]);
            self.numbers(efficiency);
            self.list(driving, |bytes, point| bytes.numbers(point));
            self.list(braking, |bytes, point| bytes.numbers(point));
        }
    }

    fn limits(&mut self, Limits { lower, upper, velocity, effort }: &Limits) {
        self.numbers(&[*lower, *upper, *velocity, *effort]);
    }

    fn coupling(&mut self, Coupling { terms, offset, curves }: &Coupling) {
        self.list(terms, |bytes, (joint, multiplier)| {
            bytes.index(*joint);
            bytes.number(*multiplier);
        });
        self.number(*offset);
        // robots without curves keep their fingerprints
        for (joint, curve) in curves {
            self.index(*joint);
            match curve {
                Curve::Polynomial { about, coefficients } => {
                    self.number(*about);
                    self.numbers(coefficients);
                }
                Curve::Table(points) => self.list(points, |bytes, point| bytes.numbers(point)),
            }
        }
    }

    fn terms(&mut self, terms: &Terms) {
        let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio, friction } = terms;
        self.numbers(&[*damping, *stiffness, *rest, *rotor_inertia, *gear_ratio]);
        let Friction { coulomb, viscous, speed } = friction;
        if *friction != Friction::default() {
            self.numbers(&[*coulomb, *viscous, *speed]);
        }
    }

    fn submechanism(&mut self, submechanism: &Submechanism) {
        let Submechanism {
            name,
            kind,
            type_name,
            spanning_tree,
            independent,
            active,
            loops,
            closed_forms,
        } = submechanism;
        self.text(name);
        let kind = match kind {
            SubmechanismKind::Serial => 0,
            SubmechanismKind::Rrpr => 1,
            SubmechanismKind::Spu2U1 => 2,
            SubmechanismKind::Sprr2U1 => 3,
            SubmechanismKind::Surrpr2U1 => 4,
            SubmechanismKind::Ups6 => 5,
            SubmechanismKind::Rus3x2 => 6,
            SubmechanismKind::ParallelogramChain => 7,
            SubmechanismKind::Transmission => 8,
            SubmechanismKind::FourBar => 9,
            SubmechanismKind::SliderCrank => 10,
            SubmechanismKind::Differential => 11,
            SubmechanismKind::Numerical => 12,
        };
        self.variant(if *closed_forms { kind } else { 64 | kind });
        self.text(type_name);
        self.indices(spanning_tree);
        self.indices(independent);
        self.indices(active);
        self.list(loops, Self::loop_);
    }

    fn loop_(&mut self, Loop { name, predecessor, successor, cut, rows }: &Loop) {
        self.text(name);
        self.index(*predecessor);
        self.index(*successor);
        self.cut(cut);
        self.list(rows, Self::row);
    }

    fn cut(&mut self, cut: &Cut) {
        match cut {
            Cut::AtJoint(joint) => {
                self.variant(0);
                self.index(*joint);
            }
            Cut::AtLink(link) => {
                self.variant(1);
                self.index(*link);
            }
            Cut::Placed { predecessor, successor } => {
                self.variant(2);
                self.placement(predecessor);
                self.placement(successor);
            }
        }
    }

    fn row(&mut self, Row { name, axis, against }: &Row) {
        self.text(name);
        self.numbers(axis);
        self.option(against, |bytes, direction| bytes.numbers(direction));
    }
}

#[cfg(test)]
mod tests;
