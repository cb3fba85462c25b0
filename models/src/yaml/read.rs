//! The values of keys: names, numbers and lists, each fault with its position.

use super::tree::{Node, Value};
use crate::number as strict;
use crate::report::{Diagnostics, Span, quoted};

/// A name and its position.
pub type Named = (String, Span);

/// Checks the keys of a mapping: none is unknown or repeated. False when the node is no mapping.
/// `of` names the mapping in messages.
pub fn keys(node: &Node, of: &str, known: &[&str], diagnostics: &mut Diagnostics) -> bool {
    let Value::Map(entries) = &node.value else {
        let found = format!("{of} is {}", node.describe());
        let expected = format!("a mapping with the keys {}", known.join(", "));
        diagnostics.error(node.span, found, expected, "correct it");
        return false;
    };
    let mut seen: Vec<&str> = Vec::new();
    for (key, _) in entries {
        let Value::Scalar { text, .. } = &key.value else {
            let found = format!("a key of {of} is {}", key.describe());
            diagnostics.error(key.span, found, known.join(", "), "use a word");
            continue;
        };
        if !known.contains(&text.as_str()) {
            let otherwise =
                if text == "<<" { "write out the keys that it merges" } else { "remove it" };
            let help = diagnostics.did_you_mean(text, known.iter().copied(), otherwise);
            let found = format!("the key {} of {of} is not known", quoted(text));
            diagnostics.error(key.span, found, known.join(", "), help);
        } else if seen.contains(&text.as_str()) {
            let found = format!("the key {} of {of} is there twice", quoted(text));
            diagnostics.error(key.span, found, "one", "remove one of them");
        } else {
            seen.push(text);
        }
    }
    true
}

/// Reports a key that a mapping lacks; `of` names the mapping in the message.
pub(crate) fn missing(
    node: &Node,
    of: &str,
    key: &str,
    expected: impl Into<String>,
    diagnostics: &mut Diagnostics,
) {
    diagnostics.error(node.span, format!("{of} has no `{key}`"), expected, "add it");
}

/// The text of a key, if present.
pub fn word(node: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<Named> {
    let value = node.get(key)?;
    word_of(value, key, diagnostics)
}

fn word_of(value: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<Named> {
    match &value.value {
        Value::Scalar { text, .. } if !text.trim().is_empty() => Some((text.clone(), value.span)),
        _ => {
            let found = format!("`{key}` holds {}", value.describe());
            diagnostics.refused(value.span, found, "a name", "write a name")
        }
    }
}

/// The names of a list, if the key is present; an empty value is an empty list.
pub fn words(node: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<Vec<Named>> {
    node.get(key)?;
    let items = list(node, key, diagnostics);
    let names: Vec<Named> =
        items.iter().filter_map(|item| word_of(item, key, diagnostics)).collect();
    (names.len() == items.len()).then_some(names)
}

/// The items of a key's list; an empty value is an empty list.
pub fn list<'a>(node: &'a Node, key: &str, diagnostics: &mut Diagnostics) -> &'a [Node] {
    let Some(value) = node.get(key) else { return &[] };
    if !matches!(value.value, Value::List(_) | Value::Null) {
        let found = format!("`{key}` is {}", value.describe());
        diagnostics.error(value.span, found, "a list", format!("write `{key}: [...]`"));
    }
    value.items()
}

/// `N` numbers of a key, if present.
pub fn numbers<const N: usize>(
    node: &Node,
    of: &str,
    key: &str,
    diagnostics: &mut Diagnostics,
) -> Option<[f64; N]> {
    let value = node.get(key)?;
    let Value::List(items) = &value.value else {
        let found = format!("`{key}` of {of} is {}", value.describe());
        return diagnostics.refused(value.span, found, strict::expected(N), "write them as a list");
    };
    if items.len() != N {
        let found = format!("`{key}` of {of} holds {} values", items.len());
        diagnostics.error(value.span, found, strict::expected(N), "correct the list");
    }
    let mut numbers = [0.0; N];
    let mut good = items.len() == N;
    for (i, item) in items.iter().enumerate() {
        match number(item, key, diagnostics) {
            Some(value) => numbers.get_mut(i).into_iter().for_each(|slot| *slot = value),
            None => good = false,
        }
    }
    good.then_some(numbers)
}

/// One finite number; `key` names it in messages.
pub fn number(item: &Node, key: &str, diagnostics: &mut Diagnostics) -> Option<f64> {
    let fault = match &item.value {
        Value::Scalar { text, plain: true } => match strict::number(text) {
            Ok(value) => return Some(value),
            Err(fault) => fault.to_string(),
        },
        Value::Scalar { .. } => format!("{} is a text in quotes", item.describe()),
        _ => format!("{} is not a number", item.describe()),
    };
    let found = format!("`{key}`: {fault}");
    diagnostics.refused(item.span, found, strict::expected(1), "correct the value")
}
