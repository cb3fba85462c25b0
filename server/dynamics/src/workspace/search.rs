//! Scratch of searches for positions.

use sarrus_proto::{MAX_FRAMES, Sizes};

use crate::linalg::Quadratic;

/// Most rows of the tasks of one query: nine of each frame, three of the centre of mass.
pub(crate) const TASK_ROWS: usize = 9 * MAX_FRAMES + 3;

/// The numbers of a search, beside those of the pose in hand, by `plan/task/`. Columns are the
/// independents that may move.
#[derive(Clone, Debug, Default)]
pub(crate) struct Search {
    /// Tree coordinates of the last accepted pose, of the start, of the nearest pose that breaks no
    /// bound, and of the pose that breaks them least (n_q).
    pub(crate) base: Vec<f64>,
    pub(crate) guess: Vec<f64>,
    pub(crate) best: Vec<f64>,
    pub(crate) least: Vec<f64>,
    /// Of the first solution, where all are wanted (n_q).
    pub(crate) first: Vec<f64>,
    /// Bounds of each tree velocity's coordinate (n_v).
    pub(crate) lower: Vec<f64>,
    pub(crate) upper: Vec<f64>,
    /// The independents that may move, in internal order (n_vy).
    pub(crate) moves: Vec<usize>,
    /// Rows of the tasks' Jacobian; those of the second level last.
    pub(crate) J: Vec<f64>,
    /// One frame's Jacobian (6 × n_vy).
    pub(crate) of_frame: Vec<f64>,
    /// The program of a step: JᵀJ of each level, its damped copy and factor, Jᵀe of each level, and
    /// that of the program in hand.
    pub(crate) H: [Vec<f64>; 2],
    pub(crate) damped: Vec<f64>,
    pub(crate) g: [Vec<f64>; 2],
    pub(crate) damped_g: Vec<f64>,
    /// Rows of the first level for the second, up to number [`TASK_ROWS`], then those of dependent
    /// coordinates with their bounds; bounds of a program.
    pub(crate) rows: Vec<f64>,
    pub(crate) limits: Vec<[f64; 2]>,
    pub(crate) row_lower: Vec<f64>,
    pub(crate) row_upper: Vec<f64>,
    pub(crate) step: Vec<f64>,
    pub(crate) program: Quadratic,
}

impl Search {
    /// For every query on a model of these sizes. Allocates; nothing after it does.
    pub(crate) fn new(sizes: &Sizes) -> Search {
        let Sizes { n_q, n_v, n_vy: n, .. } = *sizes;
        let of = |n: usize| vec![0.0; n];
        // one more for the clearance
        let rows = n_v + 1 + TASK_ROWS;
        Search {
            base: of(n_q),
            guess: of(n_q),
            best: of(n_q),
            least: of(n_q),
            first: of(n_q),
            lower: of(n_v),
            upper: of(n_v),
            moves: vec![0; n],
            J: of(TASK_ROWS * n),
            of_frame: of(6 * n),
            H: [of(n * n), of(n * n)],
            damped: of(n * n),
            g: [of(n), of(n)],
            damped_g: of(n),
            rows: of(rows * n),
            limits: vec![[0.0; 2]; n_v + 1],
            row_lower: of(n + rows),
            row_upper: of(n + rows),
            step: of(n),
            program: Quadratic::new(n, rows),
        }
    }
}
