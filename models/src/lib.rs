//! Turns robot files into checked descriptions: URDF for the spanning tree, submechanism YAML for
//! the loops, or MJCF or SDF for both; [`export()`] writes a robot for other programs. Contains 28
//! bundled robots.
//!
//! ```
//! use sarrus_models::{Options, Source, load, texts};
//!
//! let loaded = load(&Source::Bundled("lambda".into()), &Options::default())?;
//! assert_eq!(loaded.description.joints.len(), 3);
//! # Ok::<(), sarrus_models::LoadError>(())
//! ```
//!
//! Each text is read once, values together with their positions, and every fault of it is reported;
//! [`load`] compiles files without a fault. Faults that only the compiler sees have positions too.
//!
//! # Extensions of URDF
//! - Submechanism files in the keys of HyRoDyn: `type`, `contextual_name`, `name`, `file_path`,
//!   `jointnames`, `jointnames_spanningtree`, `jointnames_independent`, `jointnames_active`,
//!   `loop_constraints`. `file_path` is opened for a `TRANSMISSION` only, and only when the robot's
//!   URDF couples none of its joints: as in HyRoDyn, the submechanism's own URDF may then hold the
//!   couplings.
//! - On a submechanism, `closed_forms: off` for Newton's method on its rows alone.
//! - On a loop, `predecessor_placement: {xyz: [..], rpy: [..]}` and `successor_placement` instead
//!   of the frame of `cut_joint`.
//! - On a loop, `frames: [LINK, LINK]` instead of bodies and placements: the cut lies between the
//!   frames of these links.
//! - On a loop, `cut_joint_type` instead of `constraint_axes`: `spherical`, `weld`; `revolute`,
//!   `planar_revolute`, `prismatic` or `cylindrical` with `axis: [x, y, z]`; `universal` with
//!   `axis` on the predecessor and `axis2` on the successor, perpendicular to it. Axes are in the
//!   cut frame. The rows are named x y z (along the frame's axes), b c (the two directions across
//!   `axis`: b is the frame's axis that is least along it, made perpendicular, c = axis × b), with
//!   an r before them for turns, and u for the two axes of a universal joint.
//! - Joints of type `spherical`, or `ball`: q = x y z w, q̇ = ω in the child link. Like `floating`
//!   ones they need no axis and no limits.
//! - Joints of type `planar` (`NAME/x`, `NAME/y`, `NAME/rz`) and `universal` with `<axis>` and
//!   `<axis2>` (`NAME/r1`, `NAME/r2`), as chains of joints of one axis.
//! - On a joint `<dynamics damping spring_stiffness spring_reference/>`: the joint exerts −damping
//!   q̇ − stiffness (q − reference), in N, m or N m, rad. `friction` is not modelled, and one that
//!   is not zero is reported.
//! - A rotor: `<rotor_inertia value/>` (kg m², about its own axis) and `<gear_ratio value/>` or
//!   `<mechanicalReduction>` in the `<actuator>` of a `<transmission>` with one `<joint>`, with or
//!   without the prefix `drake:`; or `rotor_inertia` and `gear_ratio` on `<dynamics>`. It adds
//!   ratio² × inertia to the joint. Transmissions without a rotor and without `<depends_on>` are
//!   ignored.
//! - `springStiffness`, `springReference` and the mimic plug-in in `<gazebo>`; other elements there
//!   that change the dynamics are errors, as damping and springs of closing joints are.
//! - Loops in the elements of other programs (`<gazebo><joint>`, `<loop>`, `<loop_joint>`,
//!   `<constraint>`, `<drake:ball_constraint>`), and `<coupling>` of URDF+; the README has a table.
//! - `<mimic>`, and `<transmission>` with `<joint name><depends_on joint multiplier
//!   offset/></joint>`, as couplings; `polynomial` or `table` in place of `multiplier` is a curve.
//! - A SMURF file in place of the URDF, or a file of MJCF, SDF or Gepetto's tools, which [`import`]
//!   converts.
//!
//! Without a submechanism file every moving joint is independent and active in the order of the
//! URDF; floating joints are not active, joints with `<mimic>` follow. The same holds for joints
//! that no submechanism lists; they come last.
//!
//! # Limits
//! Files of 64 MiB, 64 levels of nesting, 4096 links, 1024 moving joints, six rows on a loop and
//! 1024 on all loops, aliases for 100000 values. A file beyond them is faulty, and so is one with
//! tags or a document type: reading costs time in proportion to the size of a file. A report lists
//! the first thousand errors and the first thousand warnings, and the number of the others.
#![forbid(unsafe_code)]

mod actuators;
mod assembly;
mod assembly_report;
mod base;
mod build;
mod bundled;
mod check;
pub mod closures;
mod contents;
mod cut;
mod dimensions;
mod error;
mod export;
mod gepetto;
mod import;
mod inertia;
mod load;
mod mjcf;
mod names;
mod number;
mod open;
mod pattern;
mod pose;
mod report;
mod rewrite;
mod rotation;
mod scene;
mod sdf;
mod smurf;
mod source;
mod submechanisms;
mod suggest;
mod text;
mod tree;
pub mod triangles;
mod units;
mod unlisted;
mod urdf;
pub mod yaml;

pub use actuators::{Published, published};
pub use assembly_report::{AssemblyReport, Moved, NewPlacements};
pub use base::Base;
pub use bundled::{bundled, bundled_text};
pub use check::{ActuatorReport, CheckReport, ClosureReport};
pub use dimensions::{Density, Dimensions, Length, Range};
pub use error::LoadError;
pub use export::{Exported, Target, as_tree, export};
pub use import::{Imported, import};
pub use load::{Loaded, Options};
pub use names::{nearest, nearest_first};
pub use pattern::matching_joints;
pub use report::{Diagnostic, Diagnostics, Report};
pub use rewrite::{NewZero, Rewritten, with_inertials};
pub use scene::Lock;
pub use source::{Source, assemble, load, suggest, texts};
pub use suggest::Suggestion;
