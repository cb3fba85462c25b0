//! One step of a motion: velocities and accelerations of tasks within hard limits, by the
//! conditions of their optimum, and looked at again by kinematics and dynamics.

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, JointLimits, LinkId, Model, ModelInfo, Plan, Query,
    Request, Status, TaskParts, Warnings, Workspace,
};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::largest;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{matrix_product, minus, plus, product, transposed};

use crate::allocation::calls;
use crate::tasks::{drawn, solved};

use Field::*;

const TWIST: TaskParts = TaskParts::POSITION.with(TaskParts::ORIENTATION);
const HELD: TaskParts = TWIST.with(TaskParts::HELD);
const DT: f64 = 0.01;

/// A robot and the tasks of its steps.
struct Moving {
    robot: Robot<f64>,
    tasks: Vec<(u16, TaskParts)>,
}

impl Moving {
    fn new(model: &Model<f64>, tasks: &[(&str, TaskParts)]) -> Moving {
        let of = |name: &str| model.info().link(name).unwrap();
        let tasks = tasks.iter().map(|(name, parts)| (of(name), *parts)).collect();
        Moving { robot: Robot::new(model.clone()), tasks }
    }

    fn info(&self) -> &ModelInfo {
        self.robot.model.info()
    }

    fn ask(&mut self, request: Request, motion: &[f64], given: &[(Field, &[f64])]) -> Fields<f64> {
        let base = Query::new(request, FieldSet::EMPTY, request.default_want());
        let motion: &[(Field, &[f64])] = &[(TaskMotion, motion), (Dt, &[DT])];
        self.robot.ask_for(base.with_tasks(&self.tasks), &[given, motion].concat())
    }

    /// An ordinary request with the frames of the tasks.
    fn plain(
        &mut self,
        request: Request,
        given: &[(Field, &[f64])],
        want: &[Field],
    ) -> Fields<f64> {
        let links: Vec<u16> = self.tasks.iter().map(|(link, _)| *link).collect();
        let base = Query::new(request, FieldSet::EMPTY, FieldSet::of(want));
        self.robot.ask_for(base.with_frames(&links), given)
    }
}

/// Bounds of the rate of each joint, or of its acceleration where it moves at `qd`: lower and upper
/// with their columns of `binding`.
fn bounds(info: &ModelInfo, v: usize, q: &[f64], qd: Option<&[f64]>) -> [(f64, usize); 2] {
    let none = JointLimits { lower: None, upper: None, velocity: None, effort: None };
    let limits = info.limits[v].unwrap_or(none);
    let at = info.tree_q.iter().position(|name| *name == info.tree[v]);
    let q = at.map_or(f64::NAN, |at| q[at]);
    let stroke = [limits.lower.map(|x| x - q), limits.upper.map(|x| x - q)];
    let speed = [limits.velocity.map(|x| -x), limits.velocity];
    [0, 1].map(|side| {
        let sign = if side == 0 { -1.0 } else { 1.0 };
        let [stroke, speed] = match qd {
            None => [stroke[side].map(|x| x / DT), speed[side]],
            Some(qd) => [
                stroke[side].map(|x| 2.0 * (x - DT * qd[v]) / (DT * DT)),
                speed[side].map(|x| (x - qd[v]) / DT),
            ],
        };
        let [stroke, speed] = [stroke, speed].map(|x| x.unwrap_or(sign * f64::INFINITY));
        if sign * stroke < sign * speed { (stroke, 0) } else { (speed, 1) }
    })
}

/// Multipliers λ of the least |c + Aᵀ λ|, and the rest; rows of A have n numbers.
fn multipliers(A: &[f64], c: &[f64]) -> (Vec<f64>, f64) {
    let n = c.len();
    let m = A.len() / n;
    let At: Vec<f64> = (0..n * m).map(|at| A[at % m * n + at / m]).collect();
    let of = product(A, c);
    let lambda = if m == 0 { Vec::new() } else { solved(&matrix_product(A, &At, n, m), &of, m, 1) };
    let lambda: Vec<f64> = lambda.iter().map(|x| -x).collect();
    let left = if m == 0 { c.to_vec() } else { plus(c, &transposed(A, &lambda, n)) };
    (lambda, largest(&left))
}

#[test]
fn velocities_of_tasks_are_the_optimum_inside_all_limits() {
    let mut active = 0;
    let mut reached = 0;
    for (name, frames, states) in [
        ("rh5v2_upper_body", &["ALWristRoll_Link", "ARWristRoll_Link"][..], 40),
        ("stewart", &["HipRotZ_Link"][..], 20),
    ] {
        let case = Case::bundled(name);
        let tasks: Vec<_> = frames.iter().map(|frame| (*frame, TWIST)).collect();
        let mut moving = Moving::new(&case.compiled.model, &tasks);
        let info = moving.info().clone();
        let n = info.sizes.n_vy;
        let mut seeded = Seeded::new(361);
        for state in 0..states {
            let y = drawn(&case.compiled.model, &mut seeded, 0.98);
            let want = [Q, G, JacobianIndependent];
            let there = moving.plain(Request::Kinematics, &[(Y, &y)], &want);
            if there.answer.status != Status::Ok
                || there.answer.warnings.contains(Warnings::LIMITS_EXCEEDED)
            {
                continue;
            }
            let size = [0.05, 1.0, 20.0][state % 3];
            let motion: Vec<f64> =
                frames.iter().flat_map(|_| [seeded.numbers(6, size), vec![2.0]].concat()).collect();
            let x = moving.ask(Request::DifferentialInverseKinematics, &motion, &[(Y, &y)]).ok();
            let yd = x.get(Yd);
            let rates = product(there.get(G), yd);
            // the limits hold, and those that are met are named
            let mut rows = Vec::new();
            for v in 0..info.tree.len() {
                let [lower, upper] = bounds(&info, v, there.get(Q), None);
                let off = 1e-9 * (1.0 + rates[v].abs());
                assert!(lower.0 - off <= rates[v] && rates[v] <= upper.0 + off, "{name}: {v}");
                for (bound, sign) in [(lower, -1.0), (upper, 1.0)] {
                    if x.get(Binding)[3 * v + bound.1] == sign {
                        assert!((rates[v] - bound.0).abs() <= off, "{name}: {}", info.tree[v]);
                        rows.extend(there.get(G)[v * n..][..n].iter().map(|g| sign * g));
                        active += 1;
                    }
                }
            }
            // the rest of the errors is held by these limits, and pushed against them
            let J = there.get(JacobianIndependent);
            let wanted: Vec<f64> =
                motion.chunks(7).flat_map(|of| of[..6].iter().copied()).collect();
            let error = minus(&product(J, yd), &wanted);
            let gradient = transposed(J, &error, n);
            let (lambda, left) = multipliers(&rows, &gradient);
            let scale = 1e-6 * (1.0 + largest(&gradient) + largest(yd));
            assert!(left < scale, "{name}: {left:e} beside {scale:e}");
            assert!(lambda.iter().all(|x| *x > -scale), "{name}: {lambda:?}");
            for (k, of) in error.chunks(6).enumerate() {
                let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let residual = norm(&of[..3]).max(norm(&of[3..]));
                assert!((x.get(TaskResidual)[k] - residual).abs() < 1e-9 * (1.0 + residual));
            }
            reached += usize::from(largest(&error) < 1e-6 * size);
        }
    }
    assert!(active > 20 && reached > 5, "{active} active limits, {reached} reached");
}

/// A trunk that floats on two legs of six joints.
fn walker() -> Model<f64> {
    let mut robot = DescriptionBuilder::new("walker");
    let trunk = robot.floating("trunk", LinkId::BASE);
    let trunk = trunk.inertial(Inertial::cuboid(20.0, [0.0, 0.0, 0.2], [0.3, 0.4, 0.6])).link();
    for (side, y) in [("l", 0.1), ("r", -0.1)] {
        let mut link = trunk;
        for (name, axis, at) in [
            ("yaw", [0.0, 0.0, 1.0], [0.0, y, 0.0]),
            ("roll", [1.0, 0.0, 0.0], [0.0; 3]),
            ("pitch", [0.0, 1.0, 0.0], [0.0; 3]),
            ("knee", [0.0, 1.0, 0.0], [0.0, 0.0, -0.4]),
            ("ankle", [0.0, 1.0, 0.0], [0.0, 0.0, -0.4]),
            ("foot", [1.0, 0.0, 0.0], [0.0; 3]),
        ] {
            let joint = robot.revolute(format!("{side}_{name}"), link, axis).origin(at);
            let bob = Inertial::sphere(1.0, [0.0, 0.0, -0.1], 0.05);
            link = joint
                .limits(-2.5, 2.5)
                .velocity_limit(8.0)
                .effort_limit(150.0)
                .inertial(bob)
                .link();
        }
    }
    robot.compile().unwrap().model
}

#[test]
fn forces_of_a_step_give_its_acceleration_and_keep_all_limits() {
    let case = Case::bundled("rh5v2_upper_body");
    let walker = walker();
    let feet = [("trunk_link", TWIST), ("l_foot_link", HELD), ("r_foot_link", HELD)];
    let hands = [("ALWristRoll_Link", TWIST), ("ARWristRoll_Link", TWIST)];
    let mut active = [0; 3];
    for (model, tasks) in [(&case.compiled.model, &hands[..]), (&walker, &feet[..])] {
        let mut moving = Moving::new(model, tasks);
        let info = moving.info().clone();
        let walks = info.sizes.n_u < info.sizes.n_vy;
        let mut seeded = Seeded::new(362);
        for state in 0..30 {
            let mut y = drawn(model, &mut seeded, 0.98);
            let mut yd = seeded.numbers(info.sizes.n_vy, 0.5);
            // one joint just before its stop
            let k = seeded.below(y.len());
            let v = info.tree.iter().position(|name| *name == info.independent_q[k]);
            if let Some(upper) = v.and_then(|v| info.limits[v]?.upper) {
                y[k] = upper - 1e-4;
            }
            if walks {
                // knees bent alike, at rest: both feet can be held
                y.fill(0.0);
                y[6] = 1.0;
                let bend = seeded.within(0.2, 0.8);
                for leg in [7, 13] {
                    [y[leg + 2], y[leg + 3], y[leg + 4]] = [-bend, 2.0 * bend, -bend];
                }
                yd.fill(0.0);
            }
            let position: [(Field, &[f64]); 2] = [(Y, &y), (Yd, &yd)];
            let want = [Q, Qd, G, GBias, JacobianIndependent, JdYd];
            let there = moving.plain(Request::Kinematics, &position, &want);
            if there.answer.status != Status::Ok
                || there.answer.warnings.contains(Warnings::LIMITS_EXCEEDED)
            {
                continue;
            }
            let size = [0.5, 3.0, 100.0][state % 3];
            let mut motion = vec![0.0; 7 * tasks.len()];
            for (of, (_, parts)) in motion.chunks_mut(7).zip(tasks) {
                if !parts.contains(TaskParts::HELD) {
                    of[..6].copy_from_slice(&seeded.numbers(6, size));
                }
                of[6] = 1.0;
            }
            let x = moving.ask(Request::Step, &motion, &position);
            if x.answer.status == Status::Infeasible {
                assert!(x.get(Ydd).iter().all(|x| x.is_nan()));
                assert!(x.get(Binding).iter().any(|x| *x != 0.0), "nothing is named");
                active[2] += 1;
                continue;
            }
            let x = x.ok();
            // dynamics with these forces has this acceleration
            let held: Vec<usize> =
                (0..tasks.len()).filter(|k| tasks[*k].1.contains(TaskParts::HELD)).collect();
            let links: Vec<u16> = held.iter().map(|k| moving.tasks[*k].0).collect();
            let wrenches: Vec<f64> =
                held.iter().flat_map(|k| x.get(ContactForces)[6 * k..][..6].to_vec()).collect();
            let base = Query::new(Request::ForwardDynamics, FieldSet::EMPTY, Ydd.into());
            let given = [&position[..], &[(TauU, x.get(TauU))]].concat();
            let again = match held.is_empty() {
                true => moving.robot.ask_for(base, &given),
                false => {
                    let given = [&given[..], &[(Wrenches, &wrenches)]].concat();
                    moving.robot.ask_for(base.with_wrenches(&links), &given)
                }
            };
            let off = largest(&minus(again.ok().get(Ydd), x.get(Ydd)));
            assert!(off < 1e-6 * (1.0 + largest(x.get(Ydd))), "{}: {off:e}", info.robot);
            // frames move as asked where no residual is told, held ones not at all
            let J = there.get(JacobianIndependent);
            let acceleration = plus(&product(J, x.get(Ydd)), there.get(JdYd));
            for (k, of) in acceleration.chunks(6).enumerate() {
                let away = largest(&minus(of, &motion[7 * k..][..6]));
                match held.contains(&k) {
                    true => assert!(away < 1e-6 && x.get(TaskResidual)[k].is_nan()),
                    false => assert!(away <= x.get(TaskResidual)[k] + 1e-9, "{away:e}"),
                }
            }
            // limits of joints and actuators
            let tree = plus(&product(there.get(G), x.get(Ydd)), there.get(GBias));
            for v in 0..info.tree.len() {
                let bounds = bounds(&info, v, there.get(Q), Some(there.get(Qd)));
                let off = 1e-7 * (1.0 + tree[v].abs());
                let [lower, upper] = bounds;
                assert!(lower.0 - off <= tree[v] && tree[v] <= upper.0 + off, "{}", info.tree[v]);
                for (bound, sign) in [(lower, -1.0), (upper, 1.0)] {
                    if x.get(Binding)[3 * v + bound.1] == sign {
                        assert!((tree[v] - bound.0).abs() < off, "{}", info.tree[v]);
                        active[0] += 1;
                    }
                }
            }
            for (u, name) in info.active.iter().enumerate() {
                let v = info.tree.iter().position(|of| of == name).unwrap();
                let effort = info.limits[v].and_then(|of| of.effort).unwrap_or(f64::INFINITY);
                let tau = x.get(TauU)[u];
                assert!(tau.abs() <= effort * (1.0 + 1e-9), "{name}: {tau} of {effort}");
                let side = x.get(Binding)[3 * v + 2];
                if side != 0.0 {
                    assert!((tau - side * effort).abs() < 1e-7 * effort, "{name}");
                    active[1] += 1;
                }
            }
        }
    }
    assert!(active[0] > 1 && active[1] > 20, "{active:?} active limits");
}

#[test]
fn limits_that_contradict_are_named() {
    let arm = |effort: f64| {
        let mut robot = DescriptionBuilder::new("arm");
        let axis = [0.0, 1.0, 0.0];
        let bob = Inertial::point(1.0, [1.0, 0.0, 0.0]);
        let first = robot.revolute("a", LinkId::BASE, axis).limits(-1.0, 1.0).velocity_limit(2.0);
        let first = first.effort_limit(5.0).inertial(bob).link();
        let second = robot.revolute("b", first, axis).origin([1.0, 0.0, 0.0]).inertial(bob);
        let second = second.limits(-1.0, 1.0).velocity_limit(2.0).effort_limit(effort).link();
        robot.fixed("c", second).origin([1.0, 0.0, 0.0]).link_name("tip");
        robot.compile().unwrap().model
    };
    let model = arm(50.0);
    let named = |x: &Fields<f64>| -> Vec<usize> {
        let binding = x.get(Binding);
        (0..binding.len()).filter(|k| binding[*k] != 0.0).collect()
    };
    // a held frame that no allowed velocity moves so fast
    let mut moving = Moving::new(&model, &[("b_link", HELD)]);
    let request = Request::DifferentialInverseKinematics;
    let turn = |rate: f64| [0.0, rate, 0.0, 0.0, 0.0, -rate, 1.0];
    let x = moving.ask(request, &turn(1.5), &[(Y, &[0.0, 0.0])]).ok();
    assert!((x.get(Yd)[0] - 1.5).abs() < 1e-9, "{:?}", x.get(Yd));
    let x = moving.ask(request, &turn(2.5), &[(Y, &[0.0, 0.0])]);
    assert_eq!(x.answer.status, Status::Infeasible);
    assert_eq!(named(&x), [1]);
    // gravity against a weak motor: at its stop a joint cannot be slowed down
    let mut moving = Moving::new(&model, &[("tip", TWIST)]);
    let still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let x = moving.ask(Request::Step, &still, &[(Y, &[0.9, 0.0]), (Yd, &[0.0, 0.0])]).ok();
    assert!((x.get(TauU)[0].abs() - 5.0).abs() < 1e-9, "{:?}", x.get(TauU));
    let mut weak = Moving::new(&arm(1.0), &[("tip", TWIST)]);
    let x = weak.ask(Request::Step, &still, &[(Y, &[0.9999999, 0.0]), (Yd, &[0.1, 0.0])]);
    assert_eq!(x.answer.status, Status::Infeasible);
    assert!(named(&x).contains(&0) && named(&x).contains(&2), "{:?}", named(&x));
    assert!(x.get(TauU).iter().all(|x| x.is_nan()));
    // faster than allowed and beyond its stop at once
    let x = moving.ask(request, &still, &[(Y, &[1.5, 0.0])]);
    assert_eq!(x.answer.status, Status::Infeasible);
    assert_eq!(named(&x), [0, 1]);
}

#[test]
fn a_task_of_the_second_level_takes_what_the_first_leaves() {
    let case = Case::bundled("rh5v2_upper_body");
    let second = TaskParts::ORIENTATION.with(TaskParts::SECOND);
    let frames = [("ALWristRoll_Link", TaskParts::POSITION), ("ALWristRoll_Link", second)];
    let mut moving = Moving::new(&case.compiled.model, &frames);
    let y = drawn(&case.compiled.model, &mut Seeded::new(5), 0.3);
    let motion: Vec<f64> =
        [[9.0, 9.0, 9.0, 0.1, 0.0, -0.1, 1.0], [0.2, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]].concat();
    let x = moving.ask(Request::DifferentialInverseKinematics, &motion, &[(Y, &y)]).ok();
    assert!(x.get(TaskResidual)[..2].iter().all(|x| *x < 1e-6), "{:?}", x.get(TaskResidual));
    // the preferred velocity is kept where tasks leave room, and is the answer without tasks
    let preferred = vec![0.01; y.len()];
    let mut idle = Moving::new(&case.compiled.model, &[]);
    let base = Query::new(Request::DifferentialInverseKinematics, FieldSet::EMPTY, Yd.into());
    let given: [(Field, &[f64]); 3] = [(Y, &y), (Dt, &[DT]), (Yd, &preferred)];
    let x = idle.robot.ask_for(base, &given).ok();
    assert!(largest(&minus(x.get(Yd), &preferred)) < 1e-9);
}

#[test]
fn a_step_allocates_nothing_and_repeats_its_bits() {
    let model = walker();
    let tasks = [("trunk_link", TWIST), ("l_foot_link", HELD), ("r_foot_link", HELD)];
    let of = |name: &str| model.info().link(name).unwrap();
    let tasks: Vec<_> = tasks.iter().map(|(name, parts)| (of(name), *parts)).collect();
    let query = Query::new(Request::Step, FieldSet::of(&[Y, Yd, Dt]), Request::Step.default_want());
    let plan = Plan::new(&model, &query.with_tasks(&tasks)).unwrap();
    let mut input = vec![0.0; plan.given().len()];
    input[plan.given().slot(Y).unwrap().range()][6] = 1.0;
    input[plan.given().slot(Dt).unwrap().range()][0] = DT;
    input[plan.given().slot(TaskMotion).unwrap().range()][6] = 1.0;
    let run = |workspace: &mut Workspace<f64>| {
        let mut output = vec![0.0; plan.want().len()];
        let before = calls();
        let answer = plan.run(&model, workspace, &input, &mut output);
        assert_eq!(calls(), before, "a step allocates");
        (answer, output.iter().map(|x| x.to_bits()).collect::<Vec<u64>>())
    };
    let mut workspace = Workspace::new(&model);
    let first = run(&mut workspace);
    assert_eq!(first.0.status, Status::Ok);
    assert_eq!(run(&mut workspace), first);
    assert_eq!(run(&mut Workspace::for_plans(&model, [&plan])), first);
}

#[test]
fn malformed_steps_are_refused() {
    let model = walker();
    let foot = model.info().link("l_foot_link").unwrap();
    let base = |request: Request, parts: TaskParts| {
        Query::new(request, FieldSet::of(&[Y, Dt]), request.default_want())
            .with_tasks(&[(foot, parts)])
    };
    let step = base(Request::Step, TWIST);
    let axis = TaskParts::AXIS;
    let [diff, ik] = [Request::DifferentialInverseKinematics, Request::InverseKinematics];
    for bad in [
        base(Request::Step, axis),
        base(diff, axis),
        base(diff, HELD.with(TaskParts::SECOND)),
        base(Request::Step, TaskParts(32)),
        Query { given: FieldSet::of(&[TaskTarget]), ..base(ik, HELD) },
        Query { given: FieldSet::of(&[Y, TaskMotion]), ..step },
        Query { given: FieldSet::of(&[Y, Dt]), ..step },
        Query { relative_to: 2, ..step },
        step.with_tasks(&[(foot, HELD); 5]),
    ] {
        assert!(Plan::new(&model, &bad).is_err(), "{bad:?}");
    }
    let mut moving = Moving::new(&model, &[("l_foot_link", TWIST)]);
    let mut y = vec![0.0; model.sizes().n_qy];
    y[6] = 1.0;
    for (motion, dt, status) in [
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], DT, Status::BadRequest),
        ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], 0.0, Status::BadRequest),
        ([0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN, 1.0], DT, Status::NonFiniteInput),
    ] {
        let base = Query::new(Request::Step, FieldSet::EMPTY, Request::Step.default_want());
        let given: [(Field, &[f64]); 3] = [(Y, &y), (TaskMotion, &motion), (Dt, &[dt])];
        let x = moving.robot.ask_for(base.with_tasks(&moving.tasks), &given);
        assert_eq!(x.answer.status, status);
        assert!(x.get(Ydd).iter().all(|x| x.is_nan()));
    }
}
