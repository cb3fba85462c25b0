//! Wrists of cranks and rods: tilted, mirrored, of any size, with the rod's universal joint on the
//! crank or on the hand, and cranks driven by a lambda or directly.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{ClosureKind, Compiled, Field, PlanScalar, Request, Status};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, unit};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use super::{X, Y_AXIS, Z, agrees, compile, numerical, unnamed};
use Field::*;

/// Deviations of a wrist from the closed form's assumptions.
#[derive(Clone, Copy, Default)]
struct Shape {
    /// Distance between the axes of the rods' universal joints.
    gap: f64,
    /// The rods have universal joints at both ends, so that each has two idle joints.
    idle: bool,
    /// Cranks are driven by lambdas only, with the joint count of the type.
    driven: bool,
}

/// The 2SURRPR+1U.
fn wrist(seed: u64, straight: bool, shape: Shape) -> Draft {
    let mut draft = Draft::new(seed, Kind::Surrpr2U1, straight);
    let tilt = |seeded: &mut Seeded, v: Vector| {
        if straight { v } else { unit(add(v, 0.3, seeded.direction())) }
    };
    let first = tilt(&mut draft.seeded, X);
    let second = tilt(&mut draft.seeded, Y_AXIS);
    let offset =
        if straight || draft.seeded.chance(0.5) { [0.0; 3] } else { draft.seeded.vector(0.05) };
    let (roll, roll_link) = draft.turn(0, [0.0; 3], first);
    let (pitch, hand) = draft.turn(roll_link, offset, second);
    let mirrored = draft.seeded.chance(0.5);
    let on_crank = draft.seeded.chance(0.5);
    let with_lambda = shape.driven || draft.seeded.chance(0.75);
    let mut drawn = [0.0; 12];
    let mut active = Vec::new();
    for side in [1.0, -1.0] {
        if side > 0.0 || !mirrored {
            drawn = std::array::from_fn(|_| {
                if straight {
                    0.25 * draft.seeded.below(4) as f64
                } else {
                    draft.seeded.within(-1.0, 1.0)
                }
            });
        }
        let mirror = |v: Vector| [v[0], side * v[1], v[2]];
        let far = |x: f64, k: usize| x + 0.125 * drawn[k];
        // the crank, and the rod from the crank's end to the pin on the hand
        let pivot = mirror([far(0.125, 0), far(0.5, 1), far(-1.25, 2)]);
        let n = if straight { Y_AXIS } else { unit(mirror([0.2 * drawn[3], 1.0, 0.2 * drawn[4]])) };
        let e1 = if straight { X } else { unit(cross(n, Z)) };
        let e2 = cross(n, e1);
        let in_plane = |x: f64, y: f64, z: f64| {
            add(add(add(pivot, x, e1), y, e2), if straight { 0.0 } else { 0.1 * z }, n)
        };
        let end = in_plane(far(-0.5, 5), 0.125 * drawn[6], drawn[7]);
        let pin = mirror([far(-0.375, 8), far(0.5, 9), 0.125 * drawn[10]]);
        let rod = add(pin, -1.0, end);
        let u1 = if straight { Y_AXIS } else { unit(cross(rod, tilt(&mut draft.seeded, X))) };
        let u2 = if straight { X } else { unit(cross(u1, tilt(&mut draft.seeded, unit(rod)))) };
        let common = cross(u1, u2);
        let (_, crank_link) = draft.turn(0, add(pivot, 0.25 * drawn[11], n), n);
        let crank = draft.kinds.len() - 1;
        let (carrier, at) = if on_crank { (crank_link, end) } else { (hand, pin) };
        let (_, turned) = draft.turn(carrier, add(at, 0.125 * drawn[0], u1), u1);
        let on_second = add(add(at, shape.gap, common), 0.125 * drawn[1], u2);
        let (_, mut rod_link) = draft.turn(turned, on_second, u2);
        let (other, ball) = if on_crank { (hand, pin) } else { (crank_link, end) };
        if shape.idle {
            for axis in [u1, u2] {
                rod_link = draft.turn(rod_link, ball, axis).1;
            }
        }
        let (p, s) = if draft.seeded.chance(0.5) { (rod_link, other) } else { (other, rod_link) };
        draft.cut(p, s, ball, &[], &[X, Y_AXIS, Z]);

        // drive of the crank
        if !with_lambda {
            active.push(crank);
            continue;
        }
        let stator = in_plane(far(-0.25, 2), far(-1.0, 3), drawn[4]);
        let pushed = in_plane(far(-0.5, 6), 0.125 * drawn[5], drawn[4]);
        let span = add(pushed, -1.0, stator);
        let along = if straight {
            [0.25, 0.0, 1.0]
        } else {
            unit(add(unit(span), 0.2 * drawn[8], cross(n, unit(span))))
        };
        let (_, stator_link) = draft.turn(0, stator, n);
        let (slider, slider_link) = draft.slide(stator_link, add(stator, 0.5, along), along);
        let (p, s) = if draft.seeded.chance(0.5) {
            (crank_link, slider_link)
        } else {
            (slider_link, crank_link)
        };
        let rows: &[Vector] =
            if draft.seeded.chance(0.7) { &[e1, e2] } else { &[e2, add(e1, 1.0, e2)] };
        draft.cut(p, s, pushed, &[], rows);
        active.push(slider);
    }
    draft.roles(&[(roll, 0.2), (pitch, 0.2)], &active);
    draft.shuffled()
}

/// Random y and ẏ of a draft.
fn state(draft: &Draft, seeded: &mut Seeded) -> (Vec<f64>, Vec<f64>) {
    let mut of = |size: f64| -> Vec<f64> {
        draft.reach.iter().map(|reach| size * reach * seeded.within(-1.0, 1.0)).collect()
    };
    (of(1.0), of(3.0))
}

const STATE: [Field; 7] = [Q, Qd, Qdd, G, GBias, CondKd, Iterations];

/// The state by Newton's method, from the zero pose or without a guess.
fn asked<T: PlanScalar>(
    robot: &mut Robot<T>,
    y: &[f64],
    yd: &[f64],
    guess: bool,
) -> Option<Fields<T>> {
    let of = |x: &[f64]| x.iter().map(|x| T::from_f64(*x)).collect::<Vec<T>>();
    let y = of(y);
    let yd = of(yd);
    let zero = vec![T::ZERO; robot.model.sizes().n_q];
    let mut given: Vec<(Field, &[T])> = vec![(Y, &y), (Yd, &yd), (Ydd, &yd)];
    if guess {
        given.push((QGuess, &zero));
    }
    let x = robot.ask(Request::Kinematics, &given, &STATE);
    (x.answer.status == Status::Ok).then_some(x)
}

/// Largest error as a share of its bound: 1e-13 of each size times the loops' condition number.
fn share(mine: &Fields<Dd>, reference: &Fields<Dd>, misfit: f64) -> f64 {
    let cond = reference.get(CondKd)[0].to_f64();
    let velocity = largest(reference.get(Qd));
    let allowed = 1e-14 + 10.0 * misfit;
    let share = |(field, least, power): (Field, f64, i32)| {
        error_by_size(mine.get(field), reference.get(field), least) / (allowed * cond.powi(power))
    };
    [
        (Q, 1.0, 1),
        (Qd, velocity, 1),
        (G, 1.0, 1),
        (GBias, velocity * velocity, 2),
        (Qdd, velocity * velocity, 2),
    ]
    .into_iter()
    .map(share)
    .fold(0.0, f64::max)
}

fn kind(compiled: &Compiled) -> ClosureKind {
    compiled.model.closures()[0].kind
}

#[test]
fn wrists_of_cranks_and_rods_close_in_closed_form() {
    agrees(|seed, straight| wrist(seed, straight, Shape::default()));
}

#[test]
fn two_hundred_and_forty_wrists_are_where_newtons_method_has_them() {
    let mut worst = [0.0_f64; 3];
    let mut count = 0;
    let mut direct = 0;
    for seed in 0..240 {
        let draft = wrist(seed, seed % 8 == 0, Shape { idle: seed % 5 == 0, ..Shape::default() });
        let description = draft.description();
        let form = compile(&description);
        let newton = unnamed(&description);
        assert_eq!(
            (kind(&form), kind(&newton)),
            (ClosureKind::Analytic, ClosureKind::Numerical),
            "seed {seed}: {:?}",
            form.warnings
        );
        let misfit = form.model.closures()[0].misfit;
        assert!(misfit < 1e-13, "seed {seed}: misfit {misfit}");
        let mut robots = [&form.model, &newton.model].map(|model| Robot::new(model.clone()));
        let mut exact = Robot::new(newton.exact.clone());
        let mut seeded = Seeded::new(seed + 900);
        for k in 0..4 {
            let (y, yd) = state(&draft, &mut seeded);
            let [form, newton] = &mut robots;
            // by the type, then by Newton's method without and with a guess and with more digits
            let Some(newtons) = asked(newton, &y, &yd, true) else { continue };
            let mine = asked(form, &y, &yd, false).unwrap_or_else(|| panic!("seed {seed} {y:?}"));
            let cold = asked(newton, &y, &yd, false).unwrap_or_else(|| panic!("seed {seed} {y:?}"));
            let exact = asked::<Dd>(&mut exact, &y, &yd, true).unwrap();
            direct += usize::from(cold.get(Iterations)[0] == 0.0);
            let [mine, cold, newtons] = [mine, cold, newtons].map(|x| x.map(Dd::from));
            let shares = [
                share(&mine, &newtons, misfit),
                share(&mine, &exact, misfit),
                share(&cold, &exact, misfit),
            ];
            assert!(shares.iter().all(|x| *x < 1.0), "seed {seed}, state {k}: {shares:?}");
            (0..3).for_each(|k| worst[k] = worst[k].max(shares[k]));
            count += 1;
        }
    }
    println!("{count} states, {direct} of them without a step; shares {worst:?}");
    assert!(count > 900 && 2 * direct > count, "{count} {direct}");
}

#[test]
fn a_wrist_that_is_not_of_the_type_is_closed_by_newtons_method() {
    for seed in 0..20 {
        let straight = seed % 4 == 0;
        let shape = Shape { gap: 0.05, ..Shape::default() };
        let draft = wrist(seed, straight, shape);
        let mut seeded = Seeded::new(seed + 40);
        let (y, yd) = state(&draft, &mut seeded);
        let spoilt = compile(&draft.description());
        assert_eq!(kind(&spoilt), ClosureKind::Numerical, "seed {seed}");
        let said = spoilt.warnings.iter().any(|x| x.to_string().contains("closed numerically"));
        assert!(said, "seed {seed}: {:?}", spoilt.warnings);
        let mut robot = Robot::new(spoilt.model);
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Residual, Iterations]);
        if x.answer.status == Status::Ok {
            assert!(x.get(Residual)[0] < 1e-12 * draft.scale.max(1.0), "{:?}", x.get(Residual));
            assert!(x.get(Iterations)[0] > 0.0, "seed {seed}");
        }

        // a small gap makes Newton's method refine the result on the true rows
        let polished = compile(&wrist(seed, straight, Shape { gap: 1e-5, ..shape }).description());
        assert_eq!(kind(&polished), ClosureKind::Analytic, "seed {seed}");
        let mut robot = Robot::new(polished.model.clone());
        let near = asked(&mut robot, &y, &yd, false).unwrap().map(Dd::from);
        let newton = numerical(&wrist(seed, straight, Shape { gap: 1e-5, ..shape }).description());
        let exact = asked::<Dd>(&mut Robot::new(newton.exact), &y, &yd, true).unwrap();
        assert!(share(&near, &exact, 0.0) < 10.0, "seed {seed}");
    }
}

#[test]
fn newtons_method_is_kept_where_a_guess_or_a_tolerance_asks_for_it() {
    for seed in 0..12 {
        let draft = wrist(seed, false, Shape { driven: true, ..Shape::default() });
        let model = unnamed(&draft.description()).model;
        let (y, _) = state(&draft, &mut Seeded::new(seed));
        let zero = vec![0.0; model.sizes().n_q];
        let steps = |model: &_, guess: bool| {
            let mut given = vec![(Y, y.as_slice())];
            given.extend(guess.then_some((QGuess, zero.as_slice())));
            let mut robot = Robot::new(sarrus_dynamics::Model::clone(model));
            robot.ask(Request::Kinematics, &given, &[Iterations]).ok().get(Iterations)[0]
        };
        assert!(steps(&model, true) > 0.0, "seed {seed}");
        assert!(steps(&model.with_tolerance(1e-10, 10), false) > 0.0, "seed {seed}");
    }
}
