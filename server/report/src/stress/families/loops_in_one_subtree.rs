//! Loops within one subtree, with cuts far off the centre of mass.

use sarrus_dynamics::description::SubmechanismKind as Kind;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::State;
use crate::stress::harness::robot::{Draft, Robot, Turn, Z};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::LOOSE;

/// A four-bar on a moving base, so that both ends of its loop are in one subtree, with centres of
/// mass farther and farther off its cut.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("loop in one subtree", "m from the cut to the centres of mass");
    for (name, kind) in
        [("four-bar on an arm", Kind::FourBar), ("four-bar on an arm", Kind::Numerical)]
    {
        for value in sweep(effort, -3, 6, 5) {
            let mut of = Draft::new(kind);
            let arm = of.joint(0, Turn, [-0.4, 0.2, 0.3], [0.36, 0.48, 0.8]);
            let [a, b, c, d] = LOOSE.map(|p| [p[0], p[1], 0.0]);
            let crank = of.joint(arm, Turn, a, Z);
            let coupler = of.joint(crank, Turn, b, Z);
            let rocker = of.joint(arm, Turn, d, Z);
            of.cut(coupler, rocker, c, "xy");
            let mut of = of.finish(&[1], &[1]);
            // the arm is a mechanism of its own
            let mut serial = of.submechanisms[0].clone();
            of.submechanisms[0].spanning_tree.retain(|j| *j != 0);
            (serial.name, serial.kind, serial.type_name) = ("arm".into(), Kind::Serial, "R".into());
            (serial.spanning_tree, serial.independent, serial.active) = (vec![0], vec![0], vec![0]);
            serial.loops.clear();
            of.submechanisms.insert(0, serial);
            for inertial in of.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
                inertial.origin.xyz = [0.6, -0.5, 0.62].map(|x| x * value);
            }
            if let Some(robot) = cases.load(name, At { value, method: "-" }, Robot::new(name, of)) {
                cases.questions(
                    &robot,
                    value,
                    &State::of(&robot, 0.2)?,
                    false,
                    &sarrus_dynamics::Method::ALL,
                )?;
            }
        }
    }
    Ok(())
}
