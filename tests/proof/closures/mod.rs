//! Each closed form against Newton's method on the same mechanism, in both scalars, on random
//! geometries.

mod chains;
mod cranks;
mod drawn;
mod dyads;
mod known;
mod rods;
mod steps;
mod winding;

use sarrus_dynamics::description::{Description, SubmechanismKind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{ClosureKind, Compiled, Field, Model, PlanScalar, Request, Status};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::Vector;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use Field::*;

const X: Vector = [1.0, 0.0, 0.0];
const Y_AXIS: Vector = [0.0, 1.0, 0.0];
const Z: Vector = [0.0, 0.0, 1.0];

fn compile(description: &Description) -> Compiled {
    Model::compile(description).unwrap_or_else(|error| panic!("{}: {error:?}", description.name))
}

/// The robot with a type that names no closed form.
fn unnamed(description: &Description) -> Compiled {
    let mut description = description.clone();
    description.submechanisms[0].kind = SubmechanismKind::Numerical;
    compile(&description)
}

/// The robot with every mechanism closed by Newton's method.
fn numerical(description: &Description) -> Compiled {
    let mut description = description.clone();
    description.submechanisms[0].closed_forms = false;
    compile(&description)
}

const STATE: [Field; 9] = [Q, Qd, Qdd, G, GBias, K, KBias, Residual, CondKd];

/// The robots of a description in double and double-double.
fn robots(of: &Compiled) -> (Robot<f64>, Robot<Dd>) {
    (Robot::new(of.model.clone()), Robot::new(of.exact.clone()))
}

fn answers<T: PlanScalar>(
    robot: &mut Robot<T>,
    y: &[f64],
    yd: &[f64],
) -> Option<(Fields<T>, Fields<T>)> {
    answers_near(robot, None, y, yd)
}

/// `answers` from a guess of q.
fn answers_near<T: PlanScalar>(
    robot: &mut Robot<T>,
    guess: Option<&[T]>,
    y: &[f64],
    yd: &[f64],
) -> Option<(Fields<T>, Fields<T>)> {
    let of = |x: &[f64]| x.iter().map(|x| T::from_f64(*x)).collect::<Vec<T>>();
    let y = of(y);
    let yd = of(yd);
    let ydd = yd.clone();
    let mut motion: Vec<(Field, &[T])> = vec![(Y, &y), (Yd, &yd), (Ydd, &ydd)];
    motion.extend(guess.map(|guess| (QGuess, guess)));
    let state = robot.ask(Request::Kinematics, &motion, &STATE);
    let forces = robot.ask(Request::InverseDynamics, &motion, &[TauQ, TauY, Lambda]);
    (state.answer.status == Status::Ok).then(|| (state, forces.ok()))
}

/// Largest error as a share of its bound: 64 ε cond × size, with the square of cond for
/// accelerations, plus the effect of the misfit. A slide is a difference of lengths of the loop.
fn share<T: PlanScalar>(
    mine: &(Fields<T>, Fields<T>),
    reference: &(Fields<T>, Fields<T>),
    misfit: f64,
    length: f64,
) -> f64 {
    let cond = reference.0.get(CondKd)[0].to_f64();
    let velocity = largest(reference.0.get(Qd));
    let K_size = largest(reference.0.get(K));
    let square = velocity * velocity;
    let force = largest(reference.1.get(TauQ));
    let allowed = 64.0 * T::EPSILON + 100.0 * misfit;
    let mut worst: f64 = 0.0;
    for (field, least, power) in [
        (Q, length.max(1.0), 1),
        (Qd, velocity, 1),
        (G, 1.0, 1),
        (K, 1.0, 1),
        (GBias, square, 2),
        (KBias, K_size * square, 1),
        (Qdd, square, 2),
    ] {
        let share = error_by_size(mine.0.get(field), reference.0.get(field), least)
            / (allowed * cond.powi(power));
        if share > 1.0 {
            println!("{field:?}: {share:.1e} of {allowed:.1e}, cond {cond:.1e}");
        }
        worst = worst.max(share);
    }
    // a force is a moment over the mechanism's length
    for (field, least) in [(TauQ, force), (TauY, force), (Lambda, force / length.min(1.0))] {
        let share = error_by_size(mine.1.get(field), reference.1.get(field), least)
            / (allowed * cond * cond);
        if share > 1.0 {
            println!(
                "{field:?}: {share:.1e} of {allowed:.1e}, cond {cond:.1e}, forces of {force:.1e}"
            );
        }
        worst = worst.max(share);
    }
    worst
}

/// Compares forms of mechanisms, which `is_of` looks at, with Newton's method on all of their rows:
/// the numbers of mechanisms, states, states in double-double, and states that one of both alone
/// closes.
fn compared(
    seeds: u64,
    draft: impl Fn(u64, bool) -> Draft,
    is_of: impl Fn(&Compiled) -> bool,
) -> [usize; 4] {
    let mut worst = [0.0_f64; 2];
    let mut count = [0; 4];
    for seed in 0..seeds {
        let straight = seed % 6 == 0;
        let draft = draft(seed, straight);
        let Ok(form) = Model::compile(&draft.description()) else { continue };
        let newton = numerical(&draft.description());
        if !is_of(&form) {
            continue;
        }
        count[0] += 1;
        let (mut mine_of, mut exact_of) = robots(&form);
        let (mut newtons_of, _) = robots(&newton);
        let mut seeded = Seeded::new(seed + 70);
        for k in 0..200 {
            let mut at = || -> Vec<f64> {
                draft.reach.iter().map(|reach| reach * seeded.within(-1.0, 1.0)).collect()
            };
            let y = at();
            let yd = at();
            let cast = |x: (Fields<f64>, Fields<f64>)| (x.0.map(Dd::from), x.1.map(Dd::from));
            let mine = answers(&mut mine_of, &y, &yd).map(cast);
            let newtons = answers(&mut newtons_of, &y, &yd).map(cast);
            let (mine, newtons) = match (mine, newtons) {
                (Some(mine), Some(newtons)) => (mine, newtons),
                // near the end of the reach one of both may give up before the other
                (mine, newtons) => {
                    count[3] += usize::from(mine.is_some() != newtons.is_some());
                    continue;
                }
            };
            count[1] += 1;
            let epsilon = 64.0 / 100.0 * <f64 as Real>::EPSILON;
            // both are rounded
            worst[0] = worst[0].max(share(&mine, &newtons, 2.0 * epsilon, draft.scale));
            if k % 20 == 0 {
                // without a table it might not find the way from the zero pose
                let near = Some(mine.0.get(Q));
                let exact = answers_near(&mut exact_of, near, &y, &yd).expect("a pose of doubles");
                worst[1] = worst[1].max(share(&mine, &exact, epsilon, draft.scale));
                count[2] += 1;
            }
            assert!(worst.iter().all(|x| *x <= 1.0), "seed {seed} at {y:?}: {worst:?}");
        }
    }
    println!(
        "{count:?} mechanisms, states, states in double-double, states closed by one of both alone: \
         {worst:.1?} of the bound"
    );
    count
}

/// Checks a closed form on many drafts: against Newton's method, double and double-double, and
/// double against double-double.
fn agrees(draft: impl Fn(u64, bool) -> Draft) {
    let mut worst = [0.0f64; 3];
    let mut count = 0;
    for seed in 0..40 {
        let straight = seed % 4 == 0;
        let draft = draft(seed, straight);
        let description = &draft.description();
        let form = compile(description);
        let newton = numerical(description);
        let info = &form.model.closures()[0];
        assert!(form.warnings.is_empty(), "seed {seed}: {:?}", form.warnings);
        assert_eq!(
            (info.kind, newton.model.closures()[0].kind),
            (ClosureKind::Analytic, ClosureKind::Numerical),
            "seed {seed}"
        );
        assert!(info.misfit < 1e-13, "seed {seed}: misfit {}", info.misfit);
        if straight {
            assert!(info.misfit < 1e-30, "seed {seed}: misfit {} of exact numbers", info.misfit);
        }
        let (mut mine_of, mut exact_of) = robots(&form);
        let (mut newtons_of, mut newtons_exact_of) = robots(&newton);
        let mut seeded = Seeded::new(seed + 500);
        for _ in 0..4 {
            let y: Vec<f64> =
                draft.reach.iter().map(|reach| reach * seeded.within(-1.0, 1.0)).collect();
            let yd: Vec<f64> =
                draft.reach.iter().map(|reach| 3.0 * reach * seeded.within(-1.0, 1.0)).collect();
            // both methods reach the same targets
            let (mine, newtons) =
                match (answers(&mut mine_of, &y, &yd), answers(&mut newtons_of, &y, &yd)) {
                    (Some(mine), Some(newtons)) => (mine, newtons),
                    (mine, newtons) => {
                        assert!(
                            mine.is_none() && newtons.is_none(),
                            "seed {seed} at {y:?}: only one of both closes"
                        );
                        continue;
                    }
                };
            let exact = answers(&mut exact_of, &y, &yd).unwrap();
            let newtons_exact = answers(&mut newtons_exact_of, &y, &yd).unwrap();
            let rounded = (mine.0.map(Dd::from), mine.1.map(Dd::from));
            let newtons = (newtons.0.map(Dd::from), newtons.1.map(Dd::from));
            let double = |a: &(Fields<Dd>, Fields<Dd>), b: &(Fields<Dd>, Fields<Dd>)| {
                share(a, b, 64.0 / 100.0 * <f64 as Real>::EPSILON + info.misfit, draft.scale)
            };
            let shares = [
                double(&rounded, &newtons),
                double(&rounded, &exact),
                share(&exact, &newtons_exact, info.misfit, draft.scale),
            ];
            assert!(
                shares.iter().all(|x| *x <= 1.0),
                "seed {seed} at {y:?}: {shares:?} of what is allowed"
            );
            (0..3).for_each(|k| worst[k] = worst[k].max(shares[k]));
            count += 1;
        }
    }
    assert!(count > 100, "{count} states of 160");
    println!(
        "{count} states: to Newton {:.1e}, to double-double {:.1e}, there to Newton {:.1e} of what \
         is allowed",
        worst[0], worst[1], worst[2]
    );
}
