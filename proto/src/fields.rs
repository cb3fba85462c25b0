//! The table of the fields: number, name, shape, unit and meaning. `sarrus ask --fields`, its help,
//! the manual page and `.ci/book.py` take their texts from it.

use crate::wire_enum::wire_enum;

/// A row of the field table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldEntry {
    /// The field.
    pub field: Field,
    /// Its shape in the sizes of the model; a matrix is packed row by row.
    pub shape: &'static str,
    /// Its unit; `-` without one, `mixed` where the rows have different units.
    pub unit: &'static str,
    /// Its meaning, with the order of its components.
    pub meaning: &'static str,
}

macro_rules! fields {
    ($($(#[$doc:meta])* $field:ident = $code:literal, $name:literal, $shape:literal, $unit:literal,
        $meaning:literal;)*) => {
        wire_enum! {
            /// A named block of numbers in a request or an answer. Fields are packed in the order
            /// of their numbers.
            #[derive(PartialOrd, Ord)]
            Field: u8 { $($(#[$doc])* $field = $code, $name;)* }
        }

        /// Every field, in the order of the field numbers.
        pub const FIELDS: [FieldEntry; Field::ALL.len()] = [$(FieldEntry {
            field: Field::$field,
            shape: $shape,
            unit: $unit,
            meaning: $meaning,
        },)*];
    };
}

fields! {
    /// Independent coordinates y `[m, rad]` (n_qy).
    Y = 0, "y", "n_qy", "m, rad", "independent coordinates y";
    /// Independent velocities ẏ (n_vy).
    Yd = 1, "yd", "n_vy", "m/s, rad/s", "independent velocities ẏ";
    /// Independent accelerations ÿ (n_vy).
    Ydd = 2, "ydd", "n_vy", "m/s², rad/s²", "independent accelerations ÿ";
    /// Tree coordinates q (n_q).
    Q = 3, "q", "n_q", "m, rad",
        "tree coordinates q; a floating base has position and quaternion x, y, z, w";
    /// Tree velocities q̇ (n_v).
    Qd = 4, "qd", "n_v", "m/s, rad/s", "tree velocities q̇";
    /// Tree accelerations q̈ (n_v).
    Qdd = 5, "qdd", "n_v", "m/s², rad/s²", "tree accelerations q̈";
    /// Actuator coordinates u (n_u).
    U = 6, "u", "n_u", "m, rad", "actuator coordinates u";
    /// Actuator velocities u̇ (n_u).
    Ud = 7, "ud", "n_u", "m/s, rad/s", "actuator velocities u̇";
    /// Actuator accelerations ü (n_u).
    Udd = 8, "udd", "n_u", "m/s², rad/s²", "actuator accelerations ü";
    /// A closed pose near the answer from which numerical closures continue (n_q).
    QGuess = 9, "q_guess", "n_q", "m, rad",
        "closed pose near the answer, from which numerical closures start";
    /// The tree velocity at the guess: where branches cross, the numerical closure continues
    /// along it (n_v).
    QdGuess = 10, "qd_guess", "n_v", "m/s, rad/s",
        "tree velocity at `q_guess`, the direction where branches cross";
    /// Generalised forces on the tree coordinates (n_v).
    TauQ = 11, "tau_q", "n_v", "N, N m", "generalised forces on the tree coordinates";
    /// Generalised forces on the independent coordinates (n_vy).
    TauY = 12, "tau_y", "n_vy", "N, N m", "generalised forces on the independent coordinates";
    /// Actuator forces (n_u).
    TauU = 13, "tau_u", "n_u", "N, N m", "actuator forces";
    /// Wrenches `[n; f]` on the named links, world axes at the link's origin, acting on the
    /// robot (n_wrenches × 6).
    Wrenches = 14, "wrenches", "n_wrenches × 6", "N m, N",
        "wrenches [n; f] on the named links, world axes at the link's origin";
    /// The part of `tau_y` that no actuator can give (n_vy).
    TauUnactuated = 15, "tau_unactuated", "n_vy", "N, N m",
        "part of `tau_y` that no actuator can give";
    /// Loop Jacobian, q̇ = G ẏ (n_v × n_vy).
    G = 16, "G", "n_v × n_vy", "mixed", "loop Jacobian, q̇ = G ẏ";
    /// q̈ = G ÿ + g (n_v).
    GBias = 17, "g_bias", "n_v", "m/s², rad/s²", "q̈ = G ÿ + g";
    /// Actuator rows of G (n_u × n_vy).
    GU = 18, "G_u", "n_u × n_vy", "mixed", "actuator rows of G, u̇ = G_u ẏ";
    /// ü = G_u ÿ + g_u (n_u).
    GUBias = 19, "g_u", "n_u", "m/s², rad/s²", "ü = G_u ÿ + g_u";
    /// Constraint Jacobian, K q̇ = 0 (n_c × n_v).
    K = 20, "K", "n_c × n_v", "mixed", "constraint Jacobian, K q̇ = 0";
    /// K q̈ = k, k = −K̇ q̇ (n_c).
    KBias = 21, "k_bias", "n_c", "m/s², rad/s²", "K q̈ = k, k = −K̇ q̇";
    /// Loop-closure forces and moments along the rows of K `[N, N m]` (n_c).
    Lambda = 22, "lambda", "n_c", "N, N m", "loop-closure forces";
    /// Reduced mass matrix GᵀMG (n_vy × n_vy).
    MY = 23, "M_y", "n_vy × n_vy", "mixed", "reduced mass matrix GᵀMG";
    /// Reduced bias force Gᵀ(C + M g) (n_vy).
    CY = 24, "C_y", "n_vy", "N, N m", "reduced bias force Gᵀ(C + M g)";
    /// Largest scaled loop residual (1).
    Residual = 25, "residual", "1", "-", "largest scaled loop residual";
    /// Newton steps taken (1).
    Iterations = 26, "iterations", "1", "-", "Newton steps taken";
    /// 2-norm condition number of K_d = ∂φ/∂q_d, unscaled (1).
    CondKd = 27, "cond_Kd", "1", "-", "2-norm condition number of K_d, unscaled";
    /// 2-norm condition number of G_u, unscaled (1).
    CondGu = 28, "cond_Gu", "1", "-", "2-norm condition number of G_u, unscaled";
    /// Distance to singularity: least singular value of the scaled K_d over all clusters (1).
    SigmaMin = 29, "sigma_min", "1", "-",
        "least singular value of the scaled K_d over all clusters";
    /// The closest reachable independent coordinates found (n_qy).
    NearestY = 30, "nearest_y", "n_qy", "m, rad", "closest reachable independent coordinates found";
    /// Pose of each wanted frame in the root frame: position and quaternion x, y, z, w
    /// (n_frames × 7).
    FramePose = 31, "frame_pose", "n_frames × 7", "m, -",
        "pose of each frame in the root frame: position, then quaternion x, y, z, w";
    /// Twist `[ω; v]` of each wanted frame, world axes at the frame's origin (n_frames × 6).
    FrameTwist = 32, "frame_twist", "n_frames × 6", "rad/s, m/s",
        "twist [ω; v] of each frame, world axes at the frame's origin";
    /// Classical acceleration of each wanted frame, gravity not included (n_frames × 6).
    FrameAcc = 33, "frame_acc", "n_frames × 6", "rad/s², m/s²",
        "classical acceleration [ω̇; v̇] of each frame, gravity not included";
    /// Frame Jacobians over the tree velocities (6 n_frames × n_v).
    JacobianTree = 34, "jacobian_tree", "6 n_frames × n_v", "mixed",
        "frame Jacobians, [ω; v] = J q̇";
    /// Frame Jacobians over the independent velocities (6 n_frames × n_vy).
    JacobianIndependent = 35, "jacobian_independent", "6 n_frames × n_vy", "mixed",
        "frame Jacobians, [ω; v] = J ẏ";
    /// Frame Jacobians over the actuator velocities, where these determine the motion (6
    /// n_frames × n_u).
    JacobianActuator = 36, "jacobian_actuator", "6 n_frames × n_u", "mixed",
        "frame Jacobians, [ω; v] = J u̇, where u̇ determines the motion";
    /// 2-norm condition number of M_y (1).
    CondMy = 37, "cond_My", "1", "-", "2-norm condition number of M_y";
    /// Branch of each cluster with loops that is not a pure coupling: the sign of det K_d, 1 or
    /// −1 (n_branches).
    Branch = 38, "branch", "n_branches", "-",
        "sign of det K_d of each cluster that is not a pure coupling: 1 or −1";
    /// 1 where a loop-closure force is determined by the motion, 0 where redundant rows share
    /// it (n_c).
    LambdaDeterminate = 39, "lambda_determinate", "n_c", "-",
        "1 where the motion determines the loop-closure force, 0 where redundant rows share it";
    /// 1 where a tree velocity belongs to a set of independents that is good at this pose, else
    /// 0 (n_v).
    GoodIndependents = 40, "good_independents", "n_v", "-",
        "1 where the tree velocity is in a set of independents that is good at this pose, else 0";
    /// The direction of ẏ, of unit length, that the actuators control least; after a singular
    /// actuation the uncontrolled one (n_vy).
    Uncontrolled = 41, "uncontrolled", "n_vy", "mixed",
        "direction of ẏ, of unit length, that the actuators control least";
    /// The largest distance that the answer's state moved from the given q or q̇, in radians or
    /// lengths of the cluster (1).
    Projection = 42, "projection", "1", "rad or lengths of the cluster",
        "largest distance from the given q or q̇ to the answer's state";
    /// Excess of each tree coordinate, its velocity and its actuator's force over their limits:
    /// negative below, positive above, zero inside or without a limit (n_v × 3).
    Limits = 43, "limits", "n_v × 3", "mixed",
        "distance of position, velocity and actuator force beyond their limits, zero inside";
    /// Centre of mass of the moving links, in the root frame `[m]` (3).
    Com = 44, "com", "3", "m", "centre of mass of the moving links in the root frame";
    /// Its Jacobian over the independent velocities (3 × n_vy).
    ComJacobian = 45, "com_jacobian", "3 × n_vy", "mixed", "Jacobian of the centre of mass over ẏ";
    /// Its acceleration at ÿ = 0 `[m/s²]` (3).
    ComBias = 46, "com_bias", "3", "m/s²", "acceleration of the centre of mass at ÿ = 0";
    /// Momentum of the moving links without rotors, root axes: angular about the centre of
    /// mass, linear `[N m s, N s]` (6).
    Momentum = 47, "momentum", "6", "N m s, N s",
        "momentum of the moving links without rotors, root axes: angular about com, linear";
    /// Centroidal matrix A: momentum = A ẏ (6 × n_vy).
    Centroidal = 48, "centroidal", "6 × n_vy", "mixed", "centroidal matrix A, momentum = A ẏ";
    /// Kinetic energy with rotors; potential energy of gravity, zero at the root's origin, and
    /// of springs `[J]` (2).
    Energy = 49, "energy", "2", "J",
        "kinetic energy with rotors, potential energy of gravity (zero at the origin) and springs";
    /// Classical acceleration of each wanted frame at ÿ = 0, J̇ ẏ (n_frames × 6).
    JdYd = 50, "Jd_yd", "n_frames × 6", "rad/s², m/s²", "acceleration of each frame at ÿ = 0, J̇ ẏ";
    /// ∂τ_y/∂y at fixed ẏ and ÿ; the column of a ball or floating joint is that of a turn or
    /// slide in its body (n_vy × n_vy).
    DtauYDy = 51, "dtau_y_dy", "n_vy × n_vy", "mixed",
        "∂τ_y/∂y at fixed ẏ and ÿ; of quaternion joints in body axes";
    /// ∂τ_y/∂ẏ (n_vy × n_vy).
    DtauYDyd = 52, "dtau_y_dyd", "n_vy × n_vy", "mixed", "∂τ_y/∂ẏ";
    /// ∂τ_u/∂y at fixed ẏ and ÿ (n_u × n_vy).
    DtauUDy = 53, "dtau_u_dy", "n_u × n_vy", "mixed", "∂τ_u/∂y at fixed ẏ and ÿ";
    /// ∂τ_u/∂ẏ (n_u × n_vy).
    DtauUDyd = 54, "dtau_u_dyd", "n_u × n_vy", "mixed", "∂τ_u/∂ẏ";
    /// ∂ÿ/∂y at fixed ẏ and the fixed given force (n_vy × n_vy).
    DyddDy = 55, "dydd_dy", "n_vy × n_vy", "mixed", "∂ÿ/∂y at fixed ẏ and the fixed given force";
    /// ∂ÿ/∂ẏ (n_vy × n_vy).
    DyddDyd = 56, "dydd_dyd", "n_vy × n_vy", "mixed", "∂ÿ/∂ẏ at the fixed given force";
    /// ∂ÿ/∂τ_u = M_y⁻¹ G_uᵀ (n_vy × n_u).
    DyddDtauU = 57, "dydd_dtau_u", "n_vy × n_u", "mixed", "∂ÿ/∂τ_u = M_y⁻¹ G_uᵀ";
    /// Derivative of `tau_unactuated` by y (n_vy × n_vy).
    DtauUnactuatedDy = 58, "dtau_unactuated_dy", "n_vy × n_vy", "mixed",
        "derivative of `tau_unactuated` by y";
    /// Derivative of `tau_unactuated` by ẏ (n_vy × n_vy).
    DtauUnactuatedDyd = 59, "dtau_unactuated_dyd", "n_vy × n_vy", "mixed",
        "derivative of `tau_unactuated` by ẏ";
    /// Rate of G along the motion (n_v × n_vy).
    Gd = 60, "Gd", "n_v × n_vy", "mixed", "rate of G along the motion";
    /// ∂q̈/∂y at fixed ẏ and ÿ (n_v × n_vy).
    DqddDy = 61, "dqdd_dy", "n_v × n_vy", "mixed", "∂q̈/∂y at fixed ẏ and ÿ";
    /// ∂g/∂ẏ, which is ∂q̈/∂ẏ at fixed ÿ (n_v × n_vy).
    DgBiasDyd = 62, "dg_bias_dyd", "n_v × n_vy", "mixed", "∂g/∂ẏ, which is ∂q̈/∂ẏ at fixed ÿ";
    /// ∂(J ẏ)/∂y of each wanted frame at fixed ẏ (6 n_frames × n_vy).
    DjacobianDy = 63, "djacobian_dy", "6 n_frames × n_vy", "mixed",
        "∂(J ẏ)/∂y of each frame at fixed ẏ";
    /// Directions of ẏ of the wanted supports (n_directions × n_vy).
    Directions = 64, "directions", "n_directions × n_vy", "mixed",
        "directions d of the wanted supports";
    /// Stiffness and damping of a law τ_u = K (u* − u) − D u̇ of each actuator (n_u × 2).
    GainsU = 65, "gains_u", "n_u × 2", "mixed",
        "stiffness and damping of each actuator, τ_u = K (u* − u) − D u̇";
    /// Vertices of the set of forces G_uᵀ τ_u that the actuators can give, over the wanted
    /// independents with the others free; with two of them in their order around it
    /// ([`crate::most_vertices`] × n_vy).
    TorqueVertices = 66, "torque_vertices", "n_vertices × n_vy", "N, N m",
        "vertices of the set of τ_y = G_uᵀ τ_u within the actuators' limits; missing rows are NaN";
    /// The largest dᵀ G_uᵀ τ_u of each given direction d (n_directions).
    TorqueSupport = 67, "torque_support", "n_directions", "mixed",
        "largest dᵀ G_uᵀ τ_u within the actuators' limits";
    /// As `torque_vertices`, less C_y − Gᵀ Σ Jᵀ w of the state.
    TorqueVerticesNet = 68, "torque_vertices_net", "n_vertices × n_vy", "N, N m",
        "`torque_vertices` − C_y + Gᵀ Σ Jᵀ w";
    /// As `torque_support`, less dᵀ (C_y − Gᵀ Σ Jᵀ w) of the state.
    TorqueSupportNet = 69, "torque_support_net", "n_directions", "mixed",
        "`torque_support` − dᵀ (C_y − Gᵀ Σ Jᵀ w)";
    /// Vertices of the set of velocities ẏ that the speed limits of the actuators leave, over
    /// the wanted independents with the others free, where mechanisms have no more actuators
    /// than freedoms ([`crate::most_vertices`] × n_vy).
    SpeedVertices = 70, "speed_vertices", "n_vertices × n_vy", "m/s, rad/s",
        "vertices of the set of ẏ within the actuators' speed limits; missing rows are NaN";
    /// Inertia of the rotors, G_uᵀ J G_u (n_vy × n_vy).
    ReflectedInertia = 71, "reflected_inertia", "n_vy × n_vy", "mixed",
        "inertia of the rotors, G_uᵀ J G_u";
    /// Damping of the actuators, G_uᵀ D G_u (n_vy × n_vy).
    ReflectedDamping = 72, "reflected_damping", "n_vy × n_vy", "mixed",
        "damping of the actuators, G_uᵀ D G_u";
    /// Velocity terms of the rotors, G_uᵀ J g_u (n_vy).
    ReflectedForce = 73, "reflected_force", "n_vy", "N, N m",
        "velocity terms of the rotors, G_uᵀ J g_u";
    /// The law of `gains_u` along the independents at forces τ_u of the state: τ_y changes by
    /// −K_y δy − D_y δẏ. K_y = G_uᵀ K G_u − Σ τ_u ∂²u (n_vy columns), D_y = G_uᵀ D G_u (n_vy
    /// columns) and the force G_uᵀ τ_u (n_vy × (2 n_vy + 1)).
    GainsY = 74, "gains_y", "n_vy × (2 n_vy + 1)", "mixed",
        "`gains_u` along y at τ_u: K_y = G_uᵀ K G_u − Σ τ_u ∂²u, D_y = G_uᵀ D G_u, force G_uᵀ τ_u";
    /// The largest s such that the actuators of the wanted independents can give s τ_y (1).
    Margin = 75, "margin", "1", "-", "largest s such that the actuators can give s τ_y";
    /// s τ_y with s ≤ 1 and ≤ `margin` (n_vy).
    Clip = 76, "clip", "n_vy", "N, N m", "s τ_y with s ≤ 1 and s ≤ `margin`";
    /// G_uᵀ τ_u of the forces τ_u within the limits with the least Σ ((τ_u − τ_u*) / τ_max)²
    /// from those of τ_y (n_vy).
    ClipNearest = 77, "clip_nearest", "n_vy", "N, N m",
        "G_uᵀ τ_u of the τ_u within the limits nearest to that of τ_y";
    /// 1 at an active upper bound, −1 at a lower one, else 0: position, velocity and actuator
    /// force of each tree coordinate; a last row for the clearance (n_v + 1 × 3). The bounds
    /// that a search met, or the forces at their limits at `margin` times τ_y.
    Binding = 78, "binding", "n_v + 1 × 3", "-",
        "1 or −1 at an active bound of position, velocity, effort; last row: clearance";
    /// Time since the state of the given `observer`, or in which a step keeps its limits `[s]`
    /// (1).
    Dt = 79, "dt", "1", "s", "time since the state of `observer`, or of a step";
    /// Bandwidth of the observer `[1/s]` (1).
    Gain = 80, "gain", "1", "1/s", "bandwidth of the observer";
    /// State of the momentum observer, a row of each independent: external force, momentum,
    /// and the rate of the momentum without external forces (n_vy × 3).
    Observer = 81, "observer", "n_vy × 3", "mixed",
        "state of the momentum observer: external force, momentum, its rate without that force";
    /// Forces along the independents that none of the given ones explains (n_vy).
    TauExternal = 82, "tau_external", "n_vy", "N m, N",
        "forces along the independents that no given one explains";
    /// Inertia of the frames together, Λ = (J M_y⁻¹ Jᵀ)⁺ (6 n_frames × 6 n_frames).
    TaskInertia = 83, "Lambda", "6 n_frames × 6 n_frames", "mixed",
        "inertia of the frames, Λ = (J M_y⁻¹ Jᵀ)⁺";
    /// Force of velocities and dampers at the frames, μ = Λ (J M_y⁻¹ h − J̇ ẏ) (6 n_frames).
    TaskBias = 84, "mu", "6 n_frames", "N m, N",
        "force of velocities and dampers, Λ (J M_y⁻¹ h − J̇ ẏ), h their force along y";
    /// Force of gravity and springs at the frames, p = Λ J M_y⁻¹ g (6 n_frames).
    TaskGravity = 85, "p_task", "6 n_frames", "N m, N", "force of gravity and springs, Λ J M_y⁻¹ g";
    /// Rank of J M_y⁻¹ Jᵀ, and its least singular value that counts over the largest (2).
    TaskRank = 86, "task_rank", "2", "-",
        "rank of J M_y⁻¹ Jᵀ; its least singular value that counts over the largest";
    /// Targets of the tasks: position, quaternion x, y, z, w, direction of the frame's z axis,
    /// weight; numbers of parts that a task does not have are not read (n_frames × 11).
    TaskTarget = 87, "task_target", "n_frames × 11", "m, -",
        "target of each task: position, quaternion x, y, z, w, direction of the z axis, weight";
    /// Target of the centre of mass, in the root frame `[m]` (3).
    ComTarget = 88, "com_target", "3", "m", "target of the centre of mass in the root frame";
    /// Least and greatest value of each independent coordinate, instead of the model's
    /// (n_qy × 2).
    BoundsY = 89, "bounds_y", "n_qy × 2", "m, rad", "bounds of y instead of the model's";
    /// Least and greatest value of each actuator coordinate, instead of the model's (n_u × 2).
    BoundsU = 90, "bounds_u", "n_u × 2", "m, rad", "bounds of u instead of the model's";
    /// Least `sigma_min` (1).
    Clearance = 91, "clearance", "1", "-", "least `sigma_min`";
    /// Independent coordinates from which a search starts (n_qy).
    YGuess = 92, "y_guess", "n_qy", "m, rad", "y from which a search starts";
    /// Independent coordinates to stay near to, after all tasks (n_qy).
    YPreferred = 93, "y_preferred", "n_qy", "m, rad", "y to stay near to, after all tasks";
    /// Distance or angle to each target, the larger one, and of the centre of mass, NaN without
    /// one (n_frames + 1).
    TaskResidual = 94, "task_residual", "n_frames + 1", "m, rad",
        "distance or angle to each target, the larger one; last that of the centre of mass";
    /// Independent coordinates of every solution found, NaN behind the last (16 × n_qy).
    Solutions = 95, "solutions", "16 × n_qy", "m, rad",
        "y of every solution found, NaN behind the last";
    /// Wanted twist of each frame, or its wanted acceleration, and the weight (n_frames × 7).
    TaskMotion = 96, "task_motion", "n_frames × 7", "mixed",
        "wanted twist or acceleration [ω; v] of each frame, weight";
    /// Moment and force of the ground on each held frame, root axes at its origin; NaN for the
    /// others (n_frames × 6).
    ContactForces = 97, "contact_forces", "n_frames × 6", "N m, N",
        "moment and force of the ground on each held frame, root axes at its origin; others NaN";
    /// Y_y of τ_y = Y_y π + springs − wrenches: columns in the order of
    /// [`crate::ModelInfo::parameters`] (n_vy × n_parameters).
    RegressorY = 98, "regressor_y", "n_vy × n_parameters", "mixed",
        "Y_y of τ_y = Y_y π + springs − wrenches";
    /// Y_u of τ_u, likewise (n_u × n_parameters).
    RegressorU = 99, "regressor_u", "n_u × n_parameters", "mixed",
        "Y_u of τ_u = Y_u π + springs − wrenches";
    /// Direction of second derivatives: in y, in ẏ, and in τ_u, which inverse dynamics does not
    /// read (2 n_vy + n_u).
    Direction = 100, "direction", "2 n_vy + n_u", "mixed",
        "direction v of second derivatives: in y, in ẏ, in τ_u";
    /// μ, which multiplies the rows of second derivatives (n_vy).
    Multipliers = 101, "multipliers", "n_vy", "mixed", "μ of second derivatives";
    /// Derivative of [∂τ_y/∂y ∂τ_y/∂ẏ] along `direction` (n_vy × 2 n_vy), or with
    /// `multipliers` the vector of μᵀ times it (2 n_vy).
    D2TauYV = 102, "d2_tau_y_v", "n_vy × 2 n_vy", "mixed",
        "derivative of [∂τ_y/∂y ∂τ_y/∂ẏ] along v; with μ, μᵀ times it";
    /// Derivative of [∂ÿ/∂y ∂ÿ/∂ẏ ∂ÿ/∂τ_u] along `direction` (n_vy × (2 n_vy + n_u)), or with
    /// `multipliers` the vector of μᵀ times it (2 n_vy + n_u).
    D2YddV = 103, "d2_ydd_v", "n_vy × (2 n_vy + n_u)", "mixed",
        "derivative of [∂ÿ/∂y ∂ÿ/∂ẏ ∂ÿ/∂τ_u] along v; with μ, μᵀ times it";
    /// Combinations of parameters that forces along some motion tell, each in the place of the
    /// parameter that it replaces, NaN in others; of the model, at no state (n_parameters).
    BaseParameters = 104, "base_parameters", "n_parameters", "mixed",
        "base parameters of the model in the places of their own parameters, NaN in others";
    /// ∂q/∂θ at fixed y, of tree velocities, then turn and slide of each wanted frame in the axes
    /// of its Jacobian; columns in the order of [`crate::ModelInfo::geometry`]
    /// (n_v + 6 n_frames × n_geometry).
    DgammaDtheta = 105, "dgamma_dtheta", "n_v + 6 n_frames × n_geometry", "mixed",
        "∂q/∂θ at fixed y, then [turn; slide] of each frame by θ, the places of joints and cuts";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sizes;

    #[test]
    fn rows_are_in_the_order_of_the_fields_and_shapes_are_those_of_the_layout() {
        let sizes = Sizes {
            n_q: 2,
            n_v: 3,
            n_qy: 5,
            n_vy: 7,
            n_u: 11,
            n_c: 13,
            n_branches: 17,
            n_bodies: 29,
            n_cuts: 31,
        };
        let n_frames = 19;
        let n_wrenches = 23;
        let size = |word: &str| match word {
            // of one direction
            "n_directions" => 1,
            "n_vertices" => crate::most_vertices(sizes.n_u, sizes.n_vy),
            "(2" => 2,
            "+" | "1)" => 1,
            "n_u)" => sizes.n_u,
            "n_q" => sizes.n_q,
            "n_v" => sizes.n_v,
            "n_qy" => sizes.n_qy,
            "n_vy" => sizes.n_vy,
            "n_u" => sizes.n_u,
            "n_c" => sizes.n_c,
            "n_branches" => sizes.n_branches,
            "n_parameters" => sizes.n_parameters(),
            "n_geometry" => sizes.n_geometry(),
            "n_frames" => n_frames,
            "n_wrenches" => n_wrenches,
            number => number.parse().unwrap(),
        };
        for (entry, field) in FIELDS.iter().zip(Field::ALL) {
            assert_eq!(entry.field, *field);
            let term = |term: &str| term.split(' ').map(size).product::<usize>();
            let mut factors =
                entry.shape.split(" × ").map(|part| part.split(" + ").map(term).sum());
            let shape = (factors.next().unwrap(), factors.next().unwrap_or(1));
            assert_eq!(shape, field.shape(&sizes, n_frames, n_wrenches), "{}", field.name());
        }
    }
}
