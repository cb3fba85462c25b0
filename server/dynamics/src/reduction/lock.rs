//! Locks: the joints to hold and their positions.

use std::collections::BTreeMap;

use crate::compile::Structure;
use crate::description::{Description, JointKind};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::reduction::choice::{Choice, choose};
use crate::reduction::pose::Held;
use crate::reduction::{Reduced, fold};

/// Deviation from a given position up to which a joint that its loops hold satisfies it `[m, rad]`.
const SAME: f64 = 1e-6;

/// A joint that is held still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lock {
    /// Index of the joint in [`Description::joints`].
    pub joint: usize,
    /// Its position `[m, rad]`; `None`: its zero pose, or the pose where its loops close if they
    /// hold it. A ball joint or a free one can be held at the zero pose only.
    pub position: Option<f64>,
}

/// The robot with some joints held still: a later lock of the same joint replaces an earlier one.
/// Compiles the robot if dependent joints are held, and again with the joints held; allocates.
///
/// # Errors
/// Missing or fixed joints; positions that are not finite; joints that other locks hold at another
/// position; a mechanism that does not close there; and the faults of the robot itself.
pub fn locked(description: &Description, locks: &[Lock]) -> Result<Reduced, CompileError> {
    let mut errors = Vec::new();
    let held: BTreeMap<usize, Option<f64>> = locks
        .iter()
        .filter(|lock| is_lockable(description, lock, &mut errors))
        .map(|lock| (lock.joint, lock.position))
        .collect();
    let failed = |errors| Err(CompileError::of(errors));
    if !errors.is_empty() {
        return failed(errors);
    }
    let structure = Structure::of(description)?;
    // compiled once, if it is needed
    let mut compiled = None;
    let choices: Vec<Choice> = (0..structure.clusters.len())
        .filter(|c| structure.clusters[*c].iter().any(|j| held.contains_key(j)))
        .filter_map(|c| choose(description, &structure, c, &held, &mut compiled, &mut errors))
        .collect();
    if !errors.is_empty() {
        return failed(errors);
    }
    let found = Held::find(description, &structure, &choices)?;

    // a given position of a joint that its loops hold has to agree with them
    for (&joint, &position) in &held {
        let name = &description.joints[joint].name;
        if !found.fixed.contains_key(&joint) {
            errors.push(Diagnostic::new(
                Site::Joint(joint),
                format!("the joint {name} locked beside joints that do not hold it always"),
                "joints that move independently of each other",
                "lock one of them less",
            ));
        }
        let Some((position, at)) = position.zip(found.at.get(&joint)) else { continue };
        if (position - at).abs() > SAME {
            errors.push(Diagnostic::new(
                Site::Joint(joint),
                format!("the joint {name} locked at {position}, where its loop is open"),
                format!("{at}, where the loop closes with the other locked joints"),
                "lock it at no position, or one of them less",
            ));
        }
    }
    if !errors.is_empty() {
        return failed(errors);
    }
    let mut warnings = beyond_limits(description, &found);
    warnings.extend(choices.iter().flat_map(|of| of.remarks(description, &found)));
    let (mut description, submechanisms) = fold::fold(description, &structure, &choices, &found)?;
    fold::recognise(&mut description, &found);
    Ok(Reduced {
        links: (0..description.links.len()).collect(),
        joints: (0..description.joints.len()).collect(),
        submechanisms,
        description,
        warnings,
    })
}

/// A joint that exists, moves, and can be held at this position.
fn is_lockable(description: &Description, lock: &Lock, errors: &mut Vec<Diagnostic>) -> bool {
    let mut fault = |found: String, expected: &str, help: &str| {
        errors.push(Diagnostic::new(Site::Joint(lock.joint), found, expected, help));
        false
    };
    let Some(joint) = description.joints.get(lock.joint) else {
        let found = format!("a lock of joint {} of {}", lock.joint, description.joints.len());
        return fault(found, "a joint of the robot", "name another");
    };
    let name = &joint.name;
    match (joint.kind, lock.position) {
        (JointKind::Fixed, _) => fault(
            format!("a lock of the joint {name}, which is fixed"),
            "a joint that moves",
            "leave the lock out",
        ),
        (_, Some(x)) if !x.is_finite() => {
            fault(format!("the joint {name} locked at {x}"), "a finite number", "give a position")
        }
        (JointKind::Spherical | JointKind::Floating, Some(x)) if x != 0.0 => fault(
            format!("the joint {name} of several degrees of freedom locked at {x}"),
            "no position: it is held where it is at the zero pose",
            "leave the position out, or write its freedoms as joints of their own",
        ),
        _ => true,
    }
}

/// Joints that are held beyond their limits.
fn beyond_limits(description: &Description, held: &Held) -> Vec<Diagnostic> {
    let beyond = held.at.iter().filter_map(|(&j, &x)| {
        let joint = &description.joints[j];
        let limits = joint.limits.filter(|_| joint.kind != JointKind::Continuous)?;
        // rounding of a file is none
        (x < limits.lower - SAME || x > limits.upper + SAME).then(|| {
            Diagnostic::new(
                Site::Joint(j),
                format!("the joint {} held at {x}", joint.name),
                format!("a position from {} to {}", limits.lower, limits.upper),
                "lock it, or the joints that determine it, within the limits",
            )
        })
    });
    beyond.collect()
}
