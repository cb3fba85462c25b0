//! Loops whose rows, mobility or zero pose want a word.

use sarrus_models::{CheckReport, Options, Source, assemble, suggest};

use super::reported;

/// A body of unit mass on a revolute joint.
fn body(joint: &str, parent: &str, child: &str, at: [f64; 3], axis: [f64; 3]) -> String {
    let [x, y, z] = at;
    let [a, b, c] = axis;
    format!(
        "<link name=\"{child}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.1\" ixy=\"0\" \
         ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/></inertial></link>\n\
         <joint name=\"{joint}\" type=\"continuous\"><parent link=\"{parent}\"/>\
         <child link=\"{child}\"/><origin xyz=\"{x} {y} {z}\"/>\
         <axis xyz=\"{a:e} {b} {c}\"/></joint>\n"
    )
}

/// A four-bar of these points whose ground hinge at the last turns about (ε, 0, 1).
fn four_bar(points: [[f64; 2]; 4], tilt: f64) -> String {
    let [[a, b], [c, d], [e, f], [g, h]] = points;
    let z = [0.0, 0.0, 1.0];
    let bodies = [
        body("crank", "base", "crank_link", [a, b, 0.0], z),
        body("rod", "crank_link", "rod_link", [c - a, d - b, 0.0], z),
        body("rocker", "base", "rocker_link", [g, h, 0.0], [tilt, 0.0, 1.0]),
    ];
    format!(
        "<robot name=\"bars\"><link name=\"base\"/><link name=\"mark\"><inertial>\
         <mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>\
         </inertial></link>\n{}<joint name=\"pin\" \
         type=\"fixed\"><parent link=\"base\"/><child link=\"mark\"/>\
         <origin xyz=\"{e} {f} 0\"/></joint></robot>",
        bodies.concat()
    )
}

fn yaml(independent: &str, cut: &str) -> String {
    format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: bars\n  \
         jointnames_spanningtree: [crank, rod, rocker]\n  \
         jointnames_independent: [{independent}]\n  jointnames_active: [crank]\n  \
         loop_constraints:\n  - cut_joint: pin\n    predecessor_body: rod_link\n    \
         successor_body: rocker_link\n    {cut}\n"
    )
}

const POINTS: [[f64; 2]; 4] = [[0.0, 0.0], [0.3, 0.8], [1.4, 1.0], [1.2, 0.0]];
const REVOLUTE: &str = "cut_joint_type: revolute\n    axis: [0, 0, 1]";
const PLANAR: &str = "cut_joint_type: planar_revolute\n    axis: [0, 0, 1]";

#[test]
fn redundant_rows_that_do_not_hold_are_said_in_metres_and_radians() {
    for tilt in [1e-5, 5e-5, 2e-4] {
        let said = reported(&four_bar(POINTS, tilt), &yaml("crank", REVOLUTE));
        let gap = said.split("open by up to ").nth(1).unwrap_or_else(|| panic!("{tilt}: {said}"));
        let mut numbers = gap.split([' ']).filter_map(|word| word.parse::<f64>().ok());
        let length = numbers.next().unwrap();
        let angle = numbers.next().unwrap();
        assert!(gap.contains(" m and ") && gap.contains(" rad at sampled poses"), "{gap}");
        let share = length.max(angle) / tilt;
        assert!((0.1..2.0).contains(&share), "{tilt}: {gap}");
    }
    for tilt in [0.0, 1e-12, 1e-8] {
        let said = reported(&four_bar(POINTS, tilt), &yaml("crank", REVOLUTE));
        assert!(said.contains("redundant") && !said.contains("open by"), "{said}");
        assert!(said.lines().all(|line| line.chars().count() <= 400), "{said}");
    }
}

#[test]
fn redundant_rows_name_the_cut_that_fits() {
    let said = reported(&four_bar(POINTS, 0.0), &yaml("crank", REVOLUTE));
    assert!(
        said.contains("write cut_joint_type: planar_revolute with axis: [0, 0, 1] for pin"),
        "{said}"
    );
    // this cut fits
    assert_eq!(reported(&four_bar(POINTS, 0.0), &yaml("crank", PLANAR)), "");
}

/// Crank and rod in line: the rocker, which is independent, cannot move them.
const IN_LINE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [3.0, -2.0]];

#[test]
fn a_dead_point_at_zero_is_named_and_an_assembly_leads_off_it() {
    let urdf = four_bar(IN_LINE, 0.0);
    let yaml = yaml("rocker", PLANAR);
    let said = reported(&urdf, &yaml);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.contains("the zero pose is a dead point of loop pin")
            && said.contains("--assemble --near crank=0.1")
            && !said.contains("mobility"),
        "{said}"
    );
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(yaml.clone().into()) };
    let options = Options::default();
    let near = |_: &[String], zero: Vec<f64>| {
        Ok::<_, ()>(zero.iter().enumerate().map(|(k, _)| [0.3, 0.0, 0.0][k]).collect())
    };
    let report = assemble(&source, &options, near, |names| Ok(vec![1.0; names.len()]));
    let report: CheckReport = report.unwrap().unwrap();
    assert_eq!(report.errors, []);
    let assembled = report.assembled.unwrap();
    assert!(!assembled.new_zero.origins.is_empty());
    let files = assembled.zero.unwrap().write(&source, &options).unwrap().unwrap();
    let text = String::from_utf8(files.urdf).unwrap();
    assert_eq!(reported(&text, &yaml), "");
}

#[test]
fn independents_that_do_not_determine_the_rest_are_not_what_was_expected() {
    // a five-bar with a four-bar on one of its cranks
    let z = [0.0, 0.0, 1.0];
    let mass = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" \
        ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
    let mut urdf = "<robot name=\"bars\"><link name=\"base\"/>".to_owned();
    for (joint, parent, at) in [
        ("c1", "base", [0.0, 0.0, 0.0]),
        ("l1", "c1_link", [0.0, 1.0, 0.0]),
        ("c2", "base", [2.0, 0.0, 0.0]),
        ("l2", "c2_link", [0.0, 1.0, 0.0]),
        ("k", "c1_link", [0.0, 1.0, 0.0]),
        ("r", "base", [-1.2, 0.0, 0.0]),
    ] {
        urdf += &body(joint, parent, &format!("{joint}_link"), at, z);
    }
    for (pin, at) in [("p", "1 2 0"), ("s", "-1 0.9 0")] {
        urdf += &format!(
            "<link name=\"{pin}_mark\">{mass}</link><joint name=\"{pin}\" type=\"fixed\"><parent \
             link=\"base\"/><child link=\"{pin}_mark\"/><origin xyz=\"{at}\"/></joint>"
        );
    }
    urdf += "</robot>";
    let cut = |pin: &str, ends: [&str; 2]| {
        format!(
            "  - cut_joint: {pin}\n    predecessor_body: {}_link\n    \
             successor_body: {}_link\n    {PLANAR}\n",
            ends[0], ends[1]
        )
    };
    let yaml = |independent: &str| {
        format!(
            "submechanisms:\n- type: NUMERICAL\n  contextual_name: bars\n  \
             jointnames_spanningtree: [c1, l1, c2, l2, k, r]\n  \
             jointnames_independent: [{independent}]\n  jointnames_active: [c1, c2]\n  \
             loop_constraints:\n{}{}",
            cut("p", ["l1", "l2"]),
            cut("s", ["k", "r"])
        )
    };
    let said = reported(&urdf, &yaml("c1, r"));
    assert!(
        said.contains("but the independents c1, r do not determine l1, c2, l2, expected")
            && said.contains("write jointnames_independent: [c1, c2]")
            && !said.contains("expected mobility"),
        "{said}"
    );
    assert_eq!(reported(&urdf, &yaml("c1, c2")), "");
}

/// A rod with three revolutes at each end, or as many as are given at the far one, between a crank
/// and a rocker; its cut is on the rocker.
fn rod_of_revolutes(far: usize, axes: [[f64; 3]; 3]) -> (String, Vec<String>) {
    let y = [0.0, 1.0, 0.0];
    let mut urdf = body("crank", "base", "crank_link", [0.0; 3], y);
    urdf += &body("rocker", "base", "rocker_link", [0.5, 0.1, 0.0], [0.0, 1.0, 0.2]);
    let mut tree = vec!["crank".to_owned(), "rocker".to_owned()];
    let mut parent = "crank_link".to_owned();
    for k in 0..3 + far {
        let at = match k {
            0 => [0.0, 0.0, 0.1],
            3 => [0.5, 0.1, 0.05],
            _ => [0.0; 3],
        };
        let joint = format!("ball{k}");
        let child = format!("ball{k}_link");
        urdf += &body(&joint, &parent, &child, at, axes[k % 3]);
        tree.push(joint);
        parent = child;
    }
    let urdf = format!(
        "<robot name=\"rods\"><link name=\"base\"/><link name=\"mark\"><inertial>\
         <mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>\
         </inertial></link>\n{urdf}<joint name=\"pin\" type=\"fixed\"><parent link=\"base\"/>\
         <child link=\"mark\"/><origin xyz=\"0.5 0.1 0.15\"/></joint></robot>"
    );
    (urdf, tree)
}

#[test]
fn a_rod_between_balls_of_three_revolutes_spins_idly() {
    let cuts = [(0, "spherical"), (2, "revolute\n    axis: [0, 0, 1]"), (3, "weld")];
    let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let skew = [[1.0, 0.2, 0.1], [0.1, 1.0, -0.3], [0.3, 0.2, 1.0]];
    for axes in [straight, skew] {
        for (far, cut) in cuts {
            let (urdf, tree) = rod_of_revolutes(far, axes);
            let last = format!("ball{}_link", 2 + far);
            let yaml = format!(
                "submechanisms:\n- type: NUMERICAL\n  contextual_name: rods\n  \
                 jointnames_spanningtree: [{}]\n  jointnames_independent: [crank]\n  \
                 jointnames_active: [crank]\n  loop_constraints:\n  - cut_joint: pin\n    \
                 predecessor_body: {last}\n    successor_body: rocker_link\n    \
                 cut_joint_type: {cut}\n",
                tree.join(", ")
            );
            let said = reported(&urdf, &yaml);
            assert!(
                said.contains("idle joints") && said.lines().count() == 1,
                "{far} {cut} {axes:?}: {said}"
            );
        }
    }
}

/// That rod with its far ball on the rocker: `near` revolutes on the crank, `far` on the rocker,
/// and a cut where they meet.
fn rod_from_both_ends(
    axes: [[f64; 3]; 3],
    far: usize,
    cut: &str,
    cut_at: [f64; 3],
) -> (String, String) {
    let y = [0.0, 1.0, 0.0];
    let mut urdf = body("crank", "base", "crank_link", [0.0; 3], y);
    urdf += &body("rocker", "base", "rocker_link", [0.5, 0.1, 0.0], [0.0, 1.0, 0.2]);
    let mut tree = vec!["crank".to_owned(), "rocker".to_owned()];
    let mut last = Vec::new();
    for (end, first, at, count) in
        [("near", "crank", [0.0, 0.0, 0.1], 3), ("far", "rocker", [0.0, 0.0, 0.15], far)]
    {
        let mut parent = format!("{first}_link");
        for k in 0..count {
            let joint = format!("{end}{k}");
            let child = format!("{joint}_link");
            let place = if k == 0 { at } else { [0.0; 3] };
            urdf += &body(&joint, &parent, &child, place, axes[k]);
            tree.push(joint);
            parent = child;
        }
        last.push(parent);
    }
    let [x, y, z] = cut_at;
    let urdf = format!(
        "<robot name=\"rods\"><link name=\"base\"/><link name=\"mark\"><inertial>\
         <mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>\
         </inertial></link>\n{urdf}<joint name=\"pin\" type=\"fixed\"><parent link=\"base\"/>\
         <child link=\"mark\"/><origin xyz=\"{x} {y} {z}\"/></joint></robot>"
    );
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: rods\n  \
         jointnames_spanningtree: [{}]\n  jointnames_independent: [crank]\n  \
         jointnames_active: [crank]\n  loop_constraints:\n  - cut_joint: pin\n    \
         predecessor_body: {}\n    successor_body: {}\n    cut_joint_type: {cut}\n",
        tree.join(", "),
        last[0],
        last[1]
    );
    (urdf, yaml)
}

#[test]
fn a_rod_that_is_cut_within_or_at_its_far_ball_spins_idly() {
    let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let skew = [[1.0, 0.2, 0.1], [0.1, 1.0, -0.3], [0.3, 0.2, 1.0]];
    let ball = [0.5, 0.1, 0.15];
    let cuts = [
        (3, "weld", [0.25, 0.05, 0.125]),
        (3, "weld", [0.2, 0.3, 0.1]),
        (3, "weld", ball),
        (2, "revolute\n    axis: [0, 0.6, 0.8]", ball),
        (1, "universal\n    axis: [0, 0.6, 0.8]\n    axis2: [0, -0.8, 0.6]", ball),
    ];
    for axes in [straight, skew] {
        for (far, cut, at) in cuts {
            let (urdf, yaml) = rod_from_both_ends(axes, far, cut, at);
            let said = reported(&urdf, &yaml);
            assert!(
                said.contains("idle joints") && said.lines().count() == 1,
                "{far} {cut} {axes:?}: {said}"
            );
        }
    }
    // a proposal names them, though none was declared independent
    let (urdf, yaml) = rod_from_both_ends(skew, 3, "weld", cuts[0].2);
    let yaml = yaml.replace("jointnames_independent: [crank]", "jointnames_independent: []");
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(yaml.into()) };
    let found = suggest(&source, &Options::default()).unwrap();
    assert_eq!(found.report.errors, [], "{}", found.yaml);
    let lines: Vec<&str> = found.yaml.lines().collect();
    assert!(lines[0].starts_with("# rods that spin idly, by the joint that stands still: "));
    assert!(found.yaml.contains("jointnames_independent: [crank]"), "{}", found.yaml);
    assert!(found.yaml.contains("jointnames_spanningtree: [crank, rocker, "), "{}", found.yaml);
}
