//! Loops within one subtree, with cuts far off the centre of mass.

use sarrus_dynamics::description::{Inertial, SubmechanismKind as Kind};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::State;
use crate::stress::harness::robot::{Robot, Turn, Z, cut, finish, joint, mechanism};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::{BASE, LOOSE};

/// A four-bar on a moving base, so that both ends of its loop are in one subtree, with centres of
/// mass farther and farther off its cut.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("loop in one subtree", "m from the cut to the centres of mass");
    for (name, kind) in
        [("four-bar on an arm", Kind::FourBar), ("four-bar on an arm", Kind::Numerical)]
    {
        for value in sweep(effort, -3, 6, 5) {
            let mut of = mechanism(Kind::Serial);
            let centre = [0.6, -0.5, 0.62].map(|x| x * value);
            of.default_inertial(Inertial::new(1.0, centre, [0.2, 0.01, 0.02, 0.3, 0.0, 0.25]));
            let arm = joint(&mut of, BASE, Turn, [-0.4, 0.2, 0.3], [0.36, 0.48, 0.8]);
            of.submechanism("bars", kind);
            let [a, b, c, d] = LOOSE.map(|p| [p[0], p[1], 0.0]);
            let crank = joint(&mut of, arm, Turn, a, Z);
            let coupler = joint(&mut of, crank, Turn, b, Z);
            let rocker = joint(&mut of, arm, Turn, d, Z);
            cut(&mut of, coupler, rocker, c, "xy");
            let of = finish(of, &[crank], &[crank])?;
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
