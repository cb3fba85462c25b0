//! How mechanisms are stopped.

/// How a mechanism is stopped, in the words of IEC 61800-5-2 where it has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopFunction {
    /// SS1: to a standstill within a time, then no torque.
    Ss1,
    /// STO: no torque at once.
    Sto,
}

impl StopFunction {
    /// The names in configurations.
    pub(super) const NAMES: &[&str] = &["ss1", "sto"];

    /// The function of a name; SS1 for any other.
    pub(super) fn named(name: &str) -> StopFunction {
        match name {
            "sto" => StopFunction::Sto,
            _ => StopFunction::Ss1,
        }
    }
}

/// The stop of one mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismStop {
    /// What it does.
    pub function: StopFunction,
    /// Time in which the mechanism stands still `[ns]`.
    pub stop_ns: u64,
}

impl Default for MechanismStop {
    fn default() -> MechanismStop {
        MechanismStop { function: StopFunction::Ss1, stop_ns: 500_000_000 }
    }
}
