//! Frames as a query sees them: against the root or a link, in root, reference or own axes.

use nalgebra::Vector3;
use sarrus_proto::Axes;

use crate::algorithms::{self, in_root, pack};
use crate::mechanism::Frame;
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose};
use crate::workspace::BodyState;

/// The axes and the reference of frames.
#[derive(Clone, Copy)]
pub(super) struct View<'a, T> {
    axes: Axes,
    /// The frame that takes the root's place.
    reference: Option<&'a Frame<T>>,
}

/// Motion of a frame against the reference, in root axes at the frame's origin.
struct Seen<T> {
    p: Vector3<T>,
    w: Vector3<T>,
    v: Vector3<T>,
}

impl Plan {
    pub(super) fn view<'a, T>(&self, model: &'a Model<T>) -> View<'a, T> {
        View {
            axes: Axes::from_code(self.query.axes).unwrap_or(Axes::Mixed),
            reference: self.query.reference().map(|link| &model.frames[link]),
        }
    }
}

impl<T: Real> View<'_, T> {
    pub(super) fn pose(self, frame: &Frame<T>, world: &[Pose<T>]) -> [T; 7] {
        match self.reference {
            None => algorithms::frame_pose(frame, world),
            Some(reference) => {
                let from = in_root(reference, world).inverse();
                algorithms::pose_numbers(&from.then(&in_root(frame, world)))
            }
        }
    }

    /// [ω; v] after [`algorithms::velocities`].
    pub(super) fn twist(
        self,
        frame: &Frame<T>,
        world: &[Pose<T>],
        motion: &[BodyState<T>],
    ) -> [T; 6] {
        if self.is_plain() {
            return algorithms::frame_twist(frame, world, motion);
        }
        let Seen { w, v, .. } = self.seen(frame, world, motion);
        self.turned(frame, world, &pack(&w, &v))
    }

    /// Classical [α; a] of the frame's origin after [`algorithms::rates`], and
    /// [`algorithms::velocities`] where the view is not plain; or the rate of [`View::twist`].
    pub(super) fn acceleration(
        mut self,
        frame: &Frame<T>,
        world: &[Pose<T>],
        motion: &[BodyState<T>],
        of_twist: bool,
    ) -> [T; 6] {
        if self.is_plain() {
            return algorithms::frame_acceleration(frame, world, motion);
        }
        let seen = self.seen(frame, world, motion);
        let (alpha, mut a) = self.accelerated(frame, &seen, world, motion);
        match (of_twist, self.axes) {
            // d/dt (v + p × ω) = a + p × α − ω × v,  d/dt Rᵀ v = Rᵀ (a − ω × v)
            (true, Axes::World | Axes::Local) => a = a.add_cross(seen.v, seen.w),
            // at the frame's origin in all axes
            (false, Axes::World) => self.axes = Axes::Mixed,
            _ => {}
        }
        self.turned(frame, world, &pack(&alpha, &a))
    }

    /// Columns of the Jacobian over the tree velocities: calls `each(internal velocity, column)`.
    #[inline]
    pub(super) fn columns(
        self,
        model: &Model<T>,
        frame: &Frame<T>,
        world: &[Pose<T>],
        mut each: impl FnMut(usize, [T; 6]),
    ) {
        let against = self.reference.map_or(0, |reference| reference.body);
        algorithms::frame_jacobian(model, frame, against, world, |v, column| {
            let column = if self.is_plain() { column } else { self.turned(frame, world, &column) };
            each(v, column);
        });
    }

    /// Columns over turns and slides of the origins of joints: calls `each(number of the joint, k,
    /// column)`.
    pub(super) fn by_geometry(
        self,
        model: &Model<T>,
        frame: &Frame<T>,
        world: &[Pose<T>],
        mut each: impl FnMut(usize, usize, [T; 6]),
    ) {
        let against = self.reference.map_or(0, |reference| reference.body);
        algorithms::frame_by_geometry(model, frame, against, world, |joint, k, column| {
            each(joint, k, self.turned(frame, world, &column));
        });
    }

    fn is_plain(self) -> bool {
        self.axes == Axes::Mixed && self.reference.is_none()
    }

    /// A motion in root axes at the frame's origin, in the axes and at the point of the view.
    fn turned(self, frame: &Frame<T>, world: &[Pose<T>], motion: &[T; 6]) -> [T; 6] {
        let [w, v] = halves(*motion);
        let at = in_root(frame, world);
        let root = self.reference.map_or_else(Pose::identity, |link| in_root(link, world));
        let (R, v) = match self.axes {
            Axes::World => (root.R, v.add_cross(at.p - root.p, w)),
            Axes::Local => (at.R, v),
            _ => (root.R, v),
        };
        pack(&R.apply_transposed(w), &R.apply_transposed(v))
    }

    /// Velocity against the reference.
    fn seen(self, frame: &Frame<T>, world: &[Pose<T>], motion: &[BodyState<T>]) -> Seen<T> {
        let [w, v] = halves(algorithms::frame_twist(frame, world, motion));
        let p = in_root(frame, world).p;
        match self.reference {
            None => Seen { p, w, v },
            Some(link) => {
                let [w_of, v_of] = halves(algorithms::frame_twist(link, world, motion));
                let p = p - in_root(link, world).p;
                Seen { p, w: w - w_of, v: v - v_of - w_of.cross(p) }
            }
        }
    }

    /// Acceleration against the reference, for the velocity against it, in root axes:
    /// α − α_L − ω_L × ω, a − a_L − α_L × p − ω_L × (ω_L × p) − 2 ω_L × v.
    fn accelerated(
        self,
        frame: &Frame<T>,
        seen: &Seen<T>,
        world: &[Pose<T>],
        motion: &[BodyState<T>],
    ) -> (Vector3<T>, Vector3<T>) {
        let [alpha, a] = halves(algorithms::frame_acceleration(frame, world, motion));
        let Some(link) = self.reference else { return (alpha, a) };
        let Seen { p, w, v } = *seen;
        let [w_of, _] = halves(algorithms::frame_twist(link, world, motion));
        let [alpha_of, a_of] = halves(algorithms::frame_acceleration(link, world, motion));
        let turning = w_of.cross(p);
        let coriolis = w_of.cross(v);
        (
            alpha - alpha_of - w_of.cross(w),
            a - a_of - alpha_of.cross(p) - w_of.cross(turning) - coriolis - coriolis,
        )
    }
}

/// Angular and linear part.
fn halves<T: Real>(x: [T; 6]) -> [Vector3<T>; 2] {
    [0, 3].map(|k| Vector3::new(x[k], x[k + 1], x[k + 2]))
}
