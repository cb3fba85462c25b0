//! Numbers for the joints of a robot: in a flag or in a file.

use std::path::Path;

use serde_json::Value;

use crate::commands::output::Failure;

/// The text of a flag: numbers, or the path of a file with numbers.
#[derive(Clone)]
pub(super) struct Numbers(String);

/// Numbers in the order of the joints or by their names.
enum Written {
    List(Vec<f64>),
    Named(Vec<(String, f64)>),
}

impl From<String> for Numbers {
    fn from(text: String) -> Numbers {
        Numbers(text)
    }
}

impl Numbers {
    /// One number for each name; names that are not listed keep their number in `rest`.
    pub(super) fn resolve(&self, names: &[String], rest: Vec<f64>) -> Result<Vec<f64>, Failure> {
        let written = match self.in_flag() {
            Some(written) => written,
            None => self.in_file()?,
        };
        let mut numbers = rest;
        match written {
            Written::List(list) if list.len() == names.len() => numbers = list,
            Written::List(list) => {
                let n = list.len();
                return Err(self.fault(&format!("{n} numbers, expected {}", names.len())));
            }
            Written::Named(named) => {
                for (name, number) in named {
                    let place = names.iter().position(|known| *known == name);
                    let place = place.and_then(|k| numbers.get_mut(k)).ok_or_else(|| {
                        let names = names.join(", ");
                        self.fault(&format!("no joint `{name}`, expected one of {names}"))
                    })?;
                    *place = number;
                }
            }
        }
        Ok(numbers)
    }

    /// A fault of the numbers: wrong flags end with 2, the content of files with 1.
    pub(super) fn fault(&self, words: &str) -> Failure {
        let reason = format!("{}: {words}", self.0);
        match self.in_flag() {
            Some(_) => Failure::start(reason),
            None => Failure::finding(reason),
        }
    }

    /// Numbers in the flag itself; `None` for the name of a file.
    fn in_flag(&self) -> Option<Written> {
        if Path::new(&self.0).exists() {
            return None;
        }
        if let Some(list) = list(self.0.strip_prefix("q=").unwrap_or(&self.0)) {
            return Some(Written::List(list));
        }
        let pair = |part: &str| {
            part.rsplit_once('=')
                .and_then(|(name, number)| Some((name.trim().to_owned(), parse(number)?)))
        };
        self.0.split(',').map(pair).collect::<Option<_>>().map(Written::Named)
    }

    fn in_file(&self) -> Result<Written, Failure> {
        let text = std::fs::read_to_string(&self.0).map_err(|error| {
            Failure::start(format!(
                "cannot read {}: {error}; give numbers or a readable file",
                self.0
            ))
        })?;
        let value: Value = serde_json::from_str(&text)
            .map_err(|error| self.fault(&format!("not JSON: {error}")))?;
        let value = value.get("assembled").unwrap_or(&value);
        // an answer of `ask`, or the report of an assembly
        let value = value.get("q").filter(|q| q.is_array() || q.is_object()).unwrap_or(value);
        let written = match value {
            Value::Array(list) => list.iter().map(number).collect::<Option<_>>().map(Written::List),
            Value::Object(map) => map
                .iter()
                .map(|(name, x)| Some((name.clone(), number(x)?)))
                .collect::<Option<_>>()
                .map(Written::Named),
            _ => None,
        };
        written.ok_or_else(|| self.fault("expected a list of numbers or numbers by name"))
    }
}

/// Numbers between commas, in brackets or not.
fn list(text: &str) -> Option<Vec<f64>> {
    let text = text.trim();
    let inner = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
    inner.split(',').map(parse).collect()
}

/// A number; infinity by its name.
fn parse(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| !x.is_nan())
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_str().and_then(parse))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(text: &str) -> Result<Vec<f64>, u8> {
        let names = ["a", "b", "c"].map(str::to_owned);
        Numbers(text.to_owned()).resolve(&names, vec![1.0; 3]).map_err(|failure| failure.code)
    }

    #[test]
    fn numbers_come_as_a_list_or_by_name() {
        for text in ["q=1,-2.5e-1,inf", "1, -0.25, inf", "q=[1,-0.25,inf]", "b=-0.25,c=inf"] {
            assert_eq!(resolve(text), Ok(vec![1.0, -0.25, f64::INFINITY]), "{text}");
        }
    }

    #[test]
    fn numbers_that_do_not_fit_the_robot_are_a_wrong_flag() {
        for text in ["q=1,2", "d=1", "1,nan,2", "a=nan", "no/such.json", ""] {
            assert_eq!(resolve(text), Err(2), "{text}");
        }
    }
}
