//! Idle freedoms: rods that may spin between their ball joints while everything else stands still.
//!
//! A motion of the dependents at y = const is idle where nothing of it passes a cut or leaves the
//! cluster: both points of every cut stand still, each side of a cut satisfies its rows alone, no
//! actuator and no coupled joint moves, and every body that moves turns about a line through a
//! centre of its own that stands still: a cut point on it, or the point where two of its axes meet.

use nalgebra::Vector3;

use crate::closure::column_unit;
use crate::mechanism::Motion;
use crate::model::{Body, Cluster};
use crate::spatial::Pose;

/// What counts as standing still, and as meeting, in lengths of the cluster.
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
    /// True where the motion is idle; `carries` tells which local bodies carry other clusters.
    pub(super) fn is_idle(&self, carries: &[bool]) -> bool {
        let cluster = self.cluster;
        let still = |v: usize| self.rate[v].abs() < STILL * column_unit(cluster, v);
        let coupled = cluster.cuts.iter().flat_map(|cut| &cut.rows).flat_map(|row| &row.terms);
        if !cluster.active.iter().all(|(_, v)| still(*v))
            || !coupled.into_iter().all(|(v, _)| still(*v))
        {
            return false;
        }
        self.passes_no_cut()
            && (0..cluster.n).all(|b| !self.moves(b) || !carries[b] && self.turns_about_a_centre(b))
    }

    /// Both points of every cut stand still, and each side satisfies the rows alone.
    fn passes_no_cut(&self) -> bool {
        let (cluster, n_v) = (self.cluster, self.cluster.n_v);
        let mut r = 0;
        for cut in &cluster.cuts {
            let ends = [(cut.predecessor, &cut.x_p_cut), (cut.successor, &cut.x_s_cut)];
            if ends.iter().any(|(body, x)| {
                self.velocity(*body, &self.pose[*body].point(&x.p)).norm() > STILL * cluster.length
            }) {
                return false;
            }
            for _ in &cut.rows {
                for side in [false, true] {
                    let on_side = cut.path.iter().filter(|(_, of)| *of == side);
                    // rates are those of the scaling's columns
                    let sum: f64 = on_side
                        .map(|(v, _)| {
                            self.K[r * n_v + v] * self.rate[*v] / column_unit(cluster, *v)
                        })
                        .sum();
                    if sum.abs() > STILL {
                        return false;
                    }
                }
                r += 1;
            }
        }
        true
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
        let cluster = self.cluster;
        let mut centres = Vec::new();
        for cut in &cluster.cuts {
            for (body, x) in [(cut.predecessor, &cut.x_p_cut), (cut.successor, &cut.x_s_cut)] {
                if body == b + 1 && cut.rows.iter().all(|row| row.terms.is_empty()) {
                    centres.push(self.pose[body].point(&x.p));
                }
            }
        }
        if self.bodies[b].motion == Motion::Spherical {
            centres.push(self.pose[b + 1].p);
        }
        for child in 0..cluster.n {
            let Some(parent) = cluster.local_parent[child].checked_sub(1) else { continue };
            if child == b || parent == b {
                centres.extend(self.meeting(parent, child));
            }
        }
        centres
    }

    /// Where the axes of two turning joints meet.
    fn meeting(&self, a: usize, b: usize) -> Option<Vector3<f64>> {
        if self.bodies[a].motion != Motion::Revolute || self.bodies[b].motion != Motion::Revolute {
            return None;
        }
        let (x, y) = (&self.pose[a + 1], &self.pose[b + 1]);
        let (u, v, d) = (x.R.column(2).into_owned(), y.R.column(2).into_owned(), y.p - x.p);
        let normal = u.cross(&v);
        let square = normal.norm_squared();
        if square < APART * APART
            || d.dot(&normal).abs() > STILL * self.cluster.length * square.sqrt()
        {
            return None;
        }
        Some(x.p + u * (d.cross(&v).dot(&normal) / square))
    }

    /// Angular velocity of a local body.
    fn spin(&self, body: usize) -> Vector3<f64> {
        self.sum(body, |w, _, _| w)
    }

    /// Velocity of a point of a local body.
    fn velocity(&self, body: usize, point: &Vector3<f64>) -> Vector3<f64> {
        self.sum(body, |w, v, p| v + w.cross(&(point - p)))
    }

    /// Sum over the joints that move a body, of what each does: (ω, v of its origin, its origin).
    fn sum(
        &self,
        body: usize,
        of: impl Fn(Vector3<f64>, Vector3<f64>, Vector3<f64>) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        let mut at = body;
        while at != 0 {
            let pose = &self.pose[at];
            for (v, freedom) in self
                .cluster
                .freedoms
                .iter()
                .enumerate()
                .filter(|(_, freedom)| freedom.body == at - 1)
            {
                let (zero, rate) = (Vector3::zeros(), self.rate[v]);
                let axis = |k: usize| pose.R.column(k).into_owned() * rate;
                sum += match self.bodies[at - 1].motion {
                    Motion::Revolute => of(axis(2), zero, pose.p),
                    Motion::Prismatic => of(zero, axis(2), pose.p),
                    Motion::Floating if freedom.k >= 3 => of(zero, axis(freedom.k - 3), pose.p),
                    Motion::Spherical | Motion::Floating => of(axis(freedom.k), zero, pose.p),
                };
            }
            at = self.cluster.local_parent[at - 1];
        }
        sum
    }
}
