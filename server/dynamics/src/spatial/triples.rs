//! The same products of [`Triple`]s, as the recursions compute them.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Real, Triple};
use crate::spatial::Pose;

/// A matrix by its columns.
pub(crate) type Columns<T> = [<T as Real>::Triple; 3];

#[inline(always)]
pub(crate) fn zero<T: Real>() -> T::Triple {
    T::Triple::splat(T::ZERO)
}

#[inline(always)]
pub(crate) fn identity<T: Real>() -> Columns<T> {
    let (o, i) = (T::ZERO, T::ONE);
    T::Triple::columns([i, o, o, o, i, o, o, o, i])
}

/// A constant of the model in the scalar of the kernel.
#[inline(always)]
pub(crate) fn lift<T: Real>(v: &Vector3<T::Const>) -> T::Triple {
    T::Triple::new(T::lift(v[0]), T::lift(v[1]), T::lift(v[2]))
}

/// A constant of the model in the scalar of the kernel.
#[inline(always)]
pub(crate) fn lift_columns<T: Real>(m: &Matrix3<T::Const>) -> Columns<T> {
    T::Triple::columns(core::array::from_fn(|k| T::lift(m[k])))
}

/// The same vector.
#[inline(always)]
pub(crate) fn triple<T: Real>(v: &Vector3<T>) -> T::Triple {
    T::Triple::new(v[0], v[1], v[2])
}

/// The same vector.
#[inline(always)]
pub(crate) fn vector<T: Real>(x: &T::Triple) -> Vector3<T> {
    Vector3::new(x[0], x[1], x[2])
}

/// The same matrix.
#[inline(always)]
pub(crate) fn columns<T: Real>(m: &Matrix3<T>) -> Columns<T> {
    T::Triple::columns(core::array::from_fn(|k| m[k]))
}

/// The pose of these axes and this origin.
#[inline(always)]
pub(crate) fn pose<T: Real>(R: &Columns<T>, p: &T::Triple) -> Pose<T> {
    Pose { R: Matrix3::from_columns(&R.each_ref().map(vector::<T>)), p: vector::<T>(p) }
}

/// a · b.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: &T::Triple, b: &T::Triple) -> T {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// a × b.
#[inline(always)]
pub(crate) fn cross<T: Real>(a: &T::Triple, b: &T::Triple) -> T::Triple {
    // z, x, y of it
    a.fused_sub(b.yzx(), a.yzx().times(*b)).yzx()
}

/// c + a × b.
#[inline(always)]
pub(crate) fn cross_add<T: Real>(a: &T::Triple, b: &T::Triple, c: &T::Triple) -> T::Triple {
    a.yzx().fused(b.zxy(), a.zxy().fused_from(b.yzx(), *c))
}

/// c + a s.
#[inline(always)]
pub(crate) fn scale_add<T: Real>(a: &T::Triple, s: T, c: &T::Triple) -> T::Triple {
    a.fused(T::Triple::splat(s), *c)
}

/// Each number of x three times.
#[inline(always)]
fn splats<T: Real>(x: &T::Triple) -> (T::Triple, T::Triple, T::Triple) {
    (T::Triple::splat(x[0]), T::Triple::splat(x[1]), T::Triple::splat(x[2]))
}

/// R x.
#[inline(always)]
pub(crate) fn mul<T: Real>(R: &Columns<T>, x: &T::Triple) -> T::Triple {
    let (x, y, z) = splats::<T>(x);
    R[0].fused(x, R[1].fused(y, R[2].times(z)))
}

/// R x + c.
#[inline(always)]
pub(crate) fn mul_add<T: Real>(R: &Columns<T>, x: &T::Triple, c: &T::Triple) -> T::Triple {
    let (x, y, z) = splats::<T>(x);
    R[0].fused(x, R[1].fused(y, R[2].fused(z, *c)))
}

/// A B.
#[inline(always)]
pub(crate) fn mul_mat<T: Real>(A: &Columns<T>, B: &Columns<T>) -> Columns<T> {
    B.each_ref().map(|b| mul::<T>(A, b))
}

/// E Rz(q) from the cosine and sine of q.
#[inline(always)]
pub(crate) fn turn_z<T: Real>(E: &Columns<T>, c: T, s: T) -> Columns<T> {
    let (c, s) = (T::Triple::splat(c), T::Triple::splat(s));
    [E[0].fused(c, E[1].times(s)), E[1].fused_sub(c, E[0].times(s)), E[2]]
}

/// A [p]×ᵀ, whose row i is p × (row i of A).
#[inline(always)]
pub(crate) fn cross_rows<T: Real>(p: &T::Triple, A: &Columns<T>) -> Columns<T> {
    let (x, y, z) = splats::<T>(p);
    [
        y.fused_sub(A[2], z.times(A[1])),
        z.fused_sub(A[0], x.times(A[2])),
        x.fused_sub(A[1], y.times(A[0])),
    ]
}
