#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![allow(non_snake_case, reason = "matrices have the names of the equations")]

use faer::Side;
use faer::linalg::solvers::{SelfAdjointEigen, Solve, Svd};

pub use faer::Mat;

/// A = U S Vᵀ with square U and V; `None` where no iteration converges.
pub fn svd(A: &Mat<f64>) -> Option<Svd<f64>> {
    A.svd().ok()
}

/// A = U S Vᵀ with as many columns of U and V as A has singular values.
pub fn thin_svd(A: &Mat<f64>) -> Option<Svd<f64>> {
    A.thin_svd().ok()
}

/// The columns of A in the order in which QR with pivoting takes them.
pub fn pivots(A: &Mat<f64>) -> Vec<usize> {
    pivoted_qr(A).0
}

/// The columns of A in the order in which QR with pivoting takes them, and R.
pub fn pivoted_qr(A: &Mat<f64>) -> (Vec<usize>, Mat<f64>) {
    let qr = A.col_piv_qr();
    (qr.P().arrays().0.to_vec(), qr.thin_R().to_owned())
}

/// A = U S Uᵀ from the lower triangle of A.
pub fn symmetric_eigen(A: &Mat<f64>) -> Option<SelfAdjointEigen<f64>> {
    A.self_adjoint_eigen(Side::Lower).ok()
}

/// X with A X = B by LU with row pivoting; not finite where A is singular.
pub fn solve(A: &Mat<f64>, B: &Mat<f64>) -> Mat<f64> {
    A.partial_piv_lu().solve(B)
}
