//! Bodies, and the frames on them.

use nalgebra::{Matrix3, Vector3};

use crate::mechanism::Motion;
use crate::spatial::Pose;

/// A moving body and the joint that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Body<C> {
    pub(crate) parent: usize,
    pub(crate) motion: Motion,
    /// First internal tree coordinate and velocity.
    pub(crate) q: usize,
    pub(crate) v: usize,
    /// Pose of the body at zero of its joint {parent body}: x_parent = R_parent_body x_body +
    /// p_parent_body. The rotation is the transpose of Featherstone's E.
    pub(crate) R_parent_body: Matrix3<C>,
    pub(crate) p_parent_body: Vector3<C>,
    /// Mass, first moment m c, rotational inertia xx xy xz yy yz zz about the body's origin {body}.
    pub(crate) mass: C,
    pub(crate) h: Vector3<C>,
    pub(crate) inertia: [C; 6],
}

/// A link's frame on the body that carries it.
#[derive(Clone, Debug)]
pub(crate) struct Frame<C> {
    pub(crate) body: usize,
    pub(crate) x_body_frame: Pose<C>,
}

impl<C: nalgebra::Scalar + Copy> Body<C> {
    pub(crate) fn map<D: nalgebra::Scalar>(&self, f: impl Fn(C) -> D + Copy) -> Body<D> {
        Body {
            parent: self.parent,
            motion: self.motion,
            q: self.q,
            v: self.v,
            R_parent_body: self.R_parent_body.map(f),
            p_parent_body: self.p_parent_body.map(f),
            mass: f(self.mass),
            h: self.h.map(f),
            inertia: self.inertia.map(f),
        }
    }
}
