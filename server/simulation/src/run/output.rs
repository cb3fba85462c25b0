//! The results of a simulation.

use sarrus_dynamics::Status;

use super::events::Event;
use crate::coordinates::pick;
use crate::motion::energy::Energy;
use crate::motion::engine::Counts;

/// The robot at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Time `[s]`.
    pub time: f64,
    /// Coordinates that were declared independent at the start (n_qy).
    pub y: Vec<f64>,
    /// Their velocities (n_vy).
    pub yd: Vec<f64>,
    /// Tree coordinates (n_q).
    pub q: Vec<f64>,
    /// Tree velocities (n_v).
    pub qd: Vec<f64>,
    /// Position of each elastic motor in the coordinate of its joint.
    pub theta: Vec<f64>,
    /// Energies, those of springs between links and in actuators among them, and the loops'
    /// residual.
    pub energy: Energy,
    /// Work of inputs less losses of dampers since the start `[J]`.
    pub work: f64,
}

impl Sample {
    /// Its numbers, by the names that scripts see.
    pub const FIGURES: [(&'static str, fn(&Sample) -> f64); 5] = [
        ("time", |sample| sample.time),
        ("kinetic", |sample| sample.energy.kinetic),
        ("potential", |sample| sample.energy.potential),
        ("work", |sample| sample.work),
        ("residual", |sample| sample.energy.residual),
    ];
    /// Its coordinates and velocities, by the names that scripts see.
    pub const STATES: [(&'static str, fn(&Sample) -> &[f64]); 4] = [
        ("y", |sample| &sample.y),
        ("yd", |sample| &sample.yd),
        ("q", |sample| &sample.q),
        ("qd", |sample| &sample.qd),
    ];

    /// The sample of a tree state without its energy; the declared independents stand at these
    /// places in q and q̇.
    pub(crate) fn new(
        time: f64,
        [q, qd]: [&[f64]; 2],
        [y, yd]: &[Vec<usize>; 2],
        work: Option<&f64>,
    ) -> Sample {
        Sample {
            time,
            y: pick(q, y),
            yd: pick(qd, yd),
            q: q.to_vec(),
            qd: qd.to_vec(),
            theta: Vec::new(),
            energy: Energy::default(),
            work: work.copied().unwrap_or(0.0),
        }
    }

    /// Energy less work: constant but for errors.
    pub fn balance(&self) -> f64 {
        self.energy.kinetic + self.energy.potential - self.work
    }
}

/// How a simulation ended.
#[derive(Default, Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum End {
    /// At the end of its time.
    #[default]
    Finished,
    /// Ahead lies a state without an answer.
    Failed(Status),
    /// The error could not be kept within the tolerances by any step.
    StepTooShort,
    /// More steps than were allowed.
    TooManySteps,
}

impl End {
    /// True where the whole time was simulated.
    pub fn is_finished(self) -> bool {
        self == End::Finished
    }

    /// The name that scripts see.
    pub fn name(self) -> &'static str {
        match self {
            End::Finished => "finished",
            End::Failed(status) => status.name(),
            End::StepTooShort => "step_too_short",
            End::TooManySteps => "too_many_steps",
        }
    }
}

/// A simulation that has ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// Samples, the first at the start, the last at the last good state.
    pub samples: Vec<Sample>,
    /// Events on the way.
    pub events: Vec<Event>,
    /// Counts of steps and evaluations.
    pub counts: Counts,
    /// How it ended.
    pub end: End,
    /// When it ended `[s]`.
    pub time: f64,
    /// How far the given start had to be moved to close the loops: largest change of a coordinate
    /// and of a velocity.
    pub correction: [f64; 2],
    /// Names of the independents at the end.
    pub independents: Vec<String>,
    /// Actuators with a spring between motor and joint.
    pub elastic: Vec<String>,
    /// Estimate of the largest error of y and of ẏ at the end, where it was asked for.
    pub error_estimate: Option<[f64; 2]>,
}

impl Run {
    /// Largest change of energy less work, as a share of the largest kinetic or change of potential
    /// energy.
    pub fn drift(&self) -> f64 {
        let Some(first) = self.samples.first() else { return 0.0 };
        let over = |f: &dyn Fn(&Sample) -> f64| {
            self.samples.iter().map(f).fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) })
        };
        let change = over(&|x| (x.balance() - first.balance()).abs());
        let size =
            over(&|x| x.energy.kinetic.max((x.energy.potential - first.energy.potential).abs()));
        if change == 0.0 { 0.0 } else { change / size }
    }

    /// Largest residual of the loops.
    pub fn residual(&self) -> f64 {
        self.samples.iter().map(|sample| sample.energy.residual).fold(0.0, f64::max)
    }

    /// The last sample.
    pub fn last(&self) -> Option<&Sample> {
        self.samples.last()
    }
}
