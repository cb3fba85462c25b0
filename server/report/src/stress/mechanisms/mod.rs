//! Small mechanisms that several families share; straight approaches to singular poses.

pub(super) mod approach;
pub(super) mod plane;
pub(super) mod poses;
pub(super) mod trains;
pub(super) mod weights;

use sarrus_dynamics::LinkId;
use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind as Kind};

use crate::Outcome;
pub(crate) use crate::robots::small::{
    ARM_OF_LAMBDA, LOOSE, RHOMBUS, angle_of_crank, bricard, door, four_bar, lambda,
    reach_of_lambda, toggle, way_of_lambda,
};
use crate::stress::harness::{Turn, Z, joint, mechanism};

pub(crate) const BASE: LinkId = LinkId::BASE;

/// A crank that makes full turns.
pub(crate) const GRASHOF: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 0.3], [0.9, 0.6], [1.0, 0.0]];

/// Rods in a row on parallel axes, 1 m and 1 kg each, the first on the base.
pub(crate) fn rods(n: usize) -> Outcome<Description> {
    let mut of = mechanism(Kind::Serial);
    let inertia = [0.001, 0.0, 0.0, 1.0 / 12.0, 0.0, 1.0 / 12.0];
    of.default_inertial(Inertial::new(1.0, [0.5, 0.0, 0.0], inertia));
    (0..n).fold(BASE, |on, k| joint(&mut of, on, Turn, [k as f64, 0.0, 0.0], Z));
    Ok(of.build()?)
}
