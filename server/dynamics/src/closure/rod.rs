//! A leg of a crank and a rod: the crank turns on the base, the rod has a universal joint whose
//! axes cross at a right angle at one end and a ball at the other, and reaches for a platform. A
//! slider on a turning stator may drive the crank, a lambda in its plane.
//!
//! With d from the center of the crank's circle to the rod's end B on the platform, all along the
//! crank's axes X Y Z, X towards the rod's end A on the crank at zero:
//!
//! ```text
//!   |d − R_z(θ) a X| = ℓ        a the crank, ℓ the rod
//!   κ = ½ (a² + |d|² − ℓ²),   W = ±√(a² (d_x² + d_y²) − κ²)
//!   R_z(θ) a X = (κ d + W Z × d) / (d_x² + d_y²)      in the plane of the circle
//! ```
//! a quadratic equation of tan θ/2. Then, with x the rod from its universal joint to its ball along
//! the axes of that joint, w the same at zero, n the first turn and m the second:
//!
//! ```text
//!   x = R_x(n) R_y(m) w,    z = ±√(w_x² + w_z² − x_x²)
//!   m takes (w_x, w_z) onto (x_x, z),    n takes (w_y, z) onto (x_y, x_z)
//! ```
//! With r the rod from universal joint to ball, v the velocity of the platform where the ball is, t
//! that of A for θ̇ = 1, b and c the universal joint's axes:
//!
//! ```text
//!   θ̇ = r · v / r · t,     r · t = ∓W
//!   ṅ b × r + ṁ c × r = e,    ṅ = −c · e / z,    ṁ = b · e / z
//! ```
//! where e is the velocity of the ball relative to the body that carries the universal joint: v
//! less the velocity by the crank where the crank carries it, and θ̇ t − v where the platform does.
//! The accelerations at q̈ = 0 have the same form.

use nalgebra::{Matrix3, Vector3};

use crate::closure::platform::Platform;
use crate::closure::{Level, Local, Rrpr, Validity};
use crate::scalar::{Real, Triple, constants};
use crate::spatial::{Matrix, Pose, zero};

/// Geometry of a crank and its rod; every joint has one degree of freedom.
#[derive(Clone, Debug)]
pub(crate) struct RodLeg<T> {
    /// The crank, a local joint.
    pub(crate) crank: usize,
    /// The universal joint on the crank's axes or on the platform.
    pub(crate) universal: Universal<T>,
    /// The local body for which it reaches, and how many degrees of freedom of the chain carry it.
    pub(crate) platform: usize,
    pub(crate) depth: usize,
    /// The universal joint is on the crank and the ball on the platform, not the other way round.
    pub(crate) on_crank: bool,
    /// The crank's axes at zero and the center of its circle {cluster's parent body}.
    pub(crate) axes: Matrix3<T>,
    pub(crate) center: Vector3<T>,
    /// The rod's end on the platform {platform}.
    pub(crate) pin: Vector3<T>,
    /// A point that d is near at zero {crank's axes}, and κ there.
    pub(crate) near: Vector3<T>,
    pub(crate) along: T,
    /// a, a², the larger one of this and ℓ².
    pub(crate) radius: T,
    pub(crate) radius_square: T,
    pub(crate) reach_square: T,
    /// ±1, the sign of W.
    pub(crate) side: T,
    /// The drive of the crank.
    pub(crate) drive: Option<Rrpr<T>>,
}

constants! { RodLeg:
    keep crank platform depth on_crank;
    number along radius radius_square reach_square side;
    map universal axes center pin near;
    each drive;
}

/// A universal joint whose axes cross at a right angle, on a rod with a ball at its end.
#[derive(Clone, Debug)]
pub(crate) struct Universal<T> {
    /// Local joints of its first and second turn; of a hinge twice the same, as its second turn
    /// stays at zero.
    pub(crate) joints: [usize; 2],
    /// Its axes at zero {the body that carries it}.
    pub(crate) axes: Matrix3<T>,
    /// The rod from it to the ball at zero {its axes}.
    pub(crate) rod: Vector3<T>,
    /// ℓ², w_x² + w_z².
    pub(crate) length_square: T,
    pub(crate) swing_square: T,
    /// ±1, the sign of z.
    pub(crate) root: T,
}

constants! { Universal:
    keep joints;
    number length_square swing_square root;
    map axes rod;
}

/// A rod at a pose: from universal joint to ball, that joint's axes, and 1 / z.
pub(super) struct Reached<T> {
    r: Vector3<T>,
    b: Vector3<T>,
    c: Vector3<T>,
    inverse_root: T,
}

/// A leg at a pose {cluster's parent body}.
struct Posed<T> {
    /// The rod's end on the platform and its ball; A from the center of the circle; the rod.
    point: Vector3<T>,
    ball: Vector3<T>,
    arm: Vector3<T>,
    rod: Reached<T>,
    /// Axis of the crank.
    a: Vector3<T>,
    /// Velocity of the ball, or of A, for θ̇ = 1; 1 / (r · t).
    t: Vector3<T>,
    inverse_lever: T,
}

impl<T: Real> RodLeg<T> {
    /// The position, velocity and acceleration level; the platform is at its pose, its rates are in
    /// the scratch.
    #[inline]
    pub(super) fn close(
        &self,
        of: &Platform<T>,
        n_vy: usize,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Validity<T> {
        let platform = local.scratch.pose[self.platform];
        let (at, validity) = self.pose(&platform, local);
        if level > Level::Position {
            self.rates(&at, of, n_vy, &platform, local, level);
        }

        // the lambda takes the crank for its independent joint
        let Some(lambda) = &self.drive else { return validity };
        let crank = self.crank;
        let [_, stator, slider] = lambda.joints;
        let moved = lambda.moved(local.cos_sin[crank], local.qd[crank], level);
        local.cos_sin[stator] = moved.cos_sin;
        local.q[slider] = moved.slide;
        let validity = validity.then(moved.validity);
        if level == Level::Position {
            return validity;
        }
        for (j, G, qd, g) in [
            (stator, moved.G[0], moved.rates[0], moved.g[0]),
            (slider, moved.G[1], moved.rates[1], moved.g[1]),
        ] {
            for k in 0..n_vy {
                local.G[j * n_vy + k] = G * local.G[crank * n_vy + k];
            }
            if level >= Level::Velocity {
                local.qd[j] = qd;
            }
            if level == Level::Acceleration {
                local.g[j] = G.mul_add(local.g[crank], g);
            }
        }
        validity
    }

    /// Cosines and sines of the crank and of the universal joint.
    #[inline(always)]
    fn pose(&self, platform: &Pose<T>, local: &mut Local<'_, T>) -> (Posed<T>, Validity<T>) {
        let axes: Matrix3<T> = self.axes;
        let radius = self.radius;
        let radius_square = self.radius_square;
        let half = T::from_f64(0.5);

        // the crank: κ, W, its end in the plane of the circle; PRECISION: κ is made of changes
        // since zero, and the cosine and sine are of unit length for every rounding of W
        let point = platform.point(&self.pin);
        let center = self.center;
        let d = point - center;
        let D = axes.apply_transposed(d);
        let square = D[0].mul_add(D[0], D[1] * D[1]);
        let near: Vector3<T> = self.near;
        let along = half.mul_add((D - near).dot(D + near), self.along);
        let W_square = radius_square.mul_add(square, -(along * along));
        let W = self.side * W_square.sqrt();
        let inverse = T::ONE / (square * along.mul_add(along, W_square)).sqrt();
        let c0 = along.mul_add(D[0], -(W * D[1])) * inverse;
        let s0 = along.mul_add(D[1], W * D[0]) * inverse;
        let turned = axes.turn_z(c0, s0);
        let a = turned.col(2);
        let arm = turned.col(0) * radius;

        // the universal joint: z, second turn, first turn
        local.cos_sin[self.crank] = (c0, s0);
        let (r, carrier) = if self.on_crank { (d - arm, &turned) } else { (arm - d, &platform.R) };
        let (rod, of_rod) = self.universal.reach(carrier, r, local);
        let size = self.reach_square;
        let validity =
            Validity::of(W_square, size * square).or(Validity::of(square, size)).or(of_rod);

        // r · t is −W where r runs from crank to platform, W where it runs back
        let (t, lever, ball) =
            if self.on_crank { (a.cross(d), -W, point) } else { (a.cross(arm), W, arm + center) };
        let inverse_lever = T::ONE / lever;
        (Posed { point, ball, arm, rod, a, t, inverse_lever }, validity)
    }

    /// Their rows of G, their rates and g.
    #[inline(always)]
    fn rates(
        &self,
        at: &Posed<T>,
        of: &Platform<T>,
        n_vy: usize,
        platform: &Pose<T>,
        local: &mut Local<'_, T>,
        level: Level,
    ) {
        let joints = self.joints();
        let chain = &of.chain[..self.depth];
        for j in joints {
            local.G[j * n_vy..(j + 1) * n_vy].fill(T::ZERO);
        }
        for (dof, k) in chain {
            let pose = &local.scratch.pose[dof.body + 1];
            let axis = dof.axis(&pose.R);
            let v = if dof.slides() { axis } else { axis.cross(at.ball - pose.p) };
            let column = self.solve(at, &v);
            for (j, x) in joints.into_iter().zip(column) {
                local.G[j * n_vy + k] = x;
            }
        }
        if level == Level::Jacobian {
            return;
        }
        let [w0, w1, w2] = joints.map(|j| {
            let mut qd = T::ZERO;
            for (dof, k) in chain {
                qd = local.G[j * n_vy + k].mul_add(local.qd[dof.v], qd);
            }
            local.qd[j] = qd;
            qd
        });
        if level == Level::Velocity {
            return;
        }

        // acceleration of the platform against the leg's at its own rates, ÿ = 0
        let of_platform = &local.scratch.rate[self.platform];
        let a_platform = of_platform.acceleration(at.point - platform.p);
        let a_arm = at.arm * -(w0 * w0);
        let (w, alpha) =
            if self.on_crank { (at.a * w0, zero()) } else { (of_platform.w, of_platform.alpha) };
        let of_rod = at.rod.acceleration(w, alpha, [w1, w2]);
        let bias = if self.on_crank {
            self.solve(at, &(a_platform - a_arm - of_rod))
        } else {
            self.solve(at, &(a_platform - a_arm + of_rod))
        };
        for (j, x) in joints.into_iter().zip(bias) {
            local.g[j] = x;
        }
    }

    /// Rates of crank and universal joint for a velocity of the platform where the ball is.
    #[inline(always)]
    fn solve(&self, at: &Posed<T>, v: &Vector3<T>) -> [T; 3] {
        let turn = at.rod.r.dot(*v) * at.inverse_lever;
        let e = (*v).add_scaled(at.t, -turn);
        let [first, second] = at.rod.solve(&if self.on_crank { e } else { -e });
        [turn, first, second]
    }
}

impl<T> RodLeg<T> {
    /// The crank and the two turns of the universal joint.
    pub(crate) fn joints(&self) -> [usize; 3] {
        [self.crank, self.universal.joints[0], self.universal.joints[1]]
    }
}

impl<T: Real> Universal<T> {
    /// Cosines and sines for the rod r: z, second turn, first turn.
    #[inline(always)]
    pub(super) fn reach(
        &self,
        carrier: &Matrix3<T>,
        r: Vector3<T>,
        local: &mut Local<'_, T>,
    ) -> (Reached<T>, Validity<T>) {
        let axes = carrier.times(self.axes);
        let x = axes.apply_transposed(r);
        let w: Vector3<T> = self.rod;
        let swing_square = self.swing_square;
        let root_square = swing_square - x[0] * x[0];
        let z = self.root * root_square.sqrt();
        let inverse_n = T::ONE / swing_square;
        let c2 = w[0].mul_add(x[0], w[2] * z) * inverse_n;
        let s2 = w[2].mul_add(x[0], -(w[0] * z)) * inverse_n;
        let rho = x[1].mul_add(x[1], x[2] * x[2]);
        let inverse_rho = T::ONE / (rho * w[1].mul_add(w[1], root_square)).sqrt();
        let c1 = w[1].mul_add(x[1], z * x[2]) * inverse_rho;
        let s1 = w[1].mul_add(x[2], -(z * x[1])) * inverse_rho;
        let [first, second] = self.joints;
        local.cos_sin[second] = (c2, s2);
        local.cos_sin[first] = (c1, s1);
        let b = axes.col(0);
        let c = (axes.col(1) * c1).add_scaled(axes.col(2), s1);
        let inverse_root = T::ONE / r.dot(b.cross(c));
        (Reached { r, b, c, inverse_root }, Validity::of(root_square, self.length_square))
    }
}

impl<T: Real> Reached<T> {
    /// Rates of both turns for a velocity of the ball against the body that carries the joint.
    #[inline(always)]
    pub(super) fn solve(&self, e: &Vector3<T>) -> [T; 2] {
        [-(self.c.dot(*e) * self.inverse_root), self.b.dot(*e) * self.inverse_root]
    }

    /// Acceleration of the ball against the joint's center at constant rates of both turns, on a
    /// body with these rates.
    #[inline(always)]
    pub(super) fn acceleration(
        &self,
        w: Vector3<T>,
        alpha: Vector3<T>,
        [w1, w2]: [T; 2],
    ) -> Vector3<T> {
        let first = w.add_scaled(self.b, w1);
        let whole = first.add_scaled(self.c, w2);
        let turning = alpha.add_scaled(w.cross(self.b), w1);
        let turning = turning.add_scaled(first.cross(self.c), w2);
        whole.cross(whole.cross(self.r)).add_cross(turning, self.r)
    }
}
