//! Spatial loops of revolute joints, overconstrained ones included.

use super::mechanisms::{X, Y, Z, rows, scaled};
use super::writer::{Entry, Kind, Link, Loop, Writer};
use crate::rigid::{Pose, Vector, add, cross, dot, norm, unit};

impl Writer {
    /// A spatial four-bar: crank, coupler on a universal joint, ball joint, rocker.
    pub(super) fn rusr(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let draw = loop {
            let a = scaled(self.seeded.direction(), 0.3 * size);
            let b = self.seeded.vector(size);
            let crank = self.seeded.direction();
            let rocker = self.seeded.direction();
            let foot = add(b, 0.6 * size, self.seeded.direction());
            let span = add(b, -1.0, a);
            let coupler = unit(span);
            let u1 = unit(cross(coupler, self.seeded.direction()));
            let u2 = unit(add(cross(coupler, u1), 0.2, self.seeded.direction()));
            let moves = cross(rocker, add(b, -1.0, foot));
            let tip = dot(moves, cross(cross(u1, span), cross(u2, span)));
            if norm(span) > 0.6 * size
                && tip.abs() > 0.4 * norm(moves) * dot(span, span)
                && norm(moves) > 0.3 * size
            {
                break (a, b, crank, rocker, foot, u1, u2);
            }
        };
        let (a, b, crank_axis, rocker_axis, foot, u1, u2) = draw;
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.p, at.direction(crank_axis));
        let (first, first_link) = self.joint(Kind::Turn, crank_link, at.point(a), at.direction(u1));
        let (second, coupler) = self.joint(Kind::Turn, first_link, at.point(a), at.direction(u2));
        let (rocker, rocker_link) =
            self.joint(Kind::Turn, on, at.point(foot), at.direction(rocker_axis));
        let frame = Pose { p: at.point(b), ..self.seeded.pose(0.0) };
        let cut = self.mark(coupler, frame);
        let loops = vec![Loop {
            cut,
            predecessor: coupler,
            successor: rocker_link,
            rows: rows(&[3, 4, 5]),
        }];
        let tree = vec![crank.clone(), first, second, rocker];
        let independent = vec![(crank.clone(), 0.15)];
        let active = vec![crank];
        self.submechanism(
            "RUSR",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }

    /// A spatial four-bar whose coupler has ball joints at both ends, so that it spins freely about
    /// its own axis.
    pub(super) fn rssr(&mut self, on: Link, at: Pose) {
        let size = self.scale;
        let (a, b, crank_axis, rocker_axis, foot) = loop {
            let a = scaled(self.seeded.direction(), 0.3 * size);
            let b = self.seeded.vector(size);
            let crank = self.seeded.direction();
            let rocker = self.seeded.direction();
            let foot = add(b, 0.6 * size, self.seeded.direction());
            let span = add(b, -1.0, a);
            let moves = cross(rocker, add(b, -1.0, foot));
            // the rocker must move its end along the coupler
            if norm(span) > 0.6 * size
                && dot(moves, span).abs() > 0.5 * norm(moves) * norm(span)
                && norm(moves) > 0.3 * size
            {
                break (a, b, crank, rocker, foot);
            }
        };
        let (crank, crank_link) = self.joint(Kind::Turn, on, at.p, at.direction(crank_axis));
        let (ball, coupler) = self.ball(crank_link, at.point(a));
        let (rocker, rocker_link) =
            self.joint(Kind::Turn, on, at.point(foot), at.direction(rocker_axis));
        let frame = Pose { p: at.point(b), ..self.seeded.pose(0.0) };
        let cut = self.mark(coupler, frame);
        let loops = vec![Loop {
            cut,
            predecessor: coupler,
            successor: rocker_link,
            rows: rows(&[3, 4, 5]),
        }];
        let tree = vec![crank.clone(), ball, rocker];
        let independent = vec![(crank.clone(), 0.15)];
        let active = vec![crank];
        self.submechanism(
            "RSSR",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }

    /// One loop of seven revolute joints, cut by a weld (six rows) or at its last joint (five).
    pub(super) fn seven_revolutes(&mut self, on: Link, at: Pose) {
        let at_revolute = self.seeded.chance(0.5);
        let (points, axes, free) = loop {
            let points: Vec<Vector> =
                (0..7).map(|_| self.seeded.vector(0.7 * self.scale)).collect();
            let axes: Vec<Vector> = (0..7).map(|_| self.seeded.direction()).collect();
            let column = |k: usize| {
                let m = scaled(cross(points[k], axes[k]), 1.0 / self.scale);
                [axes[k][0], axes[k][1], axes[k][2], m[0], m[1], m[2]]
            };
            let least =
                |free: usize| least_pivot((0..7).filter(|k| *k != free).map(column).collect());
            let free = (0..6).max_by(|a, b| least(*a).total_cmp(&least(*b))).unwrap_or(0);
            if least(free) > 0.3 {
                break (points, axes, free);
            }
        };
        let mut link = on;
        let mut tree = Vec::new();
        for k in 0..if at_revolute { 6 } else { 7 } {
            let (name, child) =
                self.joint(Kind::Turn, link, at.point(points[k]), at.direction(axes[k]));
            tree.push(name);
            link = child;
        }
        // z of the cut frame lies along the axis of the cut joint
        let z = at.direction(axes[6]);
        let x = unit(cross(z, self.seeded.direction()));
        let frame = Pose::from_columns(x, cross(z, x), z, at.point(points[6]));
        let marked = if self.seeded.chance(0.5) { on } else { link };
        let cut = self.mark(marked, frame);
        let of = if at_revolute { rows(&[3, 4, 5, 0, 1]) } else { rows(&[0, 1, 2, 3, 4, 5]) };
        let (predecessor, successor) =
            if self.seeded.chance(0.5) { (on, link) } else { (link, on) };
        let loops = vec![Loop { cut, predecessor, successor, rows: of }];
        let independent = vec![(tree[free].clone(), 0.12)];
        let active = vec![tree[free].clone()];
        let what = if at_revolute { "6R cut at a revolute joint" } else { "7R welded" };
        self.submechanism(what, Entry { type_name: "NUMERICAL", tree, independent, active, loops });
    }

    /// Bricard's mechanism, overconstrained: six rows of rank five.
    pub(super) fn bricard(&mut self, on: Link, at: Pose) {
        const POINTS: [Vector; 6] = [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, -1.0, 1.0],
            [0.0, -1.0, 1.0],
            [0.0, 0.0, 1.0],
        ];
        let mut link = on;
        let mut tree = Vec::new();
        for (p, axis) in POINTS.into_iter().zip([Y, Z, X, Y, Z, X]) {
            let (name, child) =
                self.joint(Kind::Turn, link, at.point(scaled(p, self.scale)), at.direction(axis));
            tree.push(name);
            link = child;
        }
        let frame = Pose { p: at.point(scaled(POINTS[5], self.scale)), ..self.seeded.pose(0.0) };
        let cut = self.mark(link, frame);
        let loops =
            vec![Loop { cut, predecessor: on, successor: link, rows: rows(&[0, 1, 2, 3, 4, 5]) }];
        let independent = vec![(tree[0].clone(), 0.3)];
        let active = vec![tree[0].clone()];
        self.submechanism(
            "Bricard",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }

    /// Four revolute joints whose axes meet in a point, cut at the last: five rows of rank two.
    pub(super) fn spherical_four_bar(&mut self, on: Link, at: Pose) {
        let axes = loop {
            let axes = [(); 4].map(|()| self.seeded.direction());
            let apart = |i: usize, j: usize| norm(cross(axes[i], axes[j]));
            let triple = dot(axes[1], cross(axes[2], axes[3])).abs();
            if triple > 0.5
                && apart(0, 1) > 0.3
                && apart(0, 3) > 0.3
                && dot(axes[0], cross(axes[1], axes[3])).abs() > 0.2
            {
                break axes;
            }
        };
        let place = |writer: &mut Writer, axis: Vector| {
            at.point(scaled(axis, writer.seeded.within(0.2, 0.8) * writer.scale))
        };
        let origin = place(self, axes[0]);
        let (crank, crank_link) = self.joint(Kind::Turn, on, origin, at.direction(axes[0]));
        let origin = place(self, axes[1]);
        let (coupler, coupler_link) =
            self.joint(Kind::Turn, crank_link, origin, at.direction(axes[1]));
        let origin = place(self, axes[3]);
        let (rocker, rocker_link) = self.joint(Kind::Turn, on, origin, at.direction(axes[3]));
        let z = at.direction(axes[2]);
        let x = unit(cross(z, self.seeded.direction()));
        let origin = place(self, axes[2]);
        let cut = self.mark(coupler_link, Pose::from_columns(x, cross(z, x), z, origin));
        let loops = vec![Loop {
            cut,
            predecessor: coupler_link,
            successor: rocker_link,
            rows: rows(&[0, 1, 3, 4, 5]),
        }];
        let tree = vec![crank.clone(), coupler, rocker];
        let active = vec![crank.clone()];
        self.submechanism(
            "spherical four-bar",
            Entry { type_name: "NUMERICAL", tree, independent: vec![(crank, 0.15)], active, loops },
        );
    }

    /// Bennett's mechanism: four revolutes, opposite links of equal length and twist, sin α / a =
    /// sin β / b; welded: six rows of rank three.
    pub(super) fn bennett(&mut self, on: Link, at: Pose) {
        let alpha: f64 = self.seeded.within(0.5, 1.0);
        let beta: f64 = self.seeded.within(1.3, 2.0);
        let a = self.scale * alpha.sin();
        let b = self.scale * beta.sin();
        // tan ½θ tan ½ψ = sin ½(β + α) / sin ½(β − α)
        let theta = self.seeded.sign() * self.seeded.within(1.2, 2.0);
        let ratio = (0.5 * (beta + alpha)).sin() / (0.5 * (beta - alpha)).sin();
        let psi = 2.0 * (ratio / (0.5 * theta).tan()).atan();
        let turn = |angle: f64| Pose::from_rpy([0.0, 0.0, angle], [0.0; 3]);
        let link = |length: f64, twist: f64| Pose::from_rpy([twist, 0.0, 0.0], [length, 0.0, 0.0]);
        let parts = [(theta, a, alpha), (psi, b, beta), (-theta, a, alpha), (-psi, b, beta)];
        let mut frame = at;
        let mut frames = Vec::new();
        for (angle, length, twist) in parts {
            frames.push(frame);
            frame = frame.then(&turn(angle)).then(&link(length, twist));
        }
        let gap = norm(add(frame.p, -1.0, at.p));
        assert!(gap < 1e-12 * self.scale, "Bennett's mechanism is open by {gap:e}");
        let mut last = on;
        let mut tree = Vec::new();
        for frame in frames {
            let (name, child) = self.joint(Kind::Turn, last, frame.p, frame.direction(Z));
            tree.push(name);
            last = child;
        }
        let frame = Pose { p: at.p, ..self.seeded.pose(0.0) };
        let cut = self.mark(last, frame);
        let loops =
            vec![Loop { cut, predecessor: on, successor: last, rows: rows(&[0, 1, 2, 3, 4, 5]) }];
        let independent = vec![(tree[0].clone(), 0.25)];
        let active = vec![tree[0].clone()];
        self.submechanism(
            "Bennett",
            Entry { type_name: "NUMERICAL", tree, independent, active, loops },
        );
    }
}

/// Least pivot of a square matrix of unit-sized columns under full pivoting.
fn least_pivot(mut columns: Vec<[f64; 6]>) -> f64 {
    let mut least = f64::INFINITY;
    let mut rows: Vec<usize> = (0..6).collect();
    while !columns.is_empty() {
        let mut c = 0;
        let mut r = 0;
        for a in 0..columns.len() {
            for b in 0..rows.len() {
                if columns[a][rows[b]].abs() > columns[c][rows[r]].abs() {
                    (c, r) = (a, b);
                }
            }
        }
        let column = columns.swap_remove(c);
        let row = rows.swap_remove(r);
        least = least.min(column[row].abs());
        for other in &mut columns {
            let factor = other[row] / column[row];
            (0..6).for_each(|i| other[i] -= factor * column[i]);
        }
    }
    least
}
