//! Estimates from a log.

use sarrus_dynamics::description::{Description, Inertial, JointKind};
use sarrus_dynamics::{Base, Model, Status, base_parameters};
use serde_json::{Map, Value, json};

use crate::dense::{Triangle, dot};
use crate::inertia::{Near, inertial, parameters};
use crate::log::Log;
use crate::stack::Stack;
use crate::{IdentifyError, Outcome};

/// Part that a scaled column adds to the others below which the motion does not excite it.
const EXCITED: f64 = 1e-7;
/// Parts of the motion, each of which is predicted from the others, and pieces of each.
const PARTS: usize = 5;
const PIECES: usize = 4;
/// Times that the noise of the actuators is estimated.
const PASSES: usize = 4;
/// Steps towards the nearest physical parameters, at most, and the change at which they end.
const STEPS: usize = 400;
const STILL: f64 = 1e-10;

/// A base parameter.
#[derive(Clone, Debug)]
pub struct BaseEstimate {
    /// Parameters in it with their factors, by their numbers; its own first.
    pub combination: Vec<(usize, f64)>,
    /// Value in the model.
    pub model: f64,
    /// Estimate; the model's value where the motion does not excite it.
    pub value: f64,
    /// Standard error; `None` where the motion does not excite it.
    pub standard_error: Option<f64>,
}

/// Root mean square of the forces that are left over, in units of their noise.
#[derive(Clone, Copy, Debug)]
pub struct Prediction {
    /// Of the model's parameters.
    pub model: f64,
    /// Of the base parameters, on the motion that they were estimated from.
    pub fitted: f64,
    /// Of each part of the motion by the base parameters of the other parts.
    pub held_out: f64,
    /// Of the physical parameters.
    pub physical: f64,
}

/// A link with a new inertia.
#[derive(Clone, Debug)]
pub struct LinkEstimate {
    /// Name of the link.
    pub name: String,
    /// Its inertia, in the axes that the description has.
    pub inertial: Inertial,
}

/// The result of [`identify`].
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Names of all parameters.
    pub names: Vec<String>,
    /// Base parameters.
    pub base: Vec<BaseEstimate>,
    /// 2-norm condition number of the excited base parameters' columns, scaled to length one.
    pub condition: f64,
    /// Standard deviation of each force that was measured.
    pub noise: Vec<f64>,
    /// Forces left over.
    pub prediction: Prediction,
    /// All parameters: the nearest physical ones.
    pub parameters: Vec<f64>,
    /// Links whose inertia is part of the estimate.
    pub links: Vec<LinkEstimate>,
}

impl Estimate {
    /// As JSON: `condition`, `noise`, `prediction`; `base` with `combination`, `model`, `value` and
    /// `standard_error`, null where the motion does not excite it; `parameters` and `links`.
    pub fn to_json(&self) -> Value {
        let Prediction { model, fitted, held_out, physical } = self.prediction;
        let base = self.base.iter().map(|of| {
            let parts = of.combination.iter();
            let parts: Map<String, Value> =
                parts.map(|(j, x)| (self.names[*j].clone(), json!(x))).collect();
            json!({
                "combination": parts,
                "model": of.model,
                "value": of.value,
                "standard_error": of.standard_error,
            })
        });
        let links = self.links.iter().map(|link| {
            let Inertial { origin, mass, inertia } = link.inertial;
            let of = json!({
                "mass": mass, "xyz": origin.xyz, "rpy": origin.rpy, "inertia": inertia
            });
            (link.name.clone(), of)
        });
        let parameters = self.names.iter().cloned().zip(self.parameters.iter().map(|x| json!(x)));
        json!({
            "condition": self.condition,
            "noise": self.noise,
            "prediction": {
                "model": model, "fitted": fitted, "held_out": held_out, "physical": physical
            },
            "base": base.collect::<Vec<Value>>(),
            "parameters": parameters.collect::<Map<String, Value>>(),
            "links": links.collect::<Map<String, Value>>(),
        })
    }
}

/// Estimates the parameters of a robot from a motion.
///
/// # Errors
///
/// For states that have no answer and logs that are too short.
pub fn identify(description: &Description, model: &Model<f64>, log: &Log) -> Outcome<Estimate> {
    let base = base_parameters(model)?;
    let mut stack = Stack::new(model)?;
    let n = base.columns.len();
    let n_rows = stack.n_rows();
    let rows = n_rows * log.samples.len();
    if rows < 2 * n {
        return Err(IdentifyError::Short { rows, parameters: n });
    }
    let of_model = base.of(&model.parameters());
    // without weights first; errors by large noise of one actuator are remainders of the others,
    // until the weights know it
    let mut noise = vec![1.0; n_rows];
    for _ in 0..PASSES {
        let all = joined(&triangles(&mut stack, &base, log, &noise)?);
        let (excited, _) = excited_columns(&all, n);
        let fit = solved(&all, &excited, &of_model);
        noise = remainders(&mut stack, &base, log, &fit, n)?;
    }
    let parts = triangles(&mut stack, &base, log, &noise)?;
    let all = joined(&parts);
    let (excited, condition) = excited_columns(&all, n);
    let values = solved(&all, &excited, &of_model);
    let size = |triangles: &[&Triangle], x: &[f64]| {
        let squares: f64 = triangles.iter().map(|part| left_over(part, x).powi(2)).sum();
        (squares / rows as f64).sqrt()
    };
    let mut held_out = 0.0;
    for k in 0..parts.len() {
        let others: Vec<Triangle> = parts
            .iter()
            .enumerate()
            .filter(|(i, _)| *i != k)
            .map(|(_, part)| part.clone())
            .collect();
        let others = joined(&others);
        let (excited, _) = excited_columns(&others, n);
        held_out += left_over(&parts[k], &solved(&others, &excited, &of_model)).powi(2);
    }
    let physical = physical(description, model, &base, &all);
    let fitted = size(&[&all], &values);
    // noise is divided by the rows, the estimate has taken as many as its parameters
    let deviation = fitted * (rows as f64 / (rows - excited.len()) as f64).sqrt();
    let mut errors = vec![None; n];
    let deviations = all.of_columns(&excited).deviations();
    for (k, error) in excited.iter().zip(deviations) {
        errors[*k] = Some(error * deviation);
    }
    let estimates = values.iter().zip(&of_model).zip(errors).enumerate();
    Ok(Estimate {
        names: model.info().parameters(),
        base: estimates
            .map(|(k, ((value, model), standard_error))| BaseEstimate {
                combination: base.combination(k),
                model: *model,
                value: *value,
                standard_error,
            })
            .collect(),
        condition,
        noise: noise.iter().map(|x| x * deviation).collect(),
        prediction: Prediction {
            model: size(&[&all], &of_model),
            fitted,
            held_out: (held_out / rows as f64).sqrt(),
            physical: size(&[&all], &base.of(&physical.parameters)),
        },
        parameters: physical.parameters,
        links: physical.links,
    })
}

/// The rows of each part of the motion, columns of base parameters and forces, divided by the
/// noise.
fn triangles(
    stack: &mut Stack<'_>,
    base: &Base,
    log: &Log,
    noise: &[f64],
) -> Outcome<Vec<Triangle>> {
    let n = base.columns.len();
    let mut parts = vec![Triangle::new(n + 1); PARTS];
    let mut line = vec![0.0; n + 1];
    for (k, sample) in log.samples.iter().enumerate() {
        answered(stack.at(sample), k)?;
        let part = &mut parts[k * PARTS * PIECES / log.samples.len() % PARTS];
        let forces = stack.explained(&sample.tau_u);
        for ((row, force), noise) in stack.rows().zip(forces).zip(noise) {
            line.iter_mut().zip(&base.columns).for_each(|(x, j)| *x = row[*j] / noise);
            line[n] = force / noise;
            part.add(&mut line);
        }
    }
    Ok(parts)
}

pub(crate) fn answered(status: Status, row: usize) -> Outcome {
    if status == Status::Ok { Ok(()) } else { Err(IdentifyError::Sample { row, status }) }
}

fn joined(parts: &[Triangle]) -> Triangle {
    let mut all = Triangle::new(parts.first().map_or(0, |part| part.n));
    parts.iter().for_each(|part| all.join(part));
    all
}

/// Root mean square of the remainder of each force.
fn remainders(
    stack: &mut Stack<'_>,
    base: &Base,
    log: &Log,
    values: &[f64],
    n: usize,
) -> Outcome<Vec<f64>> {
    let mut squares = vec![0.0; stack.n_rows()];
    let mut largest = 0.0;
    for (k, sample) in log.samples.iter().enumerate() {
        answered(stack.at(sample), k)?;
        let forces = stack.explained(&sample.tau_u);
        for ((square, row), force) in squares.iter_mut().zip(stack.rows()).zip(forces) {
            let found: f64 = (0..n).map(|k| row[base.columns[k]] * values[k]).sum();
            *square += (force - found) * (force - found);
            largest = f64::max(largest, force.abs());
        }
    }
    // without noise rounding is all there is
    let least = f64::max(1e-12 * largest, f64::MIN_POSITIVE);
    let count = log.samples.len() as f64;
    Ok(squares.into_iter().map(|x| (x / count).sqrt().max(least)).collect())
}

/// The columns that the rows tell apart, ascending, and their condition number.
fn excited_columns(all: &Triangle, n: usize) -> (Vec<usize>, f64) {
    let first: Vec<usize> = (0..n).collect();
    let order = all.of_columns(&first).pivots();
    let excited = order.iter().filter(|(_, part)| *part > EXCITED).map(|(j, _)| *j);
    let mut excited: Vec<usize> = excited.collect();
    excited.sort_unstable();
    let mut scaled = all.of_columns(&excited);
    let norms = scaled.norms();
    for row in scaled.R.chunks_exact_mut(norms.len().max(1)) {
        row.iter_mut().zip(&norms).for_each(|(x, norm)| *x /= norm);
    }
    let condition = if excited.is_empty() { 1.0 } else { scaled.condition() };
    (excited, condition)
}

/// Least squares over these columns; the other parameters keep their values.
pub(crate) fn solved(all: &Triangle, excited: &[usize], held: &[f64]) -> Vec<f64> {
    let n = held.len();
    let mut values = held.to_vec();
    let m = excited.len();
    let mut reduced = Triangle::new(m + 1);
    for row in all.R.chunks_exact(all.n) {
        let known: f64 = (0..n).filter(|j| !excited.contains(j)).map(|j| row[j] * held[j]).sum();
        let mut line: Vec<f64> = excited.iter().map(|j| row[*j]).collect();
        line.push(row[n] - known);
        reduced.add(&mut line);
    }
    let mut x: Vec<f64> = (0..m).map(|k| reduced.row(k)[m]).collect();
    reduced.solve(&mut x);
    excited.iter().zip(x).for_each(|(j, x)| values[*j] = x);
    values
}

/// 2-norm of the forces that these base parameters leave over.
pub(crate) fn left_over(all: &Triangle, values: &[f64]) -> f64 {
    let n = values.len();
    all.R
        .chunks_exact(all.n)
        .fold(0.0, |norm: f64, row| norm.hypot(dot(&row[..n], values) - row[n]))
}

struct Physical {
    parameters: Vec<f64>,
    links: Vec<LinkEstimate>,
}

/// Numbers that parameters depend on: ten of a body near the model's, or friction over its scale.
enum Free {
    Body { first: usize, link: usize, near: Box<Near>, others: [f64; 10] },
    Friction { column: usize, scale: f64 },
}

impl Free {
    fn width(&self) -> usize {
        if matches!(self, Free::Body { .. }) { 10 } else { 1 }
    }
}

/// The search for the parameters that leave the least over, with the square of their distance from
/// the model: a link that differs by as much as itself counts like a force that is off by its
/// noise.
struct Search {
    free: Vec<Free>,
    /// Rows of all parameters, R [1 map], and the forces that they have to give.
    rows: Vec<Vec<f64>>,
    forces: Vec<f64>,
    /// Parameters of the model.
    start: Vec<f64>,
}

/// The numbers that are free: links with mass and inertia, and friction.
fn free_numbers(description: &Description, model: &Model<f64>, values: &[f64]) -> Vec<Free> {
    let info = model.info();
    let bodies = 10 * info.sizes.n_bodies;
    let mut free = Vec::new();
    for (k, joint) in info.joints().enumerate() {
        let Some(described) = description.joints.iter().find(|x| x.name == joint.name) else {
            continue;
        };
        let link = described.child;
        if let Some(own) = description.links[link].inertial.as_ref().map(parameters)
            && let Some(near) = Near::new(&own)
        {
            let others = core::array::from_fn(|i| values[10 * k + i] - own[i]);
            free.push(Free::Body { first: 10 * k, link, near: Box::new(near), others });
        }
        if matches!(described.kind, JointKind::Spherical | JointKind::Floating) {
            continue;
        }
        for kind in [1, 2] {
            let column = bodies + kind * info.sizes.n_v + joint.v.start;
            let scale = if values[column] > 0.0 { values[column] } else { 1.0 };
            free.push(Free::Friction { column, scale });
        }
    }
    free
}

impl Search {
    fn new(description: &Description, model: &Model<f64>, base: &Base, all: &Triangle) -> Search {
        let start = model.parameters();
        let n = base.columns.len();
        let row = |k: usize| {
            let row = &all.row(k)[..n];
            let mut wide = vec![0.0; start.len()];
            base.columns.iter().zip(row).for_each(|(j, x)| wide[*j] = *x);
            for (i, j) in base.others.iter().enumerate() {
                wide[*j] = (0..n).map(|c| row[c] * base.map[c * base.others.len() + i]).sum();
            }
            wide
        };
        Search {
            free: free_numbers(description, model, &start),
            rows: (0..n).map(row).collect(),
            forces: (0..n).map(|k| all.row(k)[n]).collect(),
            start,
        }
    }

    /// All parameters at u.
    fn at(&self, u: &[f64]) -> Vec<f64> {
        let mut values = self.start.clone();
        let mut k = 0;
        for free in &self.free {
            match free {
                Free::Body { first, near, others, .. } => {
                    let (own, _) = near.at(&u[k..k + 10]);
                    (0..10).for_each(|i| values[first + i] = own[i] + others[i]);
                }
                Free::Friction { column, scale } => values[*column] += scale * u[k],
            }
            k += free.width();
        }
        values
    }

    /// Forces left over.
    fn left(&self, values: &[f64]) -> Vec<f64> {
        let rows = self.rows.iter().zip(&self.forces);
        rows.map(|(row, force)| force - dot(row, values)).collect()
    }

    fn cost(&self, u: &[f64], values: &[f64]) -> f64 {
        self.left(values).iter().chain(u).map(|x| x * x).sum()
    }

    /// u after a step of Gauss and Newton towards the least cost, damped.
    fn stepped(&self, u: &[f64], values: &[f64], damping: f64) -> Vec<f64> {
        let m = u.len();
        let mut normal = Triangle::new(m + 1);
        for (row, left) in self.rows.iter().zip(self.left(values)) {
            let mut line = Vec::with_capacity(m + 1);
            for free in &self.free {
                match free {
                    Free::Body { first, near, .. } => {
                        let (_, by) = near.at(&u[line.len()..line.len() + 10]);
                        line.extend(by.map(|by| dot(&by, &row[*first..first + 10])));
                    }
                    Free::Friction { column, scale } => line.push(row[*column] * scale),
                }
            }
            line.push(left);
            normal.add(&mut line);
        }
        for k in 0..m {
            // towards the model, and not far from here
            for (weight, by) in [(1.0, -u[k]), (damping, 0.0)] {
                let mut line = vec![0.0; m + 1];
                line[k] = weight;
                line[m] = weight * by;
                normal.add(&mut line);
            }
        }
        let mut next: Vec<f64> = (0..m).map(|k| normal.row(k)[m]).collect();
        normal.solve(&mut next);
        next.iter_mut().zip(u).for_each(|(x, u)| *x += u);
        // friction gives no power
        let mut k = 0;
        for free in &self.free {
            if let Free::Friction { column, scale } = free {
                next[k] = next[k].max(-self.start[*column] / scale);
            }
            k += free.width();
        }
        next
    }
}

/// The nearest physical parameters to the model that explain the forces.
fn physical(
    description: &Description,
    model: &Model<f64>,
    base: &Base,
    all: &Triangle,
) -> Physical {
    let search = Search::new(description, model, base, all);
    let mut u = vec![0.0; search.free.iter().map(Free::width).sum()];
    let mut values = search.at(&u);
    let mut before = search.cost(&u, &values);
    let mut damping = 1e-6;
    for _ in 0..STEPS {
        let next = search.stepped(&u, &values, damping);
        let moved = search.at(&next);
        let after = search.cost(&next, &moved);
        if after > before {
            damping = f64::max(damping * 10.0, 1e-3);
            continue;
        }
        let ends = before - after <= STILL * before;
        (u, values, before) = (next, moved, after);
        damping = f64::max(damping * 0.1, 1e-9);
        if ends {
            break;
        }
    }
    let links = search.free.iter().filter_map(|free| {
        let Free::Body { first, link, others, .. } = free else { return None };
        let own = core::array::from_fn(|i| values[first + i] - others[i]);
        let link = &description.links[*link];
        let rpy = link.inertial.as_ref()?.origin.rpy;
        Some(LinkEstimate { name: link.name.clone(), inertial: inertial(&own, rpy) })
    });
    Physical { links: links.collect(), parameters: values }
}
