//! Compares positions, velocities and actuator forces with the model's limits.

use sarrus_proto::Warnings;

use crate::closure::Level;
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::{BranchValue, Real};
use crate::workspace::Workspace;

/// The columns of [`sarrus_proto::Field::Limits`].
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const EFFORT: usize = 2;

impl Plan {
    /// Whether a position, velocity or actuator force lies outside its limits.
    #[inline(always)]
    pub(super) fn limits<T: Real>(&self, model: &Model<T>, ws: &Workspace<T>) -> Warnings {
        let mut exceeded = false;
        let judge = |_, _, x, [lower, upper]: [f64; 2]| exceeded |= x < lower || x > upper;
        self.each_limit(model, ws, judge);
        if exceeded { Warnings::LIMITS_EXCEEDED } else { Warnings::NONE }
    }

    /// The excess of each over its limit, in the wanted rows (n_v × 3).
    pub(super) fn write_limits<T: Real>(&self, model: &Model<T>, ws: &Workspace<T>, out: &mut [T]) {
        out.fill(T::ZERO);
        self.each_limit(model, ws, |row, column, x, [lower, upper]| {
            if let Some(row) = row {
                out[row * 3 + column] += T::from_f64(excess(x, lower, upper));
            }
        });
    }

    /// Calls `each(row, column, x, [lower, upper])` for every limit that this request can meet.
    #[inline(always)]
    fn each_limit<T: Real>(
        &self,
        model: &Model<T>,
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
        for (u, row, effort) in &self.needed.efforts {
            each(*row, EFFORT, figure(ws.tau_u[*u], -effort, *effort), [-effort, *effort]);
        }
        // limits over speed: the excess over each is compared with none
        for (u, v, row) in &self.needed.curves {
            let speed = if moves { ws.qd[*v] } else { T::ZERO };
            let [lower, upper] = model.motors[*u].forces(speed);
            let below = [0.0, f64::INFINITY];
            let above = [f64::NEG_INFINITY, 0.0];
            for (limit, range) in [(lower, below), (upper, above)] {
                each(*row, EFFORT, figure(ws.tau_u[*u] - limit, range[0], range[1]), range);
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
