//! The cases as pictures and tables.

use super::harness::{Case, HELD};
use crate::page::{Assessment, Axis, Figure, Point, Section, Series, Table, columns};

/// Values of a parameter that a picture shows; its table has all.
const DRAWN: std::ops::RangeInclusive<f64> = 1e-20..=1e20;
/// Families whose pictures and tables go by robot rather than by method: the geometry of a robot
/// decides where it breaks.
const BY_ROBOT: [&str; 4] =
    ["distance to a singularity", "unreachable y", "many turns", "big jump"];
/// Families whose parameter is not a quantity.
const NO_PICTURE: [&str; 5] =
    ["not a number", "faulty file", "unreachable y", "simulation of nothing", "change points"];

/// Fills the section.
pub(crate) fn section(cases: Vec<Case>) -> Section {
    let mut section = Section::new("extremes", "Stress cases");
    let families: Vec<&[Case]> = cases.chunk_by(|a, b| a.family == b.family).collect();
    section.summary = summary(&cases, families.len());
    section.worst_error = worst_held(&cases);
    section.tables.push(overview(&families));
    for family in &families {
        section.tables.push(table(family));
        section.figures.extend(errors(family));
    }
    section.figures.extend(times(&cases));
    section.cases = cases;
    section
}

fn count<'a>(cases: impl IntoIterator<Item = &'a Case>, assessment: Assessment) -> usize {
    cases.into_iter().filter(|case| case.assessment == assessment).count()
}

/// The largest error of the cases that held without a warning.
fn worst_held(cases: &[Case]) -> Option<f64> {
    let is_plain = |case: &&Case| case.assessment == Assessment::Held && case.warnings.is_empty();
    let held = cases.iter().filter(is_plain);
    held.filter_map(|case| case.error).reduce(f64::max)
}

fn summary(cases: &[Case], families: usize) -> Vec<String> {
    let of = |assessment| count(cases, assessment);
    let silent = of(Assessment::FailedSilently);
    let mut lines = vec![
        format!(
            "{} cases in {families} families: {} held, {} degraded and said so, {} failed and said \
            so, {silent} failed silently.",
            cases.len(),
            of(Assessment::Held),
            of(Assessment::Degraded),
            of(Assessment::Failed)
        ),
        format!(
            "Held: status ok and an error of at most {HELD:.0e} by size. Degraded and said so: a \
            larger error, and the answer warns of ill_conditioned, or the simulation's own \
            estimate or energy reports the size of its error. A loop that is open by more than \
            1e-6 has to carry loop_open, an input that is replaced by more than 1e-6 by \
            input_projected. Failed and said so: any other status with no number beside it, or a \
            refusal at load. Anything else has failed silently."
        ),
    ];
    let worst = cases
        .iter()
        .filter(|case| case.assessment == Assessment::Degraded && case.asked != "simulation")
        .max_by(|a, b| f64::total_cmp(&a.error.unwrap_or(0.0), &b.error.unwrap_or(0.0)));
    if let Some(case) = worst {
        let error = case.error.unwrap_or(f64::NAN);
        lines.push(format!(
            "The largest error of an answer with a warning, simulations left out: {error:.1e}, {} \
            at {} {:.0e}.",
            case.robot, case.family, case.value
        ));
    }
    let silent = cases.iter().filter(|case| case.assessment == Assessment::FailedSilently);
    lines.extend(silent.take(20).map(|case| {
        let error = case.error.map_or("-".to_owned(), |error| format!("{error:.1e}"));
        format!(
            "Failed silently: {}, {}, {} at {:e}, {}: error {error}.",
            case.family, case.robot, case.asked, case.value, case.method
        )
    }));
    lines
}

fn id(family: &str) -> String {
    format!("extremes-{family}")
}

/// The label of a line of a picture or a row of a table.
fn key(case: &Case) -> String {
    if BY_ROBOT.contains(&case.family) {
        return format!("{}, {}", case.robot, case.method.split(", ").next().unwrap_or_default());
    }
    match case.method.rsplit_once(", ") {
        Some((_, method)) => format!("{}, {method}", case.asked),
        None => case.asked.clone(),
    }
}

/// The cases of a family by their keys, in the order in which these come.
fn groups(family: &[Case]) -> Vec<(String, Vec<&Case>)> {
    let mut groups: Vec<(String, Vec<&Case>)> = Vec::new();
    for case in family {
        let key = key(case);
        match groups.iter_mut().find(|group| group.0 == key) {
            Some(group) => group.1.push(case),
            None => groups.push((key, vec![case])),
        }
    }
    groups
}

/// Distance of a value from the usual one.
fn extremity(case: &Case) -> f64 {
    if case.value > 0.0 { case.value.log10().abs() } else { f64::INFINITY }
}

fn overview(families: &[&[Case]]) -> Table {
    let row = |family: &&[Case]| {
        let mut row = vec![family[0].family.to_owned(), family[0].parameter.to_owned()];
        row.extend([range(family), family.len().to_string()]);
        row.extend(Assessment::ALL.map(|assessment| count(*family, assessment).to_string()));
        row.push(worst_held(family).map_or("-".into(), |error| format!("{error:.1e}")));
        row
    };
    let names = Assessment::NAMES.join(" | ");
    Table {
        id: "extremes-families".into(),
        title: "Every family".into(),
        caption: "Errors by size against the same robot in double-double, lengths in those of its \
            loops; a closed form or a finer way where the cases say so. Chains are assessed by the \
            backward error of forward dynamics, ‖M_y ÿ + C_y − τ_y‖ relative to its terms, by \
            inverse dynamics in double-double: the condition of their mass matrix grows with the \
            fourth power of their length."
            .into(),
        columns: columns(&format!(
            "family | parameter | from … to | cases | {names} | worst error of those that held"
        )),
        rows: families.iter().map(row).collect(),
    }
}

/// The values of a family.
fn range(family: &[Case]) -> String {
    let values = || family.iter().map(|case| case.value).filter(|value| value.is_finite());
    let (least, most) =
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    if least <= most { format!("{least:e} … {most:e}") } else { "-".into() }
}

/// By method or robot: assessments, the first value that does not hold, and its report.
fn table(family: &[Case]) -> Table {
    let row = |(key, cases): (String, Vec<&Case>)| {
        let mut row = vec![key];
        let of = |assessment| count(cases.iter().copied(), assessment).to_string();
        row.extend(Assessment::ALL.map(of));
        let broken = cases
            .iter()
            .filter(|case| case.assessment != Assessment::Held)
            .min_by(|a, b| f64::total_cmp(&extremity(a), &extremity(b)));
        row.extend(match broken {
            None => ["-".to_owned(), "-".to_owned(), "-".to_owned()],
            Some(case) => {
                let at = if case.value.is_finite() {
                    format!("{:e}", case.value)
                } else {
                    case.method.clone()
                };
                [at, case.robot.clone(), how(case)]
            }
        });
        row
    };
    let key = if BY_ROBOT.contains(&family[0].family) { "robot" } else { "method" };
    let names = Assessment::NAMES.join(" | ");
    Table {
        id: format!("{}-verdicts", id(family[0].family)),
        title: format!("{}: what held", capital(family[0].family)),
        caption: format!("Swept: {}.", family[0].parameter),
        columns: columns(&format!(
            "{key} | {names} | first breaks at | robot | how it is reported"
        )),
        rows: groups(family).into_iter().map(row).collect(),
    }
}

/// Status, warnings and further reports.
fn how(case: &Case) -> String {
    let error = case.error.filter(|error| *error > HELD);
    let parts = [case.status.clone(), case.told()].into_iter().filter(|part| !part.is_empty());
    parts.chain(error.map(|error| format!("error {error:.1e}"))).collect::<Vec<_>>().join("; ")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

/// The largest error over the parameter, a line for each method or robot.
fn errors(family: &[Case]) -> Option<Figure> {
    let name = family[0].family;
    if NO_PICTURE.contains(&name) {
        return None;
    }
    let series = |(key, cases): (String, Vec<&Case>)| {
        let point = |case: &Case| {
            let label = if case.assessment == Assessment::Held {
                case.robot.clone()
            } else {
                format!("{}, {}", case.robot, case.assessment.name())
            };
            Some(Point { x: case.value, y: case.error?, label })
        };
        let cases = cases.into_iter().filter(|case| DRAWN.contains(&case.value));
        let mut points: Vec<Point> = cases.filter_map(point).collect();
        // the highest of the points at a value
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
        points.dedup_by(|next, kept| next.x == kept.x);
        Series { name: key, line: true, competes: false, points }
    };
    let silent = count(family, Assessment::FailedSilently);
    let (degraded, failed) =
        (count(family, Assessment::Degraded), count(family, Assessment::Failed));
    Some(Figure {
        id: id(name),
        title: format!("{}: error over {}", capital(name), family[0].parameter),
        caption: format!(
            "The largest error over {}; at most {HELD:.0e} holds. Not drawn: {failed} of {} cases \
            that ended by a status or a refusal. Drawn above {HELD:.0e}: {degraded} that say so \
            and {silent} that do not.",
            if BY_ROBOT.contains(&name) { "all that is asked" } else { "all robots" },
            family.len()
        ),
        x: Axis::log(family[0].parameter),
        y: Axis::log(if name == "chain" {
            "backward error of FD, error of ID"
        } else {
            "error by size"
        }),
        series: groups(family)
            .into_iter()
            .map(series)
            .filter(|series| !series.points.is_empty())
            .collect(),
    })
}

/// Time per body of chains.
fn times(cases: &[Case]) -> Option<Figure> {
    let mut series: Vec<Series> = Vec::new();
    for case in cases.iter().filter(|case| case.error.is_some()) {
        let Some(nanoseconds) = case.nanoseconds else { continue };
        let name = format!("{}, {}, {}", case.robot, case.asked, case.method);
        let point = Point {
            x: case.value,
            y: nanoseconds / case.value,
            label: format!("{nanoseconds:.0} ns in all"),
        };
        Series::add(&mut series, name, point).line = true;
    }
    (!series.is_empty()).then(|| Figure {
        id: "extremes-chain-time".into(),
        title: "Chain: time per body or loop".into(),
        caption: "The shortest of five calls over the number of bodies, or of loops of three \
            bodies each; level where the cost is O(n)."
            .into(),
        x: Axis::log("bodies or loops in a row"),
        y: Axis::log("ns per body or loop"),
        series,
    })
}
