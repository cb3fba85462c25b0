//! One cut of a loop under construction, and the rows of the usual cut joints.

use nalgebra::Vector3;

use super::{DescriptionBuilder, LinkId};
use crate::compile::vector;
use crate::description::{Cut, Loop, Placement, Row};
use crate::diagnostic::{Diagnostic, Site};
use crate::initial_pose::placement;
use crate::spatial::Pose;

/// A cut under construction.
#[derive(Clone, Debug)]
pub(super) struct PendingCut {
    name: String,
    predecessor: usize,
    successor: usize,
    place: Option<Cut>,
    rows: Vec<Row>,
}

impl PendingCut {
    /// The loop; a cut without a place is a fault.
    pub(super) fn finished(&self, site: Site, errors: &mut Vec<Diagnostic>) -> Loop {
        let PendingCut { name, predecessor, successor, place, rows } = self.clone();
        if place.is_none() {
            errors.push(Diagnostic::new(
                site,
                format!("cut {name} without a place"),
                "the point where both links meet",
                "give it by `at`, or give a frame",
            ));
        }
        Loop { name, predecessor, successor, cut: place.unwrap_or(Cut::AtLink(0)), rows }
    }
}

/// A cut of the submechanism, to set its place and its rows; it needs both.
#[derive(Debug)]
pub struct CutBuilder<'a> {
    robot: &'a mut DescriptionBuilder,
}

/// The joint at a cut, by name. An axis is a direction of any length but zero `[-]` (3) {cut
/// frame}.
///
/// | cut joint | rows |
/// |---|---|
/// | spherical | x y z |
/// | weld | x y z rx ry rz |
/// | revolute | x y z rb rc |
/// | planar revolute | b c |
/// | prismatic | b c rx ry rz |
/// | cylindrical | b c rb rc |
/// | universal | x y z u |
///
/// x, y, z are the axes of the cut frame. b is the one of them that is least along the axis (the
/// first of several), made perpendicular to it; c = axis × b. The letter r stands for a turn, axis
/// · log(R_Pᵀ R_S), which is exact wherever the cut leaves the turns about one line or none. A
/// universal joint leaves two, and its turn about axis × axis2 is none of them only at zero; its
/// row is u, axis · (R_Pᵀ R_S axis2) = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CutJoint {
    /// A ball: no translation.
    Spherical,
    /// No motion.
    Weld,
    /// A hinge.
    Revolute {
        /// Of rotation.
        axis: [f64; 3],
    },
    /// A hinge of a mechanism that moves in a plane: only the rows in the plane.
    PlanarRevolute {
        /// Of rotation, across the plane.
        axis: [f64; 3],
    },
    /// A slider.
    Prismatic {
        /// Of translation.
        axis: [f64; 3],
    },
    /// A hinge that slides.
    Cylindrical {
        /// Of rotation and translation.
        axis: [f64; 3],
    },
    /// Two hinges whose axes meet at a right angle.
    Universal {
        /// On the predecessor.
        axis: [f64; 3],
        /// On the successor; its part along `axis` does not count.
        axis2: [f64; 3],
    },
}

impl CutJoint {
    /// The rows in the predecessor's cut frame, and in the successor's where they stand against a
    /// direction of it.
    pub fn rows(self) -> Vec<Row> {
        use CutJoint::*;
        let (axis, axis2) = match self {
            Spherical | Weld => ([0.0; 3], [0.0; 3]),
            Universal { axis, axis2 } => (axis, axis2),
            Revolute { axis }
            | PlanarRevolute { axis }
            | Prismatic { axis }
            | Cylindrical { axis } => (axis, [0.0; 3]),
        };
        let [b, c] = across(axis);
        let frame = [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])];
        let plane = [("b", b), ("c", c)];
        let (linear, angular): (&[(&str, [f64; 3])], &[(&str, [f64; 3])]) = match self {
            Spherical | Universal { .. } => (&frame, &[]),
            Weld => (&frame, &frame),
            Revolute { .. } => (&frame, &plane),
            PlanarRevolute { .. } => (&plane, &[]),
            Prismatic { .. } => (&plane, &frame),
            Cylindrical { .. } => (&plane, &plane),
        };
        let linear = linear
            .iter()
            .map(|(name, [x, y, z])| ((*name).to_owned(), [0.0, 0.0, 0.0, *x, *y, *z], None));
        let angular = angular
            .iter()
            .map(|(name, [x, y, z])| (format!("r{name}"), [*x, *y, *z, 0.0, 0.0, 0.0], None));
        // removes the rounding of a file
        let [first, second] = [unit(axis.into()), Vector3::from(axis2)];
        let against = unit(second - first * first.dot(&second)).into();
        let turn = matches!(self, Universal { .. })
            .then(|| ("u".to_owned(), [first.x, first.y, first.z, 0.0, 0.0, 0.0], Some(against)));
        linear
            .chain(angular)
            .chain(turn)
            .map(|(name, axis, against)| Row { name, axis, against })
            .collect()
    }
}

impl<'a> CutBuilder<'a> {
    pub(super) fn new(
        robot: &'a mut DescriptionBuilder,
        name: String,
        predecessor: LinkId,
        successor: LinkId,
    ) -> CutBuilder<'a> {
        let [predecessor, successor] =
            [predecessor, successor].map(|link| robot.known(link, Site::Robot).index());
        let place = None;
        let rows = Vec::new();
        robot.group().cuts.push(PendingCut { name, predecessor, successor, place, rows });
        CutBuilder { robot }
    }

    /// Both cut frames are at this point at zero, along the root's axes `[m]` (3) {root}.
    pub fn at(mut self, point: [f64; 3]) -> CutBuilder<'a> {
        let x_root_cut = Pose { p: vector(point), ..Pose::identity() };
        let predecessor = self.mine().predecessor;
        let successor = self.mine().successor;
        let on = |link: usize| placement(&self.robot.x_root_link[link].inverse().then(&x_root_cut));
        let place = Cut::Placed { predecessor: on(predecessor), successor: on(successor) };
        self.mine().place = Some(place);
        self
    }

    /// Both cut frames are the frame of a link at zero.
    pub fn at_frame_of(mut self, link: LinkId) -> CutBuilder<'a> {
        let link = self.robot.known(link, Site::Robot);
        self.mine().place = Some(link.joint().map_or(Cut::AtLink(0), Cut::AtJoint));
        self
    }

    /// Each cut frame by hand, {predecessor link} and {successor link}; they need not meet at zero
    /// where a pose is to be found in which they do.
    pub fn placements(mut self, predecessor: Placement, successor: Placement) -> CutBuilder<'a> {
        self.mine().place = Some(Cut::Placed { predecessor, successor });
        self
    }

    /// The rows of a cut joint, after those that stand already.
    pub fn joint(mut self, joint: CutJoint) -> CutBuilder<'a> {
        self.mine().rows.extend(joint.rows());
        self
    }

    /// One row, angular part first: φ = axis · [log(R_Pᵀ R_S); R_Pᵀ (p_S − p_P)] (6) {predecessor's
    /// cut frame}.
    pub fn row(mut self, name: impl Into<String>, axis: [f64; 6]) -> CutBuilder<'a> {
        self.mine().rows.push(Row { name: name.into(), axis, against: None });
        self
    }

    fn mine(&mut self) -> &mut PendingCut {
        let cuts = &mut self.robot.group().cuts;
        let last = cuts.len() - 1;
        &mut cuts[last]
    }
}

/// Two directions b and c = axis × b, perpendicular to an axis and of unit length; exact where the
/// axis is one of the frame.
fn across(axis: [f64; 3]) -> [[f64; 3]; 2] {
    let a = unit(axis.into());
    let k = a.iamin();
    let b = unit(Vector3::ith(k, 1.0) - a * a[k]);
    // 0.0 turns −0.0 round
    [b, a.cross(&b)].map(|v| v.map(|x| x + 0.0).into())
}

/// A direction of unit length; a cut without an axis has no row of it.
fn unit(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_across_an_axis_of_the_frame_are_axes_of_the_frame() {
        assert_eq!(across([3.0, 0.0, 0.0]), [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(across([0.0, 1.0, 0.0]), [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        assert_eq!(across([0.0, 0.0, 0.5]), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    }

    #[test]
    fn the_directions_across_a_tilted_axis_are_a_right_handed_frame_with_it() {
        let axis = [0.36, 0.48, -0.8];
        let [b, c] = across(axis);
        let dot = |a: [f64; 3], b: [f64; 3]| Vector3::from(a).dot(&Vector3::from(b));
        for (value, expected) in [
            (dot(b, axis), 0.0),
            (dot(c, axis), 0.0),
            (dot(b, c), 0.0),
            (dot(b, b), 1.0),
            (dot(c, c), 1.0),
        ] {
            assert!((value - expected).abs() < 4e-16, "{value} {expected}");
        }
        assert!(c[2] * (axis[0] * b[1] - axis[1] * b[0]) > 0.0);
    }
}
