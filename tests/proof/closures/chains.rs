//! Mechanisms whose blocks have closed forms of several kinds, one after the other, against
//! Newton's method on the same rows.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, unit};

use super::dyads::compared;
use super::{X, Y_AXIS, Z};

/// Blocks on a driver: pairs of links on three pins, cranks with a rod in space, joints that a
/// coupling turns. Every link but those of rods turns about Z.
fn blocks(seed: u64) -> Draft {
    let straight = seed.is_multiple_of(5);
    let mut draft = Draft::new(seed, Kind::Numerical, straight);
    let spot = |draft: &mut Draft, height: f64| -> Vector {
        [draft.seeded.within(-1.0, 1.0), draft.seeded.within(-1.0, 1.0), height]
    };
    let start = spot(&mut draft, 0.0);
    let (driver, link) = draft.turn(0, start, Z);
    // each link with a point of it, and the joint that turns it against the base
    let mut moved = vec![(link, start)];
    let mut turning = vec![driver];
    for _ in 0..2 + draft.seeded.below(3) {
        let (from, at) = moved[draft.seeded.below(moved.len())];
        let point = |draft: &mut Draft, at: Vector| {
            let step = draft.seeded.within(0.3, 0.6);
            add(
                at,
                step,
                unit([draft.seeded.within(-1.0, 1.0), draft.seeded.within(-1.0, 1.0), 0.0]),
            )
        };
        let end = point(&mut draft, at);
        let pivot = spot(&mut draft, 0.0);
        match draft.seeded.below(3) {
            0 => {
                // rocker and coupler, either cut at the pin between them or on the link
                let pin = point(&mut draft, pivot);
                let (rocker, rocker_link) = draft.turn(0, pivot, Z);
                if draft.seeded.chance(0.5) {
                    let (_, coupler) = draft.turn(from, end, Z);
                    draft.cut(coupler, rocker_link, pin, &[], &[X, Y_AXIS]);
                } else {
                    let (_, coupler) = draft.turn(rocker_link, pin, Z);
                    draft.cut(from, coupler, end, &[], &[X, Y_AXIS]);
                }
                moved.push((rocker_link, pivot));
                turning.push(rocker);
            }
            1 => {
                // a rod from a crank, in another plane, to a ball on the link
                let pivot = add(pivot, draft.seeded.within(0.3, 0.8), Z);
                let end_of_crank = point(&mut draft, pivot);
                let (crank, crank_link) = draft.turn(0, pivot, Z);
                let rod = add(end, -1.0, end_of_crank);
                let first = unit(cross(rod, draft.seeded.direction()));
                let second = unit(cross(first, draft.seeded.direction()));
                let (_, turned) = draft.turn(crank_link, end_of_crank, first);
                let (_, rod_link) = draft.turn(turned, end_of_crank, second);
                draft.cut(rod_link, from, end, &[], &[X, Y_AXIS, Z]);
                moved.push((crank_link, [pivot[0], pivot[1], 0.0]));
                turning.push(crank);
            }
            _ => {
                let of = turning[draft.seeded.below(turning.len())];
                let of = draft.moved_by(of);
                let (gear, gear_link) = draft.turn(0, pivot, Z);
                let ratio = draft.seeded.sign() * draft.seeded.within(0.5, 1.5);
                let gear_of = draft.moved_by(gear);
                draft.robot.couple(gear_of, [(of, ratio)], 0.0);
                moved.push((gear_link, pivot));
                turning.push(gear);
            }
        }
    }
    draft.roles(&[(driver, 1.0)], &[driver]);
    draft.shuffled()
}

#[test]
fn blocks_of_several_kinds_are_closed_as_by_newtons_method_on_their_rows() {
    let is_mixed = |parts: &[sarrus_dynamics::Part]| {
        let has = |method: &str| parts.iter().any(|part| part.method == method);
        !has("newton")
            && !has("rod")
            && u8::from(has("dyad")) + u8::from(has("leg")) + u8::from(has("linear")) > 1
    };
    let count = compared(400, blocks, is_mixed);
    assert!(count[0] > 60 && count[1] > 3000 && count[2] > 150, "{count:?}");
}

#[test]
fn bundled_robots_of_several_kinds_of_blocks_are_in_closed_form() {
    for (robot, part, methods) in [
        (
            "kangaroo_leg",
            2,
            ["dyad", "dyad", "dyad", "leg", "leg", "dyad", "dyad", "dyad", "dyad"].as_slice(),
        ),
        ("gripper", 0, &["dyad", "linear", "dyad"]),
    ] {
        let model = sarrus_tests::cases::Case::bundled(robot).compiled.model;
        let closure = model.closures_at_zero().remove(part);
        let found: Vec<&str> = closure.parts.iter().map(|part| part.method).collect();
        assert_eq!(found, methods, "{robot}");
        assert!(closure.seeds.0 > 100, "{robot}");
    }
}
