//! The ranks of the default methods in their figures.

use super::methods::Method;
use super::{title, words};
use crate::page::{Figure, exponent, pareto_front};
use crate::robots::{Robot, Subject};

/// Ratio of two times that still count as equal.
const SAME_TIME: f64 = 1.05;

/// The rank of a default method in its figure.
pub(super) struct DefaultRow {
    pub(super) question: &'static str,
    pub(super) error: f64,
    /// Its time relative to the fastest method of at least its accuracy.
    pub(super) factor: f64,
    pub(super) on_front: bool,
    pub(super) cells: Vec<String>,
}

pub(super) fn row(robot: &Robot, figure: &Figure, of: &Method) -> DefaultRow {
    let [question, _] = words(of.question);
    let points =
        figure.series.iter().filter(|series| series.competes).flat_map(|series| &series.points);
    let fastest = points
        .filter(|point| point.y <= of.error)
        .map(|point| point.x)
        .fold(f64::INFINITY, f64::min);
    let factor = of.ns / fastest;
    let on_front = pareto_front(figure)
        .iter()
        .any(|(series, point)| series.name == of.series && point.label == of.label);
    let place = if on_front {
        "on the front".to_owned()
    } else {
        format!("{factor:.2} times the time of what is no less exact")
    };
    let method = format!("{}, {}", of.series, of.label);
    let residual = of.residual.map_or("-".to_owned(), exponent);
    let cells = vec![
        title(robot.subject),
        question.to_owned(),
        method,
        format!("{:.0}", of.ns),
        exponent(of.error),
        residual,
        place,
    ];
    DefaultRow { question, error: of.error, factor, on_front, cells }
}

/// The ranks of a robot's default methods.
pub(super) fn sentence(subject: Subject, places: &[DefaultRow]) -> String {
    let word = |place: &DefaultRow| match (place.on_front, place.factor) {
        (true, _) => format!("{} on the front", place.question),
        (_, factor) if factor < SAME_TIME => format!("{} within 5 % of the front", place.question),
        (_, factor) => format!("{} {factor:.2} times the time of the front", place.question),
    };
    let words: Vec<String> = places.iter().map(word).collect();
    format!("{}, default methods: {}", title(subject), words.join(", "))
}
