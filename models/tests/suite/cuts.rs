//! Cut joints by name: their rows and their faults. The proof tests their motion.

use super::*;

const AXES: &str = "    constraint_axes:\n    - {name: y, axis: [0, 0, 0, 0, 1, 0]}\n    - \
    {name: z, axis: [0, 0, 0, 0, 0, 1]}\n";

/// The lambda's file with these lines in place of its axes.
fn cut(lines: &str) -> String {
    with(YAML, AXES, &format!("    {lines}\n"))
}

#[test]
fn a_hinge_of_the_plane_has_the_two_rows_across_its_axis() {
    let read = |yaml: &str| {
        let source = Source::Text { urdf: URDF.into(), submechanisms: Some(yaml.into()) };
        load(&source, &Options::default())
            .unwrap_or_else(|error| panic!("{error}"))
            .description
            .submechanisms[0]
            .loops
            .clone()
    };
    let (given, named) =
        (read(YAML), read(&cut("cut_joint_type: planar_revolute\n    axis: [3, 0, 0]")));
    assert_eq!((given.len(), named.len()), (1, 1));
    assert_eq!(named[0].rows.iter().map(|row| row.name.as_str()).collect::<Vec<_>>(), ["b", "c"]);
    let axes = |of: &sarrus_dynamics::description::Loop| {
        of.rows.iter().map(|row| row.axis).collect::<Vec<_>>()
    };
    assert_eq!(axes(&named[0]), axes(&given[0]));
    assert_eq!(
        (named[0].predecessor, named[0].successor, &named[0].cut),
        (given[0].predecessor, given[0].successor, &given[0].cut)
    );
}

/// The report on the lambda with these lines.
fn reported_of_cut(lines: &str) -> Vec<String> {
    reported(URDF, &cut(lines)).lines().map(str::to_owned).collect()
}

#[test]
fn an_unknown_cut_joint_is_reported_with_the_nearest() {
    let expected = "submechanisms.yml:14:21: the cut joint type `revolut` is not known, expected \
        spherical, weld, revolute, planar_revolute, prismatic, cylindrical, universal, did you \
        mean `revolute`?";
    assert_eq!(reported_of_cut("cut_joint_type: revolut\n    axis: [0, 0, 1]"), [expected]);
}

#[test]
fn a_type_beside_axes_is_an_error() {
    let yaml = with(
        YAML,
        "    constraint_axes:\n",
        "    cut_joint_type: spherical\n    constraint_axes:\n",
    );
    let expected = "submechanisms.yml:16:7: the loop has `constraint_axes` and a `cut_joint_type`, \
        expected one of them, remove one of them";
    assert_eq!(reported(URDF, &yaml).lines().collect::<Vec<_>>(), [expected]);
}

#[test]
fn an_axis_without_a_type_is_an_error() {
    let yaml = with(YAML, "    constraint_axes:\n", "    axis: [0, 0, 1]\n    constraint_axes:\n");
    let expected = "submechanisms.yml:14:11: `axis` without a `cut_joint_type`, expected both or \
        neither, add `cut_joint_type`, or write the axis in constraint_axes";
    assert_eq!(reported(URDF, &yaml).lines().collect::<Vec<_>>(), [expected]);
}

#[test]
fn missing_and_needless_axes_are_errors() {
    let missing = "submechanisms.yml:14:21: a revolute cut without `axis`, expected `axis: [x, y, \
        z]` in the cut frame, add it";
    assert_eq!(reported_of_cut("cut_joint_type: revolute"), [missing]);
    let second = "submechanisms.yml:14:21: a universal cut without `axis2`, expected `axis2: [x, \
        y, z]` in the cut frame, add it";
    assert_eq!(reported_of_cut("cut_joint_type: universal\n    axis: [1, 0, 0]"), [second]);
    let needless = "submechanisms.yml:15:11: a weld cut with `axis`, expected none, remove it";
    assert_eq!(reported_of_cut("cut_joint_type: weld\n    axis: [1, 0, 0]"), [needless]);
}

#[test]
fn the_axes_of_a_universal_cut_are_perpendicular() {
    let parallel = "submechanisms.yml:16:12: the two axes of a universal cut have the cosine \
        1.000e0, expected perpendicular axes, correct one of them, or write the cut as revolute \
        joints in the tree and a spherical cut";
    assert_eq!(
        reported_of_cut("cut_joint_type: universal\n    axis: [1, 0, 0]\n    axis2: [2, 0, 0]"),
        [parallel]
    );
    let tilted =
        reported_of_cut("cut_joint_type: universal\n    axis: [1, 0, 0]\n    axis2: [0.01, 1, 0]");
    assert!(tilted[0].contains("have the cosine 1.000e-2"), "{tilted:?}");
}

#[test]
fn axes_without_direction_or_of_the_wrong_count_are_errors() {
    let zero = "submechanisms.yml:15:11: `axis` of the loop constraint has a length near 0e0, \
        expected a direction as [0, 0, 1], correct it";
    assert_eq!(reported_of_cut("cut_joint_type: revolute\n    axis: [0, 0, 0]"), [zero]);
    let two = "submechanisms.yml:15:11: `axis` of the loop constraint holds 2 values, expected 3 \
        finite numbers, correct the list";
    assert_eq!(reported_of_cut("cut_joint_type: revolute\n    axis: [0, 1]"), [two]);
}

#[test]
fn a_fault_of_a_named_cut_stands_at_its_type() {
    // a weld leaves the lambda no freedom
    let reported = reported_of_cut("cut_joint_type: weld");
    assert!(reported.iter().all(|line| line.starts_with("submechanisms.yml:")), "{reported:?}");
}

#[test]
fn the_types_with_closed_forms_of_their_own_count_their_joints() {
    for (name, trees, independents) in
        [("FOURBAR", "3", 1), ("SLIDERCRANK", "3", 1), ("DIFFERENTIAL", "3 or 4", 2)]
    {
        let yaml = with(
            &with(YAML, "NUMERICAL", name),
            "jointnames_spanningtree: [elbow, swing, slide]",
            "jointnames_spanningtree: [elbow, swing]",
        );
        let reported = reported(URDF, &yaml);
        assert!(
            reported.contains(&format!("`{name}` with 2 spanning-tree joints, expected {trees}, ")),
            "{reported}"
        );
        let wrong = reported
            .contains(&format!("`{name}` with 1 independent joint, expected {independents}"));
        assert_eq!(wrong, independents != 1, "{reported}");
    }
    let slip = reported(URDF, &with(YAML, "NUMERICAL", "FOUR_BAR"));
    assert!(slip.contains("did you mean `FOURBAR`?"), "{slip}");
}

/// The length of a constraint axis does not count.
#[test]
fn constraint_axes_of_any_length_hold_the_same_directions() {
    let read = |yaml: &str| {
        let source = Source::Text { urdf: URDF.into(), submechanisms: Some(yaml.into()) };
        let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        let zero = loaded.compiled.model.closures_at_zero()[0].clone();
        (loaded.description.submechanisms[0].loops[0].rows.clone(), zero.cond_Kd)
    };
    let expected = read(YAML);
    for length in ["1e6", "1e-6", "3e-9", "-2e40"] {
        let one = with(YAML, "[0, 0, 0, 0, 1, 0]", &format!("[0, 0, 0, 0, {length}, 0]"));
        let (rows, cond) = read(&one);
        let sign = if length.starts_with('-') { -1.0 } else { 1.0 };
        assert_eq!(rows[0].axis, [0.0, 0.0, 0.0, 0.0, sign, 0.0], "{length}");
        assert_eq!(cond, expected.1, "{length}");
    }
    // a helical axis keeps its pitch; the rounding of a unit axis stays
    let of = |axis: &str| read(&with(YAML, "[0, 0, 0, 0, 1, 0]", axis)).0[0].axis;
    assert_eq!(of("[4, 0, 0, 0, 2, 0]"), [1.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    assert_eq!(of("[0, 0, 0, 0, 0.6, 0.8000001]")[4..], [0.6, 0.8000001]);
    for length in ["1e7", "1e-7"] {
        let cut = format!("cut_joint_type: planar_revolute\n    axis: [{length}, 0, 0]");
        assert_eq!(reported_of_cut(&cut), [""; 0], "{length}");
    }
}

#[test]
fn closed_forms_are_on_or_off() {
    let key = |value: &str| with(YAML, "  type: ", &format!("  closed_forms: {value}\n  type: "));
    let read = |yaml: &str| {
        let source = Source::Text { urdf: URDF.into(), submechanisms: Some(yaml.into()) };
        let loaded = load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        let parts = loaded.compiled.model.closures_at_zero()[0].parts.clone();
        (loaded.description.submechanisms[0].closed_forms, parts[0].method)
    };
    let named = |yaml: &str| with(yaml, "NUMERICAL", "RRPR");
    assert_eq!(read(&named(YAML)), (true, "dyad"));
    assert_eq!(read(&named(&key("on"))), (true, "dyad"));
    assert_eq!(read(&named(&key("off"))), (false, "newton"));
    let reported = reported(URDF, &key("no"));
    assert_eq!(
        reported.trim(),
        "submechanisms.yml:3:17: `closed_forms` is no, expected on or off, write `closed_forms: \
         off`, or nothing"
    );
}
