//! A model before its closures are judged.

use std::sync::Arc;

use crate::compile::assemble::Assembly;
use crate::description::Description;
use crate::diagnostic::Diagnostic;
use crate::model::Model;
use crate::scalar::{Dd, Scalar};

impl Model<f64> {
    /// Bodies, clusters, rows and orders only; no row is used and no closure chosen.
    pub(crate) fn open(
        description: &Description,
        errors: &mut Vec<Diagnostic>,
    ) -> Option<Model<f64>> {
        let assembly = Assembly::new(description, errors)?;
        let mut model = assembly.model.map(Dd::to_f64);
        model.clusters.iter_mut().for_each(|cluster| cluster.used.clear());
        model.meta = Arc::new(assembly.meta);
        Some(model)
    }
}
