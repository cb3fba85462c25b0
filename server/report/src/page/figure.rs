//! The parts of a figure: axes, series, points.

use serde::Serialize;

/// Where an error of exactly zero is drawn on a logarithmic axis, unless smaller ones lie beside.
pub const DRAWN_FOR_ZERO: f64 = 1e-17;

/// A picture and its data.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Unique on the page, of small letters, digits, `-` and `_`; also the name of its CSV file.
    pub id: String,
    /// Its title.
    pub title: String,
    /// Notes for the reader.
    pub caption: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The series drawn.
    pub series: Vec<Series>,
}

/// An axis of a figure.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Logarithmic; numbers that are not positive are drawn at its tick 0.
    pub log: bool,
    /// Values of other figures that it spans too.
    #[serde(skip)]
    pub shared: Vec<f64>,
}

impl Axis {
    /// A logarithmic one.
    pub(crate) fn log(label: impl Into<String>) -> Axis {
        Axis { label: label.into(), log: true, ..Axis::default() }
    }
}

/// Points that belong together.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Series {
    /// The name in the legend; a peer's begins with the peer's name.
    pub name: String,
    /// Joined by a line.
    pub line: bool,
    /// Competes for the Pareto front of its figure, where less is better on both axes.
    #[serde(rename = "front")]
    pub competes: bool,
    /// Points; a value that is not finite is not drawn, but the table has it.
    pub points: Vec<Point>,
}

impl Series {
    /// Adds a point to the series of this name, which it creates if needed.
    pub(crate) fn add(all: &mut Vec<Series>, name: String, point: Point) -> &mut Series {
        let place = all.iter().position(|series| series.name == name).unwrap_or_else(|| {
            all.push(Series { name, ..Series::default() });
            all.len() - 1
        });
        all[place].points.push(point);
        &mut all[place]
    }
}

/// One measurement.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Point {
    /// The horizontal coordinate.
    pub x: f64,
    /// The vertical coordinate.
    pub y: f64,
    /// Its label, such as a tolerance; shown in the table.
    pub label: String,
}
