//! Platforms on rods that only hold distances, recognised by geometry, against Newton's method on
//! all of their rows.

use sarrus_dynamics::description::{Cut, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_tests::cases::Case;
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, unit};
use sarrus_tests::seed::Seeded;

use super::{Fields, X, Y_AXIS, Z, answers, compared, compile, numerical, robots, share};

/// A platform on six rods from three cranks, parallel pairs or not; cranks, or joints of the
/// platform, are independent. The universal joint of a rod is at either end. With `spins` some rods
/// have a third turn about themselves, as a ball joint at both ends leaves it.
fn platform(seed: u64, straight: bool, spins: bool) -> Draft {
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
            let (_, mut link_of_rod) = draft.turn(turned, at, u2);
            if spins && draft.seeded.chance(0.5) {
                link_of_rod = draft.turn(link_of_rod, at, unit(rod)).1;
            }
            let rod = link_of_rod;
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

/// A platform on three legs of a crank and a link, all in a plane, or about a point; cranks, or
/// joints of the leg that the tree follows, are independent.
fn three_legs(seed: u64, straight: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Numerical, straight);
    let round = draft.seeded.chance(0.5);
    let mut cranks = Vec::new();
    let mut platform = 0;
    let mut first = Vec::new();
    for k in 0..3 {
        let spots = [(1.0, 0.0), (0.8, 0.5), (0.35, 0.2)].map(|(radius, ahead)| {
            let about = |draft: &mut Draft| 0.15 * draft.seeded.within(-1.0, 1.0);
            let angle = std::f64::consts::TAU * f64::from(k) / 3.0 + ahead + about(&mut draft);
            let radius: f64 = radius + about(&mut draft);
            let [x, y] = [radius * angle.cos(), radius * angle.sin()];
            let height = if straight { 0.0 } else { 2.0 * about(&mut draft) };
            if round { [x, y, 0.7 + height] } else { [x, y, height] }
        });
        let axis = |at: Vector| if round { unit(at) } else { Z };
        let [pivot, elbow, pin] = spots;
        let (crank, link) = draft.turn(0, pivot, axis(pivot));
        cranks.push(crank);
        let (joint, link) = draft.turn(link, elbow, axis(elbow));
        if k == 0 {
            let (last, of_platform) = draft.turn(link, pin, axis(pin));
            (platform, first) = (of_platform, vec![crank, joint, last]);
            continue;
        }
        let [x, y] = if round {
            let x = unit(cross(pin, Y_AXIS));
            [x, unit(cross(pin, x))]
        } else {
            [X, Y_AXIS]
        };
        let (p, s) = if draft.seeded.chance(0.5) { (link, platform) } else { (platform, link) };
        draft.cut(p, s, pin, &[], &[x, y]);
    }
    let independent = if draft.seeded.chance(0.2) {
        [first[0], first[1], cranks[1]]
    } else {
        [cranks[0], cranks[1], cranks[2]]
    };
    draft.roles(&independent.map(|j| (j, 0.3)), &cranks);
    draft.shuffled()
}

#[test]
fn rods_hold_distances_as_their_three_rows_do() {
    let count = rods(120, |seed, straight| platform(seed, straight, false), [6, 2]);
    assert!(count[0] > 12 && count[1] > 2000 && 100 * count[3] < count[1], "{count:?}");
}

#[test]
fn rods_that_spin_about_themselves_are_rods() {
    let count = rods(60, |seed, straight| platform(seed, straight, true), [6, 2]);
    assert!(count[0] > 6 && count[1] > 1000 && 100 * count[3] < count[1], "{count:?}");
}

#[test]
fn links_on_hinges_in_a_plane_or_about_a_point_are_rods() {
    let count = rods(160, three_legs, [2, 1]);
    assert!(count[0] > 60 && count[1] > 5000 && 100 * count[3] < count[1], "{count:?}");
}

/// Compares mechanisms of so many rods with so many turns each with all of their rows.
fn rods(seeds: u64, draft: impl Fn(u64, bool) -> Draft, [n, turns]: [usize; 2]) -> [usize; 4] {
    compared(seeds, draft, |form| {
        let parts = form.model.closures_at_zero().remove(0).parts;
        let rods = parts.iter().filter(|part| part.method == "rod");
        assert!(
            rods.clone().all(|part| part.rows == turns && part.joints.len() == turns),
            "{parts:?}"
        );
        // a zero pose near a singular one has no table
        if rods.clone().count() == 0 {
            return false;
        }
        assert_eq!(rods.count(), n, "{parts:?}");
        let of_newton = parts.iter().filter(|part| part.method == "newton");
        assert_eq!(of_newton.map(|part| part.rows).sum::<usize>(), n, "{parts:?}");
        true
    })
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

#[test]
fn pins_apart_where_no_row_sees_it_close_the_same_rows() {
    for (name, axis) in [("agile_eye", 0), ("three_rrr", 2)] {
        for gap in [1e-12, 1e-9, 1e-6, 1e-2] {
            let mut description = Case::bundled(name).description;
            let Cut::Placed { successor, .. } = &mut description.submechanisms[0].loops[0].cut
            else {
                panic!("{name} has no placed cut")
            };
            successor.xyz[axis] += gap;
            let form = compile(&description);
            let parts = form.model.closures_at_zero().remove(0).parts;
            assert_eq!(parts.iter().filter(|part| part.method == "rod").count(), 2, "{parts:?}");
            let mut mine_of = robots(&form).0;
            let mut exact_of = robots(&numerical(&description)).1;
            let mut seeded = Seeded::new(7);
            for _ in 0..50 {
                let y = seeded.numbers(3, 0.1);
                let yd = seeded.numbers(3, 1.0);
                let cast = |x: (Fields<f64>, Fields<f64>)| (x.0.map(Dd::from), x.1.map(Dd::from));
                let mine = cast(answers(&mut mine_of, &y, &yd).expect("a pose"));
                let exact = answers(&mut exact_of, &y, &yd).expect("a pose");
                let worst = share(&mine, &exact, 64.0 / 100.0 * <f64 as Real>::EPSILON, 0.3);
                assert!(worst <= 1.0, "{name}, {gap:e} at {y:?}: {worst}");
            }
        }
    }
}
