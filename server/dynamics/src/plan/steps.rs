//! The steps of a plan, by the fields that a query gives and wants.

use sarrus_proto::Field::{self, *};
use sarrus_proto::{Axes, OF_ACTUATOR_FORCES, Query, Request};

use crate::closure::Level;
use crate::model::Method;
use crate::plan::needed;

// wanted fields by the quantity that they read
const FRAMES: [Field; 13] = [
    FramePose,
    FrameTwist,
    FrameAcc,
    JacobianTree,
    JacobianIndependent,
    JacobianActuator,
    JdYd,
    DjacobianDy,
    DgammaDtheta,
    TaskInertia,
    TaskBias,
    TaskGravity,
    TaskRank,
];
const VELOCITIES: [Field; 9] = [Qd, Yd, Ud, FrameTwist, FrameAcc, KBias, Momentum, Energy, Limits];
/// Read the speeds of actuators.
const MOTORS: [Field; 8] = [
    TorqueVertices,
    TorqueSupport,
    TorqueVerticesNet,
    TorqueSupportNet,
    Margin,
    Clip,
    ClipNearest,
    Binding,
];
const ACCELERATIONS: [Field; 4] = [Qdd, Ydd, Udd, FrameAcc];
const TREE_ACCELERATIONS: [Field; 3] = [Qdd, Udd, FrameAcc];
const BIASES: [Field; 6] = [GBias, GUBias, ComBias, JdYd, ReflectedForce, TaskBias];
/// Read C_y.
const BIAS_FORCES: [Field; 3] = [CY, TorqueVerticesNet, TorqueSupportNet];
const LOOP_JACOBIANS: [Field; 9] = [
    G,
    GU,
    CondGu,
    Uncontrolled,
    JacobianIndependent,
    JacobianActuator,
    ComJacobian,
    Centroidal,
    DgammaDtheta,
];
const FORCES: [Field; 5] = [TauY, TauU, TauQ, TauUnactuated, Lambda];
const MASS_MATRICES: [Field; 2] = [MY, CondMy];

/// Space of a given position, velocity or acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    Independent,
    Tree,
    Actuation,
}

impl Space {
    /// The space of the first given field of [independent, tree, actuation].
    fn given(query: &Query, [y, q, u]: [Field; 3]) -> Option<Space> {
        let fields = [(y, Space::Independent), (q, Space::Tree), (u, Space::Actuation)];
        fields.into_iter().find(|(field, _)| query.given.has(*field)).map(|(_, space)| space)
    }
}

/// Steps of a plan, decided once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    pub(super) position: Space,
    pub(super) velocity: Option<Space>,
    pub(super) acceleration: Option<Space>,
    /// Level to which closures are evaluated.
    pub(super) level: Level,
    /// Some velocity, acceleration or bias is read, be it zero.
    pub(super) rates: bool,
    /// q̈ of dependents is read: that of the given motion, or that of the computed ÿ.
    pub(super) given_acceleration: bool,
    pub(super) found_acceleration: bool,
    /// Sines and cosines of free joints and the poses of all bodies in their parents.
    pub(super) poses: bool,
    pub(super) frames: bool,
    pub(super) frame_velocities: bool,
    /// Sums over all links.
    pub(super) links: bool,
    pub(super) newton_euler: bool,
    /// The robot is at rest, and so are its bias forces: gravity and springs alone.
    pub(super) rest: bool,
    pub(super) bias_at_rest: bool,
    pub(super) mass_matrix: bool,
    /// Inertia and forces of the frames together.
    pub(super) task_space: bool,
    /// K or a quantity derived from it.
    pub(super) conditions: bool,
    /// Derivatives, and those of them that need forces.
    pub(super) derivatives: bool,
    pub(super) force_derivatives: bool,
    /// Forces by parameters.
    pub(super) regressor: bool,
    /// Derivatives by the geometry.
    pub(super) geometry: bool,
    /// The step of the observer.
    pub(super) observes: bool,
}

impl Steps {
    pub(super) fn new(query: &Query, request: Request, method: Method) -> Steps {
        let want = query.want;
        let velocity = Space::given(query, [Yd, Qd, Ud]);
        let acceleration = Space::given(query, [Ydd, Qdd, Udd]);
        let forward = request == Request::ForwardDynamics;
        let dynamics = forward || request == Request::InverseDynamics;
        let rest = velocity.is_none() && acceleration.is_none();
        let reaches = request == Request::InverseKinematics;
        let frames = query.n_frames > 0 && (reaches || want.has_any(&FRAMES));
        let conditions = want.has_any(&needed::OF_THE_ROBOT);
        let is_seen = query.axes != Axes::Mixed as u32 || query.reference().is_some();
        let links = want.has_any(&needed::OF_THE_LINKS) || query.given.has(ComTarget);
        let observes = want.has_any(&needed::OBSERVED);
        let derivatives = observes || want.iter().any(Field::is_derivative);
        let force_derivatives = want.iter().any(Field::is_derivative_of_forces);
        let regressor = want.has_any(&needed::REGRESSORS);
        let reads_acceleration = derivatives || want.has_any(&TREE_ACCELERATIONS);
        let forces = force_derivatives
            || regressor
            || want.has_any(&FORCES)
            || want.has_any(&OF_ACTUATOR_FORCES);
        let newton_euler = forward || dynamics && forces;
        let task_space = want.has_any(&needed::OF_THE_TASKS);
        let mass_matrix =
            want.has_any(&MASS_MATRICES) || task_space || forward && method == Method::Projection;
        Steps {
            position: Space::given(query, [Y, Q, U]).unwrap_or(Space::Independent),
            velocity,
            acceleration,
            level: level(query, request, velocity.is_some(), acceleration.is_some()),
            rates: forward
                || !rest
                || conditions
                || derivatives
                || regressor
                || want.has_any(&VELOCITIES)
                || want.has_any(&MOTORS)
                || want.has_any(&ACCELERATIONS)
                || want.has_any(&BIASES),
            given_acceleration: !rest && !forward && (newton_euler || reads_acceleration),
            found_acceleration: reads_acceleration || want.has(Lambda),
            poses: frames
                || links
                || derivatives
                || want.has(DgammaDtheta)
                || dynamics && (newton_euler || mass_matrix || want.has_any(&BIAS_FORCES)),
            frames,
            frame_velocities: want.has_any(&[FrameTwist, Momentum, Energy])
                || is_seen && want.has_any(&[FrameAcc, JdYd, TaskBias]),
            links,
            newton_euler,
            rest,
            bias_at_rest: velocity.is_none(),
            mass_matrix,
            task_space,
            conditions,
            derivatives,
            force_derivatives,
            regressor,
            geometry: want.has(DgammaDtheta),
            observes,
        }
    }
}

/// Level to which closures are evaluated; at ẏ = 0 the bias g is zero and is not computed.
fn level(query: &Query, request: Request, moving: bool, accelerated: bool) -> Level {
    let want = query.want;
    let dynamics = matches!(request, Request::InverseDynamics | Request::ForwardDynamics);
    let derivatives = want.iter().any(Field::is_derivative) || want.has_any(&needed::OBSERVED);
    let reads_bias =
        derivatives || dynamics || want.has_any(&ACCELERATIONS) || want.has_any(&BIASES);
    let reads_jacobian = dynamics
        || derivatives
        || matches!(request, Request::Map | Request::InverseKinematics)
        || moving && want.has_any(&VELOCITIES)
        || want.iter().any(Field::is_of_motors)
        || accelerated
        || want.has_any(&LOOP_JACOBIANS)
        || query.given.has_any(&[U, Ud, Udd]);
    match (moving, reads_jacobian) {
        (true, _) if reads_bias => Level::Acceleration,
        (true, true) => Level::Velocity,
        (false, true) => Level::Jacobian,
        (_, false) => Level::Position,
    }
}
