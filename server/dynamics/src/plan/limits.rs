//! Compares positions, velocities and actuator forces with the model's limits.

use sarrus_proto::{Field, Request, Warnings};

use crate::closure::Level;
use crate::plan::Plan;
use crate::scalar::{BranchValue, Real};
use crate::workspace::Workspace;

/// The columns of [`Field::Limits`].
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const EFFORT: usize = 2;

impl Plan {
    /// Whether a position, velocity or actuator force lies outside its limits.
    #[inline(always)]
    pub(super) fn limits<T: Real>(&self, ws: &Workspace<T>) -> Warnings {
        let mut exceeded = false;
        self.each_limit(ws, |_, _, x, [lower, upper]| exceeded |= x < lower || x > upper);
        if exceeded { Warnings::LIMITS_EXCEEDED } else { Warnings::NONE }
    }

    /// The excess of each over its limit, in the wanted rows (n_v × 3).
    pub(super) fn write_limits<T: Real>(&self, ws: &Workspace<T>, out: &mut [T]) {
        out.fill(T::ZERO);
        self.each_limit(ws, |row, column, x, [lower, upper]| {
            if let Some(row) = row {
                out[row * 3 + column] = T::from_f64(excess(x, lower, upper));
            }
        });
    }

    /// Calls `each(row, column, x, [lower, upper])` for every limit that this request can meet.
    #[inline(always)]
    fn each_limit<T: Real>(
        &self,
        ws: &Workspace<T>,
        mut each: impl FnMut(Option<usize>, usize, f64, [f64; 2]),
    ) {
        let moves = self.steps.velocity.is_some() && self.steps.level >= Level::Velocity;
        for (row, limit) in &self.needed.limits {
            let [lower, upper] = [limit.lower, limit.upper];
            each(*row, POSITION, figure(ws.q[limit.q], lower, upper), [lower, upper]);
            if moves {
                let [lower, upper] = [-limit.velocity, limit.velocity];
                each(*row, VELOCITY, figure(ws.qd[limit.v], lower, upper), [lower, upper]);
            }
        }
        if self.request == Request::InverseDynamics && self.wants(Field::TauU) {
            for (u, row, effort) in &self.needed.efforts {
                each(*row, EFFORT, figure(ws.tau_u[*u], -effort, *effort), [-effort, *effort]);
            }
        }
    }
}

fn figure<T: Real>(x: T, lower: f64, upper: f64) -> f64 {
    x.to_branch_value(BranchValue::Limited { lower, upper })
}

/// How far x lies outside: negative below, positive above.
fn excess(x: f64, lower: f64, upper: f64) -> f64 {
    if x < lower {
        x - lower
    } else if x > upper {
        x - upper
    } else {
        0.0
    }
}
