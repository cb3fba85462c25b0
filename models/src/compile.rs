//! Stand-in for the compiler until `sarrus_dynamics::Model::compile` is there.
use sarrus_dynamics::description::Description;
use sarrus_dynamics::{CompileError, Fault};

/// Stand-in.
#[derive(Debug)]
pub struct Compiled {
    /// Warnings.
    pub warnings: Vec<Fault>,
}

pub(crate) fn compile(_description: &Description) -> Result<Compiled, CompileError> {
    Ok(Compiled { warnings: Vec::new() })
}
