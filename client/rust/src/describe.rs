use sarrus_models::Loaded;
use sarrus_proto::ModelInfo;

/// The description of a loaded model, as [`crate::Robot::model`] returns it in process and a server
/// sends it.
pub fn describe(loaded: &Loaded) -> ModelInfo {
    let warnings = loaded.report.warnings.iter().map(ToString::to_string).collect();
    ModelInfo { warnings, ..loaded.compiled.model.info().clone() }
}
