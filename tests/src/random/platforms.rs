//! Platforms on sliding legs.

use super::NEW_TYPES;
use super::mechanisms::{X, Y, Z, rows, scaled};
use super::writer::{Entry, Kind, Link, Loop, Writer};
use crate::rigid::{Pose, Vector, add, cross, dot, unit};

impl Writer {
    /// A universal joint with two sliding legs, mirrored or not; its axes and those of the legs are
    /// tilted.
    pub(super) fn two_legs(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let height = size * self.seeded.within(0.3, 0.6);
        let mut first = add([X, Y][self.seeded.below(2)], 0.2, self.seeded.vector(1.0));
        if self.seeded.chance(0.3) {
            first = unit(first).map(f64::round);
        }
        let first = unit(first);
        let second = unit(add(cross(Z, first), 0.2, self.seeded.vector(1.0)));
        let (one, one_link) = self.joint(Kind::Turn, on, at.p, at.direction(first));
        let offset =
            if self.seeded.chance(0.7) { [0.0; 3] } else { self.seeded.vector(0.05 * size) };
        let (two, platform) =
            self.joint(Kind::Turn, one_link, at.point(offset), at.direction(second));
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
            let base = mirror(shape[0]);
            let pin = mirror(shape[1]);
            let x = mirror(shape[2]);
            let y = mirror(shape[3]);
            let along = mirror(shape[4]);
            let heavy = self.seeded.chance(0.8);
            let (a, a_link) =
                self.joint_with(Kind::Turn, on, at.point(base), at.direction(x), heavy);
            let (b, b_link) = self.joint(Kind::Turn, a_link, at.point(base), at.direction(y));
            let origin = if by_type {
                pin
            } else {
                add(base, self.seeded.within(0.2, 1.0), add(pin, -1.0, base))
            };
            let (c, slider) =
                self.joint(Kind::Slide, b_link, at.point(origin), at.direction(along));
            let swapped = self.seeded.chance(0.5);
            let frame = Pose { p: at.point(pin), ..self.seeded.pose(0.0) };
            let cut = self.mark(if swapped { slider } else { platform }, frame);
            let (predecessor, successor) =
                if swapped { (slider, platform) } else { (platform, slider) };
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

    /// Base point, pin, first and second axis, and slider direction of the leg at positive y.
    fn leg_shape(&mut self, height: f64) -> [Vector; 5] {
        let near = |writer: &mut Writer, v: Vector| add(v, 0.1 * height, writer.seeded.vector(1.0));
        let pin = near(self, [-0.7 * height, 0.8 * height, 0.6 * height]);
        let base = near(self, [-0.8 * height, 0.9 * height, -1.2 * height]);
        self.leg_between(base, pin)
    }

    /// The leg between two given points, in the order of [`Self::leg_shape`].
    fn leg_between(&mut self, base: Vector, pin: Vector) -> [Vector; 5] {
        let leg = unit(add(pin, -1.0, base));
        let guide = self.seeded.direction();
        let x = unit(add(cross(leg, guide), 0.2, self.seeded.vector(1.0)));
        let y = unit(cross(leg, x));
        // perpendicular to x for any direction of the leg
        let y = unit(add(y, -dot(x, y), x));
        let along = if self.seeded.chance(0.5) {
            leg
        } else {
            unit(add(leg, 0.15, self.seeded.vector(1.0)))
        };
        [base, pin, x, y, scaled(along, self.seeded.sign())]
    }

    /// A platform that slides along and turns about three axes each, on six legs.
    pub(super) fn six_legs(&mut self, on: Link, at: Pose) {
        let size = 0.5 * self.scale;
        let mut tree = Vec::new();
        let mut link = on;
        let mut independent = Vec::new();
        for (kind, reach) in [(Kind::Slide, 0.08 * size), (Kind::Turn, 0.12)] {
            for axis in [X, Y, Z] {
                // the slides carry the frames of the turns, whose axes meet in one point
                let (name, child) = self.joint(kind, link, at.p, at.direction(axis));
                tree.push(name.clone());
                independent.push((name, reach));
                link = child;
            }
        }
        let by_type = self.seeded.chance(0.3);
        let mut loops = Vec::new();
        let mut active = Vec::new();
        for k in 0..6 {
            let around = |angle: f64, radius: f64, z: f64| {
                scaled([radius * angle.cos(), radius * angle.sin(), z], size)
            };
            let pair = f64::from(k / 2) * std::f64::consts::TAU / 3.0;
            let side = if k % 2 == 0 { 1.0 } else { -1.0 };
            let pin =
                add(around(pair + 0.3 * side, 0.6, 0.0), 0.03 * size, self.seeded.vector(1.0));
            let base =
                add(around(pair + 0.8 * side, 1.0, -1.1), 0.03 * size, self.seeded.vector(1.0));
            let [base, pin, x, y, along] = self.leg_between(base, pin);
            let (a, a_link) = self.joint(Kind::Turn, on, at.point(base), at.direction(x));
            let (b, b_link) = self.joint(Kind::Turn, a_link, at.point(base), at.direction(y));
            let origin = if by_type {
                pin
            } else {
                add(base, self.seeded.within(0.2, 1.0), add(pin, -1.0, base))
            };
            let (c, slider) =
                self.joint(Kind::Slide, b_link, at.point(origin), at.direction(along));
            let swapped = self.seeded.chance(0.5);
            let frame = Pose { p: at.point(pin), ..self.seeded.pose(0.0) };
            let cut = self.mark(if swapped { slider } else { link }, frame);
            let (predecessor, successor) = if swapped { (slider, link) } else { (link, slider) };
            loops.push(Loop { cut, predecessor, successor, rows: rows(&[3, 4, 5]) });
            active.push(c.clone());
            tree.extend([a, b, c]);
        }
        let type_name = if self.numerical { "NUMERICAL" } else { "6UPS" };
        let loops = if by_type && !self.numerical { vec![] } else { loops };
        let what = if by_type { "6UPS by type" } else { "6UPS" };
        self.submechanism(what, Entry { type_name, tree, independent, active, loops });
    }

    /// A universal joint with two sliding legs whose second axis passes the first at a distance
    /// along the leg.
    pub(super) fn two_offset_legs(&mut self, on: Link, at: Pose) {
        let height = self.scale * self.seeded.within(0.3, 0.6);
        let first = unit(add(Y, 0.2, self.seeded.vector(1.0)));
        let second = unit(add(cross(Z, first), 0.2, self.seeded.vector(1.0)));
        let (one, one_link) = self.joint(Kind::Turn, on, at.p, at.direction(first));
        let (two, platform) = self.joint(Kind::Turn, one_link, at.p, at.direction(second));
        let mut tree = vec![one.clone(), two.clone()];
        let mut loops = Vec::new();
        let mut active = Vec::new();
        for side in [1.0, -1.0] {
            let near =
                |writer: &mut Writer, v: Vector| add(v, 0.05 * height, writer.seeded.vector(1.0));
            let pin = near(self, [-0.7 * height, 0.8 * side * height, 0.2 * height]);
            let base = near(self, [-0.8 * height, 0.8 * side * height, 1.8 * height]);
            let leg = unit(add(pin, -1.0, base));
            let x = unit(cross(leg, add(Y, 0.2, self.seeded.vector(1.0))));
            let y = unit(cross(leg, x));
            let arm = self.seeded.within(0.1, 0.2) * height;
            let elbow = add(base, arm, leg);
            let [x, y, along] = [x, y, leg].map(|v| at.direction(scaled(v, self.seeded.sign())));
            let (a, a_link) = self.joint(Kind::Turn, on, at.point(base), x);
            let (b, b_link) = self.joint(Kind::Turn, a_link, at.point(elbow), y);
            let (c, slider) = self.joint(Kind::Slide, b_link, at.point(pin), along);
            let frame = Pose { p: at.point(pin), ..self.seeded.pose(0.0) };
            let cut = self.mark(slider, frame);
            loops.push(Loop {
                cut,
                predecessor: slider,
                successor: platform,
                rows: rows(&[3, 4, 5]),
            });
            active.push(c.clone());
            tree.extend([a, b, c]);
        }
        let type_name = if self.numerical { "NUMERICAL" } else { "2SPRR+1U" };
        let independent = vec![(one, 0.25), (two, 0.25)];
        self.submechanism("2SPRR+1U", Entry { type_name, tree, independent, active, loops });
    }

    /// A universal joint with two sliding legs that end on arms, each arm turning on the platform.
    /// At zero the arm's axis, its tip and the leg's base lie in a plane, and the leg's base stays
    /// in the plane of the axis and the tip.
    pub(super) fn two_legs_on_arms(&mut self, on: Link, at: Pose) {
        let height = self.scale * self.seeded.within(0.3, 0.6);
        let first = unit(add(Y, 0.2, self.seeded.vector(1.0)));
        let second = unit(add(cross(Z, first), 0.2, self.seeded.vector(1.0)));
        let (one, one_link) = self.joint(Kind::Turn, on, at.p, at.direction(first));
        let (two, platform) = self.joint(Kind::Turn, one_link, at.p, at.direction(second));
        let mut arms = Vec::new();
        let mut legs = Vec::new();
        let mut loops = Vec::new();
        let mut active = Vec::new();
        for side in [1.0, -1.0] {
            let near =
                |writer: &mut Writer, v: Vector| add(v, 0.05 * height, writer.seeded.vector(1.0));
            let pivot = near(self, [-0.8 * height, 0.8 * side * height, 0.1 * height]);
            let n = unit(add(Z, 0.2, self.seeded.vector(1.0)));
            let radial = unit(cross(n, self.seeded.direction()));
            let tip = add(pivot, 0.15 * height, radial);
            let base =
                add(add(pivot, 1.5 * height, n), self.seeded.within(0.3, 0.5) * height, radial);
            let leg = unit(add(tip, -1.0, base));
            let x = unit(cross(leg, add(Y, 0.2, self.seeded.vector(1.0))));
            let y = unit(cross(leg, x));
            let [n_axis, x, y, along] =
                [n, x, y, leg].map(|v| at.direction(scaled(v, self.seeded.sign())));
            let (arm, arm_link) = self.joint(Kind::Turn, platform, at.point(pivot), n_axis);
            let (a, a_link) = self.joint(Kind::Turn, on, at.point(base), x);
            let (b, b_link) = self.joint(Kind::Turn, a_link, at.point(base), y);
            let (c, slider) = self.joint(Kind::Slide, b_link, at.point(tip), along);
            let ball = Pose { p: at.point(tip), ..self.seeded.pose(0.0) };
            let cut = self.mark(slider, ball);
            loops.push(Loop {
                cut,
                predecessor: slider,
                successor: arm_link,
                rows: rows(&[3, 4, 5]),
            });
            // x of this frame is normal to the plane
            let across = at.direction(cross(n, radial));
            let plane = Pose::from_columns(
                across,
                at.direction(n),
                cross(across, at.direction(n)),
                at.point(base),
            );
            let cut = self.mark(on, plane);
            loops.push(Loop { cut, predecessor: arm_link, successor: on, rows: rows(&[3]) });
            arms.push(arm);
            active.push(c.clone());
            legs.extend([a, b, c]);
        }
        let tree = [one.clone(), two.clone()].into_iter().chain(arms).chain(legs).collect();
        let by_type = NEW_TYPES && !self.numerical;
        let (type_name, loops) = if by_type { ("2SPRR+1U", vec![]) } else { ("NUMERICAL", loops) };
        let independent = vec![(one, 0.15), (two, 0.15)];
        self.submechanism("legs on arms", Entry { type_name, tree, independent, active, loops });
    }
}
