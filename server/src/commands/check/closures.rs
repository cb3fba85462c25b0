//! The table of closures.

use std::cmp::Ordering;

use sarrus_dynamics::Part;
use sarrus_models::ClosureReport;

use crate::commands::output::table;

const HEADS: &str = "submechanism | type | closure | rows | rank | redundant | idle | branch | \
                     misfit | sigma | cond";

/// The meaning of the columns.
pub(super) const LEGEND: &str = "\
rows       constraint rows; rank: the number of independent rows; redundant: rows left out
idle       joints that only turn a rod between its ball joints
branch     sign of det K_d at the zero pose, one for each cluster with two assemblies; 0: singular
misfit     deviation of the geometry from the closed form's assumptions, relative to its size
sigma      least singular value of the scaled K_d at the zero pose; 0: singular
cond       condition number of the scaled K_d at the zero pose
";

/// One row for each submechanism, then redundant rows, idle joints and singular poses by name.
pub(super) fn in_words(closures: &[ClosureReport]) -> String {
    let rows: Vec<Vec<String>> = closures.iter().map(row).collect();
    let mut text = table(HEADS, &rows);
    for report in closures {
        let closure = &report.closure;
        let mut line =
            |label: &str, words: &str| text += &format!("{}: {label}: {words}\n", closure.name);
        if !report.redundant.is_empty() {
            line("redundant rows", &report.redundant.join(", "));
        }
        if !closure.idle.is_empty() {
            line("idle joints", &closure.idle.join(", "));
        }
        if closure.rows > 0 && !report.singular.is_empty() {
            line("singular poses", report.singular);
        }
        if closure.rows > 0 {
            line("parts", &parts(&report.parts));
        }
        if let (cells @ 1.., bytes) = report.seeds {
            line("starts without a guess", &format!("{cells} cells, {} kB", bytes.div_ceil(1000)));
        }
    }
    text
}

/// The parts in the order of solution, with their joints where a line has room for them.
fn parts(parts: &[Part]) -> String {
    const ROOM: usize = 76;
    let of = |part: &Part| format!("{} of {} rows", part.method, part.rows);
    let whole = parts.iter().map(|part| format!("{} ({})", of(part), part.joints.join(" ")));
    let whole = whole.collect::<Vec<_>>().join(", ");
    if whole.len() <= ROOM {
        return whole;
    }
    let rods = parts.iter().filter(|part| part.method == "rod").count();
    if rods > 0 {
        let rows: usize = parts.iter().map(|part| part.rows).sum();
        let angles = rows - rods;
        return format!("{rows} rows → {rods} rod lengths + {angles} angles in closed form");
    }
    let equal = parts.chunk_by(|a, b| of(a) == of(b));
    let words = equal.map(|some| match some.len() {
        1 => of(&some[0]),
        n => format!("{n} times {}", of(&some[0])),
    });
    words.collect::<Vec<_>>().join(", ")
}

fn row(report: &ClosureReport) -> Vec<String> {
    let closure = &report.closure;
    let sign = |branch: &f64| match branch.partial_cmp(&0.0) {
        Some(Ordering::Greater) => "+1",
        Some(Ordering::Less) => "-1",
        _ => "0",
    };
    let branch = report.branch.iter().map(sign).collect::<Vec<_>>().join(" ");
    let has_loops = closure.rows > 0;
    let with_loops = |text: String| if has_loops { text } else { "-".to_owned() };
    vec![
        closure.name.clone(),
        closure.type_name.clone(),
        closure.kind.name().to_owned(),
        closure.rows.to_string(),
        closure.rank.to_string(),
        report.redundant.len().to_string(),
        closure.idle.len().to_string(),
        // couplings have no branches
        if branch.is_empty() { "-".to_owned() } else { branch },
        if closure.misfit == 0.0 { "0".to_owned() } else { format!("{:.1e}", closure.misfit) },
        with_loops(format!("{:.2e}", report.sigma_min)),
        with_loops(if report.cond.is_finite() {
            format!("{:.1e}", report.cond)
        } else {
            "singular".to_owned()
        }),
    ]
}
