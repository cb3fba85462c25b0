//! Newton's method in JavaScript: the steps of each block as functions, and the rule of the plan
//! around them (`newton.js`).

use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Field, Model, NewtonCluster, Plan};

use super::{compiled, literal};
use crate::recorder::Traced;
use crate::trace::recorded;
use crate::{GenerateError, Generated, Lengths};

/// The script's part that closes loops; none where nothing is to be closed.
pub(super) fn newton(
    model: &Model<f64>,
    plan: &Plan,
    lengths: &Lengths,
) -> Generated<Option<(String, usize)>> {
    if !plan.closes_apart() {
        return Ok(None);
    }
    let clusters = plan.newton_clusters(model).filter(|clusters| !clusters.is_empty());
    let clusters = clusters.ok_or(GenerateError::NotStraight)?;
    let (zero, places) = Plan::newton_start(model);
    let mut operations = 0;
    let mut text = String::new();
    for cluster in &clusters {
        text += &cluster_text(model, plan, lengths, cluster, &zero, &mut operations)?;
    }
    // the levels below the position, at zero and at rest
    let given = plan.given().len();
    let mut input = vec![0.0; given];
    for slot in plan.given().slots() {
        if slot.field == Field::Y {
            let y = places.iter().map(|place| zero[*place]);
            input[slot.range()].iter_mut().zip(y).for_each(|(to, x)| *to = x);
        }
    }
    input.extend(&zero);
    let rates = recorded(model, plan, lengths, &input, false, |model, workspace, input| {
        let mut output = vec![Traced::ZERO; plan.closed_len()];
        let (given, q) = input.split_at(given);
        plan.closed_at(model, workspace, given, q, &mut output).then_some(output)
    })?;
    operations += rates.operations();
    let list = |numbers: &[f64]| numbers.iter().map(|x| literal(*x)).collect::<Vec<_>>().join(", ");
    // y and the lengths among the given numbers, and their places among the coordinates and lengths
    let more = (0..lengths.values.len()).map(|l| [zero.len() + l, given + l]);
    let places: Vec<[usize; 2]> =
        places.iter().enumerate().map(|(k, place)| [*place, k]).chain(more).collect();
    let text = format!(
        "const zero = [{}];\nconst size = {given};\nconst places = {places:?};\n\
         const clusters = [\n{text}];\nconst rates = {};\n{}",
        list(&[&zero[..], &lengths.values].concat()),
        compiled(&rates),
        include_str!("newton.js"),
    );
    Ok(Some((text, operations)))
}

fn cluster_text(
    model: &Model<f64>,
    plan: &Plan,
    lengths: &Lengths,
    cluster: &NewtonCluster,
    zero: &[f64],
    operations: &mut usize,
) -> Generated<String> {
    let mut text = String::new();
    for block in &cluster.blocks {
        let step = recorded(model, plan, lengths, zero, false, |model, workspace, q| {
            let mut output = vec![Traced::ZERO; block.outputs()];
            Plan::newton_step(model, workspace, block, q, &mut output);
            Some(output)
        })?;
        *operations += step.operations();
        text += &format!(
            "    {{ unknowns: {:?}, remembers: {}, couples: {}, step: {} }},\n",
            block.unknowns,
            block.remembers,
            block.couples,
            compiled(&step)
        );
    }
    // a change of a length is a way like that of an independent
    let unit = 1.0 / cluster.length;
    let more = (0..lengths.values.len()).map(|l| (zero.len() + l, unit));
    let independents = cluster.independents.iter().copied().chain(more);
    let independents: String =
        independents.map(|(place, unit)| format!("[{place}, {}], ", literal(unit))).collect();
    Ok(format!(
        "  {{ floor: {}, reach: {}, independents: [{independents}], blocks: [\n{text}  ] }},\n",
        literal(cluster.floor),
        literal(cluster.reach),
    ))
}
