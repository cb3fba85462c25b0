//! Scratch of searches for positions, and of steps of a motion.

use sarrus_proto::{MAX_CONTACTS, MAX_FRAMES, MAX_WRENCHES, Sizes};

use crate::linalg::Quadratic;

/// Most rows of the tasks of one query: nine of each frame, three of the centre of mass.
pub(crate) const TASK_ROWS: usize = 9 * MAX_FRAMES + 3;

/// The numbers of a search, beside those of the pose in hand, by `plan/task/`. Columns are the
/// independents that may move, or the unknowns of a step of a motion.
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
    /// Of a step of a motion: numbers of the ordinary request, joint and kinds of the bounds of
    /// each row, the actuators' matrix of a mechanism, its solution, and forces without motion
    /// (n_u).
    pub(crate) numbers: Vec<f64>,
    pub(crate) joints: Vec<Option<(usize, [usize; 2])>>,
    pub(crate) block: Vec<f64>,
    pub(crate) solved: Vec<f64>,
    pub(crate) constant: Vec<f64>,
}

impl Search {
    /// For every query on a model of these sizes, with so many freedoms of its widest mechanism
    /// and actuators of mechanisms that have not as many of them as freedoms. Allocates; nothing
    /// after it does.
    pub(crate) fn new(sizes: &Sizes, widest: usize, uneven: usize) -> Search {
        let Sizes { n_q, n_v, n_vy, n_qy, n_u, .. } = *sizes;
        let of = |n: usize| vec![0.0; n];
        let held = 6 * MAX_CONTACTS;
        let n = n_vy + held + uneven;
        // one more for the clearance
        let rows = n_v + 1 + TASK_ROWS + held + n_vy + n_u;
        let frames = 6 * MAX_FRAMES + 3;
        // given numbers, joints, M_y and G, Jacobians
        let numbers = n_qy.max(n_q)
            + n_q
            + 3 * n_v
            + 6 * MAX_WRENCHES
            + n_q
            + 2 * n_v
            + n_vy
            + n_vy * (n_vy + n_v)
            + frames * (n_vy + 1);
        Search {
            base: of(n_q),
            guess: of(n_q),
            best: of(n_q),
            least: of(n_q),
            first: of(n_q),
            lower: of(n_v),
            upper: of(n_v),
            moves: vec![0; n_vy],
            J: of(TASK_ROWS * n),
            of_frame: of(6 * n_vy),
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
            numbers: of(numbers),
            joints: vec![None; n + rows],
            block: of(widest * widest),
            solved: of(widest * (n + 1)),
            constant: of(n_u),
        }
    }
}
