//! Reduces a robot for a scene: holds joints still, and omits branches.

use std::str::FromStr;

use sarrus_dynamics::description::{Description, JointKind};
use sarrus_dynamics::{CompileError, Reduced, Site, locked, restricted};
use serde::{Deserialize, Serialize};

use crate::build::Spans;
use crate::names::{nearest_first, there_is};
use crate::pattern::{fits, is_pattern};
use crate::report::{Diagnostics, quoted};

/// Most characters of a list of names in a message.
const NAMES: usize = 300;

/// A joint that is held still; as text `JOINT` or `JOINT=POSITION`.
///
/// ```
/// use sarrus_models::Lock;
///
/// let lock: Lock = "elbow=-0.5".parse()?;
/// assert_eq!((lock.joint.as_str(), lock.position), ("elbow", Some(-0.5)));
/// assert_eq!("leg_*".parse::<Lock>()?.position, None);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// Name of a joint; with `*`, `?` or `[…]` all independent joints that it
    /// fits.
    pub joint: String,
    /// Its held position `[m, rad]`; `None`: its zero pose, or the pose where the loops close if
    /// other locks determine it.
    pub position: Option<f64>,
}

impl FromStr for Lock {
    type Err = String;

    fn from_str(text: &str) -> Result<Lock, String> {
        let (joint, position) = match text.rsplit_once('=') {
            None => (text, None),
            Some((joint, number)) => match number.trim().parse::<f64>() {
                Ok(x) if x.is_finite() => (joint, Some(x)),
                _ => return Err(format!("{number:?} after = is no finite number")),
            },
        };
        match joint.trim() {
            "" => Err("expected JOINT or JOINT=VALUE".to_owned()),
            joint => Ok(Lock { joint: joint.to_owned(), position }),
        }
    }
}

/// The robot without the freedoms and branches that the scene does not need; `None` after a fault.
pub(crate) fn reduce(
    (lock, only): (&[Lock], &[String]),
    whole: Description,
    spans: Spans,
    diagnostics: &mut Diagnostics,
) -> Option<(Description, Spans)> {
    let joints = joints(lock, &whole, &spans, diagnostics);
    let links = links(only, &whole, &spans, diagnostics);
    if diagnostics.has_errors() {
        return None;
    }
    // a lock by the joint's name, for indices change
    let joints: Vec<(String, Option<f64>)> =
        joints.into_iter().map(|(j, at)| (whole.joints[j].name.clone(), at)).collect();
    let mut robot = (whole, spans);
    if !links.is_empty() {
        robot = reported(restricted(&robot.0, &links), &robot.1, diagnostics)?;
    }
    // an omitted joint needs no lock
    let index = |name: &String| robot.0.joints.iter().position(|joint| joint.name == *name);
    let lock = |(name, position): &(String, Option<f64>)| {
        Some(sarrus_dynamics::Lock { joint: index(name)?, position: *position })
    };
    let locks: Vec<sarrus_dynamics::Lock> = joints.iter().filter_map(lock).collect();
    if !locks.is_empty() {
        robot = reported(locked(&robot.0, &locks), &robot.1, diagnostics)?;
    }
    Some(robot)
}

/// A reduced robot with the positions of its parts; `None` after a fault.
fn reported(
    reduced: Result<Reduced, CompileError>,
    whole: &Spans,
    diagnostics: &mut Diagnostics,
) -> Option<(Description, Spans)> {
    match reduced {
        Ok(reduced) => {
            whole.report(Vec::new(), reduced.warnings.clone(), diagnostics);
            let spans = whole.of_reduced(&reduced);
            Some((reduced.description, spans))
        }
        Err(error) => {
            whole.report(error.errors, Vec::new(), diagnostics);
            None
        }
    }
}

/// The joints that are held, each with its position.
fn joints(
    locks: &[Lock],
    description: &Description,
    spans: &Spans,
    diagnostics: &mut Diagnostics,
) -> Vec<(usize, Option<f64>)> {
    let mut found = Vec::new();
    let robot = spans.of(Site::Robot);
    let joints = || description.joints.iter().enumerate();
    let moving = || joints().filter(|(_, joint)| joint.kind != JointKind::Fixed);
    let independent = || description.submechanisms.iter().flat_map(|of| &of.independent).copied();
    for lock in locks {
        let name = lock.joint.as_str();
        if let Some((j, _)) = joints().find(|(_, joint)| joint.name == name) {
            found.push((j, lock.position));
            continue;
        }
        let names = || moving().map(|(_, joint)| joint.name.as_str());
        // a joint of several degrees of freedom is held as a whole, and so is a chain of parts
        let whole = name.rsplit_once('/').map(|(whole, _)| whole);
        let is_whole = whole.is_some_and(|whole| names().any(|name| name == whole));
        if let (true, Some(whole)) = (is_whole, whole) {
            let part = format!("--lock of {}, a part of the joint {}", quoted(name), quoted(whole));
            let help = format!("write --lock {whole}");
            diagnostics.error(robot, part, "a joint as a whole", help);
            continue;
        }
        let before = found.len();
        found.extend(
            independent()
                .filter(|j| fits(name, &description.joints[*j].name))
                .map(|j| (j, lock.position)),
        );
        if found.len() > before {
            continue;
        }
        let what = match is_pattern(name) {
            true => format!("--lock of {}, which no independent joint fits", quoted(name)),
            false => {
                let near = there_is(name, names());
                format!("--lock of the joint {}, which does not exist{near}", quoted(name))
            }
        };
        let known = independent().map(|j| description.joints[j].name.as_str());
        let known = nearest_first(name, known, NAMES);
        diagnostics.error(robot, what, "a joint that moves", format!("name one of {known}"));
    }
    found
}

/// The links to which the robot is reduced.
fn links(
    only: &[String],
    description: &Description,
    spans: &Spans,
    diagnostics: &mut Diagnostics,
) -> Vec<usize> {
    let mut found = Vec::new();
    let names = || description.links.iter().map(|link| link.name.as_str());
    for name in only {
        let before = found.len();
        match names().position(|link| link == name) {
            Some(link) => found.push(link),
            None => found.extend(
                names().enumerate().filter_map(|(link, known)| fits(name, known).then_some(link)),
            ),
        }
        if found.len() > before {
            continue;
        }
        let near = there_is(name, names());
        let what = match is_pattern(name) {
            true => format!("--only {}, which no link fits", quoted(name)),
            false => format!("--only the link {}, which does not exist{near}", quoted(name)),
        };
        let known = nearest_first(name, names(), NAMES);
        let help = format!("name one of {known}");
        diagnostics.error(spans.of(Site::Robot), what, "a link of the robot", help);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::Lock;

    #[test]
    fn the_last_equals_sign_of_a_lock_stands_before_its_position() {
        for (text, joint, position) in [
            ("elbow", "elbow", None),
            ("elbow=-0.25", "elbow", Some(-0.25)),
            ("a=b=1e-3", "a=b", Some(1e-3)),
        ] {
            let lock = Lock { joint: joint.to_owned(), position };
            assert_eq!(text.parse::<Lock>().unwrap(), lock);
        }
        for text in ["", "=1", "elbow=", "elbow=x", "elbow=nan", "elbow=inf"] {
            text.parse::<Lock>().unwrap_err();
        }
    }
}
