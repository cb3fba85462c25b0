//! A file of a model: the first one, or one that an `<attach>` places.
//!
//! Each has its own settings, classes and meshes, and its names get the prefix of the `<attach>`.
//! One that places a single part of a file leaves out all that refers to another part, as MuJoCo.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::compiler::Compiler;
use super::document::{Element, Files};
use super::item::{Classes, Item};
use super::mesh::Meshes;
use crate::report::{Diagnostics, quoted};

/// A file and how its elements are read.
pub(super) struct Source<'e> {
    pub(super) root: &'e Element,
    /// The part that is placed; `None` for all that its world holds.
    pub(super) part: Option<&'e Element>,
    pub(super) compiler: Compiler,
    pub(super) classes: Classes<'e>,
    pub(super) meshes: Meshes<'e>,
    /// Its folder, from that of the first file.
    folder: PathBuf,
    prefix: String,
    pub(super) suffix: String,
    /// Tags and names of the elements that are left out.
    outside: BTreeSet<(&'e str, &'e str)>,
}

impl<'e> Source<'e> {
    /// A file that keeps its names.
    pub(super) fn new(
        root: &'e Element,
        files: &'e Files,
        folder: PathBuf,
        diagnostics: &mut Diagnostics,
    ) -> Source<'e> {
        root.is_read.set(true);
        root.all("asset").for_each(drop);
        root.all("worldbody").for_each(drop);
        let compiler = Compiler::new(root, diagnostics);
        let classes = Classes::new(root, diagnostics);
        let meshes = Meshes::new(root, &classes, &compiler, (files, &folder), diagnostics);
        let [prefix, suffix] = [String::new(), String::new()];
        let outside = BTreeSet::new();
        Source { root, part: None, compiler, classes, meshes, folder, prefix, suffix, outside }
    }

    /// The file that an `<attach>` of this one places, in repetitions with the suffix of names;
    /// `None` after an error.
    pub(super) fn attached(
        &self,
        item: &Item<'e>,
        suffix: &str,
        files: &'e Files,
        diagnostics: &mut Diagnostics,
    ) -> Option<Source<'e>> {
        let name = item.text("model").unwrap_or_default();
        let assets = self.root.all("asset").flat_map(|of| &of.children);
        let mut models = assets.filter(|of| of.name == "model");
        let root = |of: &&'e Element| of.children.first();
        let own = |of: &&'e Element| of.text("name").or(root(of).and_then(|of| of.text("model")));
        let Some(model) = models.find(|of| own(of) == Some(name)) else {
            let found = format!("the model {}, which does not exist", quoted(name));
            return diagnostics.refused(item.at("model"), found, "a model", "correct the name");
        };
        let Some(prefix) = item.text("prefix") else {
            return diagnostics.refused(item.span(), "no `prefix`", "a prefix of names", "add it");
        };
        model.is_read.set(true);
        // an error has said why a file is not there
        let root = root(&model)?;
        let file = Path::new(model.text("file").unwrap_or_default());
        let folder = self.folder.join(file.parent().unwrap_or(Path::new("")));
        let mut source = Source::new(root, files, folder, diagnostics);
        source.prefix = format!("{}{prefix}", self.prefix);
        source.suffix = suffix.to_owned();
        for of in root.children.iter().filter(|of| ["option", "keyframe"].contains(&&*of.name)) {
            of.read_all();
            let found = format!("`{}` of the model {} is not read", of.name, quoted(name));
            diagnostics.note(of.span, found, "that of the first file counts, as in MuJoCo");
        }
        for tag in ["body", "frame"] {
            let Some(written) = item.text(tag) else { continue };
            let mut worlds = root.all("worldbody");
            source.part = worlds.find_map(|of| of.find(tag, written));
            if source.part.is_none() {
                let found = format!("the {tag} {}, which does not exist", quoted(written));
                let expected = format!("a {tag} of the file");
                return diagnostics.refused(item.at(tag), found, expected, "correct the name");
            }
        }
        if source.part.is_some() {
            let found = format!("a part of the model {} is attached", quoted(name));
            diagnostics.note(item.span(), found, "all that is or refers to another is left out");
            root.all("worldbody").for_each(|of| source.leave_out(of));
        }
        Some(source)
    }

    /// A name of this file in the tree, in a repetition with its suffix.
    pub(super) fn name(&self, written: &str, suffix: &str) -> String {
        match written {
            "" | "world" => written.to_owned(),
            _ => format!("{}{written}{suffix}", self.prefix),
        }
    }

    /// The name in the tree of the element that an attribute refers to.
    pub(super) fn refers(&self, item: &Item<'_>, name: &str) -> Option<String> {
        item.text(name).map(|written| self.name(written, &self.suffix))
    }

    fn leave_out(&mut self, element: &'e Element) {
        let part = self.part;
        let is_part = |of: &Element| part.is_some_and(|part| std::ptr::eq(part, of));
        for child in element.children.iter().filter(|of| !is_part(of)) {
            if !child.name().is_empty() {
                self.outside.insert((&child.name, child.name()));
            }
            self.leave_out(child);
        }
    }

    /// Whether an element refers to one that is left out, and is so with it.
    pub(super) fn leaves_out(&mut self, of: &'e Element, diagnostics: &mut Diagnostics) -> bool {
        let refers = |of: &Element| {
            of.attributes.iter().any(|of| {
                let tag = of.name.trim_end_matches(['1', '2']).trim_end_matches("inparent");
                self.outside.contains(&(tag, of.value.trim()))
            })
        };
        let is_out = refers(of) || of.children.iter().any(refers);
        if is_out {
            of.read_all();
            if ["fixed", "spatial"].contains(&&*of.name) {
                self.outside.insert(("tendon", of.name()));
            }
            let found = format!("`{}` refers to a part that is not attached", of.name);
            diagnostics.note(of.span, found, "it is left out, as in MuJoCo");
        }
        is_out
    }
}
