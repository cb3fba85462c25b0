//! The tables of dimensions.

use sarrus_models::{Dimensions, Range};

use crate::commands::output::table;

/// Lengths of the loops, ranges of their independents, densities of links.
pub(super) fn in_words(dimensions: &Dimensions) -> String {
    let lengths = dimensions.lengths.iter().map(|of| {
        let length = format!("{:.6}", of.length);
        vec![of.cut.clone(), of.link.clone(), of.from.clone(), of.to.clone(), length]
    });
    let ranges =
        dimensions.ranges.iter().map(|of| vec![of.name.clone(), limits(of), of.in_words()]);
    let densities = dimensions
        .densities
        .iter()
        .map(|of| vec![of.link.clone(), format!("{}", of.mass), format!("{:.0}", of.density)]);
    let parts = [
        ("loop | link | from | to | length in m", lengths.collect::<Vec<_>>()),
        ("independent | limits | its loops close", ranges.collect()),
        ("link | mass in kg | least density in kg/m³", densities.collect()),
    ];
    let filled = parts.iter().filter(|(_, rows)| !rows.is_empty());
    filled.map(|(heads, rows)| format!("\n{}", table(heads, rows))).collect()
}

fn limits(of: &Range) -> String {
    let end = |limit: Option<f64>| limit.map_or("none".to_owned(), |limit| limit.to_string());
    match (of.lower, of.upper) {
        (None, None) => "none".to_owned(),
        (lower, upper) => format!("{} to {}", end(lower), end(upper)),
    }
}
