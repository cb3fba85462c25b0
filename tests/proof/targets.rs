//! Ten thousand random targets for each robot, half of them far away: unreachable, or beyond a
//! toggle.
//!
//! An answer with status ok is finite, closed, and on the branch of its guess: every det K_d keeps
//! its sign, and a path follower without shared code arrives at the same pose. A closed form keeps
//! the sign of its root on any path; where the follower stops on its way to such an answer, only
//! the signs are checked. A parallelogram in closed form is linear and has no root.

use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use sarrus_dynamics::description::{JointKind, SubmechanismKind};
use sarrus_dynamics::{ClosureKind, Field, Request, Status};
use sarrus_tests::cases::{Case, robots};
use sarrus_tests::path::{End, Paths, eliminated};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use Field::*;

/// Targets of each robot.
const TARGETS: usize = 10_000;
/// Largest residual of an answer, in lengths of its cluster.
const CLOSED: f64 = 1e-11;
/// Kinds of mechanisms among the random robots, with a fixed number of robots of each.
const FAMILIES: [&str; 15] = [
    "lambda",
    "2SPU+1U",
    "2SPRR+1U",
    "6UPS",
    "four-bar",
    "slider-crank",
    "parallelogram",
    "two loops",
    "welded",
    "Bricard",
    "spherical",
    "Bennett",
    "RUSR",
    "6R cut",
    "7R welded",
];
const OF_EACH: usize = 2;

/// Expected statuses of failed requests.
const SENSIBLE: [Status; 7] = [
    Status::Unreachable,
    Status::NotConverged,
    Status::BranchChanged,
    Status::SingularClosure,
    Status::SingularIndependents,
    Status::SingularActuation,
    Status::MassNotPositive,
];

/// Square blocks of K_d that share no rows and columns with other blocks.
struct Signs {
    parts: Vec<(Vec<usize>, Vec<usize>)>,
    n_v: usize,
}

impl Signs {
    /// Finds the blocks in the patterns of some K.
    fn new(case: &Case, some: &[Vec<f64>]) -> Signs {
        let model = &case.compiled.model;
        let n_v = model.sizes().n_v;
        let n_c = model.sizes().n_c;
        let independent = model.independent_names();
        let dependent: Vec<usize> =
            (0..n_v).filter(|v| !independent.contains(&model.tree_names()[*v])).collect();
        // a parallelogram stays on its branch where its links are aligned, though K_d changes sign
        let linear: Vec<usize> = (case.description.submechanisms.iter().zip(model.closures()))
            .filter(|(of, closure)| {
                of.kind == SubmechanismKind::ParallelogramChain
                    && closure.kind == ClosureKind::Analytic
            })
            .flat_map(|(of, _)| &of.spanning_tree)
            .filter_map(|j| {
                model.tree_names().iter().position(|name| *name == case.description.joints[*j].name)
            })
            .collect();
        let touches = |r: usize, v: usize| some.iter().any(|of| of[r * n_v + v] != 0.0);
        let mut of_row: Vec<usize> = (0..n_c).collect();
        for &v in &dependent {
            let labels: Vec<usize> =
                (0..n_c).filter(|r| touches(*r, v)).map(|r| of_row[r]).collect();
            let Some(least) = labels.iter().min().copied() else { continue };
            of_row
                .iter_mut()
                .filter(|label| labels.contains(label))
                .for_each(|label| *label = least);
        }
        let mut parts = Vec::new();
        for label in (0..n_c).filter(|r| of_row[*r] == *r) {
            let rows: Vec<usize> = (0..n_c).filter(|r| of_row[*r] == label).collect();
            let columns: Vec<usize> = dependent
                .iter()
                .copied()
                .filter(|v| rows.iter().any(|r| touches(*r, *v)))
                .collect();
            if rows.len() == columns.len() && !columns.iter().any(|v| linear.contains(v)) {
                parts.push((rows, columns));
            }
        }
        Signs { parts, n_v }
    }

    fn of(&self, jacobian: &[f64]) -> Vec<bool> {
        let sign = |(rows, columns): &(Vec<usize>, Vec<usize>)| {
            let n = rows.len();
            let A: Vec<f64> =
                (0..n * n).map(|k| jacobian[rows[k / n] * self.n_v + columns[k % n]]).collect();
            eliminated(A, vec![0.0; n], n).is_some_and(|x| x.1 > 0.0)
        };
        self.parts.iter().map(sign).collect()
    }
}

/// Counts over the targets of one robot.
#[derive(Default)]
struct Counts {
    by_status: Vec<(Status, usize)>,
    /// Paths that the follower completed, paths on which both arrived, answers that only a closed
    /// form could give, and searches that ended too early.
    followed: usize,
    reached: usize,
    beyond: usize,
    given_up: usize,
    early: Option<String>,
    silent: Vec<String>,
}

/// A target, near or far.
fn target(case: &Case, seeded: &mut Seeded, far: bool) -> Vec<f64> {
    let model = &case.compiled.model;
    let slides = |name: &String| {
        case.description.joints.iter().any(|x| x.name == *name && x.kind == JointKind::Prismatic)
    };
    let mut y = case.state::<f64>(seeded.bits() % 1000).y;
    let names = model.independent_q_names();
    for (k, name) in names.iter().enumerate() {
        let Some(at) = model.independent_names().iter().position(|x| x == name) else { continue };
        let reach = match (far, slides(name)) {
            (false, _) => 1.5 * case.reach[at],
            (true, true) => 2.0 * case.scale,
            (true, false) => 3.2,
        };
        y[k] = seeded.within(-reach, reach);
    }
    y
}

/// Asks one of three requests, each of which returns q, K and the residual.
fn ask(
    robot: &mut Robot<f64>,
    which: usize,
    y: &[f64],
    guess: Option<&[f64]>,
    seeded: &mut Seeded,
) -> Fields<f64> {
    let sizes = robot.model.sizes();
    let yd = seeded.numbers(sizes.n_vy, 1.0);
    let ydd = seeded.numbers(sizes.n_vy, 1.0);
    let (request, force, result) = match which {
        0 => (Request::InverseDynamics, Ydd, TauY),
        1 => (Request::ForwardDynamics, TauY, Ydd),
        _ => (Request::Kinematics, Ydd, Qdd),
    };
    let mut given = vec![(Y, y), (Yd, yd.as_slice()), (force, ydd.as_slice())];
    given.extend(guess.map(|q| (QGuess, q)));
    robot.ask(request, &given, &[Q, K, Residual, result])
}

/// The robot's own answer after two thousand steps along the path.
fn in_small_steps(robot: &mut Robot<f64>, start: &[f64], y: &[f64], places: &[usize]) -> String {
    let mut q = start.to_vec();
    let mut least = (f64::INFINITY, 0.0);
    for k in 1..=2000 {
        let part = f64::from(k) / 2000.0;
        let at: Vec<f64> = places
            .iter()
            .zip(y)
            .map(|(place, y)| start[*place] + (y - start[*place]) * part)
            .collect();
        let x = robot.ask(Request::Kinematics, &[(Y, &at), (QGuess, &q)], &[Q, SigmaMin]);
        if x.answer.status != Status::Ok {
            return format!("{} after {part}", x.answer.status);
        }
        if x.get(SigmaMin)[0] < least.0 {
            least = (x.get(SigmaMin)[0], part);
        }
        q = x.get(Q).to_vec();
    }
    format!("ok, σ_min no less than {:.1e} (at {})", least.0, least.1)
}

/// Checks the targets of one robot.
fn go(case: &Case) -> Counts {
    let model = &case.compiled.model;
    let mut robot = Robot::new(model.clone());
    let mut seeded = Seeded::new(case.seed + 31);
    let paths = Paths::new(&case.description, model, case.scale);
    let closed_form = model.closures().iter().any(|x| x.kind == ClosureKind::Analytic);
    // nearby poses as guesses of some requests
    let near: Vec<(Vec<f64>, Vec<f64>)> = (0..8)
        .map(|k| {
            let x = robot.ask(Request::Kinematics, &[(Y, &case.state::<f64>(k).y)], &[Q, K]).ok();
            (x.get(Q).to_vec(), x.get(K).to_vec())
        })
        .collect();
    let signs = Signs::new(case, &near.iter().map(|x| x.1.clone()).collect::<Vec<_>>());
    let zero: Vec<f64> = case
        .state::<f64>(0)
        .y
        .iter()
        .zip(model.independent_q_names())
        .map(|(y, name)| if name.contains('/') { *y } else { 0.0 })
        .collect();
    let zero = robot.ask(Request::Kinematics, &[(Y, &zero)], &[Q, K]).ok();
    let zero = (zero.get(Q).to_vec(), zero.get(K).to_vec());
    // indices in q of the tree coordinates in y
    let places: Vec<usize> = model
        .independent_q_names()
        .iter()
        .map(|name| model.tree_q_names().iter().position(|x| x == name).unwrap())
        .collect();
    let turns = |k: usize| {
        case.description
            .joints
            .iter()
            .any(|x| x.name == model.tree_q_names()[k] && x.kind != JointKind::Prismatic)
    };
    let every = TARGETS / (1500 / model.link_names().len()).clamp(20, 60);
    let mut counts = Counts::default();
    for k in 0..TARGETS {
        let y = target(case, &mut seeded, k % 2 == 1);
        let start = if seeded.chance(0.5) { None } else { Some(&near[seeded.below(near.len())]) };
        let x = ask(&mut robot, k % 3, &y, start.map(|x| x.0.as_slice()), &mut seeded);
        let status = x.answer.status;
        match counts.by_status.iter_mut().find(|x| x.0 == status) {
            Some(count) => count.1 += 1,
            None => counts.by_status.push((status, 1)),
        }
        let mut silent = |what: String| {
            counts.silent.push(format!(
                "target {k} from {} ({status}): {what}; y = {y:?}",
                if start.is_some() { "a guess" } else { "zero" }
            ))
        };
        let start = start.unwrap_or(&zero);
        let result = x.get([TauY, Ydd, Qdd][k % 3]);
        if status == Status::Ok {
            let numbers = [x.get(Q), x.get(K), x.get(Residual), result];
            if !numbers.iter().all(|x| x.iter().all(|x| x.is_finite())) {
                silent("ok with a number that is none".into());
            }
            let allowed = CLOSED.max(case.contradiction());
            if x.get(Residual)[0].is_nan() || x.get(Residual)[0] > allowed {
                silent(format!("ok but open by {:e}", x.get(Residual)[0]));
            }
            if signs.of(x.get(K)) != signs.of(&start.1) {
                silent("ok on a branch of other sign".into());
            }
        } else {
            if !SENSIBLE.contains(&status) {
                silent("a status that does not fit".into());
            }
            if ![x.get(Q), x.get(K), result].iter().all(|x| x.iter().all(|x| x.is_nan())) {
                silent("a failure with numbers".into());
            }
        }
        let Some(paths) = paths.as_ref().filter(|_| k % every < 2) else { continue };
        let mut goal = start.0.clone();
        places.iter().zip(&y).for_each(|(place, y)| goal[*place] = *y);
        counts.followed += 1;
        match (paths.follow(&start.0, &goal), status == Status::Ok) {
            (End::Reached(q), true) => {
                let apart = |k: usize| {
                    let d = x.get(Q)[k] - q[k];
                    let turn = std::f64::consts::TAU;
                    if turns(k) {
                        (d - turn * (d / turn).round()).abs()
                    } else {
                        d.abs() / case.scale
                    }
                };
                // the follower does not move quaternions
                let worst = (0..q.len())
                    .filter(|k| !model.tree_q_names()[*k].contains('/'))
                    .map(apart)
                    .fold(0.0, f64::max);
                if worst > 1e-5 {
                    silent(format!("ok but {worst:.2e} from where the path leads"));
                }
                counts.reached += 1;
            }
            (End::Reached(_), false) => {
                counts.given_up += 1;
                counts.early.get_or_insert(format!("{status}, y = {y:?}"));
            }
            (End::Blocked(_), true) if closed_form => counts.beyond += 1,
            (End::Blocked(at), true) => {
                let own = in_small_steps(&mut robot, &start.0, &y, &places);
                silent(format!("ok where the path stops after {at:.6}; in small steps {own}"));
            }
            (End::Blocked(_), false) => {}
        }
    }
    counts
}

/// The bundled robots and random ones of every kind.
fn chosen() -> Vec<&'static Case> {
    let all = robots();
    let mut chosen: Vec<&Case> =
        all.iter().take_while(|case| case.seed >= 1000 || !case.name.starts_with("seed")).collect();
    for family in FAMILIES {
        let of_family = all.iter().filter(|case| {
            case.name.starts_with("seed") && !case.rounded && case.name.contains(family)
        });
        let fresh: Vec<&Case> = of_family
            .filter(|case| !chosen.iter().any(|x| x.name == case.name))
            .take(OF_EACH)
            .collect();
        chosen.extend(fresh);
    }
    chosen
}

#[test]
fn no_target_is_answered_wrongly() {
    let cases = chosen();
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let work = || {
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(case) = cases.get(k) else { break };
            let start = std::time::Instant::now();
            let counts = go(case);
            results.lock().unwrap().push((k, counts, start.elapsed().as_secs_f64()));
        }
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(work);
        work();
        other.join().unwrap();
    });
    let mut results = results.into_inner().unwrap();
    results.sort_by_key(|x| x.0);
    let mut wrong = String::new();
    for (k, counts, seconds) in results {
        let case = cases[k];
        let by_status: Vec<String> =
            counts.by_status.iter().map(|(status, n)| format!("{status} {n}")).collect();
        println!("{}: {} ({seconds:.1} s)", case.name, by_status.join(", "));
        let Counts { followed, reached, beyond, given_up, early, silent, .. } = counts;
        println!(
            "    of {followed} paths {reached} led to the answer, {given_up} could have been gone, \
             {beyond} stop before a closed form's answer"
        );
        if let Some(early) = early {
            println!("    given up too early, the first: {early}");
        }
        if !silent.is_empty() {
            let first: Vec<&str> = silent.iter().take(3).map(String::as_str).collect();
            let _ = write!(
                wrong,
                "\n{}: {} of {TARGETS}\n    {}",
                case.name,
                silent.len(),
                first.join("\n    ")
            );
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
