//! Task space: inertia and forces of frames by the laws of J and M_y, and positions that reach
//! targets, looked at again by kinematics.

use std::f64::consts::PI;

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Answer, DescriptionBuilder, Field, FieldSet, LinkId, Model, Plan, PlanScalar, Query, Request,
    Status, TaskParts, Warnings, Workspace,
};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{matrix_product, minus, plus, product, transposed};

use crate::allocation::calls;

use Field::*;

const POSE: TaskParts = TaskParts::POSITION.with(TaskParts::ORIENTATION);

/// A⁻¹ B by elimination, A (n × n), B (n × m).
pub(crate) fn solved<T: Real>(A: &[T], B: &[T], n: usize, m: usize) -> Vec<T> {
    let mut A = A.to_vec();
    let mut B = B.to_vec();
    for k in 0..n {
        let p = (k..n).max_by(|i, j| {
            let of = |i: usize| A[i * n + k].to_f64().abs();
            of(*i).total_cmp(&of(*j))
        });
        let p = p.unwrap();
        (0..n).for_each(|j| A.swap(k * n + j, p * n + j));
        (0..m).for_each(|j| B.swap(k * m + j, p * m + j));
        for i in (0..n).filter(|i| *i != k) {
            let l = A[i * n + k] / A[k * n + k];
            for j in 0..n {
                let x = A[k * n + j];
                A[i * n + j] -= l * x;
            }
            for j in 0..m {
                let x = B[k * m + j];
                B[i * m + j] -= l * x;
            }
        }
    }
    (0..n * m).map(|at| B[at] / A[at / m * n + at / m]).collect()
}

fn inertia_on<S: PlanScalar>(case: &Case, model: &Model<S>, ledger: &mut Ledger, scalar: &str) {
    let mut robot = Robot::new(model.clone());
    let state = case.state::<S>(0);
    let n = model.sizes().n_vy;
    let last = model.link_names().len() as u16 - 1;
    let of = |want: &[Field]| {
        Query::new(Request::InverseDynamics, FieldSet::EMPTY, FieldSet::of(want))
            .with_frames(&[last, last / 2])
    };
    let given = [(Y, state.y.as_slice()), (Yd, &state.yd)];
    let want = [MY, CY, JacobianIndependent, JdYd, TaskInertia, TaskBias, TaskGravity, TaskRank];
    let x = robot.ask_for(of(&want), &given);
    if x.answer.status == Status::MassNotPositive {
        return;
    }
    let x = x.ok();
    let rest = robot.ask_for(of(&[CY]), &given[..1]).ok();
    // A = J M_y⁻¹ Jᵀ
    let J = x.get(JacobianIndependent);
    let Jt: Vec<S> = (0..n * 12).map(|at| J[at % 12 * n + at / 12]).collect();
    let A = matrix_product(J, &solved(x.get(MY), &Jt, n, 12), n, 12);
    let inertia = x.get(TaskInertia);
    let [rank, least] = [x.get(TaskRank)[0].to_f64(), x.get(TaskRank)[1].to_f64()];
    assert!((0.0..=12.0).contains(&rank) && rank <= n as f64, "{}: rank {rank}", case.name);
    if least < 1e-6 {
        return;
    }
    let allowed = 1e4 * S::EPSILON / least;
    // the inverse on the range of A, and nothing beside it
    let AL = matrix_product(&A, inertia, 12, 12);
    let what = |law: &str| format!("{law} in {scalar}");
    ledger.compare(&what("A Λ A = A"), case, &matrix_product(&AL, &A, 12, 12), &A, 0.0, allowed);
    let LAL = matrix_product(inertia, &AL, 12, 12);
    ledger.compare(&what("Λ A Λ = Λ"), case, &LAL, inertia, 0.0, allowed);
    let trace = (0..12).fold(S::ZERO, |sum, k| sum + AL[13 * k]);
    ledger.compare(&what("rank"), case, &[trace], &[x.get(TaskRank)[0]], 1.0, allowed);
    // forces of gravity, and all of them
    let bias = |C: &[S]| product(J, &solved(x.get(MY), C, n, 1));
    let p = product(inertia, &bias(rest.get(CY)));
    let both = product(inertia, &minus(&bias(x.get(CY)), x.get(JdYd)));
    let size = largest(&p).max(largest(&both)).max(1.0);
    ledger.compare(&what("p"), case, x.get(TaskGravity), &p, size, allowed);
    let sum = plus(x.get(TaskBias), x.get(TaskGravity));
    ledger.compare(&what("μ + p"), case, &sum, &both, size, allowed);
    // at rest there are no forces of velocities
    let still = robot.ask_for(of(&[TaskBias]), &given[..1]).ok();
    assert!(still.get(TaskBias).iter().all(|x| *x == S::ZERO), "{}", case.name);
}

#[test]
fn inertia_of_frames_is_that_of_their_jacobians() {
    Ledger::over(robots(), |case, ledger| {
        inertia_on(case, &case.compiled.model, ledger, "double");
        inertia_on(case, &case.compiled.exact, ledger, "double-double");
    });
}

/// A frame's force gives it the acceleration Λ⁻¹ (F − μ − p), a platform in loops included.
#[test]
fn forces_of_frames_accelerate_them_by_their_inertia() {
    for (name, link) in [("stewart", "HipRotZ_Link"), ("rh5v2_upper_body", "")] {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        let links = model.link_names();
        let link = links.iter().position(|of| of == link).unwrap_or(links.len() - 1);
        let mut robot = Robot::new(model.clone());
        let state = case.state::<f64>(1);
        let given = [(Y, state.y.as_slice()), (Yd, &state.yd)];
        let base = |request, want: &[Field]| {
            Query::new(request, FieldSet::EMPTY, FieldSet::of(want)).with_frames(&[link as u16])
        };
        let want = [JacobianIndependent, TaskInertia, TaskBias, TaskGravity, TaskRank];
        let x = robot.ask_for(base(Request::InverseDynamics, &want), &given).ok();
        assert_eq!(x.get(TaskRank)[0], 6.0);
        let F = [1.0, -2.0, 0.5, 30.0, -10.0, 20.0];
        let tau_y = transposed(x.get(JacobianIndependent), &F, state.yd.len());
        let forces = [given[0], given[1], (TauY, &tau_y)];
        let moved = robot.ask_for(base(Request::ForwardDynamics, &[FrameAcc]), &forces).ok();
        let of_motion = product(x.get(TaskInertia), moved.get(FrameAcc));
        let back = plus(&plus(&of_motion, x.get(TaskBias)), x.get(TaskGravity));
        let size = largest(&of_motion);
        for (a, b) in back.iter().zip(F) {
            assert!((a - b).abs() < 1e-9 * size.max(100.0), "{name}: {back:?}");
        }
    }
}

/// A robot and the tasks of its searches.
struct Searching {
    robot: Robot<f64>,
    tasks: Vec<(u16, TaskParts)>,
}

impl Searching {
    fn new(model: &Model<f64>, tasks: &[(&str, TaskParts)]) -> Searching {
        let of = |name: &str| model.info().link(name).unwrap();
        let tasks = tasks.iter().map(|(name, parts)| (of(name), *parts)).collect();
        Searching { robot: Robot::new(model.clone()), tasks }
    }

    /// Poses of the frames and the wanted fields, at y.
    fn at(&mut self, y: &[f64], want: &[Field]) -> Fields<f64> {
        let links: Vec<u16> = self.tasks.iter().map(|(link, _)| *link).collect();
        let want = [want, &[FramePose]].concat();
        let base = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&want));
        self.robot.ask_for(base.with_frames(&links), &[(Y, y)])
    }

    fn ask(&mut self, targets: &[f64], given: &[(Field, &[f64])]) -> Fields<f64> {
        let want = [Y, Q, U, TaskResidual, Iterations, Binding];
        self.ask_for(targets, given, &want)
    }

    fn ask_for(
        &mut self,
        targets: &[f64],
        given: &[(Field, &[f64])],
        want: &[Field],
    ) -> Fields<f64> {
        let base = Query::new(Request::InverseKinematics, FieldSet::EMPTY, FieldSet::of(want));
        let given = [given, &[(TaskTarget, targets)]].concat();
        self.robot.ask_for(base.with_tasks(&self.tasks), &given)
    }
}

/// A target at a pose, of weight 1.
fn target(pose: &[f64]) -> Vec<f64> {
    [pose, &[0.0, 0.0, 1.0, 1.0]].concat()
}

fn at_place(p: [f64; 3]) -> Vec<f64> {
    target(&[p[0], p[1], p[2], 0.0, 0.0, 0.0, 1.0])
}

/// y within the model's limits, of which `part` is used.
pub(crate) fn drawn(model: &Model<f64>, seeded: &mut Seeded, part: f64) -> Vec<f64> {
    sarrus_report::robots::within_limits(model, || 0.5 + seeded.within(-0.5 * part, 0.5 * part))
}

/// Targets that the robot reaches inside all limits, and how many of them are found.
fn reach(name: &str, frames: &[&str], targets: usize, part: f64) -> (usize, usize) {
    let case = Case::bundled(name);
    let model = &case.compiled.model;
    let frames: Vec<(&str, TaskParts)> = frames.iter().map(|frame| (*frame, POSE)).collect();
    let mut searching = Searching::new(model, &frames);
    let mut seeded = Seeded::new(36);
    let mut found = 0;
    let mut drawn_so_far = 0;
    while drawn_so_far < targets {
        let y = drawn(model, &mut seeded, part);
        // of all joints, so that their limits are compared
        let there = searching.at(&y, &[Q]);
        if there.answer.status != Status::Ok
            || there.answer.warnings.contains(Warnings::LIMITS_EXCEEDED)
        {
            continue;
        }
        drawn_so_far += 1;
        let poses = there.get(FramePose).to_vec();
        let targets: Vec<f64> = poses.chunks(7).flat_map(target).collect();
        let x = searching.ask(&targets, &[]);
        assert!(matches!(x.answer.status, Status::Ok | Status::NotReached), "{name}: {y:?}");
        assert!(!x.answer.warnings.contains(Warnings::LIMITS_EXCEEDED), "{name}: {y:?}");
        let residual = x.get(TaskResidual)[..frames.len()].iter().copied().fold(0.0, f64::max);
        assert_eq!(x.answer.status == Status::Ok, residual <= 1e-9, "{name}: {residual:e}");
        // the answer is the closed pose of its y, and that has the poses that it claims
        let again = searching.at(x.get(Y), &[Q]);
        assert_eq!(again.answer.status, Status::Ok, "{name}: {y:?}");
        assert_eq!(again.get(Q), x.get(Q), "{name}: {y:?}");
        for (pose, wanted) in again.get(FramePose).chunks(7).zip(poses.chunks(7)) {
            let away = (0..3).map(|k| (pose[k] - wanted[k]).powi(2)).sum::<f64>().sqrt();
            let cosine = (3..7).map(|k| pose[k] * wanted[k]).sum::<f64>().abs();
            assert!(away <= residual + 1e-12, "{name}: {away:e} where {residual:e} is claimed");
            assert!(1.0 - cosine <= residual * residual + 1e-12, "{name}: {cosine}");
        }
        found += usize::from(x.answer.status == Status::Ok);
    }
    (found, targets)
}

#[test]
fn targets_of_poses_that_robots_reach_are_found() {
    for (name, frames, n) in [
        ("rh5v2_upper_body", &["ALWristRoll_Link"][..], 150),
        ("rh5v2_full", &["ALHandRoll_Link"][..], 25),
        ("stewart", &["HipRotZ_Link"][..], 100),
    ] {
        let (found, of) = reach(name, frames, n, if name == "rh5v2_full" { 0.3 } else { 0.9 });
        assert_eq!(found, of, "{name}");
    }
}

/// Two links of 1 m in a plane, with limits of the joints.
fn two_links(limits: [f64; 2]) -> Model<f64> {
    let mut robot = DescriptionBuilder::new("two links");
    let bob = Inertial::point(1.0, [1.0, 0.0, 0.0]);
    let z = [0.0, 0.0, 1.0];
    let [lower, upper] = limits;
    let first = robot.revolute("a", LinkId::BASE, z).limits(lower, upper).inertial(bob).link();
    let second = robot
        .revolute("b", first, z)
        .origin([1.0, 0.0, 0.0])
        .limits(lower, upper)
        .inertial(bob)
        .link();
    robot.fixed("c", second).origin([1.0, 0.0, 0.0]).link_name("tip");
    robot.compile().unwrap().model
}

#[test]
fn a_target_at_the_edge_of_reach_is_reached_and_one_behind_it_is_not() {
    let model = two_links([-3.0, 3.0]);
    let mut searching = Searching::new(&model, &[("tip", TaskParts::POSITION)]);
    for (distance, is_reached) in [(2.0, true), (2.0 + 1e-8, false), (5.0, false), (0.3, true)] {
        for angle in [0.0, 0.7, 2.0] {
            let at = [distance * f64::cos(angle), distance * f64::sin(angle), 0.0];
            let x = searching.ask(&at_place(at), &[]);
            let status = if is_reached { Status::Ok } else { Status::NotReached };
            assert_eq!(x.answer.status, status, "{distance} at {angle}");
            let off = (distance - 2.0).max(0.0);
            assert!((x.get(TaskResidual)[0] - off).abs() < 2e-9, "{:?}", x.get(TaskResidual));
        }
    }
}

#[test]
fn contradicting_tasks_meet_in_their_weighted_middle() {
    let model = two_links([-3.0, 3.0]);
    let tasks = [("tip", TaskParts::POSITION), ("tip", TaskParts::POSITION)];
    let mut searching = Searching::new(&model, &tasks);
    let mut targets = [at_place([0.8, 0.4, 0.0]), at_place([0.8, 0.8, 0.0])].concat();
    targets[10] = 3.0;
    let x = searching.ask(&targets, &[]);
    assert_eq!(x.answer.status, Status::NotReached);
    let pose = searching.at(x.get(Y), &[]).ok();
    let pose = pose.get(FramePose);
    assert!((pose[0] - 0.8).abs() < 1e-7 && (pose[1] - 0.5).abs() < 1e-7, "{pose:?}");

    // where the second one comes second, the first is met
    let second = TaskParts::POSITION.with(TaskParts::SECOND);
    let mut searching = Searching::new(&model, &[tasks[0], ("tip", second)]);
    let x = searching.ask(&targets, &[]);
    assert_eq!(x.answer.status, Status::NotReached);
    assert!(x.get(TaskResidual)[0] < 1e-9, "{:?}", x.get(TaskResidual));
    assert!((x.get(TaskResidual)[1] - 0.4).abs() < 1e-8, "{:?}", x.get(TaskResidual));
}

#[test]
fn the_nearest_pose_inside_bounds_is_that_of_a_grid_and_names_its_bounds() {
    let model = two_links([-0.5, 0.5]);
    let mut searching = Searching::new(&model, &[("tip", TaskParts::POSITION)]);
    let away = |y: [f64; 2], p: [f64; 3]| {
        let [a, b] = [y[0], y[0] + y[1]];
        (p[0] - a.cos() - b.cos()).hypot(p[1] - a.sin() - b.sin())
    };
    for p in [[0.0, 1.9, 0.0], [1.0, -1.0, 0.0], [1.5, 1.5, 0.0]] {
        let x = searching.ask(&at_place(p), &[]);
        let steps = || (-200..=200).map(|k| f64::from(k) * 0.5 / 200.0);
        let least = steps().flat_map(|a| steps().map(move |b| away([a, b], p)));
        let least = least.fold(f64::INFINITY, f64::min);
        let found = x.get(TaskResidual)[0];
        assert_eq!(x.answer.status, Status::NotReached);
        assert!(found < least + 1e-9 && found > least - 1e-2, "{found} beside {least}");
        let at_bound = |k: usize| (x.get(Y)[k].abs() - 0.5).abs() < 1e-9;
        for k in 0..2 {
            assert_eq!(x.get(Binding)[3 * k] != 0.0, at_bound(k), "{:?}", x.get(Y));
        }
        assert!((0..2).any(at_bound) && !x.answer.warnings.contains(Warnings::LIMITS_EXCEEDED));
    }
    // a guess outside is moved inside; bounds that leave nothing are named
    let x = searching.ask(&at_place([2.0, 0.0, 0.0]), &[(YGuess, &[2.0, -9.0])]);
    assert_eq!(x.answer.status, Status::Ok);
    let x = searching.ask(&at_place([2.0, 0.0, 0.0]), &[(BoundsY, &[-1.0, 1.0, 0.5, 0.4])]);
    assert_eq!(x.answer.status, Status::Infeasible);
    assert!(x.get(Y).iter().all(|x| x.is_nan()));
    assert_eq!(x.get(Binding)[..6], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
}

#[test]
fn bounds_of_actuators_and_of_singularities_hold() {
    let case = Case::bundled("rh5v2_upper_body");
    let model = &case.compiled.model;
    let mut searching = Searching::new(model, &[("ALWristRoll_Link", POSE)]);
    let mut seeded = Seeded::new(7);
    let mut active = 0;
    for _ in 0..20 {
        let y = drawn(model, &mut seeded, 0.8);
        let there = searching.at(&y, &[U, SigmaMin]);
        if there.answer.status != Status::Ok {
            continue;
        }
        let u = there.get(U).to_vec();
        let targets = target(there.get(FramePose));
        // narrow bounds that keep the target out or in by chance
        let bounds: Vec<f64> = u.iter().flat_map(|u| [u - 0.02, u + 0.02]).collect();
        let shifted: Vec<f64> = bounds.iter().map(|x| x + seeded.within(-0.03, 0.03)).collect();
        for bounds in [bounds, shifted] {
            let given: [(Field, &[f64]); 3] =
                [(BoundsU, &bounds), (YGuess, &y), (Clearance, &[1e-3])];
            let want = [Y, U, TaskResidual, Binding, SigmaMin];
            let x = searching.ask_for(&targets, &given, &want);
            if x.answer.status == Status::Infeasible {
                continue;
            }
            assert!(matches!(x.answer.status, Status::Ok | Status::NotReached));
            let inside =
                x.get(U).iter().zip(bounds.chunks(2)).all(|(u, b)| b[0] <= *u && *u <= b[1]);
            assert!(inside && x.get(SigmaMin)[0] >= 1e-3, "{y:?}");
            active += usize::from(x.get(Binding).iter().any(|x| *x != 0.0));
        }
    }
    assert!(active > 5, "{active} answers have an active bound");
}

#[test]
fn room_that_tasks_leave_goes_to_the_preferred_coordinates() {
    let case = Case::bundled("rh5v2_upper_body");
    let model = &case.compiled.model;
    let mut searching = Searching::new(model, &[("ALWristRoll_Link", TaskParts::POSITION)]);
    let mut seeded = Seeded::new(11);
    let y = drawn(model, &mut seeded, 0.3);
    let preferred = drawn(model, &mut seeded, 0.3);
    let targets = target(searching.at(&y, &[]).ok().get(FramePose));
    let given: [(Field, &[f64]); 2] = [(YGuess, &y), (YPreferred, &preferred)];
    let x = searching.ask(&targets, &given);
    assert_eq!(x.answer.status, Status::Ok);
    // the way to them stands across the room that the task leaves: it is Jᵀ of some force
    let base = Query::new(Request::Kinematics, FieldSet::EMPTY, JacobianIndependent.into());
    let found = x.get(Y).to_vec();
    let J = searching.robot.ask_for(base.with_frames(&[searching.tasks[0].0]), &[(Y, &found)]);
    let n = found.len();
    let J = J.ok().get(JacobianIndependent)[3 * n..].to_vec();
    let way = minus(&preferred, &found);
    let Jt: Vec<f64> = (0..3 * n).map(|at| J[at % 3 * n + at / 3]).collect();
    let force = solved(&matrix_product(&J, &Jt, n, 3), &product(&J, &way), 3, 1);
    let across = minus(&way, &transposed(&J, &force, n));
    let inside = |k: &usize| x.get(Binding)[3 * k] == 0.0;
    let worst = (0..n).filter(inside).map(|k| across[k].abs()).fold(0.0, f64::max);
    assert!(worst < 1e-5, "{across:?}");
}

#[test]
fn all_solutions_of_an_elbow_are_found() {
    let model = two_links([-3.0, 3.0]);
    let mut searching = Searching::new(&model, &[("tip", TaskParts::POSITION)]);
    let at = at_place([1.0, 0.5, 0.0]);
    let x = searching.ask_for(&at, &[], &[Y, Solutions]).ok();
    let found: Vec<&[f64]> = x.get(Solutions).chunks(2).filter(|y| !y[0].is_nan()).collect();
    assert_eq!(found.len(), 2, "{found:?}");
    assert!((found[0][1] + found[1][1]).abs() < 1e-8 && found[0][1].abs() > 0.1);
    assert_eq!(x.get(Y), found[0]);
}

#[test]
fn all_eight_solutions_of_an_arm_with_a_spherical_wrist_are_found() {
    let mut robot = DescriptionBuilder::new("arm");
    let bob = Inertial::point(1.0, [0.1, 0.0, 0.0]);
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut last = LinkId::BASE;
    for (name, axis, origin) in [
        ("a", z, [0.0; 3]),
        ("b", y, [0.0, 0.0, 0.4]),
        ("c", y, [0.5, 0.0, 0.0]),
        ("d", x, [0.45, 0.0, 0.0]),
        ("e", y, [0.0; 3]),
        ("f", x, [0.0; 3]),
    ] {
        let joint = robot.revolute(name, last, axis).origin(origin).limits(-PI, PI);
        last = joint.inertial(bob).link();
    }
    robot.fixed("g", last).origin([0.1, 0.0, 0.0]).link_name("tip");
    let model = robot.compile().unwrap().model;
    let mut searching = Searching::new(&model, &[("tip", POSE)]);
    for y in [[0.5, -0.4, 1.1, 0.7, 0.6, -0.9], [-1.2, 0.3, -0.8, -1.0, 1.0, 0.4]] {
        let pose = searching.at(&y, &[]).ok().get(FramePose).to_vec();
        let x = searching.ask_for(&target(&pose), &[], &[Y, Solutions]).ok();
        let all: Vec<Vec<f64>> =
            x.get(Solutions).chunks(6).filter(|y| !y[0].is_nan()).map(<[f64]>::to_vec).collect();
        // left and right, elbow above and below, wrist turned or not; no two alike
        assert_eq!(all.len(), 8, "{all:?}");
        let apart = |a: &[f64], b: &[f64]| largest(&minus(a, b));
        for (k, one) in all.iter().enumerate() {
            let there = searching.at(one, &[]).ok();
            let there = there.get(FramePose);
            let turned = there[3..].iter().zip(&pose[3..]).map(|(a, b)| a * b).sum::<f64>().abs();
            assert!(apart(&there[..3], &pose[..3]) < 1e-9 && 1.0 - turned < 1e-15, "{one:?}");
            assert!(all[..k].iter().all(|other| apart(one, other) > 0.1), "{all:?}");
        }
        assert!(all.iter().any(|one| apart(one, &y) < 1e-8), "{all:?}");
    }
}

#[test]
fn a_search_allocates_nothing_repeats_its_bits_and_ends_its_turn() {
    let case = Case::bundled("rh5v2_upper_body");
    let model = &case.compiled.model;
    let mut searching = Searching::new(model, &[("ALWristRoll_Link", POSE)]);
    let mut seeded = Seeded::new(5);
    let query = Query::new(Request::InverseKinematics, FieldSet::EMPTY, Y | U | Iterations)
        .with_tasks(&searching.tasks);
    let plan = Plan::new(model, &query).unwrap();
    let [mut workspace, mut turns] = [(); 2].map(|()| Workspace::new(model));
    turns.answer_in_turns();
    let mut cut_short = 0;
    for _ in 0..20 {
        let y = drawn(model, &mut seeded, 0.9);
        let there = searching.at(&y, &[]);
        if there.answer.status != Status::Ok {
            continue;
        }
        let targets = target(there.get(FramePose));
        let run = |workspace: &mut Workspace<f64>| -> (Answer, Vec<f64>) {
            let mut output = vec![0.0; plan.want().len()];
            let before = calls();
            let answer = plan.run(model, workspace, &targets, &mut output);
            assert_eq!(calls(), before, "a search allocates");
            (answer, output)
        };
        let whole = run(&mut workspace);
        assert_eq!(run(&mut workspace), whole);
        let turn = run(&mut turns);
        match plan.is_cut_short(&turns, turn.0.status) {
            true => cut_short += 1,
            false => assert_eq!(turn, whole),
        }
    }
    assert!(cut_short < 20);
}

#[test]
fn malformed_tasks_are_refused() {
    let model = two_links([-3.0, 3.0]);
    let base = |tasks: &[(u16, TaskParts)]| {
        Query::new(Request::InverseKinematics, FieldSet::EMPTY, Y.into()).with_tasks(tasks)
    };
    let tip = model.info().link("tip").unwrap();
    for bad in [
        base(&[]),
        base(&[(tip, TaskParts(0))]),
        base(&[(tip, TaskParts(16))]),
        base(&[(99, POSE)]),
        base(&[(tip, POSE); 33]),
        Query { axes: 2, ..base(&[(tip, POSE)]) },
        Query { request: Request::Kinematics as u32, ..base(&[(tip, POSE)]) },
    ] {
        assert!(Plan::new(&model, &bad).is_err(), "{bad:?}");
    }
    let mut searching = Searching::new(&model, &[("tip", POSE)]);
    let mut no_turn = at_place([1.0, 0.0, 0.0]);
    no_turn[6] = 0.5;
    let mut no_weight = at_place([1.0, 0.0, 0.0]);
    no_weight[10] = 0.0;
    for bad in [no_turn, no_weight] {
        let x = searching.ask(&bad, &[]);
        assert_eq!(x.answer.status, Status::BadRequest);
        assert!(x.get(Y).iter().all(|x| x.is_nan()));
    }
    let x = searching.ask(&at_place([f64::NAN, 0.0, 0.0]), &[]);
    assert_eq!(x.answer.status, Status::NonFiniteInput);

    // other scalars have no search
    let exact = &Case::bundled("lambda").compiled.exact;
    let plan = Plan::new(exact, &base(&[(1, POSE)])).unwrap();
    let target = at_place([1.0, 0.0, 0.0]).into_iter().map(Dd::from).collect::<Vec<Dd>>();
    let mut y = [Dd::ZERO];
    let answer = plan.run(exact, &mut Workspace::for_plans(exact, [&plan]), &target, &mut y);
    assert!(answer.status == Status::WrongSize && !y[0].is_finite());
}
