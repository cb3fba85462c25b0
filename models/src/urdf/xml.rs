//! Elements and attributes with their positions, read strictly.

use roxmltree::{Attribute, Document, Node, ParsingOptions};

use super::{Version, guard};
use crate::number;
use crate::report::{Diagnostics, Span, quoted};
use crate::text::Text;

/// Most nodes of a document.
const MOST_NODES: u32 = 4_000_000;

/// The attributes and elements that an element may hold, as lists of words.
pub(super) struct Shape {
    /// Attributes.
    pub(super) attributes: &'static str,
    /// Elements that are read, once each.
    pub(super) once: &'static str,
    /// Elements that are read, any number of times.
    pub(super) many: &'static str,
    /// Elements that other programs read; `*` for any.
    pub(super) ignored: &'static str,
}

impl Shape {
    /// Of an element without children.
    pub(super) const fn of(attributes: &'static str) -> Shape {
        Shape { attributes, once: "", many: "", ignored: "" }
    }
}

/// Whether a list of words has this one.
pub(super) fn has(words: &str, word: &str) -> bool {
    words.split_whitespace().any(|of| of == word)
}

/// The first child of this name.
pub(crate) fn child<'a, 't>(node: Node<'a, 't>, name: &str) -> Option<Node<'a, 't>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// Whether an element of the robot is a loop.
pub(super) fn is_closing(node: Node<'_, '_>) -> bool {
    let name = node.tag_name().name();
    match drake(node) {
        Some(name) => name.ends_with("_constraint") || name == "linear_bushing_rpy",
        None => {
            node.tag_name().namespace().is_none()
                && matches!(name, "gazebo" | "loop" | "loop_joint" | "constraint")
        }
    }
}

/// The name of an element of Drake, whether its prefix is declared or not.
pub(super) fn drake<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let name = node.tag_name().name();
    let is_declared = node.tag_name().namespace().is_some_and(|space| space.contains("drake"));
    if is_declared { Some(name) } else { name.strip_prefix("drake_") }
}

/// Parses the text as XML; `None` after an error.
pub(crate) fn parse<'t>(text: &'t Text, diagnostics: &mut Diagnostics) -> Option<Document<'t>> {
    if !guard::is_harmless(text, diagnostics) {
        return None;
    }
    let options =
        ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    match Document::parse_with_options(&text.content, options) {
        Ok(document) => {
            let macros = document.descendants().find(|node| {
                node.is_element()
                    && node.tag_name().namespace().is_some_and(|name| name.ends_with("/xacro"))
            });
            if let Some(node) = macros {
                return expand(text.span(node.range().start), diagnostics);
            }
            Some(document)
        }
        Err(error) => {
            let span = span_of(&error, text);
            if matches!(&error, roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro")
            {
                return expand(span, diagnostics);
            }
            let full = error.to_string();
            // the parser repeats the position at the end of its message
            let what = full.rsplit_once(" at ").map_or(full.as_str(), |(what, _)| what);
            let found = format!("this is not XML: {what}");
            let help = "correct the file at this position";
            diagnostics.refused(span, found, "a well-formed URDF file", help)
        }
    }
}

/// Reports an element of the macro processor.
fn expand<T>(span: Span, diagnostics: &mut Diagnostics) -> Option<T> {
    let found = "an element of xacro, which is not expanded";
    diagnostics.refused(span, found, "a URDF file", "expand it: xacro robot.xacro > robot.urdf")
}

fn span_of(error: &roxmltree::Error, text: &Text) -> Span {
    match error {
        roxmltree::Error::UnclosedRootNode | roxmltree::Error::UnexpectedEndOfStream => {
            text.span(text.content.len())
        }
        _ => {
            let at = error.pos();
            text.span_at(at.row as usize, at.col as usize)
        }
    }
}

/// Reads elements of one text and collects their faults.
pub(super) struct Reader<'t, 'f> {
    pub(super) text: &'t Text,
    pub(super) diagnostics: &'f mut Diagnostics,
    /// The version that the file states.
    pub(super) version: Version,
}

impl<'t> Reader<'t, '_> {
    pub(super) fn span(&self, node: Node<'_, 't>) -> Span {
        self.text.span(node.range().start)
    }

    pub(super) fn span_of_value(&self, attribute: &Attribute<'_, 't>) -> Span {
        self.text.span(attribute.range_value().start)
    }

    /// The elements of `node` that are read. Warns about unknown elements and attributes, and
    /// refuses repeated ones.
    pub(super) fn children<'a>(&mut self, node: Node<'a, 't>, shape: &Shape) -> Vec<Node<'a, 't>> {
        let of = node.tag_name().name().to_owned();
        for attribute in node.attributes() {
            if attribute.namespace().is_none() && !has(shape.attributes, attribute.name()) {
                let name = attribute.name();
                let span = self.text.span(attribute.range().start);
                let found =
                    format!("the attribute {} of `{of}` is not known and not read", quoted(name));
                let expected = shape.attributes.replace(' ', ", ");
                let known = shape.attributes.split_whitespace();
                let help = self.diagnostics.did_you_mean(name, known, "remove it if it is a slip");
                self.diagnostics.warning(span, found, expected, help);
            }
        }
        let mut children = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            let is_ours = child.tag_name().namespace().is_none();
            let is_once = is_ours && has(shape.once, name);
            if is_once || is_ours && has(shape.many, name) {
                if is_once && children.iter().any(|of: &Node<'_, '_>| of.has_tag_name(name)) {
                    let found = format!("`{of}` has a second `{name}`");
                    self.diagnostics.error(self.span(child), found, "one", "remove one of them");
                }
                children.push(child);
                continue;
            }
            // a separate reader handles loops
            if is_closing(child) && has(shape.many, "link") {
                continue;
            }
            if !is_ours || !(has(shape.ignored, name) || shape.ignored == "*") {
                let known = shape.once.split_whitespace().chain(shape.many.split_whitespace());
                let expected = known.clone().collect::<Vec<_>>().join(", ");
                let help = self.diagnostics.did_you_mean(name, known, "remove it if it is a slip");
                let found =
                    format!("the element {} in `{of}` is not known and not read", quoted(name));
                self.diagnostics.warning(self.span(child), found, expected, help);
            }
        }
        children
    }

    /// A required attribute, which must not be empty.
    pub(super) fn required(
        &mut self,
        node: Node<'_, 't>,
        attribute: &'static str,
    ) -> Option<(String, Span)> {
        let Some(found) = node.attribute_node(attribute) else {
            self.missing(node, attribute, "…");
            return None;
        };
        let span = self.span_of_value(&found);
        if found.value().trim().is_empty() {
            let what = format!("`{attribute}` of `{}` is empty", node.tag_name().name());
            return self.diagnostics.refused(span, what, "a name", "fill it in");
        }
        Some((found.value().to_owned(), span))
    }

    /// `N` finite numbers; `None` when the attribute is absent or after an error.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        node: Node<'_, 't>,
        attribute: &str,
    ) -> Option<[f64; N]> {
        let found = node.attribute_node(attribute)?;
        let name = format!("`{attribute}` of `{}`", node.tag_name().name());
        self.parsed(found.value(), name, self.span_of_value(&found))
    }

    /// Finite numbers, as many as there are; `None` when the attribute is absent or after an error.
    pub(super) fn list(&mut self, node: Node<'_, 't>, attribute: &str) -> Option<Vec<f64>> {
        let found = node.attribute_node(attribute)?;
        let fault = match number::list(found.value()) {
            Ok(numbers) => return Some(numbers),
            Err(fault) => format!("`{attribute}`: {fault}"),
        };
        let span = self.span_of_value(&found);
        self.diagnostics.refused(span, fault, "finite numbers", "correct the value")
    }

    /// The finite numbers that an element holds as its text; `None` after an error.
    pub(super) fn numbers_of_text<const N: usize>(
        &mut self,
        node: Node<'_, 't>,
    ) -> Option<[f64; N]> {
        let name = format!("`{}`", node.tag_name().name());
        self.parsed(node.text().unwrap_or_default(), name, self.span(node))
    }

    fn parsed<const N: usize>(&mut self, text: &str, name: String, span: Span) -> Option<[f64; N]> {
        match number::numbers(text) {
            Ok(numbers) => Some(numbers),
            Err(fault) => {
                let found = format!("{name}: {fault}");
                self.diagnostics.refused(span, found, number::expected(N), "correct the value")
            }
        }
    }

    /// One finite number; `None` when the attribute is absent or after an error.
    pub(super) fn number(&mut self, node: Node<'_, 't>, attribute: &str) -> Option<f64> {
        self.numbers::<1>(node, attribute).map(|[number]| number)
    }

    /// As [`Reader::number`]; its absence is an error too.
    pub(super) fn required_number(
        &mut self,
        node: Node<'_, 't>,
        attribute: &'static str,
    ) -> Option<f64> {
        if !node.has_attribute(attribute) {
            self.missing(node, attribute, "a number");
        }
        self.number(node, attribute)
    }

    /// Reports a missing attribute.
    fn missing(&mut self, node: Node<'_, 't>, attribute: &str, value: &str) {
        let found = format!("`{}` has no `{attribute}`", node.tag_name().name());
        let expected = format!("{attribute}=\"{value}\"");
        self.diagnostics.error(self.span(node), found, expected, "add it");
    }
}
