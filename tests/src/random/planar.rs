//! Mechanisms that move in a plane: lambdas, four-bars, parallelograms, slider-cranks.

use super::NEW_TYPES;
use super::mechanisms::{X, Z, rows, scaled};
use super::writer::{Entry, Kind, Link, Loop, Writer};
use crate::rigid::{Pose, Vector, add, cross, norm, unit};

impl Writer {
    /// Rocker, stator, slider: eccentric or not, pins out of the plane, every orientation.
    pub(super) fn lambda(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let base = size * self.seeded.within(0.4, 1.0);
        let arm = base
            * if self.seeded.chance(0.7) {
                self.seeded.within(0.3, 0.7)
            } else {
                self.seeded.within(2.0, 2.5)
            };
        let angle = self.seeded.sign() * self.seeded.within(1.1, 2.0);
        let lifts = if self.seeded.chance(0.5) { [0.0; 3] } else { self.seeded.vector(0.2 * size) };
        let rocker_at = [0.0, 0.0, lifts[0]];
        let stator_at = [base, 0.0, lifts[1]];
        let pin = [arm * angle.cos(), arm * angle.sin(), lifts[2]];
        let span = [pin[0] - base, pin[1], 0.0];
        let tilt = if self.seeded.chance(0.5) { 0.0 } else { self.seeded.within(-0.2, 0.2) };
        let (s, c) = tilt.sin_cos();
        let along = scaled(
            unit([c * span[0] - s * span[1], s * span[0] + c * span[1], 0.0]),
            self.seeded.sign(),
        );
        let [rocker_axis, stator_axis] = [(); 2].map(|()| scaled(Z, self.seeded.sign()));
        let to_root = |p: Vector| at.point(p);
        let (rocker, rocker_link) =
            self.joint(Kind::Turn, on, to_root(rocker_at), at.direction(rocker_axis));
        let (stator, stator_link) =
            self.joint(Kind::Turn, on, to_root(stator_at), at.direction(stator_axis));
        // without loops of its own the type takes the slider's origin as the pin
        let by_type = self.seeded.chance(0.3);
        let origin = if by_type || self.seeded.chance(0.5) {
            pin
        } else {
            add(pin, -self.seeded.within(0.1, 0.5), span)
        };
        let (slider, slider_link) =
            self.joint(Kind::Slide, stator_link, to_root(origin), at.direction(along));
        let turned = self.seeded.within(-3.0, 3.0);
        let mut frame = at.then(&Pose::from_rpy([0.0, 0.0, turned], pin));
        let in_plane = if self.seeded.chance(0.5) {
            rows(&[3, 4])
        } else {
            frame = Pose { p: frame.p, ..self.seeded.pose(0.0) };
            let back = |v: Vector| {
                frame
                    .inverse()
                    .then(&Pose { p: [0.0; 3], ..Pose::IDENTITY })
                    .direction(at.direction(v))
            };
            let row = |v: Vector| [0.0, 0.0, 0.0, v[0], v[1], v[2]];
            vec![row(back(along)), row(back(cross(Z, along)))]
        };
        let swapped = self.seeded.chance(0.5);
        let marked = if swapped { slider_link } else { rocker_link };
        let cut = self.mark(marked, frame);
        let (predecessor, successor) =
            if swapped { (slider_link, rocker_link) } else { (rocker_link, slider_link) };
        let given = vec![Loop { cut, predecessor, successor, rows: in_plane }];
        let type_name =
            if self.numerical { "NUMERICAL" } else { ["RRPR", "rrPr"][self.seeded.below(2)] };
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

    /// Points of a planar four-bar of any lengths: crank pivot, crank pin, coupler pin, follower
    /// pivot; coupler and follower are not aligned.
    fn any_four_bar(&mut self) -> [Vector; 4] {
        let size = self.scale;
        let flat = |v: Vector| [v[0], v[1], 0.0];
        loop {
            let [a, b, f] = [(); 3].map(|()| flat(self.seeded.vector(size)));
            let coupler = add(b, -1.0, a);
            let follower = add(b, -1.0, f);
            let lengths = [norm(a), norm(coupler), norm(follower), norm(f)];
            let apart = cross(coupler, follower)[2].abs() / (norm(coupler) * norm(follower));
            // coupler and follower must stay unaligned over the crank's reach
            if lengths.iter().all(|x| *x > 0.25 * size)
                && apart > 0.6
                && norm(coupler).min(norm(follower)) > norm(a)
            {
                return [[0.0; 3], a, b, f];
            }
        }
    }

    /// Crank, coupler and follower, cut at the coupler's far pin by two rows or by the five rows of
    /// a revolute joint, with any actuation.
    pub(super) fn four_bar(&mut self, on: Link, at: Pose) {
        let [o, a, b, f] = self.any_four_bar();
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
        let loops =
            vec![Loop { cut, predecessor: follower_link, successor: coupler_link, rows: of }];
        let (what, active) = match self.seeded.below(6) {
            0 => ("four-bar without actuator", vec![]),
            1 => ("four-bar with two actuators", vec![crank.clone(), follower.clone()]),
            2 => ("four-bar", vec![follower.clone()]),
            _ => ("four-bar", vec![crank.clone()]),
        };
        let by_name = if NEW_TYPES { "FOURBAR" } else { "NUMERICAL" };
        let type_name = if self.seeded.chance(0.2) { "PARALLELOGRAMCHAIN" } else { by_name };
        let type_name = if self.numerical { "NUMERICAL" } else { type_name };
        let tree = vec![crank.clone(), coupler, follower];
        self.submechanism(
            what,
            Entry { type_name, tree, independent: vec![(crank, 0.2)], active, loops },
        );
    }

    /// A four-bar as one chain of four revolute joints that is welded to its base: six rows, three
    /// of them redundant.
    pub(super) fn welded_four_bar(&mut self, on: Link, at: Pose) {
        let points = self.any_four_bar();
        let mut link = on;
        let mut tree = Vec::new();
        for p in points {
            let axis = scaled(Z, self.seeded.sign());
            let (name, child) = self.joint(Kind::Turn, link, at.point(p), at.direction(axis));
            tree.push(name);
            link = child;
        }
        let frame = Pose { p: at.point(points[3]), ..self.seeded.pose(0.0) };
        let cut = self.mark(on, frame);
        let loops =
            vec![Loop { cut, predecessor: on, successor: link, rows: rows(&[0, 1, 2, 3, 4, 5]) }];
        let independent = vec![(tree[0].clone(), 0.2)];
        let active = vec![tree[3].clone()];
        self.submechanism(
            "welded four-bar",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }

    /// Crank, coupler and a slider beside them, eccentric or not; cut at the coupler's far pin.
    pub(super) fn slider_crank(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let angle = self.seeded.within(-3.0, 3.0);
        let crank_pin = scaled([angle.cos(), angle.sin(), 0.0], 0.3 * size);
        let coupler = self.seeded.within(0.8, 1.5) * size;
        let lean = self.seeded.within(-0.7, 0.7);
        let pin = add(crank_pin, coupler, [lean.cos(), lean.sin(), 0.0]);
        let z = |writer: &mut Writer| at.direction(scaled(Z, writer.seeded.sign()));
        let axis = z(self);
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.p, axis);
        let axis = z(self);
        let (coupler, coupler_link) = self.joint(Kind::Turn, crank_link, at.point(crank_pin), axis);
        // the slider may start anywhere on its line, which is the plane's x
        let origin = add(pin, self.seeded.within(-0.3, 0.3) * size, X);
        let along = at.direction(scaled(X, self.seeded.sign()));
        let (slider, slider_link) = self.joint(Kind::Slide, on, at.point(origin), along);
        let turned = self.seeded.within(-3.0, 3.0);
        let swapped = self.seeded.chance(0.5);
        let cut = self.mark(
            if swapped { slider_link } else { coupler_link },
            at.then(&Pose::from_rpy([0.0, 0.0, turned], pin)),
        );
        let (predecessor, successor) =
            if swapped { (slider_link, coupler_link) } else { (coupler_link, slider_link) };
        let loops = vec![Loop { cut, predecessor, successor, rows: rows(&[3, 4]) }];
        let active = vec![if self.seeded.chance(0.5) { slider.clone() } else { crank.clone() }];
        let type_name = if NEW_TYPES && !self.numerical { "SLIDERCRANK" } else { "NUMERICAL" };
        let tree = vec![crank.clone(), coupler, slider];
        // where the slider drives, crank and coupler must not be aligned
        let along_coupler = add(pin, -1.0, crank_pin);
        let apart =
            cross(crank_pin, along_coupler)[2].abs() / (norm(crank_pin) * norm(along_coupler));
        let active = if apart > 0.7 { active } else { vec![crank.clone()] };
        self.submechanism(
            "slider-crank",
            Entry { type_name, tree, independent: vec![(crank, 0.3)], active, loops },
        );
    }

    /// A parallelogram by its loop or by joints that follow the crank; each link lies in a plane of
    /// its own.
    pub(super) fn parallelogram(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let angle = self.seeded.sign() * self.seeded.within(1.0, 2.0);
        let arm = scaled([angle.cos(), angle.sin(), 0.0], self.seeded.within(0.3, 0.8) * size);
        let base = [size, 0.0, 0.0];
        let lift =
            |writer: &mut Writer, p: Vector| add(p, writer.seeded.within(-0.1, 0.1) * size, Z);
        let signs = [(); 3].map(|()| self.seeded.sign());
        let axis = |k: usize| at.direction(scaled(Z, signs[k]));
        let places = [[0.0; 3], base, arm].map(|p| at.point(lift(self, p)));
        let follows = self.seeded.chance(0.4);
        let (crank, crank_link) = self.joint(Kind::Turn, on, places[0], axis(0));
        let (follower, follower_link) = self.joint(Kind::Turn, on, places[1], axis(1));
        if follows {
            self.mimic(&crank, signs[0] * signs[1], 0.0);
        }
        let (coupler, coupler_link) = self.joint(Kind::Turn, crank_link, places[2], axis(2));
        if follows {
            self.mimic(&crank, -signs[0] * signs[2], 0.0);
        }
        let turned = self.seeded.within(-3.0, 3.0);
        let frame = at.then(&Pose::from_rpy([0.0, 0.0, turned], add(base, 1.0, arm)));
        let loops = if follows {
            vec![]
        } else {
            let cut = self.mark(follower_link, frame);
            vec![Loop {
                cut,
                predecessor: follower_link,
                successor: coupler_link,
                rows: rows(&[3, 4]),
            }]
        };
        let active = vec![if self.seeded.chance(0.3) { follower.clone() } else { crank.clone() }];
        let type_name = if self.numerical && !follows { "NUMERICAL" } else { "PARALLELOGRAMCHAIN" };
        let what = if follows { "parallelogram by couplings" } else { "parallelogram" };
        let tree = vec![crank.clone(), follower, coupler];
        self.submechanism(
            what,
            Entry { type_name, tree, independent: vec![(crank, 0.5)], active, loops },
        );
    }

    /// Two four-bars in a row that share the first one's follower: one cluster with two cuts.
    pub(super) fn two_loops(&mut self, on: Link, at: Pose) {
        let [o, a, b, f] = self.any_four_bar();
        let size = self.scale;
        let z = at.direction(Z);
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.point(o), z);
        let (coupler, coupler_link) = self.joint(Kind::Turn, crank_link, at.point(a), z);
        let (follower, follower_link) = self.joint(Kind::Turn, on, at.point(f), z);
        // the second coupler hangs on the first follower, its own follower on the base
        let (c, d, g) = loop {
            let [c, d, g] = [(); 3].map(|()| self.seeded.vector(size)).map(|v| [v[0], v[1], 0.0]);
            let coupler = add(d, -1.0, c);
            let follower = add(d, -1.0, g);
            let apart = cross(coupler, follower)[2].abs() / (norm(coupler) * norm(follower));
            if apart > 0.6
                && norm(coupler).min(norm(follower)) > 2.0 * norm(add(c, -1.0, f)).max(0.1 * size)
            {
                break (c, d, g);
            }
        };
        let (second, second_link) = self.joint(Kind::Turn, follower_link, at.point(c), z);
        let (last, last_link) = self.joint(Kind::Turn, on, at.point(g), z);
        let mut loops = Vec::new();
        for (p, predecessor, successor) in
            [(b, follower_link, coupler_link), (d, second_link, last_link)]
        {
            let turned = self.seeded.within(-3.0, 3.0);
            let cut = self.mark(predecessor, at.then(&Pose::from_rpy([0.0, 0.0, turned], p)));
            loops.push(Loop { cut, predecessor, successor, rows: rows(&[3, 4]) });
        }
        let tree = vec![crank.clone(), coupler, follower, second, last];
        let independent = vec![(crank.clone(), 0.12)];
        let active = vec![crank];
        self.submechanism(
            "two loops",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }
}
