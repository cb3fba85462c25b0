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
    let faults: [(&str, &str, &str); 15] = [
        ("mass NaN", "<mass value=\"1.2\"/>", "<mass value=\"NaN\"/>"),
        ("mass infinite", "<mass value=\"1.2\"/>", "<mass value=\"inf\"/>"),
        ("mass negative", "<mass value=\"1.2\"/>", "<mass value=\"-1.2\"/>"),
        ("mass beyond double", "<mass value=\"1.2\"/>", "<mass value=\"1e999\"/>"),
        ("inertia NaN", "ixx=\"0.014\"", "ixx=\"nan\""),
        ("inertia negative", "ixx=\"0.014\"", "ixx=\"-0.014\""),
        ("inertia of no body", "ixx=\"0.014\"", "ixx=\"14\""),
        ("inertia without mass", "<mass value=\"1.2\"/>", "<mass value=\"0\"/>"),
        ("origin NaN", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 nan 0.0\""),
        ("origin infinite", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 1e400 0.0\""),
        ("axis zero", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 0 0\"/>"),
        ("axis NaN", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 nan 0\"/>"),
        ("axis of a loop zero", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, 0, 0]"),
        ("axis of a loop NaN", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, .nan, 0]"),
        ("axis of a loop along no freedom", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 1, 0, 0]"),
    ];
    for (k, (name, from, to)) in faults.into_iter().enumerate() {
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

/// The ways in which a URDF writes the closing hinge of a four-bar, by the name of its element;
/// `R` stands for a rotation of its frames, `Y` for the axis in them.
const HINGES: [[&str; 2]; 3] = [
    [
        "loop",
        "<loop name='pin' type='revolute'><predecessor link='coupler'><origin xyz='1 0 0' R/>\
         </predecessor><successor link='rocker'><origin xyz='-0.2 0 1' R/></successor>\
         <axis xyz='Y'/></loop>",
    ],
    [
        "loop_joint",
        "<loop_joint name='pin' type='revolute'><link1 link='coupler' xyz='1 0 0' R/>\
         <link1 link='rocker' xyz='-0.2 0 1' R/><axis xyz='Y'/></loop_joint>",
    ],
    [
        "constraint",
        "<constraint name='pin' type='revolute'><parent link='coupler'/>\
         <parent_origin xyz='1 0 0' R/><parent_axis xyz='Y'/><child link='rocker'/>\
         <child_origin xyz='-0.2 0 1' R/><child_axis xyz='Y'/></constraint>",
    ],
];

/// A four-bar whose origins are turned by quaternions has the answers of one that is turned by
/// roll, pitch and yaw.
pub(crate) fn quaternions(cases: &mut Cases, effort: &Effort) -> Outcome {
    let name = "four-bar in turned frames";
    for value in powers(effort, -12, 0, 2) {
        let turn = [0.4, FRAC_PI_2 - value.min(1.0), -0.3];
        for [element, hinge] in HINGES {
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
fn turned_four_bar(hinge: &str, rotation: &str, [r, p, y]: [f64; 3]) -> String {
    // the y axis of the links in the turned frames
    let [(sr, cr), (sp, cp), (sy, cy)] = [r, p, y].map(f64::sin_cos);
    let axis = [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr];
    let axis = axis.map(|x| format!("{x:?}")).join(" ");
    let link = |name: &str| {
        format!(
            "<link name='{name}'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' \
             iyy='1' iyz='0' izz='1'/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, xyz: &str| {
        format!(
            "<joint name='{name}_joint' type='continuous'><parent link='{parent}'/><child \
             link='{name}'/><origin xyz='{xyz}'/><axis xyz='0 1 0'/></joint>"
        )
    };
    [
        "<robot name='four_bar' version='1.1'><link name='base'/><link name='turned'/>".to_owned(),
        format!(
            "<joint name='mount' type='fixed'><parent link='base'/><child link='turned'/><origin \
             xyz='0 0 0' {rotation}/></joint>"
        ),
        ["crank", "coupler", "rocker"].map(link).concat(),
        joint("crank", "turned", "0 0 0"),
        joint("coupler", "crank", "0 0 1"),
        joint("rocker", "turned", "1.2 0 0"),
        hinge.replace('R', rotation).replace('Y', &axis),
        "<transmission name='drive'><joint name='crank_joint'/><actuator name='m'/></transmission>\
         </robot>"
            .to_owned(),
    ]
    .concat()
}
