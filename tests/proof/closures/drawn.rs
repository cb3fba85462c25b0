//! Mechanisms drawn at random: tilted, mirrored, permuted, of any size.

use sarrus_dynamics::ClosureKind;
use sarrus_dynamics::description::{JointKind, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, Request};
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, dot, norm, unit};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use super::{X, Y_AXIS, Z, agrees, answers, compile, numerical, robots, share, unnamed};
use Field::*;

/// Points of a crank-rocker: crank pivot, crank pin, coupler pin, rocker pivot; out of the plane by
/// up to `lift`, which must not matter.
fn crank_rocker(seeded: &mut Seeded, straight: bool) -> [Vector; 4] {
    if straight {
        return [
            [0.0; 3],
            [0.25, 0.5, 0.0],
            [1.25, 1.0 + 0.125 * seeded.sign(), 0.0],
            [1.0, 0.0, 0.0],
        ];
    }
    let angle = seeded.sign() * seeded.within(0.8, 2.2);
    let lengths = [seeded.within(0.3, 0.5), seeded.within(0.8, 1.0), seeded.within(0.7, 0.9)];
    let a = [lengths[0] * angle.cos(), lengths[0] * angle.sin(), 0.0];
    let o = [1.0, 0.0, 0.0];
    let span = add(o, -1.0, a);
    let d = norm(span);
    let along = (d * d + lengths[1].powi(2) - lengths[2].powi(2)) / (2.0 * d);
    let offset = (lengths[1].powi(2) - along * along).sqrt() * seeded.sign();
    let b = add(add(a, along / d, span), offset / d, [-span[1], span[0], 0.0]);
    [[0.0; 3], a, b, o]
}

/// A ring of four joints: three in the tree in one of three shapes, the last one cut; any of the
/// three is independent.
fn ring(
    seed: u64,
    kind: Kind,
    straight: bool,
    points: [Vector; 4],
    slider: Option<(usize, Vector)>,
) -> Draft {
    let mut draft = Draft::new(seed, kind, straight);
    let lifts: Vec<Vector> = (0..4)
        .map(|_| if straight { [0.0; 3] } else { [0.0, 0.0, draft.seeded.within(-0.3, 0.3)] })
        .collect();
    let at = |k: usize| add(points[k], 1.0, lifts[k]);
    let joint = |draft: &mut Draft, k: usize, link: usize| match slider {
        Some((place, along)) if place == k => draft.slide(link, at(k), along),
        _ => draft.turn(link, at(k), Z),
    };
    // part of the chain starts at one end of the base, part at the other, with the cut between
    let on_first = 1 + draft.seeded.below(3);
    let mut link = 0;
    let mut other = 0;
    let mut joints = Vec::new();
    for k in 0..on_first {
        let made = joint(&mut draft, k, link);
        joints.push(made.0);
        link = made.1;
    }
    for k in (on_first + 1..4).rev() {
        let made = joint(&mut draft, k, other);
        joints.push(made.0);
        other = made.1;
    }
    if slider.is_some_and(|(place, _)| place == on_first) {
        // a slider cannot be a pin: draws again with another seed
        return ring(seed + 1000, kind, straight, points, slider);
    }
    let (predecessor, successor) =
        if draft.seeded.chance(0.5) { (link, other) } else { (other, link) };
    let (angular, linear): (&[Vector], &[Vector]) = if draft.seeded.chance(0.7) {
        (&[], &[X, Y_AXIS])
    } else {
        (&[], &[Y_AXIS, [1.0, 1.0, 0.0]])
    };
    draft.cut(predecessor, successor, points[on_first], angular, linear);
    let independent = draft.seeded.below(3);
    let slides = draft.kinds[joints[independent]] == JointKind::Prismatic;
    let reach = if slides { 0.1 * draft.scale } else { 0.2 };
    // an actuator that hardly moves would need forces of any size
    let active = joints[independent];
    draft.roles(&[(joints[independent], reach)], &[active]);
    draft.shuffled()
}

/// The FOURBAR.
pub(super) fn four_bar(seed: u64, straight: bool) -> Draft {
    let points = crank_rocker(&mut Seeded::new(seed + 77), straight);
    ring(seed, Kind::FourBar, straight, points, None)
}

/// The SLIDERCRANK.
pub(super) fn slider_crank(seed: u64, straight: bool) -> Draft {
    let mut seeded = Seeded::new(seed + 78);
    let crank = if straight {
        [0.25, 0.5, 0.0]
    } else {
        add([0.0, 0.5 * seeded.sign(), 0.0], 0.2, [seeded.within(-1.0, 1.0), 0.0, 0.0])
    };
    let wrist = if straight {
        [1.25, -0.125, 0.0]
    } else {
        [seeded.within(0.8, 1.2) * seeded.sign(), seeded.within(-0.2, 0.2), 0.0]
    };
    let along = if straight { X } else { unit([1.0, seeded.within(-0.2, 0.2), 0.0]) };
    // crank pivot, crank pin, wrist, slider
    let points = [[0.0; 3], crank, wrist, [0.75, 0.0, 0.0]];
    ring(seed, Kind::SliderCrank, straight, points, Some((3, along)))
}

/// The RRPR whose pin circles at a part of the distance of the pivots, or at more than it.
pub(super) fn lambda(seed: u64, straight: bool, size: f64) -> Draft {
    let mut seeded = Seeded::new(seed + 79);
    let pin = if straight {
        [0.25, 0.5, 0.0]
    } else {
        [seeded.within(-0.3, 0.3), seeded.within(0.4, 0.6) * seeded.sign(), 0.0]
    };
    let pin = pin.map(|x| size * x);
    let stator = [1.0, 0.0, 0.0];
    let span = unit(add(pin, -1.0, stator));
    let along = if straight {
        [-0.75, 0.625, 0.0]
    } else {
        unit(add(span, seeded.within(-0.2, 0.2), [-span[1], span[0], 0.0]))
    };
    // rocker, pin, slider, stator
    let points = [[0.0; 3], pin, [0.625, 0.25, 0.0], stator];
    ring(seed, Kind::Rrpr, straight, points, Some((2, along)))
}

#[test]
fn four_bars_of_any_lengths_close_from_any_of_their_joints() {
    agrees(four_bar);
}

#[test]
fn slider_cranks_close_from_crank_coupler_and_slider() {
    agrees(slider_crank);
}

#[test]
fn lambdas_close_whichever_joint_is_independent() {
    agrees(|seed, straight| lambda(seed, straight, 1.0));
}

/// The 2SPRR+1U with offset joints at the base, or with arms on the foot.
fn ankle(seed: u64, straight: bool, arms: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Sprr2U1, straight);
    let seeded = &mut draft.seeded;
    let tilt = |seeded: &mut Seeded, v: Vector| {
        if straight { v } else { unit(add(v, 0.3, seeded.direction())) }
    };
    let first = tilt(seeded, X);
    let second = tilt(seeded, Y_AXIS);
    let offset = if straight || seeded.chance(0.5) { [0.0; 3] } else { seeded.vector(0.05) };
    let (roll, roll_link) = draft.turn(0, [0.0; 3], first);
    let (pitch, foot) = draft.turn(roll_link, offset, second);
    let mirrored = draft.seeded.chance(0.5);
    let mut shape = [0.0; 8];
    let mut feet = Vec::new();
    let mut active = Vec::new();
    for side in [1.0, -1.0] {
        if side > 0.0 || !mirrored {
            shape = std::array::from_fn(|_| {
                if straight {
                    0.25 * draft.seeded.below(4) as f64
                } else {
                    draft.seeded.within(-1.0, 1.0)
                }
            });
        }
        let mirror = |v: Vector| [v[0], side * v[1], v[2]];
        let far = |x: f64, k: usize| x + 0.125 * shape[k];
        let base = mirror([far(-0.25, 0), far(0.375, 1), far(1.25, 2)]);
        let pivot = mirror([far(-0.625, 3), far(0.5, 4), 0.0]);
        // the arm's axis, and the arm towards the base point and perpendicular to the axis
        let n = if straight { X } else { unit(mirror([1.0, 0.2 * shape[5], 0.2 * shape[6]])) };
        let to_base = add(base, -1.0, pivot);
        let radial = add(to_base, -dot(n, to_base), n);
        let arm = if straight {
            [0.0, 0.25, 0.125]
        } else {
            add(add([0.0; 3], (0.15 + 0.05 * shape[7]) / norm(radial), radial), 0.05 * shape[0], n)
        };
        let pin = if arms { add(pivot, 1.0, arm) } else { pivot };
        let leg = unit(add(pin, -1.0, base));
        // the leg's second axis is perpendicular to the rod, the first to the second
        let y = if straight { Y_AXIS } else { unit(cross(leg, tilt(&mut draft.seeded, X))) };
        let x = if straight { X } else { unit(cross(y, tilt(&mut draft.seeded, Z))) };
        let common = cross(x, y);
        let gap = if arms { 0.0 } else { 0.125 * side };
        let (along, y) = match (straight, arms) {
            (true, _) => ([0.25, 0.0, 1.0], y),
            (false, true) if draft.seeded.chance(0.5) => {
                (unit(add(leg, 0.2, draft.seeded.direction())), y)
            }
            _ => (unit(add(leg, 0.2 * shape[1], cross(leg, y))), y),
        };
        let on_second = add(base, gap, common);
        let (_, first_link) = draft.turn(0, add(base, 0.125 * shape[2], x), x);
        let (_, second_link) = draft.turn(first_link, add(on_second, 0.125 * shape[3], y), y);
        let (slider, rod) =
            draft.slide(second_link, add(pin, 0.25, if straight { Z } else { leg }), along);
        active.push(slider);
        if arms {
            let (_, arm_link) = draft.turn(foot, add(pivot, 0.125 * shape[6], n), n);
            feet.push((
                arm_link,
                base,
                if straight { cross(n, arm) } else { unit(cross(n, radial)) },
                pin,
                rod,
            ));
        } else if draft.seeded.chance(0.5) {
            draft.cut(foot, rod, pin, &[], &[X, Y_AXIS, Z]);
        } else {
            draft.cut(rod, foot, pin, &[], &[X, Y_AXIS, Z]);
        }
    }
    for (arm, base, normal, pin, rod) in feet {
        draft.cut(rod, arm, pin, &[], &[X, Y_AXIS, Z]);
        draft.cut(arm, 0, base, &[], &[normal]);
    }
    draft.roles(&[(roll, 0.15), (pitch, 0.15)], &active);
    draft.shuffled()
}

#[test]
fn ankles_with_offset_joints_at_the_base_close_in_closed_form() {
    agrees(|seed, straight| ankle(seed, straight, false));
}

#[test]
fn ankles_with_arms_on_the_foot_close_in_closed_form() {
    agrees(|seed, straight| ankle(seed, straight, true));
}

#[test]
fn an_ankle_with_arms_defines_its_loops_by_its_type() {
    for seed in 0..20 {
        // slider origin as pin, listed as roll, pitch, arms, then leg by leg
        let mut description = ankle(seed, false, true).description();
        let part = &mut description.submechanisms[0];
        part.loops.clear();
        part.spanning_tree = vec![0, 1, 5, 9, 2, 3, 4, 6, 7, 8];
        let form = compile(&description);
        let sizes = form.model.sizes();
        assert_eq!(
            (sizes.n_c, sizes.n_vy, form.model.closures()[0].kind),
            (8, 2, ClosureKind::Analytic)
        );
        let mut robot = Robot::new(form.model.clone());
        let mut seeded = Seeded::new(seed);
        let y = [seeded.within(-0.1, 0.1), seeded.within(-0.1, 0.1)];
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, G, Residual]).ok();
        assert!(x.get(Residual)[0] < 1e-12, "{:?}", x.get(Residual));
        // no row of G vanishes
        for row in x.get(G).chunks(2) {
            assert!(row.iter().any(|x| x.abs() > 1e-6), "{row:?}");
        }
    }
}

#[test]
fn mechanisms_of_named_types_are_found_by_their_geometry() {
    type Drawn = fn(u64, bool) -> Draft;
    let drawn: [(Drawn, &str); 4] = [
        (slider_crank, "dyad"),
        (|seed, straight| lambda(seed, straight, 1.0), "dyad"),
        (|seed, straight| ankle(seed, straight, false), "leg"),
        (|seed, straight| ankle(seed, straight, true), "leg"),
    ];
    for (draw, method) in drawn {
        let mut found = 0;
        let mut states = 0;
        let mut worst = 0.0_f64;
        for seed in 0..24 {
            let draft = draw(seed, seed % 6 == 0);
            let form = unnamed(&draft.description());
            let newton = numerical(&draft.description());
            let parts = form.model.closures_at_zero().remove(0).parts;
            // a zero pose near a dead point has no table
            if parts.iter().any(|part| part.method != method) {
                continue;
            }
            found += 1;
            let (mut mine_of, _) = robots(&form);
            let (mut newtons_of, _) = robots(&newton);
            let mut seeded = Seeded::new(seed + 300);
            for _ in 0..20 {
                let mut at = |size: f64| -> Vec<f64> {
                    draft.reach.iter().map(|x| size * x * seeded.within(-1.0, 1.0)).collect()
                };
                let (y, yd) = (at(1.0), at(3.0));
                let mine = answers(&mut mine_of, &y, &yd);
                let newtons = answers(&mut newtons_of, &y, &yd);
                assert_eq!(mine.is_some(), newtons.is_some(), "seed {seed} at {y:?}");
                let Some((mine, newtons)) = mine.zip(newtons) else { continue };
                let cast = |x: (Fields<f64>, Fields<f64>)| (x.0.map(Dd::from), x.1.map(Dd::from));
                let epsilon = 64.0 / 100.0 * <f64 as Real>::EPSILON;
                worst = worst.max(share(&cast(mine), &cast(newtons), epsilon, draft.scale));
                states += 1;
                assert!(worst <= 1.0, "{method}, seed {seed} at {y:?}: {worst}");
            }
        }
        println!("{method}: {found} of 24, {states} states, {worst:.1e} of what is allowed");
        assert!(found >= 12, "{method}: {found}");
    }
}
