//! Idle dofs: rods that can spin between their ball joints while all other bodies rest.
//!
//! A motion of the dependents at y = const is idle if it stays within the cluster, no actuator or
//! coupled joint moves, and every moving body turns about a line through a fixed centre: one of its
//! cut points, or the point where two of its axes meet. Either it passes no cut: both points of
//! every cut rest, and each side of a cut satisfies its rows alone; or it passes cuts only within a
//! rod and its balls, which are chains of revolute joints with a common point: then all these
//! bodies turn about one of two centres, and the rod about both.

use nalgebra::Vector3;

use crate::closure::column_unit;
use crate::mechanism::{Body, Cluster, Cut, Motion};
use crate::spatial::Pose;

/// Largest motion at rest, and distance of lines that meet, in lengths of the cluster.
const STILL: f64 = 1e-4;
/// Least sine of the angle between two axes that meet.
const APART: f64 = 1e-3;

/// One direction of a motion of all local velocities, in units of the scaling, at a closed pose.
pub(super) struct Drift<'a> {
    pub(super) cluster: &'a Cluster<f64>,
    pub(super) bodies: &'a [Body<f64>],
    /// Pose of each local body; 0 is the cluster's parent body.
    pub(super) pose: &'a [Pose<f64>],
    /// Rates of the local velocities, of about unit size; and the scaled K with rows × n_v entries
    /// times them.
    pub(super) rate: Vec<f64>,
    pub(super) K: &'a [f64],
}

impl Drift<'_> {
    /// True if the motion is idle; `has_child_cluster` has one entry per local body.
    pub(super) fn is_idle(&self, has_child_cluster: &[bool]) -> bool {
        let cluster = self.cluster;
        let still = |v: usize| self.rate[v].abs() < STILL * column_unit(cluster, v);
        let (coupled, loops): (Vec<_>, Vec<_>) =
            cluster.cuts.iter().partition(|cut| cut.is_coupling());
        let is_in = |cuts: &[&Cut<f64>], v: usize| {
            cuts.iter().flat_map(|cut| &cut.path).any(|(w, _)| *w == v)
        };
        let rests = |v: usize| is_in(&coupled, v) || !is_in(&loops, v);
        let active = cluster.active.iter().map(|(_, v)| *v);
        if !active.chain((0..cluster.n_v).filter(|v| rests(*v))).all(still) {
            return false;
        }
        let moving: Vec<usize> = (0..cluster.n).filter(|b| self.moves(*b)).collect();
        if moving.iter().any(|b| has_child_cluster[*b] || floats(cluster, self.bodies, *b)) {
            return false;
        }
        let passed = self.passed_cuts();
        self.groups(&moving, &passed).iter().all(|group| {
            let is_in = |body: usize| body > 0 && group.contains(&(body - 1));
            let ends = |c: &usize| [cluster.cuts[*c].predecessor, cluster.cuts[*c].successor];
            let within: Vec<usize> =
                passed.iter().copied().filter(|c| ends(c).into_iter().any(is_in)).collect();
            match within.is_empty() {
                true => group.iter().all(|b| self.turns_about_a_centre(*b)),
                // motion that passes a cut moves both of its sides
                false => {
                    within.iter().all(|c| ends(c).into_iter().all(is_in))
                        && self.spins_between_balls(group)
                }
            }
        })
    }

    /// The cuts of which a point moves, or whose sides do not satisfy the rows alone.
    fn passed_cuts(&self) -> Vec<usize> {
        let cluster = self.cluster;
        let n_v = self.cluster.n_v;
        let mut first = 0;
        let mut passed = Vec::new();
        for (c, cut) in cluster.cuts.iter().enumerate() {
            let ends = [(cut.predecessor, &cut.x_p_cut), (cut.successor, &cut.x_s_cut)];
            let moves = ends.iter().any(|(body, x)| {
                self.velocity(*body, &self.pose[*body].point(&x.p)).norm() > STILL * cluster.length
            });
            let rows = first..first + cut.rows.len();
            let alone = |r: usize, side: bool| {
                let on_side = cut.path.iter().filter(|(_, end)| *end == side);
                // rates are those of the scaling's columns
                let sum: f64 = on_side
                    .map(|(v, _)| self.K[r * n_v + v] * self.rate[*v] / column_unit(cluster, *v))
                    .sum();
                sum.abs() <= STILL
            };
            if moves || !rows.clone().all(|r| alone(r, false) && alone(r, true)) {
                passed.push(c);
            }
            first = rows.end;
        }
        passed
    }

    /// Moving bodies in groups that joints and passed cuts hold together.
    fn groups(&self, moving: &[usize], passed: &[usize]) -> Vec<Vec<usize>> {
        let mut group_of: Vec<usize> = (0..=self.cluster.n).collect();
        let joints = moving.iter().map(|b| (b + 1, self.cluster.local_parent[*b]));
        let cuts = passed.iter().map(|c| &self.cluster.cuts[*c]);
        for (a, b) in joints.chain(cuts.map(|cut| (cut.predecessor, cut.successor))) {
            let both_move = [a, b].iter().all(|body| *body > 0 && moving.contains(&(body - 1)));
            let old = group_of[a];
            let new = group_of[b];
            if both_move {
                group_of.iter_mut().filter(|group| **group == old).for_each(|group| *group = new);
            }
        }
        let mut groups: Vec<Vec<usize>> = vec![Vec::new(); self.cluster.n + 1];
        moving.iter().for_each(|b| groups[group_of[b + 1]].push(*b));
        groups.retain(|group| !group.is_empty());
        groups
    }

    /// True where all bodies of a group turn about one of two centres, and one of them about both.
    fn spins_between_balls(&self, group: &[usize]) -> bool {
        let length = self.cluster.length;
        let still =
            |b: usize, point: &Vector3<f64>| self.velocity(b + 1, point).norm() < STILL * length;
        // where axes of joints meet, and where the lines meet about which two bodies turn
        let mut centres: Vec<Vector3<f64>> = group.iter().flat_map(|b| self.balls(*b)).collect();
        for (k, a) in group.iter().enumerate() {
            for b in &group[k + 1..] {
                let lines = self.line(*a).zip(self.line(*b));
                centres.extend(lines.and_then(|(a, b)| meeting(a, b, length)));
            }
        }
        let is_pair = |a: &Vector3<f64>, b: &Vector3<f64>| {
            (a - b).norm() > APART * length
                && group.iter().all(|body| still(*body, a) || still(*body, b))
                && group.iter().any(|body| still(*body, a) && still(*body, b))
        };
        centres.iter().enumerate().any(|(k, a)| centres[k + 1..].iter().any(|b| is_pair(a, b)))
    }

    /// The line about which a body turns: a point of it and the angular velocity.
    fn line(&self, b: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let p = self.pose[b + 1].p;
        let w = self.spin(b + 1);
        let v = self.velocity(b + 1, &p);
        let square = w.norm_squared();
        (square > STILL * STILL).then(|| (p + w.cross(&v) / square, w.normalize()))
    }

    fn moves(&self, b: usize) -> bool {
        let p = self.pose[b + 1].p;
        self.spin(b + 1).norm() > STILL
            || self.velocity(b + 1, &p).norm() > STILL * self.cluster.length
    }

    fn turns_about_a_centre(&self, b: usize) -> bool {
        self.centres(b)
            .iter()
            .any(|centre| self.velocity(b + 1, centre).norm() < STILL * self.cluster.length)
    }

    /// Cut points on a body, and where its joint's axis meets that of its parent or of a child.
    fn centres(&self, b: usize) -> Vec<Vector3<f64>> {
        let mut centres = self.balls(b);
        for cut in &self.cluster.cuts {
            for (body, x) in [(cut.predecessor, &cut.x_p_cut), (cut.successor, &cut.x_s_cut)] {
                if body == b + 1 && cut.rows.iter().all(|row| row.terms.is_empty()) {
                    centres.push(self.pose[body].point(&x.p));
                }
            }
        }
        centres
    }

    /// Where a body's joint is a ball, or its axis meets that of its parent or of a child.
    fn balls(&self, b: usize) -> Vec<Vector3<f64>> {
        let cluster = self.cluster;
        let mut centres = Vec::new();
        if self.bodies[b].motion == Motion::Spherical {
            centres.push(self.pose[b + 1].p);
        }
        let axis = |b: usize| {
            let pose = &self.pose[b + 1];
            (self.bodies[b].motion == Motion::Revolute)
                .then(|| (pose.p, pose.R.column(2).into_owned()))
        };
        for child in 0..cluster.n {
            let Some(parent) = cluster.local_parent[child].checked_sub(1) else { continue };
            if child == b || parent == b {
                let lines = axis(parent).zip(axis(child));
                centres.extend(lines.and_then(|(a, b)| meeting(a, b, cluster.length)));
            }
        }
        centres
    }

    /// Angular velocity of a local body.
    fn spin(&self, body: usize) -> Vector3<f64> {
        self.sum(body, |w, _, _| w)
    }

    /// Velocity of a point of a local body.
    fn velocity(&self, body: usize, point: &Vector3<f64>) -> Vector3<f64> {
        self.sum(body, |w, v, p| v + w.cross(&(point - p)))
    }

    /// Sum over the joints that move a body, of a function of (ω, v of its origin, its origin).
    fn sum(
        &self,
        body: usize,
        part: impl Fn(Vector3<f64>, Vector3<f64>, Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        let mut at = body;
        while at != 0 {
            let pose = &self.pose[at];
            for (v, freedom) in
                self.cluster.dofs.iter().enumerate().filter(|(_, freedom)| freedom.body == at - 1)
            {
                let zero = Vector3::zeros();
                let rate = self.rate[v];
                let axis = |k: usize| pose.R.column(k).into_owned() * rate;
                sum += match self.bodies[at - 1].motion {
                    Motion::Revolute => part(axis(2), zero, pose.p),
                    Motion::Prismatic => part(zero, axis(2), pose.p),
                    Motion::Floating if freedom.k >= 3 => part(zero, axis(freedom.k - 3), pose.p),
                    Motion::Spherical | Motion::Floating => part(axis(freedom.k), zero, pose.p),
                };
            }
            at = self.cluster.local_parent[at - 1];
        }
        sum
    }
}

/// True of a body on three slides without mass: it is no rod, but free.
pub(super) fn floats(cluster: &Cluster<f64>, bodies: &[Body<f64>], b: usize) -> bool {
    let slides = |b: &usize| bodies[*b].motion == Motion::Prismatic && bodies[*b].mass == 0.0;
    let parent = |b: &usize| cluster.local_parent[*b].checked_sub(1);
    core::iter::successors(parent(&b), parent).take_while(slides).count() == 3
}

/// Where two lines, each a point and a direction of unit length, meet.
fn meeting(
    (p, u): (Vector3<f64>, Vector3<f64>),
    (q, v): (Vector3<f64>, Vector3<f64>),
    length: f64,
) -> Option<Vector3<f64>> {
    let d = q - p;
    let normal = u.cross(&v);
    let square = normal.norm_squared();
    if square < APART * APART || d.dot(&normal).abs() > STILL * length * square.sqrt() {
        return None;
    }
    Some(p + u * (d.cross(&v).dot(&normal) / square))
}
