//! The mechanisms of random robots. Each is drawn in a frame of its own, x, y, z, which is placed
//! anywhere on a link.

use super::writer::{Entry, Kind, Link, Writer};
use super::{BALLS, SPINNING};
use crate::rigid::{Pose, Vector, add};

pub(super) const X: Vector = [1.0, 0.0, 0.0];
pub(super) const Y: Vector = [0.0, 1.0, 0.0];
pub(super) const Z: Vector = [0.0, 0.0, 1.0];

/// Rows along the axes of the cut frame: 0 to 2 angular, 3 to 5 linear.
pub(super) fn rows(which: &[usize]) -> Vec<[f64; 6]> {
    which.iter().map(|k| std::array::from_fn(|i| if i == *k { 1.0 } else { 0.0 })).collect()
}

pub(super) fn scaled(v: Vector, s: f64) -> Vector {
    add([0.0; 3], s, v)
}

impl Writer {
    /// Adds one mechanism of any kind on any link.
    pub(super) fn mechanism(&mut self) {
        let last = self.links.len() - 1;
        // a mechanism beside the floating base could not be coupled to one that the base carries
        let first = usize::from(self.floats);
        let on =
            if self.seeded.chance(0.5) { last } else { self.seeded.below(last + 1).max(first) };
        let at = self.links[on].1.then(&self.seeded.pose(self.scale));
        let number = self.seeded.below(40);
        // redundant rows contradict each other in files with rounded numbers
        let number = if self.rounded && matches!(number, 26..30) { 0 } else { number };
        match number {
            0..6 => self.serial(on, at),
            6..11 => self.lambda(on, at),
            11..14 => self.two_legs(on, at),
            14 if self.seeded.chance(0.5) => self.two_offset_legs(on, at),
            14 => self.two_legs_on_arms(on, at),
            15 => self.six_legs(on, at),
            16..19 => self.four_bar(on, at),
            19..21 => self.slider_crank(on, at),
            21..23 => self.parallelogram(on, at),
            23 => self.two_loops(on, at),
            24..26 => self.welded_four_bar(on, at),
            26 => self.bricard(on, at),
            27..29 => self.spherical_four_bar(on, at),
            29 => self.bennett(on, at),
            30 if SPINNING => self.rssr(on, at),
            30..33 => self.rusr(on, at),
            33..35 => self.seven_revolutes(on, at),
            _ => self.coupled(on, at),
        }
    }

    /// A chain of free joints, sometimes one without an actuator.
    fn serial(&mut self, on: Link, at: Pose) {
        let n = 1 + self.seeded.below(4);
        let mut tree = Vec::new();
        let mut link = on;
        let mut origin = at.p;
        let mut revolutes = true;
        let mut balls = Vec::new();
        for _ in 0..n {
            let kind = if self.seeded.chance(0.25) { Kind::Slide } else { Kind::Turn };
            let axis = if self.seeded.chance(0.4) {
                [X, Y, Z][self.seeded.below(3)]
            } else {
                self.seeded.direction()
            };
            revolutes &= kind == Kind::Turn;
            let reach = if kind == Kind::Turn { 3.0 } else { self.scale };
            if BALLS && self.seeded.chance(0.08) {
                let (name, child) = self.ball(link, origin);
                balls.push(name.clone());
                tree.push((name, 0.0));
                link = child;
                origin = add(origin, 1.0, self.seeded.vector(self.scale));
                continue;
            }
            let (name, child) = self.joint(kind, link, origin, axis);
            tree.push((name, reach));
            link = child;
            origin = add(origin, 1.0, self.seeded.vector(self.scale));
        }
        let names: Vec<String> = tree.iter().map(|x| x.0.clone()).collect();
        let mut active: Vec<String> =
            names.iter().filter(|name| !balls.contains(name)).cloned().collect();
        if self.seeded.chance(0.15) && !active.is_empty() {
            active.remove(self.seeded.below(active.len()));
        }
        let letters = format!("{n}R");
        let type_name = if revolutes && balls.is_empty() && self.seeded.chance(0.5) {
            letters.as_str()
        } else {
            "SERIAL"
        };
        self.submechanism(
            "serial",
            Entry { type_name, tree: names, independent: tree, active, loops: vec![] },
        );
    }

    /// A chain in which joints follow others, some of them in a row, or a joint of another
    /// mechanism.
    fn coupled(&mut self, on: Link, at: Pose) {
        let n = 2 + self.seeded.below(3);
        let far = if self.seeded.chance(0.3) && !self.masters.is_empty() {
            Some(self.masters[self.seeded.below(self.masters.len())].clone())
        } else {
            None
        };
        let mut tree: Vec<String> = Vec::new();
        let mut independent: Vec<(String, f64)> = Vec::new();
        let mut link = on;
        let mut origin = at.p;
        let mut last = None;
        for k in 0..n {
            let axis = self.seeded.direction();
            let (name, child) = self.joint(Kind::Turn, link, origin, axis);
            if k == 0 && far.is_none()
                || k > 0 && independent.len() < n / 2 && self.seeded.chance(0.4)
            {
                independent.push((name.clone(), 1.0));
            } else {
                // a loop that also holds a coupling closes at zero only without an offset
                let offset = if far.is_none() { self.seeded.within(-0.5, 0.5) } else { 0.0 };
                let master = if k == 0 {
                    far.clone().unwrap_or_default()
                } else {
                    tree[self.seeded.below(k)].clone()
                };
                let multiplier = self.seeded.within(0.5, 1.5) * self.seeded.sign();
                // offsets are as random as the choice needs
                if offset > 0.1 {
                    self.curve(&name, &master, multiplier, offset);
                } else {
                    self.mimic(&master, multiplier, offset);
                }
                last = Some(name.clone());
            }
            tree.push(name);
            link = child;
            origin = add(origin, 1.0, self.seeded.vector(self.scale));
        }
        // the actuator of the first independent joint may sit on a joint that follows it
        let mut active: Vec<String> = independent.iter().map(|x| x.0.clone()).collect();
        if let (Some(last), [only], None) = (last, active.as_mut_slice(), &far)
            && self.seeded.chance(0.5)
        {
            *only = last;
        }
        let what = if far.is_some() { "couplings to another mechanism" } else { "couplings" };
        self.submechanism(
            what,
            Entry { type_name: "TRANSMISSION", tree, independent, active, loops: vec![] },
        );
    }
}
