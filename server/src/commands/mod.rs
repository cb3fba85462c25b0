//! One file or folder for each command.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

pub(crate) mod ask;
#[cfg(feature = "show")]
pub(crate) mod capability;
pub(crate) mod check;
#[cfg(feature = "report")]
pub(crate) mod compare;
pub(crate) mod completions;
#[cfg(feature = "simulate")]
mod curves;
pub(crate) mod demo;
pub(crate) mod doctor;
#[cfg(feature = "report")]
pub(crate) mod export;
#[cfg(feature = "generate")]
pub(crate) mod generate;
#[cfg(feature = "identify")]
pub(crate) mod identify;
pub(crate) mod import;
pub(crate) mod man;
pub(crate) mod output;
pub(crate) mod progress;
pub(crate) mod replay;
#[cfg(feature = "report")]
pub(crate) mod report;
pub(crate) mod robot;
pub(crate) mod robots;
pub(crate) mod serve;
#[cfg(feature = "show")]
pub(crate) mod show;
#[cfg(feature = "simulate")]
pub(crate) mod simulate;
#[cfg(any(feature = "identify", feature = "simulate"))]
pub(crate) mod table;
pub(crate) mod tidy;
#[cfg(feature = "simulate")]
pub(crate) mod time;
pub(crate) mod top;

/// A flag's values with their names and help.
pub(crate) type Choices<T, const N: usize> = [(T, &'static str, &'static str); N];

/// Reads one of these values by its name.
pub(crate) fn choice<T: Copy + Send + Sync + 'static, const N: usize>(
    choices: &'static Choices<T, N>,
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|(_, name, help)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names).try_map(|name| {
        let chosen = choices.iter().find(|(_, known, _)| *known == name);
        chosen.map(|(value, ..)| *value).ok_or("unknown")
    })
}
