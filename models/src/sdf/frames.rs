//! Named frames: those of models, links and joints, and `<frame>`. Names within a model stand
//! behind its name and `::`.

use std::collections::BTreeMap;

use super::{Robot, pose};
use crate::mjcf::document::Element;
use crate::pose::Pose;
use crate::report::{Span, quoted};

/// The frame of a model, by its own name in it.
pub(super) const MODEL: &str = "__model__";
/// The outermost frame.
pub(super) const WORLD: &str = "world";

/// Most frames that are each given in the next one, where none of them is listed before.
const DEEPEST: usize = 200;

/// A frame as written.
pub(super) struct Frame {
    name: String,
    span: Span,
    /// Its pose in another frame.
    pose: Pose,
    base: String,
    /// The frame with whose link it moves.
    attached: String,
}

/// The whole name of a frame that is named within a scope.
pub(super) fn full(scope: &str, name: &str) -> String {
    if name == WORLD { name.to_owned() } else { format!("{scope}{name}") }
}

impl<'e> Robot<'e, '_> {
    /// Adds the frame of an element, with the frames that are its base by default and hold its
    /// link.
    pub(super) fn add(&mut self, name: String, (of, scope): (&'e Element, &str), ends: [&str; 2]) {
        of.is_read.set(true);
        let (pose, at) = pose(of, self.diagnostics);
        let written = at.text("relative_to").or(at.text("frame")).filter(|of| !of.is_empty());
        let base = written.map_or_else(|| ends[0].to_owned(), |of| full(scope, of));
        let attached = ends[1].to_owned();
        self.frames.push(Frame { name, span: of.span, pose, base, attached });
    }

    /// Places the frames in the world.
    pub(super) fn place(&mut self) {
        let links: BTreeMap<String, usize> =
            self.links.iter().enumerate().map(|(k, link)| (link.name.clone(), k)).collect();
        let mut open = std::mem::take(&mut self.frames);
        self.found.insert(WORLD.to_owned(), (0, Pose::NONE));
        for _ in 0..DEEPEST {
            open.retain(|Frame { name, span, pose, base, attached }| {
                let link = links.get(attached).or(self.found.get(attached).map(|(link, _)| link));
                let (Some(link), Some((_, outer))) = (link, self.found.get(base)) else {
                    return true;
                };
                let placed = (*link, outer.then(*pose));
                // a model stands for its frame
                self.found.insert(format!("{name}::{MODEL}"), placed);
                if self.found.insert(name.clone(), placed).is_some() || name.ends_with("::") {
                    self.diagnostics.second(*span, "frame", name);
                }
                false
            });
        }
        for link in &mut self.links {
            link.pose = self.found.get(&link.name).map_or(Pose::NONE, |(_, at)| *at);
        }
        for Frame { name, span, .. } in open {
            let found = format!("the frame {} is relative to none that is placed", quoted(&name));
            self.fault(span, found, "another frame of this file, best before it");
        }
    }

    /// The link and the pose of a frame; `None` after an error.
    pub(super) fn frame(&mut self, name: &str, at: Span) -> Option<(usize, Pose)> {
        let found = self.found.get(name).copied();
        if found.is_none() {
            let known = self.found.keys().map(String::as_str);
            let found = format!("the frame {}, which has no place", quoted(name));
            let expected = "a frame of this file";
            self.diagnostics.unknown(at, found, expected, name, known, "correct the name");
        }
        found
    }
}
