//! Named frames: those of models, links and joints, and `<frame>`. Names within a model stand
//! behind its name and `::`.

use std::collections::BTreeMap;

use super::pose;
use crate::mjcf::document::Element;
use crate::pose::Pose;
use crate::report::{Diagnostics, Span, quoted};

/// The frame of a model, by its own name in it.
pub(super) const MODEL: &str = "__model__";
/// The outermost frame.
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
    /// The link that it is.
    pub(super) link: Option<usize>,
}

/// The frames of a file.
#[derive(Default)]
pub(super) struct Frames<'e> {
    all: BTreeMap<String, Frame<'e>>,
    /// Link and pose in the world; `None` before the end of the search, and after an error.
    found: BTreeMap<String, Option<(usize, Pose)>>,
}

/// The whole name of a frame that is named within a scope.
pub(super) fn full(scope: &str, name: &str) -> String {
    if name == WORLD { name.to_owned() } else { format!("{scope}{name}") }
}

impl<'e> Frames<'e> {
    pub(super) fn add(&mut self, name: String, frame: Frame<'e>, diagnostics: &mut Diagnostics) {
        if self.all.contains_key(&name) || name == WORLD || name == frame.scope {
            diagnostics.second(frame.element.span, "frame", &name);
        }
        self.all.insert(name, frame);
    }

    pub(super) fn count(&self) -> usize {
        self.all.len()
    }

    /// The link and the pose of a frame; `None` after an error.
    pub(super) fn get(
        &mut self,
        name: &str,
        (at, depth): (Span, usize),
        diagnostics: &mut Diagnostics,
    ) -> Option<(usize, Pose)> {
        if name == WORLD {
            return Some((0, Pose::NONE));
        }
        let name = self.whole(name);
        if let Some(Some(found)) = self.found.get(&name) {
            return Some(*found);
        }
        let is_open = self.found.contains_key(&name) || depth > DEEPEST;
        let frame = self.all.get(&name).filter(|_| !is_open);
        let (Some(Frame { element, scope, base, .. }), Some(link)) = (frame, self.link(&name))
        else {
            let why = if is_open { "is relative to itself" } else { "does not exist" };
            let found = format!("the frame {} {why}, or it is not placed", quoted(&name));
            let help = "correct the name, or list frames behind those that they name";
            diagnostics.error(at, found, "a frame of this file", help);
            return None;
        };
        let (inner, written) = pose(element, diagnostics);
        let written = written.get("relative_to").or(written.get("frame")).map(|of| of.value.trim());
        let written = written.filter(|of| !of.is_empty());
        let base = written.map_or_else(|| base.clone(), |of| full(scope, of));
        let span = element.span;
        self.found.insert(name.clone(), None);
        let (_, outer) = self.get(&base, (span, depth + 1), diagnostics)?;
        self.found.insert(name, Some((link, outer.then(inner))));
        Some((link, outer.then(inner)))
    }

    /// The name of a frame, or of the frame of a model.
    fn whole(&self, name: &str) -> String {
        let inner = format!("{name}::{MODEL}");
        if self.all.contains_key(&inner) { inner } else { name.to_owned() }
    }

    /// The link with which a frame moves.
    fn link(&self, name: &str) -> Option<usize> {
        let mut name = name.to_owned();
        for _ in 0..DEEPEST {
            match self.all.get(&name) {
                Some(Frame { link: None, attached, .. }) => name = self.whole(attached),
                Some(of) => return of.link,
                None => return (name == WORLD).then_some(0),
            }
        }
        None
    }
}
