//! The elements of an MJCF file with its includes, each attribute with its position, and whether
//! the conversion has read it.

use std::cell::Cell;
use std::mem;
use std::path::{Path, PathBuf};

use roxmltree::Node;

use crate::number::{self, NumberFault};
use crate::report::{Diagnostics, Span, quoted};
use crate::text::{self, LARGEST, Text};
use crate::urdf::parse;

/// Most files of one model.
pub(super) const MOST_FILES: usize = 256;
/// Most files within each other.
const DEEPEST: usize = 32;

/// An element.
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) children: Vec<Element>,
    /// Whether the conversion has read it.
    pub(crate) is_read: Cell<bool>,
}

/// An attribute.
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) value: String,
    pub(crate) span: Span,
    pub(crate) is_read: Cell<bool>,
}

impl Element {
    /// The value of an attribute, which is then read.
    pub(crate) fn get(&self, name: &str) -> Option<&Attribute> {
        let found = self.attributes.iter().find(|of| of.name == name)?;
        found.is_read.set(true);
        Some(found)
    }

    /// The text of an attribute.
    pub(crate) fn text(&self, name: &str) -> Option<&str> {
        self.get(name).map(|of| of.value.trim())
    }

    /// The children of a name, which are then read.
    pub(crate) fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        let is_it = move |child: &&Element| child.name == name;
        self.children.iter().filter(is_it).inspect(|child| child.is_read.set(true))
    }

    /// The text of an attribute, which stays unread; empty without it.
    pub(crate) fn unread(&self, name: &str) -> &str {
        let found = self.attributes.iter().find(|of| of.name == name);
        found.map_or("", |of| of.value.trim())
    }

    /// The first element of a tag and a name that it holds, with the class of its children there.
    pub(crate) fn find<'a>(
        &'a self,
        tag: &str,
        name: &str,
        class: &'a str,
    ) -> Option<(&'a Element, &'a str)> {
        let own = self.unread("childclass");
        let class = if own.is_empty() { class } else { own };
        self.children.iter().find_map(|of| {
            let is_it = of.name == tag && of.unread("name") == name;
            is_it.then_some((of, class)).or_else(|| of.find(tag, name, class))
        })
    }

    /// The first child of a name, which is then read.
    pub(crate) fn one(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|of| of.name == name).inspect(|of| of.is_read.set(true))
    }

    /// The number of elements, this one among them.
    pub(crate) fn size(&self) -> usize {
        1 + self.children.iter().map(Element::size).sum::<usize>()
    }

    /// Marks the element, its attributes and all that it holds as read.
    pub(crate) fn read_all(&self) {
        self.is_read.set(true);
        self.attributes.iter().for_each(|of| of.is_read.set(true));
        self.children.iter().for_each(Element::read_all);
    }
}

impl Attribute {
    /// Its numbers, at most `most`; `None` after an error.
    pub(crate) fn numbers(&self, most: usize, diagnostics: &mut Diagnostics) -> Option<Vec<f64>> {
        let fault = match number::list(&self.value) {
            Ok(numbers) if (1..=most).contains(&numbers.len()) => return Some(numbers),
            Ok(numbers) => NumberFault::Count(numbers.len()),
            Err(fault) => fault,
        };
        let found = format!("`{}`: {fault}", self.name);
        let expected = format!("at most {}", number::expected(most));
        diagnostics.refused(self.span, found, expected, "correct the value")
    }
}

/// The files of a model: where they may lie, and those that were read.
#[derive(Default)]
pub(crate) struct Files {
    /// The folder of the first file.
    folder: PathBuf,
    /// The folders below which files are read, without links.
    roots: Vec<PathBuf>,
    /// The folders of the model that is read and of its part, from that of the first file, and its
    /// files.
    base: PathBuf,
    here: PathBuf,
    read: Vec<PathBuf>,
    /// The number of files that others name, their size, and how many of them are open.
    count: usize,
    size: usize,
    depth: usize,
}

impl Files {
    /// The files beside the first one, or below a folder of `include`; a text has none beside it.
    pub(crate) fn new(first: Option<&Path>, include: &[PathBuf]) -> Files {
        let Some(first) = first else {
            return Files::default();
        };
        let folder = match first.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let all = [&folder].into_iter().chain(include);
        let roots = all.filter_map(|folder| folder.canonicalize().ok()).collect();
        let read = Vec::from_iter(first.canonicalize().ok());
        Files { folder, roots, read, ..Files::default() }
    }

    /// The name and the bytes of a file that another one names, relative to the first file's folder
    /// or to an include folder; `None` after an error.
    pub(crate) fn open(
        &self,
        written: &Path,
        span: Span,
        diagnostics: &mut Diagnostics,
    ) -> Option<(PathBuf, String, Vec<u8>)> {
        let candidates = [&self.folder].into_iter().chain(&self.roots);
        let found = candidates.map(|folder| folder.join(written)).find(|path| path.exists());
        let path = found.unwrap_or_else(|| self.folder.join(written));
        let shown = quoted(&path.display().to_string());
        // links lead to their targets before the folder is compared
        let real = match path.canonicalize() {
            Ok(real) => real,
            Err(error) => {
                let found = format!("the file {shown} cannot be opened: {error}");
                let help = "correct the path, or name its folder by --include-dir";
                return diagnostics.refused(span, found, "a readable file", help);
            }
        };
        if !self.roots.iter().any(|root| real.starts_with(root)) {
            let found = format!("the file {shown} lies outside of the first file's folder");
            let folder = real.parent().unwrap_or(&real).display();
            let help = format!("name its folder: --include-dir {folder}");
            let expected = "a file below it or below an include folder";
            return diagnostics.refused(span, found, expected, help);
        }
        match text::read_named(&real) {
            Ok((_, bytes)) => Some((real, path.display().to_string(), bytes)),
            Err(error) => {
                diagnostics.refused(span, error.to_string(), "a readable file", "correct the path")
            }
        }
    }
}

/// The outermost element of a text, with its includes in their places; `None` after an error.
pub(crate) fn read(
    name: &str,
    bytes: Vec<u8>,
    files: &mut Files,
    diagnostics: &mut Diagnostics,
) -> Option<Element> {
    let text = Text::new(name, bytes, diagnostics)?;
    let document = parse(&text, diagnostics)?;
    Some(element(document.root_element(), &text, files, diagnostics))
}

fn element<'t>(
    node: Node<'_, 't>,
    text: &'t Text,
    files: &mut Files,
    diagnostics: &mut Diagnostics,
) -> Element {
    let attribute = |name: &str, value: &str, at: usize| Attribute {
        name: name.to_owned(),
        value: value.to_owned(),
        span: text.span(at),
        is_read: Cell::new(false),
    };
    let attributes = node.attributes().map(|of| attribute(of.name(), of.value(), of.range().start));
    let mut read = Element {
        name: node.tag_name().name().to_owned(),
        span: text.span(node.range().start),
        attributes: attributes.collect(),
        children: Vec::new(),
        is_read: Cell::new(false),
    };
    // the value of an element of SDF is an attribute of its name
    let is_sdf = node.document().root_element().has_tag_name("sdf");
    let value: String = node.children().filter(Node::is_text).filter_map(|of| of.text()).collect();
    if is_sdf && !value.trim().is_empty() {
        read.attributes.push(attribute(&read.name, &value, node.range().start));
    }
    for child in node.children().filter(Node::is_element) {
        let mut child = element(child, text, files, diagnostics);
        if child.name == "include" {
            read.children.extend(include(child, is_sdf, files, diagnostics));
        } else if child.name == "model" && read.name == "asset" {
            model(&mut child, files, diagnostics);
            read.children.push(child);
        } else if matches!(&child.attributes[..], [of] if of.name == child.name && is_sdf) {
            // one that is nothing but its value is an attribute
            read.attributes.append(&mut child.attributes);
        } else {
            read.children.push(child);
        }
    }
    read
}

/// The elements of the file that an `<include>` names; of SDF its model, a file or a folder's.
fn include(
    element: Element,
    is_sdf: bool,
    files: &mut Files,
    diagnostics: &mut Diagnostics,
) -> Vec<Element> {
    let key = if is_sdf { "uri" } else { "file" };
    let Some(file) = element.get(key) else {
        let found = format!("`include` has no `{key}`");
        diagnostics.error(element.span, found, format!("{key}=\"…\""), "add it");
        return Vec::new();
    };
    let written = file.value.trim();
    let scheme = if is_sdf { written.find("://").map_or(0, |at| at + 3) } else { 0 };
    let mut path = files.base.join(&written[scheme..]);
    let folders = [&files.folder].into_iter().chain(&files.roots);
    let is_folder = folders.map(|of| of.join(&path)).any(|of| of.is_dir());
    if is_sdf && (is_folder || path.extension().is_none()) {
        path.push("model.sdf");
    }
    let known = files.read.len();
    let here = path.parent().unwrap_or(Path::new("")).to_owned();
    let outer = mem::replace(&mut files.here, here);
    let root = nested(&path, file, files, diagnostics);
    files.here = outer;
    if !is_sdf {
        return root.map_or_else(Vec::new, |root| root.children);
    }
    // another model may be of the same file
    files.read.truncate(known);
    root.and_then(|root| placed(root, element, diagnostics)).into_iter().collect()
}

/// The outermost element of a file that another one names; `None` after an error.
fn nested(
    path: &Path,
    file: &Attribute,
    files: &mut Files,
    diagnostics: &mut Diagnostics,
) -> Option<Element> {
    let (real, name, bytes) = files.open(path, file.span, diagnostics)?;
    files.count += 1;
    files.size += bytes.len();
    let is_second = files.read.contains(&real);
    let is_too_many = files.count >= MOST_FILES || files.size > LARGEST || files.depth >= DEEPEST;
    if is_second || is_too_many {
        let found = match is_second {
            true => format!("the file {} is included a second time", quoted(&file.value)),
            false => format!("with {} the model has too many files", quoted(&file.value)),
        };
        return diagnostics.refused(file.span, found, "each file once", "remove one of them");
    }
    files.read.push(real);
    files.depth += 1;
    let root = read(&name, bytes, files, diagnostics);
    files.depth -= 1;
    root
}

/// Puts the file that a `<model>` names into it, and its path from the first file's folder.
fn model(element: &mut Element, files: &mut Files, diagnostics: &mut Diagnostics) {
    let Some(file) = element.attributes.iter_mut().find(|of| of.name == "file") else {
        return diagnostics.error(element.span, "`model` has no `file`", "file=\"…\"", "add it");
    };
    let path = files.here.join(file.value.trim());
    file.value = path.display().to_string();
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let outer = [&mut files.base, &mut files.here].map(|of| mem::replace(of, folder.clone()));
    let read = mem::take(&mut files.read);
    let root = nested(&path, file, files, diagnostics);
    [files.base, files.here] = outer;
    files.read = read;
    if let Some(root) = root.as_ref().filter(|root| root.name != "mujoco") {
        let found = format!("the root element {}", quoted(&root.name));
        diagnostics.error(root.span, found, "mujoco", "convert the file into MJCF");
    }
    element.children = root.into_iter().collect();
}

/// The model of an included file of SDF, with the name, pose and plug-ins of the `<include>`.
fn placed(root: Element, include: Element, diagnostics: &mut Diagnostics) -> Option<Element> {
    let is_old = root.text("version").is_some_and(|of| ["1.2", "1.3", "1.4"].contains(&of));
    let model = root.children.into_iter().find(|of| of.name == "model").filter(|_| !is_old);
    let Some(mut model) = model else {
        let expected = "a file with a model, of version 1.5 or later";
        return diagnostics.refused(include.span, "an included file", expected, "write it so");
    };
    let given = include.attributes.into_iter().filter(|of| of.name != "uri");
    for of in given {
        model.attributes.retain(|own| own.name != of.name);
        model.children.retain(|own| own.name != of.name);
        model.attributes.push(of);
    }
    for of in include.children {
        if of.name == "pose" {
            model.attributes.retain(|own| own.name != "pose");
            model.children.retain(|own| own.name != "pose");
        }
        model.children.push(of);
    }
    Some(model)
}
