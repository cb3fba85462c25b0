//! Published files: incomplete ones are read too.

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status, Workspace};
use sarrus_models::Loaded;

use super::*;

fn good(urdf: &str, yaml: Option<&str>) -> Loaded {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn an_absent_bound_is_zero_before_version_1_2_and_infinite_from_then_on() {
    let urdf = with(URDF, "lower=\"-1.5\" upper=\"1.4\" ", "lower=\"-1.5\" ");
    for (version, expected) in [("", 0.0), ("version=\"1.2\" ", f64::INFINITY)] {
        let urdf = with(&urdf, "<robot ", &format!("<robot {version}"));
        let limits = good(&urdf, Some(YAML)).description.joints[0].limits.unwrap();
        assert_eq!((limits.lower, limits.upper), (-1.5, expected));
    }
}

#[test]
fn a_limit_without_a_range_bounds_only_speed_and_effort() {
    for range in ["", "version=\"1.2\" "] {
        let urdf = with(URDF, "lower=\"-1.5\" upper=\"1.4\" ", "");
        let urdf = with(&urdf, "<robot ", &format!("<robot {range}"));
        let limits = good(&urdf, Some(YAML)).description.joints[0].limits.unwrap();
        assert_eq!((limits.lower, limits.upper), (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!((limits.velocity, limits.effort), (10.0, 100.0));
    }
}

#[test]
fn an_effort_of_minus_one_is_no_bound() {
    let urdf = with(URDF, "effort=\"100\"", "effort=\"-1\"");
    let limits = good(&urdf, Some(YAML)).description.joints[0].limits.unwrap();
    assert_eq!((limits.velocity, limits.effort), (10.0, f64::INFINITY));
}

#[test]
fn joints_that_no_submechanism_lists_are_serial_behind_the_others() {
    let tool = r#"<link name="tool"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="finger"/>
        <joint name="spin" type="continuous"><parent link="rod"/><child link="tool"/></joint>
        <joint name="grip" type="continuous"><parent link="rod"/><child link="finger"/>
          <mimic joint="spin"/></joint>
        </robot>"#;
    let urdf = with(URDF, "</robot>", tool);
    // a submechanism may have the name that is meant for them
    for (yaml, name) in [
        (YAML.to_owned(), "unlisted"),
        (with(YAML, "contextual_name: elbow_joint", "contextual_name: unlisted"), "unlisted_"),
    ] {
        let loaded = good(&urdf, Some(&yaml));
        let model = &loaded.compiled.model;
        assert_eq!(model.tree_names(), ["elbow", "swing", "slide", "spin", "grip"]);
        assert_eq!(model.independent_names(), ["elbow", "spin"]);
        assert_eq!(model.active_names(), ["slide", "spin"]);
        let rest = &loaded.description.submechanisms[1];
        assert_eq!((rest.name.as_str(), rest.type_name.as_str()), (name, "TRANSMISSION"));
        let reported = loaded.report.to_string();
        for joint in ["spin", "grip"] {
            let line = format!("the joint `{joint}` moves but is in no submechanism");
            assert_eq!(reported.matches(&line).count(), 1, "{reported}");
        }
    }
}

/// A gripper as its maker publishes it: no masses at all.
#[test]
fn a_robot_without_masses_has_kinematics_and_no_forward_dynamics() {
    let gripper = r#"<robot name="gripper"><link name="palm"/><link name="left"/>
        <link name="right"/><joint name="grip" type="prismatic"><parent link="palm"/><child link="left"/>
          <origin xyz="0 0.1 0" rpy="0.3 0.2 0.1"/><axis xyz="1 2 3"/>
          <limit lower="0" upper="0.04" effort="40" velocity="0.1"/></joint>
        <joint name="follow" type="prismatic"><parent link="palm"/><child link="right"/>
          <axis xyz="0 1 0"/><limit effort="40" velocity="0.1"/>
          <mimic joint="grip" multiplier="-1"/></joint></robot>"#;
    let loaded = good(gripper, None);
    let reported = loaded.report.to_string();
    assert!(reported.contains("no inertia that resists the motion of grip"), "{reported}");
    let ask = |request, want: Field| {
        let given = FieldSet::of(&[Field::Y, Field::TauY]);
        let given = if request == Request::Kinematics { FieldSet::of(&[Field::Y]) } else { given };
        let query = Query::new(request, given, FieldSet::of(&[want]));
        let model = &loaded.compiled.model;
        let plan = Plan::new(model, &query).unwrap();
        let mut workspace = Workspace::new(model);
        let mut output = [0.0; 2];
        let input = [0.02, 1.0];
        let n = if request == Request::Kinematics { 1 } else { 2 };
        let m = if want == Field::Ydd { 1 } else { 2 };
        let answer = plan.run(model, &mut workspace, &input[..n], &mut output[..m]);
        (answer.status, output)
    };
    assert_eq!(ask(Request::Kinematics, Field::Q), (Status::Ok, [0.02, -0.02]));
    assert_eq!(ask(Request::Map, Field::K).0, Status::Ok);
    assert_eq!(ask(Request::ForwardDynamics, Field::Ydd).0, Status::MassNotPositive);
}

#[test]
fn anchors_and_aliases_are_read_as_pyyaml_writes_them() {
    let yaml = with(
        YAML,
        "jointnames: [elbow, swing, slide]",
        "jointnames: &id001\n  - elbow\n  - swing\n  - slide",
    );
    let yaml = with(
        &yaml,
        "jointnames_spanningtree: [elbow, swing, slide]",
        "jointnames_spanningtree: *id001",
    );
    let yaml = with(&yaml, "axis: [0, 0, 0, 0, 1, 0]", "axis: &id002 [0, 0, 0, 0, 1, 0]");
    assert_eq!(good(URDF, Some(&yaml)).description, good(URDF, Some(YAML)).description);
    let fault = with(&yaml, "*id001", "&id003 [elbow, elbow]\n  file_path: *id003");
    assert!(reported(URDF, &fault).contains("`elbow` is in `jointnames_spanningtree` twice"));
}

#[test]
fn couplings_of_any_size_in_a_row_are_read() {
    let link = |k: usize| format!("<link name=\"l{k}\"/>");
    let joint = |k: usize, mimic: &str| {
        format!(
            "<joint name=\"j{k}\" type=\"continuous\"><parent link=\"base\"/>\
             <child link=\"l{k}\"/>{mimic}</joint>"
        )
    };
    let rows: [&[f64]; 7] = [
        &[1e6, 1e6],
        &[1e6, 1e-6],
        &[1e-6, 1e6],
        &[1e-6, 1e-6],
        &[1e6; 4],
        &[1e-6; 5],
        &[1e6, 1e6, 1e-6, 1e6, 1e6],
    ];
    for ratios in rows {
        let n = ratios.len();
        let mimic = |k: usize, by: f64| format!("<mimic joint=\"j{k}\" multiplier=\"{by:e}\"/>");
        let urdf = [
            "<robot name=\"gears\"><link name=\"base\"/>".to_owned(),
            (0..=n).map(link).collect(),
            joint(0, ""),
            (0..n).map(|k| joint(k + 1, &mimic(k, ratios[k]))).collect(),
            "</robot>".to_owned(),
        ];
        let loaded = good(&urdf.concat(), None);
        assert!(!loaded.report.to_string().contains("dead point"), "{}", loaded.report);
        let model = &loaded.compiled.model;
        let given = FieldSet::of(&[Field::Y]);
        let query = Query::new(Request::Kinematics, given, FieldSet::of(&[Field::Q]));
        let plan = Plan::new(model, &query).unwrap();
        let mut q = vec![0.0; n + 1];
        let answer = plan.run(model, &mut Workspace::new(model), &[0.5], &mut q);
        assert_eq!(answer.status, Status::Ok);
        let mut expected = 0.5;
        for (k, found) in q.iter().enumerate() {
            assert!((found / expected - 1.0_f64).abs() < 1e-14, "{ratios:?}: {q:?}");
            expected *= ratios.get(k).copied().unwrap_or(1.0);
        }
    }
}
