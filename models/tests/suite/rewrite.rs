//! Files that are written with another zero pose.

use sarrus_models::{CheckReport, Loaded, Options, Rewritten, Source, assemble, load};

use super::{URDF, YAML, with};

fn source(urdf: &str, yaml: &str) -> Source {
    Source::Text { urdf: urdf.into(), submechanisms: Some(yaml.into()) }
}

/// The report of an assembly near a pose, and the texts written from it.
fn written(urdf: &str, yaml: &str, near: &[f64]) -> (CheckReport, Rewritten) {
    let source = source(urdf, yaml);
    let options = Options::default();
    let report = assemble(
        &source,
        &options,
        |_, zero| Ok::<_, ()>(if near.is_empty() { zero } else { near.to_vec() }),
        |names| Ok(vec![1.0; names.len()]),
    );
    let report = report.unwrap().unwrap();
    let files = report.assembled.as_ref().unwrap().zero.as_ref().unwrap();
    let files = files.write(&source, &options).unwrap().unwrap();
    (report, files)
}

fn loaded(urdf: &[u8], yaml: &[u8]) -> Loaded {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    load(&source(&text(urdf), &text(yaml)), &Options::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The text outside of quotes.
fn outside(text: &[u8]) -> Vec<String> {
    let text = String::from_utf8(text.to_vec()).unwrap();
    text.split('"').step_by(2).map(str::to_owned).collect()
}

/// A lambda that is open at zero, with comments, other ends of lines, calibration, soft limits and
/// a spring.
fn open() -> (String, String) {
    let urdf = with(
        URDF,
        "<limit lower=\"-1.5\" upper=\"1.4\" effort=\"100\" velocity=\"10\"/>",
        "<!-- kept  --><limit  lower=\"-1.5\" upper=\"1.4\" effort=\"100\" velocity=\"10\"/>\
         <calibration rising=\"0.25\"/>\
         <safety_controller soft_lower_limit=\"-1.25\" soft_upper_limit=\"1\" k_velocity=\"3\"/>\
         <dynamics spring_stiffness=\"2\" spring_reference=\"0.5\"/>",
    );
    let placed = "    successor_body: rod\n    predecessor_placement: {xyz: [0, 0.4, 0]}\n    \
        successor_placement: {xyz: [0, 0, 0.01]}\n";
    (urdf.replace('\n', "\r\n"), with(YAML, "    successor_body: rod\n", placed))
}

#[test]
fn an_open_file_is_written_closed_and_else_stays_byte_for_byte() {
    let (urdf, yaml) = open();
    assert!(super::reported(&urdf, &yaml).contains("--assemble --write OUT.urdf"));
    let (report, files) = written(&urdf, &yaml, &[]);
    assert_eq!((&report.errors[..], files.submechanisms), (&[][..], None));
    assert_eq!(outside(&files.urdf), outside(urdf.as_bytes()));
    let loaded = loaded(&files.urdf, yaml.as_bytes());
    assert_eq!(loaded.report.errors, []);

    // every number that counts from the zero pose has moved as far as the joint
    let moved = report.assembled.unwrap().q[0].found;
    let text = String::from_utf8(files.urdf).unwrap();
    assert!(moved.abs() > 1e-3 && text.contains("<!-- kept  -->"));
    let elbow = &loaded.description.joints[0];
    let limits = elbow.limits.unwrap();
    assert_eq!((limits.lower, limits.upper), (-1.5 - moved, 1.4 - moved));
    assert_eq!(elbow.terms.rest, 0.5 - moved);
    for (name, was) in [("rising", 0.25), ("soft_lower_limit", -1.25), ("soft_upper_limit", 1.0)] {
        let value =
            text.split(&format!("{name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
        let value: f64 = value.unwrap().parse().unwrap();
        assert!((value - (was - moved)).abs() < 1e-15, "{name}: {value}");
    }
}

#[test]
fn an_origin_that_is_missing_or_has_a_quaternion_is_written() {
    let (urdf, yaml) = open();
    let urdf = urdf
        .replace("name=\"lambda\"", "name=\"lambda\" version=\"1.1\"")
        .replace(
            "<origin xyz=\"0 0 0\" rpy=\"0.8 0 0\"/>",
            "<origin quat_xyzw=\"0.3894183423086505 0 0 0.9210609940028851\"/>",
        )
        .replace("    <origin xyz=\"0 0.3 0\"/>\r\n", "");
    let yaml = yaml.replace("[0, 0, 0.01]", "[0, 0.3, 0.01]");
    let (_, files) = written(&urdf, &yaml, &[]);
    assert_eq!(loaded(&files.urdf, yaml.as_bytes()).report.errors, []);
    let text = String::from_utf8(files.urdf).unwrap();
    assert!(!text.contains("quat_xyzw"), "{text}");
}

#[test]
fn cuts_in_a_frame_of_the_old_zero_pose_get_placements() {
    // the frame of a joint that moves with neither link depends on the zero pose
    let mark = "<link name=\"mark\"/><joint name=\"pin\" type=\"fixed\"><parent link=\"base\"/>\
        <child link=\"mark\"/><origin xyz=\"0 0.3 0.2\"/></joint></robot>";
    let urdf = with(URDF, "</robot>", mark);
    let yaml = with(YAML, "- cut_joint: slide\n", "- cut_joint: pin  # of the zero pose\n");
    let braces = yaml[..yaml.find("  - cut_joint").unwrap()].to_owned()
        + "  - {cut_joint: pin, predecessor_body: rocker, successor_body: rod, constraint_axes: \
           [{name: y, axis: [0, 0, 0, 0, 1, 0]}, {name: z, axis: [0, 0, 0, 0, 0, 1]}]}\n";
    for yaml in [yaml, braces] {
        let (_, files) = written(&urdf, &yaml, &[0.2, 0.0, 0.0]);
        let text = files.submechanisms.unwrap();
        let again = loaded(&files.urdf, &text);
        assert_eq!(again.report.errors, []);
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text.matches("cessor_placement: {xyz: [").count(), 2, "{text}");
        assert_eq!(text.matches("# of the zero pose").count(), yaml.matches('#').count());
    }
}

#[test]
fn curves_of_couplings_are_moved_with_the_zero_pose() {
    use super::curves::{URDF, YAML, motion};
    let old = loaded(URDF.as_bytes(), YAML.as_bytes());
    let [start, ..] = motion(&old, [0.4, 0.0, 0.0]);
    let (_, files) = written(URDF, YAML, &start);
    assert_eq!(files.submechanisms, None);
    let new = loaded(&files.urdf, YAML.as_bytes());
    for x in [-0.7, 0.0, 0.2, 1.1] {
        let [[q, qd, qdd], again] =
            [(&old, 0.4 + x), (&new, x)].map(|(of, y)| motion(of, [y, 1.3, 0.4]));
        let q = q.iter().zip(&start).map(|(q, start)| q - start).collect::<Vec<_>>();
        for (a, b) in again.iter().flatten().zip([q, qd, qdd].iter().flatten()) {
            assert!((a - b).abs() < 1e-14, "{x}: {a} {b}");
        }
    }
}

#[test]
fn cuts_that_say_the_same_at_another_zero_pose_leave_the_submechanisms_alone() {
    let (_, files) = written(URDF, YAML, &[0.2, 0.0, 0.0]);
    assert_eq!(files.submechanisms, None);
    assert_eq!(loaded(&files.urdf, YAML.as_bytes()).report.errors, []);
}
