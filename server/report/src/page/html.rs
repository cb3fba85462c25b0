//! The page: one self-contained file.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::data::{figure_table, result_table};
use super::figure::Figure;
use super::pareto::{ROUNDING, exponent, summaries};
use super::picture::{
    NARROW, PARTS_OF_A_LINE, WIDE, colours, looks, marked, picture, points, sign,
};
use super::section::{Report, Section, Table, columns};
use crate::Outcome;

/// The ends of the names of the figures on the first screen.
const FIRST: [&str; 2] = ["-id", "-fd"];
const TITLE: &str = "sarrus: robots with closed loops, how exact and how fast";
/// Most rows of a table on the page, and of the data of a figure; their files have all.
const ROWS: usize = 60;
const ROWS_OF_DATA: usize = 30;

/// The content security policy: the page loads nothing and runs its own script alone.
const POLICY: &str = include_str!("policy.txt");

/// The whole page.
pub(super) fn page(report: &Report) -> Outcome<String> {
    let first: Vec<(&Section, &Figure)> =
        FIRST.iter().filter_map(|end| shown(report, end)).collect();
    let of_first = first.iter().map(|(section, figure)| drawn(figure, report, section));
    let pictures = of_first.collect::<Outcome<Vec<_>>>()?;
    let is_first = |figure: &Figure| first.iter().any(|(_, of)| of.id == figure.id);
    let sections = report.sections.iter().map(|section| one(report, section, is_first));
    let sections = sections.collect::<Outcome<Vec<_>>>()?;
    let body = html! {
        (top(report, &pictures))
        @for section in &sections { (section) }
    };
    Ok(document(TITLE, &body))
}

/// The figure that ends so: of the upper body, or else of the first robot.
fn shown<'a>(report: &'a Report, end: &str) -> Option<(&'a Section, &'a Figure)> {
    let of = |section: &'a Section| section.figures.iter().map(move |figure| (section, figure));
    let all = || report.sections.iter().flat_map(of).filter(|(_, figure)| figure.id.ends_with(end));
    all().find(|(_, figure)| figure.id.contains("upper_body")).or_else(|| all().next())
}

/// The document around a body.
fn document(title: &str, body: &Markup) -> String {
    let [rules, light, dark] = colours();
    // paper is light in every colour scheme
    let style = format!(
        "{}\n:root{{{light}}}\n@media screen and (prefers-color-scheme: \
        dark){{:root{{{dark}}}}}\n{rules}\n",
        include_str!("page.css")
    );
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY.trim());
                title { (title) }
                style { (PreEscaped(style)) }
            }
            body { (body) script { (PreEscaped(include_str!("page.js"))) } }
        }
    };
    markup.into_string()
}

/// Three findings and the pictures, on one screen.
fn top(report: &Report, pictures: &[Markup]) -> Markup {
    let summaries = summaries(&report.sections);
    let silent = report.silent_failures();
    let places = Table {
        columns: columns("figure | on the front, ours of all | fastest | most exact | peers"),
        rows: summaries.iter().map(|summary| summary.cells.clone()).collect(),
        ..Table::default()
    };
    let against = summaries.iter().filter(|summary| summary.with_peer);
    let (front, ours) =
        against.fold((0, 0), |(front, ours), summary| (front + summary.front, ours + summary.ours));
    html! {
        header {
            h1 { (TITLE) }
            p { "A Rust library, in dynamics beside Pinocchio, MuJoCo, Simbody, Drake and RBDL, in \
                inverse kinematics beside pink, mink and placo, where these are installed." }
            p.soft { code { (report.command) } " on " (report.machine) ", " (report.date) }
            ul.facts {
                li { b { (report.worst_error().map_or("-".to_owned(), exponent)) } "largest \
                    relative error of an answer without a warning" }
                li.(if silent == 0 { "good" } else { "bad" }) { b { (silent) } "silent failures \
                    among " (report.cases()) " stress cases" }
                @if front > 0 { li { b { (ours) " of " (front) } "points on the Pareto fronts with \
                    a peer are ours: no other method is both faster and more exact" } }
            }
            div.figures { @for picture in pictures { (picture) } }
            details.all {
                summary { "How to read the figures" }
                p { "y are the independent joints of a robot, u its actuators, q all joints, τ \
                    forces; G = ∂q/∂y. Inverse dynamics (ID) finds forces of a motion, forward \
                    dynamics (FD) accelerations of forces." }
                p { "Errors are relative to the size of the answer, against the same model and \
                    inputs in double-double, which has 32 digits. A closed form closes loops, or \
                    Newton's method: warm from the pose 1 ms earlier, cold from the pose at \
                    y = 0; the loop residual is how far they stay open." }
                p { "Recursion, projection GᵀMG and KKT are three methods of forward dynamics; the \
                    plan is the compiled list of steps that answers a request. A method is default \
                    if it is used where the caller names none." }
            }
            @if !summaries.is_empty() {
                details.all id="places" {
                    summary { "Pareto places of every figure" }
                    p.soft {
                        "Fastest and most exact point of each front, as method (cost; error). \
                        Peers: over all settings of a peer, the least ratio of its time to that of \
                        one of ours with no larger error; errors up to " (exponent(ROUNDING)) " \
                        count as equal."
                    }
                    div.scroll { (cells(&places, ROWS)) }
                }
            }
        }
        nav {
            details {
                summary { "Contents" }
                @for section in &report.sections {
                    p { a href={ "#" (section.name) } { (section.title) } }
                    ul {
                        @for figure in &section.figures {
                            li { a href={ "#" (figure.id) } { (figure.title) } }
                        }
                        @for table in &section.tables {
                            li { a href={ "#" (table.id) } { (table.title) } }
                        }
                    }
                }
            }
        }
    }
}

fn one(report: &Report, section: &Section, is_first: impl Fn(&Figure) -> bool) -> Outcome<Markup> {
    let rest = section.figures.iter().filter(|figure| !is_first(figure));
    let figures = rest.map(|figure| drawn(figure, report, section));
    let figures = figures.collect::<Outcome<Vec<_>>>()?;
    let nothing =
        section.figures.is_empty() && section.tables.is_empty() && section.cases.is_empty();
    Ok(html! {
        section id=(section.name) {
            h2 { (section.title) }
            @if nothing { p.empty { "Nothing was measured in this section." } }
            @if let Some(failure) = &section.failure { p.bad { "Not finished. " (failure) } }
            @for sentence in &section.summary { p { (sentence) } }
            details.all {
                summary { "Figures: " (figures.len()) ", tables: " (section.tables.len()) }
                @if !section.cases.is_empty() {
                    details {
                        summary { "Every case: " (section.cases.len()) }
                        p { a href={ (section.name) "-cases.csv" } { (section.name) "-cases.csv" } }
                        div.tall { (cells(&result_table(section), ROWS_OF_DATA)) }
                    }
                }
                div.figures { @for figure in &figures { (figure) } }
                @for table in &section.tables {
                    div.table id=(table.id) {
                        h3 { (table.title) }
                        @if !table.caption.is_empty() { p.soft { (table.caption) } }
                        div.scroll { (cells(table, ROWS)) }
                        p.soft { a href={ (table.id) ".csv" } { (table.id) ".csv" } }
                    }
                }
            }
        }
    })
}

/// A figure: legend, picture, title and source, its data.
fn drawn(figure: &Figure, report: &Report, section: &Section) -> Outcome<Markup> {
    let wide = picture(figure, WIDE)?;
    let narrow = picture(figure, NARROW)?;
    let mut signs = Vec::new();
    let mut marks = Vec::new();
    let with_looks = looks(figure).into_iter().zip(&figure.series);
    for (look, series) in with_looks.filter(|(_, series)| points(series).next().is_some()) {
        let place = signs.len();
        marks.extend(marked(series).iter().map(|(x, y)| format!("{place} {x:.3e} {y:.3e}")));
        signs.push((sign(Some((look, series.line)))?, series.name.as_str()));
    }
    if figure.series.iter().any(|series| series.competes) {
        signs.push((sign(None)?, "Pareto front"));
    }
    let all: usize = figure.series.iter().map(|series| series.points.len()).sum();
    let left_out = all - figure.series.iter().map(|series| points(series).count()).sum::<usize>();
    let table = figure_table(figure);
    let is_long = figure.series.iter().any(|of| of.line && of.points.len() > PARTS_OF_A_LINE);
    Ok(html! {
        figure id=(figure.id) data-marks=[wide.as_ref().map(|_| marks.join(";"))] {
            h3 { (figure.title) }
            @match (&wide, &narrow) {
                (Some(wide), Some(narrow)) => {
                    ul.legend {
                        @for (sign, name) in &signs { li { (PreEscaped(sign)) span { (name) } } }
                    }
                    p.axis { "↑ " (figure.y.label) }
                    div.wide { (PreEscaped(wide)) }
                    div.narrow { (PreEscaped(narrow)) }
                    p.axis.x { (figure.x.label) " →" }
                }
                _ => p.empty { "No picture: nothing that could be drawn was measured." }
            }
            figcaption {
                @if !figure.caption.is_empty() { p { (figure.caption) } }
                @if is_long { p { "Of a line of more than " (PARTS_OF_A_LINE) " points the \
                    largest of each part is drawn." } }
                @if left_out > 0 { p { (left_out) " of " (all) " points have no number; they stand \
                    in the table." } }
                p.from { code { (report.command_of(section)) } " on " (report.machine) }
            }
            details {
                summary { "Data: " (all) @if all == 1 { " point" } @else { " points" } }
                p { a href={ (figure.id) ".csv" } { (figure.id) ".csv" } }
                div.tall { (cells(&table, ROWS_OF_DATA)) }
            }
        }
    })
}

/// Numbers to the right, words to the left.
fn cells(table: &Table, most: usize) -> Markup {
    let class = |cell: &str| cell.parse::<f64>().is_ok().then_some("number");
    html! {
        table {
            thead { tr { @for column in &table.columns { th { (column) } } } }
            tbody {
                @for row in table.rows.iter().take(most) {
                    tr { @for cell in row { td class=[class(cell)] { (cell) } } }
                }
            }
        }
        @if table.rows.len() > most { p.soft { "The file has all " (table.rows.len()) " rows." } }
    }
}
