//! Base parameters: the combinations that forces along some motion tell.

use sarrus_dynamics::{Model, Status};

use crate::IdentifyError;
use crate::dense::Triangle;
use crate::log::Sample;
use crate::stack::Stack;

/// Part of a column that it adds to the others below which it may be rounding.
const DEPENDENT: f64 = 1e-8;
/// Range of a coordinate without limits, on each side of zero.
const RANGE: f64 = 1.0;
/// Largest random rates.
const VELOCITY: f64 = 2.0;
const ACCELERATION: f64 = 5.0;

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

impl Base {
    /// π_base of all parameters.
    pub fn of(&self, parameters: &[f64]) -> Vec<f64> {
        let n = self.others.len().max(1);
        let own = self.columns.iter().enumerate();
        own.map(|(k, column)| {
            let row = self.map[k * self.others.len()..].iter().take(n).zip(&self.others);
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

/// The base parameters of a robot, from random states within its limits.
///
/// # Errors
///
/// Where nearly no state has an answer.
pub fn base_parameters(model: &Model<f64>) -> Result<Base, IdentifyError> {
    Ok(of_triangle(&at_random_states(model)?))
}

/// Rows of the forces at random states.
fn at_random_states(model: &Model<f64>) -> Result<Triangle, IdentifyError> {
    let n = model.sizes().n_parameters();
    let mut stack = Stack::new(model)?;
    let mut all = Triangle::new(n);
    let mut random = Random(1);
    let states = 3 * n / stack.n_rows().max(1) + 8;
    let mut found = 0;
    let mut last = Status::Ok;
    for _ in 0..50 * states {
        let status = stack.at(&random_state(model, &mut random));
        if status == Status::Ok {
            stack.rows().for_each(|row| all.add(&mut row.to_vec()));
            found += 1;
        } else {
            last = status;
        }
        if found == states {
            return Ok(all);
        }
    }
    Err(IdentifyError::Unreachable(last))
}

/// Splits the columns where they fall furthest.
fn of_triangle(all: &Triangle) -> Base {
    let order = all.pivots();
    let falls = |k: usize| {
        let next = order.get(k).map_or(0.0, |(_, x)| *x);
        (next < DEPENDENT).then(|| order[k - 1].1 / next.max(1e-20))
    };
    let rank = (1..=order.len())
        .filter_map(|k| Some((k, falls(k)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(order.len(), |(k, _)| k);
    let mut columns: Vec<usize> = order[..rank].iter().map(|(j, _)| *j).collect();
    columns.sort_unstable();
    let others: Vec<usize> = (0..all.n).filter(|j| !columns.contains(j)).collect();
    // Y_c map = Y_others, as right-hand sides behind the columns
    let joined = all.of_columns(&[&columns[..], &others].concat());
    let mut map = vec![0.0; rank * others.len()];
    for j in 0..others.len() {
        let mut x: Vec<f64> = (0..rank).map(|k| joined.row(k)[rank + j]).collect();
        joined.solve(&mut x);
        (0..rank).for_each(|k| map[k * others.len() + j] = x[k]);
    }
    Base { columns, others, map }
}

/// A multiplicative generator, the same on every machine.
struct Random(u64);

impl Random {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

fn random_state(model: &Model<f64>, random: &mut Random) -> Sample {
    let info = model.info();
    let mut sample = Sample::default();
    for joint in info.joints().filter(|joint| {
        let first = &info.tree[joint.v.start];
        model.independent_names().contains(first)
    }) {
        for _ in joint.v.clone() {
            sample.yd.push(random.within(-VELOCITY, VELOCITY));
            sample.ydd.push(random.within(-ACCELERATION, ACCELERATION));
        }
    }
    // in the order of y, which is not that of q
    for name in model.independent_q_names() {
        let Some(place) = info.tree_q.iter().position(|x| x == name) else { continue };
        let joint = info.joints().find(|joint| joint.q.contains(&place));
        let limits = joint.filter(|joint| joint.v.len() == 1).and_then(|joint| {
            let limits = info.limits.get(joint.v.start)?.as_ref()?;
            Some([limits.lower?, limits.upper?])
        });
        let [low, high] = limits.unwrap_or([-RANGE, RANGE]);
        sample.y.push(random.within(low, high));
        if name.ends_with("/qw") {
            let first = sample.y.len().saturating_sub(4);
            let length = sample.y[first..].iter().fold(0.0, |sum: f64, x| sum.hypot(*x));
            sample.y[first..].iter_mut().for_each(|x| *x /= length);
        }
    }
    sample
}

#[cfg(test)]
mod tests {
    use sarrus_models::{Options, Source, load};

    use super::*;

    /// Ranks of the inertial parameters alone, from an independent program over Pinocchio.
    #[test]
    fn loops_leave_as_many_base_parameters_as_another_program_finds() {
        for (robot, rank) in [
            ("lambda", 8),
            // its inertia is constant, and gravity has a sine and a cosine
            ("parallelogram", 3),
            ("torso", 36),
            ("ankle", 36),
            ("r3_lambda_r", 40),
        ] {
            let loaded = load(&Source::Bundled(robot.into()), &Options::default());
            let model = loaded.unwrap_or_else(|error| panic!("{robot}: {error}")).compiled.model;
            let all = at_random_states(&model).unwrap();
            let inertial: Vec<usize> = (0..10 * model.sizes().n_bodies).collect();
            let base = of_triangle(&all.of_columns(&inertial));
            assert_eq!(base.columns.len(), rank, "{robot}");
            // Y π = Y_c π_base at another state
            let base = base_parameters(&model).unwrap();
            let parameters: Vec<f64> =
                (0..model.sizes().n_parameters()).map(|k| (k as f64).sin()).collect();
            let values = base.of(&parameters);
            let mut stack = Stack::new(&model).unwrap();
            let mut random = Random(77);
            while stack.at(&random_state(&model, &mut random)) != Status::Ok {}
            for row in stack.rows() {
                let whole = crate::dense::dot(row, &parameters);
                let reduced: f64 = base.columns.iter().zip(&values).map(|(j, x)| row[*j] * x).sum();
                let size: f64 = row.iter().zip(&parameters).map(|(x, p)| (x * p).abs()).sum();
                assert!((whole - reduced).abs() < 1e-9 * size, "{robot}: {whole} {reduced}");
            }
        }
    }
}
