//! From a description to a model in both precisions: the order of the steps.

mod analysis;
mod assemble;
mod blocks;
mod bodies;
mod canonical;
mod closed_forms;
mod couplings;
mod cuts;
mod elimination;
mod geometry;
mod idle;
mod masses;
mod mobility;
mod open;
mod orders;
mod owners;
mod rank;
mod redundant;
mod seeds;
mod spanning_tree;
mod structure;
mod suggest;
mod terms;
mod turns;

use std::sync::Arc;

use sarrus_proto::{ClosureInfo, ClosureKind, ModelInfo};

use crate::closure::{Closure, Numerical};
use crate::compile::analysis::{Analysis, Subject};
use crate::compile::assemble::Assembly;
use crate::description::{Description, SubmechanismKind};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::model::{Compiled, Model};
use crate::scalar::{Dd, Real, Scalar};
pub(crate) use structure::Structure;
pub use suggest::{SuggestedIndependents, suggest_independents};

pub(crate) use geometry::{pose as pose_of, unit_of};

/// Misfit up to which a closed form stands as it is: the rounding of numbers in a file.
const ROUNDING: f64 = 1e-13;
/// Scaled distance to singularity below which the zero pose is warned of.
const SINGULAR: f64 = 1e-9;
/// Misfit up to which a closed form starts Newton's method on the true rows.
const POLISHABLE: f64 = 1e-3;

impl Model<f64> {
    /// Compiles a description: merges fixed joints, finds clusters, fixes rank, rows and order of
    /// every closure, checks mobility, closure at zero and the reduced mass matrix. Allocates;
    /// takes milliseconds.
    ///
    /// # Errors
    /// All faults that were found, each with its place in the description.
    pub fn compile(description: &Description) -> Result<Compiled, CompileError> {
        let (mut errors, mut warnings) = (Vec::new(), Vec::new());
        match build(description, &mut errors, &mut warnings) {
            Some(compiled) if errors.is_empty() => Ok(Compiled { warnings, ..compiled }),
            _ => Err(CompileError { errors, warnings }),
        }
    }
}

fn build(
    description: &Description,
    errors: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Diagnostic>,
) -> Option<Compiled> {
    let assembly = Assembly::new(description, errors)?;
    let mut exact = assembly.model.clone();
    let mut info = Vec::new();
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        let rows = assembly.row_owner.iter().filter(|owner| owner.0 == s).count();
        info.push(ClosureInfo {
            name: submechanism.name.clone(),
            type_name: submechanism.type_name.clone(),
            kind: if rows == 0 { ClosureKind::Serial } else { ClosureKind::Analytic },
            rows,
            rank: 0,
            idle: Vec::new(),
            length: 0.0,
            misfit: 0.0,
        });
    }

    // each closed cluster: rank and blocks, then its closed form if its type has one
    let rough = exact.map(Dd::to_f64);
    for c in exact.closed_clusters.clone() {
        let cluster = &rough.clusters[c];
        let bodies = rough.bodies_of(cluster);
        let names = assembly.names(c);
        let site = Site::Submechanism(assembly.owner[c]);
        let described_zero = &rough.described_zero[cluster.coordinates()];
        let row_names =
            cluster.rows.iter().map(|row| assembly.meta.loops[*row].clone()).collect::<Vec<_>>();
        let has_child_cluster: Vec<bool> = (0..cluster.n)
            .map(|b| rough.clusters.iter().any(|child| child.parent == cluster.body + b))
            .collect();
        let subject = Subject {
            cluster,
            bodies,
            zero: described_zero,
            has_child_cluster: &has_child_cluster,
            names: &names,
            row_names: &row_names,
            site,
        };
        let analysis = analysis::analyse(&subject, errors, warnings);
        let Some(Analysis { used, blocks, locked }) = analysis else { continue };
        for &r in &used {
            info[assembly.row_owner[cluster.rows[r]].0].rank += 1;
        }
        let exact_bodies = exact.bodies[cluster.bodies()].to_vec();
        let mut numerical = Numerical::new(blocks, exact.zero[cluster.coordinates()].to_vec());
        exact.clusters[c].used = used;
        for (s, _) in assembly.owners(c) {
            info[s].length = f64::max(info[s].length, cluster.length);
        }
        info[assembly.owner[c]].idle.extend(locked.iter().map(|v| names[*v].clone()));
        exact.clusters[c].dependent.retain(|v| !locked.contains(v));
        exact.clusters[c].locked = locked;
        let coupled = matches!(exact.closures[c], Closure::Coupling(_));
        if !coupled
            && let Some(fault) =
                analysis::close_zero(&exact.clusters[c], &exact_bodies, &mut numerical, site)
        {
            errors.push(fault);
            continue;
        }
        let (q, n) = (cluster.q, cluster.n_q);
        exact.zero[q..q + n].copy_from_slice(&numerical.zero);

        // couplings are closed as they are; another closed form stands, starts Newton's method, or
        // does not fit
        if coupled {
            continue;
        }
        if exact.clusters[c].cuts.iter().flat_map(|cut| &cut.rows).all(|row| !row.terms.is_empty())
        {
            errors.push(contradicting_couplings(&names, site));
            continue;
        }
        let kind = kind(&assembly, description, c);
        let order = assembly.local_order(description, c);
        let zero: Vec<Dd> = described_zero.iter().map(|x| Dd::from_f64(*x)).collect();
        let (closed, bodies_there) = (&exact.clusters[c], exact_bodies.as_slice());
        if closed_forms::has_change_point(closed, bodies_there, &order, &zero) {
            numerical.set_meets();
        }
        let mut closure = match closed_forms::build(kind, closed, bodies_there, &order, &zero) {
            None => {
                if let Some(fault) = not_closed_form(kind, description, assembly.owner[c]) {
                    warnings.push(fault);
                }
                Closure::Numerical(numerical)
            }
            Some(Err(why)) => {
                warnings.push(Diagnostic {
                    site,
                    found: format!(
                        "a {} whose {why}",
                        description.submechanisms[assembly.owner[c]].type_name
                    ),
                    expected: "the geometry that the type's closed form assumes".into(),
                    help: "it is closed numerically; write NUMERICAL to say so".into(),
                });
                Closure::Numerical(numerical)
            }
            Some(Ok(mut form)) => {
                let of_bodies: Vec<String> =
                    bodies.iter().map(|body| names[body.v - cluster.v].clone()).collect();
                let (worst, misfit) = form.misfit(&of_bodies);
                for (s, _) in assembly.owners(c) {
                    info[s].misfit = f64::max(info[s].misfit, misfit);
                }
                let numerically = match kind {
                    SubmechanismKind::ParallelogramChain => {
                        Some("opposite sides equal and axes parallel, or type FOURBAR")
                    }
                    SubmechanismKind::Surrpr2U1 => {
                        Some("axes of each rod's universal joint that cross at a right angle")
                    }
                    _ => None,
                };
                if misfit > POLISHABLE
                    && let Some(expected) = numerically
                {
                    warnings.push(Diagnostic {
                        site,
                        found: format!("{worst} by {misfit:.3e} of the mechanism's size"),
                        expected: expected.into(),
                        help: "it is closed numerically".into(),
                    });
                    exact.closures[c] = Closure::Numerical(numerical);
                    set_numerical(&mut info, &assembly, c);
                    continue;
                }
                if kind == SubmechanismKind::Surrpr2U1
                    && !form.agrees(&numerical, closed, bodies_there)
                {
                    warnings.push(Diagnostic {
                        site,
                        found: "a closed form that Newton's method does not confirm beside the \
                            zero pose"
                            .into(),
                        expected: "a zero pose away from dead points".into(),
                        help: "it is closed numerically".into(),
                    });
                    exact.closures[c] = Closure::Numerical(numerical);
                    set_numerical(&mut info, &assembly, c);
                    continue;
                }
                if misfit > POLISHABLE {
                    errors.push(Diagnostic {
                        site,
                        found: format!("{worst}: off by {misfit:.3e} of the mechanism's size"),
                        expected: format!(
                            "at most {POLISHABLE} for the closed form of {}",
                            description.submechanisms[assembly.owner[c]].type_name
                        ),
                        help: "correct the axis or origin, or write type NUMERICAL".into(),
                    });
                    continue;
                }
                if misfit > ROUNDING {
                    form.polish(numerical);
                }
                form.closure()
            }
        };
        if let Closure::Numerical(numerical) = &mut closure {
            numerical.form = closed_forms::start(closed, bodies_there, &zero, ROUNDING);
            set_numerical(&mut info, &assembly, c);
        }
        exact.closures[c] = closure;
    }
    if !errors.is_empty() {
        return None;
    }
    exact.meta = Arc::new(ModelInfo { closures: info, ..assembly.meta.clone() });
    let mut model = exact.map(Dd::to_f64);
    (model.inertia, model.is_massless) = masses::check(&model, description, warnings);
    exact.inertia.clone_from(&model.inertia);
    exact.is_massless = model.is_massless;
    for (c, turns) in turns::find(&model) {
        if let Some(numerical) = exact.closures[c].numerical() {
            numerical.turns.clone_from(&turns);
        }
        if let Some(numerical) = model.closures[c].numerical() {
            numerical.turns = turns;
        }
    }
    // a closed form that Newton's method starts from has to hold; the exact model goes without
    for seeds::Found { cluster, seeds, holds } in seeds::find(&model) {
        if let Some(numerical) = model.closures[cluster].numerical() {
            numerical.seeds = Some(seeds);
            numerical.form.take_if(|_| !holds);
        }
    }
    for numerical in exact.closures.iter_mut().filter_map(Closure::numerical) {
        numerical.form = None;
    }
    model.growth = masses::growth(&model, &exact);
    exact.growth = model.growth;
    for (s, loops) in
        model.closures_at_zero().iter().enumerate().filter(|(_, loops)| loops.sigma_min < SINGULAR)
    {
        warnings.push(Diagnostic {
            site: Site::Submechanism(s),
            found: format!(
                "the zero pose is a dead point of {}: its loops are singular at the zero pose \
                (sigma {:.1e})",
                description.submechanisms[s].name, loops.sigma_min
            ),
            expected: "a zero pose from which requests without a guess can go on".into(),
            help: "use `sarrus check --assemble --near JOINT=0.1,… --write OUT.urdf` to write \
                another one, or give q_guess with every request"
                .into(),
        });
    }
    Some(Compiled { model, exact, warnings: Vec::new() })
}

/// A cluster is of its submechanism's type where it is all of it; parallelograms of one chain may
/// be clusters of their own.
fn kind(assembly: &Assembly, description: &Description, c: usize) -> SubmechanismKind {
    let kind = match assembly.owners(c).as_slice() {
        [(s, _)] if description.submechanisms[*s].kind == SubmechanismKind::ParallelogramChain => {
            SubmechanismKind::ParallelogramChain
        }
        _ => assembly.kind(description, c),
    };
    // other closed forms count from joints at rest
    let is_platform = matches!(
        kind,
        SubmechanismKind::Spu2U1 | SubmechanismKind::Sprr2U1 | SubmechanismKind::Ups6
    );
    match description.zero_pose.iter().any(|(j, _)| assembly.members[c].contains(j)) {
        true if !is_platform => SubmechanismKind::Numerical,
        _ => kind,
    }
}

/// The submechanisms of this cluster are closed numerically.
fn set_numerical(info: &mut [ClosureInfo], assembly: &Assembly, c: usize) {
    for (s, _) in assembly.owners(c) {
        if info[s].rows > 0 {
            info[s].kind = ClosureKind::Numerical;
        }
    }
}

/// Couplings of full rank that no pose satisfies.
fn contradicting_couplings(names: &[String], site: Site) -> Diagnostic {
    Diagnostic {
        site,
        found: format!("couplings between {} that contradict each other", names.join(", ")),
        expected: "as many couplings as dependent joints, or more that repeat them".into(),
        help: "take out a coupling, or correct its multipliers and offset".into(),
    }
}

/// A type that has no closed form, or whose closed form these loops are not.
fn not_closed_form(
    kind: SubmechanismKind,
    description: &Description,
    s: usize,
) -> Option<Diagnostic> {
    let (expected, help) = match kind {
        SubmechanismKind::Numerical | SubmechanismKind::Serial => return None,
        SubmechanismKind::Transmission | SubmechanismKind::Differential => {
            ("couplings (<mimic>, <transmission>) and no loops", "write NUMERICAL to say so")
        }
        _ => (
            "a type with a closed form: RRPR, 2SPU+1U, 2SPRR+1U, 2SURRPR+1U, 6UPS, FOURBAR, \
            SLIDERCRANK, PARALLELOGRAMCHAIN, TRANSMISSION, DIFFERENTIAL",
            "nothing to do: it is closed numerically from its loops",
        ),
    };
    Some(Diagnostic {
        site: Site::Submechanism(s),
        found: format!("type {}", description.submechanisms[s].type_name),
        expected: expected.into(),
        help: help.into(),
    })
}
