//! Families of stress cases: parameter sweeps over robots, grouped by the target of the parameter,
//! and one file for each other family.

pub(super) mod chains;
pub(super) mod change_points;
pub(super) mod changed_robots;
pub(super) mod changed_states;
pub(super) mod cranks_that_turn;
pub(super) mod dead_points_in_series;
pub(super) mod faulty_files;
pub(super) mod idle_freedoms;
pub(super) mod inconsistent_input;
pub(super) mod invalid_numbers;
pub(super) mod light_behind_heavy;
pub(super) mod loops_that_cannot_close;
pub(super) mod lost_control;
pub(super) mod open_loops;
pub(super) mod poses;
pub(super) mod rods;
pub(super) mod simulated;
pub(super) mod targets_of_tasks;
