//! Settings in configurations: declared as data, read and checked in one place.

use core::fmt;
use std::collections::BTreeMap;

use sarrus_models::Diagnostics;
use sarrus_models::yaml::{self, Node, Span, Value, quoted};
use sarrus_proto::fnv1a_64;

/// A setting.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name in configurations.
    pub name: &'static str,
    /// Kind of its value.
    pub kind: KeyKind,
    /// Its default text; empty for an optional setting without a value, `None` for a required one.
    pub default: Option<&'static str>,
    /// One line for people, with the unit.
    pub about: &'static str,
}

/// Kind of a setting's value.
#[derive(Clone, Copy, Debug)]
pub enum KeyKind {
    /// A whole number between two bounds, both included; also as 0x….
    Integer(i64, i64),
    /// A finite number between two bounds, both included.
    Number(f64, f64),
    /// A number between two bounds, or `off`, which is infinite.
    NumberOrOff(f64, f64),
    /// One of these words.
    Word(&'static [&'static str]),
    /// Any text.
    Text,
    /// The name of a file beside the configuration; the setting is its content.
    File,
    /// `true` or `false`.
    Flag,
}

#[derive(Clone, Debug)]
enum Setting {
    Integer(i64),
    Number(f64),
    Text(String),
    Flag(bool),
}

/// The settings of one mapping: checked, defaults filled in.
#[derive(Clone, Debug)]
pub struct Settings {
    place: Span,
    settings: BTreeMap<&'static str, (Setting, Span)>,
}

impl Settings {
    /// Reads the settings `keys` from a mapping, in messages `of`, whose other keys are `others`;
    /// every fault is reported. `file` gives the content of a file that a setting names, or the
    /// reason of a failure.
    pub fn read(
        node: &Node,
        of: &str,
        keys: &'static [Key],
        others: &[&str],
        file: &dyn Fn(&str) -> Result<String, String>,
        diagnostics: &mut Diagnostics,
    ) -> Option<Settings> {
        let known: Vec<&str> =
            others.iter().copied().chain(keys.iter().map(|key| key.name)).collect();
        let mut good = yaml::keys(node, of, &known, diagnostics);
        if !matches!(node.value, Value::Map(_)) {
            return None;
        }
        let mut settings = BTreeMap::new();
        for key in keys {
            let place = node.get(key.name).map_or(node.span, |value| value.span);
            let written = match (node.get(key.name), key.default) {
                (Some(value), _) => match &value.value {
                    Value::Scalar { text, .. } => Some(text.as_str()),
                    _ => None,
                },
                (None, Some("")) => continue,
                (None, Some(default)) => Some(default),
                (None, None) => {
                    let found = format!("{of} has no {}", quoted(key.name));
                    let help = format!("add `{}`: {}", key.name, key.about);
                    diagnostics.error(node.span, found, key.expected(), help);
                    good = false;
                    continue;
                }
            };
            let Some(mut setting) = written.and_then(|text| key.parse(text)) else {
                let value = node.get(key.name).map_or_else(String::new, Node::describe);
                let found = format!("`{}` is {value}", key.name);
                let help = format!("correct it: {}", key.about);
                diagnostics.error(place, found, key.expected(), help);
                good = false;
                continue;
            };
            if let (KeyKind::File, Setting::Text(text)) = (key.kind, &mut setting)
                && !text.is_empty()
            {
                match file(text) {
                    Ok(content) => *text = content,
                    Err(reason) => {
                        let found = format!("{} cannot be read: {reason}", quoted(text));
                        let expected = "a file beside the configuration";
                        diagnostics.error(place, found, expected, "correct the name");
                        good = false;
                        continue;
                    }
                }
            }
            settings.insert(key.name, (setting, place));
        }
        good.then_some(Settings { place: node.span, settings })
    }

    /// Whether there is something at a setting.
    pub fn has(&self, key: &str) -> bool {
        self.settings.contains_key(key)
    }

    /// Where a setting stands, or the mapping where it is a default.
    pub fn place(&self, key: &str) -> Span {
        self.settings.get(key).map_or(self.place, |(_, place)| *place)
    }

    /// Reports a fault of a setting; nothing is made of it.
    pub(crate) fn wrong<T>(
        &self,
        diagnostics: &mut Diagnostics,
        key: &str,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Option<T> {
        diagnostics.refused(self.place(key), found, expected, help)
    }

    /// A setting declared as a number; NaN for any other name.
    pub fn number(&self, key: &str) -> f64 {
        match self.settings.get(key) {
            Some((Setting::Number(number), _)) => *number,
            Some((Setting::Integer(number), _)) => *number as f64,
            _ => f64::NAN,
        }
    }

    /// A number that may be absent, or this one.
    pub fn number_or(&self, key: &str, otherwise: f64) -> f64 {
        if self.has(key) { self.number(key) } else { otherwise }
    }

    /// A setting declared as a whole number; 0 for any other name.
    pub fn integer(&self, key: &str) -> i64 {
        if let Some((Setting::Integer(number), _)) = self.settings.get(key) { *number } else { 0 }
    }

    /// A setting declared as word, text or file; empty for any other name.
    pub fn text(&self, key: &str) -> &str {
        if let Some((Setting::Text(text), _)) = self.settings.get(key) { text } else { "" }
    }

    /// A setting declared as a flag; false for any other name.
    pub fn flag(&self, key: &str) -> bool {
        matches!(self.settings.get(key), Some((Setting::Flag(true), _)))
    }
}

/// As a mapping in the order of names, the content of a file by its FNV-1a.
impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("{")?;
        for (place, (name, (setting, _))) in self.settings.iter().enumerate() {
            let comma = if place == 0 { "" } else { ", " };
            write!(f, "{comma}{name}: ")?;
            match setting {
                Setting::Integer(number) => write!(f, "{number}"),
                Setting::Number(number) => write!(f, "{number}"),
                Setting::Flag(flag) => write!(f, "{flag}"),
                Setting::Text(text) if text.contains('\n') => {
                    write!(f, "{:016x}", fnv1a_64(text.as_bytes()))
                }
                Setting::Text(text) => f.write_str(text),
            }?;
        }
        f.write_str("}")
    }
}

impl Key {
    const fn new(name: &'static str, kind: KeyKind, about: &'static str) -> Key {
        Key { name, kind, default: None, about }
    }

    /// A whole number between two bounds that must be written.
    pub const fn integer(name: &'static str, least: i64, most: i64, about: &'static str) -> Key {
        Key::new(name, KeyKind::Integer(least, most), about)
    }

    /// A number between two bounds that must be written.
    pub const fn number(name: &'static str, least: f64, most: f64, about: &'static str) -> Key {
        Key::new(name, KeyKind::Number(least, most), about)
    }

    /// One of several words.
    pub const fn word(
        name: &'static str,
        words: &'static [&'static str],
        about: &'static str,
    ) -> Key {
        Key::new(name, KeyKind::Word(words), about)
    }

    /// Any text.
    pub const fn text(name: &'static str, about: &'static str) -> Key {
        Key::new(name, KeyKind::Text, about)
    }

    /// `true` or `false`.
    pub const fn flag(name: &'static str, about: &'static str) -> Key {
        Key::new(name, KeyKind::Flag, about)
    }

    /// Gives the setting a default, as it would be written.
    pub const fn or(self, default: &'static str) -> Key {
        Key { default: Some(default), ..self }
    }

    /// Allows the setting to be absent.
    pub const fn optional(self) -> Key {
        self.or("")
    }

    fn parse(&self, text: &str) -> Option<Setting> {
        match self.kind {
            KeyKind::Integer(least, most) => {
                let number = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
                    Some(digits) => i64::from_str_radix(digits, 16).ok()?,
                    None => text.parse().ok()?,
                };
                (least <= number && number <= most).then_some(Setting::Integer(number))
            }
            KeyKind::NumberOrOff(..) if text == "off" => Some(Setting::Number(f64::INFINITY)),
            KeyKind::Number(least, most) | KeyKind::NumberOrOff(least, most) => {
                let number: f64 = text.parse().ok()?;
                (number.is_finite() && least <= number && number <= most)
                    .then_some(Setting::Number(number))
            }
            KeyKind::Word(words) => words.contains(&text).then(|| Setting::Text(text.to_owned())),
            KeyKind::Text | KeyKind::File => Some(Setting::Text(text.to_owned())),
            KeyKind::Flag => text.parse().ok().map(Setting::Flag),
        }
    }

    fn expected(&self) -> String {
        match self.kind {
            KeyKind::Integer(least, most) => format!("a whole number from {least} to {most}"),
            KeyKind::Number(least, most) => format!("a number from {least} to {most}"),
            KeyKind::NumberOrOff(least, most) => format!("a number from {least} to {most}, or off"),
            KeyKind::Word(words) => words.join(", "),
            KeyKind::Text => "a text".to_owned(),
            KeyKind::File => "the name of a file".to_owned(),
            KeyKind::Flag => "true or false".to_owned(),
        }
    }
}
