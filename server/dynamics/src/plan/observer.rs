//! Momentum observer [LM03: De Luca, Mattone, Actuator failure detection and isolation using
//! generalized momenta, ICRA 2003], in the independents of a robot with loops.
//!
//! The momentum p = M_y ẏ changes by ṗ = f + τ_ext, with
//!
//! ```text
//!   f = τ_y − gravity, springs, dampers, friction, wrenches + Gᵀ Σ ṡᵀ H + Ġᵀ p_q
//! ```
//!
//! Ġ comes from the derivatives of the closures, so that f has no difference quotients. Over a step
//! the mean of f is that of its ends, and the mean of τ_ext, (p − p₀) / dt − (f + f₀) / 2, passes a
//! filter of first order.

use sarrus_proto::{Field, Status};

use crate::algorithms;
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::Real;
use crate::workspace::{Derivatives, Workspace};

impl Plan {
    /// The step from the given state of the observer, after `known_forces` and the motions of the
    /// bodies; without a state, or with `dt` = 0, it begins here.
    pub(super) fn observe<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        input: &[T],
        d: &mut Derivatives<T>,
    ) -> Result<(), Status> {
        let given = |field| self.given().slot(field).map(|slot| &input[slot.range()]);
        let number = |field| given(field).map_or(T::ZERO, |x| x[0]);
        let dt = number(Field::Dt);
        let gain = number(Field::Gain);
        if dt < T::ZERO || gain < T::ZERO {
            return Err(Status::BadRequest);
        }
        algorithms::momenta(model, &ws.qd, d);
        for cluster in &model.clusters {
            let m = cluster.n_vy;
            let Gd = &d.Gd[cluster.block()];
            let G = cluster.G(&ws.G);
            for (k, vy) in cluster.independents().enumerate() {
                let mut p = T::ZERO;
                let mut rate = ws.tau_y[vy];
                for j in 0..cluster.n_v {
                    let own = d.tau_q[cluster.v + j];
                    p = G[(j, k)].mul_add(own, p);
                    rate = G[(j, k)].mul_add(d.held_q[cluster.v + j], rate);
                    rate = Gd[j * m + k].mul_add(own, rate);
                }
                d.observer[vy] = [T::ZERO, p, rate];
            }
        }
        let Some(before) = given(Field::Observer) else { return Ok(()) };
        // 1 − exp(−gain dt)
        let half = T::from_f64(0.5);
        let tanh = (half * gain * dt).tanh();
        let part = (tanh + tanh) / (T::ONE + tanh);
        for (before, vy) in before.chunks_exact(3).zip(&model.order.vy) {
            let [force, p, rate] = &mut d.observer[*vy];
            *force = before[0];
            if T::ZERO < dt {
                let mean = (*p - before[1]) / dt - half * (*rate + before[2]);
                *force = part.mul_add(mean - before[0], before[0]);
            }
        }
        Ok(())
    }
}
