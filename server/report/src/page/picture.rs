//! Pictures of figures as SVG. Colours are names for the style sheet, which has others for dark
//! pages and for print.

use core::fmt::Write;

use plotters::coord::Shift;
use plotters::prelude::*;

use super::figure::{Figure, Series};
use super::pareto::pareto_front;
use super::scale::Scale;
use crate::Outcome;

/// A series' colour on light and on dark pages; they differ in lightness too, and with a form each
/// series is distinct without colour.
const COLOURS: [(RGBColor, &str); 8] = [
    (RGBColor(0x00, 0x72, 0xb2), "#56b4f5"),
    (RGBColor(0xd5, 0x5e, 0x00), "#ff8f4a"),
    (RGBColor(0x00, 0x8a, 0x66), "#2fd1a0"),
    (RGBColor(0xb8, 0x4a, 0x8c), "#f09acb"),
    (RGBColor(0xb3, 0x86, 0x00), "#f5c542"),
    (RGBColor(0x5a, 0x3d, 0x99), "#b9a2f2"),
    (RGBColor(0x6e, 0x4a, 0x2c), "#c9a27e"),
    (RGBColor(0x5f, 0x5f, 0x5f), "#b8b8b8"),
];
/// Libraries that have a colour of their own on every figure, the last ones.
const LIBRARIES: [&str; 5] = ["Pinocchio", "MuJoCo", "Simbody", "Drake", "RBDL"];
/// Text and axes, mesh, front: light and dark.
const INK: (RGBColor, &str) = (RGBColor(0x22, 0x22, 0x22), "#dddddd");
const MESH: (RGBColor, &str) = (RGBColor(0xe2, 0xe2, 0xe2), "#3a3d42");
const FRONT: (RGBColor, &str) = (RGBColor(0x99, 0x99, 0x99), "#8a8d92");

/// The size of a picture, in halves of a pixel of the page: places are whole numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    width: u32,
    height: u32,
    text: f64,
    /// Room for the ticks' names.
    left: u32,
    below: u32,
    /// Radius of a mark.
    mark: i32,
    /// The most ticks to the right and upwards.
    ticks: (usize, usize),
}

/// For screens and paper, and for phones.
pub(super) const WIDE: Size =
    Size { width: 1440, height: 860, text: 25.0, left: 116, below: 56, mark: 11, ticks: (9, 10) };
pub(super) const NARROW: Size =
    Size { width: 656, height: 720, text: 25.0, left: 104, below: 52, mark: 10, ticks: (5, 9) };

/// Least distance of marks on a line, so that they distinguish lines without hiding them.
const MARKS_OF_A_LINE: usize = 12;
/// Most points of a line.
pub(super) const PARTS_OF_A_LINE: usize = 150;

/// The picture; none if nothing can be drawn.
pub(super) fn picture(figure: &Figure, size: Size) -> Outcome<Option<String>> {
    let (xs, ys): (Vec<f64>, Vec<f64>) = figure.series.iter().flat_map(points).unzip();
    let x = Scale::new(&figure.x, false, &xs, size.ticks.0);
    let y = Scale::new(&figure.y, true, &ys, size.ticks.1);
    let (Some(x), Some(y)) = (x, y) else { return Ok(None) };
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, (size.width, size.height)).into_drawing_area();
    draw(figure, size, &x, &y, &area).map_err(|error| format!("{}: {error}", figure.id))?;
    drop(area);
    Ok(Some(named(&text, &format!("{}: {} over {}", figure.title, figure.y.label, figure.x.label))))
}

/// The points of a series that can be drawn.
pub(super) fn points(series: &Series) -> impl Iterator<Item = (f64, f64)> {
    series
        .points
        .iter()
        .map(|point| (point.x, point.y))
        .filter(|(x, y)| x.is_finite() && y.is_finite())
}

/// The points of a series that have a mark: not all of a line.
pub(super) fn marked(series: &Series) -> Vec<(f64, f64)> {
    let all = largest(series);
    let stride = if series.line { all.len().div_ceil(MARKS_OF_A_LINE).max(1) } else { 1 };
    all.into_iter().step_by(stride).collect()
}

/// The points of a series, of a long line the largest of each part.
fn largest(series: &Series) -> Vec<(f64, f64)> {
    let all: Vec<(f64, f64)> = points(series).collect();
    let part = if series.line { all.len().div_ceil(PARTS_OF_A_LINE).max(1) } else { 1 };
    let of = |part: &[(f64, f64)]| part.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
    all.chunks(part).filter_map(of).collect()
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;
/// A picture is text in memory: only arithmetic in the library can fail.
type Drawn = Result<(), Box<dyn std::error::Error>>;

fn draw(figure: &Figure, size: Size, x: &Scale, y: &Scale, area: &Area<'_>) -> Drawn {
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .margin_top(22)
        .margin_right(28)
        .x_label_area_size(size.below)
        .y_label_area_size(size.left)
        .build_cartesian_2d(x.clone(), y.clone())?;

    // the library's unit of text is larger than the page's
    let style = ("sans-serif", 1.24 * size.text).into_font().color(&INK.0);
    chart
        .configure_mesh()
        .bold_line_style(MESH.0.stroke_width(2))
        .light_line_style(TRANSPARENT)
        .axis_style(INK.0.stroke_width(2))
        .label_style(style)
        .draw()?;

    stairs(figure, x, y, &mut chart)?;
    // lines first, so that marks stay visible
    let looks = looks(figure);
    let place = |(a, b): (f64, f64)| (x.place(a), y.place(b));
    for (&look, series) in looks.iter().zip(&figure.series).filter(|(_, series)| series.line) {
        let places: Vec<_> = largest(series).into_iter().map(place).collect();
        chart.draw_series([PathElement::new(places, colour(look).stroke_width(4))])?;
    }
    for (&look, series) in looks.iter().zip(&figure.series) {
        for outline in form(look, size.mark) {
            let fill = colour(look).filled();
            let mark = |at| EmptyElement::at(at) + Polygon::new(outline.clone(), fill);
            chart.draw_series(marked(series).into_iter().map(place).map(mark))?;
        }
    }
    area.present()?;
    Ok(())
}

/// The front as steps: up to each point the one before dominates.
fn stairs(figure: &Figure, x: &Scale, y: &Scale, chart: &mut Chart<'_, '_>) -> Drawn {
    let mut steps: Vec<(f64, f64)> = Vec::new();
    for (_, point) in pareto_front(figure) {
        let place = (x.place(point.x), y.place(point.y));
        steps.extend(steps.last().map(|last| (place.0, last.1)));
        steps.push(place);
    }
    // beyond its ends the front continues to the edges
    if let (Some(first), Some(last)) = (steps.first().copied(), steps.last().copied()) {
        steps.insert(0, (first.0, y.to));
        steps.push((x.to, last.1));
        chart.draw_series([PathElement::new(steps, FRONT.0.stroke_width(3))])?;
    }
    Ok(())
}

/// A number for each series, of its colour and form: on every figure a library has one colour.
pub(super) fn looks(figure: &Figure) -> Vec<usize> {
    let library = |series: &Series| LIBRARIES.iter().position(|of| series.name.starts_with(of));
    let with_others = figure.series.iter().any(|series| library(series).is_some());
    let own = COLOURS.len() - if with_others { LIBRARIES.len() } else { 0 };
    let mut next = (0..own).cycle();
    let mut used = [0; COLOURS.len()];
    let look = |series: &Series| {
        let colour = library(series).map(|k| own + k).or_else(|| next.next()).unwrap_or(0);
        used[colour] += COLOURS.len();
        colour + used[colour] - COLOURS.len()
    };
    figure.series.iter().map(look).collect()
}

fn colour(look: usize) -> RGBColor {
    COLOURS[look % COLOURS.len()].0
}

/// The mark of a series around a point: polygons. Series of one colour have different forms.
fn form(look: usize, r: i32) -> Vec<Vec<(i32, i32)>> {
    let s = r * 9 / 10;
    // arms of a cross
    let t = (r / 3).max(1);
    let quarter = [(-t, -r), (t, -r), (t, -t)];
    let back = quarter.map(|(x, y)| (-x, -y));
    let aside = |(x, y): (i32, i32)| (-y, x);
    let plus = [quarter, quarter.map(aside), back, back.map(aside)].concat();
    let turned = |(x, y): &(i32, i32)| ((x - y) * 7 / 10, (x + y) * 7 / 10);
    match (look + 3 * (look / COLOURS.len())) % 8 {
        0 => vec![
            (0..12)
                .map(|k| (f64::from(k) * core::f64::consts::PI / 6.0).sin_cos())
                .map(|(a, b)| [a, b].map(|x| (f64::from(r) * x).round() as i32))
                .map(|[a, b]| (a, b))
                .collect(),
        ],
        1 => vec![vec![(-s, -s), (s, -s), (s, s), (-s, s)]],
        2 => vec![vec![(0, -r - 2), (r + 1, s), (-r - 1, s)]],
        3 => vec![vec![(0, -r - 3), (r + 1, 0), (0, r + 3), (-r - 1, 0)]],
        4 => vec![vec![(0, r + 2), (r + 1, -s), (-r - 1, -s)]],
        5 => vec![plus],
        6 => vec![plus.iter().map(turned).collect()],
        // an hourglass
        _ => vec![vec![(-r, -r), (r, -r), (0, 0)], vec![(-r, r), (r, r), (0, 0)]],
    }
}

/// The sign of a series in the legend, a front's without one.
pub(super) fn sign(series: Option<(usize, bool)>) -> Outcome<String> {
    const SIZE: (u32, u32) = (56, 32);
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
    let line = |colour: RGBColor, width| {
        PathElement::new(vec![(2, 16), (54, 16)], colour.stroke_width(width))
    };
    match series {
        None => area.draw(&line(FRONT.0, 3))?,
        Some((k, with_line)) => {
            if with_line {
                area.draw(&line(colour(k), 4))?;
            }
            for outline in form(k, WIDE.mark) {
                area.draw(
                    &(EmptyElement::at((28, 16)) + Polygon::new(outline, colour(k).filled())),
                )?;
            }
        }
    }
    area.present()?;
    drop(area);
    Ok(grouped(&text).replacen("<svg ", "<svg aria-hidden=\"true\" ", 1))
}

/// A picture whose neighbours of one style share it as a group, which takes a quarter less room.
fn grouped(svg: &str) -> String {
    let mut text = String::new();
    let mut open = "";
    let svg = svg.replace(" opacity=\"1\"", "").replace(" font-family=\"sans-serif\"", "");
    for line in svg.lines() {
        // a tag, its style, and its place
        let parts = ["<line ", "<polyline ", "<polygon "].into_iter().find_map(|tag| {
            let rest = line.strip_prefix(tag)?;
            let place = [" points=", " x1="].into_iter().find_map(|at| rest.find(at))?;
            Some((tag, &rest[..place], rest[place + 1..].replace(" \"", "\"")))
        });
        let style = parts.as_ref().map_or("", |(_, style, _)| style);
        if style != open {
            text += if open.is_empty() { "" } else { "</g>" };
            text += &if style.is_empty() { String::new() } else { format!("<g {style}>") };
            open = style;
        }
        text += &parts.map_or(line.to_owned(), |(tag, _, place)| format!("{tag}{place}"));
    }
    text
}

/// The picture with a name for screen readers.
fn named(svg: &str, name: &str) -> String {
    let name = maud::html! { (name) }.into_string().replace('"', "&quot;");
    grouped(svg).replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{name}\" "), 1)
}

/// Style rules that turn the pictures' colours into variables, and the variables of light and of
/// dark pages.
pub(super) fn colours() -> [String; 3] {
    let mut all = COLOURS.to_vec();
    all.extend([INK, MESH, FRONT]);
    let [mut rules, mut light, mut dark] = [const { String::new() }; 3];
    for (k, (RGBColor(r, g, b), on_dark)) in all.into_iter().enumerate() {
        let name = format!("#{r:02X}{g:02X}{b:02X}");
        // writing to a string cannot fail
        let _ = write!(
            rules,
            "[fill=\"{name}\"]{{fill:var(--p{k})}}[stroke=\"{name}\"]{{stroke:var(--p{k})}}"
        );
        let _ = write!(light, "--p{k}:{name};");
        let _ = write!(dark, "--p{k}:{on_dark};");
    }
    [rules, light, dark]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use std::collections::HashSet;

    use super::super::figure::{Axis, Point};
    use super::*;

    fn figure(points: &[(f64, f64)]) -> Figure {
        let points = points.iter().map(|&(x, y)| Point { x, y, label: String::new() }).collect();
        let series = vec![Series { name: "a".into(), line: true, competes: true, points }];
        let log = Axis::log("error");
        Figure {
            id: "f".into(),
            title: "<&\">".into(),
            x: log.clone(),
            y: log,
            series,
            ..Figure::default()
        }
    }

    #[test]
    fn a_picture_has_its_marks_its_line_and_its_front() {
        for size in [WIDE, NARROW] {
            let svg = picture(&figure(&[(1.0, 1e-3), (10.0, 0.0), (20.0, f64::NAN)]), size)
                .unwrap()
                .unwrap();
            let read = roxmltree::Document::parse(&svg).unwrap();
            let count = |name: &str, attribute: &str, value: &str| {
                read.descendants()
                    .filter(|node| {
                        node.has_tag_name(("http://www.w3.org/2000/svg", name))
                            && node.parent().unwrap().attribute(attribute) == Some(value)
                    })
                    .count()
            };
            assert_eq!(
                count("polygon", "fill", "#0072B2"),
                2,
                "one mark for each point that has a place"
            );
            assert_eq!(count("polyline", "stroke", "#0072B2"), 1);
            assert_eq!(count("polyline", "stroke", "#999999"), 1);
            assert_eq!(
                read.root_element().attribute("aria-label"),
                Some("<&\">: error over error")
            );
        }
        assert!(picture(&figure(&[(f64::NAN, 1.0)]), WIDE).unwrap().is_none());
    }

    #[test]
    fn every_series_has_a_look_of_its_own() {
        let looks: HashSet<String> = (0..40).map(|k| sign(Some((k, false))).unwrap()).collect();
        assert_eq!(looks.len(), 40);
        assert!(sign(Some((0, true))).unwrap() != sign(Some((0, false))).unwrap());
    }

    #[test]
    fn every_colour_has_a_rule() {
        let [rules, light, dark] = colours();
        let svg = picture(&figure(&[(1.0, 1e-3), (10.0, 1e-4)]), WIDE).unwrap().unwrap();
        for colour in svg.split(['"', ' ']).filter(|part| part.starts_with('#')) {
            assert!(rules.contains(colour) && light.contains(colour), "{colour}");
        }
        assert_eq!(light.matches("--p").count(), dark.matches("--p").count());
    }
}
