//! A leg of two revolute joints and a slider whose tip follows a point; the two axes are
//! perpendicular, and may be offset.
//!
//! In the frame of the strut, X along the first axis and Y along the second at zero, the point lies
//! at
//!
//! ```text
//!   v = R_x(q₁) (r Z + R_y(q₂) w)        r the distance of the axes
//!   w = ℓ a + e                          a the slider's direction, e ⟂ a the eccentricity
//! ```
//! With r = 0: ℓ² = |v|² − |e|². With a ⟂ Y the part of w along Y is constant, so that first z =
//! ±√(v_y² + v_z² − e_y²) − r, the part of R_y w along Z, then ℓ² = v_x² + z² + e_y² − |e|². Then
//! q₂ in the plane perpendicular to Y and q₁ in that perpendicular to X.

use nalgebra::{Matrix3, Vector3};

use crate::closure::{Local, Validity};
use crate::mechanism::Dof;
use crate::scalar::{Real, Triple, constants};
use crate::spatial::Matrix;

/// Geometry of a strut.
#[derive(Clone, Debug)]
pub(crate) struct Strut<T> {
    /// First and second revolute joint, slider.
    pub(crate) joints: [Dof; 3],
    /// The strut's frame {cluster's parent body}: X, Y along the axes at zero, origin on the first
    /// where the second is nearest.
    pub(crate) axes: Matrix3<T>,
    pub(crate) center: Vector3<T>,
    /// Whether the axes pass at a distance, and that distance along Z.
    pub(crate) apart: bool,
    pub(crate) distance: T,
    /// Slider direction and eccentricity at zero {strut}.
    pub(crate) a: Vector3<T>,
    pub(crate) e: Vector3<T>,
    /// |e|²; at zero |v|² where the axes cross, v_x² + z² where they do not; the signed slider
    /// length at zero.
    pub(crate) e_square: T,
    pub(crate) square0: T,
    pub(crate) length0: T,
    /// ±1, signs of the slider's length and of the root for the second turn.
    pub(crate) side: T,
    pub(crate) root: T,
}

constants! { Strut:
    keep joints apart;
    number distance e_square square0 length0 side root;
    map axes center a e;
}

/// The Jacobian of a strut and its inverse at a pose {strut}.
pub(super) struct Reach<T> {
    axes: Matrix3<T>,
    /// Second axis; arm of the first turn that the second leaves alone; point from the second axis;
    /// slider direction.
    a2: Vector3<T>,
    lever: Vector3<T>,
    u: Vector3<T>,
    a3: Vector3<T>,
    /// Rows of the inverse times the determinant, and its inverse.
    rows: [Vector3<T>; 3],
    inverse_det: T,
}

impl<T: Real> Strut<T> {
    /// Position level: the slider's coordinate and the cosines and sines of the turns for a point
    /// {cluster's parent body}, and the Jacobian there.
    #[inline(always)]
    pub(super) fn reach(
        &self,
        point: &Vector3<T>,
        local: &mut Local<'_, T>,
    ) -> (Reach<T>, Validity<T>) {
        let [j1, j2, j3] = self.joints;
        let axes: Matrix3<T> = self.axes;
        let a = self.a;
        let e = self.e;
        let v = axes.apply_transposed(point - self.center);
        let rho = v[1].mul_add(v[1], v[2] * v[2]);
        let sign = self.root;
        let side = self.side;
        let length0 = self.length0;
        let square0 = self.square0;
        let e_square = self.e_square;

        // slider length, without cancellation in its change; root = r + z
        let (length, root, z, reach, root_square) = if self.apart {
            let root_square = rho - e[1] * e[1];
            let root = sign * root_square.sqrt();
            let z = root - self.distance;
            let reach = v[0].mul_add(v[0], z.mul_add(z, e[1] * e[1] - e_square));
            let length = side * reach.sqrt();
            local.q[j3.q] = (v[0].mul_add(v[0], z * z) - square0) / (length + length0);
            (length, root, z, reach, root_square)
        } else {
            let square = v[0].mul_add(v[0], rho);
            let reach = square - e_square;
            let length = side * reach.sqrt();
            local.q[j3.q] = (square - square0) / (length + length0);
            let along = a[1].mul_add(length, e[1]);
            let root_square = rho - along * along;
            let root = sign * root_square.sqrt();
            (length, root, root, reach, root_square)
        };
        let w = e.add_scaled(a, length);

        // second turn carries (w_x, w_z) onto (v_x, z), the first (w_y, root) onto (v_y, v_z)
        let inverse_n = T::ONE / w[0].mul_add(w[0], w[2] * w[2]);
        let c2 = w[0].mul_add(v[0], w[2] * z) * inverse_n;
        let s2 = w[2].mul_add(v[0], -(w[0] * z)) * inverse_n;
        let inverse_rho = T::ONE / rho;
        let c1 = w[1].mul_add(v[1], root * v[2]) * inverse_rho;
        let s1 = w[1].mul_add(v[2], -(root * v[1])) * inverse_rho;
        local.cos_sin[j1.body] = (c1, s1);
        local.cos_sin[j2.body] = (c2, s2);
        // each alone: where one is negative the other is no number
        let validity = Validity::of(reach, square0).or(Validity::of(root_square, square0));

        // columns: X × v, a₂ × (v − r Z), slider direction; the inverse by cross products
        let a2 = Vector3::new(T::ZERO, c1, s1);
        let distance = self.distance;
        let lever = Vector3::new(T::ZERO, -(distance * s1), distance * c1);
        let u = v - lever;
        let J1 = Vector3::new(T::ZERO, -v[2], v[1]);
        let J2 = a2.cross(u);
        let ry = Vector3::new(c2.mul_add(a[0], s2 * a[2]), a[1], c2.mul_add(a[2], -(s2 * a[0])));
        let a3 =
            Vector3::new(ry[0], c1.mul_add(ry[1], -(s1 * ry[2])), s1.mul_add(ry[1], c1 * ry[2]));
        let rows = [J2.cross(a3), a3.cross(J1), J1.cross(J2)];
        let inverse_det = T::ONE / a3.dot(rows[2]);
        (Reach { axes, a2, lever, u, a3, rows, inverse_det }, validity)
    }

    /// Rates of the three joints for a velocity of the point {cluster's parent body}.
    #[inline(always)]
    pub(super) fn rates(&self, reach: &Reach<T>, velocity: &Vector3<T>) -> [T; 3] {
        let x = reach.axes.apply_transposed(*velocity);
        reach.rows.each_ref().map(|row| (*row).dot(x) * reach.inverse_det)
    }

    /// Accelerations of the three joints from their rates and an acceleration of the point
    /// {cluster's parent body}.
    #[inline(always)]
    pub(super) fn accelerations(
        &self,
        reach: &Reach<T>,
        rates: [T; 3],
        acceleration: &Vector3<T>,
    ) -> [T; 3] {
        let [w1, w2, slide] = rates;
        let w = Vector3::new(w1, w2 * reach.a2[1], w2 * reach.a2[2]);
        let alpha = Vector3::new(T::ZERO, -(w1 * w[2]), w1 * w[1]);
        let inner = w.cross(reach.u).add_scaled(reach.a3, slide + slide);
        let of_strut = alpha.cross(reach.u).add_cross(w, inner);
        let of_strut = of_strut.add_scaled(reach.lever, -(w1 * w1));
        let x = reach.axes.apply_transposed(*acceleration) - of_strut;
        reach.rows.each_ref().map(|row| (*row).dot(x) * reach.inverse_det)
    }
}
