//! Articulated bodies: accelerations from forces in O(n) on a tree (Featherstone 2008, section 7.3).
//!
//! The velocity and gravity terms are taken out first by Newton-Euler at q̈ = 0, so that what is left is M q̈ = τ − C, solved with
//! the articulated inertias alone. An inertia is kept as the blocks of n = J α + H a, f = Hᵀ α + M a.

use nalgebra::{Matrix3, Vector3};

use crate::linear::solve_unpivoted;
use crate::model::{Body, Model, Motion};
use crate::scalar::{Mask, Real};
use crate::spatial::{cross, cross_add, dot, lift, mul, mul_mat, scale_add, t_mul, zero};
use crate::workspace::BodyState;

/// Articulated inertia and bias force of one body, and what its joint needs on the way back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T> {
    J: Matrix3<T>,
    H: Matrix3<T>,
    M: Matrix3<T>,
    n: Vector3<T>,
    f: Vector3<T>,
    /// U = I s (moment, force), 1/D, and τ − s·p of a single freedom.
    U: (Vector3<T>, Vector3<T>),
    inverse_d: T,
    rest: T,
    /// Acceleration: angular, linear.
    alpha: Vector3<T>,
    a: Vector3<T>,
}

impl<T: Real> Articulated<T> {
    pub(crate) fn default() -> Articulated<T> {
        let none = Matrix3::from_element(T::ZERO);
        Articulated {
            J: none,
            H: none,
            M: none,
            n: zero(),
            f: zero(),
            U: (zero(), zero()),
            inverse_d: T::ZERO,
            rest: T::ZERO,
            alpha: zero(),
            a: zero(),
        }
    }
}

/// Solves M q̈ = b on the tree; `b` becomes q̈. Needs the joint poses. The mask tells where every articulated inertia was positive.
pub(crate) fn articulated_solve<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    bodies: &mut [Articulated<T>],
    b: &mut [T],
) -> T::Mask {
    let mut positive = T::Mask::splat(true);
    for (state, body) in bodies.iter_mut().zip(&model.bodies).skip(1) {
        rigid(body, state);
    }

    // inertias and bias forces, towards the root
    for i in (1..model.bodies.len()).rev() {
        let body = &model.bodies[i];
        let mut state = bodies[i];
        if body.motion == Motion::Floating {
            // a free body passes on what its joint transmits and no inertia
            let of = &b[body.v..body.v + 6];
            (state.J, state.H, state.M) = (Matrix3::from_element(T::ZERO), Matrix3::from_element(T::ZERO), Matrix3::from_element(T::ZERO));
            (state.n, state.f) = (Vector3::new(of[0], of[1], of[2]), Vector3::new(of[3], of[4], of[5]));
        } else {
            let turns = body.motion == Motion::Revolute;
            let column = |A: &Matrix3<T>| Vector3::new(A[(0, 2)], A[(1, 2)], A[(2, 2)]);
            let row = |A: &Matrix3<T>| Vector3::new(A[(2, 0)], A[(2, 1)], A[(2, 2)]);
            state.U = if turns { (column(&state.J), row(&state.H)) } else { (column(&state.H), column(&state.M)) };
            let d = if turns { state.U.0[2] } else { state.U.1[2] };
            positive = positive & T::ZERO.lt(d);
            state.inverse_d = T::ONE / d;
            state.rest = b[body.v] - if turns { state.n[2] } else { state.f[2] };
            bodies[i] = state;
            // I − U Uᵀ / D, p + U (τ − s·p) / D
            let (n, f) = state.U;
            let less = |A: &Matrix3<T>, x: &Vector3<T>, y: &Vector3<T>| {
                let y = y * state.inverse_d;
                Matrix3::from_fn(|i, j| (-x[i]).mul_add(y[j], A[(i, j)]))
            };
            (state.J, state.H, state.M) = (less(&state.J, &n, &n), less(&state.H, &n, &f), less(&state.M, &f, &f));
            let push = state.rest * state.inverse_d;
            (state.n, state.f) = (scale_add(&n, push, &state.n), scale_add(&f, push, &state.f));
        }
        if body.parent != 0 {
            carry(&state, &motion[i], &mut bodies[body.parent]);
        }
    }

    // accelerations, from the root outwards
    (bodies[0].alpha, bodies[0].a) = (zero(), zero());
    for i in 1..model.bodies.len() {
        let body = &model.bodies[i];
        let (p, x) = (bodies[body.parent], &motion[i]);
        let mut alpha = t_mul(&x.R, &p.alpha);
        let mut a = t_mul(&x.R, &cross_add(&p.alpha, &x.p, &p.a));
        match body.motion {
            Motion::Revolute | Motion::Prismatic => {
                let state = &bodies[i];
                let qdd = (state.rest - dot(&state.U.0, &alpha) - dot(&state.U.1, &a)) * state.inverse_d;
                b[body.v] = qdd;
                if body.motion == Motion::Revolute {
                    alpha[2] += qdd;
                } else {
                    a[2] += qdd;
                }
            }
            Motion::Spherical | Motion::Floating => {
                let of = &mut b[body.v..body.v + 6];
                positive = positive & free_body(&bodies[i], &alpha, &a, of);
                alpha += Vector3::new(of[0], of[1], of[2]);
                a += Vector3::new(of[3], of[4], of[5]);
            }
        }
        (bodies[i].alpha, bodies[i].a) = (alpha, a);
    }
    positive
}

/// Inertia of the body alone, no bias force.
fn rigid<T: Real>(body: &Body<T::Const>, state: &mut Articulated<T>) {
    let [xx, xy, xz, yy, yz, zz] = body.inertia.map(T::lift);
    let (m, h, o) = (T::lift(body.mass), lift::<T>(&body.h), T::ZERO);
    state.J = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    state.H = Matrix3::new(o, -h[2], h[1], h[2], o, -h[0], -h[1], h[0], o);
    state.M = Matrix3::new(m, o, o, o, m, o, o, o, m);
    (state.n, state.f) = (zero(), zero());
}

/// Adds an articulated inertia and force to the parent's: M' = R M Rᵀ, H' = R H Rᵀ + [p]× M', J' = R J Rᵀ − R H Rᵀ [p]× + [p]× H'ᵀ.
fn carry<T: Real>(state: &Articulated<T>, x: &BodyState<T>, parent: &mut Articulated<T>) {
    let turned = |A: &Matrix3<T>| mul_mat(&mul_mat(&x.R, A), &x.R.transpose());
    let cross_columns = |A: &Matrix3<T>| {
        let c = |j: usize| cross(&x.p, &Vector3::new(A[(0, j)], A[(1, j)], A[(2, j)]));
        Matrix3::from_columns(&[c(0), c(1), c(2)])
    };
    let (J, H, M) = (turned(&state.J), turned(&state.H), turned(&state.M));
    let shifted = H + cross_columns(&M);
    // A [p]× = ([p]×ᵀ Aᵀ)ᵀ = −([p]× Aᵀ)ᵀ
    parent.J += J + cross_columns(&H.transpose()).transpose() + cross_columns(&shifted.transpose());
    parent.H += shifted;
    parent.M += M;
    let f = mul(&x.R, &state.f);
    parent.n += cross_add(&x.p, &f, &mul(&x.R, &state.n));
    parent.f += f;
}

/// Six accelerations of a free joint: I (a_p + q̈) = τ − p.
fn free_body<T: Real>(state: &Articulated<T>, alpha: &Vector3<T>, a: &Vector3<T>, b: &mut [T]) -> T::Mask {
    let n = mul(&state.J, alpha) + mul(&state.H, a) + state.n;
    let f = t_mul(&state.H, alpha) + mul(&state.M, a) + state.f;
    let mut A = [T::ZERO; 36];
    for i in 0..3 {
        b[i] -= n[i];
        b[i + 3] -= f[i];
        for j in 0..3 {
            A[i * 6 + j] = state.J[(i, j)];
            A[i * 6 + 3 + j] = state.H[(i, j)];
            A[(3 + i) * 6 + j] = state.H[(j, i)];
            A[(3 + i) * 6 + 3 + j] = state.M[(i, j)];
        }
    }
    let (sound, det) = solve_unpivoted(&mut A, b, 6, 1, 0.0);
    sound & T::ZERO.lt(det)
}
