//! Redundant rows, idle freedoms, overconstraint, loops within one subtree, cuts far off the centre
//! of mass.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::{Cut, Description, SubmechanismKind as Kind};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::robot::{Draft, Robot, Turn, X, Y, Z};
use crate::stress::mechanisms::{LOOSE, RHOMBUS, bricard, door, four_bar};
use crate::stress::sweep;

use Field::{Lambda, TauU, TauY};

/// Rows that say nothing new, moved apart as a rounded file does: reported at load where it matters,
/// refused where it is no rounding.
pub(crate) fn redundant(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("redundant rows", "m by which redundant rows contradict each other");
    let mut values = vec![0.0];
    values.extend(sweep(effort, -16, -1, 5));
    let robots: [(&str, Description); 5] = [
        ("four-bar of three rows", four_bar(LOOSE, Kind::Numerical, "xyz")),
        ("four-bar of six rows", four_bar(LOOSE, Kind::Numerical, "xyzabc")),
        ("parallelogram of six rows", four_bar(RHOMBUS, Kind::Numerical, "xyzabc")),
        ("Bricard of six rows", bricard(false)),
        ("Bricard of five rows", bricard(true)),
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
                &Question::inverse(&state, &[TauY, TauU, Lambda]),
                &Reference::Same,
            )?;
            case.reported = [std::mem::take(&mut case.reported), warned].concat();
        }
    }
    idle(cases)
}

/// A rod that may spin about itself answers as the one that may not; a mechanism of other mobility
/// than declared is refused.
fn idle(cases: &mut Cases) -> Outcome {
    cases.family("idle freedoms", "y, rad");
    let (spinning, plain) =
        (Robot::new("rod that may spin", door(true))?, Robot::new("rod", door(false))?);
    for value in [0.4, 0.2, -0.2, -0.4] {
        let state = State { y: vec![value], ..State::of(&plain, 0.2)? };
        let ask = Question::inverse(&state, &[TauY, TauU]);
        cases.ask(&spinning, At { value, method: "numerical" }, "ID", &ask, &Reference::Same)?;
        let forward = Question::forward(&state, None);
        cases.ask(
            &spinning,
            At { value, method: "numerical" },
            "FD",
            &forward,
            &Reference::Same,
        )?;
    }
    // a five-bar with one independent, a four-bar with two rows too many about skew axes, a loose
    // sleeve
    let five = {
        let mut of = Draft::new(Kind::Numerical);
        let mut link = 0;
        for at in [[0.0, 0.0, 0.0], [0.2, 0.9, 0.0], [0.8, 1.3, 0.0]] {
            link = of.joint(link, Turn, at, Z);
        }
        let other = of.joint(0, Turn, [2.1, -0.1, 0.0], Z);
        of.cut(link, other, [1.4, 1.0, 0.0], "xy");
        of.finish(&[0], &[0])
    };
    let skew = {
        let mut of = Draft::new(Kind::Numerical);
        let mut link = 0;
        for (at, axis) in [
            ([0.0, 0.0, 0.0], X),
            ([0.2, 0.9, 0.3], Y),
            ([0.8, 1.3, -0.2], Z),
            ([1.0, 0.1, 0.4], [0.6, 0.0, 0.8]),
        ] {
            link = of.joint(link, Turn, at, axis);
        }
        of.cut(0, link, [1.4, 1.0, 0.0], "xyzabc");
        of.finish(&[0], &[0])
    };
    for (name, of, value) in
        [("five-bar of one independent", five, 2.0), ("closed chain without mobility", skew, -2.0)]
    {
        let at = At { value, method: "numerical" };
        if let Some(robot) = cases.load(name, at, Robot::new(name, of)) {
            // it should not have been taken
            let state = State::of(&robot, 0.1)?;
            cases.ask(&robot, at, "ID", &Question::inverse(&state, &[TauY]), &Reference::None)?;
        }
    }
    Ok(())
}

/// A four-bar on a moving base, so that both ends of its loop are in one subtree, with centres of
/// mass farther and farther off its cut.
pub(crate) fn subtree(cases: &mut Cases, effort: &Effort) -> Outcome {
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
