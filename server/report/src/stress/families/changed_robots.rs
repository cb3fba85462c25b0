//! Families whose parameter changes the robot: its masses, its lengths, its gravity, the terms of
//! its joints, its centres of mass, its redundant rows.

use sarrus_dynamics::description::{Cut, Description, SubmechanismKind as Kind, Terms};
use sarrus_dynamics::{Field, Method};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, Question, Reference, Robot, State, Turn, Z, cut, finish, heavier, joint, mechanism,
    powers, scaled, with,
};
use crate::stress::mechanisms::{BASE, GRASHOF, LOOSE, RHOMBUS, bricard, four_bar};
use crate::stress::sweep::{Ask, Change, Design, Subject, Sweep};

use Change::{By, Masses};
use Design::{Bundled, FourBar, Made, Numerical, Rods};

/// Heavy and light links in loops and in chains.
pub(crate) const MASS_RATIOS: Sweep = Sweep {
    values: |effort| powers(effort, 0, 9, 3),
    robots: &[
        heavy("lambda, heavy slider", "lambda", &["ElbowAct_Link"]),
        heavy("lambda, heavy rocker", "lambda", &["Elbow_Link"]),
        heavy("lambda, light rocker", "lambda", &["ElbowB11_Link", "ElbowAct_Link"]),
        heavy("torso, heavy body", "torso", &["BodyRoll_Link"]),
        heavy("torso, heavy legs", "torso", &LEGS_OF_TORSO),
        heavy("Stewart, heavy platform", "stewart", &["HipRotZ_Link"]),
        heavy("Stewart, heavy legs", "stewart", &LEGS_OF_STEWART),
        heavy("arm with a lambda, heavy hand", "r3_lambda_r", &["ALWristRoll_Link"]),
        heavy("arm with a lambda, heavy shoulder", "r3_lambda_r", &["ALShoulder1_Link"]),
        heavy("upper body, heavy hands", "rh5v2_upper_body", &["WristRoll_Link"]),
        Subject::new("8 rods, heavy end", Rods(8), Masses(&["link8"])),
        Subject::new("8 rods, heavy base", Rods(8), Masses(&["link1"])),
        Subject::new("8 rods, every second heavy", Rods(8), Masses(&["2", "4", "6", "8"])),
        Subject::new("four-bar, heavy coupler", CRANK_ROCKER, Masses(&["link2"])),
    ],
    ask: dynamics,
};

const LEGS_OF_TORSO: [&str; 6] =
    ["BL1_Link", "BL2_Link", "ActL_Link", "BR1_Link", "BR2_Link", "ActR_Link"];
const LEGS_OF_STEWART: [&str; 3] = ["B1_Link", "B2_Link", "Act_Link"];
const CRANK_ROCKER: Design = FourBar(GRASHOF, Kind::FourBar, "xy");

const fn heavy(
    name: &'static str,
    bundled: &'static str,
    links: &'static [&'static str],
) -> Subject {
    Subject::new(name, Bundled(bundled), Masses(links))
}

/// Links of decreasing mass, down to none: loading refuses a mass matrix that is not positive
/// definite; with others answers stay exact. A chain of rods without inertia about their centres is
/// one of point masses.
pub(crate) const MASSLESS_LINKS: Sweep = Sweep {
    values: |effort| {
        let [count, decades] = if effort.quick { [5, 5] } else { [16, 1] };
        let fading = (0..count).map(|k| 10f64.powi(-decades * k));
        fading.chain([1e-60, 1e-150, 1e-300, 0.0]).collect()
    },
    robots: &[
        heavy("lambda, light stator", "lambda", &["ElbowB11_Link"]),
        Subject::new("lambda, light all but the slider", Bundled("lambda"), LIGHT_BUT_SLIDER),
        heavy("Stewart, light legs", "stewart", &LEGS_OF_STEWART),
        Subject::new("3 rods, light middle", Rods(3), Masses(&["link2"])),
        Subject::new("3 rods, light end", Rods(3), Masses(&["link3"])),
        Subject::new("3 rods, light end with a rotor", Rods(3), By(light_end_with_rotor)),
        Subject::new("3 rods, inertia fading", Rods(3), By(fading_inertia)),
    ],
    ask: dynamics,
};

const LIGHT_BUT_SLIDER: Change =
    By(|of, share| heavier(of, &|link| link != "ElbowAct_Link", share));

fn light_end_with_rotor(of: &mut Description, share: f64) {
    heavier(of, &|link| link == "link3", share);
    of.joints[2].terms = Terms { rotor_inertia: 1e-4, gear_ratio: 50.0, ..Terms::default() };
}

fn fading_inertia(of: &mut Description, share: f64) {
    for inertial in of.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        inertial.inertia = inertial.inertia.map(|x| x * share);
    }
}

/// Inverse dynamics, and forward dynamics by every method.
fn dynamics(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    cases.questions(robot, value, &State::of(robot, 0.25)?, false, &Method::ALL)
}

/// Inverse dynamics, and forward dynamics by every method, near zero.
fn dynamics_near_zero(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    cases.questions(robot, value, &State::of(robot, 0.2)?, false, &Method::ALL)
}

pub(crate) const LENGTHS: Change = By(|of, factor| scaled(of, factor, 1.0));
pub(crate) const MASSES: Change = By(|of, factor| scaled(of, 1.0, factor));

/// Robots under a change from a millionth to a million times.
pub(crate) fn sizes(cases: &mut Cases, effort: &Effort, change: Change) -> Outcome {
    let robots = ["lambda", "wrist", "stewart", "four_bars_2", "torso", "rh5v2_upper_body"];
    let some = if effort.quick { &robots[..4] } else { &robots };
    bundled_robots(cases, some, change, &powers(effort, -6, 6, 4), state_and_dynamics)
}

/// Kinematics, inverse dynamics, and forward dynamics by the robot's own method.
fn state_and_dynamics(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    cases.questions(robot, value, &State::of(robot, 0.2)?, true, &robot.own_method())
}

/// Runs bundled robots with this change.
fn bundled_robots(
    cases: &mut Cases,
    names: &[&'static str],
    change: Change,
    values: &[f64],
    ask: Ask,
) -> Outcome {
    names
        .iter()
        .try_for_each(|name| Subject::new(name, Bundled(name), change).ask(cases, values, ask))
}

/// Gravity from none to that of a neutron star; without it, at rest, all forces are zero.
pub(crate) const GRAVITY: Sweep = Sweep {
    values: |effort| with(&[0.0], &powers(effort, -9, 12, 7)),
    robots: &[
        Subject::new("lambda", Bundled("lambda"), FALL),
        Subject::new("lambda numerical", Numerical("lambda"), FALL),
        Subject::new("wrist", Bundled("wrist"), FALL),
        Subject::new("rh5v2_upper_body", Bundled("rh5v2_upper_body"), FALL),
        Subject::new("rh5v2_upper_body numerical", Numerical("rh5v2_upper_body"), FALL),
    ],
    ask: |cases, robot, value| {
        let mut state = State::of(robot, 0.2)?;
        cases.questions(robot, value, &state, false, &robot.own_method())?;
        state.yd.fill(0.0);
        state.ydd.fill(0.0);
        let question = Question::inverse(&state, &[Field::TauY, Field::TauQ]);
        cases.ask(robot, At::of(robot, value), "ID at rest", &question, &Reference::Same)?;
        Ok(())
    },
};
const FALL: Change = By(|of, value| of.gravity = [0.0, 0.0, -value]);

pub(crate) const SPRING: Change =
    By(|of, x| set_terms(of, Terms { stiffness: x, rest: 0.01, ..Terms::default() }));
pub(crate) const DAMPER: Change =
    By(|of, x| set_terms(of, Terms { damping: x, ..Terms::default() }));
pub(crate) const ROTOR: Change =
    By(|of, x| set_terms(of, Terms { rotor_inertia: x, ..Terms::default() }));

/// Stiff springs, dampers or rotors in joints: one answer of inverse and forward dynamics.
pub(crate) fn joint_terms(cases: &mut Cases, effort: &Effort, change: Change) -> Outcome {
    let robots = ["lambda", "four_bars_2", "rh5v2_upper_body"];
    bundled_robots(cases, &robots, change, &powers(effort, 0, 9, 3), dynamics_near_zero)
}

/// Sets the terms of the active joints alone, so that joints with and without rotors mix.
fn set_terms(of: &mut Description, terms: Terms) {
    for part in &of.submechanisms {
        for joint in &part.active {
            of.joints[*joint].terms = terms;
        }
    }
}

/// A four-bar on a moving base, so that both ends of its loop are in one subtree, with centres of
/// mass increasingly far from its cut.
pub(crate) const ONE_SUBTREE: Sweep = Sweep {
    values: |effort| powers(effort, -3, 6, 5),
    robots: &[
        Subject::new(ON_ARM, Made(|| four_bar_on_arm(Kind::FourBar)), By(far_centres)),
        Subject::new(ON_ARM, Made(|| four_bar_on_arm(Kind::Numerical)), By(far_centres)),
    ],
    ask: dynamics_near_zero,
};
const ON_ARM: &str = "four-bar on an arm";

fn four_bar_on_arm(kind: Kind) -> Outcome<Description> {
    let mut of = mechanism(Kind::Serial);
    let arm = joint(&mut of, BASE, Turn, [-0.4, 0.2, 0.3], [0.36, 0.48, 0.8]);
    of.submechanism("bars", kind);
    let [a, b, c, d] = LOOSE.map(|p| [p[0], p[1], 0.0]);
    let crank = joint(&mut of, arm, Turn, a, Z);
    let coupler = joint(&mut of, crank, Turn, b, Z);
    let rocker = joint(&mut of, arm, Turn, d, Z);
    cut(&mut of, coupler, rocker, c, "xy");
    finish(of, &[crank], &[crank])
}

fn far_centres(of: &mut Description, distance: f64) {
    for inertial in of.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        inertial.origin.xyz = [0.6, -0.5, 0.62].map(|x| x * distance);
    }
}

/// Redundant rows with gaps like those of a rounded file: reported at load if they matter, refused
/// if the gap exceeds rounding.
pub(crate) fn redundant(cases: &mut Cases, effort: &Effort) -> Outcome {
    for (name, plain) in [
        ("four-bar of three rows", four_bar(LOOSE, Kind::Numerical, "xyz")?),
        ("four-bar of six rows", four_bar(LOOSE, Kind::Numerical, "xyzabc")?),
        ("parallelogram of six rows", four_bar(RHOMBUS, Kind::Numerical, "xyzabc")?),
        ("Bricard of six rows", bricard(false)?),
        ("Bricard of five rows", bricard(true)?),
    ] {
        for value in with(&[0.0], &powers(effort, -16, -1, 5)) {
            let mut of = plain.clone();
            if let Cut::Placed { successor, .. } = &mut of.submechanisms[0].loops[0].cut {
                successor.xyz[2] += value;
            }
            let at = At { value, method: "numerical" };
            let Some(robot) = cases.load(name, at, of) else { continue };
            let state = State::of(&robot, 0.2)?;
            cases.questions(&robot, value, &state, true, &Method::ALL)?;
            let warned = robot.compiled.warnings.first().map(ToString::to_string);
            let question = Question::inverse(&state, &[Field::TauY, Field::TauU, Field::Lambda]);
            let at = At::of(&robot, value);
            let case = cases.ask(&robot, at, "ID, λ", &question, &Reference::Same)?;
            case.reported += &warned.unwrap_or_default();
        }
    }
    Ok(())
}
