//! Rods that only hold a distance: links between a universal joint and a ball, whose own two turns
//! enter no loop but through the rod's length. With d = p_S − p_P from the center P of the
//! universal joint to that of the ball, S, each of them is one row,
//!
//! ```text
//!   φ = ½ (|d|² − ℓ²) / ℓ        φ̇ = d · ḋ / ℓ        φ̈ = (d · d̈ + ḋ · ḋ) / ℓ
//! ```
//! and Newton's method solves these for the other dependents from a seed, by the rule of
//! [`super::newton`]. The two turns follow in closed form ([`Universal`]), with the sign of the
//! root at the zero pose: inside the cells of a table it cannot change, as the declared rows are
//! singular where the root is zero. A link of a plane or spherical linkage that turns on a hinge is
//! such a rod too, from the hinge's axis to its pin: there the distance across the axis decides.

use nalgebra::Vector3;

use crate::closure::constraint::rates::rate_of;
use crate::closure::constraint::rows::place;
use crate::closure::numerical::inverse::{accurate, inverse_square_sines};
use crate::closure::numerical::newton::{CAUTION, CONTRACTION, TRUST};
use crate::closure::{Level, Local, MOST, Rate, Scratch, Twist, Universal, Validity};
use crate::linalg::{column_square, eliminate, substitute_back};
use crate::mechanism::{Dof, Motion, read_turns, turn};
use crate::scalar::{Real, Triple, constants};
use crate::spatial::{Matrix, Pose, zero};

/// Steps from a seed, each by an elimination of its own: few where a table is fine enough, else
/// most. The last one's inverse serves the rates too.
pub(crate) const FEW_STEPS: usize = 2;
const MOST_STEPS: usize = 3;
/// Roundings below which the last step may stay.
const ROUNDINGS: f64 = 64.0;
/// Least pivot against the size of its column: a smaller one costs more digits than one step of
/// refinement returns, half of all.
const PIVOT: f64 = 1e-7;

/// A mechanism whose rows are those of such rods.
#[derive(Clone, Debug)]
pub(crate) struct Rods<T> {
    /// The dependents that are no turns of rods, as many as rods.
    pub(crate) unknowns: Vec<Dof>,
    /// In the order of the pivots at zero.
    pub(crate) rods: Vec<Rod<T>>,
    /// Bodies between the cluster's parent body and the rods that stand still while the unknowns
    /// change, and those that move.
    pub(crate) before: Vec<usize>,
    pub(crate) moving: Vec<usize>,
    /// Turning joints of both kinds and of the rods: indices of cosine and sine, and coordinate.
    pub(crate) given: Vec<(usize, usize)>,
    pub(crate) turned: Vec<(usize, usize)>,
    pub(crate) found: Vec<(usize, usize)>,
    /// Sign of the determinant at the zero pose.
    pub(crate) sign: f64,
    /// Steps from a seed.
    pub(crate) steps: usize,
    /// Squares of the columns' norms if the rods were along the velocities of their ends.
    pub(crate) sizes: Vec<f64>,
}

constants! { Rods:
    keep unknowns before moving given turned found sign steps sizes;
    each rods;
}

/// A rod between two bodies.
#[derive(Clone, Debug)]
pub(crate) struct Rod<T> {
    /// The universal joint on the carrier, with its velocities.
    pub(crate) universal: Universal<T>,
    pub(crate) turns: [usize; 2],
    /// The body that carries it and the one with the ball; P and S in these.
    pub(crate) bodies: [usize; 2],
    pub(crate) center: Vector3<T>,
    pub(crate) ball: Vector3<T>,
    /// 1 / ℓ.
    pub(crate) inverse_length: T,
    /// Freedoms that move one body against the other.
    pub(crate) path: Vec<Mover>,
}

constants! { Rod:
    keep turns bodies path;
    number inverse_length;
    map universal center ball;
}

/// A joint on the way from one end of a rod to the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mover {
    pub(crate) joint: usize,
    /// It moves the ball, not the universal joint.
    pub(crate) of_ball: bool,
    /// Its number among the unknowns, or in y.
    pub(crate) column: Result<usize, usize>,
}

/// Twist of a joint for a unit of its rate.
#[inline(always)]
pub(crate) fn screw<T: Real>(motion: Motion, pose: &Pose<T>) -> Twist<T> {
    let axis = pose.R.col(2);
    if motion == Motion::Prismatic { [zero(), axis] } else { [axis, pose.p.cross(axis)] }
}

/// A rod at a pose {cluster's parent body}: S, and d.
struct At<T> {
    ball: Vector3<T>,
    d: Vector3<T>,
}

impl<T: Real> Rod<T> {
    #[inline(always)]
    fn at(&self, pose: &[Pose<T>]) -> At<T> {
        let ball = pose[self.bodies[1]].point(&self.ball);
        At { ball, d: ball - pose[self.bodies[0]].point(&self.center) }
    }

    /// φ.
    #[inline(always)]
    fn residual(&self, at: &At<T>) -> T {
        let square = at.d.dot(at.d) - self.universal.length_square;
        square * (T::from_f64(0.5) * self.inverse_length)
    }

    /// ḋ, and d̈ at q̈ = 0.
    #[inline(always)]
    fn moved(&self, at: &At<T>, pose: &[Pose<T>], rate: &[Rate<T>]) -> [Vector3<T>; 2] {
        let of = |body: usize, point: Vector3<T>| {
            let x = &rate[body];
            let r = point - pose[body].p;
            (x.v.add_cross(x.w, r), x.acceleration(r))
        };
        let (v_ball, a_ball) = of(self.bodies[1], at.ball);
        let (v_center, a_center) = of(self.bodies[0], at.ball - at.d);
        [v_ball - v_center, a_ball - a_center]
    }
}

impl<T> Rods<T> {
    /// Takes most steps; false where it does so already.
    pub(crate) fn lengthen(&mut self) -> bool {
        core::mem::replace(&mut self.steps, MOST_STEPS) < MOST_STEPS
    }
}

impl<T: Real> Rods<T> {
    /// The position, velocity and acceleration level from the unknowns in `local.q`.
    #[inline(never)]
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        match self.unknowns.len() {
            6 if T::UNROLLED => self.close_for::<6>(local, level),
            2 if T::UNROLLED => self.close_for::<2>(local, level),
            _ => self.close_for::<0>(local, level),
        }
    }

    /// For M unknowns, or for any number of them.
    fn close_for<const M: usize>(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        self.place_all(local);
        let (mut good, gain) = self.newton::<M>(local);
        if level > Level::Position {
            good &= level < Level::Acceleration || accurate(T::ONE, gain);
            self.jacobian::<M>(local, level);
        }
        if level >= Level::Acceleration {
            self.bias::<M>(local);
        }
        if level > Level::Position {
            self.displace(local, level);
        }
        Validity { singular: !good, gain, ..Validity::fine() }.then(self.turn(local, level))
    }

    /// The turns of the rods where the unknowns in `local.q` have them, which need not hold the
    /// distances.
    pub(crate) fn complete(&self, local: &mut Local<'_, T>) {
        self.place_all(local);
        self.turn(local, Level::Position);
    }

    /// Poses of the bodies between which rods are.
    fn place_all(&self, local: &mut Local<'_, T>) {
        turn(&self.given, local.q, local.cos_sin);
        local.scratch.pose[0] = Pose::identity();
        place_some(&self.before, local);
        turn(&self.turned, local.q, local.cos_sin);
        place_some(&self.moving, local);
    }

    /// The turns of the rods at these poses, and their rates.
    #[inline(always)]
    fn turn(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let mut validity = Validity::fine();
        for rod in &self.rods {
            validity = validity.or(rod.turn(local, level));
        }
        read_turns(&self.found, local.cos_sin, local.q);
        validity
    }

    #[inline(always)]
    fn width<const M: usize>(&self) -> usize {
        if M == 0 { self.unknowns.len() } else { M }
    }

    /// The unknowns, and the poses where these are; whether the steps pass the rule of
    /// [`super::newton`], and 1/sin² of the angle that vanishes at a singular pose.
    #[inline(always)]
    fn newton<const M: usize>(&self, local: &mut Local<'_, T>) -> (bool, T) {
        let cluster = local.cluster;
        let m = self.width::<M>();
        let unit = T::from_f64(1.0 / cluster.length);
        let mut good = true;
        let mut gain = T::ONE;
        let mut sizes = [T::ZERO; MOST_STEPS];
        let sizes = &mut sizes[..self.steps];
        for (k, size) in sizes.iter_mut().enumerate() {
            // Δ = A⁻¹ φ, q ← q − Δ
            let is_last = k + 1 == self.steps;
            let Scratch { pose, screw, A, inverse, phi, step, .. } = &mut *local.scratch;
            for (phi, rod) in phi.iter_mut().zip(&self.rods) {
                *phi = rod.residual(&rod.at(pose));
            }
            if is_last {
                self.matrix::<M>(pose, screw, inverse, |_, _, _| ());
                (good, gain) = self.invert::<M>(&mut inverse[..m * m], step);
                (0..m).for_each(|i| step[i] = times(inverse, m, i, phi, T::ZERO));
            } else {
                self.matrix::<M>(pose, screw, A, |_, _, _| ());
                step[..m].copy_from_slice(&phi[..m]);
                (0..m).for_each(|k| eliminate(&mut A[..m * m], &mut step[..m], m, 1, k));
                substitute_back(&A[..m * m], &mut step[..m], m, 1);
            }
            for (dof, step) in self.unknowns[..m].iter().zip(&local.scratch.step) {
                dof.advance(local.q, -*step);
                *size = size.larger(if dof.slides() { step.abs() * unit } else { step.abs() });
            }
            if is_last {
                self.turn_little(local);
            } else {
                turn(&self.turned, local.q, local.cos_sin);
            }
            place_some(&self.moving, local);
        }
        (good & accepts(sizes, gain), gain)
    }

    /// PRECISION: cosines and sines of the unknowns after the last step up to its square, as its
    /// cube is below the roundoff.
    #[inline(always)]
    fn turn_little(&self, local: &mut Local<'_, T>) {
        let half = T::from_f64(0.5);
        for (dof, step) in self.unknowns.iter().zip(&local.scratch.step) {
            if dof.motion == Motion::Revolute {
                let (c, s) = local.cos_sin[dof.body];
                let square = *step * *step * half;
                local.cos_sin[dof.body] = (
                    (-square).mul_add(c, s.mul_add(*step, c)),
                    (-square).mul_add(s, (-c).mul_add(*step, s)),
                );
            }
        }
    }

    /// ∂φ/∂q of the unknowns, row by row; calls `independent(row, place in y, entry)` for the
    /// others.
    #[inline(always)]
    pub(crate) fn matrix<const M: usize>(
        &self,
        pose: &[Pose<T>],
        screw: &[Twist<T>],
        A: &mut [T],
        mut independent: impl FnMut(usize, usize, T),
    ) {
        let m = self.width::<M>();
        A[..m * m].fill(T::ZERO);
        for (i, rod) in self.rods[..m].iter().enumerate() {
            let at = rod.at(pose);
            let along = at.d * rod.inverse_length;
            let moment = at.ball.cross(along);
            for mover in &rod.path {
                let [turn, velocity] = screw[mover.joint];
                let x = moment.dot(turn) + along.dot(velocity);
                let x = if mover.of_ball { x } else { -x };
                match mover.column {
                    Ok(column) => A[i * m + column] = x,
                    Err(k) => independent(i, k, x),
                }
            }
        }
    }

    /// The inverse of A in its place, by elimination in the order of the pivots at zero; whether no
    /// pivot was small and the determinant has the sign of the zero pose, and 1/sin² of the least
    /// angle between a column and the span of the others.
    #[inline(always)]
    fn invert<const M: usize>(&self, A: &mut [T], squares: &mut [T]) -> (bool, T) {
        let m = self.width::<M>();
        (0..m).for_each(|k| squares[k] = column_square(A, m, m, k));
        let mut sound = true;
        let mut det = T::from_f64(self.sign);
        for k in 0..m {
            let pivot = A[k * m + k];
            sound &= T::from_f64(PIVOT * PIVOT * self.sizes[k]).lt(pivot * pivot);
            det *= pivot;
            let inverse = T::ONE / pivot;
            A[k * m + k] = T::ONE;
            (0..m).for_each(|j| A[k * m + j] *= inverse);
            for i in (0..m).filter(|i| *i != k) {
                let l = -A[i * m + k];
                A[i * m + k] = T::ZERO;
                for j in 0..m {
                    A[i * m + j] = l.mul_add(A[k * m + j], A[i * m + j]);
                }
            }
        }
        let [_, gain] = inverse_square_sines(A, squares, &self.sizes, m);
        (sound & T::ZERO.lt(det), gain)
    }

    /// −A⁻¹ φ of the scratch, into its steps. PRECISION: one step of refinement squares the
    /// distance of the inverse, which is that before the last step and of an elimination without
    /// exchanges.
    #[inline(always)]
    fn solve<const M: usize>(&self, scratch: &mut Scratch<T>) {
        let m = self.width::<M>();
        let Scratch { A, inverse, phi, step, .. } = scratch;
        let phi = &mut phi[..m];
        let step = &mut step[..m];
        (0..m).for_each(|i| step[i] = -times(inverse, m, i, phi, T::ZERO));
        (0..m).for_each(|i| phi[i] = times(A, m, i, step, phi[i]));
        (0..m).for_each(|i| step[i] -= times(inverse, m, i, phi, T::ZERO));
    }

    /// G of the unknowns, and their rates.
    #[inline(always)]
    fn jacobian<const M: usize>(&self, local: &mut Local<'_, T>, level: Level) {
        let cluster = local.cluster;
        let m = self.width::<M>();
        let n = cluster.n_vy;
        let Scratch { pose, screw, A, B, .. } = &mut *local.scratch;
        B[..m * n].fill(T::ZERO);
        self.matrix::<M>(pose, screw, A, |i, k, x| B[i * n + k] = x);
        for (k, &j) in cluster.independent.iter().enumerate() {
            local.G[j * n..(j + 1) * n].fill(T::ZERO);
            local.G[j * n + k] = T::ONE;
            local.g[j] = T::ZERO;
            let scratch = &mut *local.scratch;
            (0..m).for_each(|i| scratch.phi[i] = scratch.B[i * n + k]);
            self.solve::<M>(scratch);
            for (dof, x) in self.unknowns[..m].iter().zip(&scratch.step) {
                local.G[dof.v * n + k] = *x;
            }
        }
        if level < Level::Velocity {
            return;
        }
        for dof in &self.unknowns[..m] {
            let rates = local.G[dof.v * n..(dof.v + 1) * n].iter().zip(&cluster.independent);
            local.qd[dof.v] = rates.fold(T::ZERO, |sum, (x, i)| x.mul_add(local.qd[*i], sum));
        }
    }

    /// g of the unknowns.
    #[inline(always)]
    fn bias<const M: usize>(&self, local: &mut Local<'_, T>) {
        let &mut Local { cluster, bodies, .. } = local;
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        scratch.rate[0] = Rate::at_rest();
        for &j in self.before.iter().chain(&self.moving) {
            rate_of(cluster, bodies, j, local.qd, &scratch.pose, &mut scratch.rate);
        }
        for (i, rod) in self.rods[..m].iter().enumerate() {
            let at = rod.at(&scratch.pose);
            let [v, a] = rod.moved(&at, &scratch.pose, &scratch.rate);
            scratch.phi[i] = (at.d.dot(a) + v.dot(v)) * rod.inverse_length;
        }
        self.solve::<M>(scratch);
        for (dof, x) in self.unknowns[..m].iter().zip(&scratch.step) {
            local.g[dof.v] = *x;
        }
    }

    /// Twists of the bodies for each independent, then for q̈ = g.
    #[inline(always)]
    fn displace(&self, local: &mut Local<'_, T>, level: Level) {
        let cluster = local.cluster;
        let n = cluster.n_vy;
        let Scratch { screw, twist, .. } = &mut *local.scratch;
        for &j in self.before.iter().chain(&self.moving) {
            let mut own = twist[cluster.local_parent[j]];
            let [turn, velocity] = screw[j];
            let mut add = |k: usize, x: T| {
                let [w, v] = own[k];
                own[k] = [w.add_scaled(turn, x), v.add_scaled(velocity, x)];
            };
            (0..n).for_each(|k| add(k, local.G[j * n + k]));
            if level == Level::Acceleration {
                add(MOST, local.g[j]);
            }
            twist[j + 1] = own;
        }
    }
}

/// Row i of a square matrix times x, plus a number.
#[inline(always)]
fn times<T: Real>(matrix: &[T], m: usize, i: usize, x: &[T], start: T) -> T {
    let mut sum = start;
    for (a, x) in matrix[i * m..(i + 1) * m].iter().zip(x) {
        sum = a.mul_add(*x, sum);
    }
    sum
}

/// The rule of [`super::newton`] for steps of these sizes; besides, the error after the last,
/// s_k³ / s_{k−1}², is below a sixteenth of the roundoff or the step itself roundoff, and an
/// inverse before it is half as accurate as one after it, at least.
#[inline(always)]
fn accepts<T: Real>(sizes: &[T], gain: T) -> bool {
    let [first, before, last] = [0, sizes.len() - 2, sizes.len() - 1].map(|k| sizes[k]);
    let rounding = T::from_f64(ROUNDINGS * T::EPSILON);
    let sixteenth = T::from_f64(T::EPSILON / 16.0);
    let left = (before * before * sixteenth).larger(rounding * rounding * rounding);
    let contracts = |[a, b]: [T; 2]| b.lt((a * T::from_f64(CONTRACTION)).larger(rounding));
    first.lt(T::from_f64(TRUST))
        & (first * first * gain).lt(T::from_f64(CAUTION * CAUTION))
        & contracts([first, sizes[1]])
        & contracts([before, last])
        & last.lt(T::from_f64(T::EPSILON.cbrt()))
        & (last * last * gain).lt(T::from_f64(T::EPSILON))
        & (last * last * last).lt(left)
}

/// Poses and screws of these joints' bodies.
#[inline(always)]
fn place_some<T: Real>(joints: &[usize], local: &mut Local<'_, T>) {
    let &mut Local { cluster, bodies, .. } = local;
    for &j in joints {
        place(cluster, bodies, j, local.q, local.cos_sin, &mut local.scratch.pose);
        local.scratch.screw[j] = screw(bodies[j].motion, &local.scratch.pose[j + 1]);
    }
}

impl<T: Real> Rod<T> {
    /// Cosines, sines and rates of its two turns, at the poses and rates of the other joints.
    #[inline(always)]
    fn turn(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let cluster = local.cluster;
        let n = cluster.n_vy;
        let at = self.at(&local.scratch.pose);
        let carrier = local.scratch.pose[self.bodies[0]].R;
        let (rod, validity) = self.universal.reach(&carrier, at.d, local);
        if level == Level::Position {
            return validity;
        }
        // velocity of the ball against the carrier for each independent, and by g
        let [of_carrier, of_ball] = self.bodies;
        let twist = &local.scratch.twist;
        let apart = |k: usize| {
            let [[w, v], [w_ball, v_ball]] = [twist[of_carrier][k], twist[of_ball][k]];
            (v_ball - v).add_cross(w_ball - w, at.ball)
        };
        // the second turn first: those of a hinge are one
        let [first, second] = self.turns;
        let mut rates = [T::ZERO; 2];
        for k in 0..n {
            let of_turns = rod.solve(&apart(k));
            local.G[second * n + k] = of_turns[1];
            local.G[first * n + k] = of_turns[0];
            let qd = local.qd[cluster.independent[k]];
            rates = [0, 1].map(|i| of_turns[i].mul_add(qd, rates[i]));
        }
        if level == Level::Jacobian {
            return validity;
        }
        let set = |to: &mut [T], x: [T; 2]| (to[second], to[first]) = (x[1], x[0]);
        set(local.qd, rates);
        if level == Level::Acceleration {
            let scratch = &*local.scratch;
            let Rate { w, alpha, .. } = scratch.rate[self.bodies[0]];
            let [_, a] = self.moved(&at, &scratch.pose, &scratch.rate);
            set(local.g, rod.solve(&(a + apart(MOST) - rod.acceleration(w, alpha, rates))));
        }
        validity
    }
}
