//! The figures of one robot: error over time, a series for each method and peer.

use super::methods::Method;
use super::{id, runner, title};
use crate::Outcome;
use crate::page::{Axis, Figure, Point, Series, is_peer};
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

/// Error up to which a peer counts as one of equal error.
const EQUAL: f64 = 1e-11;

/// The stated aim as a line: inverse dynamics in an eighth and forward dynamics in a fifth of the
/// time of the fastest peer of equal error, derivatives in 3.5 times the time of their question.
pub(super) fn aim(figure: &Figure, question: Question, methods: &[Method]) -> Option<Series> {
    use Question::*;
    let peers = figure.series.iter().filter(|of| is_peer(&of.name)).flat_map(|of| &of.points);
    let fastest = peers.filter(|of| of.y <= EQUAL).map(|of| of.x).min_by(f64::total_cmp);
    let own = |plain| methods.iter().find(|of| of.default && of.question == plain).map(|of| of.ns);
    let (x, name) = match question {
        InverseDynamics => (fastest? / 8.0, "aim: an eighth of the fastest peer up to 1e-11"),
        ForwardDynamics => (fastest? / 5.0, "aim: a fifth of the fastest peer up to 1e-11"),
        InverseDerivatives => (3.5 * own(InverseDynamics)?, "aim: 3.5 times inverse dynamics"),
        ForwardDerivatives => (3.5 * own(ForwardDynamics)?, "aim: 3.5 times forward dynamics"),
        _ => return None,
    };
    let errors = figure.series.iter().flat_map(|of| &of.points).map(|of| of.y);
    let mut errors: Vec<f64> = errors.filter(|y| *y > 0.0 && y.is_finite()).collect();
    errors.sort_by(f64::total_cmp);
    let ends = [*errors.first()?, *errors.last()?];
    let points = ends.map(|y| Point { x, y, label: "aim".into() }).into();
    Some(Series { name: name.into(), line: true, competes: false, points })
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
        Question::InverseDerivatives => "τ_u, ∂τ_u/∂y and ∂τ_u/∂ẏ from y, ẏ, ÿ",
        Question::ForwardDerivatives => "ÿ, ∂ÿ/∂y, ∂ÿ/∂ẏ and ∂ÿ/∂τ_u from y, ẏ, τ_u",
        _ => "ÿ from y, ẏ, τ_u",
    };
    let of = if chain_forward {
        "backward error, by how much the forces would have to change"
    } else {
        "relative, against double-double"
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
            "{what}. Upwards the largest error of {} random states, {of}; to the right the median \
            time of a call, of all methods in turn. Warm: from the closed pose 1 ms earlier; cold: \
            from that at y = 0.{implicit}",
            robot.states.len()
        ),
        x: Axis::log("time of a call in ns"),
        y: Axis::log(if chain_forward { "backward error" } else { "error by size" }),
        series,
    }
}
