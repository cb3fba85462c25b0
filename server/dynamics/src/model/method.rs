//! The methods of forward dynamics, and the fastest one for a robot.
//!
//! Both fast methods consist of the same few operations; the robot's structure gives the count of
//! each, and its time was measured once for all robots. `sarrus-benches --forward` prints the
//! prediction beside the measurement.

use super::Model;
use crate::mechanism::Cluster;

sarrus_proto::named_enum! {
    /// A method from forces to accelerations.
    pub enum Method {
        /// Articulated bodies over clusters by constraint embedding: O(n).
        Recursion = "recursion",
        /// The reduced mass matrix Gᵀ M G with a branch-sparse factor.
        Projection = "projection",
        /// The whole tree with the loops as constraints: an oracle, and slow.
        Kkt = "kkt",
    }
}

/// Unit roundoffs above which a method is replaced by one that keeps more digits.
const LOSSY: f64 = 1e4;

/// Nanoseconds of each operation.
const NS: Count = Count { rigid: 20.0, articulated: 40.0, force: 7.0, update: 8.0, entry: 0.3 };

/// Number of runs of each operation, or its time.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    /// A rigid inertia, carried to the parent.
    rigid: f64,
    /// An articulated inertia, carried to the parent, and the acceleration on the way back.
    articulated: f64,
    /// A force column, carried to the parent or joined by a row of G.
    force: f64,
    /// A column, taken out of an articulated inertia.
    update: f64,
    /// One multiplication and addition of a block or a factor.
    entry: f64,
}

impl Count {
    fn cost(&self) -> f64 {
        let Count { rigid, articulated, force, update, entry } = *self;
        rigid * NS.rigid
            + articulated * NS.articulated
            + force * NS.force
            + update * NS.update
            + entry * NS.entry
    }
}

impl<C> Model<C> {
    /// The method with the least predicted cost, or the other one where that loses digits which the
    /// other keeps; it depends on the robot alone.
    pub fn forward_method(&self) -> Method {
        let (first, second) = if self.recursion().cost() < self.projection().cost() {
            (Method::Recursion, Method::Projection)
        } else {
            (Method::Projection, Method::Recursion)
        };
        let growth = self.growth_of(first);
        let other = self.growth_of(second);
        if growth > LOSSY && 0.0 < other && other < 0.1 * growth { second } else { first }
    }

    /// By how many unit roundoffs accelerations by a method were off at the poses that were tried
    /// at load; zero where none was.
    pub(crate) fn growth_of(&self, method: Method) -> f64 {
        match method {
            Method::Recursion => self.growth[0],
            Method::Projection => self.growth[1],
            Method::Kkt => 0.0,
        }
    }

    /// Predicted nanoseconds of M_y ÿ = b by a method on the machine of the calibration; the oracle
    /// has no prediction.
    pub fn predicted_cost(&self, method: Method) -> Option<f64> {
        match method {
            Method::Recursion => Some(self.recursion().cost()),
            Method::Projection => Some(self.projection().cost()),
            Method::Kkt => None,
        }
    }

    fn recursion(&self) -> Count {
        let mut count = Count::default();
        for cluster in &self.clusters {
            let m = cluster.n_vy as f64;
            let moved = if cluster.parent == 0 { 0.0 } else { 1.0 };
            if cluster.n_v == 1 && cluster.n_vy == 1 {
                count.articulated += moved;
                count.update += moved;
                continue;
            }
            self.join(cluster, &mut count);
            for i in cluster.bodies() {
                match (self.bodies[i].parent, self.has_child_cluster[i]) {
                    (0, _) => {}
                    (_, false) => count.rigid += 1.0,
                    (_, true) => count.articulated += 1.0,
                }
            }
            count.update += m * moved;
            count.entry += m * m * (m / 6.0 + 3.0);
        }
        count
    }

    fn projection(&self) -> Count {
        let mut count = Count::default();
        count.rigid += self.bodies.iter().skip(1).filter(|body| body.parent != 0).count() as f64;
        for cluster in &self.clusters {
            let m = cluster.n_vy as f64;
            if cluster.n > 1 {
                self.join(cluster, &mut count);
            } else {
                count.force += m;
            }
            let mut at = cluster.parent;
            while at != 0 {
                let body = &self.bodies[at];
                count.force += m;
                count.entry +=
                    m * (body.motion.n_v() * self.clusters[self.cluster_of[at]].n_vy) as f64;
                at = body.parent;
            }
        }
        for depth in self.sparsity.depth.iter().map(|depth| *depth as f64) {
            count.entry += depth * (depth + 1.0) / 2.0 + 2.0 * depth;
        }
        count
    }

    /// The columns and the block of one cluster.
    fn join(&self, cluster: &Cluster<C>, count: &mut Count) {
        let m = cluster.n_vy as f64;
        count.force += m * (cluster.n + cluster.n_v) as f64;
        count.entry += m * m * cluster.n_v as f64;
    }
}
