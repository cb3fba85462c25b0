//! SMURF: a YAML file whose `files` name the robot's files; the first URDF and the first YAML with
//! submechanisms count.

use std::path::Path;

use crate::contents::Contents;
use crate::error::Outcome;
use crate::report::Diagnostics;
use crate::text;
use crate::yaml::{self, Node};

/// Whether a file is given as SMURF.
pub(crate) fn is_smurf(path: &Path) -> bool {
    has_extension(path, &["smurf"])
}

/// The contents of the files that a SMURF file names; separately given submechanisms come first.
pub(crate) fn contents(
    path: &Path,
    submechanisms: Option<&Path>,
    diagnostics: &mut Diagnostics,
) -> Outcome<Option<Contents>> {
    let (name, bytes) = text::read(path)?;
    let Some(root) = yaml::read(&name, bytes, yaml::SUBMECHANISMS, diagnostics) else {
        return Ok(None);
    };
    let Some(files) = root.get("files") else {
        yaml::missing(&root, "the file", "files", "a list of the robot's files", diagnostics);
        return Ok(None);
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = |extensions: &[&str]| -> Vec<_> {
        let texts = files.items().iter().filter_map(Node::text);
        texts.map(|name| folder.join(name)).filter(|path| has_extension(path, extensions)).collect()
    };
    let urdfs = named(&["urdf"]);
    let Some(urdf) = urdfs.first() else {
        diagnostics.error(files.span, "`files` names no URDF", "one", "add it");
        return Ok(None);
    };
    let urdf = text::read_named(urdf)?;
    if let Some(given) = submechanisms {
        let folder = given.parent().map(Path::to_owned);
        return Ok(Some(Contents { urdf, submechanisms: Some(text::read(given)?), folder }));
    }
    for candidate in named(&["yml", "yaml"]) {
        let (name, bytes) = text::read_named(&candidate)?;
        if may_have_submechanisms(&name, bytes.clone()) {
            let folder = candidate.parent().map(Path::to_owned);
            return Ok(Some(Contents { urdf, submechanisms: Some((name, bytes)), folder }));
        }
    }
    Ok(Some(Contents { urdf, submechanisms: None, folder: None }))
}

/// A file that cannot be parsed counts as one: its faults are then reported with the rest.
fn may_have_submechanisms(name: &str, bytes: Vec<u8>) -> bool {
    let root = yaml::read(name, bytes, yaml::SUBMECHANISMS, &mut Diagnostics::new(false));
    root.is_none_or(|root| root.get("submechanisms").is_some())
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    extensions.iter().any(|query| extension.eq_ignore_ascii_case(query))
}
