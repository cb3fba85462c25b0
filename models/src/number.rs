//! Numbers as people write them, read strictly: every word a finite number, and as many as asked.

use core::fmt;

use crate::report::quoted;

/// Why a text is not the expected numbers.
#[derive(Debug, PartialEq)]
pub(crate) enum NumberFault {
    NotANumber(String),
    NotFinite(String),
    Count(usize),
}

impl fmt::Display for NumberFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NumberFault::NotANumber(word) => write!(f, "{} is not a number", quoted(word)),
            NumberFault::NotFinite(word) => write!(f, "{} is not finite", quoted(word)),
            NumberFault::Count(1) => f.write_str("it holds 1 number"),
            NumberFault::Count(count) => write!(f, "it holds {count} numbers"),
        }
    }
}

/// `N` numbers separated by white space.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], NumberFault> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for word in text.split_ascii_whitespace() {
        let value = number(word)?;
        if let Some(slot) = numbers.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count == N { Ok(numbers) } else { Err(NumberFault::Count(count)) }
}

/// One finite number without anything around it.
pub(crate) fn number(word: &str) -> Result<f64, NumberFault> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(NumberFault::NotFinite(word.to_owned())),
        // YAML's own spelling
        Err(_)
            if matches!(
                word.trim_start_matches(['-', '+']),
                ".inf" | ".Inf" | ".INF" | ".nan" | ".NaN" | ".NAN"
            ) =>
        {
            Err(NumberFault::NotFinite(word.to_owned()))
        }
        Err(_) => Err(NumberFault::NotANumber(word.to_owned())),
    }
}

/// "one finite number", "3 finite numbers".
pub(crate) fn expected(count: usize) -> String {
    if count == 1 { "one finite number".to_owned() } else { format!("{count} finite numbers") }
}
