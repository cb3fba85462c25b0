//! Second and third derivatives of a closure by its implicit form, contracted with rates or forces.
//!
//! A row of K is a wrench w_r at the cut, fixed to the predecessor's axes and to the successor's
//! point: K_rj = ± w_r · s_j for the joint motions s_j on the path. Along a motion of the cluster
//! both move, and K G = 0 stays:
//!
//! ```text
//!   K Ġ = −K̇ G      K G̈ = −K̈ G − 2 K̇ Ġ      K_dᵀ λ = τ_d      W = −Gᵀ (∂ Kᵀλ/∂q) G
//! ```
//! With ẏ and ÿ constant numbers, ∂q̇/∂y = Ġ and ∂q̈/∂y = G̈ for joints of one freedom; W_jk is
//! Σ τ_i ∂²γ_i/∂y_j∂y_k.
//! Nothing here depends on how the closure was found; the one factor is K_d⁻¹.

use nalgebra::{Matrix3, Vector3};

use crate::closure::constraint::rows::{Angular, CutState, base, place};
use crate::closure::constraint::so3_log::{log_factors, second_factor};
use crate::linalg::invert;
use crate::mechanism::{Body, Cluster, Cut, CutRow, Dof};
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose, Spatial, total, zero};

/// A vector and its first and second time derivative.
type Rates<T> = [<T as Real>::Triple; 3];

/// Scratch for the derivatives of one cluster, in the axes of its parent body.
#[derive(Clone, Debug)]
pub(crate) struct Second<T: Real> {
    pose: Vec<Pose<T>>,
    /// Velocity and acceleration of each local body; 0 stands still (n + 1).
    motion: Vec<[Spatial<T>; 2]>,
    /// s, ṡ, s̈ of each local velocity (n_v).
    s: Vec<[Spatial<T>; 3]>,
    /// Displacement of each local body by each independent ((n + 1) × n_vy).
    moved: Vec<Spatial<T>>,
    /// K, K̇ and K̈ of the used rows (each × n_v), and K_d⁻¹.
    K: [Vec<T>; 3],
    inverse: Vec<T>,
    /// Right-hand sides; λ; wrench of the loops on each joint (n_v).
    B: Vec<T>,
    lambda: Vec<T>,
    load: Vec<Spatial<T>>,
}

impl<T: Real> Second<T> {
    /// For clusters up to these. Allocates.
    pub(crate) fn new<'a>(clusters: impl Iterator<Item = &'a Cluster<T>> + Clone) -> Second<T> {
        let most = |of: fn(&Cluster<T>) -> usize| clusters.clone().map(of).max().unwrap_or(0);
        let n = most(|c| c.n) + 1;
        let n_v = most(|c| c.n_v);
        let rows = most(|c| c.used.len());
        let widest = most(|c| c.n_vy);
        let zeros = |n: usize| vec![T::ZERO; n];
        let none = Spatial::zero();
        Second {
            pose: vec![Pose::identity(); n],
            motion: vec![[none; 2]; n],
            s: vec![[none; 3]; n_v],
            moved: vec![none; n * widest],
            K: [zeros(rows * n_v), zeros(rows * n_v), zeros(rows * n_v)],
            inverse: zeros(rows * rows),
            B: zeros(rows * rows.max(widest)),
            lambda: zeros(rows),
            load: vec![none; n_v],
        }
    }

    /// Motions, K with its rates and K_d⁻¹ of a closed cluster that moves with q̇ and q̈; false
    /// where K_d is singular.
    pub(crate) fn at(
        &mut self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        (q, cos_sin): (&[T], &[(T, T)]),
        (qd, qdd): (&[T], &[T]),
    ) -> bool {
        for (j, body) in bodies.iter().enumerate() {
            place(cluster, bodies, j, q, cos_sin, &mut self.pose);
            let [mut V, mut A] = self.motion[cluster.local_parent[j]];
            let pose = &self.pose[j + 1];
            let p = T::Triple::of(&pose.p);
            let first = body.v - cluster.v;
            let own = first..first + body.motion.n_v();
            for v in own.clone() {
                let dof = &cluster.dofs[v];
                let s = Spatial::joint(T::Triple::of(&dof.axis(&pose.R)), p, dof.slides());
                self.s[v][0] = s;
                V = V.add_scaled(s, qd[v]);
            }
            for v in own.clone() {
                let s = self.s[v][0];
                self.s[v][1] = V.cross(s);
                A = A.add_scaled(s, qdd[v]).add_scaled(self.s[v][1], qd[v]);
            }
            for v in own {
                let [s, sd, _] = self.s[v];
                self.s[v][2] = A.cross(s).plus(V.cross(sd));
            }
            self.motion[j + 1] = [V, A];
        }
        self.rows(cluster, q, qd, qdd);

        let n_v = cluster.n_v;
        let m = cluster.dependent.len();
        for i in 0..m {
            for (a, j) in cluster.dependent.iter().enumerate() {
                self.B[i * m + a] = self.K[0][i * n_v + j];
            }
        }
        invert(&mut self.B, &mut self.inverse, m)
    }

    /// K, K̇ and K̈.
    fn rows(&mut self, cluster: &Cluster<T>, q: &[T], qd: &[T], qdd: &[T]) {
        let n_v = cluster.n_v;
        let [K, K_dot, K_ddot] = &mut self.K;
        K[..cluster.used.len() * n_v].fill(T::ZERO);
        let none = T::Triple::zero();
        let mut r = 0;
        for cut in &cluster.cuts {
            let state = CutState::of_forces(cut, &self.pose);
            let p = &self.motion[cut.predecessor];
            let s = &self.motion[cut.successor];
            for row in &cut.rows {
                r += 1;
                let Some(i) = cluster.used.iter().position(|used| *used == r - 1) else { continue };
                for (j, c) in &row.terms {
                    K[i * n_v + j] = *c;
                }
                if !row.terms.is_empty() {
                    cut.path.iter().for_each(|(j, _)| {
                        (K_dot[i * n_v + j], K_ddot[i * n_v + j]) = (T::ZERO, T::ZERO)
                    });
                    for curve in &row.curves {
                        let [at, v] = [i * n_v + curve.of.v, curve.of.v];
                        let [_, f1, f2, f3] = curve.at(q[curve.of.q]);
                        K[at] -= f1;
                        K_dot[at] -= f2 * qd[v];
                        K_ddot[at] -= f3.mul_add(qd[v] * qd[v], f2 * qdd[v]);
                    }
                    continue;
                }
                let [w, wd, wdd] = wrench(cut, row, &state, p, s);
                for &(j, on_successor) in &cut.path {
                    let at = i * n_v + j;
                    let [s, sd, sdd] = self.s[j];
                    let sign = if on_successor { T::ONE } else { -T::ONE };
                    K[at] = sign * w.dot(s);
                    K_dot[at] = sign * total(wd.along(s, w.along(sd, none)));
                    let twice = wd.plus(wd);
                    let second = wdd.along(s, twice.along(sd, w.along(sdd, none)));
                    K_ddot[at] = sign * total(second);
                }
            }
        }
    }

    /// Ġ, ∂q̇/∂y and ∂q̈/∂y (n_v × n_vy each) of the cluster and motion of [`Second::at`].
    pub(crate) fn rates(
        &mut self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        (qd, qdd): (&[T], &[T]),
        G: &[T],
        [Gd, H1, H2]: [&mut [T]; 3],
    ) {
        Gd.fill(T::ZERO);
        self.solve(cluster, &[(1, T::ONE, G)], Gd);
        H2.fill(T::ZERO);
        self.solve(cluster, &[(2, T::ONE, G), (1, T::from_f64(2.0), Gd)], H2);
        H1.copy_from_slice(Gd);
        if cluster.n_q > cluster.n_v {
            turn_freely(cluster, bodies, (qd, qdd), G, [Gd, H1, H2]);
        }
    }

    /// The dependents' rows of X with K X = −Σ s K⁽ⁿ⁾ Y over the terms (n, s, Y).
    fn solve(&mut self, cluster: &Cluster<T>, terms: &[(usize, T, &[T])], X: &mut [T]) {
        let m = cluster.n_vy;
        let n_v = cluster.n_v;
        let rows = cluster.used.len();
        let B = &mut self.B[..rows * m];
        B.fill(T::ZERO);
        let mut r = 0;
        for cut in &cluster.cuts {
            for _ in &cut.rows {
                r += 1;
                let Some(i) = cluster.used.iter().position(|used| *used == r - 1) else { continue };
                let b = &mut B[i * m..(i + 1) * m];
                for &(order, scale, Y) in terms {
                    for &(j, _) in &cut.path {
                        let k = -(self.K[order][i * n_v + j] * scale);
                        let row = &Y[j * m..(j + 1) * m];
                        b.iter_mut().zip(row).for_each(|(b, y)| *b = k.mul_add(*y, *b));
                    }
                }
            }
        }
        for (a, j) in cluster.dependent.iter().enumerate() {
            let row = &mut X[j * m..(j + 1) * m];
            for (i, x) in self.inverse[a * rows..(a + 1) * rows].iter().enumerate() {
                if T::UNROLLED && *x == T::ZERO {
                    continue;
                }
                let b = &B[i * m..(i + 1) * m];
                row.iter_mut().zip(b).for_each(|(y, b)| *y = x.mul_add(*b, *y));
            }
        }
    }

    /// ∂q/∂θ of the dependents at fixed y (dependents × [`Cluster::n_geometry`]) of the cluster of
    /// [`Second::at`]: K_d X = −∂φ/∂θ with the columns of joints of six freedoms at the origin of
    /// each joint, with the axes that `axes` gives from those of its body, and at the frames of
    /// each cut.
    pub(crate) fn by_geometry(
        &self,
        cluster: &Cluster<T>,
        bodies: &[Body<T>],
        axes: impl Fn(usize) -> Matrix3<T>,
        X: &mut [T],
    ) {
        let width = cluster.n_geometry();
        let m = cluster.dependent.len();
        X[..m * width].fill(T::ZERO);
        let still = [Spatial::zero(); 2];
        let mut first = 0;
        for (c, cut) in cluster.cuts.iter().enumerate() {
            let state = CutState::of_forces(cut, &self.pose);
            for (r, row) in (first..).zip(&cut.rows) {
                let used = cluster.used.iter().position(|used| *used == r);
                let Some(i) = used.filter(|_| row.terms.is_empty()) else { continue };
                let [w, ..] = wrench(cut, row, &state, &still, &still);
                let mut add = |place: usize, at: &Pose<T>, on_successor: bool| {
                    let p = T::Triple::of(&at.p);
                    for k in 0..6 {
                        let along =
                            w.dot(Spatial::joint(T::Triple::of(&at.R.col(k % 3)), p, k >= 3));
                        let minus = if on_successor { -along } else { along };
                        for a in 0..m {
                            let x = &mut X[a * width + 6 * place + k];
                            *x = self.inverse[a * m + i].mul_add(minus, *x);
                        }
                    }
                };
                for &(j, on_successor) in &cut.path {
                    let Dof { body, k: 0, .. } = cluster.dofs[j] else { continue };
                    let at = base(cluster, bodies, body, &self.pose);
                    add(body, &Pose { R: at.R.times(axes(body)), p: at.p }, on_successor);
                }
                let end = cluster.n + 2 * c;
                add(end, &self.pose[cut.predecessor].then(&cut.x_p_cut), false);
                add(end + 1, &self.pose[cut.successor].then(&cut.x_s_cut), true);
            }
            first += cut.rows.len();
        }
    }

    /// W (n_vy × n_vy) of forces on the tree velocities, after [`Second::at`].
    pub(crate) fn curvature(
        &mut self,
        cluster: &Cluster<T>,
        (q, G): (&[T], &[T]),
        tau: &[T],
        W: &mut [T],
    ) {
        let m = cluster.n_vy;
        let rows = cluster.used.len();
        W.fill(T::ZERO);
        let lambda = &mut self.lambda[..rows];
        lambda.fill(T::ZERO);
        for (a, j) in cluster.dependent.iter().enumerate() {
            for (i, x) in self.inverse[a * rows..(a + 1) * rows].iter().enumerate() {
                lambda[i] = x.mul_add(tau[*j], lambda[i]);
            }
        }
        self.displace(cluster, G);
        self.load[..cluster.n_v].fill(Spatial::zero());
        let mut first = 0;
        for cut in &cluster.cuts {
            let whole = self.of_cut(cut, (&cluster.used, first), (q, G), m, W);
            first += cut.rows.len();
            for &(j, on_successor) in &cut.path {
                let sign = if on_successor { T::ONE } else { -T::ONE };
                self.load[j] = self.load[j].add_scaled(whole, sign);
            }
        }
        // and the turns of the joints' motions
        for (v, dof) in cluster.dofs.iter().enumerate() {
            let turned = self.s[v][0].cross_force(self.load[v]);
            let body = (dof.body + 1) * m;
            let G = &G[v * m..(v + 1) * m];
            for (j, moved) in self.moved[body..body + m].iter().enumerate() {
                let x = -moved.dot(turned);
                for (w, g) in W[j * m..(j + 1) * m].iter_mut().zip(G) {
                    *w = x.mul_add(*g, *w);
                }
            }
        }
    }

    /// The wrench of a cut with the local rows from `first` on; adds its own turns to W.
    fn of_cut(
        &self,
        cut: &Cut<T>,
        (used, first): (&[usize], usize),
        (q, G): (&[T], &[T]),
        m: usize,
        W: &mut [T],
    ) -> Spatial<T> {
        let state = CutState::of_forces(cut, &self.pose);
        let none = [Spatial::zero(); 2];
        let displaced = |j: usize| {
            [cut.predecessor, cut.successor].map(|body| [self.moved[body * m + j], Spatial::zero()])
        };
        // the straight rows together, the bent ones one by one
        let mut force = zero();
        let mut moment = zero();
        let mut whole = Spatial::zero();
        for (r, row) in (first..).zip(&cut.rows) {
            let Some(i) = used.iter().position(|used| *used == r) else { continue };
            let lambda = self.lambda[i];
            if !row.terms.is_empty() {
                for curve in &row.curves {
                    let G = &G[curve.of.v * m..][..m];
                    let second = lambda * curve.at(q[curve.of.q])[2];
                    for (k, w) in W[..m * m].iter_mut().enumerate() {
                        *w = second.mul_add(G[k / m] * G[k % m], *w);
                    }
                }
                continue;
            }
            if is_bent(cut, row) {
                let [w, ..] = wrench(cut, row, &state, &none, &none);
                whole = whole.add_scaled(w, lambda);
                for j in 0..m {
                    let [p, s] = displaced(j);
                    let [_, turned, _] = wrench(cut, row, &state, &p, &s);
                    self.meet(cut, turned, lambda, j, m, W);
                }
            } else {
                force = force.add_scaled(state.R_p.apply(row.linear_p), lambda);
                if let Some(of) = &state.angular {
                    moment = moment.add_scaled(of.R_P.apply(row.angular), lambda);
                }
            }
        }
        let force = T::Triple::of(&force);
        let moment = T::Triple::of(&moment);
        let point = T::Triple::of(&state.point);
        let straight = |p: &[Spatial<T>; 2], s: &[Spatial<T>; 2]| {
            with_linear(turning(force, p), passing(point, s), turning(moment, p))
        };
        for j in 0..m {
            let [p, s] = displaced(j);
            let [_, turned, _] = straight(&p, &s);
            self.meet(cut, turned, T::ONE, j, m, W);
        }
        let [w, ..] = straight(&none, &none);
        whole.plus(w)
    }

    /// Displacement of each body by each independent.
    fn displace(&mut self, cluster: &Cluster<T>, G: &[T]) {
        let m = cluster.n_vy;
        self.moved[..m].fill(Spatial::zero());
        let mut v = 0;
        for j in 0..cluster.n {
            let parent = cluster.local_parent[j];
            self.moved.copy_within(parent * m..(parent + 1) * m, (j + 1) * m);
            while v < cluster.n_v && cluster.dofs[v].body == j {
                let s = self.s[v][0];
                let own = &mut self.moved[(j + 1) * m..(j + 2) * m];
                for (moved, g) in own.iter_mut().zip(&G[v * m..(v + 1) * m]) {
                    *moved = moved.add_scaled(s, *g);
                }
                v += 1;
            }
        }
    }

    /// W_jk −= λ w · (D_S − D_P)_k.
    #[inline(always)]
    fn meet(&self, cut: &Cut<T>, w: Spatial<T>, lambda: T, j: usize, m: usize, W: &mut [T]) {
        for k in 0..m {
            let apart =
                self.moved[cut.successor * m + k].minus(self.moved[cut.predecessor * m + k]);
            W[j * m + k] = (-lambda).mul_add(apart.dot(w), W[j * m + k]);
        }
    }
}

/// True where a row's angular part is no vector that stands still in the predecessor.
fn is_bent<T: Real>(cut: &Cut<T>, row: &CutRow<T>) -> bool {
    cut.angular && (row.against.is_some() || !cut.on_line)
}

/// The wrench of a row and its rates, from the velocities and accelerations of P and S.
#[inline(always)]
fn wrench<T: Real>(
    cut: &Cut<T>,
    row: &CutRow<T>,
    state: &CutState<'_, T>,
    p: &[Spatial<T>; 2],
    s: &[Spatial<T>; 2],
) -> [Spatial<T>; 3] {
    let none = [T::Triple::zero(); 3];
    let angular = match (&state.angular, &row.against) {
        (None, _) => none,
        (Some(of), Some(b)) => {
            let b = turning(T::Triple::of(&of.R_S.apply(*b)), s);
            let a = turning(T::Triple::of(&of.R_P.apply(row.angular)), p);
            return product::<T>(b, a).map(|a| Spatial { a, l: T::Triple::zero() });
        }
        (Some(of), None) if cut.on_line => turning(T::Triple::of(&of.R_P.apply(row.angular)), p),
        (Some(of), None) => of_log(of, &row.angular, p, s),
    };
    let linear = turning(T::Triple::of(&state.R_p.apply(row.linear_p)), p);
    with_linear(linear, passing(T::Triple::of(&state.point), s), angular)
}

/// Force and couple at a point, as a wrench at the origin.
#[inline(always)]
fn with_linear<T: Real>(l: Rates<T>, x: Rates<T>, couple: Rates<T>) -> [Spatial<T>; 3] {
    let moment = product::<T>(x, l);
    [0, 1, 2].map(|k| Spatial { a: moment[k] + couple[k], l: l[k] })
}

/// a × b.
#[inline(always)]
fn product<T: Real>(a: Rates<T>, b: Rates<T>) -> Rates<T> {
    let twice = a[1] + a[1];
    [
        a[0].cross(b[0]),
        a[1].cross(b[0]).add_cross(a[0], b[1]),
        a[2].cross(b[0]).add_cross(twice, b[1]).add_cross(a[0], b[2]),
    ]
}

/// A vector that turns with a body.
#[inline(always)]
fn turning<T: Real>(x: T::Triple, [V, A]: &[Spatial<T>; 2]) -> Rates<T> {
    let rate = V.a.cross(x);
    [x, rate, A.a.cross(x).add_cross(V.a, rate)]
}

/// A point that moves with a body.
#[inline(always)]
fn passing<T: Real>(x: T::Triple, [V, A]: &[Spatial<T>; 2]) -> Rates<T> {
    let rate = V.at(x);
    [x, rate, A.at(x).add_cross(V.a, rate)]
}

/// R_P Aᵀ a, the axis of a row of θ.
#[inline(never)]
fn of_log<T: Real>(
    of: &Angular<T>,
    a: &Vector3<T>,
    p: &[Spatial<T>; 2],
    s: &[Spatial<T>; 2],
) -> Rates<T> {
    let two = T::from_f64(2.0);
    let half = T::from_f64(0.5);
    let in_p = |x: T::Triple| of.R_P.apply_transposed(x.vector());
    let x = of.theta;
    let factors = log_factors(&x);
    let (c, dc) = factors;
    // θ̇ = A ω, θ̈ = A ω̇ + Ȧ ω
    let w = in_p(s[0].a - p[0].a);
    let wd = in_p(s[1].a - p[1].a - p[0].a.cross(s[0].a));
    let xd = of.A.apply(w);
    let cd = dc * two * x.dot(xd);
    let xw = x.cross(w);
    let turned = xd.cross(xw) + x.cross(xd.cross(w));
    let xdd = of.A.apply(wd) + xd.cross(w) * -half + (turned * c).add_scaled(x.cross(xw), cd);
    let rate = two * x.dot(xd);
    let cdd = second_factor(&x, factors).mul_add(rate * rate, dc * two * (xd.dot(xd) + x.dot(xdd)));
    // a + ½ θ × a + c θ × (θ × a)
    let [e, ed, edd] = [x, xd, xdd].map(|x| x.cross(*a));
    let f = x.cross(e);
    let fd = xd.cross(e) + x.cross(ed);
    let fdd = xdd.cross(e) + xd.cross(ed) * two + x.cross(edd);
    let axis = a.add_scaled(e, half).add_scaled(f, c);
    let first = (ed * half).add_scaled(f, cd).add_scaled(fd, c);
    let second = (edd * half).add_scaled(f, cdd).add_scaled(fd, two * cd).add_scaled(fdd, c);
    let [axis, first, second] = [axis, first, second].map(|x| T::Triple::of(&of.R_P.apply(x)));
    let [x, xd, xdd] = turning(axis, p);
    [x, xd + first, xdd + second + (p[0].a.cross(first) + p[0].a.cross(first))]
}

/// Joints of several freedoms: their ẏ is no rate of numbers. A displacement η of one that stands
/// still in its own axes changes as η̇ = −q̇ × η, and changes its velocity by ξ̇ + q̇ × ξ. On entry
/// H1 and H2 are Ġ and G̈.
#[inline(never)]
fn turn_freely<T: Real>(
    cluster: &Cluster<T>,
    bodies: &[Body<T>],
    (qd, qdd): (&[T], &[T]),
    G: &[T],
    [Gd, H1, H2]: [&mut [T]; 3],
) {
    let m = cluster.n_vy;
    let free = || bodies.iter().filter(|body| body.motion.n_v() > 1);
    let two = T::from_f64(2.0);
    for body in free() {
        let n = body.motion.n_v();
        let first = body.v - cluster.v;
        let Some(y) = cluster.independent.iter().position(|v| *v == first) else { continue };
        let [w, wd] = [qd, qdd].map(|x| &x[first..first + n]);
        for b in 0..n {
            let mut e = [T::ZERO; 6];
            e[b] = -T::ONE;
            let eta = cross(w, &e[..n]);
            let minus = eta.map(|x| -x);
            let of_rate = cross(w, &minus[..n]);
            let of_acceleration = cross(wd, &e[..n]);
            for v in 0..cluster.n_v {
                for a in 0..n {
                    let g = G[v * m + y + a];
                    let at = v * m + y + b;
                    H1[at] = g.mul_add(eta[a], H1[at]);
                    let second = of_acceleration[a] + of_rate[a];
                    let of_Gd = two * Gd[v * m + y + a] * eta[a];
                    H2[at] += g.mul_add(second, of_Gd);
                }
            }
        }
    }
    for body in free() {
        let n = body.motion.n_v();
        let first = body.v - cluster.v;
        let [w, wd] = [qd, qdd].map(|x| &x[first..first + n]);
        for j in 0..m {
            let column = |x: &[T]| -> [T; 6] {
                let of = |a: usize| if a < n { x[(first + a) * m + j] } else { T::ZERO };
                [0, 1, 2, 3, 4, 5].map(of)
            };
            let moved = column(G);
            let rate = column(H1);
            let turned = cross(w, &moved[..n]);
            let [of_moved, of_rate] = [cross(wd, &moved[..n]), cross(w, &rate[..n])];
            for a in 0..n {
                H1[(first + a) * m + j] += turned[a];
                H2[(first + a) * m + j] += of_moved[a] + of_rate[a];
            }
        }
    }
}

/// x × y of the numbers of a ball joint (3) or of a floating one (6).
fn cross<T: Real>(x: &[T], y: &[T]) -> [T; 6] {
    let part = |x: &[T], k: usize| Vector3::new(x[k], x[k + 1], x[k + 2]);
    let a = part(x, 0).cross(part(y, 0));
    let l = match x.len() {
        6 => part(x, 0).cross(part(y, 3)) + part(x, 3).cross(part(y, 0)),
        _ => zero(),
    };
    [a[0], a[1], a[2], l[0], l[1], l[2]]
}
