//! The named blocks of numbers that requests give and answers hold.

use core::fmt;
use core::ops::{BitOr, BitOrAssign, Sub};

use crate::Sizes;
use crate::wire_enum::wire_enum;

/// Numbers of a task in [`Field::TaskTarget`].
pub const TASK_NUMBERS: usize = 11;
/// Most solutions of one answer.
pub const MAX_SOLUTIONS: usize = 16;

wire_enum! {
    /// A named block of numbers in a request or an answer. Fields are packed in the order of their
    /// numbers.
    #[derive(PartialOrd, Ord)]
    Field: u8 {
        /// Independent coordinates y `[m, rad]` (n_qy).
        Y = 0, "y";
        /// Independent velocities ẏ (n_vy).
        Yd = 1, "yd";
        /// Independent accelerations ÿ (n_vy).
        Ydd = 2, "ydd";
        /// Tree coordinates q (n_q).
        Q = 3, "q";
        /// Tree velocities q̇ (n_v).
        Qd = 4, "qd";
        /// Tree accelerations q̈ (n_v).
        Qdd = 5, "qdd";
        /// Actuator coordinates u (n_u).
        U = 6, "u";
        /// Actuator velocities u̇ (n_u).
        Ud = 7, "ud";
        /// Actuator accelerations ü (n_u).
        Udd = 8, "udd";
        /// A closed pose near the answer from which numerical closures continue (n_q).
        QGuess = 9, "q_guess";
        /// The tree velocity at the guess: where branches cross, the numerical closure continues
        /// along it (n_v).
        QdGuess = 10, "qd_guess";
        /// Generalised forces on the tree coordinates (n_v).
        TauQ = 11, "tau_q";
        /// Generalised forces on the independent coordinates (n_vy).
        TauY = 12, "tau_y";
        /// Actuator forces (n_u).
        TauU = 13, "tau_u";
        /// Wrenches `[n; f]` on the named links, world axes at the link's origin, acting on the
        /// robot (n_wrenches × 6).
        Wrenches = 14, "wrenches";
        /// The part of `tau_y` that no actuator can give (n_vy).
        TauUnactuated = 15, "tau_unactuated";
        /// Loop Jacobian, q̇ = G ẏ (n_v × n_vy).
        G = 16, "G";
        /// q̈ = G ÿ + g (n_v).
        GBias = 17, "g_bias";
        /// Actuator rows of G (n_u × n_vy).
        GU = 18, "G_u";
        /// ü = G_u ÿ + g_u (n_u).
        GUBias = 19, "g_u";
        /// Constraint Jacobian, K q̇ = 0 (n_c × n_v).
        K = 20, "K";
        /// K q̈ = k, k = −K̇ q̇ (n_c).
        KBias = 21, "k_bias";
        /// Loop-closure forces and moments along the rows of K `[N, N m]` (n_c).
        Lambda = 22, "lambda";
        /// Reduced mass matrix GᵀMG (n_vy × n_vy).
        MY = 23, "M_y";
        /// Reduced bias force Gᵀ(C + M g) (n_vy).
        CY = 24, "C_y";
        /// Largest scaled loop residual (1).
        Residual = 25, "residual";
        /// Newton steps taken (1).
        Iterations = 26, "iterations";
        /// 2-norm condition number of K_d = ∂φ/∂q_d, unscaled (1).
        CondKd = 27, "cond_Kd";
        /// 2-norm condition number of G_u, unscaled (1).
        CondGu = 28, "cond_Gu";
        /// Distance to singularity: least singular value of the scaled K_d over all clusters (1).
        SigmaMin = 29, "sigma_min";
        /// The closest reachable independent coordinates found (n_qy).
        NearestY = 30, "nearest_y";
        /// Pose of each wanted frame in the root frame: position and quaternion x, y, z, w
        /// (n_frames × 7).
        FramePose = 31, "frame_pose";
        /// Twist `[ω; v]` of each wanted frame, world axes at the frame's origin (n_frames × 6).
        FrameTwist = 32, "frame_twist";
        /// Classical acceleration of each wanted frame, gravity not included (n_frames × 6).
        FrameAcc = 33, "frame_acc";
        /// Frame Jacobians over the tree velocities (6 n_frames × n_v).
        JacobianTree = 34, "jacobian_tree";
        /// Frame Jacobians over the independent velocities (6 n_frames × n_vy).
        JacobianIndependent = 35, "jacobian_independent";
        /// Frame Jacobians over the actuator velocities, where these determine the motion (6
        /// n_frames × n_u).
        JacobianActuator = 36, "jacobian_actuator";
        /// 2-norm condition number of M_y (1).
        CondMy = 37, "cond_My";
        /// Branch of each cluster with loops that is not a pure coupling: the sign of det K_d, 1 or
        /// −1 (n_branches).
        Branch = 38, "branch";
        /// 1 where a loop-closure force is determined by the motion, 0 where redundant rows share
        /// it (n_c).
        LambdaDeterminate = 39, "lambda_determinate";
        /// 1 where a tree velocity belongs to a set of independents that is good at this pose, else
        /// 0 (n_v).
        GoodIndependents = 40, "good_independents";
        /// The direction of ẏ, of unit length, that the actuators control least; after a singular
        /// actuation the uncontrolled one (n_vy).
        Uncontrolled = 41, "uncontrolled";
        /// The largest distance that the answer's state moved from the given q or q̇, in radians or
        /// lengths of the cluster (1).
        Projection = 42, "projection";
        /// Excess of each tree coordinate, its velocity and its actuator's force over their limits:
        /// negative below, positive above, zero inside or without a limit (n_v × 3).
        Limits = 43, "limits";
        /// Centre of mass of the moving links, in the root frame `[m]` (3).
        Com = 44, "com";
        /// Its Jacobian over the independent velocities (3 × n_vy).
        ComJacobian = 45, "com_jacobian";
        /// Its acceleration at ÿ = 0 `[m/s²]` (3).
        ComBias = 46, "com_bias";
        /// Momentum of the moving links without rotors, root axes: angular about the centre of
        /// mass, linear `[N m s, N s]` (6).
        Momentum = 47, "momentum";
        /// Centroidal matrix A: momentum = A ẏ (6 × n_vy).
        Centroidal = 48, "centroidal";
        /// Kinetic energy with rotors; potential energy of gravity, zero at the root's origin, and
        /// of springs `[J]` (2).
        Energy = 49, "energy";
        /// Classical acceleration of each wanted frame at ÿ = 0, J̇ ẏ (n_frames × 6).
        JdYd = 50, "Jd_yd";
        /// ∂τ_y/∂y at fixed ẏ and ÿ; the column of a ball or floating joint is that of a turn or
        /// slide in its body (n_vy × n_vy).
        DtauYDy = 51, "dtau_y_dy";
        /// ∂τ_y/∂ẏ (n_vy × n_vy).
        DtauYDyd = 52, "dtau_y_dyd";
        /// ∂τ_u/∂y at fixed ẏ and ÿ (n_u × n_vy).
        DtauUDy = 53, "dtau_u_dy";
        /// ∂τ_u/∂ẏ (n_u × n_vy).
        DtauUDyd = 54, "dtau_u_dyd";
        /// ∂ÿ/∂y at fixed ẏ and the fixed given force (n_vy × n_vy).
        DyddDy = 55, "dydd_dy";
        /// ∂ÿ/∂ẏ (n_vy × n_vy).
        DyddDyd = 56, "dydd_dyd";
        /// ∂ÿ/∂τ_u = M_y⁻¹ G_uᵀ (n_vy × n_u).
        DyddDtauU = 57, "dydd_dtau_u";
        /// Derivative of `tau_unactuated` by y (n_vy × n_vy).
        DtauUnactuatedDy = 58, "dtau_unactuated_dy";
        /// Derivative of `tau_unactuated` by ẏ (n_vy × n_vy).
        DtauUnactuatedDyd = 59, "dtau_unactuated_dyd";
        /// Rate of G along the motion (n_v × n_vy).
        Gd = 60, "Gd";
        /// ∂q̈/∂y at fixed ẏ and ÿ (n_v × n_vy).
        DqddDy = 61, "dqdd_dy";
        /// ∂g/∂ẏ, which is ∂q̈/∂ẏ at fixed ÿ (n_v × n_vy).
        DgBiasDyd = 62, "dg_bias_dyd";
        /// ∂(J ẏ)/∂y of each wanted frame at fixed ẏ (6 n_frames × n_vy).
        DjacobianDy = 63, "djacobian_dy";
        /// Directions of ẏ of the wanted supports (n_directions × n_vy).
        Directions = 64, "directions";
        /// Stiffness and damping of a law τ_u = K (u* − u) − D u̇ of each actuator (n_u × 2).
        GainsU = 65, "gains_u";
        /// Vertices of the set of forces G_uᵀ τ_u that the actuators can give, over the wanted
        /// independents with the others free; with two of them in their order around it
        /// ([`most_vertices`] × n_vy).
        TorqueVertices = 66, "torque_vertices";
        /// The largest dᵀ G_uᵀ τ_u of each given direction d (n_directions).
        TorqueSupport = 67, "torque_support";
        /// As `torque_vertices`, less C_y − Gᵀ Σ Jᵀ w of the state.
        TorqueVerticesNet = 68, "torque_vertices_net";
        /// As `torque_support`, less dᵀ (C_y − Gᵀ Σ Jᵀ w) of the state.
        TorqueSupportNet = 69, "torque_support_net";
        /// Vertices of the set of velocities ẏ that the speed limits of the actuators leave, over
        /// the wanted independents with the others free, where mechanisms have no more actuators
        /// than freedoms ([`most_vertices`] × n_vy).
        SpeedVertices = 70, "speed_vertices";
        /// Inertia of the rotors, G_uᵀ J G_u (n_vy × n_vy).
        ReflectedInertia = 71, "reflected_inertia";
        /// Damping of the actuators, G_uᵀ D G_u (n_vy × n_vy).
        ReflectedDamping = 72, "reflected_damping";
        /// Velocity terms of the rotors, G_uᵀ J g_u (n_vy).
        ReflectedForce = 73, "reflected_force";
        /// The law of `gains_u` along the independents at forces τ_u of the state: τ_y changes by
        /// −K_y δy − D_y δẏ. K_y = G_uᵀ K G_u − Σ τ_u ∂²u (n_vy columns), D_y = G_uᵀ D G_u (n_vy
        /// columns) and the force G_uᵀ τ_u (n_vy × (2 n_vy + 1)).
        GainsY = 74, "gains_y";
        /// The largest s such that the actuators of the wanted independents can give s τ_y (1).
        Margin = 75, "margin";
        /// s τ_y with s ≤ 1 and ≤ `margin` (n_vy).
        Clip = 76, "clip";
        /// G_uᵀ τ_u of the forces τ_u within the limits with the least Σ ((τ_u − τ_u*) / τ_max)²
        /// from those of τ_y (n_vy).
        ClipNearest = 77, "clip_nearest";
        /// 1 at an active upper bound, −1 at a lower one, else 0: position, velocity and actuator
        /// force of each tree coordinate; a last row for the clearance (n_v + 1 × 3). The bounds
        /// that a search met, or the forces at their limits at `margin` times τ_y.
        Binding = 78, "binding";
        /// Time since the state of the given `observer`, or in which a step keeps its limits `[s]`
        /// (1).
        Dt = 79, "dt";
        /// Bandwidth of the observer `[1/s]` (1).
        Gain = 80, "gain";
        /// State of the momentum observer, a row of each independent: external force, momentum,
        /// and the rate of the momentum without external forces (n_vy × 3).
        Observer = 81, "observer";
        /// Forces along the independents that none of the given ones explains (n_vy).
        TauExternal = 82, "tau_external";
        /// Inertia of the frames together, Λ = (J M_y⁻¹ Jᵀ)⁺ (6 n_frames × 6 n_frames).
        TaskInertia = 83, "Lambda";
        /// Force of velocities and dampers at the frames, μ = Λ (J M_y⁻¹ h − J̇ ẏ) (6 n_frames).
        TaskBias = 84, "mu";
        /// Force of gravity and springs at the frames, p = Λ J M_y⁻¹ g (6 n_frames).
        TaskGravity = 85, "p_task";
        /// Rank of J M_y⁻¹ Jᵀ, and its least singular value that counts over the largest (2).
        TaskRank = 86, "task_rank";
        /// Targets of the tasks: position, quaternion x, y, z, w, direction of the frame's z axis,
        /// weight; numbers of parts that a task does not have are not read (n_frames × 11).
        TaskTarget = 87, "task_target";
        /// Target of the centre of mass, in the root frame `[m]` (3).
        ComTarget = 88, "com_target";
        /// Least and greatest value of each independent coordinate, instead of the model's
        /// (n_qy × 2).
        BoundsY = 89, "bounds_y";
        /// Least and greatest value of each actuator coordinate, instead of the model's (n_u × 2).
        BoundsU = 90, "bounds_u";
        /// Least `sigma_min` (1).
        Clearance = 91, "clearance";
        /// Independent coordinates from which a search starts (n_qy).
        YGuess = 92, "y_guess";
        /// Independent coordinates to stay near to, after all tasks (n_qy).
        YPreferred = 93, "y_preferred";
        /// Distance or angle to each target, the larger one, and of the centre of mass, NaN without
        /// one (n_frames + 1).
        TaskResidual = 94, "task_residual";
        /// Independent coordinates of every solution found, NaN behind the last (16 × n_qy).
        Solutions = 95, "solutions";
        /// Wanted twist of each frame, or its wanted acceleration, and the weight (n_frames × 7).
        TaskMotion = 96, "task_motion";
        /// Moment and force of the ground on each held frame, root axes at its origin; NaN for the
        /// others (n_frames × 6).
        ContactForces = 97, "contact_forces";
        /// Y_y of τ_y = Y_y π + springs − wrenches: columns in the order of
        /// [`crate::ModelInfo::parameters`] (n_vy × n_parameters).
        RegressorY = 98, "regressor_y";
        /// Y_u of τ_u, likewise (n_u × n_parameters).
        RegressorU = 99, "regressor_u";
        /// Direction of second derivatives: in y, in ẏ, and in τ_u, which inverse dynamics does not
        /// read (2 n_vy + n_u).
        Direction = 100, "direction";
        /// μ, which multiplies the rows of second derivatives (n_vy).
        Multipliers = 101, "multipliers";
        /// Derivative of [∂τ_y/∂y ∂τ_y/∂ẏ] along `direction` (n_vy × 2 n_vy), or with
        /// `multipliers` the vector of μᵀ times it (2 n_vy).
        D2TauYV = 102, "d2_tau_y_v";
        /// Derivative of [∂ÿ/∂y ∂ÿ/∂ẏ ∂ÿ/∂τ_u] along `direction` (n_vy × (2 n_vy + n_u)), or with
        /// `multipliers` the vector of μᵀ times it (2 n_vy + n_u).
        D2YddV = 103, "d2_ydd_v";
        /// Combinations of parameters that forces along some motion tell, each in the place of the
        /// parameter that it replaces, NaN in others; of the model, at no state (n_parameters).
        BaseParameters = 104, "base_parameters";
        /// ∂q/∂θ at fixed y, of tree velocities, then turn and slide of each wanted frame in the
        /// axes of its Jacobian; columns in the order of [`crate::ModelInfo::geometry`]
        /// (n_v + 6 n_frames × n_geometry).
        DgammaDtheta = 105, "dgamma_dtheta";
    }
}

/// Most coordinates of a set of vertices.
pub const MOST_VERTEX_COORDINATES: usize = 4;
/// Most vertices of an answer.
pub const MOST_VERTICES: usize = 512;

/// Rows for the vertices of a sum of m segments in p dimensions, 2 Σ_{k<p} C(m − 1, k), at most
/// [`MOST_VERTICES`].
pub const fn most_vertices(m: usize, p: usize) -> usize {
    let mut sum = 0;
    let mut choices = 1;
    let mut k = 0;
    while k < p && sum < MOST_VERTICES {
        sum += 2 * choices;
        choices = choices * m.saturating_sub(k + 1) / (k + 1);
        k += 1;
    }
    if sum < MOST_VERTICES { sum } else { MOST_VERTICES }
}

impl Field {
    /// (rows, columns) on a model of the given sizes; a vector has one column, matrices are packed
    /// row by row. [`Field::has_direction_rows`] has those of one direction.
    pub const fn shape(self, s: &Sizes, n_frames: usize, n_wrenches: usize) -> (usize, usize) {
        self.shape_of_rows(s, s, n_frames, n_wrenches)
    }

    /// The shape if a query picks the rows of some joints; the sizes `p` count them.
    pub const fn shape_of_rows(
        self,
        s: &Sizes,
        p: &Sizes,
        n_frames: usize,
        n_wrenches: usize,
    ) -> (usize, usize) {
        use Field::*;
        match self {
            Y | NearestY => (p.n_qy, 1),
            Yd | Ydd | TauY | TauUnactuated | CY => (p.n_vy, 1),
            Q => (p.n_q, 1),
            Qd | Qdd | TauQ | GBias => (p.n_v, 1),
            QGuess => (s.n_q, 1),
            QdGuess => (s.n_v, 1),
            U | Ud | Udd | TauU | GUBias => (p.n_u, 1),
            Wrenches => (n_wrenches, 6),
            G | Gd | DqddDy | DgBiasDyd => (p.n_v, s.n_vy),
            GU | DtauUDy | DtauUDyd => (p.n_u, s.n_vy),
            DyddDtauU => (p.n_vy, s.n_u),
            K => (s.n_c, s.n_v),
            KBias | Lambda | LambdaDeterminate => (s.n_c, 1),
            MY | DtauYDy | DtauYDyd | DyddDy | DyddDyd | DtauUnactuatedDy | DtauUnactuatedDyd => {
                (p.n_vy, s.n_vy)
            }
            Dt | Gain => (1, 1),
            Observer => (s.n_vy, 3),
            TauExternal => (p.n_vy, 1),
            Residual | Iterations | CondKd | CondGu | SigmaMin | CondMy | Projection => (1, 1),
            GoodIndependents => (s.n_v, 1),
            Uncontrolled => (s.n_vy, 1),
            Limits => (p.n_v, 3),
            FramePose => (n_frames, 7),
            FrameTwist | FrameAcc | JdYd => (n_frames, 6),
            JacobianTree => (6 * n_frames, s.n_v),
            JacobianIndependent | DjacobianDy => (6 * n_frames, s.n_vy),
            JacobianActuator => (6 * n_frames, s.n_u),
            Branch => (s.n_branches, 1),
            Directions => (1, s.n_vy),
            GainsU => (s.n_u, 2),
            TorqueVertices | TorqueVerticesNet | SpeedVertices => {
                (most_vertices(s.n_u, p.n_vy), p.n_vy)
            }
            TorqueSupport | TorqueSupportNet => (1, 1),
            ReflectedInertia | ReflectedDamping => (p.n_vy, s.n_vy),
            ReflectedForce | Clip | ClipNearest => (p.n_vy, 1),
            GainsY => (p.n_vy, 2 * s.n_vy + 1),
            Margin => (1, 1),
            Com | ComBias => (3, 1),
            ComJacobian => (3, s.n_vy),
            Momentum => (6, 1),
            Centroidal => (6, s.n_vy),
            Energy | TaskRank => (2, 1),
            TaskInertia => (6 * n_frames, 6 * n_frames),
            TaskBias | TaskGravity => (6 * n_frames, 1),
            TaskTarget => (n_frames, TASK_NUMBERS),
            ComTarget => (3, 1),
            BoundsY => (s.n_qy, 2),
            BoundsU => (s.n_u, 2),
            Clearance => (1, 1),
            YGuess | YPreferred => (s.n_qy, 1),
            TaskResidual => (n_frames + 1, 1),
            Binding => (s.n_v + 1, 3),
            Solutions => (MAX_SOLUTIONS, s.n_qy),
            TaskMotion => (n_frames, 7),
            ContactForces => (n_frames, 6),
            RegressorY => (p.n_vy, s.n_parameters()),
            RegressorU => (p.n_u, s.n_parameters()),
            Direction => (2 * s.n_vy + s.n_u, 1),
            Multipliers => (s.n_vy, 1),
            BaseParameters => (s.n_parameters(), 1),
            DgammaDtheta => (p.n_v + 6 * n_frames, s.n_geometry()),
            D2TauYV => (p.n_vy, 2 * s.n_vy),
            D2YddV => (p.n_vy, 2 * s.n_vy + s.n_u),
        }
    }

    /// True for fields with these rows for each direction of [`crate::Query::n_directions`].
    pub const fn has_direction_rows(self) -> bool {
        matches!(self, Field::Directions | Field::TorqueSupport | Field::TorqueSupportNet)
    }

    /// True for sets of vertices, each a row.
    pub const fn has_vertex_rows(self) -> bool {
        matches!(self, Field::TorqueVertices | Field::TorqueVerticesNet | Field::SpeedVertices)
    }

    /// True for fields of actuators, which are NaN where an actuator has no limit.
    pub const fn is_of_motors(self) -> bool {
        self as u8 >= Field::TorqueVertices as u8 && self as u8 <= Field::Binding as u8
    }

    /// True for fields that depend on the joints that [`crate::Query::joints`] picks.
    pub fn has_joint_rows(self) -> bool {
        if matches!(self, Field::Margin | Field::Binding) {
            return true;
        }
        let none = Sizes::default();
        let one = Sizes { n_q: 1, n_v: 1, n_qy: 1, n_vy: 1, n_u: 1, ..none };
        self.shape_of_rows(&none, &one, 0, 0).0 > self.shape(&none, 0, 0).0
    }

    /// True for derivatives.
    pub const fn is_derivative(self) -> bool {
        let is_other = self as u8 >= Field::Gd as u8 && self as u8 <= Field::DjacobianDy as u8;
        is_other || self.is_derivative_of_forces()
    }

    /// True for derivatives that need forces and masses.
    pub const fn is_derivative_of_forces(self) -> bool {
        let is_first = self as u8 >= Field::DtauYDy as u8 && (self as u8) < Field::Gd as u8;
        is_first || self.is_second()
    }

    /// True for second derivatives along a direction.
    pub const fn is_second(self) -> bool {
        matches!(self, Field::D2TauYV | Field::D2YddV)
    }

    /// The field of a name, as in scripts.
    pub fn from_name(name: &str) -> Option<Field> {
        Field::ALL.iter().copied().find(|field| field.name() == name)
    }

    /// True for fields that a failed answer may still carry.
    pub const fn survives_failure(self) -> bool {
        use Field::*;
        matches!(
            self,
            Residual | Iterations | NearestY | SigmaMin | GoodIndependents | Uncontrolled | Binding
        )
    }
}

/// A set of fields, as the bits of their numbers: fields have numbers up to 127. As text it is two
/// words, the lower first.
///
/// ```
/// use sarrus_proto::{Field, FieldSet};
///
/// let state = Field::Q | Field::Qd;
/// let mut asked = state | Field::U;
/// asked |= Field::Ud;
/// assert!(asked.contains(state) && !state.contains(asked));
/// assert_eq!((asked - state).to_string(), "u, ud");
/// assert_eq!([Field::U, Field::Ud].into_iter().collect::<FieldSet>(), asked - state);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "transport", serde(from = "[u64; 2]", into = "[u64; 2]"))]
#[repr(transparent)]
pub struct FieldSet(pub u128);

impl FieldSet {
    /// The empty set.
    pub const EMPTY: FieldSet = FieldSet(0);

    /// The set of the given fields.
    pub const fn of(fields: &[Field]) -> FieldSet {
        let mut bits = 0;
        let mut k = 0;
        while k < fields.len() {
            bits |= 1 << fields[k] as u8;
            k += 1;
        }
        FieldSet(bits)
    }

    /// True when the field is in the set.
    pub const fn has(self, field: Field) -> bool {
        self.0 >> field as u8 & 1 == 1
    }

    /// True when any of the fields is in the set.
    pub const fn has_any(self, fields: &[Field]) -> bool {
        self.0 & FieldSet::of(fields).0 != 0
    }

    /// True when every field of `other` is in the set.
    pub const fn contains(self, other: FieldSet) -> bool {
        self.0 & other.0 == other.0
    }

    /// True when no field is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The set with one field more.
    #[must_use]
    pub const fn with(self, field: Field) -> FieldSet {
        FieldSet(self.0 | 1 << field as u8)
    }

    /// The fields of the set that are not in the other.
    #[must_use]
    pub const fn without(self, other: FieldSet) -> FieldSet {
        FieldSet(self.0 & !other.0)
    }

    /// The fields of the set, in packing order.
    pub fn iter(self) -> impl Iterator<Item = Field> {
        Field::ALL.iter().copied().filter(move |field| self.has(*field))
    }

    /// True if this version knows the field of every bit.
    pub fn is_known(self) -> bool {
        self.0 & !FieldSet::of(Field::ALL).0 == 0
    }
}

impl From<[u64; 2]> for FieldSet {
    fn from([low, high]: [u64; 2]) -> FieldSet {
        FieldSet(u128::from(low) | u128::from(high) << 64)
    }
}

impl From<FieldSet> for [u64; 2] {
    fn from(FieldSet(bits): FieldSet) -> [u64; 2] {
        [bits as u64, (bits >> 64) as u64]
    }
}

impl From<Field> for FieldSet {
    fn from(field: Field) -> FieldSet {
        FieldSet::EMPTY.with(field)
    }
}

impl<S: Into<FieldSet>> BitOr<S> for FieldSet {
    type Output = FieldSet;

    /// The union.
    fn bitor(self, other: S) -> FieldSet {
        FieldSet(self.0 | other.into().0)
    }
}

impl<S: Into<FieldSet>> BitOr<S> for Field {
    type Output = FieldSet;

    fn bitor(self, other: S) -> FieldSet {
        FieldSet::from(self) | other
    }
}

impl<S: Into<FieldSet>> BitOrAssign<S> for FieldSet {
    fn bitor_assign(&mut self, other: S) {
        *self = *self | other;
    }
}

impl<S: Into<FieldSet>> Sub<S> for FieldSet {
    type Output = FieldSet;

    /// The difference.
    fn sub(self, other: S) -> FieldSet {
        self.without(other.into())
    }
}

impl FromIterator<Field> for FieldSet {
    fn from_iter<I: IntoIterator<Item = Field>>(fields: I) -> FieldSet {
        fields.into_iter().fold(FieldSet::EMPTY, FieldSet::with)
    }
}

impl fmt::Display for FieldSet {
    /// The names of the fields in packing order, with commas between them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, field) in self.iter().enumerate() {
            f.write_str(if k == 0 { "" } else { ", " })?;
            f.write_str(field.name())?;
        }
        Ok(())
    }
}
