use sarrus_dynamics::Model;
use sarrus_models::Loaded;
use sarrus_proto::ModelInfo;

/// The description of a loaded model, as [`crate::Robot::model`] returns it in process and a server
/// sends it.
pub fn describe(loaded: &Loaded) -> ModelInfo {
    let warnings = loaded.report.warnings.iter().map(ToString::to_string).collect();
    describe_model(&loaded.compiled.model, warnings)
}

/// The description of a model, with its warnings.
pub(crate) fn describe_model(model: &Model<f64>, warnings: Vec<String>) -> ModelInfo {
    ModelInfo { warnings, ..model.info().clone() }
}
