//! One robot as plain data: links, joints, submechanisms and loops, by index.
//!
//! Readers of files fill a [`Description`]; [`crate::Model::compile`] turns it into the arrays of
//! the kernels.

use sarrus_proto::JointLimits;

/// One robot, as written.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the robot.
    pub name: String,
    /// Links; the root is the one that is no joint's child.
    pub links: Vec<Link>,
    /// Joints between links, fixed ones included.
    pub joints: Vec<Joint>,
    /// Submechanisms; their lists, joined in this order, give the order of q, y and u.
    pub submechanisms: Vec<Submechanism>,
    /// Gravity in root axes `[m/s²]`.
    pub gravity: [f64; 3],
    /// The zero pose, if dependent joints are not zero there: joints with their coordinates (n_q of
    /// each), in the order of the joints. Files have none. With it the loops of these joints are
    /// closed numerically, except for platforms on legs without arms.
    pub zero_pose: Vec<(usize, Vec<f64>)>,
}

/// A rigid link.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Unique name.
    pub name: String,
    /// Mass and inertia; without it the link is massless.
    pub inertial: Option<Inertial>,
}

/// Mass and inertia of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Pose of the centre of mass and its axes {link}.
    pub origin: Placement,
    /// Mass `[kg]`.
    pub mass: f64,
    /// ixx, ixy, ixz, iyy, iyz, izz about the centre of mass `[kg m²]` {origin}.
    pub inertia: [f64; 6],
}

/// A pose as URDF writes it: translation, then fixed-axis roll, pitch, yaw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placement {
    /// Translation `[m]`.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw about fixed axes `[rad]`.
    pub rpy: [f64; 3],
}

/// A joint of the spanning tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Kind of motion.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint frame (= the child link's frame at zero) {parent}.
    pub origin: Placement,
    /// Axis of motion, of any length but zero {joint frame}.
    pub axis: [f64; 3],
    /// Limits; used for warnings only.
    pub limits: Option<Limits>,
    /// A linear dependence on other joints (`<mimic>`, `<transmission>`).
    pub coupling: Option<Coupling>,
    /// Spring, damper, rotor and friction.
    pub terms: Terms,
    /// Limits of its motor beside those of effort and velocity.
    pub motor: Option<Motor>,
}

/// Spring, damper and rotor of a joint with one degree of freedom, or the damper of a ball joint;
/// the default is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms {
    /// Viscous damping d: the joint exerts −d q̇, a ball joint −d ω `[N s/m, N m s/rad]`.
    pub damping: f64,
    /// Spring: the joint exerts −k (q − rest) `[N/m, N m/rad]`, `[m, rad]`.
    pub stiffness: f64,
    /// Position at which the spring exerts nothing.
    pub rest: f64,
    /// Inertia I of the rotor about its own axis, which turns N times as fast as the joint: N² I is
    /// added to the joint's inertia `[kg m²]` (of a slider N is in rad/m).
    pub rotor_inertia: f64,
    /// Gear ratio N.
    pub gear_ratio: f64,
    /// Friction, which a query counts where it asks for it.
    pub friction: Friction,
}

impl Default for Terms {
    fn default() -> Terms {
        Terms {
            damping: 0.0,
            stiffness: 0.0,
            rest: 0.0,
            rotor_inertia: 0.0,
            gear_ratio: 1.0,
            friction: Friction::default(),
        }
    }
}

/// Friction of a joint of one freedom: it exerts −F tanh(q̇ / v₀) − d q̇.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Dry friction F `[N, N m]`.
    pub coulomb: f64,
    /// Viscous friction d `[N s/m, N m s/rad]`.
    pub viscous: f64,
    /// Speed v₀ `[m/s, rad/s]`.
    pub speed: f64,
}

impl Default for Friction {
    fn default() -> Friction {
        Friction { coulomb: 0.0, viscous: 0.0, speed: 0.01 }
    }
}

/// Limits of a motor at its joint, beside [`Limits::effort`] at any speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Force that it bears for ever `[N, N m]`; infinite where nothing is known.
    pub continuous: f64,
    /// Time constant of its winding's temperature `[s]`; infinite where it is not known.
    pub thermal_time: f64,
    /// Stiffness of the spring between it and the joint `[N/m, N m/rad]`; infinite where it is
    /// rigid. Simulations alone read it.
    pub series_stiffness: f64,
    /// Largest force over speed, (speed, force) by ascending speed with straight lines between,
    /// along the motion and against it; empty without such a limit.
    pub driving: Vec<[f64; 2]>,
    /// See `driving`.
    pub braking: Vec<[f64; 2]>,
    /// Largest mechanical power given `[W]`; infinite without a limit.
    pub power: f64,
    /// Part of the power that arrives at the joint when the motor drives, and at the motor when the
    /// joint does: it divides the forces that brake.
    pub efficiency: [f64; 2],
}

/// Motion that a joint allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum JointKind {
    /// None.
    Fixed,
    /// Rotation about the axis.
    Revolute,
    /// Rotation about the axis without limits.
    Continuous,
    /// Translation along the axis.
    Prismatic,
    /// All three rotations; q = x y z w, q̇ = ω in the body.
    Spherical,
    /// All six; q = [p; x y z w], q̇ = [ω; v] in the body.
    Floating,
}

/// Limits of a joint, in its own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least position.
    pub lower: f64,
    /// Greatest position.
    pub upper: f64,
    /// Greatest speed.
    pub velocity: f64,
    /// Greatest force or moment.
    pub effort: f64,
}

impl Limits {
    /// No limits.
    pub const NONE: Limits = Limits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
    };

    /// The limits that are numbers: an infinite one is none.
    pub fn finite(self) -> JointLimits {
        let Limits { lower, upper, velocity, effort } = self;
        let [lower, upper, velocity, effort] =
            [lower, upper, velocity, effort].map(|limit| limit.is_finite().then_some(limit));
        JointLimits { lower, upper, velocity, effort }
    }
}

/// q = Σ multiplier · q_master + offset + Σ f(q_of).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coupling {
    /// (joint index, multiplier) of each master.
    pub terms: Vec<(usize, f64)>,
    /// Constant part.
    pub offset: f64,
    /// (joint index, f) of each curve.
    pub curves: Vec<(usize, Curve)>,
}

/// A smooth function of the coordinate of a joint with one axis, `[m, rad]`.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// f = Σ c_k (q − about)^k, up to degree 5.
    Polynomial {
        /// Where the polynomial is c_0.
        about: f64,
        /// c_0 to at most c_5.
        coefficients: Vec<f64>,
    },
    /// The natural spline of degree 5 through at least three points [q, f] with rising q: four
    /// derivatives are continuous. Before the first point and after the last one it is a parabola.
    Table(Vec<[f64; 2]>),
}

impl Curve {
    /// The curve as a function of q − by.
    pub(crate) fn moved(&self, by: f64) -> Curve {
        match self {
            Curve::Polynomial { about, coefficients } => {
                Curve::Polynomial { about: about - by, coefficients: coefficients.clone() }
            }
            Curve::Table(points) => {
                Curve::Table(points.iter().map(|[x, y]| [x - by, *y]).collect())
            }
        }
    }
}

/// A named group of joints with its loops.
#[derive(Clone, Debug, PartialEq)]
pub struct Submechanism {
    /// Contextual name, unique by custom.
    pub name: String,
    /// How its loops are to be closed.
    pub kind: SubmechanismKind,
    /// The type as it was written.
    pub type_name: String,
    /// Moving joints, in the order of q.
    pub spanning_tree: Vec<usize>,
    /// Independent joints, in the order of y.
    pub independent: Vec<usize>,
    /// Actuated joints, in the order of u.
    pub active: Vec<usize>,
    /// Loops as given; empty where the type defines them.
    pub loops: Vec<Loop>,
    /// Closed forms may answer for Newton's method on the rows.
    pub closed_forms: bool,
}

sarrus_proto::named_enum! {
    /// How the loops of a submechanism are to be closed.
    #[non_exhaustive]
    pub enum SubmechanismKind {
        /// No loop.
        Serial = "SERIAL",
        /// Lambda: rocker, stator, slider.
        Rrpr = "RRPR",
        /// Two SPU legs around a universal joint.
        Spu2U1 = "2SPU+1U",
        /// Two SPRR legs around a universal joint.
        Sprr2U1 = "2SPRR+1U",
        /// Two SURRPR legs around a universal joint.
        Surrpr2U1 = "2SURRPR+1U",
        /// Six UPS legs.
        Ups6 = "6UPS",
        /// Three RUS legs, doubled (Active Ankle).
        Rus3x2 = "3RUS2",
        /// Parallelograms.
        ParallelogramChain = "PARALLELOGRAMCHAIN",
        /// Linear couplings.
        Transmission = "TRANSMISSION",
        /// Planar four-bar of any lengths: crank, coupler, rocker.
        FourBar = "FOURBAR",
        /// Crank, coupler, slider.
        SliderCrank = "SLIDERCRANK",
        /// Two wheels that a cage's spider ties: linear in its turns.
        Differential = "DIFFERENTIAL",
        /// Any loops, by Newton's method.
        Numerical = "NUMERICAL",
    }
}

/// One loop: two frames that coincide in some directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    /// Name of the cut.
    pub name: String,
    /// Index of the predecessor link.
    pub predecessor: usize,
    /// Index of the successor link.
    pub successor: usize,
    /// Where the two cut frames lie.
    pub cut: Cut,
    /// The constrained directions, in the axes of the predecessor's cut frame.
    pub rows: Vec<Row>,
}

/// Where the cut frames of a loop lie.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Cut {
    /// Both are the frame of this joint at the zero pose: closed at zero by construction.
    AtJoint(usize),
    /// Both are the frame of this link at the zero pose: closed at zero by construction.
    AtLink(usize),
    /// Placed explicitly on the predecessor and on the successor.
    Placed {
        /// Cut frame {predecessor link}.
        predecessor: Placement,
        /// Cut frame {successor link}.
        successor: Placement,
    },
}

/// One constrained direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the row.
    pub name: String,
    /// `[angular; linear]` {predecessor's cut frame}.
    pub axis: [f64; 6],
    /// A direction {successor's cut frame} that stays perpendicular to the angular part of `axis`:
    /// then the row is the product of the two, as in a universal joint, and the linear part does
    /// not count.
    pub against: Option<[f64; 3]>,
}
