//! A robot of any length: lambdas in a row.

use sarrus_dynamics::description::{
    Cut, Description, Inertial, Joint, JointKind, Link, Loop, Placement, Row, Submechanism,
    SubmechanismKind,
};

/// Each plane is turned against the one before.
const TWIST: f64 = 0.2;

/// Lambdas in a row, each on the rocker of the one before.
pub(crate) fn chain_of_lambdas(n: usize) -> Description {
    let inertial = |y: f64, mass: f64| {
        Some(Inertial {
            origin: Placement { xyz: [0.0, y, 0.01], rpy: [0.0; 3] },
            mass,
            inertia: [0.004, 0.0, 0.0, 0.002, 0.0, 0.005],
        })
    };
    let mut robot = Description {
        name: format!("{n} lambdas"),
        links: vec![Link { name: "base".into(), inertial: None }],
        joints: Vec::new(),
        submechanisms: Vec::new(),
        gravity: [0.0, 0.0, -9.81],
    };
    let mut on = 0;
    for k in 0..n {
        let (link, joint) = (robot.links.len(), robot.joints.len());
        for (name, y, mass) in [("rocker", 0.1, 1.2), ("stator", 0.1, 0.5), ("slider", -0.1, 0.4)] {
            robot.links.push(Link { name: format!("{name}{k}"), inertial: inertial(y, mass) });
        }
        let at = |xyz: [f64; 3], rpy: [f64; 3]| Placement { xyz, rpy };
        let start = if k == 0 { [0.0; 3] } else { [0.0, 0.2, 0.05] };
        let joints = [
            (
                "rocker",
                JointKind::Revolute,
                on,
                link,
                at(start, [0.8, 0.0, TWIST]),
                [1.0, 0.0, 0.0],
            ),
            (
                "stator",
                JointKind::Revolute,
                on,
                link + 1,
                at(
                    [start[0] - 0.114 * TWIST.sin(), start[1] + 0.114 * TWIST.cos(), start[2]],
                    [1.08, 0.0, TWIST],
                ),
                [1.0, 0.0, 0.0],
            ),
            (
                "slider",
                JointKind::Prismatic,
                link + 1,
                link + 2,
                at([0.0, 0.3, 0.0], [0.0; 3]),
                [0.0, 1.0, 0.0],
            ),
        ];
        for (name, kind, parent, child, origin, axis) in joints {
            robot.joints.push(Joint {
                name: format!("{name}{k}"),
                kind,
                parent,
                child,
                origin,
                axis,
                limits: None,
                coupling: None,
                terms: Default::default(),
            });
        }
        let row = |axis: usize| Row {
            name: ["y", "z"][axis].into(),
            axis: std::array::from_fn(|i| if i == 4 + axis { 1.0 } else { 0.0 }),
            against: None,
        };
        robot.submechanisms.push(Submechanism {
            name: format!("lambda{k}"),
            kind: SubmechanismKind::Rrpr,
            type_name: "RRPR".into(),
            spanning_tree: vec![joint, joint + 1, joint + 2],
            independent: vec![joint],
            active: vec![joint + 2],
            loops: vec![Loop {
                name: format!("pin{k}"),
                predecessor: link,
                successor: link + 2,
                cut: Cut::AtJoint(joint + 2),
                rows: vec![row(0), row(1)],
            }],
        });
        on = link;
    }
    robot
}
