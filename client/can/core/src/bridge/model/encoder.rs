//! An encoder in addition to those of the motors.

use crate::config::EncoderConfig;
use crate::state::state;

/// An encoder and its last report.
#[derive(Debug)]
pub(super) struct Encoder {
    pub(super) config: EncoderConfig,
    /// Index of its joint in q.
    pub(super) place: usize,
    /// The mechanism of its joint.
    pub(super) mechanism: usize,
    pub(super) position: f64,
    pub(super) measured_ns: Option<u64>,
    pub(super) contradictions: u32,
}

state!(Encoder { position, measured_ns, contradictions; config, place, mechanism });
