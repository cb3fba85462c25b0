//! Encoders in addition to those of the motors: compares each one's joint position with the solved
//! pose.

use sarrus_proto::actuators::Reason;

use super::RobotModel;
use super::assessed::Assessed;
use crate::config::{Configuration, EncoderConfig};
use crate::frame::Frame;
use crate::state::state;

/// Contradictory assessments after which the encoder is a fault.
const CONTRADICTIONS: u32 = 2;

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

impl RobotModel {
    /// The encoders of a configuration on joints of mechanisms. Allocates.
    pub(super) fn add_encoders(&mut self, configuration: &Configuration) {
        let model = self.evaluator.model.clone();
        for config in &configuration.encoders {
            let of = |names: &[String]| names.iter().position(|name| *name == config.joint);
            let rows = of(model.tree_names()).zip(of(model.tree_q_names()));
            let found = rows.and_then(|(row, place)| {
                let is_of = |Assessed { linkage, .. }: &Assessed| {
                    linkage.joints.contains(&row) || linkage.rows.contains(&row)
                };
                self.mechanisms.iter().position(is_of).map(|mechanism| (place, mechanism))
            });
            if let Some((place, mechanism)) = found {
                self.encoders.push(Encoder {
                    config: config.clone(),
                    place,
                    mechanism,
                    position: f64::NAN,
                    measured_ns: None,
                    contradictions: 0,
                });
            }
        }
    }

    /// Takes a frame; false if it belongs to no encoder.
    pub(in crate::bridge) fn receive(&mut self, now_ns: u64, bus: usize, frame: &Frame) -> bool {
        let is_meant =
            |encoder: &&mut Encoder| (encoder.config.bus, encoder.config.id) == (bus, frame.id);
        let Some(encoder) = self.encoders.iter_mut().find(is_meant) else { return false };
        if let Some(position) = encoder.config.position(frame.data()) {
            (encoder.position, encoder.measured_ns) = (position, Some(now_ns));
        }
        true
    }

    /// Compares the encoders with the last pose.
    pub(super) fn compare_encoders(&mut self, now_ns: u64) {
        for e in 0..self.encoders.len() {
            let is_known = self.is_known(self.encoders[e].mechanism);
            let encoder = &mut self.encoders[e];
            let residual = (self.pose.q[encoder.place] - encoder.position).abs();
            let is_beyond = is_known && residual > encoder.config.margin;
            encoder.contradictions = if is_beyond { encoder.contradictions + 1 } else { 0 };
            let number = encoder.mechanism;
            let reason = self.of_encoder(e, now_ns);
            let fault = &mut self.mechanisms[number].fault;
            if *fault == Reason::None {
                *fault = reason.unwrap_or(Reason::None);
            }
        }
    }

    /// The reason for which the encoders contradict a mechanism.
    pub(super) fn of_encoders(&self, number: usize, now_ns: u64) -> Option<Reason> {
        (0..self.encoders.len())
            .filter(|e| self.encoders[*e].mechanism == number)
            .find_map(|e| self.of_encoder(e, now_ns))
    }

    fn of_encoder(&self, e: usize, now_ns: u64) -> Option<Reason> {
        let encoder = &self.encoders[e];
        let is_old = |at: u64| now_ns.saturating_sub(at) > self.feedback_ns;
        if encoder.measured_ns.is_none_or(is_old) {
            Some(Reason::FeedbackStale)
        } else {
            (encoder.contradictions >= CONTRADICTIONS).then_some(Reason::LoopResidual)
        }
    }
}

state!(Encoder { position, measured_ns, contradictions; config, place, mechanism });
