//! Searches and steps in task space (`--tasks`): times by state, from a guess nearby and from zero.
//!
//! Targets are the poses of the hands, and the centre of mass, at random states within the limits
//! of all joints; a guess nearby is 1 mrad from there in each coordinate, one cycle of a kilohertz
//! at 1 rad/s. Each state's time is the least of some rounds.

use std::hint::black_box;
use std::time::Instant;

use fastrand::Rng;
use sarrus_dynamics::{
    Field, FieldSet, Model, Plan, Query, Request, Status, TaskParts, Warnings, Workspace,
};
use sarrus_models::{Options, Source, load};
use sarrus_report::Outcome;
use sarrus_report::robots::within_limits;

use crate::table::{Table, ns};
use Field::*;

const STATES: usize = 200;
const ROUNDS: usize = 15;
/// Distance of a guess nearby, in each coordinate [rad].
const NEAR: f64 = 1e-3;
/// Share of the room between limits for the targets.
const SHARE: f64 = 0.8;
const POSE: TaskParts = TaskParts::POSITION.with(TaskParts::ORIENTATION);

/// A request in task space on a robot.
struct Subject {
    name: &'static str,
    robot: &'static str,
    frames: &'static [&'static str],
    request: Request,
    is_near: bool,
    has_com: bool,
}

const UPPER: (&str, &[&str]) = ("rh5v2_upper_body", &["ALWristRoll_Link"]);
const FULL: (&str, &[&str]) = ("rh5v2_full", &["ALHandRoll_Link", "ARHandRoll_Link"]);

const fn subject(
    name: &'static str,
    (robot, frames): (&'static str, &'static [&'static str]),
    request: Request,
    [is_near, has_com]: [bool; 2],
) -> Subject {
    Subject { name, robot, frames, request, is_near, has_com }
}

const SUBJECTS: [Subject; 6] = [
    subject("one hand, near", UPPER, Request::InverseKinematics, [true, false]),
    subject("one hand, from zero", UPPER, Request::InverseKinematics, [false, false]),
    subject("both hands and centre of mass, near", FULL, Request::InverseKinematics, [true, true]),
    subject("both hands, from zero", FULL, Request::InverseKinematics, [false, false]),
    subject("rates of both hands", FULL, Request::DifferentialInverseKinematics, [true, false]),
    subject("step of both hands", FULL, Request::Step, [true, false]),
];

/// Prints the table.
///
/// # Errors
///
/// A robot that does not load, a plan that is refused.
pub fn run() -> Outcome {
    let mut rows = Vec::new();
    for of in &SUBJECTS {
        let loaded = load(&Source::Bundled(of.robot.to_owned()), &Options::default())?;
        rows.push(of.measure(&loaded.compiled.model)?);
    }
    let table = Table {
        title: "Task space".into(),
        columns: vec!["robot", "request", "ok", "of", "median ns", "p90 ns"],
        n_text: 2,
        rows,
        notes: vec![format!("targets within {SHARE} of the limits; near: {NEAR} rad away")],
    };
    print!("{}", table.text());
    Ok(())
}

impl Subject {
    fn measure(&self, model: &Model<f64>) -> Outcome<Vec<String>> {
        let info = model.info();
        let links: Option<Vec<u16>> = self.frames.iter().map(|of| info.link(of)).collect();
        let links = links.ok_or("a frame is unknown")?;
        let tasks: Vec<(u16, TaskParts)> = links.iter().map(|link| (*link, POSE)).collect();
        let want = FieldSet::of(&[FramePose, Com]);
        let there = Query::new(Request::Kinematics, Y.into(), want).with_frames(&links);
        let there = Plan::new(model, &there)?;
        let given: &[Field] = match (self.request, self.has_com) {
            (Request::InverseKinematics, false) => &[TaskTarget, YGuess],
            (Request::InverseKinematics, true) => &[TaskTarget, ComTarget, YGuess],
            (Request::Step, _) => &[TaskMotion, Y, Yd, Dt],
            _ => &[TaskMotion, Y, Dt],
        };
        let query = Query::new(self.request, FieldSet::of(given), self.request.default_want());
        let plan = Plan::new(model, &query.with_tasks(&tasks))?;
        let mut workspace = Workspace::for_plans(model, [&there, &plan]);
        let mut rng = Rng::with_seed(36);
        let mut inputs = Vec::new();
        while inputs.len() < STATES {
            let y = within_limits(model, || 0.5 + SHARE * (rng.f64() - 0.5));
            let mut poses = vec![0.0; there.want().len()];
            let answer = there.run(model, &mut workspace, &y, &mut poses);
            if answer.status != Status::Ok || answer.warnings.contains(Warnings::LIMITS_EXCEEDED) {
                continue;
            }
            inputs.push(self.input(&plan, &y, &poses, &there));
        }
        let mut output = vec![0.0; plan.want().len()];
        let mut least = vec![f64::INFINITY; STATES];
        let mut ok = 0;
        for round in 0..ROUNDS {
            for (input, least) in inputs.iter().zip(&mut least) {
                let start = Instant::now();
                let answer = plan.run(model, &mut workspace, black_box(input), &mut output);
                *least = least.min(start.elapsed().as_nanos() as f64);
                ok += usize::from(round == 0 && answer.status == Status::Ok);
            }
        }
        least.sort_unstable_by(f64::total_cmp);
        let of = |share: f64| ns(least[(share * STATES as f64) as usize]);
        let words = [self.robot, self.name].map(str::to_owned);
        let counts = [ok, STATES].map(|n| n.to_string());
        Ok([&words[..], &counts, &[of(0.5), of(0.9)]].concat())
    }

    /// The packed input for the poses at y.
    fn input(&self, plan: &Plan, y: &[f64], found: &[f64], there: &Plan) -> Vec<f64> {
        let mut input = vec![0.0; plan.given().len()];
        let of = |field| there.want().slot(field).map(|slot| slot.range()).unwrap_or_default();
        let mut give = |field, numbers: &[f64]| {
            if let Some(slot) = plan.given().slot(field) {
                input[slot.range()].copy_from_slice(numbers);
            }
        };
        let poses = found[of(FramePose)].chunks(7);
        let target = poses.flat_map(|pose| [pose, &[0.0, 0.0, 1.0, 1.0]].concat());
        give(TaskTarget, &target.collect::<Vec<_>>());
        give(ComTarget, &found[of(Com)]);
        let near = if self.is_near { 1.0 } else { 0.0 };
        let guess: Vec<f64> = y.iter().map(|y| near * (y - NEAR)).collect();
        give(YGuess, &guess);
        give(Y, y);
        give(Yd, &vec![0.0; y.len()]);
        give(Dt, &[1e-3]);
        // 0.1 rad/s and m/s along each axis, or 0.1 of the accelerations
        let motion = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 1.0].repeat(self.frames.len());
        give(TaskMotion, &motion);
        input
    }
}
