//! SMURF: a YAML file whose `files` name the robot's files; the first URDF and the first YAML with
//! submechanisms count.

use std::path::Path;

use crate::contents::{Contents, file};
use crate::error::LoadError;
use crate::report::Diagnostics;
use crate::text::{self, Text};
use crate::yaml::{self, Node, Value};

/// Whether a file is given as SMURF.
pub(crate) fn is_smurf(path: &Path) -> bool {
    has_extension(path, &["smurf"])
}

/// The contents of the files that a SMURF file names; submechanisms that are given beside it come
/// first.
pub(crate) fn contents(
    path: &Path,
    submechanisms: Option<&Path>,
    diagnostics: &mut Diagnostics,
) -> Result<Option<Contents>, LoadError> {
    let (name, bytes) = file(path)?;
    let Some(text) = Text::new(&name, bytes, diagnostics) else { return Ok(None) };
    let Some(root) = yaml::parse(&text, yaml::SUBMECHANISMS, diagnostics) else { return Ok(None) };
    let Some(files) = root.get("files") else {
        yaml::missing(&root, "the file", "files", "a list of the robot's files", diagnostics);
        return Ok(None);
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = |extensions: &[&str]| -> Vec<_> {
        let texts = files.items().iter().filter_map(|node| {
            if let Value::Scalar { text, .. } = &node.value { Some(text) } else { None }
        });
        texts.map(|name| folder.join(name)).filter(|path| has_extension(path, extensions)).collect()
    };
    let urdfs = named(&["urdf"]);
    let Some(urdf) = urdfs.first() else {
        diagnostics.error(files.span, "`files` names no URDF", "one", "add it");
        return Ok(None);
    };
    let urdf = named_file(urdf)?;
    if let Some(given) = submechanisms {
        let folder = given.parent().map(Path::to_owned);
        return Ok(Some(Contents { urdf, submechanisms: Some(file(given)?), folder }));
    }
    for candidate in named(&["yml", "yaml"]) {
        let (name, bytes) = named_file(&candidate)?;
        if may_have_submechanisms(&name, bytes.clone()) {
            let folder = candidate.parent().map(Path::to_owned);
            return Ok(Some(Contents { urdf, submechanisms: Some((name, bytes)), folder }));
        }
    }
    Ok(Some(Contents { urdf, submechanisms: None, folder: None }))
}

fn named_file(path: &Path) -> Result<(String, Vec<u8>), LoadError> {
    Ok((path.display().to_string(), text::read_named(path)?))
}

/// A file that cannot be parsed may: its faults are then reported with the rest.
fn may_have_submechanisms(name: &str, bytes: Vec<u8>) -> bool {
    let mut unheard = Diagnostics::new(false);
    let root = Text::new(name, bytes, &mut unheard)
        .and_then(|text| yaml::parse(&text, yaml::SUBMECHANISMS, &mut unheard));
    root.as_ref().is_none_or(|root: &Node| root.get("submechanisms").is_some())
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    extensions.iter().any(|query| extension.eq_ignore_ascii_case(query))
}
