//! Doubts, and samples of roundings against double-double.

use sarrus_proto::{FieldSet, Query, Request};

use super::*;
use crate::builder::{CutJoint, DescriptionBuilder, LinkId};
use crate::description::Inertial;

/// A slider-crank, crank 3 and rod 5, that the slider moves: singular where they are in line.
/// Every number of the robot is whole.
#[test]
fn samples_take_no_answer_for_good_that_double_double_does_not() {
    let y = [0.0, 1.0, 0.0];
    let mut robot = DescriptionBuilder::new("slider-crank");
    robot.default_inertial(Inertial::new(2.0, [1.0, 0.0, 1.0], [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]));
    let crank = robot.revolute("crank", LinkId::BASE, y).link();
    let rod = robot.revolute("rod", crank, y).at([0.0, 0.0, 3.0]).link();
    let slider = robot.prismatic("slider", LinkId::BASE, [1.0, 0.0, 0.0]);
    let slider = slider.at([4.0, 0.0, 0.0]).link();
    robot.cut("pin", rod, slider).at([4.0, 0.0, 0.0]).joint(CutJoint::PlanarRevolute { axis: y });
    robot.independent([slider]);
    let model = robot.compile().unwrap().model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let want = FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd, Field::TauU]);
    let plan = Plan::new(&model, &Query::new(Request::InverseDynamics, given, want)).unwrap();
    let mut ws = Workspace::for_plans(&model, [&plan]);
    let mut output = vec![0.0; plan.want().len()];
    let [mut answered, mut alike, mut lost] = [0; 3];
    for k in 0..800 {
        // from a tenth to 1e-11 before or behind one of both singular poses
        let away = 10_f64.powf(-1.0 - 10.0 * f64::from(k) / 800.0);
        let at = if k % 2 == 0 { 4.0 - away } else { away - 2.0 };
        let input = [at, (f64::from(k) * 0.7).sin(), (f64::from(k) * 1.3).cos()];
        if plan.run(&model, &mut ws, &input, &mut output).status != sarrus_proto::Status::Ok {
            continue;
        }
        answered += 1;
        let mut probe = ws.probe.take().unwrap();
        let Probe { samples, exact } = &mut *probe;
        let report = RunReport::<f64>::none();
        let off = |again: &mut _| plan.differs_by(again, &ws.q, &input, &output, &report);
        let is_alike = samples.iter_mut().map(off).all(|off| off <= ALIKE);
        let off = plan.differs_by(exact, &ws.q, &input, &output, &report);
        alike += u32::from(is_alike);
        lost += u32::from(off > KEPT);
        assert!(!is_alike || off <= KEPT, "{input:?}: {off:e}");
        ws.probe = Some(probe);
    }
    // both ends of the range are decided
    assert!(alike > 60 && lost > 60, "{alike} {lost} of {answered}");
}

#[test]
fn the_largest_of_several_is_no_number_wherever_one_of_them_is_none() {
    let largest = |x: [f64; 3]| x.into_iter().fold(1.0, larger);
    let nan = f64::NAN;
    for x in [[nan, 2.0, 3.0], [2.0, nan, 3.0], [2.0, 3.0, nan], [f64::INFINITY, nan, 0.0]] {
        assert!(largest(x).is_nan(), "{x:?}");
    }
    assert_eq!(largest([3.0, 2.0, f64::INFINITY]), f64::INFINITY);
    assert_eq!((largest([3.0, 7.0, 2.0]), largest([0.0, -1.0, 0.5])), (7.0, 1.0));
}

#[test]
fn a_doubt_that_is_no_number_is_large_whatever_follows() {
    let mut doubt = Doubt::NONE;
    for gain in [2.0, f64::NAN, 3.0] {
        doubt.closure(gain, Level::Acceleration, 1.0);
    }
    assert!(doubt.is_large());
    let mut doubt = Doubt::NONE;
    [f64::NAN, 3.0].into_iter().for_each(|factor| doubt.times(factor));
    assert!(doubt.is_large());
}
