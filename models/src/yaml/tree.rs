//! YAML as a tree with positions, built from the parser's events: no recursion, and repeated keys
//! stay visible.

use std::collections::BTreeMap;

use saphyr_parser::{Event, Marker, Parser, ScalarStyle};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::{DEEPEST, Text};

/// Most nodes of a file.
const MOST_NODES: usize = 1_000_000;
/// Most nodes that the aliases of a file may stand for, all together.
const MOST_EXPANDED: usize = 100_000;

/// A node and where it stands.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its first character.
    pub span: Span,
    /// What it is.
    pub value: Value,
}

/// What a node is.
#[derive(Clone, Debug)]
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
    /// Its anchor, 0 without one.
    anchor: usize,
    /// Nodes of the file before it.
    before: usize,
    /// Levels below it.
    depth: usize,
    /// The key that waits for its value.
    key: Option<Node>,
}

/// What an anchor stands for.
struct Anchored {
    node: Node,
    size: usize,
    depth: usize,
}

/// Parses one YAML document that is `expected` to be a file of some kind; `None` after an error
/// that leaves no tree.
pub(crate) fn parse(text: &Text, expected: &str, diagnostics: &mut Diagnostics) -> Option<Node> {
    let span_of = |mark: &Marker| text.span_at(mark.line(), mark.col() + 1);
    let mut open: Vec<Open> = Vec::new();
    let mut root: Option<Node> = None;
    let mut n_nodes = 0;
    // the parser numbers anchors as it meets them; a name that is taken again gets a new number
    let mut anchors: BTreeMap<usize, Anchored> = BTreeMap::new();
    let (mut n_anchored, mut n_expanded) = (0, 0);
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
        if tag {
            diagnostics.error(here, "a tag (`!…`)", "plain values", "remove it");
        }
        let (node, anchor, depth, before) = match event {
            Event::Scalar(value, style, ..) => {
                (Node { span: here, value: scalar(&value, style) }, anchor, 0, n_nodes)
            }
            Event::Alias(anchor) => {
                let Some(Anchored { node, size, depth }) = anchors.get(&anchor) else {
                    let found = "an alias (`*…`) within the value that it stands for";
                    diagnostics.error(here, found, "a value that ends", "write the value out");
                    return None;
                };
                n_expanded += size;
                if n_expanded > MOST_EXPANDED {
                    diagnostics.error(
                        here,
                        format!("the aliases stand for more than {MOST_EXPANDED} values"),
                        "a file of ordinary size",
                        "write fewer of them, or the values out",
                    );
                    return None;
                }
                if open.len() + depth > DEEPEST {
                    too_deep(here, diagnostics);
                    return None;
                }
                n_nodes += size - 1;
                (Node { span: here, value: node.value.clone() }, 0, *depth, n_nodes)
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
                let node = Node { span: here, value };
                open.push(Open { node, anchor, before: n_nodes, depth: 0, key: None });
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(closed) => (closed.node, closed.anchor, closed.depth + 1, closed.before),
                None => continue,
            },
            Event::DocumentStart(_) if root.is_some() => {
                diagnostics.error(here, "a second document", "one", "remove what follows `---`");
                return root;
            }
            _ => continue,
        };
        n_nodes += 1;
        if anchor != 0 {
            let size = n_nodes - before;
            n_anchored += size;
            anchors.insert(anchor, Anchored { node: node.clone(), size, depth });
        }
        if n_nodes.max(n_anchored) > MOST_NODES {
            diagnostics.error(
                here,
                format!("the file has more than {MOST_NODES} values"),
                "a file of ordinary size",
                "leave out what is not needed",
            );
            return None;
        }
        match open.last_mut() {
            Some(parent) => {
                parent.depth = parent.depth.max(depth);
                parent.add(node);
            }
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
