//! An element with the defaults of its class.

use std::collections::BTreeMap;

use sarrus_dynamics::description::Friction;

use super::document::{Attribute, Element};
use crate::report::{Diagnostics, Span, quoted};

/// The name of the outermost class.
const MAIN: &str = "main";

/// An element and the defaults that complete it, the nearest first.
pub(crate) struct Item<'e> {
    pub(crate) element: &'e Element,
    defaults: Vec<&'e Element>,
}

impl<'e> Item<'e> {
    /// An element without defaults.
    pub(crate) fn plain(element: &'e Element) -> Item<'e> {
        element.is_read.set(true);
        Item { element, defaults: Vec::new() }
    }

    pub(crate) fn tag(&self) -> &str {
        &self.element.name
    }

    pub(crate) fn span(&self) -> Span {
        self.element.span
    }

    /// An attribute of the element, or else of the nearest class that has it.
    pub(crate) fn get(&self, name: &str) -> Option<&'e Attribute> {
        let all = [self.element].into_iter().chain(self.defaults.iter().copied());
        // an attribute that another one hides is read too
        let found: Vec<&Attribute> = all.filter_map(|of| of.get(name)).collect();
        found.first().copied()
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    pub(crate) fn text(&self, name: &str) -> Option<&'e str> {
        self.get(name).map(|of| of.value.trim())
    }

    /// The position of an attribute, or of the element.
    pub(crate) fn at(&self, name: &str) -> Span {
        self.get(name).map_or(self.span(), |of| of.span)
    }

    /// Exactly `N` numbers; `None` without the attribute and after an error.
    pub(crate) fn numbers<const N: usize>(
        &self,
        name: &str,
        diagnostics: &mut Diagnostics,
    ) -> Option<[f64; N]> {
        let attribute = self.get(name)?;
        let numbers = attribute.numbers(N, diagnostics)?;
        let count = numbers.len();
        let numbers = <[f64; N]>::try_from(numbers).ok();
        if numbers.is_none() {
            let found = format!("`{name}` of `{}` holds {count} numbers", self.tag());
            diagnostics.error(attribute.span, found, format!("{N}"), "correct the value");
        }
        numbers
    }

    /// One to `most` numbers.
    pub(crate) fn list(&self, name: &str, most: usize, of: &mut Diagnostics) -> Option<Vec<f64>> {
        self.get(name).and_then(|attribute| attribute.numbers(most, of))
    }

    pub(crate) fn number(&self, name: &str, diagnostics: &mut Diagnostics) -> Option<f64> {
        self.numbers::<1>(name, diagnostics).map(|[number]| number)
    }

    /// The first of some numbers, of which the others must be zero: they are the nonlinear terms.
    pub(crate) fn linear(&self, name: &str, diagnostics: &mut Diagnostics) -> f64 {
        let numbers = self.list(name, 3, diagnostics).unwrap_or_default();
        if numbers.iter().skip(1).any(|of| *of != 0.0) {
            let found = format!("`{name}` of `{}` is not linear", self.tag());
            let help = "remove its second and third number";
            diagnostics.dynamics(self.at(name), found, "one number", help);
        }
        numbers.first().copied().unwrap_or(0.0)
    }

    /// `frictionloss`.
    pub(crate) fn dry_friction(&self, diagnostics: &mut Diagnostics) -> Friction {
        let coulomb = self.number("frictionloss", diagnostics).unwrap_or(0.0);
        Friction { coulomb, ..Friction::default() }
    }

    /// `true`, `false` or `auto`; `auto` and no value are `None`.
    pub(crate) fn flag(&self, name: &str, diagnostics: &mut Diagnostics) -> Option<bool> {
        let attribute = self.get(name)?;
        match attribute.value.trim() {
            "true" | "enable" | "1" => Some(true),
            "false" | "disable" | "0" => Some(false),
            "auto" => None,
            other => {
                let found = format!("`{name}` of `{}` is {}", self.tag(), quoted(other));
                diagnostics.refused(attribute.span, found, "true or false", "correct it")
            }
        }
    }
}

/// The classes of defaults: the `<default>` elements of each, the nearest first.
pub(crate) struct Classes<'e> {
    by_name: BTreeMap<&'e str, Vec<&'e Element>>,
}

impl<'e> Classes<'e> {
    pub(crate) fn new(root: &'e Element, diagnostics: &mut Diagnostics) -> Classes<'e> {
        let mut classes = Classes { by_name: BTreeMap::from([(MAIN, Vec::new())]) };
        let mut main: Vec<&Element> = Vec::new();
        for outermost in root.all("default") {
            // the last one wins, and a class within it does not see those that follow
            main.insert(0, outermost);
            classes.by_name.insert(MAIN, main.clone());
            if let Some(name) = outermost.text("class") {
                classes.by_name.insert(name, main.clone());
            }
            classes.nest(outermost, &main, diagnostics);
        }
        classes
    }

    fn nest(&mut self, outer: &'e Element, chain: &[&'e Element], diagnostics: &mut Diagnostics) {
        for inner in outer.all("default") {
            let Some(name) = inner.text("class") else {
                let found = "a nested `default` has no `class`";
                diagnostics.error(inner.span, found, "class=\"…\"", "add it");
                continue;
            };
            let chain = [&[inner], chain].concat();
            self.nest(inner, &chain, diagnostics);
            if self.by_name.insert(name, chain).is_some() {
                diagnostics.second(inner.span, "class", name);
            }
        }
    }

    /// An element with the defaults of its class, else of `child_class`, else of all; `tags` are
    /// the names under which a class may hold them.
    pub(crate) fn item(
        &self,
        element: &'e Element,
        tags: &[&str],
        child_class: Option<&str>,
        diagnostics: &mut Diagnostics,
    ) -> Item<'e> {
        element.is_read.set(true);
        let class = element.get("class");
        let name = class.map(|of| of.value.trim()).or(child_class).unwrap_or(MAIN);
        let Some(chain) = self.by_name.get(name) else {
            let span = class.map_or(element.span, |of| of.span);
            let found = format!("the class {}, which does not exist", quoted(name));
            let known = self.by_name.keys().copied();
            diagnostics.unknown(span, found, "a class of this file", name, known, "correct it");
            return Item { element, defaults: Vec::new() };
        };
        let of_tag = chain.iter().flat_map(|class| &class.children);
        let defaults: Vec<&Element> = of_tag.filter(|of| tags.contains(&&*of.name)).collect();
        defaults.iter().for_each(|of| of.is_read.set(true));
        Item { element, defaults }
    }
}
