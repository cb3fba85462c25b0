use sarrus_dynamics::Model;
use sarrus_dynamics::description::Limits;
use sarrus_models::Loaded;
use sarrus_proto::{Closure, JointLimits, ModelInfo};

/// What there is to know about a loaded model: what [`crate::Robot::model`] gives in process, and
/// what a server sends.
pub fn describe(loaded: &Loaded) -> ModelInfo {
    let warnings = loaded.report.warnings.iter().map(ToString::to_string);
    describe_model(&loaded.compiled.model, warnings.collect())
}

/// The same of a model, with what is remarkable about it.
pub(crate) fn describe_model(model: &Model<f64>, warnings: Vec<String>) -> ModelInfo {
    let closures = model.closures().iter().map(|closure| Closure {
        name: closure.name.clone(),
        type_name: closure.type_name.clone(),
        kind: closure.kind.name().to_owned(),
        rows: closure.rows,
        rank: closure.rank,
        misfit: closure.misfit,
    });
    ModelInfo {
        robot: model.name().to_owned(),
        fingerprint: model.fingerprint(),
        sizes: model.sizes().into(),
        tree: model.tree_names().to_vec(),
        tree_q: model.tree_q_names().to_vec(),
        independent: model.independent_names().to_vec(),
        independent_q: model.independent_q_names().to_vec(),
        active: model.active_names().to_vec(),
        loops: model.loop_names().to_vec(),
        branches: model.branch_names().to_vec(),
        links: model.link_names().to_vec(),
        limits: model.tree_limits().iter().map(|limits| limits.as_ref().map(finite)).collect(),
        closures: closures.collect(),
        warnings,
    }
}

/// JSON has no infinite numbers: no limit there.
fn finite(limits: &Limits) -> JointLimits {
    let finite = |limit: f64| limit.is_finite().then_some(limit);
    JointLimits {
        lower: finite(limits.lower),
        upper: finite(limits.upper),
        velocity: finite(limits.velocity),
        effort: finite(limits.effort),
    }
}
