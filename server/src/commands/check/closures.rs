//! The table of closures.

use sarrus_models::ClosureReport;

use crate::commands::output::table;

/// One row for each submechanism, then what has names: redundant rows, idle joints, singular poses.
pub(super) fn in_words(closures: &[ClosureReport]) -> String {
    let heads = [
        "submechanism",
        "type",
        "closure",
        "rows",
        "rank",
        "redundant",
        "idle",
        "branch",
        "misfit",
        "sigma",
        "cond",
    ];
    let rows: Vec<Vec<String>> = closures.iter().map(row).collect();
    let mut text = table(&heads, &rows);
    for closure in closures {
        let mut line =
            |what: &str, words: &str| text += &format!("{}: {what}: {words}\n", closure.name);
        if !closure.redundant.is_empty() {
            line("redundant rows", &closure.redundant.join(", "));
        }
        if !closure.idle.is_empty() {
            line("idle joints", &closure.idle.join(", "));
        }
        if closure.rows > 0 && !closure.singular.is_empty() {
            line("singular poses", closure.singular);
        }
    }
    text
}

fn row(closure: &ClosureReport) -> Vec<String> {
    let sign = |branch: &f64| {
        if *branch > 0.0 {
            "+1"
        } else if *branch < 0.0 {
            "-1"
        } else {
            "0"
        }
    };
    let branch = closure.branch.iter().map(sign).collect::<Vec<_>>().join(" ");
    let tied = closure.rows > 0;
    let when_tied = |text: String| if tied { text } else { "-".to_owned() };
    vec![
        closure.name.clone(),
        closure.type_name.clone(),
        closure.kind.to_owned(),
        closure.rows.to_string(),
        closure.rank.to_string(),
        closure.redundant.len().to_string(),
        closure.idle.len().to_string(),
        // the sign of det K_d at the zero pose; couplings have one pose only
        if branch.is_empty() { "-".to_owned() } else { branch },
        if closure.misfit == 0.0 { "0".to_owned() } else { format!("{:.1e}", closure.misfit) },
        when_tied(format!("{:.2e}", closure.sigma_min)),
        when_tied(if closure.cond.is_finite() {
            format!("{:.1e}", closure.cond)
        } else {
            "singular".to_owned()
        }),
    ]
}
