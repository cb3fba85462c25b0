use sarrus_models::Loaded;
use sarrus_proto::ModelInfo;

/// What there is to know about a loaded model: what [`crate::Robot::model`] gives in process, and
/// what a server sends.
pub fn describe(loaded: &Loaded) -> ModelInfo {
    let warnings = loaded.report.warnings.iter().map(ToString::to_string).collect();
    ModelInfo { warnings, ..loaded.compiled.model.info().clone() }
}
