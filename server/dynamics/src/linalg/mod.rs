//! Linear algebra in place, over scratch of the caller: dense systems, and the factor of a matrix
//! with the sparsity of a tree.

mod dense;
mod tree_sparse;

pub(crate) use dense::{
    column_square, decompose, determinant_sign, least_norm, singular_range, solve_pivoted,
    solve_sound, solve_unpivoted,
};
pub(crate) use tree_sparse::{Branches, factorise_branches, factorise_full, solve_branches};
