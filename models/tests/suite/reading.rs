//! Files as users have them read without an error.

use std::path::{Path, PathBuf};

use sarrus_dynamics::description::{Cut, JointKind, Placement, SubmechanismKind};
use sarrus_models::{Base, CheckReport, Diagnostic, Loaded, bundled, bundled_text};

use super::*;

fn good(urdf: &str, yaml: Option<&str>) -> Loaded {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_bundled_robot_reads_without_an_error() {
    assert_eq!(bundled().count(), 28);
    for (name, about) in bundled() {
        let loaded = load(&Source::Bundled(name.into()), &Options::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let reported = loaded.report.to_string();
        // an overconstrained mechanism says so, and one with rods that may spin
        let may_be_reported = match name {
            "bricard" => "redundant constraint axes: P5/",
            "bennett" => "redundant constraint axes: hinge4/",
            "delta_balls" => "idle joints, which turn a rod between its ball joints",
            _ => "it is closed numerically from its loops",
        };
        assert!(reported.lines().all(|line| line.contains(may_be_reported)), "{name}\n{reported}");
        assert!(!about.is_empty());
    }
}

#[test]
fn every_value_of_the_lambda_is_read() {
    let read = good(URDF, Some(YAML)).description;
    assert_eq!(read.name, "lambda");
    assert_eq!(
        read.links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>(),
        ["base", "rocker", "stator", "rod"]
    );
    assert_eq!(read.links[0].inertial, None);
    let rocker = read.links[1].inertial.unwrap();
    assert_eq!(rocker.origin, Placement { xyz: [0.0, 0.2, 0.0], rpy: [0.0; 3] });
    assert_eq!((rocker.mass, rocker.inertia), (1.5, [0.02, 0.0, 0.0, 0.001, 0.0, 0.02]));

    let [elbow, swing, slide] = &read.joints[..] else { panic!() };
    assert_eq!((elbow.kind, elbow.parent, elbow.child), (JointKind::Revolute, 0, 1));
    assert_eq!((swing.kind, swing.parent, swing.child), (JointKind::Continuous, 0, 2));
    assert_eq!((slide.kind, slide.parent, slide.child), (JointKind::Prismatic, 2, 3));
    assert_eq!((elbow.axis, swing.axis), ([1.0, 0.0, 0.0], [2.0, 0.0, 0.0]));
    assert_eq!(swing.origin, Placement { xyz: [0.0, 0.1, 0.0], rpy: [1.1, 0.0, 0.0] });
    let limits = elbow.limits.unwrap();
    assert_eq!(
        [limits.lower, limits.upper, limits.effort, limits.velocity],
        [-1.5, 1.4, 100.0, 10.0]
    );
    assert_eq!(swing.limits, None);

    let [group] = &read.submechanisms[..] else { panic!() };
    assert_eq!((group.name.as_str(), group.type_name.as_str()), ("elbow_joint", "NUMERICAL"));
    assert_eq!(
        (&group.spanning_tree[..], &group.independent[..], &group.active[..]),
        (&[0, 1, 2][..], &[0][..], &[2][..])
    );
    let [cut] = &group.loops[..] else { panic!() };
    assert_eq!(
        (cut.name.as_str(), cut.predecessor, cut.successor, &cut.cut),
        ("slide", 1, 3, &Cut::AtJoint(2))
    );
    assert_eq!(cut.rows[0].name, "y");
    assert_eq!(cut.rows[1].axis, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(read.gravity, [0.0, 0.0, -9.81]);
}

#[test]
fn line_ends_of_windows_and_a_byte_order_mark_change_nothing() {
    let windows = |text: &str| format!("\u{feff}{}", text.replace('\n', "\r\n"));
    let there = good(&windows(URDF), Some(&windows(YAML))).description;
    assert_eq!(there, good(URDF, Some(YAML)).description);
    let fault = windows(&with(YAML, "[slide]", "[slid]"));
    assert!(
        reported(&windows(URDF), &fault)
            .starts_with("submechanisms.yml:9:23: `jointnames_active` names `slid`")
    );
}

#[test]
fn names_may_hold_slashes_and_the_active_list_may_be_empty() {
    let urdf = URDF.replace("\"slide\"", "\"Connector_Body/slide\"");
    let yaml = YAML.replace("[slide]", "[]").replace("slide", "Connector_Body/slide");
    let read = good(&urdf, Some(&yaml)).description;
    assert_eq!(read.joints[2].name, "Connector_Body/slide");
    assert!(read.submechanisms[0].active.is_empty());
    assert_eq!(
        good(&urdf, Some(&yaml.replace("jointnames_active: []", "jointnames_active:"))).description,
        read
    );
}

#[test]
fn both_spellings_of_the_lambda_are_one_kind() {
    for written in ["RRPR", "rrPr", "'rrPr'"] {
        let read = good(URDF, Some(&with(YAML, "NUMERICAL", written))).description;
        assert_eq!(read.submechanisms[0].kind, SubmechanismKind::Rrpr);
    }
}

#[test]
fn numbers_are_read_as_people_write_them() {
    let yaml = with(YAML, "[0, 0, 0, 0, 1, 0]", "[0., -0., .0, 0e0, 1.0e+00, 0]");
    assert_eq!(
        good(URDF, Some(&yaml)).description.submechanisms[0].loops[0].rows[0].axis,
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    );
    let urdf = with(URDF, "xyz=\"0 0.1 0\"", "xyz=\" 0. \n\t+1.E-1  -0\"");
    assert_eq!(good(&urdf, Some(YAML)).description.joints[1].origin.xyz, [0.0, 0.1, 0.0]);
}

#[test]
fn a_mimic_is_a_coupling_with_its_defaults() {
    let urdf = with(URDF, "<axis xyz=\"2 0 0\"/>", "<axis xyz=\"2 0 0\"/><mimic joint=\"elbow\"/>");
    let coupling = good(&urdf, None).description.joints[1].coupling.clone().unwrap();
    assert_eq!((coupling.terms, coupling.offset), (vec![(0, 1.0)], 0.0));
    let urdf = with(&urdf, "joint=\"elbow\"", "joint=\"elbow\" multiplier=\"-2\" offset=\"0.5\"");
    let coupling = good(&urdf, None).description.joints[1].coupling.clone().unwrap();
    assert_eq!((coupling.terms, coupling.offset), (vec![(0, -2.0)], 0.5));
}

#[test]
fn a_transmission_is_a_coupling_of_several_joints() {
    let transmission = r#"<transmission name="t"><type>Linear</type><joint name="slide">
        <depends_on joint="elbow" multiplier="2" offset="0.25"/><depends_on joint="swing" multiplier="-1"/>
        </joint></transmission><transmission name="ros"><joint name="elbow"><hardwareInterface/></joint><actuator name="a"/></transmission></robot>"#;
    let yaml = "submechanisms:\n- type: TRANSMISSION\n  contextual_name: t\n  jointnames_spanningtree: [elbow, swing, slide]\n  \
        jointnames_independent: [elbow, swing]\n  jointnames_active: [swing, slide]\n";
    let read = good(&with(URDF, "</robot>", transmission), Some(yaml));
    assert_eq!(read.report.to_string(), "");
    let coupling = read.description.joints[2].coupling.clone().unwrap();
    assert_eq!((coupling.terms, coupling.offset), (vec![(0, 2.0), (1, -1.0)], 0.25));
    assert_eq!(read.description.submechanisms[0].kind, SubmechanismKind::Transmission);
}

#[test]
fn placements_by_hand_replace_the_cut_joint() {
    // the rod's origin in the axes of the rocker at zero
    let across = 0.1 + 0.3 * 1.1_f64.cos();
    let along = 0.3 * 1.1_f64.sin();
    let (s, c) = 0.8_f64.sin_cos();
    let y = c * across + s * along;
    let z = c * along - s * across;
    let placed = format!(
        "cut_joint: pin\n    predecessor_placement: {{xyz: [0, {y}, {z}]}}\n    \
         successor_placement: {{rpy: [0.1, 0, 0]}}"
    );
    let read = good(URDF, Some(&with(YAML, "cut_joint: slide", &placed)));
    assert_eq!(read.report.to_string(), "");
    let predecessor = Placement { xyz: [0.0, y, z], rpy: [0.0; 3] };
    let successor = Placement { xyz: [0.0; 3], rpy: [0.1, 0.0, 0.0] };
    assert_eq!(
        read.description.submechanisms[0].loops[0].cut,
        Cut::Placed { predecessor, successor }
    );
}

#[test]
fn a_cut_joint_without_a_frame_takes_the_frame_of_the_predecessor() {
    let read = good(URDF, Some(&with(YAML, "cut_joint: slide", "cut_joint: RodEnd")));
    assert_eq!(read.description.submechanisms[0].loops[0].cut, Cut::AtLink(1));
    assert_eq!(read.report.warnings.len(), 1);
}

#[test]
fn without_submechanisms_every_joint_is_its_own_and_mimics_follow() {
    let extra = r#"<link name="free"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="float" type="floating"><parent link="base"/><child link="free"/></joint></robot>"#;
    let urdf = with(
        &with(URDF, "</robot>", extra),
        "<axis xyz=\"2 0 0\"/>",
        "<axis xyz=\"2 0 0\"/><mimic joint=\"elbow\"/>",
    );
    let read = good(&urdf, None).description;
    let [group] = &read.submechanisms[..] else { panic!() };
    assert_eq!(
        (&group.spanning_tree[..], &group.independent[..], &group.active[..]),
        (&[0, 1, 2, 3][..], &[0, 2, 3][..], &[0, 2][..])
    );
    let group = &good(URDF, None).description.submechanisms[0];
    assert_eq!((group.kind, group.independent.len()), (SubmechanismKind::Serial, 3));
}

#[test]
fn a_quaternion_is_read_from_version_one_point_one_on() {
    let urdf = with(
        &with(URDF, "rpy=\"1.1 0 0\"", "quat_xyzw=\"1 0 0 0\""),
        "name=\"lambda\"",
        "name=\"lambda\" version=\"1.1\"",
    );
    let rpy = good(&urdf, Some(YAML)).description.joints[1].origin.rpy;
    assert!((rpy[0].abs() - core::f64::consts::PI).abs() < 1e-15, "{rpy:?}");
    // roll 0.3, pitch 0.5, yaw -0.7
    let turned = "0.21989576632910457 0.18014585799688554 -0.36323736972823584 0.8872721876797527";
    let urdf = urdf.replace("1 0 0 0", turned);
    let rpy = good(&urdf, Some(YAML)).description.joints[1].origin.rpy;
    let off = rpy.iter().zip([0.3, 0.5, -0.7]).map(|(found, given)| (found - given).abs());
    assert!(off.fold(0.0, f64::max) < 1e-14, "{rpy:?}");
    // almost straight down: roll 0.3, pitch π/2 − 0.0028, yaw -0.7
    let steep = "0.33880804465697045 0.6195737563346051 -0.33920138973533087 0.6215141885257067";
    let steep = urdf.replace(turned, steep);
    let rpy = good(&steep, Some(YAML)).description.joints[1].origin.rpy;
    let given = [0.3, core::f64::consts::FRAC_PI_2 - 0.0028, -0.7];
    let off = rpy.iter().zip(given).map(|(found, given)| (found - given).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12, "{rpy:?}");
    // of few digits, and of no length
    let coarse = good(&urdf.replace(turned, "0.22 0.18 -0.363 0.887"), Some(YAML));
    assert!(coarse.report.to_string().contains("the quaternion of `origin` has the length 0.999"));
    let none = reported(&urdf.replace(turned, "0 0 0 0"), YAML);
    assert!(none.contains("the quaternion of `origin` has the length 0, expected 1"), "{none}");
}

#[test]
fn what_other_programs_read_may_be_faulty() {
    let urdf = with(
        URDF,
        "<link name=\"base\"/>",
        "<link name=\"base\"><visual><origin xyz=\"0 x\"/><geometry/></visual></link><gazebo \
         reference=\"base\"><sensor><link name=\"rod\"/></sensor></gazebo>",
    );
    let read = good(&urdf, Some(YAML));
    assert_eq!(read.report.to_string(), "");
    assert_eq!(read.description, good(URDF, Some(YAML)).description);
}

#[test]
fn a_lenient_reader_warns_of_inertias_and_reads_on() {
    let urdf = with(URDF, "izz=\"0.02\"", "izz=\"0.5\"");
    let strict = reported_of(urdf.as_bytes(), Some(YAML.as_bytes()), false);
    let lenient = load(
        &Source::Text { urdf: urdf.into(), submechanisms: Some(YAML.into()) },
        &Options { lenient: true, ..Options::default() },
    );
    let way_out = ", or take it as it is with --lenient";
    assert_eq!(lenient.unwrap().report.to_string(), strict.replace(way_out, ""));
    assert!(strict.contains(way_out));
}

#[test]
fn a_diagnostic_as_json_has_the_names_that_scripts_see() {
    let Err(LoadError::Faults(report)) = load(
        &Source::Text {
            urdf: with(URDF, "<mass value=\"1.5\"/>", "<mass value=\"heavy\"/>").into(),
            submechanisms: None,
        },
        &Options::default(),
    ) else {
        panic!()
    };
    let expected = r#"{"file":"robot.urdf","line":6,"column":20,"found":"`value` of `mass`: `heavy` is not a number","expected":"one finite number","help":"correct the value"}"#;
    assert_eq!(serde_json::to_string(&report.errors[0]).unwrap(), expected);
}

#[test]
fn a_check_report_holds_names_orders_and_closures() {
    let text = |yaml: &str| Source::Text { urdf: URDF.into(), submechanisms: Some(yaml.into()) };
    let good = CheckReport::new(&load(&text(YAML), &Options::default())).unwrap();
    let json = serde_json::to_string(&good).unwrap();
    let fingerprint = good.fingerprint.unwrap();
    assert!(
        fingerprint.len() == 16 && fingerprint.chars().all(|digit| digit.is_ascii_hexdigit()),
        "{fingerprint}"
    );
    let sigma = good.closures[0].sigma_min;
    let cond = good.closures[0].cond;
    let (cells, bytes) = good.closures[0].seeds;
    assert!(cells > 0 && bytes > 0);
    let bound = good.bound.unwrap();
    let (steps, ns) = (bound.steps, bound.ns.round());
    assert!(steps > 0 && (1.0..=500_000.0).contains(&ns), "{bound:?}");
    let dimensions = serde_json::to_string(&good.dimensions).unwrap();
    let range = r#""ranges":[{"name":"elbow","lower":-1.5,"upper":1.4,"closes_from":null,"closes_to":null}]"#;
    let length = r#"{"cut":"slide","link":"base","from":"elbow","to":"swing","length":0.1}"#;
    assert!(dimensions.contains(range) && dimensions.contains(length), "{dimensions}");
    let expected = format!(
        r#"{{"robot":"lambda","fingerprint":"{fingerprint}","tree":["elbow","swing","slide"],"tree_q":["elbow","swing","slide"],"independent":["elbow"],"active":["slide"],"loops":["slide/y","slide/z"],"closures":[{{"name":"elbow_joint","type":"NUMERICAL","kind":"numerical","rows":2,"rank":2,"misfit":0.0,"redundant":[],"idle":[],"branch":[-1.0],"sigma_min":{sigma:?},"cond_Kd":{cond:?},"singular":"","seed_cells":{cells},"seed_bytes":{bytes},"parts":[{{"method":"dyad","rows":2,"joints":["swing","slide"]}}]}}],"bound":{{"steps":{steps},"ns":{ns:?}}},"actuators":[],"dimensions":{dimensions},"warnings":[],"errors":[]}}"#
    );
    assert_eq!(json, expected);

    let bad = CheckReport::new(&load(&text("a: b"), &Options::default())).unwrap();
    assert_eq!(
        (bad.robot.as_deref(), bad.fingerprint, bad.errors.len()),
        (Some("lambda"), None, 2)
    );
    let absent = load(&Source::Bundled("nobody".into()), &Options::default());
    assert!(matches!(CheckReport::new(&absent), Err(LoadError::UnknownRobot { .. })));
}

/// The reference files, if they are there.
fn reference() -> Option<PathBuf> {
    let found = std::env::var_os("SARRUS_REFERENCE")
        .map(|reference| Path::new(&reference).join("robots/hyrodyn"));
    if found.is_none() {
        println!("not run: SARRUS_REFERENCE is not set");
    }
    found
}

fn files(folder: &Path, urdf: &str, yaml: &str, lenient: bool) -> Result<Loaded, LoadError> {
    let submechanisms = (!yaml.is_empty()).then(|| folder.join(yaml));
    load(
        &Source::Files { urdf: folder.join(urdf), submechanisms },
        &Options { lenient, ..Options::default() },
    )
}

#[test]
fn the_files_of_hyrodyn_read_unchanged() {
    let Some(folder) = reference() else { return };
    let pairs = [
        ("leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee.yml"),
        ("leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee_numerical.yml"),
        ("rh5v2/derived/Body.urdf", "rh5v2/submechanisms/body_submechanism.yml"),
        ("rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced.yml"),
        (
            "rh5v2/derived/submechanisms_reduced.urdf",
            "rh5v2/derived/submechanisms_reduced_numerical.yml",
        ),
        (
            "rh5v2/derived/submechanisms_reduced.urdf",
            "rh5v2/derived/submechanisms_reduced_hybrid_elbows_numerical.yml",
        ),
        (
            "rh5v2/derived/submechanisms_reduced.urdf",
            "rh5v2/derived/submechanisms_reduced_hybrid_torso_numerical.yml",
        ),
        (
            "rh5v2/derived/submechanisms_reduced.urdf",
            "rh5v2/submechanisms/submechanisms_reduced_numerical.yml",
        ),
        ("rh5v2/derived/RH5v2.urdf", ""),
        ("rh5v2/derived/Head.urdf", ""),
        ("rh5v2/derived/ALElbow.urdf", ""),
        ("rh5v2/derived/left_wrist_mechanism.urdf", ""),
        ("leg/derived/LLHip3.urdf", ""),
    ];
    for (urdf, yaml) in pairs {
        if let Err(error) = files(&folder, urdf, yaml, false) {
            panic!("{urdf} {yaml}\n{error}");
        }
    }
}

#[test]
fn the_published_full_robot_loads_and_its_idle_rods_are_named() {
    let Some(folder) = reference() else { return };
    for yaml in [
        "rh5v2/derived/submechanisms_full_hybrid.yml",
        "rh5v2/derived/submechanisms_full_numerical.yml",
    ] {
        // the head's TRANSMISSION, whose couplings stand in the file of its file_path, is no fault
        let loaded = files(&folder, "rh5v2/derived/RH5v2.urdf", yaml, false).unwrap();
        for side in ["AL", "AR"] {
            let idle = ["BL0", "BL2", "BR0", "BR2"].map(|joint| format!("{side}Wrist{joint}"));
            let named =
                loaded.compiled.warnings.iter().filter(|warning| {
                    idle.iter().all(|joint| warning.found.contains(joint.as_str()))
                });
            assert_eq!(named.count(), 1, "{:?}", loaded.compiled.warnings);
            assert!(
                loaded.compiled.model.closures().iter().any(|closure| closure.idle == idle),
                "{side}"
            );
        }
    }
}

#[test]
fn a_smurf_file_names_the_files_that_are_read() {
    let Some(folder) = reference() else { return };
    // both ways are the same robot; the loops of its ankle are those of its type
    let smurf = files(&folder, "leg/smurf/leg.smurf", "", true).unwrap().compiled.model;
    let direct = files(&folder, "leg/urdf/leg.urdf", "leg/urdf/submechanisms.yml", true)
        .unwrap()
        .compiled
        .model;
    assert_eq!(smurf.fingerprint(), direct.fingerprint());
    assert!(
        direct.loop_names().iter().any(|name| name == "LLAnkle_E11/plane"),
        "{:?}",
        direct.loop_names()
    );
    // without leniency the negative inertias of the two foot-side links stand in the URDF that the
    // SMURF names
    let Err(LoadError::Faults(report)) = files(&folder, "leg/smurf/leg.smurf", "", false) else {
        panic!()
    };
    let ends: Vec<_> = report
        .errors
        .iter()
        .map(|Diagnostic { file, line, .. }| (file.ends_with("leg/smurf/../urdf/leg.urdf"), *line))
        .collect();
    assert_eq!(ends, [(true, 67), (true, 74)]);
}

#[test]
fn the_text_of_a_bundled_robot_is_there_for_others() {
    let (urdf, yaml) = bundled_text("torso").unwrap();
    assert!(urdf.contains("<robot name=\"torso\">") && yaml.contains("2SPU+1U"));
    assert!(bundled_text("nobody").is_none());
}

#[test]
fn a_floating_base_is_a_free_joint_before_all_others() {
    let source = Source::Text { urdf: super::URDF.into(), submechanisms: Some(super::YAML.into()) };
    let with = |base| load(&source, &Options { base, ..Options::default() });
    let fixed = with(Base::Fixed).unwrap().compiled.model;
    for base in [Base::Floating, Base::FloatingAt("base".into())] {
        let model = with(base).unwrap().compiled.model;
        let first = ["rx", "ry", "rz", "tx", "ty", "tz"].map(|x| format!("floating_base/{x}"));
        assert_eq!(model.tree_names()[..6], first);
        assert_eq!(model.tree_names()[6..], *fixed.tree_names());
        let with = model.sizes();
        let without = fixed.sizes();
        assert_eq!((with.n_q, with.n_vy), (without.n_q + 7, without.n_vy + 6));
        assert_eq!((with.n_u, with.n_c), (without.n_u, without.n_c));
        assert_ne!(model.fingerprint(), fixed.fingerprint());
    }
    for (link, found) in
        [("rocker", "`rocker`, which is not the root"), ("bas", "not exist (there is `base`)")]
    {
        let Err(LoadError::Faults(report)) = with(Base::FloatingAt(link.into())) else { panic!() };
        let error = report.errors[0].to_string();
        assert!(error.contains(found) && error.contains("the root link `base`"), "{error}");
    }
}
