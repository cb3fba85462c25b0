//! Numbers as people write them, read strictly: every word a finite number, and as many as asked.

use crate::report::quoted;

/// Why a text is not the expected numbers.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(crate) enum NumberFault {
    #[error("{} is not a number", quoted(.0))]
    NotANumber(String),
    #[error("{} is not finite", quoted(.0))]
    NotFinite(String),
    #[error("it holds {n} number{s}", n = .0, s = if *.0 == 1 { "" } else { "s" })]
    Count(usize),
}

/// `N` numbers separated by white space.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], NumberFault> {
    list(text)?.try_into().map_err(|numbers: Vec<f64>| NumberFault::Count(numbers.len()))
}

/// Numbers separated by white space.
pub(crate) fn list(text: &str) -> Result<Vec<f64>, NumberFault> {
    text.split_ascii_whitespace().map(number).collect()
}

/// One finite number without anything around it.
pub(crate) fn number(word: &str) -> Result<f64, NumberFault> {
    // infinities and NaN in YAML's own spelling
    const OF_YAML: [&str; 6] = [".inf", ".Inf", ".INF", ".nan", ".NaN", ".NAN"];
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Err(_) if !OF_YAML.contains(&word.trim_start_matches(['-', '+'])) => {
            Err(NumberFault::NotANumber(word.to_owned()))
        }
        _ => Err(NumberFault::NotFinite(word.to_owned())),
    }
}

/// "one finite number", "3 finite numbers".
pub(crate) fn expected(count: usize) -> String {
    if count == 1 { "one finite number".to_owned() } else { format!("{count} finite numbers") }
}
