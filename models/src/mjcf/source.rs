//! A file of a model: the first one, or one that an `<attach>` places.
//!
//! Each has its own settings, classes and meshes, and its names get the prefix of the `<attach>`.
//! One that places a single part of a file leaves out all that refers to another part, as MuJoCo.

use std::collections::BTreeSet;
use std::path::Path;

use super::compiler::Compiler;
use super::document::{Element, Files};
use super::item::{Classes, Item};
use super::mesh::Meshes;
use crate::report::{Diagnostics, quoted};

/// A file and how its elements are read.
pub(super) struct Source<'e> {
    pub(super) root: &'e Element,
    /// The part that is placed, and the class of its elements without one; `None` for all that its
    /// world holds.
    pub(super) part: Option<(&'e Element, &'e str)>,
    pub(super) compiler: Compiler,
    pub(super) classes: Classes<'e>,
    pub(super) meshes: Meshes<'e>,
    prefix: String,
    pub(super) suffix: String,
    /// The prefix of the file that attaches this one.
    outer: String,
    /// Tags and names of the elements that are left out, and how names begin that an `<attach>` or
    /// a `<replicate>` would have made there.
    outside: BTreeSet<(&'e str, &'e str)>,
    beginnings: Vec<&'e str>,
}

impl<'e> Source<'e> {
    /// A file that keeps its names.
    pub(super) fn new(
        root: &'e Element,
        files: &'e Files,
        folder: &Path,
        diagnostics: &mut Diagnostics,
    ) -> Source<'e> {
        root.is_read.set(true);
        root.all("asset").for_each(drop);
        root.all("worldbody").for_each(drop);
        let compiler = Compiler::new(root, diagnostics);
        let classes = Classes::new(root, diagnostics);
        let meshes = Meshes::new(root, &classes, &compiler, (files, folder), diagnostics);
        let [prefix, suffix, outer] = [const { String::new() }; 3];
        Source {
            root,
            part: None,
            compiler,
            classes,
            meshes,
            prefix,
            suffix,
            outer,
            outside: BTreeSet::new(),
            beginnings: Vec::new(),
        }
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
        let [name, prefix] = ["model", "prefix"].map(|of| item.text(of));
        let (Some(name), Some(prefix)) = (name, prefix) else {
            let found = "`attach` without `model` or `prefix`";
            return diagnostics.refused(item.span(), found, "both", "add it");
        };
        let assets = self.root.all("asset").flat_map(|of| &of.children);
        let mut models = assets.filter(|of| of.name == "model");
        let root = |of: &&'e Element| of.children.first();
        let own = |of: &&'e Element| of.text("name").or(root(of).and_then(|of| of.text("model")));
        let Some(model) = models.find(|of| own(of) == Some(name)) else {
            let found = format!("the model {}, which does not exist", quoted(name));
            return diagnostics.refused(item.at("model"), found, "a model", "correct the name");
        };
        model.is_read.set(true);
        // an error has said why a file is not there
        let root = root(&model)?;
        let file = Path::new(model.text("file").unwrap_or_default());
        let folder = file.parent().unwrap_or(Path::new(""));
        let mut source = Source::new(root, files, folder, diagnostics);
        source.meshes.strips = self.meshes.strips;
        source.prefix = format!("{}{prefix}", self.prefix);
        source.suffix = suffix.to_owned();
        source.outer = self.prefix.clone();
        for of in root.children.iter().filter(|of| ["option", "keyframe"].contains(&&*of.name)) {
            of.read_all();
            let found = format!("`{}` of the model {} is not read", of.name, quoted(name));
            diagnostics.note(of.span, found, "that of the first file counts");
        }
        if item.has("body") && item.has("frame") {
            let found = "`attach` with `body` and `frame`";
            return diagnostics.refused(item.span(), found, "one of them", "remove the other");
        }
        for tag in ["body", "frame"] {
            let Some(written) = item.text(tag) else { continue };
            source.part = root.all("worldbody").find_map(|of| of.find(tag, written, ""));
            if source.part.is_none() {
                root.read_all();
                let found = format!("the {tag} {}, which does not exist", quoted(written));
                let expected = format!("a {tag} of the file");
                return diagnostics.refused(item.at(tag), found, expected, "correct the name");
            }
        }
        if source.part.is_some() {
            let found = format!("a part of the model {} is attached", quoted(name));
            diagnostics.note(item.span(), found, "all that is or refers to another is left out");
            root.all("worldbody").for_each(|of| source.leave_out(of, false));
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

    fn leave_out(&mut self, element: &'e Element, is_repeated: bool) {
        let part = self.part;
        let is_part = |of: &Element| part.is_some_and(|(part, _)| std::ptr::eq(part, of));
        for child in element.children.iter().filter(|of| !is_part(of)) {
            let is_attach = child.name == "attach";
            let name = child.unread(if is_attach { "prefix" } else { "name" });
            if !name.is_empty() {
                self.outside.insert((child.name.trim_start_matches("free"), name));
                self.beginnings.extend(Some(name).filter(|_| is_attach || is_repeated));
            }
            self.leave_out(child, is_repeated || child.name == "replicate");
        }
    }

    /// Whether an element refers to one that is left out, and is so with it; the tree has elements
    /// of the tags and names that are known.
    pub(super) fn leaves_out(
        &mut self,
        of: &'e Element,
        is_known: impl Fn(&str, &str) -> bool,
        diagnostics: &mut Diagnostics,
    ) -> bool {
        let attributes = [of].into_iter().chain(&of.children).flat_map(|of| &of.attributes);
        let references = attributes.map(|of| {
            let tag = of.name.trim_end_matches(['1', '2']).trim_end_matches("inparent");
            let tag = if tag.ends_with("site") { "site" } else { tag };
            (tag, of.value.trim())
        });
        let lost: Vec<_> = references.filter(|of| self.is_outside(*of, &is_known)).collect();
        if lost.is_empty() {
            return false;
        }
        of.read_all();
        if ["fixed", "spatial"].contains(&&*of.name) {
            self.outside.insert(("tendon", of.unread("name")));
        }
        for (tag, name) in lost {
            // MuJoCo takes these, depending on the order of the elements
            let own = self.name(name, &self.suffix);
            let outer = format!("{}{name}", self.outer);
            if is_known(tag, &own) || of.name == "fixed" && is_known(tag, &outer) {
                let found = format!(
                    "`{}` refers to the {tag} {}, which is not attached, and another has its name",
                    of.name,
                    quoted(name)
                );
                diagnostics.error(of.span, found, "names of their own", "rename one of them");
            }
        }
        let found = format!("`{}` refers to a part that is not attached", of.name);
        diagnostics.note(of.span, found, "it is left out, as in MuJoCo");
        true
    }

    /// Whether an attribute refers to an element that is left out or was never made.
    fn is_outside(&self, (tag, name): (&str, &str), is_known: impl Fn(&str, &str) -> bool) -> bool {
        let would_be = |beginning: &&str| name.starts_with(beginning);
        let is_attached = || is_known(tag, &self.name(name, &self.suffix));
        let is_reference = ["joint", "body", "site", "tendon"].contains(&tag);
        self.outside.contains(&(tag, name))
            || is_reference && self.beginnings.iter().any(would_be) && !is_attached()
    }
}
