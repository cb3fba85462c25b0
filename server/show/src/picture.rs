//! A robot at its zero pose as a drawing of lines.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use sarrus_dynamics::description::{Cut, Description, JointKind};
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request};

use crate::code::FRAMES;
use crate::scene::placement;

/// Directions of the page to the right and upwards {root}, as the pages begin.
const RIGHT: [f64; 3] = [0.783, 0.622, 0.0];
const UP: [f64; 3] = [-0.213, 0.269, 0.939];
/// Side of a picture without its border, and that border.
const SIDE: f64 = 150.0;
const BORDER: f64 = 8.0;

/// The picture as SVG: lines between the joints of each link, and to the points where loops are
/// cut; none where the plan of its poses has no answer. Allocates.
pub fn picture(description: &Description, model: &Model) -> Option<String> {
    let poses = poses(description, model)?;
    let mut lines = Vec::new();
    let mut cuts = Vec::new();
    let mut line = |from: usize, to: Point3<f64>, kind: &'static str| {
        lines.push((on_page(poses[from] * Point3::origin()), on_page(to), kind));
    };
    for joint in &description.joints {
        let kind = if joint.kind == JointKind::Prismatic { "slide" } else { "rod" };
        line(joint.parent, poses[joint.child] * Point3::origin(), kind);
    }
    for of in description.submechanisms.iter().flat_map(|part| &part.loops) {
        let at = match &of.cut {
            Cut::AtJoint(joint) => poses[description.joints[*joint].child],
            Cut::AtLink(link) => poses[*link],
            Cut::Placed { predecessor, .. } => {
                poses[of.predecessor] * pose(&placement(predecessor))
            }
            _ => continue,
        };
        let at = at * Point3::origin();
        [of.predecessor, of.successor].into_iter().for_each(|end| line(end, at, "rod"));
        cuts.push(on_page(at));
    }
    let ends = || lines.iter().flat_map(|(from, to, _)| [from, to]);
    let bound = |k: usize, pick: fn(f64, f64) -> f64| ends().map(|end| end[k]).reduce(pick);
    let bounds = [0, 1].map(|k| [bound(k, f64::min), bound(k, f64::max)].map(|x| x.unwrap_or(0.0)));
    let widths = bounds.map(|[least, most]| most - least);
    let scale = SIDE / widths[0].max(widths[1]).max(f64::MIN_POSITIVE);
    let put = |at: &[f64; 2]| {
        [0, 1].map(|k| (at[k] - bounds[k][0] - 0.5 * widths[k]) * scale + 0.5 * SIDE + BORDER)
    };
    let side = SIDE + 2.0 * BORDER;
    let mut text = format!("<svg viewBox=\"0 0 {side} {side}\" aria-hidden=\"true\">");
    for (from, to, kind) in &lines {
        let [[x1, y1], [x2, y2]] = [put(from), put(to)];
        text += &format!(
            "<line class=\"{kind}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>"
        );
    }
    for [x, y] in cuts.iter().map(put) {
        text += &format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\"/>");
    }
    Some(text + "</svg>")
}

/// Poses of all links at the zero pose.
fn poses(description: &Description, model: &Model) -> Option<Vec<Isometry3<f64>>> {
    let q = model.tree_zero();
    let mut found = vec![Isometry3::identity(); description.links.len()];
    let names = &model.info().links;
    let all: Vec<u16> = (0..names.len() as u16).collect();
    for frames in all.chunks(FRAMES) {
        let [given, want] = [Field::Q, Field::FramePose].map(|field| FieldSet::of(&[field]));
        let query = Query::new(Request::Kinematics, given, want).with_frames(frames);
        let planned = Planned::answered(model, &query, &[(Field::Q, &q)])?;
        for (frame, row) in frames.iter().zip(planned.output.chunks(7)) {
            let name = &names[usize::from(*frame)];
            if let Some(link) = description.links.iter().position(|link| link.name == *name) {
                found[link] = pose(row);
            }
        }
    }
    Some(found)
}

/// A pose from position and quaternion x, y, z, w.
fn pose(row: &[f64]) -> Isometry3<f64> {
    let [x, y, z, i, j, k, w] = [0, 1, 2, 3, 4, 5, 6].map(|n| row.get(n).copied().unwrap_or(0.0));
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}

/// To the right and downwards on the page.
fn on_page(at: Point3<f64>) -> [f64; 2] {
    let along = |of: [f64; 3]| of.iter().zip(at.iter()).map(|(a, x)| a * x).sum::<f64>();
    [along(RIGHT), -along(UP)]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use sarrus_models::{Options, Source, bundled, load};

    use super::*;

    #[test]
    fn a_picture_has_the_joints_and_closed_loops_of_its_robot() {
        for (robot, _) in bundled() {
            let loaded = load(&Source::Bundled(robot.to_owned()), &Options::default()).unwrap();
            let of = &loaded.description;
            let model = &loaded.compiled.model;
            let text = picture(of, model).unwrap();
            let loops = of.submechanisms.iter().flat_map(|part| &part.loops);
            assert_eq!(text.matches("<line").count(), of.joints.len() + 2 * loops.clone().count());
            assert!(!text.contains("NaN"), "{robot}: {text}");
            // both ends of a loop hold its cut
            let poses = poses(of, model).unwrap();
            for cut in loops {
                let Cut::Placed { predecessor, successor } = &cut.cut else { continue };
                let [a, b] = [(cut.predecessor, predecessor), (cut.successor, successor)]
                    .map(|(end, at)| poses[end] * pose(&placement(at)) * Point3::origin());
                assert!((a - b).norm() < 1e-9, "{robot}, {}: {a} {b}", cut.name);
            }
        }
    }
}
