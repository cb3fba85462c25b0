//! Compiles a description to a model, in double-double and rounded to f64.

mod analysis;
mod assemble;
mod blocks;
mod bodies;
mod canonical;
mod choose_closure;
mod closed_forms;
mod clusters;
mod couplings;
mod curves;
mod cuts;
mod elimination;
mod geometry;
mod idle;
mod masses;
mod matching;
mod mobility;
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

use sarrus_proto::ModelInfo;

use crate::closure::Closure;
use crate::description::{Description, SubmechanismKind};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::model::{ClosureAtZero, Compiled, Model};
use crate::scalar::{Dd, Real};

pub(crate) use assemble::Assembly;
pub use canonical::{fitting_types, joint_orders, loops_of};
pub(crate) use curves::curve_at;
pub use curves::{curve_fault, table_fit};
pub(crate) use geometry::{link_pose, pose as pose_of, unit_of, vector};
pub(crate) use structure::Structure;
pub use suggest::{SuggestedIndependents, suggest_independents};

/// The types with a closed form, in the order in which they are tried on a loop of another type.
pub const CLOSED_FORMS: [(&str, SubmechanismKind); 8] = [
    ("RRPR", SubmechanismKind::Rrpr),
    ("SLIDERCRANK", SubmechanismKind::SliderCrank),
    ("FOURBAR", SubmechanismKind::FourBar),
    ("2SPU+1U", SubmechanismKind::Spu2U1),
    ("2SPRR+1U", SubmechanismKind::Sprr2U1),
    ("2SURRPR+1U", SubmechanismKind::Surrpr2U1),
    ("6UPS", SubmechanismKind::Ups6),
    ("PARALLELOGRAMCHAIN", SubmechanismKind::ParallelogramChain),
];

/// Distance to singularity of the zero pose below which a warning is given.
const SINGULAR: f64 = 1e-9;

impl Model<f64> {
    /// Compiles a description: merges fixed joints, finds clusters, fixes rank, rows and order of
    /// every closure, checks mobility, closure at zero and the reduced mass matrix. Allocates;
    /// takes milliseconds.
    ///
    /// # Errors
    /// Every fault, each with its place in the description.
    pub fn compile(description: &Description) -> Result<Compiled, CompileError> {
        let mut errors = Vec::new();
        let mut warnings = Vec::new();
        match build(description, &mut errors, &mut warnings) {
            Some((model, exact)) => Ok(Compiled { model, exact, warnings }),
            None => Err(CompileError { errors, warnings }),
        }
    }
}

/// Model in f64 and in double-double; `None` if there are errors.
fn build(
    description: &Description,
    errors: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Diagnostic>,
) -> Option<(Model<f64>, Model<Dd>)> {
    let assembly = Assembly::new(description, errors)?;
    let mut exact = assembly.model.clone();
    let closures = clusters::close_clusters(description, &assembly, &mut exact, errors, warnings);
    if !errors.is_empty() {
        return None;
    }
    exact.meta = Arc::new(ModelInfo { closures, ..assembly.meta });
    let mut model = exact.map(Dd::to_f64);
    masses::assess_masses(&mut model, &mut exact, description, warnings);
    find_turns_and_seeds(&mut model, &mut exact);
    model.growth = masses::growth(&model, &exact);
    exact.growth = model.growth;
    warn_of_dead_points(&model, description, warnings);
    Some((model, exact))
}

/// Whole turns of both models; seed tables and verified closed forms of the f64 model alone.
fn find_turns_and_seeds(model: &mut Model<f64>, exact: &mut Model<Dd>) {
    turns::wind(model);
    for (cluster, of) in exact.clusters.iter_mut().zip(&model.clusters) {
        cluster.windings.clone_from(&of.windings);
    }
    for (c, turns) in turns::find(model) {
        if let Some(numerical) = exact.closures[c].numerical() {
            numerical.turns.clone_from(&turns);
        }
        if let Some(numerical) = model.closures[c].numerical() {
            numerical.turns = turns;
        }
    }
    let tables = seeds::find(model);
    // a form without a table is not used
    for numerical in model.closures.iter_mut().filter_map(Closure::numerical) {
        numerical.form = None;
    }
    for seeds::Found { cluster, seeds, form } in tables {
        if let Some(numerical) = model.closures[cluster].numerical() {
            numerical.seeds = Some(seeds);
            numerical.form = form;
        }
    }
    for numerical in exact.closures.iter_mut().filter_map(Closure::numerical) {
        numerical.form = None;
    }
}

fn warn_of_dead_points(
    model: &Model<f64>,
    description: &Description,
    warnings: &mut Vec<Diagnostic>,
) {
    let at_zero = model.closures_at_zero();
    // couplings alone are linear, however their sizes differ
    let has_loops = |s: usize| {
        let of = &description.submechanisms[s];
        of.kind != SubmechanismKind::Transmission || !of.loops.is_empty()
    };
    let singular =
        |(s, loops): &(usize, &ClosureAtZero)| loops.sigma_min < SINGULAR && has_loops(*s);
    for (s, loops) in at_zero.iter().enumerate().filter(singular) {
        warnings.push(Diagnostic::new(
            Site::Submechanism(s),
            format!(
                "the zero pose is a dead point of {}: its loops are singular at the zero pose \
                (sigma {:.1e})",
                description.submechanisms[s].name, loops.sigma_min
            ),
            "a zero pose from which requests without a guess can go on",
            "use `sarrus check --assemble --near JOINT=0.1,… --write OUT.urdf` to write \
            another one, or give q_guess with every request",
        ));
    }
}
