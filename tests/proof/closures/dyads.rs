//! Plane loops that are pairs of links on each other, recognised by geometry, against Newton's
//! method on the same rows.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Compiled, Field, Model, Part, Request, Status};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::error_by_size;
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, unit};
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use super::{X, Y_AXIS, Z, answers, numerical, robots, share};
use Field::*;

/// A chain of drivers and pairs of links; any pin of a pair is the cut one. With `sliders` one
/// joint of a pair slides, or two do, and drivers may.
fn chain(seed: u64, straight: bool, sliders: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Numerical, straight);
    let drivers = 1 + draft.seeded.below(2);
    let pairs = 1 + draft.seeded.below(3);
    let mut links = vec![0];
    let mut independent = Vec::new();
    let spot = |draft: &mut Draft| -> Vector {
        [draft.seeded.within(-1.0, 1.0), draft.seeded.within(-1.0, 1.0), 0.0]
    };
    let joint = |draft: &mut Draft, slides: bool, on: usize, point: Vector| {
        let way = unit(spot(draft));
        let way = if straight { X } else { way };
        if slides { draft.slide(on, point, way) } else { draft.turn(on, point, Z) }
    };
    for k in 0..drivers {
        let point = spot(&mut draft);
        let on = links[draft.seeded.below(links.len())];
        let slides = sliders && k > 0 && draft.seeded.chance(0.5);
        let (joint, link) = joint(&mut draft, slides, on, point);
        links.push(link);
        independent.push((joint, if slides { 0.3 * draft.scale } else { 3.0 }));
    }
    // the first pair ties the last driver to the base, so that all of them move loops
    let mut a = *links.last().unwrap_or(&0);
    let mut b = 0;
    for _ in 0..pairs {
        let points = [(); 3].map(|()| spot(&mut draft));
        // joints from one end over C to the other: which slide, and which of the others is cut
        const KINDS: [[bool; 3]; 7] = [
            [false, false, false],
            [false, false, true],
            [true, false, false],
            [false, true, false],
            [true, false, true],
            [true, true, false],
            [false, true, true],
        ];
        let slides = KINDS[if sliders { draft.seeded.below(7) } else { 0 }];
        let cut = loop {
            let k = draft.seeded.below(3);
            if !slides[k] {
                break k;
            }
        };
        let mut add = |k: usize, on: usize| joint(&mut draft, slides[k], on, points[k]).1;
        let (first, second, [p, s]) = match cut {
            0 => {
                let second = add(2, b);
                let first = add(1, second);
                (first, second, [a, first])
            }
            1 => {
                let first = add(0, a);
                let second = add(2, b);
                (first, second, [first, second])
            }
            _ => {
                let first = add(0, a);
                let second = add(1, first);
                (first, second, [second, b])
            }
        };
        draft.cut(p, s, points[cut], &[], &[X, Y_AXIS]);
        links.extend([first, second]);
        a = links[draft.seeded.below(links.len())];
        b = loop {
            let b = links[draft.seeded.below(links.len())];
            if b != a {
                break b;
            }
        };
    }
    let active: Vec<usize> = independent.iter().map(|x| x.0).collect();
    draft.roles(&independent, &active);
    draft.shuffled()
}

fn methods(of: &Compiled) -> Vec<Part> {
    of.model.closures_at_zero().remove(0).parts
}

fn is_all(parts: &[Part], method: &str) -> bool {
    parts.iter().all(|part| part.method == method)
}

#[test]
fn chains_of_pairs_are_closed_as_by_newtons_method_on_their_rows() {
    let count = compared(180, |seed| chain(seed, seed % 5 == 0, false), are_dyads);
    assert!(count[0] > 100 && count[1] > 5000 && count[2] > 200, "{count:?}");
}

#[test]
fn chains_of_pairs_with_sliders_are_closed_as_by_newtons_method_on_their_rows() {
    let count = compared(300, |seed| chain(seed, seed % 5 == 0, true), are_dyads);
    assert!(count[0] > 100 && count[1] > 5000 && count[2] > 200, "{count:?}");
}

fn are_dyads(parts: &[Part]) -> bool {
    let is_pair = |part: &Part| part.rows == 2 && part.joints.len() == 2;
    is_all(parts, "dyad") && (parts.iter().all(is_pair) || panic!("{parts:?}"))
}

/// How many mechanisms in these closed forms, states, and states in double-double were compared.
pub(super) fn compared(
    seeds: u64,
    draw: impl Fn(u64) -> Draft,
    is_form: impl Fn(&[Part]) -> bool,
) -> [usize; 3] {
    let mut worst = [0.0_f64; 2];
    let mut count = [0; 3];
    for seed in 0..seeds {
        let draft = draw(seed);
        let description = &draft.description();
        // sliders alone may leave a loop open or idle
        let Ok(form) = Model::compile(description) else { continue };
        let newton = numerical(description);
        assert_ne!(newton.model.fingerprint(), form.model.fingerprint(), "seed {seed}");
        let parts = methods(&form);
        // a zero pose near a dead point, or many loops, has no table
        if !is_form(&parts) {
            continue;
        }
        let rows = methods(&newton);
        assert!(rows.iter().all(|part| ["newton", "linear"].contains(&part.method)), "seed {seed}");
        let (mut mine_of, mut exact_of) = robots(&form);
        let (mut newtons_of, _) = robots(&newton);
        let mut seeded = Seeded::new(seed + 900);
        count[0] += 1;
        for k in 0..100 {
            let mut at = |size: f64| -> Vec<f64> {
                draft.reach.iter().map(|reach| size * reach * seeded.within(-1.0, 1.0)).collect()
            };
            let y = at(0.7);
            let yd = at(1.0);
            let (mine, newtons) =
                match (answers(&mut mine_of, &y, &yd), answers(&mut newtons_of, &y, &yd)) {
                    (Some(mine), Some(newtons)) => (mine, newtons),
                    (mine, newtons) => {
                        assert!(mine.is_none() && newtons.is_none(), "seed {seed} at {y:?}");
                        continue;
                    }
                };
            count[1] += 1;
            let cast = |x: (super::Fields<f64>, super::Fields<f64>)| {
                (x.0.map(Dd::from), x.1.map(Dd::from))
            };
            let mine = cast(mine);
            let newtons = cast(newtons);
            let epsilon = 64.0 / 100.0 * <f64 as Real>::EPSILON;
            // both are rounded; where they differ more, the reference says which one is off
            let apart = share(&mine, &newtons, 2.0 * epsilon, draft.scale);
            if k % 20 == 0 || apart > 1.0 {
                let exact = answers(&mut exact_of, &y, &yd).expect("a pose of doubles");
                worst[1] = worst[1].max(share(&mine, &exact, epsilon, draft.scale));
                count[2] += 1;
            } else {
                worst[0] = worst[0].max(apart);
            }
            assert!(worst.iter().all(|x| *x <= 1.0), "seed {seed} at {y:?}: {worst:?}");
        }
    }
    println!("{count:?} chains, states, states in double-double: {worst:.1?} of what is allowed");
    count
}

#[test]
fn a_cell_of_the_table_needs_no_newton_step_and_a_guess_has_the_same_pose() {
    for name in ["five_bar", "squeezer"] {
        let compiled = Case::bundled(name).compiled;
        let parts = methods(&compiled);
        assert!(is_all(&parts, "dyad") && !parts.is_empty(), "{name}: {parts:?}");
        let n = compiled.model.sizes().n_vy;
        let mut robot = Robot::new(compiled.model);
        let y = vec![0.1; n];
        let cold = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, Iterations]).ok();
        assert_eq!(cold.get(Iterations), [0.0], "{name}");
        let guess: Vec<f64> = cold.get(Q).iter().map(|x| x + 1e-3).collect();
        let given: [(Field, &[f64]); 2] = [(Y, &y), (QGuess, &guess)];
        let warm = robot.ask(Request::Kinematics, &given, &[Q, Iterations]).ok();
        assert!(warm.get(Iterations)[0] > 0.0, "{name}");
        let apart = error_by_size(warm.get(Q), cold.get(Q), 1.0);
        assert!(apart < 1e-14, "{name}: {apart:.1e}");
        assert_eq!(warm.answer.status, Status::Ok);
    }
}
