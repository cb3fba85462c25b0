//! YAML files with the position of every value, so that all their faults can be reported at once:
//! for submechanism files, and for others that report faults in the same way.

mod read;
mod tree;

pub(crate) use read::missing;
pub use read::{Named, keys, list, number, numbers, word, words};
pub(crate) use tree::parse;
pub use tree::{Node, Value};

use crate::report::Diagnostics;
pub use crate::report::{Span, quoted};
use crate::text::Text;

/// The expected kind of file in the messages about most YAML files of a robot.
pub(crate) const SUBMECHANISMS: &str = "a submechanism file";

/// Reads a text whose faults carry its file's name; `expected` names the kind of file. `None` after
/// a fault that leaves no content.
pub fn read(
    name: &str,
    bytes: Vec<u8>,
    expected: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Node> {
    parse(&Text::new(name, bytes, diagnostics)?, expected, diagnostics)
}
