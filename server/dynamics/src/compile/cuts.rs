//! Turns cut joints and couplings into rows of their clusters.

use nalgebra::Vector3;

use crate::compile::assemble::Builder;
use crate::compile::curves::pieces;
use crate::compile::geometry::{norm, pose, unit, vector};
use crate::compile::rank::RANK_GAP;
use crate::description::{self as written, Coupling, Loop, Row};
use crate::mechanism::{Cluster, Curve, Cut, CutRow, Motion, Screw};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::{Matrix, Pose, zero};

/// Cosine from which on a joint turns along a line, and sine from which on rows are independent.
const PARALLEL: f64 = 1.0 - 1e-8;
const SKEW: f64 = 1e-6;
/// Sine of the angle between rows from which on they keep their digits.
const OBLIQUE: f64 = 0.1;

impl Builder<'_> {
    /// Adds cuts and couplings to their clusters; returns the submechanism of each external row.
    pub(super) fn rows(&mut self, loops: &[Vec<Loop>]) -> Vec<usize> {
        let mut owner = Vec::new();
        let world = self.zero_poses();
        for (s, submechanism) in self.description.submechanisms.iter().enumerate() {
            for cycle in &loops[s] {
                let (a, b) = self.skeleton.path_between(cycle.predecessor, cycle.successor);
                let Some(&m) = a.first().or(b.first()) else { continue };
                let c = self.model.cluster_of[self.body_of[m]];
                let cut = self.cut(cycle, c, &a, &b, &world);
                let names = cycle.rows.iter().map(|row| format!("{}/{}", cycle.name, row.name));
                self.push_cut(c, cut, names);
                owner.resize(self.meta.loops.len(), s);
            }
            for &j in &submechanism.spanning_tree {
                let joint = &self.description.joints[j];
                let Some(coupling) = &joint.coupling else { continue };
                let c = self.model.cluster_of[self.body_of[self.skeleton.moving_of[j]]];
                let cut = self.coupling(j, coupling, &self.model.clusters[c]);
                self.push_cut(c, cut, [format!("{}/coupling", joint.name)]);
                owner.resize(self.meta.loops.len(), s);
            }
        }
        owner
    }

    /// Adds a cut to a cluster, with the names of its rows.
    fn push_cut(&mut self, c: usize, cut: Cut<Dd>, names: impl IntoIterator<Item = String>) {
        let first = self.meta.loops.len();
        self.meta.loops.extend(names);
        let cluster = &mut self.model.clusters[c];
        cluster.rows.extend(first..self.meta.loops.len());
        if !cut.is_coupling() {
            self.model.order.cuts.push((c, cluster.cuts.len()));
        }
        cluster.cuts.push(cut);
    }

    /// A coupling of a joint as a cut of one row.
    fn coupling(&self, joint: usize, coupling: &Coupling, cluster: &Cluster<Dd>) -> Cut<Dd> {
        let local = |j: usize| self.body(j).v - cluster.v;
        let mut terms = vec![(local(joint), Dd::ONE)];
        for (master, multiplier) in &coupling.terms {
            terms.push((local(*master), -Dd::from_f64(*multiplier)));
        }
        let curve = |(of, curve): &(usize, written::Curve)| Curve {
            of: cluster.dofs[local(*of)],
            pieces: pieces(curve).into_iter().map(|piece| piece.map(Dd::from_f64)).collect(),
        };
        let curves: Vec<Curve<Dd>> = coupling.curves.iter().map(curve).collect();
        let own = terms.iter().map(|(v, _)| *v).chain(curves.iter().map(|curve| curve.of.v));
        let path = own.map(|v| (v, true)).collect();
        let row = CutRow {
            angular: zero(),
            linear: zero(),
            linear_p: zero(),
            against: None,
            screw: None,
            terms,
            curves,
            offset: -Dd::from_f64(coupling.offset),
            size: Dd::ONE,
            leans: Vec::new(),
        };
        Cut {
            predecessor: 0,
            successor: 0,
            x_p_cut: Pose::identity(),
            x_s_cut: Pose::identity(),
            rows: vec![row],
            path,
            angular: false,
            on_line: false,
        }
    }

    /// Pose of every body at zero {root}.
    fn zero_poses(&self) -> Vec<Pose<Dd>> {
        let mut world = vec![Pose::identity()];
        for body in &self.model.bodies[1..] {
            world.push(
                world[body.parent].then(&Pose { R: body.R_parent_body, p: body.p_parent_body }),
            );
        }
        world
    }

    /// A loop as a cut of a cluster; `a` and `b` are the joints on the predecessor's and the
    /// successor's side.
    fn cut(&self, cycle: &Loop, c: usize, a: &[usize], b: &[usize], world: &[Pose<Dd>]) -> Cut<Dd> {
        let cluster = &self.model.clusters[c];
        let local = |link: usize| {
            let body = self.model.frames[link].body;
            if body >= cluster.body && body < cluster.body + cluster.n {
                body - cluster.body + 1
            } else {
                0
            }
        };
        let p = local(cycle.predecessor);
        let s = local(cycle.successor);
        let global =
            |local: usize| if local == 0 { cluster.parent } else { cluster.body + local - 1 };
        let in_root = |link: usize| {
            world[self.model.frames[link].body].then(&self.model.frames[link].x_body_frame)
        };
        let (P, S) = match &cycle.cut {
            written::Cut::AtJoint(j) => {
                let frame = in_root(self.description.joints[*j].child);
                (frame, frame)
            }
            written::Cut::AtLink(link) => (in_root(*link), in_root(*link)),
            written::Cut::Placed { predecessor, successor } => (
                in_root(cycle.predecessor).then(&pose(predecessor)),
                in_root(cycle.successor).then(&pose(successor)),
            ),
        };
        let x_p_cut = world[global(p)].inverse().then(&P);
        let mut rows: Vec<_> = cycle.rows.iter().map(|row| unit_row(row, &x_p_cut)).collect();
        straighten(&mut rows, &x_p_cut);
        let held = held_turns(&rows);
        let rows = rows.into_iter().map(|mut row| {
            let line = match held[..] {
                [_, _, _] => None,
                [a, b] => Some(a.cross(b)),
                _ => unit(&row.angular),
            };
            if let Some(line) = line.filter(|line| is_screw(&row, line)) {
                row.screw = self.screw(line, &P, c, a, b, world);
            }
            row
        });
        let path = a.iter().map(|m| (m, false)).chain(b.iter().map(|m| (m, true))).flat_map(
            |(m, side)| {
                let body = &self.model.bodies[self.body_of[*m]];
                (0..body.motion.n_v()).map(move |k| (body.v - cluster.v + k, side))
            },
        );
        Cut {
            predecessor: p,
            successor: s,
            x_p_cut,
            x_s_cut: world[global(s)].inverse().then(&S),
            rows: rows.collect(),
            path: path.collect(),
            angular: cycle.rows.iter().any(|row| row.axis[..3].iter().any(|x| *x != 0.0)),
            on_line: held.len() >= 2,
        }
    }

    /// A screw along a line of the cut frame P, and the joints of its path that turn along it;
    /// `None` where no joint turns about it in part.
    fn screw(
        &self,
        line: Vector3<Dd>,
        P: &Pose<Dd>,
        c: usize,
        a: &[usize],
        b: &[usize],
        world: &[Pose<Dd>],
    ) -> Option<Screw<Dd>> {
        let along = P.R.apply(line);
        let sides = a.iter().map(|m| (m, -Dd::ONE)).chain(b.iter().map(|m| (m, Dd::ONE)));
        let sides: Vec<_> = sides.map(|(m, side)| (self.body_of[*m], side)).collect();
        let cosine = |body: usize| world[body].R.col(2).dot(along);
        let turns_in_part = |(body, _): &(usize, Dd)| match self.model.bodies[*body].motion {
            Motion::Revolute => cosine(*body).abs().to_f64() > SKEW,
            Motion::Prismatic => false,
            Motion::Spherical | Motion::Floating => true,
        };
        let turns = |(body, _): &&(usize, Dd)| {
            self.model.bodies[*body].motion == Motion::Revolute
                && cosine(*body).abs().to_f64() > PARALLEL
        };
        let sense = |&(body, side): &(usize, Dd)| {
            let v = self.model.bodies[body].v - self.model.clusters[c].v;
            (v, if cosine(body) < Dd::ZERO { -side } else { side })
        };
        let joints = sides.iter().filter(turns).map(sense).collect();
        sides.iter().any(turns_in_part).then_some(Screw { line, joints })
    }
}

/// A row as written, of unit length.
fn unit_row(row: &Row, x_p_cut: &Pose<Dd>) -> CutRow<Dd> {
    let [wx, wy, wz, vx, vy, vz] = row.axis;
    let [w, v] = [vector([wx, wy, wz]), vector([vx, vy, vz])];
    let slides = row.against.is_none() && norm(&v) > Dd::ZERO;
    let of_turn = row.against.map_or(Dd::ONE, |b| norm(&vector(b)));
    let own = norm(if slides { &v } else { &w });
    let linear = if slides { v.map(|x| x / own) } else { zero() };
    CutRow {
        angular: w.map(|x| x / own),
        linear,
        linear_p: x_p_cut.R.apply(linear),
        against: row.against.map(|b| vector(b).map(|x| x / of_turn)),
        screw: None,
        terms: Vec::new(),
        curves: Vec::new(),
        offset: Dd::ZERO,
        size: own * of_turn,
        leans: Vec::new(),
    }
}

/// Rows that lean against each other become perpendicular ones, which hold the same directions
/// with all digits. Rows that others imply stay.
fn straighten(rows: &mut [CutRow<Dd>], x_p_cut: &Pose<Dd>) {
    for linear in [true, false] {
        let mut axes: Vec<(usize, Vector3<Dd>)> = Vec::new();
        let mut found = Vec::new();
        for (r, row) in rows.iter().enumerate() {
            let [slide, turn] = [row.linear, row.angular];
            let [mut rest, other] = if linear { [slide, turn] } else { [turn, slide] };
            if row.against.is_some() || norm(&other) > Dd::ZERO {
                continue;
            }
            let part = |(k, axis): &(usize, Vector3<Dd>)| {
                let along = axis.dot(rest);
                rest = rest.add_scaled(*axis, -along);
                (r - k, along * row.size)
            };
            let leans: Vec<_> = axes.iter().map(part).collect();
            let sine = norm(&rest);
            if sine.to_f64() > RANK_GAP {
                axes.push((r, rest.map(|x| x / sine)));
                found.push((leans, sine));
            }
        }
        if found.iter().all(|(_, sine)| sine.to_f64() > OBLIQUE) {
            continue;
        }
        for ((r, axis), (leans, sine)) in axes.into_iter().zip(found) {
            let row = &mut rows[r];
            *if linear { &mut row.linear } else { &mut row.angular } = axis;
            row.linear_p = x_p_cut.R.apply(row.linear);
            row.size *= sine;
            row.leans = leans;
        }
    }
}

/// Unit vectors, perpendicular to each other, about which the rows of a cut hold every turn: the
/// angular parts of their sums without a linear part.
fn held_turns(rows: &[CutRow<Dd>]) -> Vec<Vector3<Dd>> {
    let mut slides: Vec<[Vector3<Dd>; 2]> = Vec::new();
    let mut held: Vec<Vector3<Dd>> = Vec::new();
    for row in rows.iter().filter(|row| row.against.is_none()) {
        let [mut linear, mut angular] = [row.linear, row.angular];
        for [l, a] in &slides {
            let along = l.dot(linear);
            linear = linear.add_scaled(*l, -along);
            angular = angular.add_scaled(*a, -along);
        }
        let size = norm(&linear);
        if size.to_f64() > SKEW {
            slides.push([linear, angular].map(|x| x.map(|x| x / size)));
            continue;
        }
        for a in &held {
            angular = angular.add_scaled(*a, -a.dot(angular));
        }
        if norm(&angular).to_f64() > SKEW {
            held.extend(unit(&angular));
        }
    }
    held
}

/// True where a row ties a slide to the turns about a line.
fn is_screw(row: &CutRow<Dd>, line: &Vector3<Dd>) -> bool {
    row.against.is_none()
        && norm(&row.linear) > Dd::ZERO
        && row.angular.dot(*line).abs().to_f64() > SKEW * norm(&row.angular).to_f64()
}
