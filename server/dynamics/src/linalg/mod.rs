//! Linear algebra in place, with the caller's scratch: dense systems, and the factor of a matrix
//! with the sparsity of a tree.

mod dense;
mod quadratic;
mod tree_sparse;
mod zonotope;

pub(crate) use dense::{
    column_square, decompose, determinant_sign, eliminate, exchange, invert, least_norm,
    singular_range, solve_pivoted, solve_sound, solve_unpivoted, substitute_back,
};
pub(crate) use quadratic::{Optimum, Quadratic, Rows};
pub(crate) use tree_sparse::{TreeSparsity, factorise_full, factorise_tree, solve_tree};
pub(crate) use zonotope::{Zonotope, dot};
