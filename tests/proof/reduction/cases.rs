//! Which joints are held, on which robots.

use std::collections::BTreeSet;

use sarrus_dynamics::restricted;
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::seed::Seeded;

use super::{Pair, independents, joint, position, sizes};

/// Random robots that are tried.
const RANDOM: usize = 60;

/// The bundled robots and some random ones, in which something can be held.
fn some() -> impl Iterator<Item = &'static Case> {
    let is_random = |case: &Case| case.compiled.model.name().starts_with("random");
    let (random, bundled): (Vec<&Case>, Vec<&Case>) =
        robots().iter().partition(|case| is_random(case));
    bundled.into_iter().chain(random.into_iter().take(RANDOM))
}

#[test]
fn each_independent_joint_held_in_turn_leaves_the_answers_of_the_whole_robot() {
    Ledger::over(some(), |case, ledger| {
        let mut seeded = Seeded::new(case.seed + 17);
        for name in independents(case) {
            let held = [(name.clone(), position(case, &name, &mut seeded))];
            let reduced = Pair::locked(case, &held);
            let mut pair = Pair::new(case, &reduced, &held);
            let (small, whole) = (sizes(&pair.small.model), sizes(&case.compiled.model));
            assert!(small[0] < whole[0] && small[1] + 1 == whole[1], "{}: {name}", case.name);
            assert!(small[2] <= whole[2]);
            pair.compare(ledger, 2);
        }
    });
}

#[test]
fn several_joints_held_at_once_leave_the_answers_of_the_whole_robot() {
    Ledger::over(some(), |case, ledger| {
        let mut seeded = Seeded::new(case.seed + 18);
        for _ in 0..3 {
            let held: Vec<(String, f64)> = independents(case)
                .into_iter()
                .filter(|_| seeded.chance(0.6))
                .collect::<Vec<_>>()
                .into_iter()
                .map(|name| (name.clone(), position(case, &name, &mut seeded)))
                .collect();
            let n = case.compiled.model.sizes().n_vy;
            if held.is_empty() || held.len() == n {
                continue;
            }
            let reduced = Pair::locked(case, &held);
            Pair::new(case, &reduced, &held).compare(ledger, 2);
        }
    });
}

#[test]
fn a_humanoid_with_legs_and_torso_held_has_the_bodies_of_its_arms_and_head() {
    let case = Case::bundled("rh5v2_full");
    let mut ledger = Ledger::default();
    let arms = |name: &str| ["AL", "AR", "Head"].iter().any(|part| name.starts_with(part));
    let mut seeded = Seeded::new(4);
    let held: Vec<(String, f64)> = independents(&case)
        .into_iter()
        .filter(|name| !arms(name))
        .map(|name| (name.clone(), position(&case, &name, &mut seeded)))
        .collect();
    let reduced = Pair::locked(&case, &held);
    let mut pair = Pair::new(&case, &reduced, &held);
    let model = &pair.small.model;
    assert!(model.tree_names().iter().all(|name| arms(name)), "{:?}", model.tree_names());
    assert!(model.active_names().iter().all(|name| arms(name)));
    assert_eq!(model.link_names(), case.compiled.model.link_names());
    // every closed form of the arms stays
    let kinds = |of: &[sarrus_dynamics::ClosureInfo]| -> Vec<_> {
        of.iter().filter(|of| arms(&of.name)).map(|of| (of.name.clone(), of.kind)).collect()
    };
    assert_eq!(kinds(model.closures()), kinds(case.compiled.model.closures()));
    assert_ne!(model.fingerprint(), case.compiled.model.fingerprint());
    pair.compare(&mut ledger, 4);
    ledger.finish();
}

#[test]
fn a_robot_without_the_other_branches_has_the_motion_of_the_whole_and_forces_of_its_own() {
    let case = Case::bundled("rh5v2_full");
    let mut ledger = Ledger::default();
    let links = case.compiled.model.link_names();
    let hand = links.iter().rposition(|link| link.starts_with("AL")).unwrap();
    let reduced = restricted(&case.description, &[hand]).unwrap();
    let mut pair = Pair::new(&case, &reduced, &[]);
    let names = pair.small.model.tree_names().to_vec();
    assert!(names.iter().all(|name| name.starts_with("AL") || name.starts_with("Body")));
    assert!(names.iter().any(|name| name.starts_with("AL")));
    // the path is whole: the torso's legs close its loops
    assert!(names.iter().any(|name| name == "BodyActR"));
    let (small, whole) = (&reduced.description, &case.description);
    assert!(small.links.len() < whole.links.len());
    let mass = |of: &sarrus_dynamics::description::Description| -> f64 {
        of.links.iter().filter_map(|link| link.inertial).map(|of| of.mass).sum()
    };
    assert!(mass(small) < mass(whole));

    // and it is the whole robot whose other branches weigh nothing
    let kept: BTreeSet<usize> = reduced.links.iter().copied().collect();
    let mut light = case.description.clone();
    for (l, link) in light.links.iter_mut().enumerate() {
        link.inertial = link.inertial.filter(|_| kept.contains(&l));
    }
    let fixed: BTreeSet<usize> = reduced.joints.iter().copied().collect();
    for (j, joint) in light.joints.iter_mut().enumerate().filter(|(j, _)| !fixed.contains(j)) {
        joint.terms = Default::default();
        let _ = j;
    }
    let compiled = sarrus_dynamics::Model::compile(&light).unwrap();
    let light = Case { compiled, description: light, ..case.clone() };
    pair.case = &light;
    pair.whole = sarrus_tests::run::Robot::new(light.compiled.exact.clone());
    pair.compare(&mut ledger, 3);
    ledger.finish();
}

#[test]
fn joints_inside_a_loop_can_be_held_where_its_independents_bring_them() {
    let mut ledger = Ledger::default();
    for (robot, name) in [("lambda", "slider"), ("ankle", "AnkleActL"), ("torso", "BodyBL1")] {
        let case = Case::bundled(robot);
        // the position of the joint at some pose: there the whole robot is rigid, or it has one
        // freedom less
        let names = case.compiled.model.tree_names();
        let name = names.iter().find(|of| *of == name).unwrap_or(&names[names.len() - 1]);
        let held = [(name.clone(), 0.0)];
        let reduced = Pair::locked(&case, &held);
        let model = sarrus_dynamics::Model::compile(&reduced.description).unwrap().model;
        assert_eq!(model.sizes().n_vy + 1, case.compiled.model.sizes().n_vy, "{robot}");
        assert!(!model.tree_names().contains(name));
        if model.sizes().n_vy == 0 {
            assert_eq!(model.sizes().n_v, 0, "{robot}");
        }
        let dropped = reduced.warnings.iter().any(|of| of.found.contains("no independent joint"));
        assert_eq!(dropped, model.sizes().n_vy > 0, "{robot}");
        let _ = (&mut ledger, joint(&case, name));
    }
}
