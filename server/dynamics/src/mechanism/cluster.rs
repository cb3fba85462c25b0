//! Clusters: the joints that loops and couplings close together.

use crate::scalar::constants;
use core::ops::{Index, Range};

use crate::mechanism::{Cut, Dof, Windings};

/// Tree joints that loops or couplings close together, on one parent body.
#[derive(Clone, Debug)]
pub(crate) struct Cluster<T> {
    /// The parent body.
    pub(crate) parent: usize,
    /// First body and number of bodies.
    pub(crate) body: usize,
    pub(crate) n: usize,
    /// First internal tree velocity and coordinate; n_v of them.
    pub(crate) v: usize,
    pub(crate) q: usize,
    pub(crate) n_v: usize,
    pub(crate) n_q: usize,
    /// The degree of freedom of each local velocity (n_v).
    pub(crate) dofs: Vec<Dof>,
    /// First internal independent velocity; n_vy of them.
    pub(crate) vy: usize,
    pub(crate) n_vy: usize,
    /// First number of the cluster's block in G; read by [`Cluster::G`].
    pub(crate) g_offset: usize,
    /// Local velocities that are independent, in the order of y, and the others; and the same of
    /// the local coordinates.
    pub(crate) independent: Vec<usize>,
    pub(crate) dependent: Vec<usize>,
    pub(crate) independent_q: Vec<usize>,
    pub(crate) dependent_q: Vec<usize>,
    /// Idle velocities, which are zero; they are in neither list.
    pub(crate) locked: Vec<usize>,
    /// Local parent of each local body, counted from 1; 0 is the cluster's parent body.
    pub(crate) local_parent: Vec<usize>,
    /// Actuators: (index in u, local velocity).
    pub(crate) active: Vec<(usize, usize)>,
    pub(crate) windings: Windings,
    pub(crate) cuts: Vec<Cut<T>>,
    /// External index of each local constraint row; the rows that, with the dependents, make the
    /// square system.
    pub(crate) rows: Vec<usize>,
    pub(crate) used: Vec<usize>,
    /// Other such rows, where some are redundant: these have their singular poses elsewhere.
    pub(crate) other_rows: Vec<Vec<usize>>,
    /// Characteristic length `[m]`.
    pub(crate) length: f64,
    /// Unit of each local velocity (n_v): 1 rad, a slider's the length; a joint that moves by
    /// couplings alone has the one that belongs to theirs.
    pub(crate) units: Vec<f64>,
    /// Size from which down the roundings of G count against G_u: the actuators' authority is a
    /// thousandth there, by the units of the joints.
    pub(crate) least_authority: f64,
}

constants! { Cluster:
    keep parent body n v q n_v n_q dofs vy n_vy g_offset independent dependent locked independent_q
        dependent_q local_parent active windings rows used other_rows length units
        least_authority;
    each cuts;
}

impl<T> Cluster<T> {
    /// Its bodies among those of the model.
    #[inline(always)]
    pub(crate) fn bodies(&self) -> Range<usize> {
        self.body..self.body + self.n
    }

    /// Its tree coordinates among those of the model.
    #[inline(always)]
    pub(crate) fn coordinates(&self) -> Range<usize> {
        self.q..self.q + self.n_q
    }

    /// Its tree velocities among those of the model.
    #[inline(always)]
    pub(crate) fn velocities(&self) -> Range<usize> {
        self.v..self.v + self.n_v
    }

    /// Its independent velocities among those of the model.
    #[inline(always)]
    pub(crate) fn independents(&self) -> Range<usize> {
        self.vy..self.vy + self.n_vy
    }

    /// The place of its block in an array of the blocks of all clusters.
    #[inline(always)]
    pub(crate) fn block(&self) -> Range<usize> {
        self.g_offset..self.g_offset + self.n_v * self.n_vy
    }

    /// Its loop Jacobian, from the blocks of all clusters.
    #[inline(always)]
    pub(crate) fn G<'a, S>(&self, blocks: &'a [S]) -> GBlock<'a, S> {
        GBlock { entries: &blocks[self.g_offset..], n_vy: self.n_vy }
    }

    /// Numbers of its geometry: six of each body and of each end of each cut.
    pub(crate) fn n_geometry(&self) -> usize {
        6 * (self.n + 2 * self.cuts.len())
    }

    /// True when the cluster is one free joint.
    pub(crate) fn is_serial(&self) -> bool {
        self.rows.is_empty()
    }
}

/// The loop Jacobian of one cluster (n_v × n_vy, row-major): q̇_j = Σ_k `G[(j, k)]` ẏ_k.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GBlock<'a, T> {
    /// The block's numbers and those of the blocks after it.
    entries: &'a [T],
    n_vy: usize,
}

impl<'a, T> GBlock<'a, T> {
    /// The block of one free degree of freedom and others of one independent.
    #[inline(always)]
    pub(crate) fn new(entries: &'a [T], n_vy: usize) -> GBlock<'a, T> {
        GBlock { entries, n_vy }
    }

    /// The row of local velocity j (n_vy).
    #[inline(always)]
    pub(crate) fn row(&self, j: usize) -> &'a [T] {
        &self.entries[j * self.n_vy..][..self.n_vy]
    }

    /// The rows of n local velocities from j on, one after the other.
    #[inline(always)]
    pub(crate) fn rows(&self, j: usize, n: usize) -> &'a [T] {
        &self.entries[j * self.n_vy..][..n * self.n_vy]
    }
}

impl<T> Index<(usize, usize)> for GBlock<'_, T> {
    type Output = T;

    #[inline(always)]
    fn index(&self, (j, k): (usize, usize)) -> &T {
        &self.entries[j * self.n_vy + k]
    }
}
