//! Closes the clusters of a model one by one.

use sarrus_proto::{ClosureInfo, ClosureKind};

use crate::closure::{Closure, Numerical, Scratch};
use crate::compile::analysis::{Analysis, State, Subject, analyse, close_zero};
use crate::compile::assemble::Assembly;
use crate::compile::choose_closure::Candidate;
use crate::description::{Description, Submechanism};
use crate::diagnostic::Diagnostic;
use crate::model::Model;
use crate::scalar::{Dd, Real};

/// Fixes rank, rows, blocks, zero pose and closure of each closed cluster; returns the report on
/// each submechanism.
pub(super) fn close_clusters(
    description: &Description,
    assembly: &Assembly,
    exact: &mut Model<Dd>,
    errors: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Diagnostic>,
) -> Vec<ClosureInfo> {
    let mut closures = reports(description, assembly);
    let rough = exact.map(Dd::to_f64);
    for c in exact.closed_clusters.clone() {
        let labels = assembly.labels(c);
        let subject = Subject::new(&rough, c, &labels);
        // a coupling is solved already
        let is_solved = matches!(exact.closures[c], Closure::Coupling(_));
        let Some(analysis) = analyse(&subject, is_solved, errors, warnings) else { continue };
        record(&analysis, &subject, assembly, c, &mut closures);
        let Analysis { used, other_rows, choices, locked } = analysis;
        let zero = &mut exact.zero[subject.cluster.coordinates()];
        let mut numerical = Numerical::new(choices, zero.to_vec());
        let cluster = &mut exact.clusters[c];
        cluster.used = used;
        cluster.other_rows = other_rows;
        cluster.dependent.retain(|v| !locked.contains(v));
        cluster.locked = locked;
        if is_solved {
            continue;
        }
        let bodies = &exact.bodies[subject.cluster.bodies()];
        if let Some(fault) = close_zero(cluster, bodies, &mut numerical, labels.site) {
            errors.push(fault);
            continue;
        }
        zero.copy_from_slice(&numerical.zero);
        let mut scratch = Scratch::new(cluster.n_q, cluster.rows.len());
        let mut state = State::new(cluster, zero);
        numerical.set_reach(&mut state.local(cluster, bodies, &mut scratch));
        let candidate =
            Candidate { description, assembly, c, labels: &labels, cluster, bodies, numerical };
        let chosen = candidate.choose_closure(subject.zero, &mut closures, errors, warnings);
        if let Some(closure) = chosen {
            exact.closures[c] = closure;
        }
    }
    closures
}

/// One report for each submechanism, before its clusters are closed.
fn reports(description: &Description, assembly: &Assembly) -> Vec<ClosureInfo> {
    let report = |(s, submechanism): (usize, &Submechanism)| {
        let rows = assembly.row_owner.iter().filter(|owner| **owner == s).count();
        ClosureInfo {
            name: submechanism.name.clone(),
            type_name: submechanism.type_name.clone(),
            kind: if rows == 0 { ClosureKind::Serial } else { ClosureKind::Analytic },
            rows,
            rank: 0,
            idle: Vec::new(),
            length: 0.0,
            misfit: 0.0,
        }
    };
    description.submechanisms.iter().enumerate().map(report).collect()
}

/// Adds rank, size and idle joints of a cluster to the reports on its submechanisms.
fn record(
    analysis: &Analysis,
    &Subject { cluster, names, .. }: &Subject<'_>,
    assembly: &Assembly,
    c: usize,
    closures: &mut [ClosureInfo],
) {
    for &r in &analysis.used {
        closures[assembly.row_owner[cluster.rows[r]]].rank += 1;
    }
    for (s, _) in assembly.owners(c) {
        closures[s].length = f64::max(closures[s].length, cluster.length);
    }
    let idle = analysis.locked.iter().map(|v| names[*v].clone());
    closures[assembly.owner[c]].idle.extend(idle);
}
