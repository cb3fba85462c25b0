//! Numbers of the derivatives of one request. Dense matrices hold one derivative after the other:
//! entry (k, j) is that of τ_j by direction k.

use crate::closure::Second;
use crate::model::Model;
use crate::scalar::{Real, Triple};
use crate::spatial::Spatial;
use crate::workspace::Composite;

/// Scratch and results, by `closure/constraint/second.rs`, `algorithms/derivatives.rs` and
/// `plan/derivatives.rs`.
#[derive(Clone, Debug)]
pub(crate) struct Derivatives<T: Real> {
    pub(crate) second: Second<T>,
    /// Ġ, ∂q̇/∂y and ∂q̈/∂y at fixed ẏ and ÿ, in the places of the G blocks.
    pub(crate) Gd: Vec<T>,
    pub(crate) H1: Vec<T>,
    pub(crate) H2: Vec<T>,
    /// Bodies {root}.
    pub(crate) bodies: Vec<Moving<T>>,
    /// Columns of the tree velocities (n_v), and of the cluster in hand (largest n_vy).
    pub(crate) columns: Vec<Column<T>>,
    pub(crate) joined: Vec<Supported<T>>,
    /// Displacement of each body by the independents of its own cluster, from `seen_at` on.
    pub(crate) seen: Vec<Seen<T>>,
    pub(crate) seen_at: Vec<usize>,
    /// r_q G + r_v H1 + M H2, r_v G + M (Ġ + H1) and M G of the cluster in hand (n_v × n_vy).
    pub(crate) products: [Vec<T>; 3],
    /// Forces on the tree velocities: those of the motion and those that are held (n_v).
    pub(crate) tau_q: Vec<T>,
    pub(crate) held_q: Vec<T>,
    /// Their W, a row for each direction (n_vy × largest n_vy of a cluster).
    pub(crate) W: Vec<T>,
    pub(crate) held: Vec<T>,
    pub(crate) widest: usize,
    /// ∂τ_y/∂y, ∂τ_y/∂ẏ (n_vy × n_vy), and M_y, packed by `Model::sparsity`.
    pub(crate) tau_y: [Vec<T>; 2],
    pub(crate) M_y: Vec<T>,
    /// Independents (largest n_vy) and velocities (n_v) of the cluster in hand; zeros (n_v).
    pub(crate) x: Vec<T>,
    pub(crate) rate: Vec<T>,
    pub(crate) still: Vec<T>,
    /// ∂τ_u and ∂τ_rest by y and ẏ (n_vy × n_u, n_vy × n_vy); ∂ÿ by τ_u (n_u × n_vy), those by y
    /// and ẏ take the place of ∂τ_y.
    pub(crate) tau_u: [Vec<T>; 2],
    pub(crate) rest: [Vec<T>; 2],
    pub(crate) ydd_of_tau_u: Vec<T>,
    /// State of the observer after the request (n_vy).
    pub(crate) observer: Vec<[T; 3]>,
    /// Displacement and change of the velocity of a frame's body and of its reference by each
    /// independent (n_vy).
    pub(crate) frame: Vec<[Spatial<T>; 2]>,
    pub(crate) reference: Vec<[Spatial<T>; 2]>,
    /// ∂q/∂θ of the dependents of the cluster in hand.
    pub(crate) by_geometry: Vec<T>,
}

/// Motion and composite of a body with all that it carries, at the root's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving<T: Real> {
    /// Velocity; acceleration less gravity.
    pub(crate) V: Spatial<T>,
    pub(crate) A: Spatial<T>,
    pub(crate) inertia: Composite<T>,
    /// Linear momentum Σ m ẋ, and the columns of 2 (Σ m x·ẋ 1 − Σ m ẋ xᵀ).
    pub(crate) momentum: T::Triple,
    pub(crate) turning: [T::Triple; 3],
    /// Inertial less external force.
    pub(crate) force: Spatial<T>,
    /// External force F, and the columns of Σ (x·F 1 − F xᵀ) + [·] × n.
    pub(crate) external: T::Triple,
    pub(crate) follows: [T::Triple; 3],
}

/// Displacement by an independent, its rates, and its part in the accelerations' change with ẏ.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen<T: Real> {
    pub(crate) moved: Spatial<T>,
    pub(crate) rate: Spatial<T>,
    pub(crate) second: Spatial<T>,
    pub(crate) by_rate: Spatial<T>,
}

/// The composite that a velocity carries, along it: momentum, forces that turn with rates and with
/// displacements, and the change of the force by the coordinate and by its rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Supported<T: Real> {
    pub(crate) momentum: Spatial<T>,
    pub(crate) by_turning: T::Triple,
    pub(crate) by_moving: T::Triple,
    pub(crate) force: Spatial<T>,
    pub(crate) by_rate: Spatial<T>,
}

/// Both for a tree velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column<T: Real> {
    pub(crate) of: Seen<T>,
    pub(crate) supported: Supported<T>,
}

impl<T: Real> Seen<T> {
    pub(crate) fn none() -> Seen<T> {
        let none = Spatial::zero();
        Seen { moved: none, rate: none, second: none, by_rate: none }
    }
}

impl<T: Real> Supported<T> {
    pub(crate) fn none() -> Supported<T> {
        let none = Spatial::zero();
        let zero = T::Triple::zero();
        Supported { momentum: none, by_turning: zero, by_moving: zero, force: none, by_rate: none }
    }
}

impl<T: Real> Moving<T> {
    pub(crate) fn at_rest(inertia: Composite<T>) -> Moving<T> {
        let none = Spatial::zero();
        let zero = T::Triple::zero();
        Moving {
            V: none,
            A: none,
            inertia,
            momentum: zero,
            turning: [zero; 3],
            force: none,
            external: zero,
            follows: [zero; 3],
        }
    }
}

impl<T: Real> Derivatives<T> {
    /// Allocates.
    pub(crate) fn new(model: &Model<T>, massless: Composite<T>) -> Derivatives<T> {
        let sizes = model.sizes();
        let n = sizes.n_vy;
        let of = |n: usize| vec![T::ZERO; n];
        let square = || of(n * n);
        let clusters = || model.clusters.iter();
        let widest = clusters().map(|c| c.n_vy).max().unwrap_or(0);
        let by_geometry = clusters().map(|c| c.dependent.len() * c.n_geometry());
        let block = clusters().map(|c| c.n_v * c.n_vy).max().unwrap_or(0);
        let mut seen_at = vec![0; model.bodies.len()];
        let mut seen = 0;
        for cluster in &model.clusters {
            for i in cluster.bodies() {
                seen_at[i] = seen;
                seen += cluster.n_vy;
            }
        }
        let column = Column { of: Seen::none(), supported: Supported::none() };
        Derivatives {
            second: Second::new(model.closed_clusters.iter().map(|c| &model.clusters[*c])),
            Gd: of(model.n_g),
            H1: of(model.n_g),
            H2: of(model.n_g),
            bodies: vec![Moving::at_rest(massless); model.bodies.len()],
            columns: vec![column; sizes.n_v],
            joined: vec![Supported::none(); widest],
            seen: vec![Seen::none(); seen],
            seen_at,
            products: [of(block), of(block), of(block)],
            tau_q: of(sizes.n_v),
            held_q: of(sizes.n_v),
            W: of(n * widest),
            held: of(n * widest),
            widest,
            x: of(widest),
            rate: of(sizes.n_v),
            still: of(sizes.n_v),
            tau_y: [square(), square()],
            M_y: of(model.sparsity.len),
            tau_u: [of(n * sizes.n_u), of(n * sizes.n_u)],
            rest: [square(), square()],
            ydd_of_tau_u: of(n * sizes.n_u),
            observer: vec![[T::ZERO; 3]; n],
            frame: vec![[Spatial::zero(); 2]; n],
            reference: vec![[Spatial::zero(); 2]; n],
            by_geometry: of(by_geometry.max().unwrap_or(0)),
        }
    }
}
