//! Joints that follow others by curves: polynomials and tables.

use sarrus_dynamics::description::Curve;
use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_models::{LoadError, Loaded, Options, Source, Target, export, load};

use super::export::{exported, file, imported};

/// A cam that lifts a slide by a polynomial; the slide turns an arm by a table, with the cam.
pub(super) const URDF: &str = r#"<robot name="cam">
  <link name="base"/>
  <link name="wheel"><inertial><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="slide"><inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.2 0.05 0"/><mass value="0.5"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="cam" type="revolute"><parent link="base"/><child link="wheel"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="10" velocity="10"/></joint>
  <joint name="lift" type="prismatic"><origin xyz="0 0 0.3"/><parent link="base"/><child link="slide"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0.2 0 0"/><parent link="slide"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
  <transmission name="lifts"><joint name="lift"><depends_on joint="cam" polynomial="0 0.05 0.02 -0.01 0.003" about="0.1"/></joint></transmission>
  <transmission name="turns"><joint name="elbow"><depends_on joint="lift" table="-0.3 -0.5 -0.2 -0.42 -0.1 -0.25 0 0 0.1 0.31 0.2 0.6 0.3 0.8"/><depends_on joint="cam" multiplier="0.25" offset="0.1"/></joint></transmission>
</robot>"#;
pub(super) const YAML: &str = "submechanisms:\n- type: TRANSMISSION\n  contextual_name: cam\n  \
    jointnames_spanningtree: [cam, lift, elbow]\n  jointnames_independent: [cam]\n  \
    jointnames_active: [cam]\n";

fn source(urdf: &str, yaml: &str) -> Source {
    Source::Text { urdf: urdf.into(), submechanisms: Some(yaml.into()) }
}

fn loaded(urdf: &str, yaml: &str) -> Loaded {
    load(&source(urdf, yaml), &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// q, q̇ and q̈ of the joints at (y, ẏ, ÿ) of the only independent.
pub(super) fn motion(of: &Loaded, y: [f64; 3]) -> [Vec<f64>; 3] {
    let model = &of.compiled.model;
    let fields = |of: &[Field]| FieldSet::of(of);
    let given = fields(&[Field::Y, Field::Yd, Field::Ydd]);
    let want = fields(&[Field::Q, Field::Qd, Field::Qdd]);
    let plan = Plan::new(model, &Query::new(Request::Kinematics, given, want)).unwrap();
    let mut output = vec![0.0; plan.want().len()];
    let answer = plan.run(model, &mut Workspace::new(model), &y, &mut output);
    assert_eq!(answer.status, Status::Ok, "{y:?}");
    let n = model.sizes().n_v;
    [0, 1, 2].map(|k| output[k * n..(k + 1) * n].to_vec())
}

#[test]
fn a_polynomial_and_a_table_are_read_and_move_as_written() {
    let read = loaded(URDF, YAML);
    assert_eq!((&read.report.errors[..], &read.report.warnings[..]), (&[][..], &[][..]));
    let note = &read.report.notes[0].found;
    assert!(note.starts_with("the curve through a table of 7 points leaves them by "), "{note}");
    let coupling = read.description.joints[1].coupling.clone().unwrap();
    let coefficients = vec![0.0, 0.05, 0.02, -0.01, 0.003];
    assert_eq!(coupling.curves, [(0, Curve::Polynomial { about: 0.1, coefficients })]);
    let coupling = read.description.joints[2].coupling.clone().unwrap();
    assert_eq!((coupling.terms, coupling.offset), (vec![(0, 0.25)], 0.1));

    let [y, yd, ydd] = [0.7_f64, 1.3, 0.4];
    let d = y - 0.1;
    let lift = d * (0.05 + d * (0.02 + d * (-0.01 + d * 0.003)));
    let slope = 0.05 + d * (0.04 + d * (-0.03 + d * 0.012));
    let bend = 0.04 + d * (-0.06 + d * 0.036);
    let [q, qd, qdd] = motion(&read, [y, yd, ydd]);
    assert!((q[1] - lift).abs() < 1e-16);
    assert!((qd[1] - slope * yd).abs() < 1e-16);
    assert!((qdd[1] - slope * ydd - bend * yd * yd).abs() < 1e-16);
    // a point of the table: found where the cam lifts to it
    assert!((motion(&read, [0.1, 0.0, 0.0])[0][2] - 0.125).abs() < 1e-16);
}

#[test]
fn the_driven_end_of_a_curve_may_be_the_independent_one() {
    let read = loaded(URDF, YAML);
    let turned = loaded(URDF, &YAML.replace("independent: [cam]", "independent: [lift]"));
    for y in [-0.2, 0.1, 0.7, 1.6] {
        let [q, qd, qdd] = motion(&read, [y, 1.3, 0.4]);
        let again = motion(&turned, [q[1], qd[1], qdd[1]]);
        for (a, b) in again.iter().flatten().zip([q, qd, qdd].iter().flatten()) {
            assert!((a - b).abs() < 1e-13, "{y}: {a} {b}");
        }
    }
}

#[test]
fn a_curve_that_is_none_is_refused_with_its_place() {
    let depends = "polynomial=\"0 0.05 0.02 -0.01 0.003\" about=\"0.1\"";
    for (by, words) in [
        ("polynomial=\"0 1 2 3 4 5 6\"", "a polynomial of 1 to 6 coefficients"),
        ("polynomial=\"\"", "a polynomial of 1 to 6 coefficients"),
        ("polynomial=\"0 x\"", "is not a number"),
        ("polynomial=\"0 1\" table=\"0 0 1 1 2 2\"", "expected one of the three"),
        ("polynomial=\"0 1\" multiplier=\"2\"", "expected one of the three"),
        ("table=\"0 0 1 1\"", "a table of 3 to 256 points"),
        ("table=\"0 0 1 1 2\"", "a table of 3 to 256 points"),
        ("table=\"0 0 1 1 1 2 3 4\"", "with rising q"),
        ("table=\"0 0 1e-200 1 1 2 3 4\"", "no step below 1e-5 of the largest"),
        ("table=\"0 0 1 nan 2 2\"", "is not finite"),
    ] {
        let urdf = super::with(URDF, depends, by);
        let Err(LoadError::Faults(report)) = load(&source(&urdf, YAML), &Options::default()) else {
            panic!("{by} is read")
        };
        let text = report.to_string();
        assert!(text.starts_with("robot.urdf:9:"), "{by}: {text}");
        assert!(text.contains(words), "{by}: {text}");
    }
}

#[test]
fn a_curve_is_written_and_where_a_format_has_none_refused() {
    let cam = loaded(URDF, YAML);
    let written = exported(&cam, Target::Urdf);
    let text = |ending: &str| String::from_utf8(file(&written, ending)).unwrap();
    assert_eq!(loaded(&text(".urdf"), &text(".yml")).description, cam.description);
    for (target, joint) in [
        (Target::Mjcf, "`elbow`"),
        (Target::Sdf, "`lift`"),
        (Target::Pinocchio, "`lift`"),
        (Target::Gepetto, "`lift`"),
    ] {
        let Err(LoadError::Faults(report)) = export(&cam, target, "robot", false) else {
            panic!("{target:?} is written")
        };
        let found = &report.errors[0].found;
        assert_eq!(found, &format!("{joint} follows a curve"), "{target:?}: {report}");
    }
    // about another place than zero, as powers of the coordinate
    let end = URDF.find("  <transmission name=\"turns\"").unwrap();
    let short = URDF[..end].to_owned() + "</robot>";
    let yaml = YAML.replace(", elbow]", "]");
    let lifted =
        loaded(&short.replace("type=\"revolute\"><origin", "type=\"fixed\"><origin"), &yaml);
    let through = imported(file(&exported(&lifted, Target::Mjcf), ".xml"));
    for y in [-0.3, 0.2, 1.1] {
        let [a, b] = [&lifted, &through].map(|of| motion(of, [y, 1.3, 0.4]));
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() < 1e-15, "{y}: {a} {b}");
        }
    }
}

#[test]
fn a_held_follower_of_a_curve_is_refused_and_a_held_leader_gives_its_value() {
    let with = |urdf: &str, yaml: &str, lock: &str| {
        let lock = vec![lock.parse().unwrap()];
        load(&source(urdf, yaml), &Options { lock, ..Options::default() })
    };
    // one freedom is left by neither
    for lock in ["cam=0.7", "lift=0.02"] {
        let held = with(URDF, YAML, lock).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(held.compiled.model.sizes().n_vy, 0, "{lock}");
    }
    // two joints that the curve ties to each other without a follower
    let start = URDF.find("  <transmission name=\"lifts\"").unwrap();
    let end = URDF.find("  <transmission name=\"turns\"").unwrap();
    let urdf = URDF[..start].to_owned() + &URDF[end..];
    let yaml = YAML.replace("independent: [cam]", "independent: [cam, lift]");
    let held = with(&urdf, &yaml, "lift=0.1").unwrap_or_else(|error| panic!("{error}"));
    let coupling = held.description.joints[2].coupling.clone().unwrap();
    assert_eq!((coupling.terms, coupling.curves), (vec![(0, 0.25)], vec![]));
    assert!((coupling.offset - 0.41).abs() < 1e-15, "{}", coupling.offset);
    let text = with(&urdf, &yaml, "elbow=0.2").unwrap_err().to_string();
    assert!(text.contains("whose coupling no other joint can have"), "{text}");
}
