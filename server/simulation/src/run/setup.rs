//! A robot with its springs and inputs, and the checks of their numbers.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Compiled, Model};

use crate::coordinates::{Coordinates, places};
use crate::error::{Outcome, SimulationError};
use crate::forces::inputs::{Input, OnTree};
use crate::forces::springs::{Spring, Springs};
use crate::run::output::Sample;

/// A robot with its springs and inputs.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// The description of the robot's files: masses for the energy, and the source for compiling it
    /// with other independents.
    pub description: &'a Description,
    /// The compiled description.
    pub compiled: &'a Compiled,
    /// Springs and dampers between links.
    pub springs: &'a [Spring],
    /// Inputs on the joints.
    pub inputs: &'a [Input],
}

impl Setup<'_> {
    /// Forces of the inputs on the tree joints at each of these samples (n_v). Allocates.
    ///
    /// # Errors
    /// As [`crate::simulate`], for inputs and springs that do not fit the robot.
    pub fn forces<'s>(
        &self,
        samples: impl IntoIterator<Item = &'s Sample>,
    ) -> Outcome<Vec<Vec<f64>>> {
        let (_, inputs) = self.checked()?;
        let of = |sample: &Sample| {
            let mut tau_q = vec![0.0; self.compiled.model.sizes().n_v];
            for input in &inputs {
                input.add(sample.time, &sample.q, &sample.qd, &mut tau_q);
            }
            tau_q
        };
        Ok(samples.into_iter().map(of).collect())
    }

    /// Springs and inputs whose numbers can be used.
    pub(crate) fn checked(&self) -> Outcome<(Springs, Vec<OnTree>)> {
        let model = &self.compiled.model;
        check_springs(self.springs, model)?;
        let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
        let inputs = self
            .inputs
            .iter()
            .map(|input| OnTree::new(input, model, &tree))
            .collect::<Result<_, _>>()?;
        Ok((Springs::new(self.springs), inputs))
    }

    /// Where the declared independents stand in q and q̇.
    pub(crate) fn declared(&self) -> [Vec<usize>; 2] {
        let model = &self.compiled.model;
        [
            places(model.independent_q_names(), model.tree_q_names()),
            places(model.independent_names(), model.tree_names()),
        ]
    }
}

/// Springs end on links and have constants.
fn check_springs(springs: &[Spring], model: &Model<f64>) -> Outcome {
    for (k, spring) in springs.iter().enumerate() {
        let fault =
            |found: String, expected| Err(SimulationError::Spring { spring: k, found, expected });
        for end in [&spring.from, &spring.to] {
            if end.link >= model.link_names().len() {
                return fault(format!("link number {}", end.link), "a link of the robot");
            }
            if !end.at.iter().all(|x| x.is_finite()) {
                return fault("a point that is not finite".to_owned(), "three numbers");
            }
        }
        for (what, constant) in [
            ("stiffness", spring.stiffness),
            ("damping", spring.damping),
            ("rest length", spring.rest),
        ] {
            if !(constant.is_finite() && constant >= 0.0) {
                return fault(format!("a {what} of {constant}"), "a number that is not negative");
            }
        }
    }
    Ok(())
}
