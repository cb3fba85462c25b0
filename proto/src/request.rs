//! The kinds of request, with the fields that each takes and gives, and the parts of tasks.

use crate::Field::{self, *};
use crate::FieldSet;
use crate::wire_enum::wire_enum;

wire_enum! {
    /// The kinds of request.
    Request: u32 {
        /// Positions, velocities, accelerations, closures, frames.
        Kinematics = 1, "kinematics";
        /// Motion to forces.
        InverseDynamics = 2, "inverse-dynamics";
        /// Forces to motion.
        ForwardDynamics = 3, "forward-dynamics";
        /// Positions, velocities, accelerations and forces from one space to another.
        Map = 4, "map";
        /// Motion and forces of the actuators to the forces from outside.
        Observe = 5, "observe";
        /// Poses of frames to the positions that reach them.
        InverseKinematics = 6, "ik";
        /// Twists of frames to the velocity that gives them, within limits.
        DifferentialInverseKinematics = 7, "diff-ik";
        /// Accelerations of frames to the forces of actuators and contacts that give them, within
        /// limits.
        Step = 8, "step";
    }
}

/// Fields that read the forces of the actuators or of the independents.
pub const OF_ACTUATOR_FORCES: [Field; 5] = [GainsY, Margin, Clip, ClipNearest, Binding];

impl Request {
    /// The inputs of tasks.
    const TARGETS: FieldSet =
        FieldSet::of(&[TaskTarget, ComTarget, BoundsY, BoundsU, Clearance, YGuess, YPreferred]);

    /// The wanted fields of a request that names none.
    pub const fn default_want(self) -> FieldSet {
        match self {
            Request::Kinematics | Request::Map => FieldSet::of(&[Q, Qd, Qdd, U]),
            Request::InverseDynamics => FieldSet::of(&[TauY, TauU]),
            Request::ForwardDynamics => FieldSet::of(&[Ydd]),
            Request::Observe => FieldSet::of(&[TauExternal, Observer]),
            Request::InverseKinematics => {
                FieldSet::of(&[Y, Q, U, TaskResidual, Iterations, Binding])
            }
            Request::DifferentialInverseKinematics => FieldSet::of(&[Yd, TaskResidual, Binding]),
            Request::Step => FieldSet::of(&[Ydd, TauU, ContactForces, TaskResidual, Binding]),
        }
    }

    /// True for requests of tasks.
    pub const fn has_tasks(self) -> bool {
        self as u32 >= Request::InverseKinematics as u32
    }

    /// The field of the targets of the tasks.
    pub(crate) const fn of_tasks(self) -> Field {
        match self {
            Request::InverseKinematics => TaskTarget,
            _ => TaskMotion,
        }
    }

    /// The fields that a request of this kind can give.
    pub const fn inputs(self) -> FieldSet {
        const MOTION: FieldSet = VELOCITY.with(Ydd).with(Qdd).with(Udd);
        const VELOCITY: FieldSet = STATE.with(Directions).with(GainsU);
        const STATE: FieldSet = FieldSet::of(&[Y, Yd, Q, Qd, U, Ud, QGuess, QdGuess]);
        const OBSERVED: FieldSet = FieldSet::of(&[Wrenches, TauQ, TauY, TauU, Dt, Gain, Observer]);
        const TARGETS: FieldSet = Request::TARGETS;
        const MOVED: FieldSet =
            FieldSet::of(&[Y, Q, U, QGuess, Dt, TaskMotion, ComTarget, BoundsY, BoundsU]);
        match self {
            Request::Kinematics => MOTION,
            Request::InverseDynamics => MOTION.with(Wrenches).with(Direction).with(Multipliers),
            Request::ForwardDynamics => {
                let forces = FieldSet::of(&[Wrenches, TauQ, TauY, TauU, Direction, Multipliers]);
                FieldSet(VELOCITY.0 | forces.0)
            }
            Request::Map => MOTION.with(TauQ).with(TauY).with(TauU),
            Request::Observe => FieldSet(STATE.0 | OBSERVED.0),
            Request::InverseKinematics => TARGETS.with(QGuess),
            Request::DifferentialInverseKinematics => MOVED.with(Yd),
            Request::Step => {
                FieldSet(MOVED.0 | FieldSet::of(&[Yd, Qd, Ud, QdGuess, Ydd, Wrenches]).0)
            }
        }
    }

    /// The fields that an answer to a request of this kind can hold.
    pub(crate) const fn outputs(self) -> FieldSet {
        // every field except given-only ones, and the forces and masses of some requests
        const FOUND: FieldSet = FieldSet::of(&[TaskResidual, Solutions]);
        const OF_TASKS: FieldSet = FOUND.with(ContactForces).with(TaskMotion);
        const ANSWERS: FieldSet = FieldSet::of(Field::ALL)
            .without(FieldSet::of(&[QGuess, QdGuess, Wrenches, Directions, GainsU]))
            .without(FieldSet::of(&[Direction, Multipliers]))
            .without(FieldSet::of(&[Dt, Gain, Observer, TauExternal]))
            .without(Request::TARGETS)
            .without(OF_TASKS);
        const FORCES: FieldSet = FieldSet::of(&[TauQ, TauY, TauU, TauUnactuated]);
        const MASSES: FieldSet = FieldSet::of(&[
            Lambda,
            LambdaDeterminate,
            MY,
            CY,
            CondMy,
            TorqueVerticesNet,
            TorqueSupportNet,
            TaskInertia,
            TaskBias,
            TaskGravity,
            TaskRank,
        ]);
        const OF_FORCES: FieldSet = FieldSet::of(&[
            DtauYDy,
            DtauYDyd,
            DtauUDy,
            DtauUDyd,
            DtauUnactuatedDy,
            DtauUnactuatedDyd,
            RegressorY,
            RegressorU,
            D2TauYV,
            BaseParameters,
        ]);
        const OF_ACCELERATIONS: FieldSet = FieldSet::of(&[DyddDy, DyddDyd, DyddDtauU, D2YddV]);
        const LIMITED: FieldSet = FieldSet::of(&OF_ACTUATOR_FORCES);
        const INVERSE: FieldSet = ANSWERS.without(OF_ACCELERATIONS);
        const STATE: FieldSet =
            INVERSE.without(FORCES).without(MASSES).without(OF_FORCES).without(LIMITED);
        match self {
            Request::Kinematics => STATE.with(GainsY),
            Request::InverseDynamics => INVERSE,
            Request::ForwardDynamics => {
                ANSWERS.without(FORCES).without(OF_FORCES).without(LIMITED).with(TauY)
            }
            Request::Map => FieldSet(STATE.with(TauY).with(TauU).with(TauUnactuated).0 | LIMITED.0),
            Request::Observe => FieldSet::of(&[Y, Yd, Q, Qd, U, Ud, TauExternal, Observer])
                .with(Residual)
                .with(Iterations)
                .with(SigmaMin)
                .with(NearestY)
                .with(Limits),
            Request::InverseKinematics => {
                const OF_STATE: FieldSet =
                    FieldSet::of(&[Y, Q, U, Iterations, SigmaMin, FramePose, Binding]);
                FieldSet(FOUND.0 | OF_STATE.0)
            }
            Request::DifferentialInverseKinematics | Request::Step => self.default_want(),
        }
    }
}

/// The parts of a frame that a task is about, and its priority, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[repr(transparent)]
pub struct TaskParts(pub u8);

impl TaskParts {
    /// The place of its origin.
    pub const POSITION: TaskParts = TaskParts(1);
    /// Its axes.
    pub const ORIENTATION: TaskParts = TaskParts(2);
    /// The direction of its z axis.
    pub const AXIS: TaskParts = TaskParts(4);
    /// Only as far as the tasks without this bit leave room.
    pub const SECOND: TaskParts = TaskParts(8);
    /// Exactly, by forces of the ground: a contact.
    pub const HELD: TaskParts = TaskParts(16);

    /// True when every bit of `other` is set.
    pub const fn contains(self, other: TaskParts) -> bool {
        self.0 & other.0 == other.0
    }

    /// The union.
    #[must_use]
    pub const fn with(self, other: TaskParts) -> TaskParts {
        TaskParts(self.0 | other.0)
    }

    /// Known bits of a request, with something to reach.
    pub(crate) const fn is_task(self, request: Request) -> bool {
        let known = match request {
            Request::InverseKinematics => TaskParts(15),
            _ if self.contains(TaskParts::HELD) => TaskParts(16 | 3),
            _ => TaskParts(8 | 3),
        };
        known.contains(self) && self.0 & 7 != 0
    }
}
