//! The lambda mechanism RRPR: a rocker that is moved by a slider on a turning stator, closed in its
//! plane.
//!
//! ```text
//!   d(y) = R(y) d₃ − d₁        pin seen from the stator's pivot
//!   d = R(θ) (ℓ t₀ + ε b₀)     slider length ℓ, eccentricity ε of the pin across the slider
//! ```
//! t₀ is the slider's direction at zero, b₀ is t₀ turned by a right angle. All in the plane
//! perpendicular to the rocker's axis n.
//!
//! Any plane loop of three turns and a slider is one of these when the joint opposite to the slider
//! is independent; "stator" is the other turn of the tree beside the slider. The branch is the sign
//! of ℓ, for every y that of the zero pose: the closed form knows no path, so beyond a gap with |d|
//! < |ε| it answers on the same side of the slider's root. Newton's method, which follows the path,
//! calls that target unreachable.

use crate::closure::{Level, Local, Numerical, Validity};
use crate::scalar::{Real, constants};

/// Geometry of a lambda in its plane.
#[derive(Clone, Debug)]
pub(crate) struct Rrpr<T> {
    /// Local joints: rocker (independent), stator, slider.
    pub(crate) joints: [usize; 3],
    /// Pin and stator pivot from the rocker's pivot, slider direction at zero {plane}.
    pub(crate) d3: [T; 2],
    pub(crate) d1: [T; 2],
    pub(crate) t0: [T; 2],
    /// |d|² at zero, signed slider length at zero, eccentricity and its square.
    pub(crate) square0: T,
    pub(crate) length0: T,
    pub(crate) eccentricity: T,
    /// +1 where the stator turns with the rocker's sense, −1 against it.
    pub(crate) sense: T,
    /// ±1, the sign of the slider's length.
    pub(crate) side: T,
    /// Newton's method on the true rows, if the geometry is only nearly planar.
    pub(crate) polish: Option<Numerical<T>>,
}

constants! { Rrpr:
    keep joints;
    number square0 length0 eccentricity sense side;
    map d3 d1 t0;
    each polish;
}

/// Where stator and slider are for the rocker's: the stator's cosine and sine, the slider's
/// coordinate; of both G, rates and g.
pub(super) struct Moved<T: Real> {
    pub(super) cos_sin: (T, T),
    pub(super) slide: T,
    pub(super) G: [T; 2],
    pub(super) rates: [T; 2],
    pub(super) g: [T; 2],
    pub(super) validity: Validity<T>,
}

impl<T: Real> Rrpr<T> {
    /// The position, velocity and acceleration level in closed form.
    #[inline]
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let [j1, j2, j3] = self.joints;
        let (s1, c1) = local.q[j1].sin_cos();
        let moved = self.moved((c1, s1), local.qd[j1], level);
        local.cos_sin[j1] = (c1, s1);
        local.cos_sin[j2] = moved.cos_sin;
        local.q[j2] = moved.cos_sin.1.atan2(moved.cos_sin.0);
        local.q[j3] = moved.slide;
        if level > Level::Position {
            local.G[j1] = T::ONE;
            [local.G[j2], local.G[j3]] = moved.G;
            local.g[j1] = T::ZERO;
        }
        if level >= Level::Velocity {
            [local.qd[j2], local.qd[j3]] = moved.rates;
        }
        if level == Level::Acceleration {
            [local.g[j2], local.g[j3]] = moved.g;
        }
        moved.validity
    }

    /// Stator and slider from the rocker's cosine and sine and its rate.
    #[inline(always)]
    pub(super) fn moved(&self, (c1, s1): (T, T), yd: T, level: Level) -> Moved<T> {
        let two = |v: &[T; 2]| [v[0], v[1]];
        let d3 = two(&self.d3);
        let d1 = two(&self.d1);
        let t0 = two(&self.t0);
        let e = self.eccentricity;
        let length0 = self.length0;

        // the pin: arm = R(y) d3, d = arm − d1
        let arm = [c1.mul_add(d3[0], -(s1 * d3[1])), s1.mul_add(d3[0], c1 * d3[1])];
        let d = [arm[0] - d1[0], arm[1] - d1[1]];
        let square = d[0].mul_add(d[0], d[1] * d[1]);

        // slider length; PRECISION: the change of |d|² is formed from the turn of the arm, q3
        // without cancellation
        let reach = square - e * e;
        let length = self.side * reach.sqrt();
        let q3 = (square - self.square0) / (length + length0);

        // stator angle from w = ℓ t0 + ε b0 to d
        let w = [length.mul_add(t0[0], -(e * t0[1])), length.mul_add(t0[1], e * t0[0])];
        let inverse_square = T::ONE / square;
        let cosine = w[0].mul_add(d[0], w[1] * d[1]) * inverse_square;
        let sine = w[0].mul_add(d[1], -(w[1] * d[0])) * inverse_square;
        let sense = self.sense;
        let none = [T::ZERO; 2];
        let mut moved = Moved {
            cos_sin: (cosine, sense * sine),
            slide: q3,
            G: none,
            rates: none,
            g: none,
            validity: Validity::of(reach, self.square0),
        };
        if level == Level::Position {
            return moved;
        }

        // t, b: slider direction and its normal; p: velocity of the pin for ẏ = 1
        let t = [cosine.mul_add(t0[0], -(sine * t0[1])), sine.mul_add(t0[0], cosine * t0[1])];
        let b = [-t[1], t[0]];
        let p = [-arm[1], arm[0]];
        let inverse_length = T::ONE / length;
        let turn_rate = b[0].mul_add(p[0], b[1] * p[1]) * inverse_length;
        let slide_rate = t[0].mul_add(p[0], t[1].mul_add(p[1], e * turn_rate));
        moved.G = [sense * turn_rate, slide_rate];
        if level == Level::Jacobian {
            return moved;
        }
        let w2 = turn_rate * yd;
        let v3 = slide_rate * yd;
        moved.rates = [sense * w2, v3];
        if level == Level::Velocity {
            return moved;
        }

        // d̈ at ÿ = 0, less the centripetal and Coriolis part of the stator
        let yd2 = yd * yd;
        let w22 = w2 * w2;
        let coriolis = T::from_f64(2.0) * v3 * w2;
        let bias = |k: usize| w22.mul_add(d[k], -(yd2.mul_add(arm[k], coriolis * b[k])));
        let x0 = bias(0);
        let x1 = bias(1);
        let turn_bias = b[0].mul_add(x0, b[1] * x1) * inverse_length;
        moved.g = [sense * turn_bias, t[0].mul_add(x0, t[1].mul_add(x1, e * turn_bias))];
        moved
    }
}
