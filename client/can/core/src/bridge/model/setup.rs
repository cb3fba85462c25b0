//! Groups coordinates by the loop Jacobian and the mass matrix at sampled poses, and finds the best
//! condition of each mechanism.

use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request};

use super::evaluator::{Evaluator, Pose};
use super::linkage::Linkage;
use crate::cholesky::Cholesky;
use crate::config::{Configuration, Limits};

/// Number of sampled poses.
const SAMPLES: usize = 128;
/// Half the range of an independent without limits `[m, rad]`.
const UNBOUNDED: f64 = 0.5;
/// Part of the range of an actuator that is a negligible deviation.
const MARGIN: f64 = 0.002;
/// Clearance of a pose where Newton's method can start.
const SOUND: f64 = 0.05;
/// Smaller entries count as zero.
const NONE: f64 = 1e-9;

/// Structure of a robot, from samples.
pub(super) struct Structure {
    pub(super) linkages: Vec<Linkage>,
    /// Where the search for a pose starts: zero, or the best sample if zero is near a singular pose
    /// (n_qy).
    pub(super) home: Vec<f64>,
    /// The mechanism of each independent; `None` where no actuator moves it (n_vy).
    pub(super) owners: Vec<Option<usize>>,
    /// For each mechanism the independents whose positions its forces depend on.
    pub(super) coupled: Vec<Vec<usize>>,
}

/// Reads the structure. `limits` are those of the actuators (n_u). Allocates.
pub(super) fn structure(
    evaluator: &mut Evaluator,
    zero: &Pose,
    configuration: &Configuration,
    limits: &[Limits],
) -> Option<Structure> {
    let model = evaluator.model.clone();
    let sizes = model.sizes();
    let names = model.independent_names();
    let places: Vec<Option<usize>> = names
        .iter()
        .map(|name| model.independent_q_names().iter().position(|other| other == name))
        .collect();
    let place_of = |names: &[String], name: &String| names.iter().position(|other| other == name);
    let actuator_rows: Option<Vec<usize>> =
        model.active_names().iter().map(|name| place_of(model.tree_names(), name)).collect();
    let actuator_rows = actuator_rows?;
    let ranges = independent_ranges(&model);

    // dependencies at any of the poses
    let poses = samples(evaluator, zero, &places, &ranges);
    let depends = |row: usize, column: usize| {
        poses.iter().any(|pose| pose.jacobian_entry(row, column).abs() > NONE)
    };
    let mechanism_of = |column: usize| {
        actuator_rows
            .iter()
            .position(|row| depends(*row, column))
            .and_then(|u| configuration.mechanisms.get(u).copied())
    };
    let owners: Vec<Option<usize>> = (0..sizes.n_vy).map(mechanism_of).collect();
    let mut linkages: Vec<Linkage> = Vec::new();
    for number in 0..configuration.n_mechanisms() {
        let actuators: Vec<usize> =
            (0..sizes.n_u).filter(|u| configuration.mechanisms.get(*u) == Some(&number)).collect();
        let rows: Vec<usize> = actuators.iter().map(|u| actuator_rows[*u]).collect();
        let columns: Vec<usize> =
            (0..sizes.n_vy).filter(|column| owners[*column] == Some(number)).collect();
        let joints: Vec<usize> = (0..sizes.n_v)
            .filter(|row| !rows.contains(row))
            .filter(|row| columns.iter().any(|column| depends(*row, *column)))
            .collect();
        let weights = actuators
            .iter()
            .map(|u| {
                let range = limits.get(*u).map_or(1.0, |limits| limits.upper - limits.lower);
                let range = if range.is_finite() && range > 0.0 { range } else { 1.0 };
                1.0 / (MARGIN * range)
            })
            .collect();
        let independents = columns.iter().map(|v| (*v, places[*v].unwrap_or(0))).collect();
        let n_independents = columns.len();
        linkages.push(Linkage {
            is_serial: joints.is_empty() && actuators.len() == 1 && n_independents == 1,
            actuators,
            rows,
            independents,
            joints,
            weights,
            limits: columns.iter().map(|column| ranges[*column]).collect(),
            least: 0.0,
            factor: Cholesky::new(n_independents),
            side: vec![0.0; n_independents],
        });
    }

    let home = best_poses(&mut linkages, &poses, zero, limits);
    let coupled = coupled(evaluator, zero, &owners, linkages.len())?;
    Some(Structure { linkages, home, owners, coupled })
}

/// Limits of each independent; infinite where it has none (n_vy).
fn independent_ranges(model: &Model) -> Vec<[f64; 2]> {
    model
        .independent_names()
        .iter()
        .map(|name| {
            let limits = model.info().limits_of(name);
            let of = |limit: Option<f64>, otherwise| limit.unwrap_or(otherwise);
            let lower = limits.and_then(|limits| limits.lower);
            let upper = limits.and_then(|limits| limits.upper);
            [of(lower, f64::NEG_INFINITY), of(upper, f64::INFINITY)]
        })
        .collect()
}

/// Finds the best pose of each mechanism within the limits of its actuators, and sets the least
/// norm of its joints' reach. Returns the home pose (n_qy).
fn best_poses(
    linkages: &mut [Linkage],
    poses: &[Pose],
    zero: &Pose,
    limits: &[Limits],
) -> Vec<f64> {
    let mut home = zero.y.clone();
    for linkage in linkages.iter_mut().filter(|linkage| linkage.is_determined()) {
        let is_within = |pose: &Pose| {
            linkage
                .actuators
                .iter()
                .all(|&u| limits.get(u).is_none_or(|of| (of.lower..=of.upper).contains(&pose.u[u])))
        };
        let within: Vec<&Pose> = poses.iter().filter(|pose| is_within(pose)).collect();
        let chosen = if within.is_empty() { poses.iter().collect() } else { within };
        let mut least = f64::INFINITY;
        let mut best = zero;
        for pose in chosen {
            let is_sound = linkage.factorise(pose);
            let reach = linkage.reach_of_joints(pose);
            if is_sound && reach < least {
                (least, best) = (reach, pose);
            }
        }
        linkage.least = if least.is_finite() { least } else { 0.0 };
        if !linkage.factorise(zero) || linkage.clearance(zero) < SOUND {
            linkage.independents.iter().for_each(|(_, place)| home[*place] = best.y[*place]);
        }
    }
    home
}

/// Poses within the limits of the independents; the first is the zero pose.
fn samples(
    evaluator: &mut Evaluator,
    zero: &Pose,
    places: &[Option<usize>],
    ranges: &[[f64; 2]],
) -> Vec<Pose> {
    let mut poses = vec![zero.clone()];
    for k in 1..SAMPLES {
        let mut pose = zero.clone();
        for (v, (place, range)) in places.iter().zip(ranges).enumerate() {
            let Some(place) = place else { continue };
            // a sequence of low discrepancy: multiples of irrational numbers
            let step = (0.754_877_666_246_693 * (v as f64 + 1.0)).fract().max(0.01);
            let part = (0.5 + k as f64 * step).fract();
            let [lower, upper] = match range.iter().all(|end| end.is_finite()) {
                true => *range,
                false => [range[0].max(-UNBOUNDED), range[1].min(UNBOUNDED)],
            };
            pose.y[*place] = lower + part * (upper - lower);
        }
        if evaluator.pose(&mut pose) {
            poses.push(pose);
        }
    }
    poses
}

/// For each mechanism the independents that its forces depend on: those that its own carry, and
/// those that carry its own, read off the mass matrix.
fn coupled(
    evaluator: &Evaluator,
    zero: &Pose,
    owners: &[Option<usize>],
    n_mechanisms: usize,
) -> Option<Vec<Vec<usize>>> {
    let model = &evaluator.model;
    let query =
        Query::new(Request::InverseDynamics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::MY]));
    let planned = Planned::answered(model, &query, &[(Field::Y, &zero.y)])?;
    let n = owners.len();
    let depends = |i: usize, j: usize| planned.output[i * n + j] != 0.0;
    let of = |number: usize| {
        let own: Vec<usize> = (0..n).filter(|v| owners[*v] == Some(number)).collect();
        (0..n).filter(|v| own.contains(v) || own.iter().any(|i| depends(*i, *v))).collect()
    };
    Some((0..n_mechanisms).map(of).collect())
}
