//! The ways in which MJCF writes an orientation.

use super::item::Item;
use crate::pose::{Pose, from_z, of_axes, unit};
use crate::report::{Diagnostics, quoted};
use crate::rotation::product;

/// The angles of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Angles {
    pub(super) in_degrees: bool,
    /// Axes in their order; lower case for those of the turned frame, upper case for fixed ones.
    pub(super) sequence: [char; 3],
}

impl Angles {
    /// An angle of the file in radians.
    pub(super) fn radians(&self, angle: f64) -> f64 {
        if self.in_degrees { angle.to_radians() } else { angle }
    }

    pub(super) fn of_euler(&self, angles: [f64; 3]) -> [f64; 4] {
        let mut r = Pose::NONE.r;
        for (axis, angle) in self.sequence.into_iter().zip(angles) {
            let mut direction = [0.0; 3];
            direction["xyz".find(axis.to_ascii_lowercase()).unwrap_or(0)] = 1.0;
            let next = Pose::turn(direction, self.radians(angle));
            r = if axis.is_lowercase() { product(r, next) } else { product(next, r) };
        }
        r
    }

    /// `pos` and the orientation of an element; none where it has neither.
    pub(super) fn pose(&self, item: &Item<'_>, diagnostics: &mut Diagnostics) -> Pose {
        let p = item.numbers("pos", diagnostics).unwrap_or_default();
        Pose { p, r: self.orientation(item, diagnostics).unwrap_or(Pose::NONE.r) }
    }

    /// The orientation, one of five ways; `None` without one.
    pub(super) fn orientation(
        &self,
        item: &Item<'_>,
        diagnostics: &mut Diagnostics,
    ) -> Option<[f64; 4]> {
        let ways = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];
        let given: Vec<&str> =
            ways.into_iter().filter(|way| item.element.get(way).is_some()).collect();
        let way = given.first().copied().or_else(|| ways.into_iter().find(|of| item.has(of)))?;
        if given.len() > 1 {
            let found = format!("`{}` has the orientations {}", item.tag(), given.join(", "));
            diagnostics.error(item.span(), found, "one of them", "remove the others");
        }
        let r = match way {
            "quat" => {
                let [w, x, y, z] = item.numbers(way, diagnostics)?;
                unit([x, y, z, w])
            }
            "axisangle" => {
                let [x, y, z, angle] = item.numbers(way, diagnostics)?;
                unit([x, y, z]).map(|axis| Pose::turn(axis, self.radians(angle)))
            }
            "zaxis" => unit(item.numbers::<3>(way, diagnostics)?).map(from_z),
            "euler" => Some(self.of_euler(item.numbers(way, diagnostics)?)),
            _ => {
                let [a, b, c, d, e, f] = item.numbers(way, diagnostics)?;
                of_axes([a, b, c], [d, e, f])
            }
        };
        if r.is_none() {
            let found = format!("the orientation {} of `{}`", quoted(way), item.tag());
            diagnostics.error(item.span(), found, "directions that are not zero", "correct it");
        }
        r
    }
}
