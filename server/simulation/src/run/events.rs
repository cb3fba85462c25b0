//! Events of a run.

use sarrus_dynamics::Status;

/// Something remarkable on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When `[s]`.
    pub time: f64,
    /// Its kind.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EventKind {
    /// The simulation went on with other independents.
    Switched {
        /// The independents before.
        from: Vec<String>,
        /// The independents after.
        to: Vec<String>,
        /// Distance to singularity before.
        before: f64,
        /// Distance to singularity after.
        after: f64,
    },
    /// Other independents are better, but the robot cannot be compiled with them or its state not
    /// taken over.
    NotSwitched {
        /// Which.
        to: Vec<String>,
        /// Why.
        why: String,
    },
    /// A step was taken back because the right-hand side had no answer on its way; a shorter one
    /// had. Holds the status of the one taken back.
    Shortened(Status),
    /// The simulation ended near a singularity, at this distance.
    NearSingular(f64),
    /// The actuator of this joint came to its limits.
    Limited(String),
    /// The joint of this name came to its stop.
    Stopped(String),
    /// The problem is stiff for an explicit method.
    Stiff,
}
