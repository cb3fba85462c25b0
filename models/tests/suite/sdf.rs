//! SDF: written and read again, against Drake, and rules that are refused or noted.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use sarrus_dynamics::description::{Description, Inertial, JointKind, Placement, Terms};
use sarrus_dynamics::{Field, Model, Request};
use sarrus_models::{
    Imported, LoadError, Loaded, Options, Report, Source, Target, as_tree, bundled, export, import,
    load,
};
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

const MASS: &str = "<inertial><mass>1</mass></inertial>";
const AXIS: &str = "<axis><xyz>0 0 1</xyz></axis>";

/// A model of two links and a joint, with these parts in the joint and behind it.
fn model(joint: &str, behind: &str) -> String {
    format!(
        "<sdf version=\"1.9\"><model name=\"m\"><link name=\"a\">{MASS}</link>\n<link \
         name=\"b\">{MASS}</link><joint name=\"w\" type=\"fixed\"><parent>world</parent>\
         <child>a</child></joint>\n<joint name=\"j\" {joint}</joint>\n{behind}</model></sdf>"
    )
}

const HINGE: &str = "type=\"revolute\"><parent>a</parent><child>b</child>";

fn read(text: &str, lenient: bool) -> Result<Imported, Report> {
    let options = Options { lenient, ..Options::default() };
    match import(Path::new("/nowhere/m.sdf"), Some(text.as_bytes().to_vec()), &[], &options) {
        Ok(imported) => Ok(imported),
        Err(LoadError::Faults(report)) => Err(report),
        Err(other) => panic!("{other}"),
    }
}

fn report(text: &str, lenient: bool) -> Report {
    read(text, lenient).map_or_else(|report| report, |imported| imported.report)
}

#[test]
fn a_part_of_sdf_that_changes_numbers_and_has_no_expression_is_an_error_or_a_warning() {
    let good = model(&format!("{HINGE}{AXIS}"), "");
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    let second = "<joint name=\"k\" type=\"revolute\"><parent>a</parent><child>b</child><axis>\
                  <xyz>0 0 1</xyz><dynamics><damping>1</damping></dynamics></axis></joint>";
    let damped = AXIS.replace("</axis>", "<dynamics><damping>1</damping></dynamics></axis>");
    for (text, words, line) in [
        (
            model(&HINGE.replace("revolute", "gearbox"), ""),
            "the joint `j` of type `gearbox`, expected revolute",
            3,
        ),
        (with("<link name=\"b\">", "<link name=\"b\"><gravity>0</gravity>"), "`gravity`", 2),
        (with("<link name=\"b\">", "<link name=\"b\"><kinematic>1</kinematic>"), "`kinematic`", 2),
        (
            with(
                "<link name=\"b\">",
                "<link name=\"b\"><velocity_decay><linear>0.1</linear>\
                 </velocity_decay>",
            ),
            "the attribute `linear` of `velocity_decay`",
            2,
        ),
        (with("<inertial>", "<inertial auto=\"true\">"), "the attribute `auto`", 1),
        (with("<inertial>", "<inertial><fluid_added_mass/>"), "`fluid_added_mass` is not read", 1),
        (with("<inertial>", "<inertial><pose relative_to=\"b\">1 0 0 0 0 0</pose>"), "`pose`", 1),
        (model(&format!("{HINGE}{AXIS}"), "<wobble>1</wobble>"), "`wobble`", 4),
        (with("<axis>", "<axis>\n<wobble a=\"1\"/>"), "the element `wobble` is not read", 4),
        (with("<model name=\"m\">", "<model name=\"m\" placement_frame=\"b\">"), "`placement_f", 1),
        (
            model(&format!("{HINGE}{damped}"), second),
            "`k` closes a loop, and is more than a plain joint",
            4,
        ),
        (
            model(
                &format!("{HINGE}{AXIS}"),
                "<plugin name=\"JointController\"><joint_name>x\
                  </joint_name></plugin>",
            ),
            "a plug-in drives `x`, which is no joint",
            4,
        ),
    ] {
        let [strict, lenient] = [false, true].map(|lenient| report(&text, lenient));
        let has = |all: &[sarrus_models::Diagnostic]| {
            all.iter().any(|of| of.to_string().contains(words) && of.line == line)
        };
        assert!(has(&strict.errors), "{words}: {strict}");
        assert!(has(&lenient.warnings) && lenient.errors.is_empty(), "{words}: {lenient}");
    }
}

#[test]
fn a_faulty_file_of_sdf_is_refused_with_its_place() {
    let hinge = |axis: &str| model(&format!("{HINGE}{axis}"), "");
    let frame = |of: &str| model(&format!("{HINGE}{AXIS}"), of);
    let two = "</model><model name=\"n\"><link name=\"c\"/>";
    for (text, words, line) in [
        (hinge(""), "the joint `j` has no `axis`", 3),
        (hinge("<axis><xyz>0 0 0</xyz></axis>"), "the axis of the joint `j` is zero", 3),
        (hinge("<axis><xyz>0 0</xyz></axis>"), "`xyz` of `axis` holds 2 numbers", 3),
        (hinge("<axis><xyz expressed_in=\"c\">0 0 1</xyz></axis>"), "`c`, which has no place", 3),
        (
            hinge("<axis><xyz>0 0 1</xyz><limit><lower>1</lower><upper>0</upper></limit></axis>"),
            "the limits of `j`, expected lower ≤ upper",
            3,
        ),
        (
            hinge("<axis><xyz>0 0 1</xyz><limit><lower>x</lower></limit></axis>"),
            "`lower`: `x` is not a number",
            3,
        ),
        (
            hinge("<axis><xyz>0 0 1</xyz><mimic joint=\"x\"/></axis>"),
            "`j` follows `x`, expected a joint of one axis in the tree",
            3,
        ),
        (model(&HINGE.replace(">b<", ">a<"), ""), "the ends of the joint `j`", 3),
        (model(&HINGE.replace(">b<", ">world<"), ""), "the ends of the joint `j`", 3),
        (model(&HINGE.replace(">b<", ">x<"), ""), "the frame `j` is relative to none", 3),
        (
            model(&format!("{}{AXIS}", HINGE.replace("revolute", "screw")), ""),
            "a screw without a pitch",
            3,
        ),
        (frame("<frame name=\"f\"><pose relative_to=\"f\"/></frame>"), "`f` is relative to no", 4),
        (frame("<frame name=\"f\"><pose>1 2 3</pose></frame>"), "numbers that are no pose", 4),
        (frame("<frame name=\"f\"><pose degrees=\"x\"/></frame>"), "`degrees` of `pose` is `x`", 4),
        (frame("<link name=\"b\"/>"), "a second frame is named `b`", 4),
        (frame("<joint name=\"b\" type=\"ball\"><child>a</child></joint>"), "named `b`", 4),
        (frame(two), "2 models that move", 4),
        ("<sdf version=\"1.9\"/>".to_owned(), "0 models that move", 1),
    ] {
        let found = report(&text, true);
        let is_it =
            |of: &&sarrus_models::Diagnostic| of.to_string().contains(words) && of.line == line;
        assert!(found.errors.iter().any(|of| is_it(&of)), "{words}: {found}");
    }
}

#[test]
fn harmless_parts_of_sdf_are_noted_and_gravity_is_told() {
    let text = model(
        &format!("{HINGE}{AXIS}<sensor name=\"s\"/><physics/>"),
        "<self_collide>1</self_collide><plugin name=\"x\"/><link name=\"c\"/>",
    );
    let found = read(&text, false).unwrap();
    assert!(found.report.errors.is_empty(), "{}", found.report);
    let notes: Vec<&str> = found.report.notes.iter().map(|note| note.found.as_str()).collect();
    for words in [
        "the element `sensor` is not read",
        "the element `physics` is not read",
        "the element `plugin` is not read",
        "`self_collide` of `model` is not read",
        "the link `c` has no inertial",
        "the joint `floating_base` moves a free link",
        "the model has no actuators",
    ] {
        assert!(notes.contains(&words), "{words}: {notes:?}");
    }
    assert_eq!(found.independent.len(), 7);
    for (world, words) in [
        ("", "the gravity of a world is 0 0 -9.8 where its file has none"),
        ("<gravity>0 0 -1.62</gravity>", "the gravity 0 0 -1.62, which is no part of a URDF"),
    ] {
        let text = text.replace("<model name", &format!("<world name=\"w\">{world}<model name"));
        let found = report(&text.replace("</model>", "</model></world>"), false);
        let all: Vec<&String> =
            found.notes.iter().chain(&found.warnings).map(|of| &of.found).collect();
        assert!(all.iter().any(|of| *of == words), "{words}: {all:?}");
    }
}

#[test]
fn joints_with_a_spring_or_a_range_are_in_the_tree_and_controllers_drive() {
    let text = |parts: [&str; 3], plugin: &str| {
        let [one, two, three] = parts.map(|part| format!("<axis><xyz>0 1 0</xyz>{part}</axis>"));
        format!(
            "<sdf version=\"1.9\"><model name=\"m\"><link name=\"a\">{MASS}</link><joint name=\"w\" \
             type=\"fixed\"><parent>world</parent><child>a</child></joint><link name=\"b\">{MASS}\
             </link><link name=\"c\"><pose>0.3 0 0.2 0 0 0</pose>{MASS}</link><link name=\"d\">\
             <pose>0.3 0 0.5 0 0 0</pose>{MASS}</link><joint name=\"one\" type=\"revolute\"><parent>\
             a</parent><child>b</child>{AXIS_Y}</joint><joint name=\"two\" type=\"revolute\"><pose>-0.2 0 0.1 0 0 0</pose>\
             <parent>b</parent><child>d</child>{one}</joint><joint name=\"three\" \
             type=\"revolute\"><parent>a</parent><child>c</child>{two}</joint><joint name=\"four\" \
             type=\"revolute\"><parent>c</parent><child>d</child>{three}</joint>{plugin}</model></sdf>"
        )
    };
    const AXIS_Y: &str = "<axis><xyz>0 1 0</xyz></axis>";
    let spring = "<dynamics><spring_stiffness>3</spring_stiffness></dynamics>";
    let range = "<limit><lower>-1</lower><upper>1</upper></limit>";
    for (parts, cut) in [
        (["", "", ""], "four"),
        (["", "", range], "two"),
        ([range, "", spring], "two"),
        ([spring, "", range], "four"),
    ] {
        let found = read(&text(parts, ""), false).unwrap();
        assert!(found.report.errors.is_empty(), "{}", found.report);
        let yaml = String::from_utf8(found.submechanisms).unwrap();
        assert!(yaml.contains(&format!("cut_joint: {cut}\n")), "{cut}: {yaml}");
        let has_range = parts[if cut == "two" { 0 } else { 2 }] == range;
        let warns = found.report.warnings.iter().any(|of| of.found.contains("has a range"));
        assert_eq!(warns, has_range, "{cut}: {}", found.report);
    }
    let plugin = "<plugin name=\"gz::sim::systems::JointController\"><joint_name>three\
                  </joint_name><p>1</p></plugin>";
    let found = read(&text(["", "", ""], plugin), false).unwrap();
    let yaml = String::from_utf8(found.submechanisms).unwrap();
    assert!(yaml.contains("jointnames_active: [three]"), "{yaml}");
    assert!(yaml.contains("jointnames_independent: [three]"), "{yaml}");
}

#[test]
fn limits_couplings_and_drake_rotors_are_read() {
    let axis = "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><effort>5</effort><velocity>-1\
                </velocity></limit></axis><rotor_inertia>0.002</rotor_inertia><gear_ratio>9\
                </gear_ratio>";
    let follower = "<link name=\"c\"/><joint name=\"k\" type=\"revolute\"><parent>b</parent><child>c\
                    </child><axis><xyz>1 0 0</xyz><mimic joint=\"j\"><multiplier>2</multiplier>\
                    <offset>0.5</offset><reference>0.1</reference></mimic></axis></joint>";
    let text = model(&format!("{HINGE}{axis}"), follower);
    let found = read(&text, false).unwrap();
    assert!(found.report.errors.is_empty(), "{}", found.report);
    let source = Source::Text { urdf: text.into_bytes(), submechanisms: None };
    let loaded = load(&source, &Options::default()).unwrap();
    let joint = |name: &str| {
        loaded.description.joints.iter().find(|joint| joint.name == name).unwrap().clone()
    };
    let limits = joint("j").limits.unwrap();
    let none = f64::INFINITY;
    assert_eq!(
        [limits.lower, limits.upper, limits.effort, limits.velocity],
        [-1.0, none, 5.0, none]
    );
    assert_eq!([joint("j").terms.rotor_inertia, joint("j").terms.gear_ratio], [0.002, 9.0]);
    let coupling = joint("k").coupling.unwrap();
    assert_eq!(coupling.terms[0].1, 2.0);
    assert!((coupling.offset - 0.3).abs() < 1e-15);
}

#[test]
fn large_numbers_stay_and_axes_of_a_later_version_are_in_the_joint() {
    let heavy = MASS.replace("<mass>1<", "<mass>1e17<");
    let text = model(&format!("{HINGE}{AXIS}"), "").replacen(MASS, &heavy, 1);
    let loaded = |text: &str| {
        let source = Source::Text { urdf: text.as_bytes().to_vec(), submechanisms: None };
        load(&source, &Options::default()).unwrap().description
    };
    let masses = loaded(&text).links.into_iter().filter_map(|of| of.inertial).map(|of| of.mass);
    assert!(masses.into_iter().any(|mass| mass == 1e17));
    let turned = format!("{HINGE}<pose>0 0 0 1.5707963267948966 0 0</pose>{AXIS}");
    for (version, is_turned) in [("1.9", true), ("2.0", true), ("1.4", false)] {
        let text = model(&turned, "").replace("1.9", version);
        let joint = loaded(&text).joints.into_iter().find(|joint| joint.name == "j").unwrap();
        let [x, y, z] = joint.axis;
        let is_along_y = x.abs() < 1e-15 && (y + 1.0).abs() < 1e-15 && z.abs() < 1e-15;
        assert_eq!(is_along_y, is_turned, "{version}: {:?}", joint.axis);
    }
}

/// Two wheels of one file on a model.
const WHEELS: &str = "<sdf version=\"1.9\"><model name=\"m\"><link name=\"a\"><inertial><mass>1\
    </mass></inertial></link>\
    <include><uri>model://wheel</uri><name>left</name><pose>0 0.5 0 0 0 0</pose></include>\
    <include><uri>wheel/model.sdf</uri><name>right</name>\
    <pose relative_to=\"left\">0 -1 0 0 0 0</pose></include>\
    <joint name=\"l\" type=\"revolute\"><parent>a</parent><child>left::disc</child><axis><xyz>0 1 \
    0</xyz></axis></joint>\
    <joint name=\"r\" type=\"revolute\"><parent>a</parent><child>right::disc</child><axis><xyz>0 1 \
    0</xyz></axis></joint></model></sdf>";
const WHEEL: &str = "<sdf version=\"1.9\"><model name=\"wheel\"><pose>9 9 9 0 0 0</pose><link \
    name=\"disc\"><inertial><mass>3</mass></inertial></link></model></sdf>";

#[test]
fn models_of_other_files_are_included_below_the_folder_only() {
    let name = format!("sarrus_sdf_include_{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    fs::create_dir_all(folder.join("m/wheel")).unwrap();
    let words = |robot: &str, wheel: &str, include: &[std::path::PathBuf]| {
        fs::write(folder.join("m/robot.sdf"), robot).unwrap();
        fs::write(folder.join("m/wheel/model.sdf"), wheel).unwrap();
        match import(&folder.join("m/robot.sdf"), None, include, &Options::default()) {
            Ok(imported) => Ok(imported),
            Err(error) => Err(error.to_string()),
        }
    };
    let found = words(WHEELS, WHEEL, &[]).unwrap();
    assert!(found.report.errors.is_empty(), "{}", found.report);
    let source = Source::Files { urdf: folder.join("m/robot.sdf"), submechanisms: None };
    let of = load(&source, &Options::default()).unwrap().description;
    for (name, y) in [("l", 0.5), ("r", -0.5)] {
        let joint = of.joints.iter().find(|joint| joint.name == name).unwrap();
        assert_eq!(joint.origin.xyz, [0.0, y, 0.0], "{name}");
        let mass = of.links[joint.child].inertial.unwrap().mass;
        assert_eq!(mass, 3.0);
    }
    let own = WHEEL.replace("<link", "<include><uri>model.sdf</uri></include><link");
    let own = own.replace("model.sdf", "wheel/model.sdf");
    let no_model = "<sdf version=\"1.9\"/>";
    let outside = WHEELS.replace("wheel/model.sdf", "../other.sdf");
    let gone = WHEELS.replace("wheel/model.sdf", "gone.sdf");
    fs::write(folder.join("other.sdf"), WHEEL).unwrap();
    for (robot, wheel, expected) in [
        (WHEELS, own.as_str(), "is included a second time"),
        (WHEELS, no_model, "expected a file with a model, of version 1.5 or later"),
        (WHEELS, &WHEEL.replace("1.9", "1.4"), "expected a file with a model, of version 1.5"),
        (&outside, WHEEL, "--include-dir"),
        (&gone, WHEEL, "cannot be opened"),
        (&WHEELS.replace("<uri>model://wheel</uri>", ""), WHEEL, "`include` has no `uri`"),
    ] {
        let found = words(robot, wheel, &[]).unwrap_err();
        assert!(found.contains(expected), "{expected}: {found}");
    }
    words(&outside, WHEEL, std::slice::from_ref(&folder)).unwrap();
    // the name of a folder may have a dot, below the first file or below an included folder
    fs::create_dir_all(folder.join("m/wheel.v2")).unwrap();
    fs::create_dir_all(folder.join("far.v2")).unwrap();
    fs::write(folder.join("m/wheel.v2/model.sdf"), WHEEL).unwrap();
    fs::write(folder.join("far.v2/model.sdf"), WHEEL).unwrap();
    words(&WHEELS.replace("model://wheel", "model://wheel.v2"), WHEEL, &[]).unwrap();
    let far = WHEELS.replace("model://wheel", "model://far.v2");
    assert!(words(&far, WHEEL, &[]).unwrap_err().contains("cannot be opened"));
    words(&far, WHEEL, std::slice::from_ref(&folder)).unwrap();
    fs::remove_dir_all(folder).unwrap();
}
