//! The report of an assembly: the pose that was found, and the numbers to write into the files.

use sarrus_dynamics::description::Placement;
use sarrus_dynamics::{AssembleError, Assembled};
use serde::{Serialize, Serializer};

use crate::rewrite::NewZero;

/// The result of an assembly.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AssemblyReport {
    /// The reason why there is no closed pose; `q` is then the nearest one found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The pose by coordinate.
    #[serde(serialize_with = "by_name")]
    pub q: Vec<Moved>,
    /// Largest scaled loop residual.
    pub residual: f64,
    /// Largest scaled loop residual at the given pose.
    pub residual_before: f64,
    /// Weighted distance from the given pose.
    pub distance: f64,
    /// Steps taken.
    pub iterations: u32,
    /// Branch of each cluster with loops that is not a pure coupling; empty for files that are open
    /// at zero.
    pub branch: Vec<f64>,
    /// For files that are open at zero: placements that make the found pose the zero pose.
    #[serde(skip_serializing_if = "NewPlacements::is_empty")]
    pub new_zero: NewPlacements,
    /// For the same files, if the joints are correct: placements that coincide at the present zero
    /// pose.
    #[serde(skip_serializing_if = "NewPlacements::is_empty")]
    pub at_zero: NewPlacements,
    /// The robot as loaded, and with the found pose as its zero pose; none without one.
    #[serde(skip)]
    pub zero: Option<Box<NewZero>>,
    /// The files that were written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub written: Vec<String>,
}

/// One coordinate of the pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Its name.
    pub name: String,
    /// Its given value.
    pub given: f64,
    /// Its value.
    pub found: f64,
}

/// Numbers to write into the files.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NewPlacements {
    /// Origins of joints, by name.
    #[serde(serialize_with = "placements")]
    pub origins: Vec<(String, Placement)>,
    /// Predecessor's placements, by submechanism and cut joint.
    #[serde(serialize_with = "placements")]
    pub predecessors: Vec<(String, Placement)>,
    /// Successor's placements, by the same.
    #[serde(serialize_with = "placements")]
    pub successors: Vec<(String, Placement)>,
}

impl NewPlacements {
    /// True if there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty() && self.predecessors.is_empty() && self.successors.is_empty()
    }
}

fn by_name<S: Serializer>(q: &[Moved], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(q.iter().map(|of| (&of.name, of.found)))
}

fn placements<S: Serializer>(of: &[(String, Placement)], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Written {
        xyz: [f64; 3],
        rpy: [f64; 3],
    }
    let written = |of: &Placement| Written { xyz: of.xyz, rpy: of.rpy };
    serializer.collect_map(of.iter().map(|(name, placement)| (name, written(placement))))
}

impl AssemblyReport {
    pub(crate) fn new(
        names: &[String],
        near: &[f64],
        found: Result<Assembled, AssembleError>,
    ) -> AssemblyReport {
        let error = found.as_ref().err().map(ToString::to_string);
        let none = Assembled {
            q: near.to_vec(),
            residual: f64::NAN,
            residual_before: f64::NAN,
            distance: f64::NAN,
            iterations: 0,
            branch: Vec::new(),
        };
        let found = match found {
            Ok(found) => found,
            Err(
                AssembleError::Unreachable { residual, nearest }
                | AssembleError::NotConverged { residual, nearest, .. },
            ) => Assembled { q: nearest, residual, ..none },
            Err(_) => none,
        };
        let moved = |((name, given), found): ((&String, &f64), &f64)| Moved {
            name: name.clone(),
            given: *given,
            found: *found,
        };
        AssemblyReport {
            error,
            q: names.iter().zip(near).zip(&found.q).map(moved).collect(),
            residual: found.residual,
            residual_before: found.residual_before,
            distance: found.distance,
            iterations: found.iterations,
            branch: found.branch,
            ..AssemblyReport::default()
        }
    }
}
