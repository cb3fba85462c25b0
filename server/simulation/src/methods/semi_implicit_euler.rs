//! Semi-implicit Euler: order 1.
//!
//! ```text
//!   ẏ₊ = ẏ + h ÿ(t, y, ẏ),   y₊ = y ⊞ h ẏ₊
//! ```
//! ⊞ is the exponential map of quaternions and the sum of everything else.

use sarrus_dynamics::Status;

use super::fixed_step::OneStep;
use crate::motion::engine::Engine;

/// The method with its scratch.
#[derive(Default)]
pub(crate) struct SemiImplicitEuler {
    next: Vec<f64>,
}

impl OneStep for SemiImplicitEuler {
    /// ẏ += h ÿ at the old state, then y along the new ẏ by the exponential map.
    fn step(&mut self, engine: &mut Engine, t: f64, x: &mut [f64], to: f64) -> Result<(), Status> {
        let n_qy = engine.mechanism.sizes.n_qy;
        let n_vy = engine.mechanism.sizes.n_vy;
        let h = to - t;
        self.next.clear();
        self.next.extend_from_slice(x);
        let rate = &engine.anchor.rate;
        (n_qy..x.len()).for_each(|i| self.next[i] += h * rate[i]);
        // a rotor behind a spring moves by its new speed too
        for at in (0..engine.mechanism.effects.rotors.len()).map(|k| engine.mechanism.rotor(k)) {
            self.next[at + 1] = x[at + 1] + h * self.next[at];
        }
        let (y, rest) = self.next.split_at_mut(n_qy);
        engine.mechanism.y.advance(y, &rest[..n_vy], h);
        engine.accept(to, &mut self.next, x)
    }
}
