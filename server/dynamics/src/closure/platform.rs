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
use crate::mechanism::{Dof, Motion, joint_pose, read_turns, turn};
use crate::scalar::{Real, Triple, constants};
use crate::spatial::{Matrix, Pose, zero};

/// A platform and its legs.
#[derive(Clone, Debug)]
pub(crate) struct Platform<T> {
    /// Degrees of freedom of the joints that carry the platform, from the base, each with its index
    /// in y; all are independent.
    pub(crate) chain: Vec<(Dof, usize)>,
    pub(crate) legs: Vec<Leg<T>>,
    /// Legs of a crank and a rod.
    pub(crate) rods: Vec<RodLeg<T>>,
    /// Revolute joints of the chain, and those that the legs solve: index of the cosine and sine,
    /// and of the coordinate.
    turned: Vec<(usize, usize)>,
    found: Vec<(usize, usize)>,
    /// Joints that keep their start position.
    pub(crate) idle: Vec<Dof>,
    /// Newton's method on the true rows, if the geometry is only nearly of this type.
    pub(crate) polish: Option<Numerical<T>>,
}

constants! { Platform:
    keep chain turned found idle;
    each legs rods polish;
}

/// A strut and the pin for which it reaches.
#[derive(Clone, Debug)]
pub(crate) struct Leg<T> {
    pub(crate) strut: Strut<T>,
    /// Pin {platform body}, or {arm: k, m, n from its pivot} where there is one.
    pub(crate) pin: Vector3<T>,
    pub(crate) arm: Option<Arm<T>>,
}

constants! { Leg:
    map strut pin;
    each arm;
}

/// A turning arm on the platform that stays turned towards a point of the base.
#[derive(Clone, Debug)]
pub(crate) struct Arm<T> {
    pub(crate) joint: Dof,
    /// Its axes k, m, n at zero {platform body}.
    pub(crate) axes: Matrix3<T>,
    /// P, a point of its axis n {platform body}.
    pub(crate) pivot: Vector3<T>,
    /// The point C {cluster's parent body}.
    pub(crate) center: Vector3<T>,
    /// m · (C − P).
    pub(crate) offset: T,
    /// ±1, the sign of k · (C − P).
    pub(crate) side: T,
}

constants! { Arm:
    keep joint;
    number offset side;
    map axes pivot center;
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

impl<T: Real> Platform<T> {
    /// Without Newton's method.
    pub(crate) fn new(
        chain: Vec<(Dof, usize)>,
        legs: Vec<Leg<T>>,
        rods: Vec<RodLeg<T>>,
        idle: Vec<Dof>,
    ) -> Platform<T> {
        let is_turn = |at: &&Dof| at.k == 0 && at.motion == Motion::Revolute;
        let place = |at: &Dof| (at.body, at.q);
        let turned = chain.iter().map(|(at, _)| at).filter(is_turn).map(place).collect();
        let of_leg = |leg: &Leg<T>| {
            let arm = leg.arm.as_ref().map(|arm| place(&arm.joint));
            leg.strut.joints[..2].iter().map(place).chain(arm).collect::<Vec<_>>()
        };
        // joints of rods are single ones
        let of_rod = |rod: &RodLeg<T>| {
            let stator = rod.drive.as_ref().map(|lambda| lambda.joints[1]);
            let joints = rod.joints().into_iter().chain(stator);
            joints.map(|j| (j, j)).collect::<Vec<_>>()
        };
        let found = legs.iter().flat_map(of_leg).chain(rods.iter().flat_map(of_rod)).collect();
        Platform { chain, turned, found, legs, rods, idle, polish: None }
    }

    /// The position, velocity and acceleration level in closed form.
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let &mut Local { cluster, bodies, .. } = local;
        // pose of the platform along the chain; its joints' axes and points are kept for the
        // Jacobian
        turn(&self.turned, local.q, local.cos_sin);
        let mut pose = Pose::identity();
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            let body = &bodies[at.body];
            let q = &local.q[at.q..];
            pose = pose.then(&joint_pose(body, &body.p_local, q, local.cos_sin[at.body]));
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
                None => leg.close::<false>(self, cluster.n_vy, &pose, local, level),
                Some(_) => leg.close::<true>(self, cluster.n_vy, &pose, local, level),
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
    fn chain_rates(&self, local: &mut Local<'_, T>) {
        let mut rate = Rate::at_rest();
        let mut origin = zero();
        for (at, _) in self.chain.iter().filter(|(at, _)| at.k == 0) {
            let pose = &local.scratch.pose[at.body + 1];
            rate = rate.moved(at.motion, &(pose.p - origin), &pose.R, &local.qd[at.v..]);
            local.scratch.rate[at.body + 1] = rate;
            origin = pose.p;
        }
    }
}

impl<T: Real> Leg<T> {
    /// The levels of a leg with or without arm.
    #[inline]
    fn close<const ARM: bool>(
        &self,
        of: &Platform<T>,
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
        let center = arm.map_or(zero(), |arm| arm.center);
        for (at, k) in &of.chain {
            let pose = &local.scratch.pose[at.body + 1];
            let z = at.axis(&pose.R);
            let moves = |x: &Vector3<T>| if at.slides() { z } else { z.cross(x - pose.p) };
            let mut velocity = moves(&pin.point);
            if let Some(arm) = arm {
                let rate = -(pin.m.dot(moves(&center)) * pin.inverse_length);
                velocity = velocity.add_scaled(pin.n.cross(pin.tip), rate);
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
        let mut acceleration = of_platform.acceleration(pin.point - platform.p);
        if let Some(arm) = arm {
            // rates of the arm's body, its pivot for origin, at θ̈ = 0
            let to_pivot = pin.pivot - platform.p;
            let w = of_platform.w;
            let wn = of_platform.w.cross(pin.n);
            let of_arm = Rate {
                w: w.add_scaled(pin.n, turn_rate),
                v: of_platform.v.add_cross(w, to_pivot),
                alpha: of_platform.alpha.add_scaled(wn, turn_rate),
                a: of_platform.acceleration(to_pivot),
            };
            let r = center - pin.pivot;
            let v = of_arm.v.add_cross(of_arm.w, r);
            let x = of_arm.acceleration(r).add_scaled(of_arm.w.cross(v), -T::from_f64(2.0));
            let bias = -(pin.m.dot(x) * pin.inverse_length);
            local.g[arm.joint.v] = bias;
            acceleration = of_arm.acceleration(pin.tip).add_scaled(pin.n.cross(pin.tip), bias);
        }
        let bias = self.strut.accelerations(&reach, rates, &acceleration);
        self.strut.joints.iter().zip(bias).for_each(|(j, bias)| local.g[j.v] = bias);
        validity
    }

    /// The pin on the platform or on its arm; the arm's cosine and sine.
    #[inline(always)]
    fn pin(
        &self,
        arm: Option<&Arm<T>>,
        platform: &Pose<T>,
        local: &mut Local<'_, T>,
    ) -> (Pin<T>, Validity<T>) {
        let pin: Vector3<T> = self.pin;
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
        let axes = platform.R.times(arm.axes);
        let pivot = platform.point(&arm.pivot);
        let D = axes.apply_transposed(arm.center - pivot);
        let offset = arm.offset;
        let square = D[0].mul_add(D[0], D[1] * D[1]);
        let reach = square - offset * offset;
        let length = arm.side * reach.sqrt();

        // θ carries (length, beside) onto (D_k, D_m)
        let inverse = T::ONE / square;
        let c = length.mul_add(D[0], offset * D[1]) * inverse;
        let s = length.mul_add(D[1], -(offset * D[0])) * inverse;
        local.cos_sin[arm.joint.body] = (c, s);
        let turned = axes.turn_z(c, s);
        let tip = turned.apply(pin);
        let validity = Validity::of(reach, D.dot(D));
        let pin = Pin {
            point: pivot + tip,
            tip,
            m: turned.col(1),
            n: turned.col(2),
            inverse_length: T::ONE / length,
            pivot,
        };
        (pin, validity)
    }
}
