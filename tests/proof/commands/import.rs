//! `sarrus import`: files, exit codes, and MJCF wherever a URDF stands.

use std::fs;
use std::path::Path;

use crate::commands::{Folder, run};

fn model(name: &str) -> String {
    format!("{}/../models/tests/suite/mjcf/{name}.xml", env!("CARGO_MANIFEST_DIR"))
}
