//! Bodies, and the frames on them.

use crate::scalar::constants;
use nalgebra::{Matrix3, Vector3};

use crate::mechanism::Motion;
use crate::spatial::Pose;

/// A moving body and the joint that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Body<T> {
    pub(crate) parent: usize,
    pub(crate) motion: Motion,
    /// First internal tree coordinate and velocity.
    pub(crate) q: usize,
    pub(crate) v: usize,
    /// Pose of the body at zero of its joint {parent body}: x_parent = R_parent_body x_body +
    /// p_parent_body. The rotation is the transpose of Featherstone's E.
    pub(crate) R_parent_body: Matrix3<T>,
    pub(crate) p_parent_body: Vector3<T>,
    /// The same place, from the origin of the cluster's loops if the cluster's parent carries the
    /// body.
    pub(crate) p_local: Vector3<T>,
    /// Mass, first moment m c, rotational inertia xx xy xz yy yz zz about the body's origin {body}.
    pub(crate) mass: T,
    pub(crate) h: Vector3<T>,
    pub(crate) inertia: [T; 6],
}

constants! { Body:
    keep parent motion q v;
    number mass;
    map R_parent_body p_parent_body p_local h inertia;
}

/// A link's frame on the body that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Frame<T> {
    pub(crate) body: usize,
    pub(crate) x_body_frame: Pose<T>,
}

constants! { Frame:
    keep body;
    map x_body_frame;
}
