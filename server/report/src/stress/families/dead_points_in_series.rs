//! Dead points in series: each stage is near one, and their ratios multiply.

use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::harness::{At, Cases, Question, Robot, State};
use crate::stress::mechanisms::trains::{Draw, closed_forms, spatial, train};

use Field::*;

/// The train of this seed, with every question.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(seed);
    let stages = 1 + random.below(5);
    // some as regular as they can be, all angles equal
    let regular = random.below(3) == 0;
    let delta = random.scale(0.005, 0.1);
    let draw = Draw {
        stages,
        angle: if regular { [delta, delta] } else { [0.005, 0.1] },
        lengths: !regular,
        sliders: !regular && random.coin(),
        turned: random.coin(),
        tilted: random.below(4) == 0,
    };
    let (kind, train) = match seed % 6 {
        4 => ("closed forms", closed_forms(&mut random, stages)?),
        5 => ("rods in space", spatial(&mut random, stages)?),
        _ => ("stages", train(&mut random, draw)?),
    };
    let turned = if train.y.iter().all(|y| *y == 0.0) { "" } else { ", turned" };
    let name = format!("{stages} {kind}{turned}, seed {seed}");
    let at = At { value: train.sines, method: "-" };
    let Some(robot) = cases.load(&name, at, train.description) else {
        return Ok(());
    };
    // within the reach of the last stage
    let reach = random.one_of(&[0.0, 0.2]) * train.least * train.sines;
    let rest = random.below(4) == 0;
    let mut draw = |size: f64| train.y.iter().map(|_| size * random.next()).collect::<Vec<_>>();
    let y = draw(reach).iter().zip(&train.y).map(|(off, y)| y + off).collect();
    let yd = draw(if rest { 0.0 } else { 1.0 });
    let ydd = draw(1.0);
    let mut state = State { y, yd, ydd, ..State::default() };
    state.forces(&robot)?;
    everything(cases, &robot, train.sines, &state)
}

/// Every level of motion and every space of forces, as separate questions and all at once.
pub(crate) fn everything(cases: &mut Cases, robot: &Robot, value: f64, state: &State) -> Outcome {
    let at = At { value, method: robot.closures() };
    let motion = [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)];
    let guess = state.guess.iter().map(|guess| (QGuess, guess));
    let given = |n: usize| -> Vec<(Field, Vec<f64>)> {
        let motion = motion[..n].iter().copied();
        motion.chain(guess.clone()).map(|(field, numbers)| (field, numbers.clone())).collect()
    };
    let kinematics = Request::Kinematics;
    let inverse = Request::InverseDynamics;
    for (asked, request, n, want) in [
        ("pose", kinematics, 1, &[Q, U][..]),
        ("velocity", kinematics, 2, &[Qd, Ud]),
        ("velocity, G", kinematics, 2, &[Q, Qd, U, Ud, G, GU, K]),
        ("acceleration", kinematics, 3, &[Qdd, Udd]),
        ("acceleration, G", kinematics, 3, &[Qd, Qdd, Ud, Udd, G, GBias, GU, GUBias, K, KBias]),
        ("ID", inverse, 3, &[TauU]),
        ("ID, tau_y", inverse, 3, &[TauY]),
        ("ID, all", inverse, 3, &[TauY, TauU, TauQ, Qdd, Lambda, MY, CY]),
    ] {
        cases.judge(robot, at, asked, &Question::new(request, given(n), want))?;
    }
    let last = robot.description.links.len() - 1;
    let want = [FramePose, FrameTwist, FrameAcc, JacobianTree, JacobianIndependent];
    let mut frames = Question::new(kinematics, given(3), &want);
    frames.frames = vec![u16::try_from(last)?];
    cases.judge(robot, at, "frames", &frames)?;
    let all = Question::inverse(state, &[TauU]).run(&robot.compiled.model)?;
    let tau_u: Vec<f64> =
        all.get(TauU).iter().map(|x| if x.is_finite() { 1.3 * x } else { 1.0 }).collect();
    let ones = vec![1.0; tau_u.len()];
    for (asked, force, want) in [
        ("FD of unit tau_u", (TauU, &ones), &[Ydd][..]),
        ("FD", (TauY, &state.tau_y), &[Ydd]),
        ("FD of tau_u", (TauU, &tau_u), &[Ydd]),
        ("FD of tau_u, all", (TauU, &tau_u), &[Ydd, Qd, Qdd, Udd, Lambda, MY, CY]),
    ] {
        let given = given(2).into_iter().chain([(force.0, force.1.clone())]).collect();
        cases.judge(robot, at, asked, &Question::new(Request::ForwardDynamics, given, want))?;
    }
    Ok(())
}
