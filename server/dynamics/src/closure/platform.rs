//! A platform on a chain of independent joints, held by struts (2SPU+1U, 6UPS), some with an offset
//! at one end (2SPRR+1U), or by cranks and rods (2SURRPR+1U, see [`super::RodLeg`]).
//!
//! A strut reaches for a pin on the platform (see [`super::Strut`], offset at the base included).
//! Where the offset is at the platform, an arm turns there about an axis n, and the strut's center
//! C stays in a plane of the arm whose normal m ⟂ n turns with it:
//!
//! ```text
//!   D = C − P in platform axes        P on the arm's axis
//!   m₀ · R_n(−θ) D = h                h = m · (C − P) at zero
//!   k · R_n(−θ) D = ±√(D_k² + D_m² − h²)        k, m, n right-handed
//! ```
//! Then the arm's tip is known and the strut reaches for it. With ω, α and E for the arm's body and
//! r = C − P: θ̇ k · r = −m · v_platform(C), and θ̈ from m · (a_E(C) − 2 ω × v_E(C)) = 0.

use nalgebra::{Matrix3, Vector3};

use crate::closure::{Level, Local, Numerical, Rate, RodLeg, Strut, Validity};
use crate::mechanism::{Body, Cluster, Dof, Motion, joint_pose, read_turns, turn};
use crate::scalar::Real;
use crate::spatial::{
    Pose, column, cross, cross_add, dot, lift, lift_mat, mul, mul_mat, scale_add, t_mul, turn_z,
    zero,
};

/// A platform and its legs.
#[derive(Clone, Debug)]
pub(crate) struct Platform<C> {
    /// Degrees of freedom of the joints that carry the platform, from the base, each with its place
    /// in y; all are independent.
    pub(crate) chain: Vec<(Dof, usize)>,
    pub(crate) legs: Vec<Leg<C>>,
    /// Legs of a crank and a rod.
    pub(crate) rods: Vec<RodLeg<C>>,
    /// Turns of the chain, and those that the legs find: place of the cosine and sine, and of the
    /// coordinate.
    turned: Vec<(usize, usize)>,
    found: Vec<(usize, usize)>,
    /// Joints that stand still where the start has them.
    pub(crate) idle: Vec<Dof>,
    /// Newton's method on the true rows, where the geometry is only nearly of this type.
    pub(crate) polish: Option<Numerical<C>>,
}

/// A strut and what it reaches for.
#[derive(Clone, Debug)]
pub(crate) struct Leg<C> {
    pub(crate) strut: Strut<C>,
    /// Pin {platform body}, or {arm: k, m, n from its pivot} where there is one.
    pub(crate) pin: Vector3<C>,
    pub(crate) arm: Option<Arm<C>>,
}

/// A turning arm on the platform that stays turned towards a point of the base.
#[derive(Clone, Debug)]
pub(crate) struct Arm<C> {
    pub(crate) joint: Dof,
    /// Its axes k, m, n at zero {platform body}.
    pub(crate) axes: Matrix3<C>,
    /// P, a point of its axis n {platform body}.
    pub(crate) pivot: Vector3<C>,
    /// The point C {cluster's parent body}.
    pub(crate) center: Vector3<C>,
    /// m · (C − P).
    pub(crate) beside: C,
    /// ±1, the sign of k · (C − P).
    pub(crate) side: C,
}

/// The pin and how it moves {cluster's parent body}.
struct Pin<T> {
    point: Vector3<T>,
    /// Of an arm: its tip from its pivot, m, n, 1 / (k · r) and its pivot.
    tip: Vector3<T>,
    m: Vector3<T>,
    n: Vector3<T>,
    inverse_length: T,
    pivot: Vector3<T>,
}

impl<C: nalgebra::Scalar + Copy> Platform<C> {
    /// Without Newton's method.
    pub(crate) fn new(
        chain: Vec<(Dof, usize)>,
        legs: Vec<Leg<C>>,
        rods: Vec<RodLeg<C>>,
        idle: Vec<Dof>,
    ) -> Platform<C> {
        let is_turn = |at: &&Dof| at.k == 0 && at.motion == Motion::Revolute;
        let place = |at: &Dof| (at.body, at.q);
        let turned = chain.iter().map(|(at, _)| at).filter(is_turn).map(place).collect();
        let of_leg = |leg: &Leg<C>| {
            let arm = leg.arm.as_ref().map(|arm| place(&arm.joint));
            leg.strut.joints[..2].iter().map(place).chain(arm).collect::<Vec<_>>()
        };
        // joints of rods are single ones
        let of_rod = |rod: &RodLeg<C>| {
            let stator = rod.drive.as_ref().map(|lambda| lambda.joints[1]);
            let joints = [rod.crank, rod.universal[0], rod.universal[1]].into_iter().chain(stator);
            joints.map(|j| (j, j)).collect::<Vec<_>>()
        };
        let found = legs.iter().flat_map(of_leg).chain(rods.iter().flat_map(of_rod)).collect();
        Platform { chain, turned, found, legs, rods, idle, polish: None }
    }

    /// The position, velocity and acceleration level in closed form.
    pub(crate) fn close<T: Real<Const = C>>(
        &self,
        cluster: &Cluster<C>,
        bodies: &[Body<C>],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Validity<T> {
        // pose of the platform along the chain; its joints' axes and points are kept for the
        // Jacobian
        turn(&self.turned, local.q, local.cos_sin);
        let mut pose = Pose::identity();
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            pose =
                pose.then(&joint_pose(&bodies[at.body], &local.q[at.q..], local.cos_sin[at.body]));
            local.scratch.pose[at.body + 1] = pose;
        }
        if level == Level::Acceleration {
            self.chain_rates(local);
        }
        if level >= Level::Jacobian {
            for (at, k) in &self.chain {
                local.G[at.v * cluster.n_vy..(at.v + 1) * cluster.n_vy].fill(T::ZERO);
                local.G[at.v * cluster.n_vy + k] = T::ONE;
                local.g[at.v] = T::ZERO;
            }
        }
        let mut validity = Validity::fine();
        for leg in &self.legs {
            let of_leg = match leg.arm {
                None => leg.close::<T, false>(self, cluster.n_vy, &pose, local, level),
                Some(_) => leg.close::<T, true>(self, cluster.n_vy, &pose, local, level),
            };
            validity = validity.or(of_leg);
        }
        for rod in &self.rods {
            validity = validity.or(rod.close(self, cluster.n_vy, local, level));
        }
        read_turns(&self.found, local.cos_sin, local.q);
        for at in &self.idle {
            local.q[at.q] = local.start[at.q];
            if at.motion == Motion::Revolute {
                let (s, c) = local.q[at.q].sin_cos();
                local.cos_sin[at.body] = (c, s);
            }
        }
        validity
    }

    /// Rates of the chain's bodies at q̈ = 0.
    fn chain_rates<T: Real<Const = C>>(&self, local: &mut Local<'_, T>) {
        let (mut rate, mut origin) = (Rate::at_rest(), zero());
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            let pose = &local.scratch.pose[at.body + 1];
            rate = rate.moved(at.motion, &(pose.p - origin), &pose.R, &local.qd[at.v..]);
            local.scratch.rate[at.body + 1] = rate;
            origin = pose.p;
        }
    }

    /// The same geometry with every constant converted.
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Platform<D> {
        let arm = |arm: &Arm<C>| Arm {
            joint: arm.joint,
            axes: arm.axes.map(f),
            pivot: arm.pivot.map(f),
            center: arm.center.map(f),
            beside: f(arm.beside),
            side: f(arm.side),
        };
        let leg = |leg: &Leg<C>| Leg {
            strut: leg.strut.map(f),
            pin: leg.pin.map(f),
            arm: leg.arm.as_ref().map(arm),
        };
        Platform {
            chain: self.chain.clone(),
            turned: self.turned.clone(),
            found: self.found.clone(),
            legs: self.legs.iter().map(leg).collect(),
            rods: self.rods.iter().map(|rod| rod.map(f)).collect(),
            idle: self.idle.clone(),
            polish: self.polish.as_ref().map(|numerical| numerical.map(f)),
        }
    }
}

impl<C: nalgebra::Scalar + Copy> Leg<C> {
    /// The levels of a leg with or without arm.
    #[inline]
    fn close<T: Real<Const = C>, const ARM: bool>(
        &self,
        of: &Platform<C>,
        n_vy: usize,
        platform: &Pose<T>,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Validity<T> {
        // where the pin is, then how the strut reaches it
        let arm = if ARM { self.arm.as_ref() } else { None };
        let (pin, of_arm) = self.pin(arm, platform, local);
        let (reach, validity) = self.strut.reach(&pin.point, local);
        let validity = if ARM { validity.or(of_arm) } else { validity };
        if level == Level::Position {
            return validity;
        }

        // one column of G for each independent coordinate
        let center = arm.map_or(zero(), |arm| lift(&arm.center));
        for (at, k) in &of.chain {
            let pose = &local.scratch.pose[at.body + 1];
            let z = at.axis(&pose.R);
            let moves = |x: &Vector3<T>| if at.slides() { z } else { cross(&z, &(x - pose.p)) };
            let mut velocity = moves(&pin.point);
            if let Some(arm) = arm {
                let rate = -(dot(&pin.m, &moves(&center)) * pin.inverse_length);
                velocity = scale_add(&cross(&pin.n, &pin.tip), rate, &velocity);
                local.G[arm.joint.v * n_vy + k] = rate;
            }
            let rates = self.strut.rates(&reach, &velocity);
            self.strut
                .joints
                .iter()
                .zip(rates)
                .for_each(|(i, rate)| local.G[i.v * n_vy + k] = rate);
        }
        if level == Level::Jacobian {
            return validity;
        }
        let rate = |j: Dof, local: &mut Local<'_, T>| {
            let mut qd = T::ZERO;
            for (at, k) in &of.chain {
                qd = local.G[j.v * n_vy + k].mul_add(local.qd[at.v], qd);
            }
            local.qd[j.v] = qd;
            qd
        };
        let rates = self.strut.joints.map(|j| rate(j, local));
        let turn_rate = arm.map_or(T::ZERO, |arm| rate(arm.joint, local));
        if level == Level::Velocity {
            return validity;
        }

        // acceleration of the pin at ÿ = 0
        let of_platform =
            of.chain.last().map_or(Rate::at_rest(), |(at, _)| local.scratch.rate[at.body + 1]);
        let mut acceleration = accelerated(&of_platform, &(pin.point - platform.p));
        if let Some(arm) = arm {
            // rates of the arm's body, its pivot for origin, at θ̈ = 0
            let to_pivot = pin.pivot - platform.p;
            let (w, wn) = (of_platform.w, cross(&of_platform.w, &pin.n));
            let of_arm = Rate {
                w: scale_add(&pin.n, turn_rate, &w),
                v: cross_add(&w, &to_pivot, &of_platform.v),
                alpha: scale_add(&wn, turn_rate, &of_platform.alpha),
                a: accelerated(&of_platform, &to_pivot),
            };
            let r = center - pin.pivot;
            let v = cross_add(&of_arm.w, &r, &of_arm.v);
            let x = scale_add(&cross(&of_arm.w, &v), -T::from_f64(2.0), &accelerated(&of_arm, &r));
            let bias = -(dot(&pin.m, &x) * pin.inverse_length);
            local.g[arm.joint.v] = bias;
            acceleration =
                scale_add(&cross(&pin.n, &pin.tip), bias, &accelerated(&of_arm, &pin.tip));
        }
        let bias = self.strut.accelerations(&reach, rates, &acceleration);
        self.strut.joints.iter().zip(bias).for_each(|(j, bias)| local.g[j.v] = bias);
        validity
    }

    /// The pin on the platform or on its arm; the arm's cosine and sine.
    #[inline(always)]
    fn pin<T: Real<Const = C>>(
        &self,
        arm: Option<&Arm<C>>,
        platform: &Pose<T>,
        local: &mut Local<'_, T>,
    ) -> (Pin<T>, Validity<T>) {
        let pin: Vector3<T> = lift(&self.pin);
        let Some(arm) = arm else {
            let point = platform.point(&pin);
            let pin = Pin {
                point,
                tip: zero(),
                m: zero(),
                n: zero(),
                inverse_length: T::ZERO,
                pivot: zero(),
            };
            return (pin, Validity::fine());
        };

        // D on the arm's axes at zero, its part along n apart
        let axes = mul_mat(&platform.R, &lift_mat(&arm.axes));
        let pivot = platform.point(&lift(&arm.pivot));
        let D = t_mul(&axes, &(lift(&arm.center) - pivot));
        let (beside, square) = (T::lift(arm.beside), D[0].mul_add(D[0], D[1] * D[1]));
        let reach = square - beside * beside;
        let length = T::lift(arm.side) * reach.sqrt();

        // θ carries (length, beside) onto (D_k, D_m)
        let inverse = T::ONE / square;
        let c = length.mul_add(D[0], beside * D[1]) * inverse;
        let s = length.mul_add(D[1], -(beside * D[0])) * inverse;
        local.cos_sin[arm.joint.body] = (c, s);
        let turned = turn_z(&axes, c, s);
        let tip = mul(&turned, &pin);
        let validity = Validity::of(reach, dot(&D, &D));
        let pin = Pin {
            point: pivot + tip,
            tip,
            m: column(&turned, 1),
            n: column(&turned, 2),
            inverse_length: T::ONE / length,
            pivot,
        };
        (pin, validity)
    }
}

/// Acceleration of a point of a body from the rates of its origin.
#[inline(always)]
pub(super) fn accelerated<T: Real>(rate: &Rate<T>, r: &Vector3<T>) -> Vector3<T> {
    cross_add(&rate.w, &cross(&rate.w, r), &cross_add(&rate.alpha, r, &rate.a))
}
