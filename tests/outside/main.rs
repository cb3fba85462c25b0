//! A user's program: inverse dynamics of the upper body at a few states.
//!
//! `tests/outside/run.sh` builds this file in a crate outside the workspace, and inside it as an
//! example of the benches, and compares the instructions that both need. Takes the number of passes
//! through the states; prints the bits of the last answer.

use std::error::Error;
use std::hint::black_box;

use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Options, Source, load};

/// States that the calls go through in turn.
const STATES: usize = 16;

fn main() -> Result<(), Box<dyn Error>> {
    let passes: usize = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let source = Source::Bundled("rh5v2_upper_body".to_owned());
    let model = load(&source, &Options::default())?.compiled.model;
    let query = Query::new(
        Request::InverseDynamics,
        FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
        FieldSet::of(&[Field::TauU]),
    );
    let plan = Plan::new(&model, &query)?;
    let mut workspace = Workspace::for_plans(&model, std::slice::from_ref(&plan));
    let inputs: Vec<Vec<f64>> = (0..STATES).map(|k| state(k, plan.given().len())).collect();
    let mut output = vec![0.0; plan.want().len()];

    for _ in 0..passes {
        let status = pass(&model, &plan, &mut workspace, &inputs, &mut output);
        if status != Status::Ok {
            return Err(status.to_string().into());
        }
    }
    output.iter().for_each(|tau| println!("{:016x} {tau}", tau.to_bits()));
    Ok(())
}

/// One state: small numbers, the same in every run.
fn state(k: usize, len: usize) -> Vec<f64> {
    (0..len).map(|j| 0.2 * ((7 * j + 13 * k + j * k) % 23) as f64 / 11.0 - 0.2).collect()
}

/// One call a state, up to the first that has no answer; its instructions are counted.
#[inline(never)]
fn pass(
    model: &Model,
    plan: &Plan,
    workspace: &mut Workspace<f64>,
    inputs: &[Vec<f64>],
    output: &mut [f64],
) -> Status {
    for input in inputs {
        let status = plan.run(model, workspace, black_box(input), output).status;
        if status != Status::Ok {
            return status;
        }
        black_box(&output);
    }
    Status::Ok
}
