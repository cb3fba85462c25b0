//! YAML as a tree with positions, built from the parser's events: no recursion, and repeated keys
//! stay visible.

use saphyr_parser::{Event, Marker, Parser, ScalarStyle};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::{DEEPEST, Text};

/// Most nodes of a file.
const MOST_NODES: usize = 1_000_000;

/// A node and where it stands.
#[derive(Debug)]
pub struct Node {
    /// Its first character.
    pub span: Span,
    /// What it is.
    pub value: Value,
}

/// What a node is.
#[derive(Debug)]
pub enum Value {
    /// Nothing, `~` or `null`.
    Null,
    /// A word or text; a quoted one is never a number.
    Scalar {
        /// The text, without quotes.
        text: String,
        /// Not in quotes.
        plain: bool,
    },
    /// A list.
    List(Vec<Node>),
    /// Keys and values.
    Map(Vec<(Node, Node)>),
}

impl Node {
    /// What the node is, for a message.
    pub fn describe(&self) -> String {
        match &self.value {
            Value::Null => "nothing".to_owned(),
            Value::Scalar { text, .. } => quoted(text),
            Value::List(_) => "a list".to_owned(),
            Value::Map(_) => "a mapping".to_owned(),
        }
    }

    /// The value of a key of a mapping.
    pub fn get(&self, query: &str) -> Option<&Node> {
        let Value::Map(entries) = &self.value else { return None };
        entries
            .iter()
            .find(|(key, _)| matches!(&key.value, Value::Scalar { text, .. } if text == query))
            .map(|(_, value)| value)
    }

    /// The items of a list.
    pub fn items(&self) -> &[Node] {
        if let Value::List(items) = &self.value { items } else { &[] }
    }
}

/// A list or mapping that is not yet closed.
struct Open {
    node: Node,
    /// The key that waits for its value.
    key: Option<Node>,
}

/// Parses one YAML document that is `expected` to be a file of some kind; `None` after an error
/// that leaves no tree.
pub(crate) fn parse(text: &Text, expected: &str, diagnostics: &mut Diagnostics) -> Option<Node> {
    let span_of = |mark: &Marker| text.span_at(mark.line(), mark.col() + 1);
    let mut open: Vec<Open> = Vec::new();
    let mut root: Option<Node> = None;
    let mut n_nodes = 0;
    for event in Parser::new_from_str(&text.content) {
        let (event, marks) = match event {
            Ok(event) => event,
            Err(error) => {
                // the scanner looks ahead of our own limit and has a higher one
                if error.info() == "recursion limit exceeded" {
                    too_deep(span_of(error.marker()), diagnostics);
                    return None;
                }
                let found = format!("this is not YAML: {}", error.info());
                diagnostics.error(
                    span_of(error.marker()),
                    found,
                    expected,
                    "correct the file at this position",
                );
                return None;
            }
        };
        let here = span_of(&marks.start);
        let (anchor, tag) = match &event {
            Event::Scalar(_, _, anchor, tag)
            | Event::SequenceStart(anchor, tag)
            | Event::MappingStart(anchor, tag) => (*anchor, tag.is_some()),
            _ => (0, false),
        };
        if anchor != 0 {
            diagnostics.error(
                here,
                "an anchor (`&…`)",
                "a file without anchors and aliases",
                "write the value out where it is used",
            );
        }
        if tag {
            diagnostics.error(here, "a tag (`!…`)", "plain values", "remove it");
        }
        let node = match event {
            Event::Scalar(value, style, ..) => Node { span: here, value: scalar(&value, style) },
            Event::Alias(_) => {
                diagnostics.error(
                    here,
                    "an alias (`*…`)",
                    "a file without anchors and aliases",
                    "write the value out",
                );
                Node { span: here, value: Value::Null }
            }
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() >= DEEPEST {
                    too_deep(here, diagnostics);
                    return None;
                }
                let value = if matches!(event, Event::SequenceStart(..)) {
                    Value::List(Vec::new())
                } else {
                    Value::Map(Vec::new())
                };
                open.push(Open { node: Node { span: here, value }, key: None });
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(closed) => closed.node,
                None => continue,
            },
            Event::DocumentStart(_) if root.is_some() => {
                diagnostics.error(here, "a second document", "one", "remove what follows `---`");
                return root;
            }
            _ => continue,
        };
        n_nodes += 1;
        if n_nodes > MOST_NODES {
            diagnostics.error(
                here,
                format!("the file has more than {MOST_NODES} values"),
                "a file of ordinary size",
                "leave out what is not needed",
            );
            return None;
        }
        match open.last_mut() {
            Some(parent) => parent.add(node),
            None => root = Some(node),
        }
    }
    Some(root.unwrap_or(Node { span: Span::start(text.file), value: Value::Null }))
}

fn too_deep(span: Span, diagnostics: &mut Diagnostics) {
    diagnostics.error(
        span,
        "lists and mappings are nested too deep",
        format!("at most {DEEPEST} levels"),
        "flatten the file",
    );
}

impl Open {
    fn add(&mut self, child: Node) {
        match &mut self.node.value {
            Value::List(items) => items.push(child),
            Value::Map(entries) => match self.key.take() {
                Some(key) => entries.push((key, child)),
                None => self.key = Some(child),
            },
            Value::Null | Value::Scalar { .. } => {}
        }
    }
}

fn scalar(text: &str, style: ScalarStyle) -> Value {
    let plain = style == ScalarStyle::Plain;
    if plain && matches!(text, "" | "~" | "null" | "Null" | "NULL") {
        Value::Null
    } else {
        Value::Scalar { text: text.to_owned(), plain }
    }
}
