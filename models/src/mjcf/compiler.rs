//! `<compiler>` and `<option>`: the settings that change numbers.

use super::angles::Angles;
use super::document::Element;
use super::item::Item;
use crate::report::{Diagnostics, quoted};

/// Which bodies take their inertia from geoms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FromGeoms {
    Never,
    WithoutInertial,
    Always,
}

/// The settings of `<compiler>`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Compiler {
    pub(super) angles: Angles,
    pub(super) auto_limits: bool,
    pub(super) from_geoms: FromGeoms,
    /// Groups of the geoms that have mass.
    pub(super) groups: [f64; 2],
    pub(super) balances: bool,
    pub(super) least_mass: f64,
    pub(super) least_inertia: f64,
    /// The sum of all masses; 0 or less for that of the file.
    pub(super) total_mass: f64,
    /// The folder of meshes.
    pub(super) folder: String,
    /// File names lose their folders.
    pub(super) strips: bool,
}

impl Compiler {
    /// The settings of a model; a later element wins.
    pub(super) fn new(root: &Element, diagnostics: &mut Diagnostics) -> Compiler {
        let mut compiler = Compiler {
            angles: Angles { in_degrees: true, sequence: ['x', 'y', 'z'] },
            auto_limits: true,
            from_geoms: FromGeoms::WithoutInertial,
            groups: [0.0, 5.0],
            balances: false,
            least_mass: 0.0,
            least_inertia: 0.0,
            total_mass: -1.0,
            folder: String::new(),
            strips: false,
        };
        root.all("compiler").for_each(|element| compiler.add(&Item::plain(element), diagnostics));
        compiler
    }

    fn add(&mut self, item: &Item<'_>, diagnostics: &mut Diagnostics) {
        let mut word = |name: &str, known: &[&str]| {
            let attribute = item.get(name)?;
            let value = attribute.value.trim();
            if known.contains(&value) {
                return Some(value);
            }
            let found = format!("`{name}` of `compiler` is {}", quoted(value));
            diagnostics.refused(attribute.span, found, known.join(", "), "correct it")
        };
        if let Some(angle) = word("angle", &["degree", "radian"]) {
            self.angles.in_degrees = angle == "degree";
        }
        if let Some(from) = word("inertiafromgeom", &["false", "true", "auto"]) {
            self.from_geoms = match from {
                "false" => FromGeoms::Never,
                "true" => FromGeoms::Always,
                _ => FromGeoms::WithoutInertial,
            };
        }
        // others have been refused
        word("coordinate", &["local"]);
        if let Some(written) = item.get("eulerseq") {
            let letters: Vec<char> = written.value.trim().chars().collect();
            match <[char; 3]>::try_from(letters) {
                Ok(sequence) if sequence.iter().all(|of| "xyzXYZ".contains(*of)) => {
                    self.angles.sequence = sequence;
                }
                _ => {
                    let found = format!("`eulerseq` is {}", quoted(&written.value));
                    diagnostics.error(written.span, found, "three of x y z X Y Z", "correct it");
                }
            }
        }
        self.auto_limits = item.flag("autolimits", diagnostics).unwrap_or(self.auto_limits);
        self.balances = item.flag("balanceinertia", diagnostics).unwrap_or(self.balances);
        self.strips = item.flag("strippath", diagnostics).unwrap_or(self.strips);
        self.groups = item.numbers("inertiagrouprange", diagnostics).unwrap_or(self.groups);
        self.least_mass = item.number("boundmass", diagnostics).unwrap_or(self.least_mass);
        self.least_inertia = item.number("boundinertia", diagnostics).unwrap_or(self.least_inertia);
        self.total_mass = item.number("settotalmass", diagnostics).unwrap_or(self.total_mass);
        if let Some(folder) = item.text("assetdir").or(item.text("meshdir")) {
            self.folder = item.text("meshdir").unwrap_or(folder).to_owned();
        }
        if item.flag("alignfree", diagnostics) == Some(true) {
            let found = "`alignfree` moves the frames of free bodies";
            diagnostics.dynamics(item.at("alignfree"), found, "false", "remove it");
        }
    }

    /// A range that counts: where `limited` says so, or without it where there is a range.
    pub(super) fn range(
        &self,
        item: &Item<'_>,
        name: &str,
        limited: &str,
        diagnostics: &mut Diagnostics,
    ) -> Option<[f64; 2]> {
        let flag = item.flag(limited, diagnostics);
        let range = item.numbers::<2>(name, diagnostics).filter(|range| *range != [0.0; 2]);
        if flag.is_none() && !self.auto_limits && range.is_some() {
            let found = format!("`{name}` without `{limited}`, and `autolimits` is false");
            let help = format!("write {limited}=\"true\" or \"false\"");
            diagnostics.error(item.at(name), found, "both", help);
        }
        let counts = flag.unwrap_or(self.auto_limits && range.is_some());
        match range.filter(|_| counts) {
            None if counts => {
                let found = format!("`{limited}` without a `{name}`");
                diagnostics.refused(item.span(), found, "both", "add the range")
            }
            Some(range) if range[0] >= range[1] => {
                let found = format!("the `{name}` {} {}", range[0], range[1]);
                diagnostics.refused(item.at(name), found, "lower < upper", "swap them")
            }
            range => range,
        }
    }
}

/// Reports gravity that files do not hold.
pub(crate) fn gravity(item: &Item<'_>, diagnostics: &mut Diagnostics) {
    let gravity = item.numbers::<3>("gravity", diagnostics);
    if let Some([x, y, z]) = gravity.filter(|gravity| *gravity != [0.0, 0.0, -9.81]) {
        let found = format!("the gravity {x} {y} {z}, which is no part of a URDF");
        let help = format!("give it as --gravity={x},{y},{z}");
        diagnostics.warning(item.at("gravity"), found, "0 0 -9.81", help);
    }
}

/// Gravity that files do not hold; a value of each effect that is not zero is reported.
/// Returns whether equalities are enforced.
pub(super) fn options(root: &Element, diagnostics: &mut Diagnostics) -> bool {
    let mut enforces = true;
    for option in root.all("option").map(Item::plain) {
        gravity(&option, diagnostics);
        for name in ["wind", "density", "viscosity"] {
            let numbers = option.list(name, 3, diagnostics).unwrap_or_default();
            if name != "wind" && numbers.iter().any(|of| *of != 0.0) {
                let found = format!("`{name}` of a medium is not modelled");
                diagnostics.dynamics(option.at(name), found, "none", "remove it");
            }
        }
        for flag in option.element.all("flag").map(Item::plain) {
            for name in ["constraint", "equality", "spring", "damper", "passive", "gravity"] {
                if flag.flag(name, diagnostics) != Some(false) {
                    continue;
                }
                if ["constraint", "equality"].contains(&name) {
                    let found = format!("`{name}` is disabled: no equality is enforced");
                    diagnostics.note(flag.at(name), found, "remove it to close loops");
                    enforces = false;
                } else {
                    let found = format!("`{name}` is disabled for the whole model");
                    diagnostics.dynamics(flag.at(name), found, "enable", "remove it");
                }
            }
        }
    }
    enforces
}
