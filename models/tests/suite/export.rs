//! Robots written for other programs, and read again.

use std::collections::BTreeMap;
use std::path::Path;

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Workspace};
use sarrus_models::{
    Base, Exported, LoadError, Loaded, Options, Source, Target, as_tree, bundled, bundled_text,
    export, import, load,
};

/// Largest difference, relative to the largest number of a quantity.
const ROUNDING: f64 = 1e-13;

pub(super) fn robot(name: &str) -> Loaded {
    load(&Source::Bundled(name.to_owned()), &Options::default()).unwrap()
}

pub(super) fn exported(loaded: &Loaded, target: Target) -> Exported {
    export(loaded, target, "robot", false).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn file(exported: &Exported, ending: &str) -> Vec<u8> {
    let found = exported.files.iter().find(|(of, _)| *of == ending);
    found.unwrap_or_else(|| panic!("no {ending}")).1.clone().into_bytes()
}

/// The robot of our two files.
fn again(exported: &Exported) -> Loaded {
    let submechanisms = Some(file(exported, ".yml"));
    let source = Source::Text { urdf: file(exported, ".urdf"), submechanisms };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_bundled_robot_is_the_same_after_writing_our_own_files() {
    for (name, _) in bundled() {
        let loaded = robot(name);
        let written = exported(&loaded, Target::Urdf);
        assert_eq!(again(&written).description, loaded.description, "{name}");
    }
}

#[test]
fn a_scene_is_the_same_after_writing_our_own_files() {
    let lock = ["Head*", "Body*", "ALElbow"].map(|lock| lock.parse().unwrap()).to_vec();
    let options = Options { lock, base: Base::of_flag(Some("")), ..Options::default() };
    let loaded = load(&Source::Bundled("rh5v2_full".to_owned()), &options).unwrap();
    let written = exported(&loaded, Target::Urdf);
    let read = again(&written);
    assert_eq!(read.description, written.held);
    let [read, own] = [read, loaded].map(|of| of.compiled.model.tree_names().to_vec());
    assert_eq!(read, own);
}

/// Fields of a model from numbers by name.
pub(super) fn asked(
    model: &Model,
    request: Request,
    given: &BTreeMap<String, [f64; 2]>,
    fields: &[Field],
) -> Vec<Vec<f64>> {
    let given_fields = match request {
        Request::Kinematics => vec![Field::Y, Field::Yd, Field::QGuess],
        _ => vec![Field::Y, Field::Yd, Field::Ydd],
    };
    let query = Query::new(request, FieldSet::of(&given_fields), FieldSet::of(fields));
    let plan = Plan::new(model, &query).unwrap();
    let positions = model.independent_q_names();
    let mut input: Vec<f64> = positions.iter().map(|name| given[name][0]).collect();
    input.extend(model.independent_names().iter().map(|name| given[name][1]));
    match request {
        Request::Kinematics => {
            input.extend(model.tree_q_names().iter().map(|name| given[name][0]));
        }
        _ => input.extend(model.independent_names().iter().map(|_| 0.0)),
    }
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, &mut Workspace::new(model), &input, &mut output);
    assert_eq!(answer.status, Status::Ok);
    let slots = fields.iter().map(|field| plan.want().slot(*field).unwrap());
    slots.map(|slot| output[slot.range()].to_vec()).collect()
}

/// Closed positions and velocities by name, near zero.
pub(super) fn state(model: &Model, seed: usize) -> BTreeMap<String, [f64; 2]> {
    let number = |k: usize| ((k * 7 + seed * 13) as f64 * 0.37).sin();
    let given = FieldSet::of(&[Field::Y, Field::Yd]);
    let query = Query::new(Request::Kinematics, given, FieldSet::of(&[Field::Q, Field::Qd]));
    let plan = Plan::new(model, &query).unwrap();
    let names = model.independent_q_names();
    let mut input: Vec<f64> = (0..names.len()).map(|k| 0.02 * number(k)).collect();
    for (name, x) in names.iter().zip(&mut input) {
        if name.ends_with("/qw") {
            *x = 1.0;
        }
    }
    // a unit quaternion
    for k in 3..names.len() {
        if names[k].ends_with("/qw") {
            let length = input[k - 3..=k].iter().map(|x| x * x).sum::<f64>().sqrt();
            input[k - 3..=k].iter_mut().for_each(|x| *x /= length);
        }
    }
    input.extend((0..model.independent_names().len()).map(|k| number(k + 50)));
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, &mut Workspace::new(model), &input, &mut output);
    assert_eq!(answer.status, Status::Ok);
    let mut found: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for (k, name) in model.tree_q_names().iter().enumerate() {
        found.entry(name.clone()).or_default()[0] = output[k];
    }
    let offset = model.tree_q_names().len();
    for (k, name) in model.tree_names().iter().enumerate() {
        found.entry(name.clone()).or_default()[1] = output[offset + k];
    }
    found
}

pub(super) fn size(of: &[f64]) -> f64 {
    of.iter().fold(0.0, |size: f64, x| size.max(x.abs()))
}

/// M and bias forces of the trees of two robots with the same joints, by name.
pub(super) fn same_trees(
    name: &str,
    [ours, theirs]: [&Model; 2],
    at: &BTreeMap<String, [f64; 2]>,
    rounding: f64,
) {
    let fields = [Field::TauY, Field::MY];
    let a = asked(ours, Request::InverseDynamics, at, &fields);
    let b = asked(theirs, Request::InverseDynamics, at, &fields);
    let n = ours.independent_names().len();
    let to = order(ours.independent_names(), theirs.independent_names());
    let gap = (0..n).map(|i| (a[0][i] - b[0][to[i]]).abs()).fold(0.0, f64::max);
    assert!(gap <= rounding * size(&a[0]).max(1.0), "{name}: forces {gap:e}");
    let gap = (0..n * n).map(|k| (a[1][k] - b[1][to[k / n] * n + to[k % n]]).abs());
    let gap = gap.fold(0.0, f64::max);
    assert!(gap <= rounding * size(&a[1]).max(0.1), "{name}: M {gap:e}");
}

pub(super) fn order(from: &[String], to: &[String]) -> Vec<usize> {
    from.iter().map(|name| to.iter().position(|of| of == name).unwrap()).collect()
}

pub(super) fn compiled(name: &str, of: &Description) -> Model {
    Model::compile(of).unwrap_or_else(|e| panic!("{name}: {e}")).model
}

/// M, bias forces and K, K̇ q̇ of two robots with the same joints, by name.
pub(super) fn same(name: &str, original: &Description, held: &Description, other: &Description) {
    let model = compiled(name, original);
    let [ours, theirs] = [held, other].map(|of| compiled(name, &as_tree(of)));
    let [held, other] = [held, other].map(|of| compiled(name, of));
    let n = ours.independent_names().len();
    for seed in 0..3 {
        let at = state(&model, seed);
        same_trees(name, [&ours, &theirs], &at, ROUNDING);

        let fields = [Field::K, Field::KBias];
        let a = asked(&held, Request::Kinematics, &at, &fields);
        let b = asked(&other, Request::Kinematics, &at, &fields);
        assert_eq!(a[1].len(), b[1].len(), "{name}: rows");
        let to = order(held.tree_names(), other.tree_names());
        for (row, bias) in a[0].chunks(n).zip(&a[1]) {
            let gap = |k: usize| {
                let gaps = (0..n).map(|j| (row[j] - b[0][k * n + to[j]]).abs());
                gaps.fold((bias - b[1][k]).abs(), f64::max)
            };
            let least = (0..b[1].len()).map(gap).fold(f64::INFINITY, f64::min);
            assert!(least <= ROUNDING * size(row).max(bias.abs()).max(1.0), "{name}: K {least:e}");
        }
    }
}

/// The robot of a file of another format.
pub(super) fn imported(text: Vec<u8>) -> Loaded {
    let path = Path::new("/nowhere/robot.xml");
    let found = import(path, Some(text), &[], &Options::default());
    let found = found.unwrap_or_else(|error| panic!("{error}"));
    assert!(found.report.errors.is_empty(), "{}", found.report);
    let source = Source::Text { urdf: found.urdf, submechanisms: Some(found.submechanisms) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_bundled_robot_is_the_same_after_a_way_through_mjcf() {
    for (name, _) in bundled() {
        let loaded = robot(name);
        let written = exported(&loaded, Target::Mjcf);
        let read = imported(file(&written, ".xml"));
        let of = |of: &Loaded| {
            let mut names: Vec<String> = of.compiled.model.info().active.clone();
            names.sort();
            names
        };
        assert_eq!(of(&read), of(&loaded), "{name}");
        same(name, &loaded.description, &written.held, &read.description);
    }
}

/// A model of MJCF beside this file.
pub(super) fn mjcf(name: &str) -> Loaded {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/mjcf");
    let urdf = folder.join(format!("{name}.xml"));
    let source = Source::Files { urdf, submechanisms: None };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// With couplings to one joint and to several, springs, rotors, balls, welds, free bodies.
const MODELS: [&str; 6] = ["ankle", "gripper", "knee", "leg", "rules", "tied"];

#[test]
fn robots_of_mjcf_are_the_same_after_writing_our_own_files() {
    for name in MODELS {
        let loaded = mjcf(name);
        let written = exported(&loaded, Target::Urdf);
        assert_eq!(again(&written).description, loaded.description, "{name}");
    }
}

#[test]
fn robots_of_mjcf_are_the_same_after_a_way_through_mjcf() {
    for name in MODELS {
        let loaded = mjcf(name);
        let written = exported(&loaded, Target::Mjcf);
        let read = imported(file(&written, ".xml"));
        same(name, &loaded.description, &written.held, &read.description);
    }
}

/// `lambda` with these lines behind its submechanisms, and text of its URDF replaced.
fn lambda(lines: &str, [from, to]: [&str; 2]) -> Loaded {
    let (urdf, submechanisms) = bundled_text("lambda").unwrap();
    assert!(urdf.contains(from));
    let urdf = urdf.replace(from, to).into_bytes();
    let submechanisms = Some(format!("{submechanisms}\n{lines}").into_bytes());
    load(&Source::Text { urdf, submechanisms }, &Options::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn motors_are_written_to_our_own_files_and_named_where_a_format_has_none() {
    let motor = "actuators:\n- joint: ElbowAct\n  torque_speed: [[0.3, 2000], [0.5, 0]]\n  \
                 braking_torque_speed: [[0.3, 2500], [0.5, 0]]\n  continuous_torque: 400\n  \
                 thermal_time: 30\n  series_stiffness: 5e5\n  power: 300\n  rotor_inertia: 1e-5\n  gear_ratio: -3000\n  \
                 efficiency: [0.9, 0.8]\n  friction: {coulomb: 20, viscous: 3, speed: 0.02}\n";
    let loaded = lambda(motor, ["", ""]);
    assert_eq!(again(&exported(&loaded, Target::Urdf)).description, loaded.description);
    let written = exported(&loaded, Target::Mjcf);
    let notes: Vec<&str> = written.report.notes.iter().map(|note| note.found.as_str()).collect();
    assert!(notes.contains(&"the motor of `ElbowAct` has limits over its speed"), "{notes:?}");
    let read = imported(file(&written, ".xml"));
    same("motor", &loaded.description, &written.held, &read.description);
    // MuJoCo refuses an inertia that breaks the triangle inequality by a rounding
    let loaded = lambda("", ["ixx=\"0.014\"", "ixx=\"0.0140000001\""]);
    let written = exported(&loaded, Target::Mjcf);
    let text = String::from_utf8(file(&written, ".xml")).unwrap();
    assert!(text.contains("diaginertia=\"0.013999999999999999 0.001 0.013\""), "{text}");
    let notes = &written.report.notes;
    assert!(notes.iter().any(|of| of.found.contains("`Elbow_Link` is that of no body")));
    // SDF has no rotor: an error, or a warning
    let loaded = lambda(motor, ["", ""]);
    let refused = export(&loaded, Target::Sdf, "robot", false);
    let Err(LoadError::Faults(report)) = refused else { panic!("written") };
    assert!(report.errors[0].found.contains("the rotor of `ElbowAct`"), "{report}");
    let written = export(&loaded, Target::Sdf, "robot", true).unwrap();
    assert!(written.report.warnings[0].found.contains("the rotor of `ElbowAct`"));
}

#[test]
fn loops_that_a_type_defines_are_written() {
    let (urdf, submechanisms) = bundled_text("lambda").unwrap();
    let alone = submechanisms.split("  loop_constraints:").next().unwrap();
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(alone.into()) };
    let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(loaded.description.submechanisms[0].loops.is_empty());
    let written = exported(&loaded, Target::Mjcf);
    let read = imported(file(&written, ".xml"));
    same("lambda", &loaded.description, &written.held, &read.description);
    assert_eq!(written.held.submechanisms[0].loops.len(), 1);
    assert_eq!(again(&exported(&loaded, Target::Urdf)).description, loaded.description);
}

#[test]
fn cuts_that_a_format_lacks_are_refused_by_name() {
    let (urdf, submechanisms) = bundled_text("five_bar").unwrap();
    // a cut that holds a point on a line lets the loop leave its plane where a joint does
    let planar = "cut_joint_type: planar_revolute";
    assert!(submechanisms.contains(planar));
    let with = |cut: &str, urdf: &str| {
        let submechanisms = Some(submechanisms.replace(planar, cut).into_bytes());
        let source = Source::Text { urdf: urdf.into(), submechanisms };
        load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
    };
    let loaded = with("cut_joint_type: cylindrical", urdf);
    for target in [Target::Mjcf, Target::Sdf, Target::Pinocchio, Target::Gepetto] {
        let Err(LoadError::Faults(report)) = export(&loaded, target, "robot", false) else {
            panic!("{target:?} is written")
        };
        let fault = &report.errors[0];
        assert!(fault.found.starts_with("the cut `pin` holds a"), "{report}");
        assert!(fault.line > 1 && fault.file.ends_with("yml"), "{report}");
    }
    // as a hinge it is two points on its axis, in SDF a joint
    let loaded = with("cut_joint_type: revolute", urdf);
    let written = exported(&loaded, Target::Mjcf);
    let read = imported(file(&written, ".xml"));
    same("hinge", &loaded.description, &written.held, &read.description);
    let sdf = String::from_utf8(file(&exported(&loaded, Target::Sdf), ".sdf")).unwrap();
    assert!(sdf.contains("<joint name=\"FiveBar/pin\" type=\"revolute\">"), "{sdf}");
}
