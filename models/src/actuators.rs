//! `actuators:` of a submechanism file: motors as their makers describe them.

use sarrus_dynamics::description::{JointKind, Limits, Motor, Terms};

use crate::number as strict;
use crate::report::{Diagnostics, quoted};
use crate::urdf::{JointEntry, Urdf};
use crate::yaml::{Node, Value, keys, list, missing, number, numbers, word, words};

const OF: &str = "an actuator";
const KEYS: &str = "joint joints model peak_torque continuous_torque thermal_time \
    series_stiffness max_speed torque_speed braking_torque_speed power stroke rotor_inertia \
    gear_ratio efficiency friction";
/// Keys that no request reads, and where they count.
const KEPT: &[(&str, &str)] = &[
    ("thermal_time", "`simulate --limits` alone reads it"),
    ("series_stiffness", "`simulate` alone reads it: elsewhere motor and joint move as one"),
];
const FRICTION: &[&str] = &["coulomb", "viscous", "speed"];

/// A motor that its maker or its users have published, by the numbers at its joint: torque up to
/// the first speed along the motion and against it `[N m]`, both falling in a straight line to zero
/// at the second `[rad/s]`; dry and viscous friction `[N m, N m s/rad]`; armature `[kg m²]`, zero
/// where it is not known.
pub struct Published {
    /// Its name as `model` of an actuator.
    pub name: &'static str,
    /// Where it is used.
    pub about: &'static str,
    speeds: [f64; 2],
    torques: [f64; 2],
    friction: [f64; 2],
    armature: f64,
}

/// Published motors; the README of this crate names the sources.
pub fn published() -> impl Iterator<Item = Published> + Clone {
    include_str!("motors.tsv").lines().filter_map(|row| {
        let (name, row) = row.split_once('\t')?;
        let (about, row) = row.split_once('\t')?;
        let [a, b, driving, braking, dry, viscous, armature] = strict::numbers(row).ok()?;
        let [speeds, torques, friction] = [[a, b], [driving, braking], [dry, viscous]];
        Some(Published { name, about, speeds, torques, friction, armature })
    })
}

/// Reads the actuators of a file into the joints of the robot.
pub(crate) fn read(root: &Node, urdf: &mut Urdf, diagnostics: &mut Diagnostics) {
    let known: Vec<&str> = KEYS.split(' ').collect();
    let mut seen: Vec<String> = Vec::new();
    for node in list(root, "actuators", diagnostics) {
        if !keys(node, OF, &known, diagnostics) {
            continue;
        }
        for (key, reader) in KEPT {
            if let Some(item) = node.get(key) {
                diagnostics.note(item.span, format!("`{key}` is kept"), *reader);
            }
        }
        let mut joints = words(node, "joints", diagnostics).unwrap_or_default();
        joints.extend(word(node, "joint", diagnostics));
        if node.get("joint").is_none() && node.get("joints").is_none() {
            missing(node, OF, "joint", "the joint that it moves", diagnostics);
        }
        for (name, span) in joints {
            let kind = urdf.joint(&name).and_then(|joint| joint.kind);
            let moves = matches!(
                kind,
                Some(JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic)
            );
            if !moves || seen.contains(&name) {
                let found =
                    format!("{} is no joint of one freedom without an actuator", quoted(&name));
                let help = "correct the name, or remove one of the actuators";
                diagnostics.error(span, found, "a joint of the URDF, once", help);
                continue;
            }
            if let Some(joint) = urdf.joint_index.get(&name).and_then(|j| urdf.joints.get_mut(*j)) {
                actuator(node, joint, diagnostics);
            }
            seen.push(name);
        }
    }
}

/// One actuator at its joint: its model first, then the keys that say otherwise.
fn actuator(node: &Node, joint: &mut JointEntry, diagnostics: &mut Diagnostics) {
    let limits = joint.limits.get_or_insert(Limits::NONE);
    let terms = &mut joint.terms;
    let mut own = Motor {
        continuous: f64::INFINITY,
        thermal_time: f64::INFINITY,
        series_stiffness: f64::INFINITY,
        driving: Vec::new(),
        braking: Vec::new(),
        power: f64::INFINITY,
        efficiency: [1.0; 2],
    };
    model(node, (limits, terms, &mut own), diagnostics);
    let mut positive = |node: &Node, key: &str, to: &mut f64, may_be_zero: bool| {
        let Some(item) = node.get(key) else { return };
        let Some(x) = number(item, key, diagnostics) else { return };
        if x > 0.0 || may_be_zero && x == 0.0 {
            *to = x;
        } else {
            let found = format!("`{key}` is {x}");
            diagnostics.error(item.span, found, "a positive number", "correct the value");
        }
    };
    positive(node, "peak_torque", &mut limits.effort, false);
    positive(node, "continuous_torque", &mut own.continuous, false);
    positive(node, "thermal_time", &mut own.thermal_time, false);
    positive(node, "series_stiffness", &mut own.series_stiffness, false);
    positive(node, "max_speed", &mut limits.velocity, false);
    positive(node, "power", &mut own.power, false);
    positive(node, "rotor_inertia", &mut terms.rotor_inertia, true);
    if let Some(friction) = node.get("friction") {
        positive(friction, "coulomb", &mut terms.friction.coulomb, true);
        positive(friction, "viscous", &mut terms.friction.viscous, true);
        positive(friction, "speed", &mut terms.friction.speed, false);
        keys(friction, "friction", FRICTION, diagnostics);
    }
    if node.get("thermal_time").is_some() && own.continuous.is_infinite() {
        missing(node, OF, "continuous_torque", "what it bears for ever", diagnostics);
    }
    if let Some(item) = node.get("gear_ratio") {
        terms.gear_ratio = number(item, "gear_ratio", diagnostics).unwrap_or(1.0);
    }
    if let Some([lower, upper]) = numbers::<2>(node, OF, "stroke", diagnostics) {
        (limits.lower, limits.upper) = (limits.lower.max(lower), limits.upper.min(upper));
    }
    if let Some(efficiency) = numbers::<2>(node, OF, "efficiency", diagnostics) {
        own.efficiency = efficiency;
        if !efficiency.iter().all(|x| *x > 0.0 && *x <= 1.0) {
            let span = node.get("efficiency").map_or(node.span, |item| item.span);
            let found = format!("the efficiencies are {efficiency:?}");
            let expected = "two numbers above 0, at most 1: of the motor driving, and driven";
            diagnostics.error(span, found, expected, "correct the list");
        }
    }
    for (key, to) in
        [("torque_speed", &mut own.driving), ("braking_torque_speed", &mut own.braking)]
    {
        if node.get(key).is_some() {
            *to = curve(node, key, diagnostics);
        }
    }
    if node.get("torque_speed").is_some() && node.get("braking_torque_speed").is_none() {
        own.braking.clear();
    }
    // a curve ends at the largest speed, and its highest point is the peak
    if limits.effort.is_infinite() || node.get("peak_torque").is_none() {
        let points = own.driving.iter().chain(&own.braking);
        let peak = points.fold(0.0_f64, |most, [_, torque]| most.max(*torque));
        limits.effort = if peak > 0.0 { peak } else { limits.effort };
    }
    if let Some([speed, torque]) = own.driving.last()
        && *torque == 0.0
        && node.get("max_speed").is_none()
    {
        limits.velocity = *speed;
    }
    joint.motor = Some(own);
}

/// The numbers of a published motor, if one is named.
fn model(
    node: &Node,
    (limits, terms, own): (&mut Limits, &mut Terms, &mut Motor),
    diagnostics: &mut Diagnostics,
) {
    let Some((name, span)) = word(node, "model", diagnostics) else { return };
    let Some(known) = published().find(|known| known.name == name) else {
        let names = published().map(|known| known.name);
        let found = format!("the motor {} is not known", quoted(&name));
        let expected = names.clone().collect::<Vec<_>>().join(", ");
        let otherwise = "write its numbers instead";
        return diagnostics.unknown(span, found, expected, &name, names, otherwise);
    };
    let [until, end] = known.speeds;
    [own.driving, own.braking] = known.torques.map(|torque| vec![[until, torque], [end, 0.0]]);
    limits.effort = known.torques[0].max(known.torques[1]);
    limits.velocity = end;
    [terms.friction.coulomb, terms.friction.viscous] = known.friction;
    if known.armature > 0.0 {
        (terms.rotor_inertia, terms.gear_ratio) = (known.armature, 1.0);
    }
}

/// Points (speed, torque) by ascending speed.
fn curve(node: &Node, key: &str, diagnostics: &mut Diagnostics) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    for item in list(node, key, diagnostics) {
        let Value::List(pair) = &item.value else {
            let found = item.describe();
            diagnostics.error(item.span, found, "a point [speed, torque]", "write a list");
            continue;
        };
        let pair: Vec<f64> = pair.iter().filter_map(|x| number(x, key, diagnostics)).collect();
        match pair[..] {
            [speed, torque]
                if speed >= 0.0
                    && torque >= 0.0
                    && points.last().is_none_or(|before| before[0] < speed) =>
            {
                points.push([speed, torque]);
            }
            _ => {
                let found = format!("the point {pair:?} of `{key}`");
                let expected = "[speed, torque], not negative, each at a higher speed";
                diagnostics.error(item.span, found, expected, "correct the point");
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::published;

    #[test]
    fn every_row_of_the_published_motors_is_read() {
        let rows = include_str!("motors.tsv").lines().count();
        assert_eq!((published().count(), rows), (11, 11));
        let of_the_knee = published().find(|motor| motor.name == "N7520-22.5").unwrap();
        assert_eq!((of_the_knee.torques, of_the_knee.friction), ([111.0, 131.0], [2.4, 0.24]));
    }
}
