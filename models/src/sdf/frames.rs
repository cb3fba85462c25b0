//! Named frames: those of models, links and joints, and `<frame>`.

use std::collections::BTreeMap;

use super::value;
use crate::mjcf::document::Element;
use crate::pose::Pose;
use crate::report::{Diagnostics, Span, quoted};

/// The frame of a model, by its own name in it.
pub(super) const MODEL: &str = "__model__";
/// The frame of the outermost scope.
pub(super) const WORLD: &str = "world";

/// Most frames that are each given in the next one, where none of them is listed before.
const DEEPEST: usize = 200;

/// A frame as written.
pub(super) struct Frame<'e> {
    pub(super) element: &'e Element,
    /// The names of the models around it, each with `::`.
    pub(super) scope: String,
    /// The frame in which its pose is given where that names none.
    pub(super) base: String,
    /// The frame with whose link it moves.
    pub(super) attached: String,
}

/// The frames of a file: names within models stand behind their names and `::`.
#[derive(Default)]
pub(super) struct Frames<'e> {
    order: Vec<String>,
    all: BTreeMap<String, Frame<'e>>,
    /// Link and pose in the world; `None` before the end of the search, and after an error.
    found: BTreeMap<String, Option<(usize, Pose)>>,
}

/// The whole name of a frame that is named within a scope.
pub(super) fn full(scope: &str, name: &str) -> String {
    if name == WORLD { name.to_owned() } else { format!("{scope}{name}") }
}

impl<'e> Frame<'e> {
    pub(super) fn new(
        element: &'e Element,
        scope: &str,
        base: &str,
        attached: String,
    ) -> Frame<'e> {
        Frame { element, scope: scope.to_owned(), base: base.to_owned(), attached }
    }
}

impl<'e> Frames<'e> {
    pub(super) fn count(&self) -> usize {
        self.order.len()
    }

    pub(super) fn add(&mut self, name: String, frame: Frame<'e>, diagnostics: &mut Diagnostics) {
        if self.all.contains_key(&name) || name == WORLD {
            diagnostics.second(frame.element.span, "frame", &name);
        }
        self.order.push(name.clone());
        self.all.insert(name, frame);
    }

    /// Places all frames.
    pub(super) fn place(&mut self, links: &BTreeMap<String, usize>, of: &mut Diagnostics) {
        self.found.insert(WORLD.to_owned(), Some((0, Pose::NONE)));
        for name in self.order.clone() {
            self.search(&name, Span::start(0), 0, links, of);
        }
    }

    fn search(
        &mut self,
        name: &str,
        at: Span,
        depth: usize,
        links: &BTreeMap<String, usize>,
        diagnostics: &mut Diagnostics,
    ) -> Option<(usize, Pose)> {
        let name = self.whole(name);
        if let Some(Some(found)) = self.found.get(&name) {
            return Some(*found);
        }
        let is_open = self.found.insert(name.clone(), None).is_some() || depth > DEEPEST;
        let frame = self.all.get(&name).filter(|_| !is_open);
        let link = self.link(&name, links);
        let (Some(Frame { element, scope, base, .. }), Some(link)) = (frame, link) else {
            let found = match frame {
                None if !is_open => format!("the frame {}, which does not exist", quoted(&name)),
                _ => format!("the frame {} is not placed, or relative to itself", quoted(&name)),
            };
            let help = "correct the name, or list frames behind those that they name";
            diagnostics.error(at, found, "a frame of this file", help);
            return None;
        };
        let (pose, written) = value::pose(element, diagnostics);
        let base = written.map_or_else(|| base.clone(), |of| full(scope, of));
        let (_, outer) = self.search(&base, element.span, depth + 1, links, diagnostics)?;
        let placed = (link, outer.then(pose));
        self.found.insert(name, Some(placed));
        Some(placed)
    }

    /// The name of a frame, or of the frame of a model.
    fn whole(&self, name: &str) -> String {
        let inner = format!("{name}::{MODEL}");
        if self.all.contains_key(&inner) { inner } else { name.to_owned() }
    }

    /// The link with which a frame moves.
    fn link(&self, name: &str, links: &BTreeMap<String, usize>) -> Option<usize> {
        let mut name = name.to_owned();
        for _ in 0..DEEPEST {
            if let Some(link) = links.get(&name) {
                return Some(*link);
            }
            name = self.whole(&self.all.get(&name)?.attached);
        }
        None
    }

    /// The link and the pose of a frame; `None` of one that is not placed, after an error.
    pub(super) fn get(
        &self,
        name: &str,
        at: Span,
        diagnostics: &mut Diagnostics,
    ) -> Option<(usize, Pose)> {
        let found = self.found.get(&self.whole(name));
        if found.is_none() {
            let known = self.all.keys().map(String::as_str);
            let found = format!("the frame {}, which does not exist", quoted(name));
            let expected = "a link or another frame of this file";
            diagnostics.unknown(at, found, expected, name, known, "correct the name");
        }
        *found?
    }
}
