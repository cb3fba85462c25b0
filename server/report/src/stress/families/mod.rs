//! Families of stress cases, one a file: each sweeps a parameter and collects its cases.

pub(super) mod big_jumps;
pub(super) mod chains;
pub(super) mod conservation;
pub(super) mod faulty_files;
pub(super) mod gravity;
pub(super) mod idle_freedoms;
pub(super) mod inconsistent_starts;
pub(super) mod invalid_numbers;
pub(super) mod joint_terms;
pub(super) mod loops_in_one_subtree;
pub(super) mod many_turns;
pub(super) mod mass_ratios;
pub(super) mod massless_links;
pub(super) mod projection;
pub(super) mod quaternions;
pub(super) mod redundant_rows;
pub(super) mod simulation_starts;
pub(super) mod singular_poses;
pub(super) mod sizes;
pub(super) mod stabilisation;
pub(super) mod steps_and_tolerances;
pub(super) mod stiff_simulations;
pub(super) mod unreachable_targets;
pub(super) mod velocities;
pub(super) mod wrenches;
