//! Values of elements.

use crate::mjcf::document::Element;
use crate::mjcf::item::Item;
use crate::number;
use crate::pose::{Pose, unit};
use crate::report::{Diagnostics, quoted};
use crate::rotation::quaternion;

/// The child of a name, of which an element has at most one.
pub(super) fn one<'e>(
    of: &'e Element,
    name: &'e str,
    diagnostics: &mut Diagnostics,
) -> Option<&'e Element> {
    let mut all = of.all(name);
    let first = all.next();
    for second in all {
        let found = format!("`{}` has a second `{name}`", of.name);
        diagnostics.error(second.span, found, "one", "remove one of them");
    }
    first
}

/// The name of an element.
pub(super) fn name(of: &Element, diagnostics: &mut Diagnostics) -> Option<String> {
    let name = of.text("name").filter(|name| !name.is_empty());
    if name.is_none() {
        let found = format!("`{}` has no name", of.name);
        diagnostics.error(of.span, found, "name=\"…\"", "add it");
    }
    name.map(str::to_owned)
}

/// The text of a child; `None` without it and of an empty one.
pub(super) fn word<'e>(
    of: &'e Element,
    name: &'e str,
    diagnostics: &mut Diagnostics,
) -> Option<&'e str> {
    one(of, name, diagnostics)?.text(name)
}

/// The numbers of a child; `None` without it and after an error.
pub(super) fn numbers<const N: usize>(
    of: Option<&Element>,
    name: &str,
    diagnostics: &mut Diagnostics,
) -> Option<[f64; N]> {
    Item::plain(one(of?, name, diagnostics)?).numbers(name, diagnostics)
}

pub(super) fn number(
    of: Option<&Element>,
    name: &str,
    default: f64,
    diagnostics: &mut Diagnostics,
) -> f64 {
    numbers(of, name, diagnostics).map_or(default, |[number]| number)
}

/// A number that may be infinite, as ±1e16 is.
pub(super) fn bound(
    of: Option<&Element>,
    name: &str,
    default: f64,
    diagnostics: &mut Diagnostics,
) -> f64 {
    let of = of.and_then(|of| one(of, name, diagnostics)).and_then(|of| of.get(name));
    let Some(written) = of else { return default };
    match written.value.trim().parse::<f64>() {
        Ok(value) if value.abs() >= 1e16 => value * f64::INFINITY,
        Ok(value) if value.is_finite() => value,
        _ => {
            let found = format!("`{name}` is {}", quoted(written.value.trim()));
            diagnostics.error(written.span, found, number::expected(1), "correct the value");
            default
        }
    }
}

/// Whether the value of an attribute, or of an element, says yes.
pub(super) fn flag(of: &Element, name: &str, default: bool, diagnostics: &mut Diagnostics) -> bool {
    let Some(written) = of.get(name) else { return default };
    match written.value.trim() {
        "true" | "1" => true,
        "false" | "0" => false,
        other => {
            let found = format!("`{name}` is {}", quoted(other));
            diagnostics.error(written.span, found, "true or false", "correct it");
            default
        }
    }
}

/// As [`flag`], of a child.
pub(super) fn switch(
    of: &Element,
    name: &str,
    default: bool,
    diagnostics: &mut Diagnostics,
) -> bool {
    one(of, name, diagnostics).map_or(default, |of| flag(of, name, default, diagnostics))
}

/// The `<pose>` of an element, and the frame that it names.
pub(super) fn pose<'e>(of: &'e Element, diagnostics: &mut Diagnostics) -> (Pose, Option<&'e str>) {
    let Some(pose) = one(of, "pose", diagnostics) else { return (Pose::NONE, None) };
    let item = Item::plain(pose);
    let frame = ["relative_to", "frame"].into_iter().filter_map(|of| item.text(of));
    let frame = frame.filter(|name| !name.is_empty()).last();
    let in_degrees = flag(pose, "degrees", false, diagnostics);
    let is_quaternion = match item.text("rotation_format").unwrap_or("euler_rpy") {
        "quat_xyzw" => true,
        "euler_rpy" => false,
        other => {
            let found = format!("the rotation format {} of `pose`", quoted(other));
            let expected = "euler_rpy or quat_xyzw";
            diagnostics.error(pose.span, found, expected, "correct it");
            false
        }
    };
    let values = item.list("pose", 7, diagnostics);
    let at = match (is_quaternion, values.as_deref()) {
        (_, None) => Some(Pose::NONE),
        (false, Some([x, y, z, angles @ ..])) => <[f64; 3]>::try_from(angles).ok().map(|angles| {
            let angles = if in_degrees { angles.map(f64::to_radians) } else { angles };
            Pose { p: [*x, *y, *z], r: quaternion(angles) }
        }),
        (true, Some([x, y, z, turn @ ..])) if !in_degrees => {
            let turn = <[f64; 4]>::try_from(turn).ok().and_then(unit);
            turn.map(|r| Pose { p: [*x, *y, *z], r })
        }
        _ => None,
    };
    if at.is_none() {
        let expected = "x y z roll pitch yaw, or x y z and a quaternion without degrees";
        diagnostics.error(pose.span, "numbers that are no pose", expected, "correct them");
    }
    (at.unwrap_or(Pose::NONE), frame)
}
