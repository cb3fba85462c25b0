//! Redundant rows, idle freedoms, overconstraint, loops within one subtree, cuts far off the centre
//! of mass.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::{Cut, Description, Inertial, SubmechanismKind as Kind};

use super::ask::{Ask, State};
use super::case::{At, Cases, Truth};
use super::mechanisms::{BASE, LOOSE, RHOMBUS, bricard, door, four_bar};
use super::robot::{Robot, Turn, X, Y, Z, cut, finish, joint, mechanism};
use super::sweep;
use crate::Outcome;
use crate::report::Effort;

use Field::{Lambda, TauU, TauY};

/// Rows that say nothing new, moved apart as a rounded file does: told at load where it matters,
/// refused where it is no rounding.
pub(super) fn redundant(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("redundant rows", "m by which redundant rows contradict each other");
    let mut values = vec![0.0];
    values.extend(sweep(effort, -16, -1, 5));
    let robots: [(&str, Description); 5] = [
        ("four-bar of three rows", four_bar(LOOSE, Kind::Numerical, "xyz")?),
        ("four-bar of six rows", four_bar(LOOSE, Kind::Numerical, "xyzabc")?),
        ("parallelogram of six rows", four_bar(RHOMBUS, Kind::Numerical, "xyzabc")?),
        ("Bricard of six rows", bricard(false)?),
        ("Bricard of five rows", bricard(true)?),
    ];
    for (name, plain) in robots {
        for &value in &values {
            let mut of = plain.clone();
            if let Cut::Placed { successor, .. } = &mut of.submechanisms[0].loops[0].cut {
                successor.xyz[2] += value;
            }
            let Some(robot) =
                cases.load(name, At { value, method: "numerical" }, Robot::new(name, of))
            else {
                continue;
            };
            let mut state = State::of(&robot, 0.2)?;
            state.forces(&robot)?;
            let at = At { value, method: robot.closures() };
            cases.questions(&robot, value, &state, true, &sarrus_dynamics::Method::ALL)?;
            let warned =
                robot.compiled.warnings.first().map(ToString::to_string).unwrap_or_default();
            let case = cases.ask(
                &robot,
                at,
                "ID, λ",
                &Ask::inverse(&state, &[TauY, TauU, Lambda]),
                &Truth::Same,
            )?;
            case.told = [std::mem::take(&mut case.told), warned].concat();
        }
    }
    idle(cases)
}

/// A rod that may spin about itself answers as the one that may not; a mechanism of other mobility
/// than declared is refused.
fn idle(cases: &mut Cases) -> Outcome {
    cases.family("idle freedoms", "y, rad");
    let (spinning, plain) =
        (Robot::new("rod that may spin", door(true)?)?, Robot::new("rod", door(false)?)?);
    for value in [0.4, 0.2, -0.2, -0.4] {
        let state = State { y: vec![value], ..State::of(&plain, 0.2)? };
        let ask = Ask::inverse(&state, &[TauY, TauU]);
        cases.ask(&spinning, At { value, method: "numerical" }, "ID", &ask, &Truth::Same)?;
        let forward = Ask::forward(&state, None);
        cases.ask(&spinning, At { value, method: "numerical" }, "FD", &forward, &Truth::Same)?;
    }
    // a five-bar with one independent, a four-bar with two rows too many about skew axes, a loose
    // sleeve
    let five = {
        let mut of = mechanism(Kind::Numerical);
        let first = joint(&mut of, BASE, Turn, [0.0, 0.0, 0.0], Z);
        let second = joint(&mut of, first, Turn, [0.2, 0.9, 0.0], Z);
        let third = joint(&mut of, second, Turn, [0.8, 1.3, 0.0], Z);
        let other = joint(&mut of, BASE, Turn, [2.1, -0.1, 0.0], Z);
        cut(&mut of, third, other, [1.4, 1.0, 0.0], "xy");
        finish(of, &[first], &[first])?
    };
    let skew = {
        let mut of = mechanism(Kind::Numerical);
        let first = joint(&mut of, BASE, Turn, [0.0, 0.0, 0.0], X);
        let second = joint(&mut of, first, Turn, [0.2, 0.9, 0.3], Y);
        let third = joint(&mut of, second, Turn, [0.8, 1.3, -0.2], Z);
        let last = joint(&mut of, third, Turn, [1.0, 0.1, 0.4], [0.6, 0.0, 0.8]);
        cut(&mut of, BASE, last, [1.4, 1.0, 0.0], "xyzabc");
        finish(of, &[first], &[first])?
    };
    for (name, of, value) in
        [("five-bar of one independent", five, 2.0), ("closed chain without mobility", skew, -2.0)]
    {
        let at = At { value, method: "numerical" };
        if let Some(robot) = cases.load(name, at, Robot::new(name, of)) {
            // it should not have been taken
            let state = State::of(&robot, 0.1)?;
            cases.ask(&robot, at, "ID", &Ask::inverse(&state, &[TauY]), &Truth::None)?;
        }
    }
    Ok(())
}

/// A four-bar on a moving base, so that both ends of its loop are in one subtree, with centres of
/// mass farther and farther off its cut.
pub(super) fn subtree(cases: &mut Cases, effort: &Effort) -> Outcome {
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
