//! What `check` prints about a robot.

use serde::Serialize;

use crate::assembly::AssemblyReport;
use crate::closures;
use crate::load::{LoadError, Loaded};
use crate::report::{Diagnostic, Report};

/// One robot as `check --format json` prints it. Of a faulty robot only the name, as far as it was
/// read, and the diagnostics are there.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckReport {
    /// Name of the robot.
    pub robot: Option<String>,
    /// Fingerprint of the model, 16 hexadecimal digits.
    pub fingerprint: Option<String>,
    /// Names in the order of q̇.
    pub tree: Vec<String>,
    /// Names in the order of q; a quaternion joint has one more.
    pub tree_q: Vec<String>,
    /// Names in the order of ẏ.
    pub independent: Vec<String>,
    /// Names in the order of u.
    pub active: Vec<String>,
    /// Names of the rows of K.
    pub loops: Vec<String>,
    /// How each submechanism is closed.
    pub closures: Vec<ClosureReport>,
    /// What may stay.
    pub warnings: Vec<Diagnostic>,
    /// What must be mended.
    pub errors: Vec<Diagnostic>,
    /// What came of an assembly, if one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assembled: Option<AssemblyReport>,
}

/// How a submechanism is closed.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ClosureReport {
    /// Contextual name.
    pub name: String,
    /// The type as it was written.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `analytic`, `numerical` or `serial`.
    pub kind: &'static str,
    /// Constraint rows.
    pub rows: usize,
    /// How many of them are independent.
    pub rank: usize,
    /// How far the geometry is from the closed form's assumptions, relative to the mechanism's
    /// size.
    pub misfit: f64,
    /// Rows that say nothing new.
    pub redundant: Vec<String>,
    /// Idle joints, which keep the value that they start with.
    pub idle: Vec<String>,
    /// Branch of each of its clusters at the zero pose, 1 or −1; 0 where that is singular.
    pub branch: Vec<f64>,
    /// Least singular value of the scaled K_d at the zero pose; 1 without loops.
    pub sigma_min: f64,
    /// Condition number of the scaled K_d at the zero pose; `null` where that is singular.
    #[serde(rename = "cond_Kd", serialize_with = "finite")]
    pub cond: f64,
    /// Where a closure of this type is singular, in words; empty where nothing general can be said.
    pub singular: &'static str,
}

/// A number, or null for what JSON has no word for.
fn finite<S: serde::Serializer>(number: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    number.is_finite().then_some(number).serialize(serializer)
}

impl CheckReport {
    /// The report of a robot that loaded, or of one whose files are faulty.
    ///
    /// # Errors
    /// Sources that cannot be read at all have no report.
    pub fn new(loaded: &Result<Loaded, LoadError>) -> Result<CheckReport, LoadError> {
        match loaded {
            Ok(loaded) => Ok(CheckReport::of_model(loaded)),
            Err(LoadError::Faults(report)) => Ok(CheckReport::of_diagnostics(report)),
            Err(other) => Err(other.clone()),
        }
    }

    fn of_diagnostics(report: &Report) -> CheckReport {
        CheckReport {
            robot: report.robot.clone(),
            warnings: report.warnings.clone(),
            errors: report.errors.clone(),
            ..CheckReport::default()
        }
    }

    fn of_model(loaded: &Loaded) -> CheckReport {
        let model = &loaded.compiled.model;
        let at_zero = model.closures_at_zero();
        let kinds = loaded.description.submechanisms.iter().map(|of| of.kind);
        let closures =
            model.closures().iter().zip(at_zero).zip(kinds).map(|((info, at_zero), kind)| {
                ClosureReport {
                    name: info.name.clone(),
                    type_name: info.type_name.clone(),
                    kind: info.kind.name(),
                    rows: info.rows,
                    rank: info.rank,
                    misfit: info.misfit,
                    redundant: at_zero.redundant,
                    idle: info.idle.clone(),
                    branch: at_zero.branch,
                    sigma_min: at_zero.sigma_min,
                    cond: at_zero.cond_Kd,
                    singular: closures::singular(kind),
                }
            });
        CheckReport {
            robot: Some(model.name().to_owned()),
            fingerprint: Some(format!("{:016x}", model.fingerprint())),
            tree: model.tree_names().to_vec(),
            tree_q: model.tree_q_names().to_vec(),
            independent: model.independent_names().to_vec(),
            active: model.active_names().to_vec(),
            loops: model.loop_names().to_vec(),
            closures: closures.collect(),
            ..CheckReport::of_diagnostics(&loaded.report)
        }
    }
}
