//! Base parameters: the combinations of parameters that forces along some motion tell. See
//! [`crate::guide::parameters`].

use sarrus_factorisations::{Mat, pivoted_qr};
use sarrus_proto::{Field, FieldSet, Query, QueryError, QueryOptions, Request, Status};

use crate::model::Model;
use crate::plan::Planned;
use crate::scalar::{Real, noise};

/// Part of a column that it adds to the others below which it may be rounding.
const DEPENDENT: f64 = 1e-8;
/// Range of a coordinate without limits, on each side of zero; largest rates.
const RANGE: f64 = 1.0;
const VELOCITY: f64 = 2.0;
const ACCELERATION: f64 = 5.0;
/// Most parameters of a plan that wants them: their states take seconds.
const MOST: usize = 1024;

/// π_base = π_c + map π_others of all parameters: Y π = Y_c π_base at every state.
#[derive(Clone, Debug)]
pub struct Base {
    /// The columns of Y_c, one for each base parameter.
    pub columns: Vec<usize>,
    /// All other parameters.
    pub others: Vec<usize>,
    /// Row of each base parameter, column of each other one.
    pub map: Vec<f64>,
}

/// The base parameters of a robot, from states all over its limits. Allocates.
///
/// # Errors
///
/// Where nearly no state has an answer.
pub fn base_parameters(model: &Model<f64>) -> Result<Base, QueryError> {
    let n = model.sizes().n_parameters();
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let query = Query::new(Request::InverseDynamics, given, Field::RegressorY.into())
        .with_options(QueryOptions::FRICTION);
    let mut planned = Planned::new(model, &query)?;
    let states = 3 * n / model.sizes().n_vy.max(1) + 8;
    let mut rows = Vec::with_capacity(states * planned.output.len());
    for k in 0..50 * states {
        planned.input = state(model, k);
        if planned.run(model).status == Status::Ok {
            rows.extend_from_slice(&planned.output);
        }
        if rows.len() == states * planned.output.len() {
            return Ok(Base::of_rows(&rows, n));
        }
    }
    Err(QueryError::NoStates)
}

/// The field of a model: base parameters in the places of their own columns, NaN in others; none
/// where it is not wanted.
pub(super) fn wanted<C: Real>(model: &Model<C>, query: &Query) -> Result<Vec<f64>, QueryError> {
    if !query.want.has(Field::BaseParameters) {
        return Ok(Vec::new());
    }
    let mut field = vec![f64::NAN; model.sizes().n_parameters()];
    if field.len() > MOST {
        return Err(QueryError::TooMany { what: "parameters of a base", limit: MOST });
    }
    let model = model.convert(|x| x.to_f64());
    let base = base_parameters(&model)?;
    let values = base.of(&model.parameters());
    base.columns.iter().zip(values).for_each(|(j, x)| field[*j] = x);
    Ok(field)
}

impl Base {
    /// The base parameters that rows of forces by n parameters tell: columns, scaled to one, are
    /// split where the pivots fall furthest. Allocates.
    pub fn of_rows(rows: &[f64], n: usize) -> Base {
        let m = rows.len() / n.max(1);
        let norm = |j: usize| rows.iter().skip(j).step_by(n).fold(0.0, |x: f64, y| x.hypot(*y));
        let norms: Vec<f64> = (0..n).map(norm).collect();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let scale = |j: usize| if norms[j] > f64::EPSILON * largest { 1.0 / norms[j] } else { 0.0 };
        let (order, R) = pivoted_qr(&Mat::from_fn(m, n, |i, j| rows[i * n + j] * scale(j)));
        let most = n.min(m);
        let pivot = |k: usize| if k < most { R[(k, k)].abs() } else { 0.0 };
        let fall = |k: &usize| pivot(k - 1) / pivot(*k).max(1e-20);
        let rank = (1..=most)
            .filter(|k| pivot(*k) < DEPENDENT)
            .max_by(|a, b| fall(a).total_cmp(&fall(b)))
            .unwrap_or(most);
        // R_c x = R_j of each other column
        let solved = |j: &usize| {
            let mut x = vec![0.0; rank];
            for k in (0..rank).rev() {
                let below: f64 = (k + 1..rank).map(|i| R[(k, i)] * x[i]).sum();
                x[k] = (R[(k, *j)] - below) / R[(k, k)];
            }
            x
        };
        let mut places: Vec<usize> = (0..n).collect();
        places[..rank].sort_unstable_by_key(|k| order[*k]);
        places[rank..].sort_unstable_by_key(|k| order[*k]);
        let (own, others) = places.split_at(rank);
        let parts: Vec<Vec<f64>> = others.iter().map(solved).collect();
        let entry = |k: usize, j: usize| parts[j][k] * scale(order[k]) * norms[order[others[j]]];
        let row = |k: &usize| (0..others.len()).map(|j| entry(*k, j)).collect::<Vec<f64>>();
        Base {
            map: own.iter().flat_map(row).collect(),
            columns: own.iter().map(|k| order[*k]).collect(),
            others: others.iter().map(|k| order[*k]).collect(),
        }
    }

    /// π_base of all parameters.
    pub fn of(&self, parameters: &[f64]) -> Vec<f64> {
        let n = self.others.len();
        let own = self.columns.iter().enumerate();
        own.map(|(k, column)| {
            let row = self.map[k * n..].iter().zip(&self.others);
            parameters[*column] + row.map(|(x, j)| x * parameters[*j]).sum::<f64>()
        })
        .collect()
    }

    /// The parameters in a base parameter with their factors, its own first.
    pub fn combination(&self, k: usize) -> Vec<(usize, f64)> {
        let n = self.others.len();
        let row = &self.map[k * n..(k + 1) * n];
        let others = self.others.iter().copied().zip(row.iter().copied());
        let counts = |(_, x): &(usize, f64)| x.abs() > 1e-9;
        [(self.columns[k], 1.0)].into_iter().chain(others.filter(counts)).collect()
    }
}

/// State k: y within its limits, ẏ and ÿ.
fn state(model: &Model<f64>, k: usize) -> Vec<f64> {
    let info = model.info();
    let len = info.sizes.n_qy + 2 * info.sizes.n_vy;
    let mut numbers: Vec<f64> = Vec::with_capacity(len);
    let part = |numbers: &[f64]| noise(len * k + numbers.len());
    for name in model.independent_q_names() {
        let Some(place) = info.tree_q.iter().position(|x| x == name) else { continue };
        let joint = info.joints().find(|joint| joint.q.contains(&place));
        let limits = joint.filter(|joint| joint.v.len() == 1).and_then(|joint| {
            let limits = info.limits.get(joint.v.start)?.as_ref()?;
            Some([limits.lower?, limits.upper?])
        });
        let [low, high] = limits.unwrap_or([-RANGE, RANGE]);
        numbers.push(0.5 * (low + high + (high - low) * part(&numbers)));
        if name.ends_with("/qw") {
            let first = numbers.len().saturating_sub(4);
            let length = numbers[first..].iter().fold(0.0, |sum: f64, x| sum.hypot(*x));
            numbers[first..].iter_mut().for_each(|x| *x /= length);
        }
    }
    for most in [VELOCITY, ACCELERATION] {
        (0..info.sizes.n_vy).for_each(|_| numbers.push(most * part(&numbers)));
    }
    numbers
}
