//! Reference answers: `tests/vectors`, and a larger collection in the folder
//! `$SARRUS_REFERENCE`.

use std::path::{Path, PathBuf};

use sarrus_dynamics::scalar::Dd;
use serde_json::Value;

use crate::decimal::decimal;

/// The bundled robots with answers from an independent engine.
pub const ROBOTS: [&str; 21] = [
    "lambda",
    "parallelogram",
    "torso",
    "ankle",
    "wrist",
    "r3_lambda_r",
    "stewart",
    "rh5v2_upper_body",
    "rh5v2_full",
    "four_bars_2",
    "five_bar",
    "squeezer",
    "delta",
    "active_ankle",
    "g1_ankle",
    "jansen",
    "three_rrr",
    "gripper",
    "agile_eye",
    "wheel_leg",
    "cassie_leg",
];

/// Legs with such answers. The laws take them behind the random robots, which keep their places.
pub const LEGS: [&str; 3] = ["cassie", "digit_tarsus", "kangaroo_leg"];

/// The others with such answers, but for the reactions of their loops, which are not determinate.
pub const REDUNDANT: [&str; 1] = ["bennett"];

/// With such answers too; moments about the axes of their idle rods are borne by nothing, so that
/// laws of forces do not hold joint by joint.
pub const IDLE: [&str; 1] = ["delta_balls"];

/// A file of the project's own vectors.
pub fn vectors(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors").join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The folder of reference data outside the project, if there is one.
pub fn folder() -> Option<PathBuf> {
    let folder =
        std::env::var_os("SARRUS_REFERENCE").map(PathBuf::from).filter(|folder| folder.is_dir());
    if folder.is_none() {
        println!("not run: SARRUS_REFERENCE does not point to reference data");
    }
    folder
}

/// Flattens a number, a list or a list of rows.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap_or_else(|| panic!("not a number: {other}"))],
    }
}

/// [`numbers`] for numbers of forty digits in quotes.
pub fn digits(value: &Value) -> Vec<Dd> {
    match value {
        Value::Array(items) => items.iter().flat_map(digits).collect(),
        Value::String(text) => {
            vec![decimal(text).unwrap_or_else(|| panic!("not a number: {text}"))]
        }
        other => numbers(other).into_iter().map(Dd::from).collect(),
    }
}

/// The cases of a file.
pub fn cases(file: &Value) -> &[Value] {
    file["cases"].as_array().or(file["states"].as_array()).map_or(&[], Vec::as_slice)
}
