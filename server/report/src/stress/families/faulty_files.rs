//! Files of robots with a fault each, and with origins as quaternions.

use std::f64::consts::FRAC_PI_2;

use sarrus_dynamics::Field::{Q, Qdd, TauY};
use sarrus_dynamics::Status;
use sarrus_models::{Options, Source, bundled_text, load};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{At, Case, Cases, Question, Reference, Robot, State, powers};

/// Bundled files with one faulty number, joint or link each: refused, with the position.
pub(crate) fn run(cases: &mut Cases, _: &Effort) -> Outcome {
    let (urdf, yaml) = bundled_text("lambda").ok_or("no lambda")?;
    for (k, row) in include_str!("faults.tsv").lines().enumerate() {
        let cells: Vec<&str> = row.split('\t').collect();
        let [name, from, to] = cells[..] else { return Err(row.into()) };
        let replaced = |text: &str| text.replacen(from, to, 1);
        let source = Source::Text {
            urdf: replaced(urdf).into(),
            submechanisms: Some(replaced(yaml).into()),
        };
        let at = At { value: k as f64, method: "file" };
        match load(&source, &Options::default()) {
            Err(error) => {
                let reported = error.to_string().lines().next().unwrap_or_default().to_owned();
                cases.refused("lambda", at, name, "refused at load", reported);
            }
            Ok(loaded) => {
                cases.all.push(Case {
                    status: Status::Ok.name().into(),
                    reported: format!("{} warnings", loaded.report.warnings.len()),
                    ..cases.blank("lambda", at, name)
                });
            }
        }
    }
    Ok(())
}

/// A four-bar whose origins are turned by quaternions has the answers of one that is turned by
/// roll, pitch and yaw.
pub(crate) fn quaternions(cases: &mut Cases, effort: &Effort) -> Outcome {
    let name = "four-bar in turned frames";
    for value in powers(effort, -12, 0, 2) {
        let turn = [0.4, FRAC_PI_2 - value.min(1.0), -0.3];
        for row in include_str!("hinges.tsv").lines() {
            let (element, hinge) = row.split_once('\t').ok_or(row)?;
            let read = |rotation: &str| -> Outcome<Robot> {
                let urdf = turned_four_bar(hinge, rotation, turn).into();
                let source = Source::Text { urdf, submechanisms: None };
                Robot::new(name, load(&source, &Options::default())?.description)
            };
            let [r, p, y] = turn;
            let by_angles = read(&format!("rpy='{r:?} {p:?} {y:?}'"))?;
            let [(sr, cr), (sp, cp), (sy, cy)] = turn.map(|x| f64::sin_cos(0.5 * x));
            let [x, y] = [sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy];
            let [z, w] = [cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy];
            let robot = read(&format!("quat_xyzw='{x:?} {y:?} {z:?} {w:?}'"))?;
            let ask = Question::inverse(&State::of(&by_angles, 0.1)?, &[Q, Qdd, TauY]);
            let exact = ask.run(&by_angles.compiled.exact)?;
            let known = [Q, Qdd, TauY].map(|field| (field, exact.get(field).to_vec()));
            let at = At { value, method: element };
            cases.ask(&robot, at, "ID", &ask, &Reference::Known(known.to_vec()))?;
        }
    }
    Ok(())
}

/// The four-bar on a link that is turned against the base, closed in frames that are turned alike.
/// A hinge is the element of a URDF that closes it, with the frames' rotation and the axis in them.
fn turned_four_bar(hinge: &str, rotation: &str, [r, p, y]: [f64; 3]) -> String {
    // the y axis of the links in the turned frames
    let [(sr, cr), (sp, cp), (sy, cy)] = [r, p, y].map(f64::sin_cos);
    let axis = [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr];
    let axis = axis.map(|x| format!("{x:?}")).join(" ");
    let text = include_str!("turned_four_bar.urdf").replace("@HINGE@", hinge);
    text.replace("@FRAME@", rotation).replace("@AXIS@", &axis)
}
