//! SDF: written and read again, against Drake, and rules that are refused or noted.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use sarrus_dynamics::description::{Description, Inertial, JointKind, Placement, Terms};
use sarrus_dynamics::{Field, Model, Request};
use sarrus_models::{Loaded, Options, Source, Target, as_tree, bundled, export, load};
use serde_json::Value;

use super::export::{asked, compiled, file, imported, mjcf, order, robot, same_trees, size, state};

/// Largest difference, relative to the largest number of a quantity.
const ROUNDING: f64 = 1e-12;

/// The robot with the least mass that SDF has for a link.
fn with_mass(of: &Description) -> Description {
    let mut of = of.clone();
    let least = 1e-12;
    let inertia = [least, 0.0, 0.0, least, 0.0, least];
    for link in of.links.iter_mut().filter(|link| link.name != "world") {
        if link.inertial.is_none_or(|of| of.mass == 0.0) {
            let origin = Placement::default();
            link.inertial = Some(Inertial { origin, mass: least, inertia });
        }
    }
    of
}

/// The part of a row that is no combination of others.
fn rest(row: &[f64], others: &[Vec<f64>]) -> Vec<f64> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let across = |v: &[f64], basis: &[Vec<f64>]| {
        let mut rest = v.to_vec();
        for _ in 0..2 {
            for b in basis {
                let along = dot(&rest, b);
                rest.iter_mut().zip(b).for_each(|(x, b)| *x -= along * b);
            }
        }
        rest
    };
    for other in others {
        let rest = across(other, &basis);
        let length = dot(&rest, &rest).sqrt();
        if length > 1e-9 * size(other).max(1e-9) {
            basis.push(rest.iter().map(|x| x / length).collect());
        }
    }
    across(row, &basis)
}

/// Rows of K with K̇ q̇, columns in the order of these names.
fn rows(model: &Model, at: &BTreeMap<String, [f64; 2]>, names: &[String]) -> Vec<Vec<f64>> {
    let found = asked(model, Request::Kinematics, at, &[Field::K, Field::KBias]);
    let to = order(names, model.tree_names());
    let row = |(row, bias): (&[f64], &f64)| {
        to.iter().map(|k| row[*k]).chain([*bias]).collect::<Vec<f64>>()
    };
    found[0].chunks(names.len()).zip(&found[1]).map(row).collect()
}

fn independent(of: &Description) -> Vec<String> {
    let all = of.submechanisms.iter().flat_map(|part| &part.independent);
    all.map(|joint| of.joints[*joint].name.clone()).collect()
}

/// M_y and τ_y of a robot whose tree differs: a joint that closes a loop of the first one carries a
/// free body in the second one.
fn same_in_part(name: &str, held: &Description, other: &Description) {
    let names = independent(other);
    let mut held = with_mass(held);
    for part in &mut held.submechanisms {
        let tree = part.spanning_tree.clone();
        let is_it = |name: &String| tree.iter().copied().find(|j| held.joints[*j].name == *name);
        part.independent = names.iter().filter_map(is_it).collect();
        part.kind = sarrus_dynamics::description::SubmechanismKind::Numerical;
    }
    let [own, read] = [&held, other].map(|of| compiled(name, of));
    for seed in 0..3 {
        let at = state(&own, seed);
        same_trees(name, [&own, &read], &at, ROUNDING);
    }
}

/// M, forces and the space of the rows of K with K̇ q̇ of two robots at states of the first one;
/// M_y and τ_y for its independent joints.
fn same(name: &str, held: &Description, mut other: Description) {
    let free = |of: &Description| -> Vec<(String, String)> {
        let joints = of.joints.iter().filter(|joint| joint.kind == JointKind::Floating);
        joints.map(|joint| (of.links[joint.child].name.clone(), joint.name.clone())).collect()
    };
    // a free joint has the name of its link
    for (link, own) in free(held) {
        let child = other.links.iter().position(|of| of.name == link).unwrap();
        let joint = other.joints.iter_mut().find(|joint| joint.child == child).unwrap();
        if joint.kind != JointKind::Floating {
            return same_in_part(name, held, &other);
        }
        joint.name = own;
    }
    let independent = independent(held);
    for part in &mut other.submechanisms {
        let tree = part.spanning_tree.clone();
        let is_it = |name: &String| tree.iter().copied().find(|j| other.joints[*j].name == *name);
        part.independent = independent.iter().filter_map(is_it).collect();
    }
    let held = with_mass(held);
    let [own, read] = [&held, &other].map(|of| compiled(name, of));
    let [own_tree, read_tree] = [&held, &other].map(|of| compiled(name, &as_tree(of)));
    for seed in 0..3 {
        let at = state(&own, seed);
        same_trees(name, [&own_tree, &read_tree], &at, ROUNDING);
        same_trees(name, [&own, &read], &at, ROUNDING);
        let names = own.tree_names();
        let both = [&own, &read].map(|model| rows(model, &at, names));
        for (some, others) in [(&both[0], &both[1]), (&both[1], &both[0])] {
            for row in some {
                let gap = size(&rest(row, others));
                assert!(gap <= ROUNDING * size(row).max(1.0), "{name}: K {gap:e}");
            }
        }
    }
}

/// Limits, springs and couplings of joints by name.
fn same_joints(name: &str, held: &Description, other: &Description) {
    for joint in held.joints.iter().filter(|joint| joint.kind != JointKind::Floating) {
        let found = other.joints.iter().find(|of| of.name == joint.name);
        let found = found.unwrap_or_else(|| panic!("{name}: {}", joint.name));
        let range = |of: &sarrus_dynamics::description::Joint| {
            of.limits.map(|of| [of.lower, of.upper, of.effort, of.velocity]).unwrap_or([
                f64::NEG_INFINITY,
                f64::INFINITY,
                f64::INFINITY,
                f64::INFINITY,
            ])
        };
        assert_eq!(range(found), range(joint), "{name}: {}", joint.name);
        assert_eq!(found.terms.damping, joint.terms.damping, "{name}");
        assert_eq!(found.terms.friction.coulomb, joint.terms.friction.coulomb, "{name}");
        assert_eq!(found.coupling.is_some(), joint.coupling.is_some(), "{name}");
    }
}

fn through(name: &str, loaded: &Loaded) -> bool {
    let written = match export(loaded, Target::Sdf, "robot", false) {
        Ok(written) => written,
        Err(error) => {
            println!(
                "{name}: SDF cannot express it: {}",
                error.to_string().lines().next().unwrap()
            );
            return false;
        }
    };
    let read = imported(file(&written, ".sdf"));
    same_joints(name, &written.held, &read.description);
    same(name, &written.held, read.description);
    true
}

#[test]
fn every_bundled_robot_is_the_same_after_a_way_through_sdf() {
    let count = bundled().filter(|(name, _)| through(name, &robot(name))).count();
    assert!(count >= 24, "{count}");
}

/// With ball joints, springs, dampers, a floating base; without the rotors and the dampers of ball
/// joints that SDF lacks.
#[test]
fn robots_of_mjcf_are_the_same_after_a_way_through_sdf() {
    for name in ["ankle", "leg"] {
        let mut loaded = mjcf(name);
        loaded.description.joints.iter_mut().for_each(|joint| joint.terms.rotor_inertia = 0.0);
        if name == "leg" {
            let words = export(&loaded, Target::Sdf, "robot", false).unwrap_err().to_string();
            assert!(
                words.contains("the ball joint `achilles_joint` has a spring or a damper"),
                "{words}"
            );
            let balls = loaded.description.joints.iter_mut();
            let balls = balls.filter(|joint| joint.kind == JointKind::Spherical);
            balls.for_each(|joint| joint.terms = Terms::default());
        }
        assert!(through(name, &loaded), "{name}");
    }
}

/// Compares a file with Drake's vectors: M and forces, of the tree where there are loops, and the
/// space of the rows of K with K̇ q̇.
fn agrees(name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/sdf");
    let text = fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let source = Source::Files { urdf: folder.join(format!("{name}.sdf")), submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let numbers = |of: &Value| -> Vec<f64> {
        of.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let tree: Vec<String> = serde_json::from_value(vectors["tree"].clone()).unwrap();
    let has_loops = loaded.description.submechanisms.iter().any(|part| !part.loops.is_empty());
    let model = match has_loops {
        true => compiled(name, &as_tree(&loaded.description)),
        false => loaded.compiled.model.clone(),
    };
    let to = order(&tree, model.independent_names());
    let n = tree.len();
    assert_eq!(model.independent_names().len(), n, "{name}");
    for state in vectors["states"].as_array().unwrap() {
        let mut at: BTreeMap<String, [f64; 2]> = BTreeMap::new();
        for (k, key) in ["q", "v"].into_iter().enumerate() {
            for (joint, value) in state[key].as_object().unwrap() {
                at.entry(joint.clone()).or_default()[k] = value.as_f64().unwrap();
            }
        }
        let found = asked(&model, Request::InverseDynamics, &at, &[Field::TauY, Field::MY]);
        let wanted = numbers(&state["h"]);
        let gap = (0..n).map(|i| (found[0][to[i]] - wanted[i]).abs()).fold(0.0, f64::max);
        assert!(gap <= ROUNDING * size(&wanted), "{name}: forces {gap:e}");
        let rows_of = |key: &str| -> Vec<Vec<f64>> {
            state[key].as_array().unwrap().iter().map(numbers).collect()
        };
        let wanted = rows_of("M").concat();
        let own = |k: usize| found[1][to[k / n] * n + to[k % n]];
        let gap = (0..n * n).map(|k| (own(k) - wanted[k]).abs()).fold(0.0, f64::max);
        assert!(gap <= ROUNDING * size(&wanted), "{name}: M {gap:e}");
        if has_loops {
            let own = rows(&loaded.compiled.model, &at, &tree);
            let mut theirs = rows_of("K");
            let bias = numbers(&state["k_bias"]);
            theirs.iter_mut().zip(bias).for_each(|(row, bias)| row.push(bias));
            for (some, others) in [(&own, &theirs), (&theirs, &own)] {
                for row in some {
                    let gap = size(&rest(row, others));
                    assert!(gap <= ROUNDING * size(row).max(1.0), "{name}: K {gap:e}");
                }
            }
        }
    }
}

#[test]
fn frames_axes_inertia_and_joints_agree_with_drake() {
    agrees("rules");
}

#[test]
fn an_old_file_of_a_floating_robot_agrees_with_drake() {
    agrees("old");
}

#[test]
fn loops_agree_with_drakes_jacobians() {
    agrees("loops");
}
