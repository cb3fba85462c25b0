//! Positions, velocities and actuator forces against the limits of the model.

use sarrus_proto::{Field, Request, Warnings};

use crate::closure::Level;
use crate::plan::Plan;
use crate::scalar::{Figure, Scalar};
use crate::workspace::Workspace;

/// The columns of [`Field::Limits`].
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const EFFORT: usize = 2;

impl Plan {
    /// Whether a position, velocity or actuator force lies outside its limits.
    pub(super) fn limits<T: Scalar>(&self, ws: &Workspace<T>) -> Warnings {
        let mut warnings = Warnings::NONE;
        self.each_excess(ws, |_, _, excess| {
            if excess != 0.0 {
                warnings |= Warnings::LIMITS_EXCEEDED;
            }
        });
        warnings
    }

    /// By how much each of them does, in the rows that are asked (n_v × 3).
    pub(super) fn write_limits<T: Scalar>(&self, ws: &Workspace<T>, out: &mut [T]) {
        out.fill(T::ZERO);
        self.each_excess(ws, |row, column, excess| {
            if let Some(row) = row {
                out[row * 3 + column] = T::from_f64(excess);
            }
        });
    }

    /// Calls `each(row, column, excess)` for every limit that this request can meet.
    #[inline(always)]
    fn each_excess<T: Scalar>(
        &self,
        ws: &Workspace<T>,
        mut each: impl FnMut(Option<usize>, usize, f64),
    ) {
        let moves = self.steps.velocity.is_some() && self.steps.level >= Level::Velocity;
        for (row, limit) in &self.needed.limits {
            each(*row, POSITION, excess(ws.q[limit.q], limit.lower, limit.upper));
            if moves {
                let velocity = ws.qd[limit.v];
                each(*row, VELOCITY, excess(velocity, -limit.velocity, limit.velocity));
            }
        }
        if self.request == Request::InverseDynamics && self.wants(Field::TauU) {
            for (u, row, effort) in &self.needed.efforts {
                each(*row, EFFORT, excess(ws.tau_u[*u], -effort, *effort));
            }
        }
    }
}

/// How far x lies outside: negative below, positive above.
#[inline(always)]
fn excess<T: Scalar>(x: T, lower: f64, upper: f64) -> f64 {
    let x = x.to_figure(Figure::Limited { lower, upper });
    if x < lower {
        x - lower
    } else if x > upper {
        x - upper
    } else {
        0.0
    }
}
