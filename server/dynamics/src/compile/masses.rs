//! Assesses at load how well a robot's masses determine its accelerations.
//!
//! The diagonal of M_y is the inertia of an independent joint with the others held still; the
//! pivots Δ of the recursion are its inertia with the joints behind it free to move. Forward
//! dynamics loses as many digits as their ratio has; the ratio is large for a heavy hand on light
//! links.

use sarrus_proto::Status;

use crate::algorithms;
use crate::closure::Level;
use crate::compile::analysis::POSES;
use crate::description::Description;
use crate::diagnostic::{Diagnostic, Site};
use crate::model::{Method, Model, Scope, UNEQUAL};
use crate::scalar::{Dd, Real, noise};
use crate::workspace::{Needs, Workspace};

/// Least Δ above rounding, relative to the joint's own inertia and to the robot's largest.
const NOTHING: f64 = 1e-15;
const LEAST: f64 = 1e-18;

/// Independents up to which projection is tried at load, whose cost grows with their cube.
const PROJECTED: usize = 64;

/// Ratios of inertias at the sampled poses, in internal order.
struct Assessment {
    /// Largest inertia of each independent; zero where no pose was closed.
    typical: Vec<f64>,
    /// Largest ratio of inertia to pivot of each independent.
    worst: Vec<f64>,
    /// Independents without inertia at some pose.
    massless: Vec<usize>,
    /// Number of poses with a positive definite M_y.
    n_good: usize,
}

/// Sets `inertia` and `is_massless` of both models; warns if M_y is not positive definite, or
/// nearly is not, at the zero pose or beside it.
pub(super) fn assess_masses(
    model: &mut Model<f64>,
    exact: &mut Model<Dd>,
    description: &Description,
    warnings: &mut Vec<Diagnostic>,
) {
    let Assessment { typical, worst, massless, n_good } = assess(model);
    if !massless.is_empty() {
        let (site, names) = joints(model, description, &massless);
        warnings.push(Diagnostic::new(
            site,
            format!("no inertia that resists the motion of {names}"),
            "a positive definite reduced mass matrix",
            "give mass or inertia to a link that these joints move; until then forward \
            dynamics answers mass_not_positive",
        ));
    }
    let unequal: Vec<usize> = (0..worst.len()).filter(|i| worst[*i] > UNEQUAL).collect();
    if !unequal.is_empty() {
        let (site, names) = joints(model, description, &unequal);
        let ratio = worst.iter().copied().fold(0.0, f64::max);
        warnings.push(Diagnostic::new(
            site,
            format!(
                "masses so unequal that forward dynamics loses {:.0} of 16 digits at {names}",
                ratio.log10()
            ),
            format!(
                "a joint's inertia at most {UNEQUAL:.0e} times its inertia with the joints behind \
                it free"
            ),
            "give the light links their true mass, or read the accelerations with that many \
            digits",
        ));
    }
    model.is_massless = !massless.is_empty() && n_good == 0;
    exact.is_massless = model.is_massless;
    exact.inertia.clone_from(&typical);
    model.inertia = typical;
}

fn assess(model: &Model<f64>) -> Assessment {
    let mut ws = Workspace::sized(model, Needs::default());
    let scope = Scope::whole(model);
    let n = model.meta.sizes.n_vy;
    let mut found =
        Assessment { typical: vec![0.0; n], worst: vec![0.0; n], massless: Vec::new(), n_good: 0 };
    for k in 0..POSES {
        if !set_pose(model, &scope, &mut ws, k) {
            break;
        }
        let inertia = algorithms::own_inertias(model, &scope, &mut ws);
        let pivots = self::pivots(model, &scope, &mut ws);
        let largest = inertia.iter().copied().fold(0.0, f64::max);
        let least = |i: usize| f64::max(inertia[i] * NOTHING, largest * LEAST);
        let enough = |i: &usize| pivots[*i] > least(*i);
        let bad: Vec<usize> = (0..n).filter(|i| !enough(i)).collect();
        if !bad.is_empty() {
            // a pivot of zero makes the pivots of the joints before it NaN
            let zero = bad.iter().copied().filter(|i| !pivots[*i].is_nan()).collect::<Vec<_>>();
            found.massless = if zero.is_empty() { bad } else { zero };
            continue;
        }
        found.n_good += 1;
        for i in 0..n {
            found.typical[i] = f64::max(found.typical[i], inertia[i]);
            found.worst[i] = f64::max(found.worst[i], inertia[i] / pivots[i]);
        }
    }
    found
}

/// Names of independents and the site of the first.
fn joints(model: &Model<f64>, description: &Description, which: &[usize]) -> (Site, String) {
    let name = |i: &usize| model.meta.independent[model.order.vy_external[*i]].as_str();
    let first = which.first().map(name);
    let site = description
        .joints
        .iter()
        .position(|joint| Some(joint.name.as_str()) == first)
        .map_or(Site::Robot, Site::Joint);
    (site, which.iter().map(name).collect::<Vec<_>>().join(", "))
}

/// Poses and G at the zero pose or at some distance from it; false if a loop does not close.
fn set_pose<T: Real>(model: &Model<T>, scope: &Scope, ws: &mut Workspace<T>, k: usize) -> bool {
    for (i, &q) in model.order.qy_q.iter().enumerate() {
        ws.q[q] = model.zero[q];
        if model.order.qy_q.len() == model.meta.sizes.n_vy {
            ws.q[q] += T::from_f64(0.1 * noise(k * 1000 + i));
        }
    }
    ws.start.copy_from_slice(&model.zero);
    for &c in &model.closed_clusters {
        if ws.close(model, c, Level::Velocity).status != Status::Ok {
            return false;
        }
    }
    for &(i, q) in &scope.free {
        let (s, c) = ws.q[q].sin_cos();
        ws.cos_sin[i] = (c, s);
    }
    algorithms::joint_poses(model, &scope.posed, &ws.q, &ws.cos_sin, &mut ws.motion);
    true
}

/// Error of accelerations at the sampled poses, in unit roundoffs of the largest: by the recursion,
/// and by projection if the robot is small. Zero if no pose could be closed.
pub(super) fn growth(model: &Model<f64>, exact: &Model<Dd>) -> [f64; 2] {
    let n = model.meta.sizes.n_vy;
    let mut growth = [0.0; 2];
    let needs = Needs { mass_matrix: n <= PROJECTED, ..Needs::default() };
    let mut ws = Workspace::sized(model, needs);
    let mut exact_ws = Workspace::sized(exact, needs);
    let scope = Scope::whole(model);
    for k in 0..POSES {
        if !set_pose(model, &scope, &mut ws, k) || !set_pose(exact, &scope, &mut exact_ws, k) {
            break;
        }
        let force = |i: usize| model.inertia[i] * noise(k * 1000 + 500 + i);
        let reference = solved(exact, &scope, &mut exact_ws, Method::Recursion, force);
        for (method, growth) in [Method::Recursion, Method::Projection].into_iter().zip(&mut growth)
        {
            if method == Method::Projection && !needs.mass_matrix {
                continue;
            }
            let found = solved(model, &scope, &mut ws, method, force);
            let mut off = 0.0_f64;
            let mut size = 0.0_f64;
            for (x, reference) in found.iter().zip(&reference) {
                off = off.max((Dd::from(*x) - *reference).to_f64().abs());
                size = size.max(reference.to_f64().abs());
            }
            if size > 0.0 {
                *growth = f64::max(*growth, off / (size * <f64 as Real>::EPSILON));
            }
        }
    }
    growth
}

/// ÿ from M_y ÿ = b by a method. Needs the joint poses and G. Allocates.
fn solved<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
    method: Method,
    b: impl Fn(usize) -> f64,
) -> Vec<T> {
    ws.ydd.iter_mut().enumerate().for_each(|(i, to)| *to = T::from_f64(b(i)));
    if method == Method::Projection {
        algorithms::reduced_mass_matrix(model, scope, ws);
        algorithms::projected_solve(model, scope, ws);
    } else {
        algorithms::embedded_solve(model, scope, ws);
    }
    ws.ydd.clone()
}

/// Pivots of the recursion in internal order: the articulated inertia of each independent. Needs
/// the joint poses and G. Allocates.
fn pivots(model: &Model<f64>, scope: &Scope, ws: &mut Workspace<f64>) -> Vec<f64> {
    ws.ydd.fill(0.0);
    algorithms::embedded_solve(model, scope, ws);
    ws.embedding.inverses(model, &scope.clusters).map(|inverse| 1.0 / inverse).collect()
}
