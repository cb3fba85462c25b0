//! Offsets of encoders and geometry from redundant encoders.
//!
//! Encoders measure the independents and some dependents. With y the true independents, θ the
//! geometry, o the offsets and n noise of equal size on all encoders, in radians or lengths of the
//! mechanism:
//!
//! ```text
//!   y_measured = y + o_y + n        z_measured = q_z(y, θ) + o_z + n
//! ```
//! Gauss-Newton steps with ∂q/∂θ (`dgamma_dtheta`) and ∂q/∂y (G); in each row of the log the error
//! of y is an unknown of its own, which is eliminated before the row is added to the others. After
//! a step the displaced robot is closed again at y = 0 and compiled.

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{
    Field, FieldSet, Model, OpenModel, Planned, Query, Request, displaced, rezeroed,
};
use serde_json::{Map, Value, json};

use crate::dense::Triangle;
use crate::estimate::{answered, left_over, solved};
use crate::{IdentifyError, Outcome};

/// Part of its length that a column adds to those before it from which on it is estimated.
const IDENTIFIABLE: f64 = 1e-3;
/// Noise of encoders, in radians or lengths of the robot, that no encoder has.
const FAR: f64 = 0.1;
/// Part of the largest column below which a column is rounding.
const ROUNDING: f64 = 1e-9;
/// Gauss-Newton steps.
const STEPS: usize = 5;

/// An offset of an encoder, JOINT/offset, or a number of the geometry.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// Its name.
    pub name: String,
    /// Estimate `[m, rad]`: the difference from the description.
    pub value: f64,
    /// Standard error; `None` where it is not identifiable beside those before it.
    pub standard_error: Option<f64>,
}

/// The result of [`calibrate`].
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Offsets, then the geometry in the order of `ModelInfo::geometry`.
    pub parameters: Vec<Calibrated>,
    /// Standard deviation of an encoder `[rad]`, or in lengths of the mechanism: of the description
    /// and of the estimate.
    pub noise: [f64; 2],
    /// The robot with the new geometry, closed at y = 0. Offsets count from its zero pose.
    pub description: Description,
}

impl Calibration {
    /// As JSON: `noise` with `model` and `fitted`; `parameters` with `value` and `standard_error`,
    /// null where they are not identifiable.
    pub fn to_json(&self) -> Value {
        let [model, fitted] = self.noise;
        let of = |x: &Calibrated| {
            let of = json!({ "value": x.value, "standard_error": x.standard_error });
            (x.name.clone(), of)
        };
        json!({
            "noise": { "model": model, "fitted": fitted },
            "parameters": self.parameters.iter().map(of).collect::<Map<String, Value>>(),
        })
    }
}

/// Estimates offsets of encoders and geometry. `heads` names a column for each independent joint
/// and for those dependent joints that have an encoder; other columns are ignored.
///
/// # Errors
///
/// A column that is missing, states without an answer, too few rows, a geometry that does not
/// close.
pub fn calibrate(
    description: &Description,
    heads: &[String],
    rows: &[Vec<f64>],
) -> Outcome<Calibration> {
    let mut robot = displaced(description, &[], &[]).unwrap_or_else(|| description.clone());
    for of in &mut robot.submechanisms {
        of.closed_forms = false;
        if !matches!(of.kind, Kind::Serial | Kind::Transmission | Kind::Differential) {
            of.kind = Kind::Numerical;
        }
    }
    let mut model = compiled(&robot)?;
    let encoders = Encoder::all(&model, heads)?;
    let names = model.info().geometry();
    let offsets = encoders.iter().map(|of| format!("{}/offset", of.name));
    let all: Vec<String> = offsets.chain(names.iter().cloned()).collect();
    let mut estimate = vec![0.0; all.len()];
    // zero poses of the encoders in the description
    let mut zero = vec![0.0; encoders.len()];
    let mut triangle = stacked(&model, &encoders, rows, &zero, &estimate)?;
    let before = left_over(&triangle, &vec![0.0; all.len()]);
    let accepted = identifiable(&triangle, all.len());
    let measured = (encoders.len() - model.sizes().n_vy) * rows.len();
    if measured <= accepted.len() {
        return Err(IdentifyError::Short { rows: measured, parameters: accepted.len() });
    }
    for _ in 0..STEPS {
        let step = solved(&triangle, &accepted, &vec![0.0; all.len()]);
        estimate.iter_mut().zip(&step).for_each(|(x, by)| *x += by);
        let (next, at_zero) =
            closed(&robot, (&names, model.independent_names()), &step[encoders.len()..])?;
        model = compiled(&next)?;
        robot = next;
        zero.iter_mut().zip(&encoders).for_each(|(x, of)| *x += at_zero[of.q]);
        triangle = stacked(&model, &encoders, rows, &zero, &estimate)?;
    }
    let noise = left_over(&triangle, &vec![0.0; all.len()]);
    let freedoms = (measured - accepted.len()) as f64;
    let deviation = noise / freedoms.sqrt();
    if deviation > FAR {
        return Err(IdentifyError::Unexplained);
    }
    let mut errors = vec![None; all.len()];
    let deviations = triangle.of_columns(&accepted).deviations();
    accepted.iter().zip(deviations).for_each(|(j, x)| errors[*j] = Some(x * deviation));
    let parameters = all.into_iter().zip(estimate).zip(errors);
    Ok(Calibration {
        parameters: parameters
            .map(|((name, value), standard_error)| Calibrated { name, value, standard_error })
            .collect(),
        noise: [before / (measured as f64).sqrt(), deviation],
        description: robot,
    })
}

/// A joint with an encoder: its places in q and in q̇, its column in the log, and its unit.
struct Encoder {
    name: String,
    q: usize,
    v: usize,
    column: usize,
    unit: f64,
}

impl Encoder {
    fn all(model: &Model<f64>, heads: &[String]) -> Outcome<Vec<Encoder>> {
        let place = |list: &[String], name: &String| list.iter().position(|x| x == name);
        let units = model.tree_units();
        let joints = model.tree_names().iter().enumerate();
        let of = |(v, name): (usize, &String)| {
            let q = place(model.tree_q_names(), name)?;
            let column = place(heads, name)?;
            Some(Encoder { name: name.clone(), q, v, column, unit: units[v] })
        };
        let all: Vec<Encoder> = joints.filter_map(of).collect();
        let independents = model.independent_q_names();
        let is_there = |name: &String| all.iter().any(|of| of.name == *name);
        if all.len() > independents.len() && independents.iter().all(is_there) {
            return Ok(all);
        }
        let [found, joints] = [heads, independents].map(|names| names.join(", "));
        let words = format!("found the columns {found}, expected {joints} and dependent joints");
        Err(IdentifyError::Log(words))
    }
}

fn compiled(robot: &Description) -> Outcome<Model<f64>> {
    Model::compile(robot).map(|compiled| compiled.model).map_err(IdentifyError::geometry)
}

/// The rows of all encoders: columns of offsets and geometry, and what is left over.
fn stacked(
    model: &Model<f64>,
    encoders: &[Encoder],
    rows: &[Vec<f64>],
    zero: &[f64],
    estimate: &[f64],
) -> Outcome<Triangle> {
    let n = model.sizes().n_vy;
    let want = FieldSet::of(&[Field::Q, Field::G, Field::DgammaDtheta]);
    let mut planned = Planned::new(model, &Query::new(Request::Kinematics, Field::Y.into(), want))?;
    let width = model.sizes().n_geometry();
    let mut all = Triangle::new(encoders.len() + width + 1);
    for (k, row) in rows.iter().enumerate() {
        let measured = |(e, of): (usize, &Encoder)| row[of.column] - zero[e] - estimate[e];
        let of_y = |name: &String| {
            let encoder = encoders.iter().enumerate().find(|(_, of)| of.name == *name);
            encoder.map_or(0.0, measured)
        };
        let y: Vec<f64> = model.independent_q_names().iter().map(of_y).collect();
        planned.give(Field::Y, &y);
        answered(planned.run(model).status, k)?;
        // errors of y first
        let mut own = Triangle::new(n + all.n);
        for (e, of) in encoders.iter().enumerate() {
            let mut line = planned.get(Field::G)[of.v * n..][..n].to_vec();
            line.extend((0..encoders.len()).map(|i| f64::from(u8::from(i == e))));
            line.extend_from_slice(&planned.get(Field::DgammaDtheta)[of.v * width..][..width]);
            line.push(measured((e, of)) - planned.get(Field::Q)[of.q]);
            line.iter_mut().for_each(|x| *x /= of.unit);
            own.add(&mut line);
        }
        (n..encoders.len()).for_each(|i| all.add(&mut own.row(i)[n..].to_vec()));
    }
    Ok(all)
}

/// The columns that add to those before them.
fn identifiable(all: &Triangle, n: usize) -> Vec<usize> {
    let norms = all.norms();
    let most = norms[..n].iter().copied().fold(0.0, f64::max);
    let mut accepted = Vec::new();
    for j in (0..n).filter(|j| norms[*j] > ROUNDING * most) {
        accepted.push(j);
        let last = accepted.len() - 1;
        if all.of_columns(&accepted).row(last)[last].abs() < IDENTIFIABLE * norms[j] {
            accepted.pop();
        }
    }
    accepted
}

/// The displaced robot, closed at y = 0, and its coordinates there before.
fn closed(
    robot: &Description,
    (names, held): (&[String], &[String]),
    theta: &[f64],
) -> Outcome<(Description, Vec<f64>)> {
    let other = || IdentifyError::geometry("its parts have other names");
    let moved = displaced(robot, names, theta).ok_or_else(other)?;
    let open = OpenModel::compile(&moved).map_err(IdentifyError::geometry)?;
    let weight = |name| if held.contains(name) { f64::INFINITY } else { 1.0 };
    let weights: Vec<f64> = open.tree_names().iter().map(weight).collect();
    let q = open.assemble(&open.tree_zero(), &weights).map_err(IdentifyError::geometry)?.q;
    rezeroed(&moved, &q).map(|robot| (robot, q)).ok_or_else(other)
}
