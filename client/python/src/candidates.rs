//! Possible motors, by protocol and identifier, for the search of motors that a configuration
//! lacks.

use std::sync::Mutex;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sarrus_can_core::commissioning::{Candidate, identifiers, variants};
use sarrus_can_core::drive::Receipt;
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Protocol, protocol};

use crate::frames::{PyFrame, list};
use crate::locked;

/// Room for the frames of one question.
const FRAMES: usize = 32;

/// A possible motor: questions for an answer, without power.
#[pyclass(name = "Candidate", module = "sarrus.can", frozen)]
pub(crate) struct PyCandidate {
    candidate: Mutex<Candidate>,
}

#[pymethods]
impl PyCandidate {
    /// A motor of this protocol, variant (empty if the protocol has none) and identifier; a
    /// `ValueError` if no motor can have them.
    #[new]
    fn new(protocol: &str, variant: &str, id: i64) -> PyResult<PyCandidate> {
        let candidate = Candidate::new(known(protocol)?, variant, id).ok_or_else(|| {
            PyValueError::new_err(format!("{protocol} {variant} has no identifier {id}"))
        })?;
        Ok(PyCandidate { candidate: Mutex::new(candidate) })
    }

    /// Frames that ask for an answer without giving power or changing anything.
    fn probe(&self) -> Vec<PyFrame> {
        let mut out = FrameQueue::new(FRAMES);
        locked(&self.candidate).probe(&mut out);
        list(out.frames())
    }

    /// The kind of a frame of this motor, independent of the identifier on which it replies:
    /// `"measured"`, `"parameter"`, `"noted"` or `"malformed"`; `None` for another's frame.
    fn hears(&self, now_ns: u64, frame: &PyFrame) -> Option<&'static str> {
        match locked(&self.candidate).hears(now_ns, &frame.0) {
            Receipt::NotMine | Receipt::Foreign => None,
            Receipt::Malformed => Some("malformed"),
            Receipt::Noted => Some("noted"),
            Receipt::Measured(_) => Some("measured"),
            Receipt::Parameter(..) => Some("parameter"),
        }
    }
}

fn known(name: &str) -> PyResult<&'static Protocol> {
    protocol(name).ok_or_else(|| PyValueError::new_err(format!("no protocol `{name}`")))
}

/// Variants of a protocol, and of each the least and greatest identifier that its motors may have;
/// an empty list for a protocol whose motors cannot be asked.
#[pyfunction]
pub(crate) fn candidates(protocol: &str) -> PyResult<Vec<(&'static str, i64, i64)>> {
    let protocol = known(protocol)?;
    let words = variants(protocol);
    let words = if words.is_empty() { &[""] } else { words };
    let of =
        |word: &&'static str| identifiers(protocol, word).map(|(least, most)| (*word, least, most));
    Ok(words.iter().filter_map(of).collect())
}
