//! The joint that the rows of a cut leave, and points and welds that hold the same directions.

use sarrus_dynamics::description::{Loop, Row};

use crate::pose::Pose;
use crate::rotation::{cross, dot};

sarrus_dynamics::named_enum! {
    /// The joint that a cut leaves.
    pub(super) enum Kind {
        Point = "point",
        /// The point in a plane: a hinge of a loop that moves in that plane.
        Plane = "point in a plane",
        Hinge = "hinge",
        Weld = "weld",
        Slide = "slider",
        Universal = "universal joint",
        Other = "combination of directions",
    }
}

/// A kind with its axes {predecessor's cut frame}, the second one {successor's}.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) kind: Kind,
    pub(super) axis: [f64; 3],
    pub(super) axis2: [f64; 3],
}

/// An orthonormal basis of directions.
fn basis(directions: impl Iterator<Item = [f64; 3]>) -> Vec<[f64; 3]> {
    let mut basis: Vec<[f64; 3]> = Vec::new();
    for v in directions {
        let mut rest = v;
        for b in &basis {
            let along = dot(rest, *b);
            rest = std::array::from_fn(|k| rest[k] - along * b[k]);
        }
        let length = dot(rest, rest).sqrt();
        if length > 1e-9 * dot(v, v).sqrt() {
            basis.push(rest.map(|x| x / length));
        }
    }
    basis
}

/// The joint that these rows leave.
pub(super) fn held(rows: &[Row]) -> Held {
    let parts = |row: &Row| {
        let [a, b, c, x, y, z] = row.axis;
        ([a, b, c], [x, y, z])
    };
    let turns = rows.iter().filter(|row| row.against.is_none()).map(|row| parts(row).0);
    let turns = basis(turns.filter(|of| *of != [0.0; 3]));
    let points = basis(rows.iter().map(|row| parts(row).1).filter(|of| *of != [0.0; 3]));
    let is_mixed = |row: &Row| parts(row).0 != [0.0; 3] && parts(row).1 != [0.0; 3];
    let against = rows.iter().find_map(|row| Some((parts(row).0, row.against?)));
    let across = |of: &[[f64; 3]]| match of {
        [a, b] => cross(*a, *b),
        _ => [0.0; 3],
    };
    let (kind, axis) = match (points.len(), turns.len(), against) {
        _ if rows.iter().any(is_mixed) => (Kind::Other, [0.0; 3]),
        (3, 0, None) => (Kind::Point, [0.0; 3]),
        (2, 0, None) => (Kind::Plane, across(&points)),
        (3, 2, None) => (Kind::Hinge, across(&turns)),
        (3, 3, None) => (Kind::Weld, [0.0; 3]),
        (2, 3, None) => (Kind::Slide, across(&points)),
        (3, 0, Some((axis, _))) => (Kind::Universal, axis),
        _ => (Kind::Other, [0.0; 3]),
    };
    Held { kind, axis, axis2: against.map_or([0.0; 3], |(_, axis2)| axis2) }
}

/// Two frames that meet in their origins, and as a weld in their axes too.
pub(super) struct Tie {
    /// Submechanism and loop.
    pub(super) of: (usize, usize),
    pub(super) name: String,
    pub(super) links: [usize; 2],
    pub(super) places: [Pose; 2],
    pub(super) is_weld: bool,
}

impl Tie {
    /// The points and welds of a cut; none of a cut that they cannot express.
    pub(super) fn new(at: (usize, usize), of: &Loop, places: [Pose; 2], cut: &Held) -> Vec<Tie> {
        let tie = |name: &str, offset: [f64; 3], is_weld: bool| Tie {
            of: at,
            name: format!("{}{name}", of.name),
            links: [of.predecessor, of.successor],
            places: places.map(|place| place.then(Pose::at(offset))),
            is_weld,
        };
        match cut.kind {
            Kind::Point | Kind::Plane => vec![tie("", [0.0; 3], false)],
            Kind::Weld => vec![tie("", [0.0; 3], true)],
            // two points of its axis, as far apart as the cut is from its links' origins
            Kind::Hinge => {
                let far = places.iter().map(|place| dot(place.p, place.p).sqrt());
                let far = Some(far.fold(0.0, f64::max)).filter(|far| *far > 0.0).unwrap_or(1.0);
                let size = far / dot(cut.axis, cut.axis).sqrt();
                vec![tie("", [0.0; 3], false), tie("_axis", cut.axis.map(|x| x * size), false)]
            }
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use sarrus_dynamics::CutJoint;

    use super::*;

    #[test]
    fn the_rows_of_each_cut_joint_tell_which_one_it_is() {
        let axis = [1.0, 2.0, -0.5];
        let axis2 = [2.0, -1.0, 0.0];
        for (joint, kind) in [
            (CutJoint::Spherical, Kind::Point),
            (CutJoint::Weld, Kind::Weld),
            (CutJoint::Revolute { axis }, Kind::Hinge),
            (CutJoint::PlanarRevolute { axis }, Kind::Plane),
            (CutJoint::Prismatic { axis }, Kind::Slide),
            (CutJoint::Universal { axis, axis2 }, Kind::Universal),
            (CutJoint::Cylindrical { axis }, Kind::Other),
        ] {
            let found = held(&joint.rows());
            assert_eq!(found.kind, kind);
            if !matches!(kind, Kind::Point | Kind::Weld | Kind::Other) {
                let [x, y, z] = cross(found.axis, axis);
                assert!(x.hypot(y).hypot(z) < 1e-15 * 10.0, "{found:?}");
            }
        }
    }
}
