//! The builder against descriptions and numbers that are known.

use super::*;
use crate::description::{Coupling, Cut, Limits, Placement};
use crate::scalar::Real;
use crate::{Field, FieldSet, Plan, Query, Request, Status, Workspace};

const Y: [f64; 3] = [0.0, 1.0, 0.0];

fn found(robot: &DescriptionBuilder) -> Vec<String> {
    robot.build().unwrap_err().errors.into_iter().map(|fault| fault.found).collect()
}

#[test]
fn a_pendulum_in_code_swings_as_its_equation_says() {
    let mut robot = DescriptionBuilder::new("pendulum");
    let bob = Inertial::point(2.0, [0.0, 0.0, -0.5]);
    robot.revolute("pivot", LinkId::BASE, Y).inertial(bob).damping(0.3);
    let model = robot.compile().unwrap().model;
    let query = Query::new(
        Request::ForwardDynamics,
        FieldSet::of(&[Field::Y, Field::Yd, Field::TauU]),
        FieldSet::of(&[Field::Ydd]),
    );
    let plan = Plan::new(&model, &query).unwrap();
    let mut ydd = [0.0];
    let answer = plan.run(&model, &mut Workspace::new(&model), &[0.7, 1.1, 0.4], &mut ydd);
    assert_eq!(answer.status, Status::Ok);
    let expected = (0.4 - 0.3 * 1.1 - 2.0 * 9.81 * 0.5 * 0.7_f64.sin()) / (2.0 * 0.25);
    assert!((ydd[0] - expected).abs() < 1e-14 * expected.abs(), "{} {expected}", ydd[0]);
}

#[test]
fn a_point_of_the_root_is_the_same_place_from_any_link() {
    // the second joint turned and moved, the third at a point of the root
    let mut robot = DescriptionBuilder::new("arm");
    let first = robot.revolute("first", LinkId::BASE, Y).origin([0.25, 0.0, 0.5]).link();
    let second = robot.revolute("second", first, Y).rpy([0.0, 0.5, 0.25]).at([1.0, 0.5, 0.25]);
    let second = second.link();
    let third = robot.revolute("third", second, Y).at([2.0, -0.5, 0.75]).link();
    robot.cut("pin", third, first).at([3.0, 1.0, -1.0]).joint(CutJoint::Spherical);
    robot.independent([first]);
    let description = robot.build().unwrap();
    let poses: Vec<_> = description.joints.iter().fold(vec![Pose::identity()], |mut all, joint| {
        all.push(all[joint.parent].then(&crate::compile::pose_of(&joint.origin)));
        all
    });
    let far = |x: &nalgebra::Vector3<Dd>, point: [f64; 3]| {
        (0..3).map(|k| (x[k] - Dd::from_f64(point[k])).to_f64().abs()).fold(0.0, f64::max)
    };
    assert!(far(&poses[2].p, [1.0, 0.5, 0.25]) < 1e-16);
    assert!(far(&poses[3].p, [2.0, -0.5, 0.75]) < 1e-15);
    let cut = &description.submechanisms[0].loops[0];
    let Cut::Placed { predecessor, successor } = &cut.cut else { panic!("{cut:?}") };
    for (link, place) in [(cut.predecessor, predecessor), (cut.successor, successor)] {
        let x = poses[link].then(&crate::compile::pose_of(place));
        assert!(far(&x.p, [3.0, 1.0, -1.0]) < 1e-15);
        // along the root's axes
        for (i, axis) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate()
        {
            assert!(far(&x.R.column(i).into_owned(), axis) < 1e-15);
        }
    }
}

#[test]
fn what_is_not_said_has_its_usual_value() {
    let mut robot = DescriptionBuilder::new("robot");
    robot.default_inertial(Inertial::sphere(1.0, [0.0; 3], 0.1));
    let body = robot.floating("body", LinkId::BASE).link();
    let hip = robot.spherical("hip", body).link();
    let knee = robot.revolute("knee", hip, Y).at([0.0, 0.0, -0.5]).limits(0.0, 2.0).link();
    let sensor = robot.fixed("sensor", knee).link_name("camera").link();
    let spool = robot.prismatic("spool", body, Y).massless().link();
    robot.couple(spool, [(knee, 0.02)], 0.1);
    let of = robot.build().unwrap();
    assert_eq!(of.gravity, [0.0, 0.0, -9.81]);
    assert_eq!((body.index(), body.joint(), LinkId::BASE.joint()), (1, Some(0), None));
    let limits = Limits { lower: 0.0, upper: 2.0, velocity: f64::INFINITY, effort: f64::INFINITY };
    assert_eq!(of.joints[2].limits, Some(limits));
    assert_eq!(of.links[sensor.index()], Link { name: "camera".into(), inertial: None });
    assert_eq!((of.links[3].name.as_str(), of.links[5].inertial), ("knee_link", None));
    let part = &of.submechanisms[0];
    assert_eq!((part.name.as_str(), part.type_name.as_str()), ("robot", "TRANSMISSION"));
    assert_eq!(part.spanning_tree, [0, 1, 2, 4]);
    assert_eq!((part.independent.as_slice(), part.active.as_slice()), (&[0, 1, 2][..], &[2][..]));
    let coupling = Coupling { terms: vec![(2, 0.02)], offset: 0.1, ..Coupling::default() };
    assert_eq!(of.joints[4].coupling, Some(coupling));
}

#[test]
fn submechanisms_hold_what_comes_after_them() {
    let mut robot = DescriptionBuilder::new("robot");
    robot.submechanism("arm", SubmechanismKind::Serial);
    let arm = robot.revolute("arm", LinkId::BASE, Y).link();
    robot.submechanism("loop", SubmechanismKind::Numerical);
    let [a, b, c] = [("a", arm), ("b", arm), ("c", arm)].map(|(name, parent)| {
        robot.revolute(name, parent, Y).inertial(Inertial::point(1.0, [0.1; 3])).link()
    });
    robot.cut("pin", a, b).at_frame_of(c).row("x", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    robot.order([c, a, b]).independent([a, b]).active([c]);
    let of = robot.build().unwrap();
    let [arm, of] = of.submechanisms.as_slice() else { panic!() };
    assert_eq!((arm.spanning_tree.as_slice(), arm.active.as_slice()), (&[0][..], &[0][..]));
    assert_eq!(
        [&of.spanning_tree, &of.independent, &of.active].map(Vec::as_slice),
        [&[3, 1, 2][..], &[1, 2], &[3]]
    );
    assert_eq!((of.loops[0].cut.clone(), of.loops[0].rows.len()), (Cut::AtJoint(3), 1));
}

#[test]
fn every_fault_comes_back_at_once() {
    let other = {
        let mut other = DescriptionBuilder::new("other");
        (0..9).fold(LinkId::BASE, |on, k| other.revolute(format!("j{k}"), on, Y).link())
    };
    let mut robot = DescriptionBuilder::new("robot");
    robot.submechanism("loop", SubmechanismKind::FourBar);
    let a = robot.revolute("a", LinkId::BASE, [f64::NAN, 0.0, 0.0]).link();
    let b = robot.revolute("a", other, Y).limits(1.0, -1.0).link();
    let tip = robot.fixed("tip", b).inertial(Inertial::point(-1.0, [0.0; 3])).link();
    robot.couple(b, [(a, 1.0)], 0.0).couple(b, [(tip, 1.0)], 0.0).active([LinkId::BASE]);
    robot.cut("pin", a, b);
    let found = found(&robot);
    for part in [
        "link 9 of 2",
        "the link tip_link where a joint is named",
        "joint a that follows others twice",
        "the link base where a joint is named",
        "the loops of loop without independent joints",
        "cut pin without a place",
        "cut pin without rows",
        "two links of the name a_link",
        "two joints of the name a",
        "NaN in the axis of joint a",
        "joint a with limits 1 to -1",
        "link tip_link with a mass of -1 kg",
    ] {
        assert!(found.iter().any(|found| found.contains(part)), "{part}: {found:#?}");
    }
    assert_eq!(found.len(), 12, "{found:#?}");
}

#[test]
fn shapes_have_the_inertias_of_the_tables() {
    let rod = Inertial::rod(3.0, [0.0; 3], [0.0, 0.0, 2.0]);
    assert_eq!(rod.origin, Placement { xyz: [0.0, 0.0, 1.0], rpy: [0.0; 3] });
    assert_eq!(rod.inertia, [1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let plate = Inertial::cuboid(12.0, [0.0; 3], [1.0, 2.0, 3.0]);
    assert_eq!(plate.inertia, [13.0, 0.0, 0.0, 10.0, 0.0, 5.0]);
    assert_eq!(Inertial::sphere(5.0, [0.0; 3], 0.5).inertia, [0.5, 0.0, 0.0, 0.5, 0.0, 0.5]);
    // m r² / 2 about its axis, m (3 r² + l²) / 12 across it
    let drum = Inertial::cylinder(12.0, [0.0; 3], [0.0, 2.0, 0.0], 1.0);
    assert_eq!(drum.inertia, [7.0, 0.0, 0.0, 6.0, 0.0, 7.0]);
    // a slanted rod is the sum of its pieces
    let slanted = Inertial::rod(1.0, [1.0, 2.0, 3.0], [2.0, 0.0, 3.5]);
    let n = 2000;
    let mut sum = [0.0; 6];
    for k in 0..n {
        let s = (f64::from(k) + 0.5) / f64::from(n) - 0.5;
        let [x, y, z] = [s, -2.0 * s, 0.5 * s];
        let of = [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y];
        (0..6).for_each(|i| sum[i] += of[i] / f64::from(n));
    }
    (0..6).for_each(|i| assert!((sum[i] - slanted.inertia[i]).abs() < 1e-6));
}
