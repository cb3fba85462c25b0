//! A plan computes only the parts that its outputs depend on: its numbers keep their bits, and a
//! skipped part cannot fail.

use sarrus_dynamics::{Answer, Field, FieldSet, Model, Plan, Query, Request, Status};
use sarrus_dynamics::{Warnings, Workspace};
use sarrus_proto::Rows;
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::plans::{every_plan, input, motion};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

fn answer(model: &Model, workspace: &mut Workspace<f64>, plan: &Plan, input: &[f64]) -> Reply {
    let mut numbers = vec![0.1; plan.want().len()];
    let answer = plan.run(model, workspace, input, &mut numbers);
    Reply { answer, numbers }
}

struct Reply {
    answer: Answer,
    numbers: Vec<f64>,
}

/// The numbers of a smaller query, taken from the answer to a larger one with the same inputs.
fn part(model: &Model, large: (&Plan, &[f64]), small: &Plan, frames: &[usize]) -> Vec<f64> {
    let (large, numbers) = large;
    let rows = Rows::of(small.query(), model.info());
    let mut part = Vec::new();
    for slot in small.want().slots() {
        let whole = large.want().slot(slot.field).unwrap();
        let of_row = |row: usize| {
            let at = whole.offset + row * whole.columns;
            &numbers[at..at + whole.columns]
        };
        let picked: Vec<usize> = match slot.field {
            field if !field.has_joint_rows() || !slot.is_matrix() && field.is_second() => {
                let of_frames = slot.rows != whole.rows || field >= Field::FramePose;
                let per_frame = match field {
                    Field::FramePose | Field::FrameTwist | Field::FrameAcc | Field::JdYd => 1,
                    Field::JacobianTree
                    | Field::JacobianIndependent
                    | Field::JacobianActuator
                    | Field::DjacobianDy => 6,
                    _ => 0,
                };
                if of_frames && per_frame > 0 {
                    let rows = |k: &usize| k * per_frame..(k + 1) * per_frame;
                    frames.iter().flat_map(rows).collect()
                } else {
                    (0..whole.rows).collect()
                }
            }
            Field::Y | Field::NearestY => rows.qy.clone(),
            Field::Q => rows.q.clone(),
            Field::U | Field::Ud | Field::Udd | Field::TauU | Field::GU | Field::GUBias => {
                rows.u.clone()
            }
            Field::DtauUDy | Field::DtauUDyd | Field::RegressorU => rows.u.clone(),
            Field::Qd | Field::Qdd | Field::TauQ | Field::G | Field::GBias | Field::Limits => {
                rows.v.clone()
            }
            Field::DgammaDtheta => {
                let n_v = model.sizes().n_v;
                let of_frames = frames.iter().flat_map(|k| 6 * k..6 * k + 6);
                rows.v.iter().copied().chain(of_frames.map(|row| n_v + row)).collect()
            }
            Field::Gd | Field::DqddDy | Field::DgBiasDyd => rows.v.clone(),
            _ => rows.vy.clone(),
        };
        part.extend(picked.into_iter().flat_map(of_row));
    }
    part
}

/// A smaller query with some of the fields, joints and frames. It wants no Newton steps and no
/// distance from the given values, since these count only the closures that the query needs, and no
/// figures of its joints together.
fn smaller(model: &Model, large: &Query, seeded: &mut Seeded) -> (Query, Vec<usize>) {
    let frames: Vec<usize> = (0..large.frames().len()).filter(|_| seeded.chance(0.6)).collect();
    let links: Vec<u16> = frames.iter().map(|k| large.frames()[*k]).collect();
    let counted = [
        Field::Iterations,
        Field::Projection,
        Field::TorqueVertices,
        Field::TorqueVerticesNet,
        Field::SpeedVertices,
        Field::Margin,
        Field::Clip,
        Field::Binding,
    ];
    let share = [0.1, 0.4, 0.9][seeded.below(3)];
    // of all frames together
    use Field::{TaskBias, TaskGravity, TaskInertia, TaskRank};
    let together = [TaskInertia, TaskBias, TaskGravity, TaskRank];
    let are_all = links.len() == large.frames().len();
    let is_counted =
        |field: &Field| counted.contains(field) || !are_all && together.contains(field);
    let want = large.want.iter().filter(|field| !is_counted(field));
    let want: FieldSet = want.filter(|_| seeded.chance(share)).collect();
    // forces are compared with their limits where they are wanted
    let forces = |field: &Field| *field != Field::Limits || want.has(Field::TauU);
    let want: FieldSet = want.iter().filter(forces).collect();
    let mut query = Query { want, n_frames: 0, ..*large }.with_frames(&links);
    if seeded.chance(0.7) {
        let joints: Vec<_> = model.info().joints().collect();
        let first = seeded.below(joints.len());
        let many = if seeded.chance(0.5) { 1 } else { 1 + seeded.below(6) };
        let picked = joints.iter().skip(first).take(many);
        query = query.with_joints(picked.flat_map(|joint| joint.v.clone()).map(|v| v as u16));
    }
    (query, frames)
}

#[test]
fn an_answer_in_part_has_the_bits_of_the_whole() {
    let mut compared = 0;
    let mut numbers_compared = 0;
    for case in robots().iter().take(24).chain(robots().iter().skip(24).step_by(5)) {
        let model = &case.compiled.model;
        let mut seeded = Seeded::new(case.seed + 77);
        let mut robot = Robot::new(model.clone());
        let mut workspace = Workspace::new(model);
        // plans that want every field at once
        let plans = every_plan(model, &mut seeded);
        let motions = [0, 1].map(|k| motion(&mut robot, &case.state(k)));
        for large in plans.iter().filter(|plan| plan.query().want.iter().count() > 8) {
            for motion in &motions {
                let input = input(case, large, motion, &mut seeded);
                let full = answer(model, &mut workspace, large, &input);
                if full.answer.status != Status::Ok {
                    continue;
                }
                for _ in 0..4 {
                    let (query, frames) = smaller(model, large.query(), &mut seeded);
                    let Ok(small) = Plan::new(model, &query) else { continue };
                    let found = answer(model, &mut workspace, &small, &input);
                    let expected = part(model, (large, &full.numbers), &small, &frames);
                    assert_eq!(found.answer.status, Status::Ok, "{}: {query:?}", case.name);
                    // lost digits are relative to the largest wanted number
                    let known = full.answer.warnings.0 | Warnings::ILL_CONDITIONED.0;
                    let more = found.answer.warnings.0 & !known;
                    assert_eq!(more, 0, "{}: warnings, {query:?}", case.name);
                    assert_eq!(found.numbers.len(), expected.len(), "{}", case.name);
                    for slot in small.want().slots() {
                        let a = &found.numbers[slot.range()];
                        let b = &expected[slot.range()];
                        let same = a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
                        assert!(
                            same,
                            "{}: {}: {a:?} instead of {b:?}: {query:?}",
                            case.name,
                            slot.field.name()
                        );
                        numbers_compared += a.len();
                    }
                    compared += 1;
                }
            }
        }
    }
    println!("{compared} smaller queries, {numbers_compared} numbers");
    assert!(compared > 2000 && numbers_compared > 50_000);
}

#[test]
fn gravity_alone_has_the_bits_of_a_robot_at_rest() {
    use Field::*;
    let want = [TauQ, TauY, TauU, TauUnactuated, CY];
    let mut compared = 0;
    for case in robots().iter().step_by(3) {
        let mut robot = Robot::new(case.compiled.model.clone());
        for k in 0..5 {
            let state = case.state(k);
            let zero = vec![0.0; state.yd.len()];
            let request = Request::InverseDynamics;
            let rest = robot.ask(request, &[(Y, &state.y)], &want);
            let still = robot.ask(request, &[(Y, &state.y), (Yd, &zero), (Ydd, &zero)], &want);
            assert_eq!(rest.answer.status, still.answer.status, "{}", case.name);
            if rest.answer.status != Status::Ok {
                continue;
            }
            for field in want {
                let pairs = rest.get(field).iter().zip(still.get(field));
                for (a, b) in pairs {
                    assert_eq!(a.to_bits(), b.to_bits(), "{}: {}", case.name, field.name());
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 5000, "{compared}");
}

#[test]
fn what_is_left_out_cannot_fail() {
    use Field::*;
    let case = Case::bundled("rh5v2_full");
    let model = &case.compiled.model;
    let mut robot = Robot::new(model.clone());
    let of = |side: &str| -> Vec<u16> {
        let joints = model.info().joints().filter(|joint| joint.name.starts_with(side));
        joints.flat_map(|joint| joint.v).map(|v| v as u16).collect()
    };
    let state = case.state::<f64>(1);
    // a joint of one arm at an unreachable position
    let names = model.independent_names();
    let of_arm = (0..names.len()).filter(|k| names[*k].starts_with("AL"));
    let broken = of_arm
        .flat_map(|k| [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].map(|x| (k, x)))
        .map(|(k, x)| {
            let mut y = state.y.clone();
            y[k] = x;
            y
        })
        .find(|y| robot.ask(Request::Kinematics, &[(Y, y)], &[Q]).answer.status != Status::Ok)
        .unwrap();
    for (request, want) in [
        (Request::Kinematics, FieldSet::of(&[Q, U, G, Limits])),
        (Request::InverseDynamics, FieldSet::of(&[TauY, TauU, CY])),
    ] {
        let base = Query::new(request, FieldSet::EMPTY, want);
        let ask = |robot: &mut Robot<f64>, query: Query, y: &[f64]| {
            robot.ask_for(query, &[(Y, y), (Yd, &state.yd)])
        };
        assert_ne!(ask(&mut robot, base, &broken).answer.status, Status::Ok);
        assert_ne!(ask(&mut robot, base.with_joints(of("AL")), &broken).answer.status, Status::Ok);
        let other = base.with_joints(of("AR"));
        let good = ask(&mut robot, other, &state.y).ok();
        let still_good = ask(&mut robot, other, &broken).ok();
        for field in want.iter() {
            assert_eq!(good.get(field), still_good.get(field), "{}", field.name());
        }
    }
    // outputs of the whole robot depend on all of its closures
    let figures = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[Residual]));
    assert_ne!(robot.ask_for(figures, &[(Y, &broken)]).answer.status, Status::Ok);
    let nothing = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::EMPTY);
    assert_ne!(robot.ask_for(nothing, &[(Y, &broken)]).answer.status, Status::Ok);
}
