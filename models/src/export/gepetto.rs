//! The files of Gepetto's tools for parallel robots: URDF with a frame at each end of a cut, and
//! YAML that pairs them.

use sarrus_dynamics::Site;
use sarrus_dynamics::description::JointKind;

use super::Out;
use super::cuts::Tie;
use super::urdf::{self, Frame};

/// The names of the two frames of a cut.
fn names(k: usize, tie: &Tie) -> [String; 2] {
    ["A", "B"].map(|end| format!("closedloop{}_{}_{end}", k + 1, tie.name))
}

/// URDF and YAML.
pub(super) fn texts(out: &mut Out<'_>, ties: &[Tie]) -> Vec<(&'static str, String)> {
    let of = out.robot.of;
    let ends = |(k, tie): (usize, &Tie)| {
        let places = names(k, tie).into_iter().zip(tie.links).zip(tie.places);
        places.map(|((name, link), place)| (name, link, place.placement())).collect::<Vec<_>>()
    };
    let frames: Vec<Frame<'_>> = ties
        .iter()
        .enumerate()
        .flat_map(ends)
        .map(|(name, link, place)| Frame { name, link: &of.links[link].name, place })
        .collect();
    let listed = |of: Vec<String>| format!("[{}]", of.join(", "));
    let quoted = |name: &str| format!("'{}'", name.replace('\'', "''"));
    let pairs = ties.iter().enumerate().map(|(k, tie)| {
        let pair = names(k, tie).map(|name| quoted(&name));
        format!("[{}]", pair.join(", "))
    });
    let kinds = ties.iter().map(|tie| quoted(if tie.is_weld { "6d" } else { "3d" }));
    let motors = out.robot.active().map(|joint| quoted(&joint.name));
    let balls = || of.joints.iter().filter(|joint| joint.kind == JointKind::Spherical);
    let yaml = format!(
        "closed_loop: {}\ntype: {}\nname_mot: {}\njoint_name: {}\njoint_type: {}\n",
        listed(pairs.collect()),
        listed(kinds.collect()),
        listed(motors.collect()),
        listed(balls().map(|joint| quoted(&joint.name)).collect()),
        listed(balls().map(|_| quoted("SPHERICAL")).collect())
    );
    if of.gravity != [0.0, 0.0, -9.81] {
        let found = "the files hold no gravity".to_owned();
        out.note(Site::Robot, found, "set model.gravity");
    }
    vec![(".urdf", urdf::plain(of, &frames)), (".yaml", yaml)]
}
