//! The mechanisms that random robots are made of. Each is drawn in a frame of its own, x, y, z, that is put anywhere on a link.

use super::writer::{Entry, Kind, Link, Loop, Writer};
use crate::rigid::{Pose, Vector, add, cross, dot, norm, unit};

const X: Vector = [1.0, 0.0, 0.0];
const Y: Vector = [0.0, 1.0, 0.0];
const Z: Vector = [0.0, 0.0, 1.0];

/// Rows along the axes of the cut frame: 0 to 2 angular, 3 to 5 linear.
fn rows(which: &[usize]) -> Vec<[f64; 6]> {
    which.iter().map(|k| std::array::from_fn(|i| if i == *k { 1.0 } else { 0.0 })).collect()
}

fn scaled(v: Vector, s: f64) -> Vector {
    add([0.0; 3], s, v)
}

impl Writer {
    /// One mechanism of any kind on any link.
    pub(super) fn mechanism(&mut self) {
        let last = self.links.len() - 1;
        // what hangs beside a floating base could not be coupled to what it carries
        let first = usize::from(self.floats);
        let on = if self.seeded.chance(0.5) { last } else { self.seeded.below(last + 1).max(first) };
        let at = self.links[on].1.then(&self.seeded.pose(self.scale));
        match self.seeded.below(20) {
            0..4 => self.serial(on, at),
            4..8 => self.lambda(on, at),
            8..11 => self.two_legs(on, at),
            11..13 => self.four_bar(on, at),
            13 => self.welded_four_bar(on, at),
            14..16 => self.rusr(on, at),
            16 => self.seven_revolutes(on, at),
            17 if !self.rounded => self.bricard(on, at),
            _ => self.coupled(on, at),
        }
    }

    /// A chain of free joints, now and then one without an actuator.
    fn serial(&mut self, on: Link, at: Pose) {
        let n = 1 + self.seeded.below(4);
        let (mut tree, mut link, mut origin) = (Vec::new(), on, at.p);
        let mut revolutes = true;
        for _ in 0..n {
            let kind = if self.seeded.chance(0.25) { Kind::Slide } else { Kind::Turn };
            let axis = if self.seeded.chance(0.4) { [X, Y, Z][self.seeded.below(3)] } else { self.seeded.direction() };
            revolutes &= kind == Kind::Turn;
            let reach = if kind == Kind::Turn { 3.0 } else { self.scale };
            let (name, child) = self.joint(kind, link, origin, axis);
            tree.push((name, reach));
            link = child;
            origin = add(origin, 1.0, self.seeded.vector(self.scale));
        }
        let names: Vec<String> = tree.iter().map(|x| x.0.clone()).collect();
        let mut active = names.clone();
        if self.seeded.chance(0.15) {
            active.remove(self.seeded.below(n));
        }
        let letters = format!("{n}R");
        let type_name = if revolutes && self.seeded.chance(0.5) { letters.as_str() } else { "SERIAL" };
        self.submechanism("serial", Entry { type_name, tree: names, independent: tree, active, loops: vec![] });
    }

    /// Rocker, stator, slider: eccentric or not, pins out of the plane, every sense.
    fn lambda(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let base = size * self.seeded.within(0.4, 1.0);
        let arm = base * if self.seeded.chance(0.7) { self.seeded.within(0.3, 0.7) } else { self.seeded.within(2.0, 2.5) };
        let angle = self.seeded.sign() * self.seeded.within(1.1, 2.0);
        let lifts = if self.seeded.chance(0.5) { [0.0; 3] } else { self.seeded.vector(0.2 * size) };
        let (rocker_at, stator_at) = ([0.0, 0.0, lifts[0]], [base, 0.0, lifts[1]]);
        let pin = [arm * angle.cos(), arm * angle.sin(), lifts[2]];
        let span = [pin[0] - base, pin[1], 0.0];
        let tilt = if self.seeded.chance(0.5) { 0.0 } else { self.seeded.within(-0.2, 0.2) };
        let (s, c) = tilt.sin_cos();
        let along = scaled(unit([c * span[0] - s * span[1], s * span[0] + c * span[1], 0.0]), self.seeded.sign());
        let [rocker_axis, stator_axis] = [(); 2].map(|()| scaled(Z, self.seeded.sign()));
        let to_root = |p: Vector| at.point(p);
        let (rocker, rocker_link) = self.joint(Kind::Turn, on, to_root(rocker_at), at.direction(rocker_axis));
        let (stator, stator_link) = self.joint(Kind::Turn, on, to_root(stator_at), at.direction(stator_axis));
        // without loops of its own the type takes the slider's origin for the pin
        let by_type = self.seeded.chance(0.3);
        let origin = if by_type || self.seeded.chance(0.5) { pin } else { add(pin, -self.seeded.within(0.1, 0.5), span) };
        let (slider, slider_link) = self.joint(Kind::Slide, stator_link, to_root(origin), at.direction(along));
        let turned = self.seeded.within(-3.0, 3.0);
        let mut frame = at.then(&Pose::from_rpy([0.0, 0.0, turned], pin));
        let in_plane = if self.seeded.chance(0.5) {
            rows(&[3, 4])
        } else {
            frame = Pose { p: frame.p, ..self.seeded.pose(0.0) };
            let back = |v: Vector| frame.inverse().then(&Pose { p: [0.0; 3], ..Pose::IDENTITY }).direction(at.direction(v));
            let row = |v: Vector| [0.0, 0.0, 0.0, v[0], v[1], v[2]];
            vec![row(back(along)), row(back(cross(Z, along)))]
        };
        let swapped = self.seeded.chance(0.5);
        let marked = if swapped { slider_link } else { rocker_link };
        let cut = self.mark(marked, frame);
        let (predecessor, successor) = if swapped { (slider_link, rocker_link) } else { (rocker_link, slider_link) };
        let given = vec![Loop { cut, predecessor, successor, rows: in_plane }];
        let type_name = if self.numerical { "NUMERICAL" } else { ["RRPR", "rrPr"][self.seeded.below(2)] };
        if self.numerical {
            self.seeded.below(2);
        }
        let active = if self.seeded.chance(0.9) { slider.clone() } else { rocker.clone() };
        let entry = Entry {
            type_name,
            tree: vec![rocker.clone(), stator, slider],
            independent: vec![(rocker, 0.5)],
            active: vec![active],
            loops: if by_type && !self.numerical { vec![] } else { given },
        };
        self.submechanism(if by_type { "lambda by type" } else { "lambda" }, entry);
    }

    /// A universal joint with two sliding legs, its axes and those of the legs tilted, legs mirrored or not.
    fn two_legs(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let height = size * self.seeded.within(0.3, 0.6);
        let mut first = add([X, Y][self.seeded.below(2)], 0.2, self.seeded.vector(1.0));
        if self.seeded.chance(0.3) {
            first = unit(first).map(f64::round);
        }
        let first = unit(first);
        let second = unit(add(cross(Z, first), 0.2, self.seeded.vector(1.0)));
        let (one, one_link) = self.joint(Kind::Turn, on, at.p, at.direction(first));
        let offset = if self.seeded.chance(0.7) { [0.0; 3] } else { self.seeded.vector(0.05 * size) };
        let (two, platform) = self.joint(Kind::Turn, one_link, at.point(offset), at.direction(second));
        let by_type = self.seeded.chance(0.3);
        let mirrored = self.seeded.chance(0.5);
        let mut legs = Vec::new();
        let mut loops = Vec::new();
        let mut shape = self.leg_shape(height);
        for side in [1.0, -1.0] {
            if side < 0.0 && !mirrored {
                shape = self.leg_shape(height);
            }
            let mirror = |v: Vector| [v[0], side * v[1], v[2]];
            let (base, pin, x, y, along) = (mirror(shape[0]), mirror(shape[1]), mirror(shape[2]), mirror(shape[3]), mirror(shape[4]));
            let heavy = self.seeded.chance(0.8);
            let (a, a_link) = self.joint_with(Kind::Turn, on, at.point(base), at.direction(x), heavy);
            let (b, b_link) = self.joint(Kind::Turn, a_link, at.point(base), at.direction(y));
            let origin = if by_type { pin } else { add(base, self.seeded.within(0.2, 1.0), add(pin, -1.0, base)) };
            let (c, slider) = self.joint(Kind::Slide, b_link, at.point(origin), at.direction(along));
            let swapped = self.seeded.chance(0.5);
            let frame = Pose { p: at.point(pin), ..self.seeded.pose(0.0) };
            let cut = self.mark(if swapped { slider } else { platform }, frame);
            let (predecessor, successor) = if swapped { (slider, platform) } else { (platform, slider) };
            loops.push(Loop { cut, predecessor, successor, rows: rows(&[3, 4, 5]) });
            legs.push([a, b, c]);
        }
        // the last independent joint of a list without loops carries the platform
        let turned = self.seeded.chance(0.3);
        let mut independent = vec![(one.clone(), 0.3), (two.clone(), 0.3)];
        if turned {
            independent.reverse();
        }
        let mut tree: Vec<String> = independent.iter().map(|x| x.0.clone()).collect();
        tree.extend(legs.iter().flatten().cloned());
        let what = match (by_type, turned) {
            (true, true) => "2SPU+1U by type turned",
            (true, false) => "2SPU+1U by type",
            (false, true) => "2SPU+1U turned",
            (false, false) => "2SPU+1U",
        };
        let entry = Entry {
            type_name: if self.numerical { "NUMERICAL" } else { "2SPU+1U" },
            tree,
            independent,
            active: legs.iter().map(|leg| leg[2].clone()).collect(),
            loops: if by_type && !self.numerical { vec![] } else { loops },
        };
        self.submechanism(what, entry);
    }

    /// Base point, pin, first and second axis, slider of the leg at positive y.
    fn leg_shape(&mut self, height: f64) -> [Vector; 5] {
        let near = |writer: &mut Writer, v: Vector| add(v, 0.1 * height, writer.seeded.vector(1.0));
        let pin = near(self, [-0.7 * height, 0.8 * height, 0.6 * height]);
        let base = near(self, [-0.8 * height, 0.9 * height, -1.2 * height]);
        let leg = unit(add(pin, -1.0, base));
        let guide = self.seeded.direction();
        let x = unit(add(cross(leg, guide), 0.2, self.seeded.vector(1.0)));
        let y = unit(cross(leg, x));
        // perpendicular to x, whatever the leg's direction
        let y = unit(add(y, -dot(x, y), x));
        let along = if self.seeded.chance(0.5) { leg } else { unit(add(leg, 0.15, self.seeded.vector(1.0))) };
        [base, pin, x, y, scaled(along, self.seeded.sign())]
    }

    /// Points of a crank-rocker in its plane: crank pivot, crank pin, coupler pin, follower pivot.
    fn crank_rocker(&mut self) -> [Vector; 4] {
        let size = self.scale;
        let angle = self.seeded.sign() * self.seeded.within(1.0, 2.0);
        let (crank, coupler, follower) = (0.35 * size, 0.9 * size, 0.7 * size);
        let a = [crank * angle.cos(), crank * angle.sin(), 0.0];
        let o = [size, 0.0, 0.0];
        // where the circles of coupler and follower meet
        let span = add(o, -1.0, a);
        let d = norm(span);
        let along = (d * d + coupler * coupler - follower * follower) / (2.0 * d);
        let aside = (coupler * coupler - along * along).max(0.0).sqrt() * self.seeded.sign();
        let b = add(add(a, along / d, span), aside / d, [-span[1], span[0], 0.0]);
        [[0.0; 3], a, b, o]
    }

    /// Crank, coupler and follower; cut at the coupler's far pin by two rows, or by the five of a revolute joint. Any actuation.
    fn four_bar(&mut self, on: Link, at: Pose) {
        let [o, a, b, f] = self.crank_rocker();
        let z = |writer: &mut Writer| at.direction(scaled(Z, writer.seeded.sign()));
        let axis = z(self);
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.point(o), axis);
        let axis = z(self);
        let (coupler, coupler_link) = self.joint(Kind::Turn, crank_link, at.point(a), axis);
        let axis = z(self);
        let (follower, follower_link) = self.joint(Kind::Turn, on, at.point(f), axis);
        let turned = self.seeded.within(-3.0, 3.0);
        let cut = self.mark(follower_link, at.then(&Pose::from_rpy([0.0, 0.0, turned], b)));
        let five = self.seeded.chance(0.4);
        let of = if five { rows(&[0, 1, 3, 4, 5]) } else { rows(&[3, 4]) };
        let loops = vec![Loop { cut, predecessor: follower_link, successor: coupler_link, rows: of }];
        let (what, active) = match self.seeded.below(6) {
            0 => ("four-bar without actuator", vec![]),
            1 => ("four-bar with two actuators", vec![crank.clone(), follower.clone()]),
            2 => ("four-bar", vec![follower.clone()]),
            _ => ("four-bar", vec![crank.clone()]),
        };
        let type_name = if self.seeded.chance(0.3) { "PARALLELOGRAMCHAIN" } else { "NUMERICAL" };
        let tree = vec![crank.clone(), coupler, follower];
        self.submechanism(what, Entry { type_name, tree, independent: vec![(crank, 0.4)], active, loops });
    }

    /// A four-bar as one chain of four revolute joints that is welded to its base: six rows, three of them redundant.
    fn welded_four_bar(&mut self, on: Link, at: Pose) {
        let points = self.crank_rocker();
        let (mut link, mut tree) = (on, Vec::new());
        for p in points {
            let axis = scaled(Z, self.seeded.sign());
            let (name, child) = self.joint(Kind::Turn, link, at.point(p), at.direction(axis));
            tree.push(name);
            link = child;
        }
        let frame = Pose { p: at.point(points[3]), ..self.seeded.pose(0.0) };
        let cut = self.mark(on, frame);
        let loops = vec![Loop { cut, predecessor: on, successor: link, rows: rows(&[0, 1, 2, 3, 4, 5]) }];
        let (independent, active) = (vec![(tree[0].clone(), 0.4)], vec![tree[3].clone()]);
        self.submechanism("welded four-bar", Entry { type_name: "NUMERICAL", tree, independent, active, loops });
    }

    /// A spatial four-bar: crank, coupler on a universal joint, ball joint, rocker.
    fn rusr(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let draw = loop {
            let (a, b) = (scaled(self.seeded.direction(), 0.3 * size), self.seeded.vector(size));
            let (crank, rocker) = (self.seeded.direction(), self.seeded.direction());
            let foot = add(b, 0.6 * size, self.seeded.direction());
            let span = add(b, -1.0, a);
            let coupler = unit(span);
            let u1 = unit(cross(coupler, self.seeded.direction()));
            let u2 = unit(add(cross(coupler, u1), 0.2, self.seeded.direction()));
            let moves = cross(rocker, add(b, -1.0, foot));
            let tip = dot(moves, cross(cross(u1, span), cross(u2, span)));
            if norm(span) > 0.6 * size && tip.abs() > 0.4 * norm(moves) * dot(span, span) && norm(moves) > 0.3 * size {
                break (a, b, crank, rocker, foot, u1, u2);
            }
        };
        let (a, b, crank_axis, rocker_axis, foot, u1, u2) = draw;
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.p, at.direction(crank_axis));
        let (first, first_link) = self.joint(Kind::Turn, crank_link, at.point(a), at.direction(u1));
        let (second, coupler) = self.joint(Kind::Turn, first_link, at.point(a), at.direction(u2));
        let (rocker, rocker_link) = self.joint(Kind::Turn, on, at.point(foot), at.direction(rocker_axis));
        let frame = Pose { p: at.point(b), ..self.seeded.pose(0.0) };
        let cut = self.mark(coupler, frame);
        let loops = vec![Loop { cut, predecessor: coupler, successor: rocker_link, rows: rows(&[3, 4, 5]) }];
        let tree = vec![crank.clone(), first, second, rocker];
        let (independent, active) = (vec![(crank.clone(), 0.15)], vec![crank]);
        self.submechanism("RUSR", Entry { type_name: "NUMERICAL", tree, independent, active, loops });
    }

    /// One loop of seven revolute joints, cut by a weld (six rows) or at its last joint (five).
    fn seven_revolutes(&mut self, on: Link, at: Pose) {
        let at_revolute = self.seeded.chance(0.5);
        let (points, axes, free) = loop {
            let points: Vec<Vector> = (0..7).map(|_| self.seeded.vector(0.7 * self.scale)).collect();
            let axes: Vec<Vector> = (0..7).map(|_| self.seeded.direction()).collect();
            let column = |k: usize| {
                let m = scaled(cross(points[k], axes[k]), 1.0 / self.scale);
                [axes[k][0], axes[k][1], axes[k][2], m[0], m[1], m[2]]
            };
            let least = |free: usize| least_pivot((0..7).filter(|k| *k != free).map(column).collect());
            let free = (0..6).max_by(|a, b| least(*a).total_cmp(&least(*b))).unwrap_or(0);
            if least(free) > 0.3 {
                break (points, axes, free);
            }
        };
        let (mut link, mut tree) = (on, Vec::new());
        for k in 0..if at_revolute { 6 } else { 7 } {
            let (name, child) = self.joint(Kind::Turn, link, at.point(points[k]), at.direction(axes[k]));
            tree.push(name);
            link = child;
        }
        // z of the cut frame along the axis that is cut
        let z = at.direction(axes[6]);
        let x = unit(cross(z, self.seeded.direction()));
        let frame = Pose::from_columns(x, cross(z, x), z, at.point(points[6]));
        let marked = if self.seeded.chance(0.5) { on } else { link };
        let cut = self.mark(marked, frame);
        let of = if at_revolute { rows(&[3, 4, 5, 0, 1]) } else { rows(&[0, 1, 2, 3, 4, 5]) };
        let (predecessor, successor) = if self.seeded.chance(0.5) { (on, link) } else { (link, on) };
        let loops = vec![Loop { cut, predecessor, successor, rows: of }];
        let (independent, active) = (vec![(tree[free].clone(), 0.12)], vec![tree[free].clone()]);
        let what = if at_revolute { "6R cut at a revolute joint" } else { "7R welded" };
        self.submechanism(what, Entry { type_name: "NUMERICAL", tree, independent, active, loops });
    }

    /// Bricard's mechanism, overconstrained: six rows of rank five.
    fn bricard(&mut self, on: Link, at: Pose) {
        const POINTS: [Vector; 6] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, -1.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]];
        let (mut link, mut tree) = (on, Vec::new());
        for (p, axis) in POINTS.into_iter().zip([Y, Z, X, Y, Z, X]) {
            let (name, child) = self.joint(Kind::Turn, link, at.point(scaled(p, self.scale)), at.direction(axis));
            tree.push(name);
            link = child;
        }
        let frame = Pose { p: at.point(scaled(POINTS[5], self.scale)), ..self.seeded.pose(0.0) };
        let cut = self.mark(link, frame);
        let loops = vec![Loop { cut, predecessor: on, successor: link, rows: rows(&[0, 1, 2, 3, 4, 5]) }];
        let (independent, active) = (vec![(tree[0].clone(), 0.3)], vec![tree[0].clone()]);
        self.submechanism("Bricard", Entry { type_name: "NUMERICAL", tree, independent, active, loops });
    }

    /// A chain in which joints follow others, also one after the other, or a joint of another mechanism.
    fn coupled(&mut self, on: Link, at: Pose) {
        let n = 2 + self.seeded.below(3);
        let far = if self.seeded.chance(0.3) && !self.masters.is_empty() {
            Some(self.masters[self.seeded.below(self.masters.len())].clone())
        } else {
            None
        };
        let (mut tree, mut independent): (Vec<String>, Vec<(String, f64)>) = (Vec::new(), Vec::new());
        let (mut link, mut origin, mut last) = (on, at.p, None);
        for k in 0..n {
            let axis = self.seeded.direction();
            let (name, child) = self.joint(Kind::Turn, link, origin, axis);
            if k == 0 && far.is_none() || k > 0 && independent.len() < n / 2 && self.seeded.chance(0.4) {
                independent.push((name.clone(), 1.0));
            } else {
                // a loop that also holds a coupling is closed at zero only without an offset
                let offset = if far.is_none() { self.seeded.within(-0.5, 0.5) } else { 0.0 };
                let master = if k == 0 { far.clone().unwrap_or_default() } else { tree[self.seeded.below(k)].clone() };
                let multiplier = self.seeded.within(0.5, 1.5) * self.seeded.sign();
                self.mimic(&master, multiplier, offset);
                last = Some(name.clone());
            }
            tree.push(name);
            link = child;
            origin = add(origin, 1.0, self.seeded.vector(self.scale));
        }
        // the actuator of the first independent may sit on a joint that follows it
        let mut active: Vec<String> = independent.iter().map(|x| x.0.clone()).collect();
        if let (Some(last), [only], None) = (last, active.as_mut_slice(), &far)
            && self.seeded.chance(0.5)
        {
            *only = last;
        }
        let what = if far.is_some() { "couplings to another mechanism" } else { "couplings" };
        self.submechanism(what, Entry { type_name: "TRANSMISSION", tree, independent, active, loops: vec![] });
    }
}

/// Least pivot of a square matrix of unit-sized columns under full pivoting.
fn least_pivot(mut columns: Vec<[f64; 6]>) -> f64 {
    let mut least = f64::INFINITY;
    let mut rows: Vec<usize> = (0..6).collect();
    while !columns.is_empty() {
        let (mut c, mut r) = (0, 0);
        for a in 0..columns.len() {
            for b in 0..rows.len() {
                if columns[a][rows[b]].abs() > columns[c][rows[r]].abs() {
                    (c, r) = (a, b);
                }
            }
        }
        let (column, row) = (columns.swap_remove(c), rows.swap_remove(r));
        least = least.min(column[row].abs());
        for other in &mut columns {
            let factor = other[row] / column[row];
            (0..6).for_each(|i| other[i] -= factor * column[i]);
        }
    }
    least
}
