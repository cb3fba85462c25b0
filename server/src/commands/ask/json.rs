//! JSON values with their positions on a line.

use std::fmt;

use serde::Deserializer;
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

/// A fault and its byte.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) offset: usize,
    pub(super) words: String,
}

/// A value as it was written. Its parts are decoded on demand, so depth and length cost nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value<'a> {
    text: &'a str,
    /// Of its first byte.
    pub(super) offset: usize,
}

impl<'a> Value<'a> {
    /// The one value of a line.
    pub(super) fn parse(line: &'a str) -> Result<Value<'a>, Fault> {
        match serde_json::from_str::<&RawValue>(line) {
            Ok(raw) => Ok(Value { text: line, offset: 0 }.inner(raw)),
            Err(error) => {
                let words = error.to_string();
                let words = words.split(" at line ").next().unwrap_or_default();
                let offset = error.column().saturating_sub(1);
                Err(Fault { offset, words: format!("not JSON: {words}") })
            }
        }
    }

    /// A value within this one.
    fn inner(&self, raw: &'a RawValue) -> Value<'a> {
        let text = raw.get();
        Value {
            text,
            offset: self.offset + text.as_ptr().addr().saturating_sub(self.text.as_ptr().addr()),
        }
    }

    /// Keys and values of an object; members beyond the first `most` are checked and dropped.
    pub(super) fn members(&self, most: usize) -> Option<Vec<(Value<'a>, Value<'a>)>> {
        let members =
            serde_json::Deserializer::from_str(self.text).deserialize_map(Members { most }).ok()?;
        Some(members.into_iter().map(|(key, value)| (self.inner(key), self.inner(value))).collect())
    }

    /// Passes the values of a list to `take` until it returns false.
    pub(super) fn items(&self, take: impl FnMut(Value<'a>) -> bool) -> Option<()> {
        serde_json::Deserializer::from_str(self.text)
            .deserialize_seq(Items { list: *self, take })
            .ok()
    }

    /// The text of a string.
    pub(super) fn string(&self) -> Option<String> {
        serde_json::from_str(self.text).ok()
    }

    /// A number; one that is too large for a double is infinite.
    pub(super) fn number(&self) -> Option<f64> {
        let first = self.text.as_bytes().first()?;
        if first.is_ascii_digit() || *first == b'-' { self.text.parse().ok() } else { None }
    }

    /// True or false.
    pub(super) fn boolean(&self) -> Option<bool> {
        self.text.parse().ok()
    }

    /// The name of its kind.
    pub(super) fn kind(&self) -> &'static str {
        match self.text.as_bytes().first() {
            Some(b'{') => "an object",
            Some(b'[') => "a list",
            Some(b'"') => "text",
            Some(b't' | b'f') => "true or false",
            Some(b'n') => "null",
            _ => "a number",
        }
    }
}

struct Members {
    most: usize,
}

impl<'de> Visitor<'de> for Members {
    type Value = Vec<(&'de RawValue, &'de RawValue)>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut members = Vec::new();
        while members.len() < self.most
            && let Some(member) = map.next_entry()?
        {
            members.push(member);
        }
        // raw: a key may hold half a surrogate
        while map.next_entry::<&RawValue, &RawValue>()?.is_some() {}
        Ok(members)
    }
}

struct Items<'de, F> {
    list: Value<'de>,
    take: F,
}

impl<'de, F: FnMut(Value<'de>) -> bool> Visitor<'de> for Items<'de, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error> {
        while let Some(item) = list.next_element()? {
            if !(self.take)(self.list.inner(item)) {
                break;
            }
        }
        while list.next_element::<&RawValue>()?.is_some() {}
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_knows_its_span() {
        let line = r#" {"a" : [1, -2.5e3 ,{}], "ü": "x"} "#;
        let root = Value::parse(line).unwrap();
        let members = root.members(8).unwrap();
        let spans: Vec<&str> = members
            .iter()
            .flat_map(|(key, value)| [&line[key.offset..], &line[value.offset..]])
            .collect();
        assert!(
            spans[0].starts_with(r#""a""#)
                && spans[1].starts_with("[1")
                && spans[2].starts_with(r#""ü""#)
        );
        let mut items = Vec::new();
        members[0].1.items(|item| {
            items.push((item.number(), item.kind(), item.offset));
            items.len() < 3
        });
        assert_eq!(
            items,
            [(Some(1.0), "a number", 9), (Some(-2500.0), "a number", 12), (None, "an object", 20)]
        );
        assert_eq!(members[1].0.string().as_deref(), Some("ü"));
        assert!(
            root.items(|_| true).is_none() && root.string().is_none() && root.kind() == "an object"
        );
    }

    #[test]
    fn numbers_beyond_a_double_are_infinite_and_nothing_else_is_a_number() {
        let number = |text| Value::parse(text).unwrap().number();
        assert_eq!(
            [number("1e999"), number("-1e999"), number("-0.0")],
            [Some(f64::INFINITY), Some(f64::NEG_INFINITY), Some(0.0)]
        );
        assert_eq!([number("\"1\""), number("true"), number("null")], [None; 3]);
        for text in ["NaN", "Infinity", "01", "+1", ".5", "1.", "[1,]", "{\"a\":1,}", "", "{} {}"] {
            assert!(Value::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn faults_of_syntax_have_their_offset() {
        let fault = |text| Value::parse(text).map(|value| value.offset).unwrap_err();
        assert_eq!(
            fault(r#"{"y":[0.1 0.2]}"#),
            Fault { offset: 10, words: "not JSON: expected `,` or `]`".to_owned() }
        );
        assert_eq!(fault(r#"{"y":[0.1]"#).words, "not JSON: EOF while parsing an object");
    }

    #[test]
    fn depth_and_length_are_no_danger() {
        let deep = "[".repeat(1_000_000) + &"]".repeat(1_000_000);
        let root = Value::parse(&deep).unwrap();
        let mut depths = 0;
        root.items(|item| {
            depths += 1;
            item.number().is_none()
        });
        assert_eq!(depths, 1);
        let wide = format!("{{{}\"a\":1}}", "\"a\":1,".repeat(1_000_000));
        assert_eq!(Value::parse(&wide).unwrap().members(3).unwrap().len(), 3);
    }
}
