//! Rewrites files for another zero pose: only the numbers that change are replaced.

mod inertials;
mod urdf;
mod yaml;

use std::ops::Range;

pub use inertials::with_inertials;

use roxmltree::Node;
use sarrus_dynamics::description::{Cut, Description, Joint, Placement};

use crate::base::Base;
use crate::contents::Contents;
use crate::load::Options;
use crate::open::open_contents;
use crate::report::Diagnostics;

/// Largest error of a number that was written and read again `[m, rad]`.
const ROUNDING: f64 = 1e-9;

/// One robot at two zero poses.
#[derive(Clone, Debug, PartialEq)]
pub struct NewZero {
    /// The zero pose of the files.
    pub old: Description,
    /// The zero pose to write.
    pub new: Description,
}

/// The texts of a robot with another zero pose.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Rewritten {
    /// URDF.
    pub urdf: Vec<u8>,
    /// Submechanisms; `None` if they do not change.
    pub submechanisms: Option<Vec<u8>>,
}

/// A replacement of some bytes; of none for an insertion.
type Edit = (Range<usize>, String);

impl NewZero {
    /// As [`NewZero::write`], of contents.
    pub(crate) fn write_contents(
        &self,
        contents: &Contents,
        options: &Options,
    ) -> Result<Rewritten, String> {
        let urdf = contents.urdf.1.clone();
        let submechanisms = contents.submechanisms.clone().map(|(_, bytes)| bytes);
        let text = String::from_utf8(urdf).map_err(|_| "files that are no UTF-8 text")?;
        let urdf = edited(&text, urdf::edits(&text, self)?).into_bytes();
        // no file holds a free base
        let first = usize::from(options.base != Base::Fixed);
        let cuts = self.cuts(first);
        if cuts.is_empty() {
            return self.verified(Rewritten { urdf, submechanisms: None }, contents, options);
        }
        let Some(Ok(text)) = submechanisms.map(String::from_utf8) else {
            return Err("cuts that stand in no submechanism file".to_owned());
        };
        // as a block, or within braces
        let mut why = String::new();
        for in_braces in [false, true] {
            let Some(edits) = yaml::edits(&text, &cuts, in_braces) else { continue };
            let submechanisms = Some(edited(&text, edits).into_bytes());
            let written = Rewritten { urdf: urdf.clone(), submechanisms };
            match self.verified(written, contents, options) {
                Ok(written) => return Ok(written),
                Err(error) => why = error,
            }
        }
        Err(why)
    }

    /// The cuts whose placements change: submechanism, counted from `first` on, loop, placement on
    /// the predecessor and on the successor.
    pub(crate) fn cuts(&self, first: usize) -> Vec<(usize, usize, Placement, Placement)> {
        let mut cuts = Vec::new();
        let pairs = self.old.submechanisms.iter().zip(&self.new.submechanisms).skip(first);
        for (s, (old, new)) in pairs.enumerate() {
            for (l, (old, new)) in old.loops.iter().zip(&new.loops).enumerate() {
                if let (true, Cut::Placed { predecessor, successor }) =
                    (old.cut != new.cut, &new.cut)
                {
                    cuts.push((s, l, *predecessor, *successor));
                }
            }
        }
        cuts
    }

    /// The new texts, if they describe the robot at its new zero pose.
    fn verified(
        &self,
        written: Rewritten,
        contents: &Contents,
        options: &Options,
    ) -> Result<Rewritten, String> {
        let opened = |urdf: &Vec<u8>, submechanisms: Option<&Vec<u8>>| {
            let named = |name: &str, bytes: &Vec<u8>| (name.to_owned(), bytes.clone());
            let contents = Contents {
                urdf: named("robot.urdf", urdf),
                submechanisms: submechanisms.map(|bytes| named("submechanisms.yml", bytes)),
                folder: None,
            };
            open_contents(Some(contents), options, Diagnostics::new(options.lenient))
        };
        let given = contents.submechanisms.as_ref().map(|(_, bytes)| bytes);
        // a robot whose files name others is not whole in its texts
        if opened(&contents.urdf.1, given).is_err() {
            return Ok(written);
        }
        let again = opened(&written.urdf, written.submechanisms.as_ref().or(given))
            .map_err(|error| format!("the written files cannot be read: {error}"))?;
        match difference(&again.description, &self.new) {
            Some(what) => Err(format!("{what} cannot be written by position")),
            None => Ok(written),
        }
    }
}

/// The first part in which two descriptions of one robot differ.
fn difference(found: &Description, wanted: &Description) -> Option<String> {
    let near = |a: f64, b: f64| a == b || (a - b).abs() <= ROUNDING;
    let same = |a: &Placement, b: &Placement| {
        a.xyz.iter().chain(&a.rpy).zip(b.xyz.iter().chain(&b.rpy)).all(|(a, b)| near(*a, *b))
    };
    // limits, offset of the coupling, rest of the spring
    let numbers = |of: &Joint| {
        let [lower, upper] = of.limits.map_or([0.0; 2], |limits| [limits.lower, limits.upper]);
        let offset = of.coupling.as_ref().map_or(0.0, |coupling| coupling.offset);
        let rest = if of.terms.stiffness == 0.0 { 0.0 } else { of.terms.rest };
        [lower, upper, offset, rest]
    };
    for (a, b) in found.joints.iter().zip(&wanted.joints) {
        let are_near = numbers(a).iter().zip(numbers(b)).all(|(a, b)| near(*a, b));
        if !are_near || !same(&a.origin, &b.origin) {
            return Some(format!("the joint {}", b.name));
        }
    }
    let loops = |of: &Description| -> Vec<_> {
        of.submechanisms.iter().flat_map(|of| of.loops.clone()).collect()
    };
    for (a, b) in loops(found).iter().zip(&loops(wanted)) {
        let equal = match (&a.cut, &b.cut) {
            (
                Cut::Placed { predecessor, successor },
                Cut::Placed { predecessor: p, successor: s },
            ) => same(predecessor, p) && same(successor, s),
            (a, b) => a == b,
        };
        if !equal {
            return Some(format!("the cut {}", b.name));
        }
    }
    None
}

/// A text with its replacements, which do not overlap.
fn edited(text: &str, mut edits: Vec<Edit>) -> String {
    edits.sort_by_key(|(range, _)| range.start);
    let mut written = String::with_capacity(text.len() + 64 * edits.len());
    let mut at = 0;
    for (range, new) in edits {
        written += text.get(at..range.start).unwrap_or_default();
        written += &new;
        at = range.end;
    }
    written + text.get(at..).unwrap_or_default()
}

/// A number in as few digits as it needs.
pub(crate) fn number(x: f64) -> String {
    let plain = x.to_string();
    if plain.len() > 24 { format!("{x:e}") } else { plain }
}

fn list(of: &[f64], between: &str) -> String {
    of.iter().map(|x| number(*x)).collect::<Vec<_>>().join(between)
}

/// Whether an element is the part of a robot with this name.
fn is_named(node: Node<'_, '_>, kind: &str, name: &str) -> bool {
    node.has_tag_name(kind) && node.attribute("name") == Some(name)
}
