//! The table of the fields: name, shape, unit and meaning. `sarrus ask --fields`, its help, the
//! manual page and `.ci/book.py` take their texts from it.

use crate::Field;

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
    ($($field:ident $shape:literal $unit:literal $meaning:literal;)*) => {
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
    Y "n_qy" "m, rad" "independent coordinates y";
    Yd "n_vy" "m/s, rad/s" "independent velocities ẏ";
    Ydd "n_vy" "m/s², rad/s²" "independent accelerations ÿ";
    Q "n_q" "m, rad" "tree coordinates q; a floating base has position and quaternion x, y, z, w";
    Qd "n_v" "m/s, rad/s" "tree velocities q̇";
    Qdd "n_v" "m/s², rad/s²" "tree accelerations q̈";
    U "n_u" "m, rad" "actuator coordinates u";
    Ud "n_u" "m/s, rad/s" "actuator velocities u̇";
    Udd "n_u" "m/s², rad/s²" "actuator accelerations ü";
    QGuess "n_q" "m, rad" "closed pose near the answer, from which numerical closures start";
    QdGuess "n_v" "m/s, rad/s" "tree velocity at `q_guess`, the direction where branches cross";
    TauQ "n_v" "N, N m" "generalised forces on the tree coordinates";
    TauY "n_vy" "N, N m" "generalised forces on the independent coordinates";
    TauU "n_u" "N, N m" "actuator forces";
    Wrenches "n_wrenches × 6" "N m, N"
        "wrenches [n; f] on the named links, world axes at the link's origin";
    TauUnactuated "n_vy" "N, N m" "part of `tau_y` that no actuator can give";
    G "n_v × n_vy" "mixed" "loop Jacobian, q̇ = G ẏ";
    GBias "n_v" "m/s², rad/s²" "q̈ = G ÿ + g";
    GU "n_u × n_vy" "mixed" "actuator rows of G, u̇ = G_u ẏ";
    GUBias "n_u" "m/s², rad/s²" "ü = G_u ÿ + g_u";
    K "n_c × n_v" "mixed" "constraint Jacobian, K q̇ = 0";
    KBias "n_c" "m/s², rad/s²" "K q̈ = k, k = −K̇ q̇";
    Lambda "n_c" "N, N m" "loop-closure forces";
    MY "n_vy × n_vy" "mixed" "reduced mass matrix GᵀMG";
    CY "n_vy" "N, N m" "reduced bias force Gᵀ(C + M g)";
    Residual "1" "-" "largest scaled loop residual";
    Iterations "1" "-" "Newton steps taken";
    CondKd "1" "-" "2-norm condition number of K_d, unscaled";
    CondGu "1" "-" "2-norm condition number of G_u, unscaled";
    SigmaMin "1" "-" "least singular value of the scaled K_d over all clusters";
    NearestY "n_qy" "m, rad" "closest reachable independent coordinates found";
    FramePose "n_frames × 7" "m, -"
        "pose of each frame in the root frame: position, then quaternion x, y, z, w";
    FrameTwist "n_frames × 6" "rad/s, m/s"
        "twist [ω; v] of each frame, world axes at the frame's origin";
    FrameAcc "n_frames × 6" "rad/s², m/s²"
        "classical acceleration [ω̇; v̇] of each frame, gravity not included";
    JacobianTree "6 n_frames × n_v" "mixed" "frame Jacobians, [ω; v] = J q̇";
    JacobianIndependent "6 n_frames × n_vy" "mixed" "frame Jacobians, [ω; v] = J ẏ";
    JacobianActuator "6 n_frames × n_u" "mixed"
        "frame Jacobians, [ω; v] = J u̇, where u̇ determines the motion";
    CondMy "1" "-" "2-norm condition number of M_y";
    Branch "n_branches" "-" "sign of det K_d of each cluster that is not a pure coupling: 1 or −1";
    LambdaDeterminate "n_c" "-"
        "1 where the motion determines the loop-closure force, 0 where redundant rows share it";
    GoodIndependents "n_v" "-"
        "1 where the tree velocity is in a set of independents that is good at this pose, else 0";
    Uncontrolled "n_vy" "mixed" "direction of ẏ, of unit length, that the actuators control least";
    Projection "1" "rad or lengths of the cluster"
        "largest distance from the given q or q̇ to the answer's state";
    Limits "n_v × 3" "mixed"
        "distance of position, velocity and actuator force beyond their limits, zero inside";
    Com "3" "m" "centre of mass of the moving links in the root frame";
    ComJacobian "3 × n_vy" "mixed" "Jacobian of the centre of mass over ẏ";
    ComBias "3" "m/s²" "acceleration of the centre of mass at ÿ = 0";
    Momentum "6" "N m s, N s"
        "momentum of the moving links without rotors, root axes: angular about com, linear";
    Centroidal "6 × n_vy" "mixed" "centroidal matrix A, momentum = A ẏ";
    Energy "2" "J"
        "kinetic energy with rotors, potential energy of gravity (zero at the origin) and springs";
    JdYd "n_frames × 6" "rad/s², m/s²" "acceleration of each frame at ÿ = 0, J̇ ẏ";
    DtauYDy "n_vy × n_vy" "mixed" "∂τ_y/∂y at fixed ẏ and ÿ; of quaternion joints in body axes";
    DtauYDyd "n_vy × n_vy" "mixed" "∂τ_y/∂ẏ";
    DtauUDy "n_u × n_vy" "mixed" "∂τ_u/∂y at fixed ẏ and ÿ";
    DtauUDyd "n_u × n_vy" "mixed" "∂τ_u/∂ẏ";
    DyddDy "n_vy × n_vy" "mixed" "∂ÿ/∂y at fixed ẏ and the fixed given force";
    DyddDyd "n_vy × n_vy" "mixed" "∂ÿ/∂ẏ at the fixed given force";
    DyddDtauU "n_vy × n_u" "mixed" "∂ÿ/∂τ_u = M_y⁻¹ G_uᵀ";
    DtauUnactuatedDy "n_vy × n_vy" "mixed" "derivative of `tau_unactuated` by y";
    DtauUnactuatedDyd "n_vy × n_vy" "mixed" "derivative of `tau_unactuated` by ẏ";
    Gd "n_v × n_vy" "mixed" "rate of G along the motion";
    DqddDy "n_v × n_vy" "mixed" "∂q̈/∂y at fixed ẏ and ÿ";
    DgBiasDyd "n_v × n_vy" "mixed" "∂g/∂ẏ, which is ∂q̈/∂ẏ at fixed ÿ";
    DjacobianDy "6 n_frames × n_vy" "mixed" "∂(J ẏ)/∂y of each frame at fixed ẏ";
    Directions "n_directions × n_vy" "mixed" "directions d of the wanted supports";
    GainsU "n_u × 2" "mixed" "stiffness and damping of each actuator, τ_u = K (u* − u) − D u̇";
    TorqueVertices "n_vertices × n_vy" "N, N m"
        "vertices of the set of τ_y = G_uᵀ τ_u within the actuators' limits; missing rows are NaN";
    TorqueSupport "n_directions" "mixed" "largest dᵀ G_uᵀ τ_u within the actuators' limits";
    TorqueVerticesNet "n_vertices × n_vy" "N, N m" "`torque_vertices` − C_y + Gᵀ Σ Jᵀ w";
    TorqueSupportNet "n_directions" "mixed" "`torque_support` − dᵀ (C_y − Gᵀ Σ Jᵀ w)";
    SpeedVertices "n_vertices × n_vy" "m/s, rad/s"
        "vertices of the set of ẏ within the actuators' speed limits; missing rows are NaN";
    ReflectedInertia "n_vy × n_vy" "mixed" "inertia of the rotors, G_uᵀ J G_u";
    ReflectedDamping "n_vy × n_vy" "mixed" "damping of the actuators, G_uᵀ D G_u";
    ReflectedForce "n_vy" "N, N m" "velocity terms of the rotors, G_uᵀ J g_u";
    GainsY "n_vy × (2 n_vy + 1)" "mixed"
        "`gains_u` along y at τ_u: K_y = G_uᵀ K G_u − Σ τ_u ∂²u, D_y = G_uᵀ D G_u, force G_uᵀ τ_u";
    Margin "1" "-" "largest s such that the actuators can give s τ_y";
    Clip "n_vy" "N, N m" "s τ_y with s ≤ 1 and s ≤ `margin`";
    ClipNearest "n_vy" "N, N m" "G_uᵀ τ_u of the τ_u within the limits nearest to that of τ_y";
    Binding "n_v + 1 × 3" "-"
        "1 or −1 at an active bound of position, velocity, effort; last row: clearance";
    Dt "1" "s" "time since the state of `observer`, or of a step";
    Gain "1" "1/s" "bandwidth of the observer";
    Observer "n_vy × 3" "mixed"
        "state of the momentum observer: external force, momentum, its rate without that force";
    TauExternal "n_vy" "N m, N" "forces along the independents that no given one explains";
    TaskInertia "6 n_frames × 6 n_frames" "mixed" "inertia of the frames, Λ = (J M_y⁻¹ Jᵀ)⁺";
    TaskBias "6 n_frames" "N m, N"
        "force of velocities and dampers, Λ (J M_y⁻¹ h − J̇ ẏ), h their force along y";
    TaskGravity "6 n_frames" "N m, N" "force of gravity and springs, Λ J M_y⁻¹ g";
    TaskRank "2" "-" "rank of J M_y⁻¹ Jᵀ; its least singular value that counts over the largest";
    TaskTarget "n_frames × 11" "m, -"
        "target of each task: position, quaternion x, y, z, w, direction of the z axis, weight";
    ComTarget "3" "m" "target of the centre of mass in the root frame";
    BoundsY "n_qy × 2" "m, rad" "bounds of y instead of the model's";
    BoundsU "n_u × 2" "m, rad" "bounds of u instead of the model's";
    Clearance "1" "-" "least `sigma_min`";
    YGuess "n_qy" "m, rad" "y from which a search starts";
    YPreferred "n_qy" "m, rad" "y to stay near to, after all tasks";
    TaskResidual "n_frames + 1" "m, rad"
        "distance or angle to each target, the larger one; last that of the centre of mass";
    Solutions "16 × n_qy" "m, rad" "y of every solution found, NaN behind the last";
    TaskMotion "n_frames × 7" "mixed" "wanted twist or acceleration [ω; v] of each frame, weight";
    ContactForces "n_frames × 6" "N m, N"
        "moment and force of the ground on each held frame, root axes at its origin; others NaN";
    RegressorY "n_vy × n_parameters" "mixed" "Y_y of τ_y = Y_y π + springs − wrenches";
    RegressorU "n_u × n_parameters" "mixed" "Y_u of τ_u = Y_u π + springs − wrenches";
    Direction "2 n_vy + n_u" "mixed" "direction v of second derivatives: in y, in ẏ, in τ_u";
    Multipliers "n_vy" "mixed" "μ of second derivatives";
    D2TauYV "n_vy × 2 n_vy" "mixed" "derivative of [∂τ_y/∂y ∂τ_y/∂ẏ] along v; with μ, μᵀ times it";
    D2YddV "n_vy × (2 n_vy + n_u)" "mixed"
        "derivative of [∂ÿ/∂y ∂ÿ/∂ẏ ∂ÿ/∂τ_u] along v; with μ, μᵀ times it";
    BaseParameters "n_parameters" "mixed"
        "base parameters of the model in the places of their own parameters, NaN in others";
    DgammaDtheta "n_v + 6 n_frames × n_geometry" "mixed"
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
