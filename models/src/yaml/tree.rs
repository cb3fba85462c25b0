//! YAML as a tree with positions, built from the parser's events: no recursion, and repeated keys
//! stay visible.

use std::collections::BTreeMap;

use saphyr_parser::{Event, Parser, ScalarStyle};

use crate::report::{Diagnostics, Span, quoted};
use crate::text::{DEEPEST, Text};

/// Most nodes of a file.
const MOST_NODES: usize = 1_000_000;
/// Most nodes that all aliases of a file may expand to.
const MOST_EXPANDED: usize = 100_000;

/// A node and its position.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its first character.
    pub span: Span,
    /// Its content.
    pub value: Value,
}

/// The content of a node.
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
    /// The node for a message.
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
        self.entry(query).map(|(_, value)| value)
    }

    /// A key of a mapping and its value.
    pub(crate) fn entry(&self, query: &str) -> Option<&(Node, Node)> {
        let Value::Map(entries) = &self.value else { return None };
        entries.iter().find(|(key, _)| key.text() == Some(query))
    }

    /// The text of a word, if it is one.
    pub(crate) fn text(&self) -> Option<&str> {
        if let Value::Scalar { text, .. } = &self.value { Some(text) } else { None }
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

/// The value of an anchor.
struct Anchored {
    node: Node,
    size: usize,
    depth: usize,
}

/// Parses one YAML document that is `expected` to be a file of some kind; `None` after an error
/// that leaves no tree.
pub(crate) fn parse(text: &Text, expected: &str, diagnostics: &mut Diagnostics) -> Option<Node> {
    let mut builder = Builder::default();
    for event in Parser::new_from_str(&text.content) {
        let (event, marks) = match event {
            Ok(event) => event,
            Err(error) => {
                let span = text.span_at(error.marker().line(), error.marker().col() + 1);
                // the scanner looks ahead of our own limit and has a higher one
                if error.info() == "recursion limit exceeded" {
                    return too_deep(span, diagnostics);
                }
                let found = format!("this is not YAML: {}", error.info());
                let help = "correct the file at this position";
                return diagnostics.refused(span, found, expected, help);
            }
        };
        let here = text.span_at(marks.start.line(), marks.start.col() + 1);
        if matches!(event, Event::DocumentStart(_)) && builder.root.is_some() {
            diagnostics.error(here, "a second document", "one", "remove what follows `---`");
            break;
        }
        builder.take(event, here, diagnostics)?;
    }
    Some(builder.root.unwrap_or(Node { span: Span::start(text.file), value: Value::Null }))
}

/// The tree of the events so far.
#[derive(Default)]
struct Builder {
    root: Option<Node>,
    open: Vec<Open>,
    /// Nodes so far, aliases written out.
    n_nodes: usize,
    /// By the parser's number; a name that is taken again gets a new one.
    anchors: BTreeMap<usize, Anchored>,
    /// Nodes of all anchors together.
    n_anchored: usize,
    /// Nodes of all aliases together.
    n_expanded: usize,
}

impl Builder {
    /// Takes an event; `None` after an error that leaves no tree.
    fn take(&mut self, event: Event<'_>, here: Span, diagnostics: &mut Diagnostics) -> Option<()> {
        if let Event::Scalar(.., Some(_))
        | Event::SequenceStart(_, Some(_))
        | Event::MappingStart(_, Some(_)) = &event
        {
            diagnostics.error(here, "a tag (`!…`)", "plain values", "remove it");
        }
        match event {
            Event::Scalar(value, style, anchor, _) => {
                let node = Node { span: here, value: scalar(&value, style) };
                self.close(node, anchor, 0, self.n_nodes);
            }
            Event::Alias(anchor) => self.alias(anchor, here, diagnostics)?,
            Event::SequenceStart(anchor, _) => {
                self.start(Value::List(Vec::new()), anchor, here, diagnostics)?;
            }
            Event::MappingStart(anchor, _) => {
                self.start(Value::Map(Vec::new()), anchor, here, diagnostics)?;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                let Open { node, anchor, before, depth, .. } = self.open.pop()?;
                self.close(node, anchor, depth + 1, before);
            }
            _ => {}
        }
        if self.n_nodes.max(self.n_anchored) > MOST_NODES {
            let found = format!("the file has more than {MOST_NODES} values");
            let help = "leave out what is not needed";
            return diagnostics.refused(here, found, "a file of ordinary size", help);
        }
        Some(())
    }

    /// Begins a list or a mapping.
    fn start(
        &mut self,
        value: Value,
        anchor: usize,
        here: Span,
        diagnostics: &mut Diagnostics,
    ) -> Option<()> {
        if self.open.len() >= DEEPEST {
            return too_deep(here, diagnostics);
        }
        let node = Node { span: here, value };
        self.open.push(Open { node, anchor, before: self.n_nodes, depth: 0, key: None });
        Some(())
    }

    /// Expands an alias to its value.
    fn alias(&mut self, anchor: usize, here: Span, diagnostics: &mut Diagnostics) -> Option<()> {
        let Some(Anchored { node, size, depth }) = self.anchors.get(&anchor) else {
            let found = "an alias (`*…`) within the value that it stands for";
            return diagnostics.refused(here, found, "a value that ends", "write the value out");
        };
        self.n_expanded += size;
        if self.n_expanded > MOST_EXPANDED {
            let found = format!("the aliases stand for more than {MOST_EXPANDED} values");
            let help = "write fewer of them, or the values out";
            return diagnostics.refused(here, found, "a file of ordinary size", help);
        }
        if self.open.len() + depth > DEEPEST {
            return too_deep(here, diagnostics);
        }
        self.n_nodes += size - 1;
        let node = Node { span: here, value: node.value.clone() };
        let depth = *depth;
        self.close(node, 0, depth, self.n_nodes);
        Some(())
    }

    /// Adds a whole node to its parent. `before` counts the nodes of the file before it.
    fn close(&mut self, node: Node, anchor: usize, depth: usize, before: usize) {
        self.n_nodes += 1;
        if anchor != 0 {
            let size = self.n_nodes - before;
            self.n_anchored += size;
            self.anchors.insert(anchor, Anchored { node: node.clone(), size, depth });
        }
        match self.open.last_mut() {
            Some(parent) => {
                parent.depth = parent.depth.max(depth);
                parent.add(node);
            }
            None => self.root = Some(node),
        }
    }
}

fn too_deep<T>(span: Span, diagnostics: &mut Diagnostics) -> Option<T> {
    let found = "lists and mappings are nested too deep";
    diagnostics.refused(span, found, format!("at most {DEEPEST} levels"), "flatten the file")
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
