use sarrus_dynamics::Model;
use sarrus_models::Loaded;
use sarrus_proto::ModelInfo;

/// What there is to know about a loaded model: what [`crate::Robot::model`] gives in process, and
/// what a server sends.
pub fn describe(loaded: &Loaded) -> ModelInfo {
    let warnings = loaded.report.warnings.iter().map(ToString::to_string).collect();
    describe_model(&loaded.compiled.model, warnings)
}

/// The same of a model, with what is remarkable about it.
pub(crate) fn describe_model(model: &Model<f64>, warnings: Vec<String>) -> ModelInfo {
    ModelInfo { warnings, ..model.info().clone() }
}
