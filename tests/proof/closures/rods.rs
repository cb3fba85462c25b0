//! Platforms on rods that only hold distances, recognised by geometry, against Newton's method on
//! all of their rows.

use sarrus_dynamics::Field::Q;
use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_tests::cases::Case;
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, unit};
use sarrus_tests::seed::Seeded;

use super::{Fields, X, Y_AXIS, Z, answers, answers_near, numerical, robots, share};

/// A platform on six rods from three cranks, parallel pairs or not; cranks, or joints of the
/// platform, are independent. The universal joint of a rod is at either end.
fn platform(seed: u64, straight: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Numerical, straight);
    let about = |draft: &mut Draft, size: f64| {
        if straight { [0.0; 3] } else { draft.seeded.vector(size) }
    };
    let mut link = 0;
    let mut joint;
    let mut of_platform = Vec::new();
    for slides in [true, false] {
        for axis in [X, Y_AXIS, Z] {
            (joint, link) = match slides {
                true => draft.slide(link, [0.0, 0.0, 1.0], axis),
                false => draft.turn(link, [0.0, 0.0, 1.0], axis),
            };
            of_platform.push(joint);
        }
    }
    let mut cranks = Vec::new();
    for k in 0..3 {
        let angle = std::f64::consts::TAU * f64::from(k) / 3.0;
        let out: Vector = [angle.cos(), angle.sin(), 0.0];
        let across = cross(Z, out);
        let pivot = add([out[0], out[1], 0.0], 1.0, about(&mut draft, 0.1));
        let (crank, crank_link) = draft.turn(0, pivot, across);
        cranks.push(crank);
        for side in [-0.25, 0.25] {
            let mut spot =
                |at: Vector, aside: f64| add(add(at, aside, across), 1.0, about(&mut draft, 0.05));
            let end = spot(add(pivot, 0.4, out), side);
            let pin = spot([0.5 * out[0], 0.5 * out[1], 1.0], side);
            let rod = add(pin, -1.0, end);
            let u1 = if straight { across } else { unit(cross(rod, draft.seeded.direction())) };
            let u2 = if straight { out } else { unit(cross(u1, draft.seeded.direction())) };
            let (carrier, at, other, ball) = match draft.seeded.chance(0.7) {
                true => (crank_link, end, link, pin),
                false => (link, pin, crank_link, end),
            };
            let (_, turned) = draft.turn(carrier, at, u1);
            let (_, rod) = draft.turn(turned, at, u2);
            let (p, s) = if draft.seeded.chance(0.5) { (rod, other) } else { (other, rod) };
            draft.cut(p, s, ball, &[], &[X, Y_AXIS, Z]);
        }
    }
    let independent = match draft.seeded.below(3) {
        0 => &of_platform[..3],
        _ => &cranks,
    };
    let independent: Vec<(usize, f64)> = independent.iter().map(|j| (*j, 0.3)).collect();
    draft.roles(&independent, &cranks);
    draft.shuffled()
}

#[test]
fn rods_hold_distances_as_their_three_rows_do() {
    let mut worst = [0.0_f64; 2];
    let mut count = [0; 4];
    for seed in 0..120 {
        let straight = seed % 6 == 0;
        let draft = platform(seed, straight);
        let Ok(form) = sarrus_dynamics::Model::compile(&draft.description()) else { continue };
        let newton = numerical(&draft.description());
        let parts = form.model.closures_at_zero().remove(0).parts;
        let rods = parts.iter().filter(|part| part.method == "rod");
        assert!(rods.clone().all(|part| part.rows == 2 && part.joints.len() == 2), "{parts:?}");
        // a zero pose near a singular one has no table
        if rods.clone().count() == 0 {
            continue;
        }
        assert_eq!(rods.count(), 6, "seed {seed}: {parts:?}");
        let of_newton = parts.iter().filter(|part| part.method == "newton");
        assert_eq!(of_newton.map(|part| part.rows).sum::<usize>(), 6, "{parts:?}");
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
        "{count:?} platforms, states, states in double-double, states closed by one of both alone: \
         {worst:.1?} of what is allowed"
    );
    assert!(count[0] > 12 && count[1] > 2000 && 100 * count[3] < count[1], "{count:?}");
}

#[test]
fn delta_and_active_ankle_stand_where_all_of_their_rows_have_them() {
    let mut worst = 0.0_f64;
    for (name, reach) in [("delta", 0.9), ("active_ankle", 0.6)] {
        let Case { description, compiled, .. } = Case::bundled(name);
        let newton = numerical(&description);
        let (mut mine_of, _) = robots(&compiled);
        let (mut rows_of, mut exact_of) = robots(&newton);
        let mut seeded = Seeded::new(41);
        for k in 0..5000 {
            let y = seeded.numbers(3, reach);
            let yd = seeded.numbers(3, 1.0);
            let cast = |x: Option<(Fields<f64>, Fields<f64>)>| {
                x.map(|x| (x.0.map(Dd::from), x.1.map(Dd::from)))
            };
            let mine = cast(answers(&mut mine_of, &y, &yd));
            let rows = cast(answers(&mut rows_of, &y, &yd));
            assert_eq!(mine.is_some(), rows.is_some(), "{name} at {y:?}");
            let Some((mine, rows)) = mine.zip(rows) else { continue };
            let epsilon = 64.0 / 100.0 * <f64 as Real>::EPSILON;
            worst = worst.max(share(&mine, &rows, 2.0 * epsilon, 0.3));
            if k % 50 == 0 {
                let exact = answers(&mut exact_of, &y, &yd).expect("a pose of doubles");
                worst = worst.max(share(&mine, &exact, epsilon, 0.3));
            }
            assert!(worst <= 1.0, "{name} at {y:?}: {worst}");
        }
    }
    println!("{worst:.1e} of what is allowed");
}
