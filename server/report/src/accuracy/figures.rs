//! The figures of one robot: error over time, a series for each method and peer.

use super::methods::Method;
use super::{id, runner, title};
use crate::Outcome;
use crate::page::{Axis, Figure, Point, Series};
use crate::peer;
use crate::reference::References;
use crate::robots::{Question, Robot, Start, Subject};

/// The series that a peer adds to a figure; for states it computes q alone.
pub(super) fn of_peer(
    robot: &Robot,
    references: &mut References<'_>,
    runs: &[peer::Run],
    question: Question,
) -> Outcome<Vec<Series>> {
    let start = if ["hybrid", "numerical"].contains(&robot.variants[0].closures) {
        Start::Warm
    } else {
        Start::None
    };
    peer::series(runs, question, &mut |state, answer| {
        references.of_peer((question, start), state, answer)
    })
}

pub(super) fn figure<'a>(
    robot: &Robot,
    question: Question,
    name: &str,
    measured: impl Iterator<Item = &'a Method> + Clone,
) -> Figure {
    let chain_forward =
        matches!(robot.subject, Subject::Chain(_)) && question == Question::ForwardDynamics;
    let mut series: Vec<Series> = Vec::new();
    let point = |of: &Method, y: f64| {
        let fault = of.fault.as_ref().map_or(String::new(), |fault| format!(": {fault}"));
        Point { x: of.ns, y, label: format!("{}{fault}", of.label) }
    };
    for of in measured.clone() {
        Series::add(&mut series, of.series.clone(), point(of, of.error)).competes = true;
    }
    for of in measured.filter(|of| !["bounded", "cold"].iter().any(|word| of.series.contains(word)))
    {
        if let Some(residual) = of.residual {
            let name = format!("loop residual of {}", of.series);
            Series::add(&mut series, name, point(of, residual));
        }
    }
    series.iter_mut().for_each(|of| of.line = of.points.len() > 1);
    let what = match question {
        Question::State => "q, q̇, q̈, u, u̇, ü from y, ẏ, ÿ; a peer finds q alone",
        Question::InverseDynamics => "τ_u from y, ẏ, ÿ",
        _ => "ÿ from y, ẏ, τ_u",
    };
    let of = if chain_forward {
        "backward error, by how much the forces would have to change"
    } else {
        "by size, against double-double"
    };
    let implicit = if question == Question::ForwardDynamics {
        format!(" The implicit form closes the loops first; α = β = {} 1/s.", runner::STABILISATION)
    } else {
        String::new()
    };
    Figure {
        id: id(robot.subject, question),
        title: format!("{}: {name}", title(robot.subject)),
        caption: format!(
            "{what}. The largest error of {} states, {of}, over the median of batches that take \
            turns. Warm: from the closed pose 1 ms earlier; cold: from that at zero. Single \
            precision takes its inputs rounded.{implicit} An error of zero is drawn at 1e-17.",
            robot.states.len()
        ),
        x: Axis::log("time of a call in ns"),
        y: Axis::log(if chain_forward { "backward error" } else { "error by size" }),
        series,
    }
}
