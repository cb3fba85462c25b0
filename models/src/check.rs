//! The report of `check` about a robot.

use sarrus_dynamics::description::{Joint, Submechanism, Terms};
use sarrus_dynamics::{Bound, ClosureInfo, ModelInfo, Part};
use serde::Serialize;
use serde::ser::{SerializeStruct, Serializer};

use crate::assembly_report::AssemblyReport;
use crate::closures;
use crate::dimensions::Dimensions;
use crate::error::{LoadError, Outcome};
use crate::load::Loaded;
use crate::report::{Diagnostic, Diagnostics, Report};

/// One robot as `check --format json` prints it. A faulty robot has only its name, if it was read,
/// and the diagnostics.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CheckReport {
    /// Name of the robot.
    pub robot: Option<String>,
    /// Fingerprint of the model, 16 hexadecimal digits.
    pub fingerprint: Option<String>,
    /// Names, orders and sizes; none for a faulty robot.
    #[serde(flatten, serialize_with = "names")]
    pub model: Option<ModelInfo>,
    /// How each submechanism is closed.
    pub closures: Vec<ClosureReport>,
    /// The bound on the work of a request.
    #[serde(serialize_with = "steps_and_time")]
    pub bound: Option<Bound>,
    /// The motors that `actuators:` describes.
    pub actuators: Vec<ActuatorReport>,
    /// Dimensions that follow from the files.
    pub dimensions: Option<Dimensions>,
    /// Warnings.
    pub warnings: Vec<Diagnostic>,
    /// Faults to correct.
    pub errors: Vec<Diagnostic>,
    /// The result of an assembly, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assembled: Option<AssemblyReport>,
}

/// A motor at its joint by the keys of `actuators:`; `null` where nothing limits it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
#[allow(missing_docs)]
pub struct ActuatorReport {
    pub joint: String,
    pub peak_torque: Option<f64>,
    pub continuous_torque: Option<f64>,
    pub thermal_time: Option<f64>,
    pub series_stiffness: Option<f64>,
    pub max_speed: Option<f64>,
    pub torque_speed: Vec<[f64; 2]>,
    pub braking_torque_speed: Vec<[f64; 2]>,
    pub power: Option<f64>,
    pub rotor_inertia: f64,
    pub gear_ratio: f64,
    pub efficiency: [f64; 2],
}

impl ActuatorReport {
    fn of(joint: &Joint) -> Option<ActuatorReport> {
        let motor = joint.motor.as_ref()?;
        let of = |limit: f64| limit.is_finite().then_some(limit);
        let Terms { rotor_inertia, gear_ratio, .. } = joint.terms;
        Some(ActuatorReport {
            joint: joint.name.clone(),
            peak_torque: joint.limits.and_then(|limits| of(limits.effort)),
            continuous_torque: of(motor.continuous),
            thermal_time: of(motor.thermal_time),
            series_stiffness: of(motor.series_stiffness),
            max_speed: joint.limits.and_then(|limits| of(limits.velocity)),
            torque_speed: motor.driving.clone(),
            braking_torque_speed: motor.braking.clone(),
            power: of(motor.power),
            rotor_inertia,
            gear_ratio,
            efficiency: motor.efficiency,
        })
    }
}

/// How a submechanism is closed, and its closure at the zero pose.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClosureReport {
    /// Type, kind, rows and misfit.
    pub closure: ClosureInfo,
    /// Rows that the others imply.
    pub redundant: Vec<String>,
    /// Branch of each of its clusters at the zero pose, 1 or −1; 0 where that is singular.
    pub branch: Vec<f64>,
    /// Least singular value of the scaled K_d at the zero pose; 1 without loops.
    pub sigma_min: f64,
    /// Condition number of the scaled K_d at the zero pose; `null` where that is singular.
    pub cond: f64,
    /// The singular poses of closures of this type, in words; empty if there is no general rule.
    pub singular: &'static str,
    /// Cells of the table of closed poses where a numerical closure starts without a guess, and
    /// its size `[B]`; 0 without one. Equal limbs share one table.
    pub seeds: (usize, usize),
    /// The parts in which it is closed, in the order of solution.
    pub parts: Vec<Part>,
}

/// The names of a model, or none.
fn names<S: Serializer>(model: &Option<ModelInfo>, serializer: S) -> Result<S::Ok, S::Error> {
    let names = |of: fn(&ModelInfo) -> &[String]| model.as_ref().map_or(&[][..], of);
    serializer.collect_map([
        ("tree", names(|model| &model.tree)),
        ("tree_q", names(|model| &model.tree_q)),
        ("independent", names(|model| &model.independent)),
        ("active", names(|model| &model.active)),
        ("loops", names(|model| &model.loops)),
    ])
}

fn steps_and_time<S: Serializer>(bound: &Option<Bound>, to: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Written {
        steps: u32,
        ns: f64,
    }
    bound.map(|Bound { steps, ns }| Written { steps, ns: ns.round() }).serialize(to)
}

impl Serialize for ClosureReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written<'a> {
            method: &'a str,
            rows: usize,
            joints: &'a [String],
        }
        let ClosureReport { closure, redundant, branch, sigma_min, cond, .. } = self;
        let ClosureReport { singular, seeds, parts, .. } = self;
        let ClosureInfo { name, type_name, kind, rows, rank, idle, length: _, misfit } = closure;
        let parts =
            parts.iter().map(|of| Written { method: of.method, rows: of.rows, joints: &of.joints });
        let mut object = serializer.serialize_struct("ClosureReport", 15)?;
        object.serialize_field("name", name)?;
        object.serialize_field("type", type_name)?;
        object.serialize_field("kind", kind.name())?;
        object.serialize_field("rows", rows)?;
        object.serialize_field("rank", rank)?;
        object.serialize_field("misfit", misfit)?;
        object.serialize_field("redundant", redundant)?;
        object.serialize_field("idle", idle)?;
        object.serialize_field("branch", branch)?;
        object.serialize_field("sigma_min", sigma_min)?;
        // JSON cannot express infinity
        object.serialize_field("cond_Kd", &cond.is_finite().then_some(cond))?;
        object.serialize_field("singular", singular)?;
        object.serialize_field("seed_cells", &seeds.0)?;
        object.serialize_field("seed_bytes", &seeds.1)?;
        object.serialize_field("parts", &parts.collect::<Vec<_>>())?;
        object.end()
    }
}

impl CheckReport {
    /// The report of a robot that loaded, or of one whose files are faulty.
    ///
    /// # Errors
    /// Sources that cannot be read at all have no report.
    pub fn new(loaded: &Outcome<Loaded>) -> Outcome<CheckReport> {
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
        let description = &loaded.description;
        // joints without rows are closed by nothing
        let serial = |of: &Submechanism| Part {
            method: "serial",
            rows: 0,
            joints: of.spanning_tree.iter().map(|j| description.joints[*j].name.clone()).collect(),
        };
        let closures = model.closures().iter().zip(at_zero).zip(&description.submechanisms).map(
            |((info, at_zero), of)| ClosureReport {
                closure: info.clone(),
                redundant: at_zero.redundant,
                branch: at_zero.branch,
                sigma_min: at_zero.sigma_min,
                cond: at_zero.cond_Kd,
                singular: closures::singular(of.kind),
                seeds: at_zero.seeds,
                parts: if info.rows == 0 { vec![serial(of)] } else { at_zero.parts },
            },
        );
        let mut found = Diagnostics::new(false);
        loaded.files.iter().for_each(|file| _ = found.add_file(file));
        let dimensions = Dimensions::new(&loaded.description, model, &loaded.spans, &mut found);
        let mut report = loaded.report.clone();
        report.warnings.extend(found.into_report().warnings);
        CheckReport {
            robot: Some(model.name().to_owned()),
            fingerprint: Some(format!("{:016x}", model.fingerprint())),
            model: Some(model.info().clone()),
            closures: closures.collect(),
            bound: Some(model.bound()),
            actuators: description.joints.iter().filter_map(ActuatorReport::of).collect(),
            dimensions: Some(dimensions),
            ..CheckReport::of_diagnostics(&report)
        }
    }
}
