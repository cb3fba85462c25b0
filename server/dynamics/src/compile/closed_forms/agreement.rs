//! Compares a closed form with Newton's method near the zero pose.

use crate::closure::{Closure, Level, Numerical, Scratch, column_unit, distance};
use crate::compile::analysis::State;
use crate::mechanism::{Body, Cluster};
use crate::scalar::{Dd, Real};

/// Steps of the independents to either side, in radians or cluster lengths: the longer one, or the
/// shorter one if Newton's method does not reach the longer.
const STEPS: [f64; 2] = [0.1, 0.01];
/// Largest distance between the two, in radians or cluster lengths, and its increase per unit of
/// misfit.
const AGREES: f64 = 1e-12;
const PER_MISFIT: f64 = 1e3;
/// Largest distance as part of the step.
const SHARE: f64 = 0.1;

/// True if the closed form agrees with Newton's method on both sides of each independent and of all
/// together; false if Newton's method finds no pose.
pub(super) fn agrees(
    closure: &Closure<Dd>,
    numerical: &Numerical<Dd>,
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    misfit: f64,
) -> bool {
    let zero = &numerical.zero;
    let mut state = State::new(cluster, zero);
    let mut scratch = Scratch::new(cluster.n_q, cluster.rows.len());
    let m = cluster.independent.len();
    (0..2 * (m + 1)).all(|direction| {
        let sign = if direction % 2 == 0 { 1.0 } else { -1.0 };
        let moves = |k: usize| direction / 2 == m || direction / 2 == k;
        STEPS.into_iter().any(|step| {
            let mut goal = zero.clone();
            for (k, v) in cluster.independent.iter().enumerate().filter(|(k, _)| moves(*k)) {
                // steps differ between independents
                let step = sign * step * (1.0 - 0.3 * k as f64 / m as f64);
                goal[cluster.dofs[*v].q] += Dd::from_f64(step * column_unit(cluster, *v));
            }
            state.q.clone_from(zero);
            numerical.determinants(&mut state.local(cluster, bodies, &mut scratch));
            state.q.clone_from(&goal);
            let moved = distance(cluster, zero, &goal);
            if numerical.attempt(&mut state.local(cluster, bodies, &mut scratch), moved).is_none() {
                return false;
            }
            let found = std::mem::replace(&mut state.q, goal);
            closure.close(&mut state.local(cluster, bodies, &mut scratch), Level::Position);
            cluster.dependent.iter().all(|v| {
                let i = cluster.dofs[*v].q;
                let apart = (state.q[i] - found[i]).to_f64().abs() / column_unit(cluster, *v);
                apart < (AGREES + PER_MISFIT * misfit).min(SHARE * step)
            })
        })
    })
}
