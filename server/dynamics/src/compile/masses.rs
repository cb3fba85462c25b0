//! Whether the masses of a robot let its motion be computed, judged at load.
//!
//! The diagonal of M_y is what an independent joint has to accelerate while the others stand still,
//! the pivots Δ of the recursion what it has to while the others behind it are free. Their ratio
//! has no unit, and its digits are lost in forward dynamics: a heavy hand on light links has a
//! large one.

use sarrus_proto::Status;

use crate::algorithms;
use crate::closure::Level;
use crate::compile::analysis::POSES;
use crate::description::Description;
use crate::diagnostic::{Diagnostic, Site};
use crate::model::{Method, Model, Scope, UNEQUAL};
use crate::scalar::{Dd, Real, Scalar, noise};
use crate::workspace::{Needs, Workspace};

/// Least Δ against the joint's own inertia, and against the largest of the robot, that is
/// distinguished from rounding.
const NOTHING: f64 = 1e-15;
const LEAST: f64 = 1e-18;

/// Independents up to which projection is tried at load, whose cost grows with their cube.
const PROJECTED: usize = 64;

/// Warnings where M_y is not positive definite, or nearly is not, at the zero pose or beside it.
/// Returns the largest inertia of each independent among these poses, in internal order, zero where
/// no pose could be closed; and whether M_y was positive definite at none of them.
pub(super) fn check(
    model: &Model<f64>,
    description: &Description,
    warnings: &mut Vec<Diagnostic>,
) -> (Vec<f64>, bool) {
    let mut ws = Workspace::sized(model, Needs::default());
    let scope = Scope::whole(model);
    let n = model.meta.sizes.n_vy;
    let (mut typical, mut worst) = (vec![0.0; n], vec![0.0; n]);
    let (mut massless, mut n_good) = (Vec::new(), 0);
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
            // a pivot of zero leaves no number behind in those that carry it
            let zero = bad.iter().copied().filter(|i| !pivots[*i].is_nan()).collect::<Vec<_>>();
            massless = if zero.is_empty() { bad } else { zero };
            continue;
        }
        n_good += 1;
        for i in 0..n {
            typical[i] = f64::max(typical[i], inertia[i]);
            worst[i] = f64::max(worst[i], inertia[i] / pivots[i]);
        }
    }
    if !massless.is_empty() {
        let (site, names) = joints(model, description, &massless);
        warnings.push(Diagnostic {
            site,
            found: format!("no inertia that resists the motion of {names}"),
            expected: "a positive definite reduced mass matrix".into(),
            help: "give mass or inertia to a link that these joints move; until then forward \
                dynamics answers mass_not_positive"
                .into(),
        });
    }
    let unequal: Vec<usize> = (0..n).filter(|i| worst[*i] > UNEQUAL).collect();
    if !unequal.is_empty() {
        let (site, names) = joints(model, description, &unequal);
        let ratio = worst.iter().copied().fold(0.0, f64::max);
        warnings.push(Diagnostic {
            site,
            found: format!(
                "masses so unequal that forward dynamics loses {:.0} of 16 digits at {names}",
                ratio.log10()
            ),
            expected: format!(
                "a joint's inertia at most {UNEQUAL:.0e} times what is left of it where the joints \
                behind it are free"
            ),
            help: "give the light links their true mass, or read the accelerations with that many \
                digits"
                .into(),
        });
    }
    (typical, !massless.is_empty() && n_good == 0)
}

/// Names of independents and where the first of them stands.
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

/// Poses and G at the zero pose or at some distance from it; false where a loop does not close
/// there.
fn set_pose<T: Scalar>(model: &Model<T>, scope: &Scope, ws: &mut Workspace<T>, k: usize) -> bool {
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

/// By how many unit roundoffs accelerations are off at the poses that were tried, against the
/// largest of them: by the recursion, and by projection where the robot is small enough for that to
/// be tried. Zero where no pose could be closed.
pub(super) fn growth(model: &Model<f64>, exact: &Model<Dd>) -> [f64; 2] {
    let n = model.meta.sizes.n_vy;
    let mut growth = [0.0; 2];
    let needs = Needs { mass_matrix: n <= PROJECTED, ..Needs::default() };
    let (mut ws, mut exact_ws) = (Workspace::sized(model, needs), Workspace::sized(exact, needs));
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
            let (mut off, mut size) = (0.0_f64, 0.0_f64);
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
fn solved<T: Scalar>(
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

/// What the recursion divides by at each independent, in internal order: the inertia that is left
/// of it where everything behind it is free. Needs the joint poses and G. Allocates.
fn pivots(model: &Model<f64>, scope: &Scope, ws: &mut Workspace<f64>) -> Vec<f64> {
    ws.ydd.fill(0.0);
    algorithms::embedded_solve(model, scope, ws);
    ws.embedding.inverses(model, &scope.clusters).map(|inverse| 1.0 / inverse).collect()
}
