//! Faults of URDF files, each with its whole message. The text before `=>` becomes the text after
//! it.

use super::*;

faults! { urdf:
    a_document_type_declaration_is_refused:
        r#"<robot name="lambda">"# => "<!DOCTYPE robot [<!ENTITY x \"1\">]>\n<robot \
            name=\"lambda\">",
        "robot.urdf:1:1: a document type declaration (DTD), expected a file without one, remove \
         it; the five entities of XML itself need none";
    what_is_not_xml_is_reported_where_it_breaks:
        "</robot>" => "</robt>",
        "robot.urdf:42:1: this is not XML: expected 'robot' tag, not 'robt', expected a \
         well-formed URDF file, correct the file at this position";
    a_file_that_ends_early_is_reported_at_its_end:
        "</robot>\n" => "",
        "robot.urdf:42:1: this is not XML: the root node was opened but never closed, expected a \
         well-formed URDF file, correct the file at this position";
    a_faulty_attribute_is_reported:
        r#"<mass value="1.5"/>"# => "<mass value=1.5/>",
        "robot.urdf:6:19: this is not XML: expected a quote not '1', expected a well-formed URDF \
         file, correct the file at this position";
    another_robot_format_is_reported:
        r#"<robot name="lambda">"# => r#"<sdf name="lambda"><robot/></sdf><robot>"#,
        "robot.urdf:1:34: this is not XML: unknown token, expected a well-formed URDF file, \
         correct the file at this position";
    a_robot_needs_a_name:
        r#"<robot name="lambda">"# => "<robot>",
        r#"robot.urdf:1:1: `robot` has no `name`, expected name="…", add it"#;
    a_quaternion_needs_version_one_point_one:
        r#"rpy="1.1 0 0""# => r#"quat_xyzw="0 0 0 1""#,
        r#"robot.urdf:32:5: `quat_xyzw` in a file of version 1.0, expected `rpy`, write version="1.1" on `robot` or use `rpy`"#;
    an_unknown_version_is_reported:
        r#"<robot name="lambda">"# => r#"<robot name="lambda" version="2.0">"#,
        "robot.urdf:1:1: the version `2.0` of `robot`, expected 1.0, 1.1 or 1.2, correct it";
    an_unknown_element_is_a_warning_with_the_nearest:
        r#"<link name="base"/>"# => r#"<link name="base"><inertal/></link>"#,
        "robot.urdf:2:21: the element `inertal` in `link` is not known and not read, expected \
         inertial, did you mean `inertial`?";
    an_unknown_attribute_is_a_warning:
        r#"<mass value="1.5"/>"# => r#"<mass value="1.5" unit="kg"/>"#,
        "robot.urdf:6:25: the attribute `unit` of `mass` is not known and not read, expected \
         value, remove it if it is a slip";
    an_element_of_another_namespace_is_a_warning:
        r#"<link name="base"/>"# => r#"<link name="base"/><x:macro xmlns:x="http://x.org/"/>"#,
        "robot.urdf:2:22: the element `macro` in `robot` is not known and not read, expected link, \
         joint, transmission, coupling, remove it if it is a slip";
    a_second_axis_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0 0"/><axis xyz="0 1 0"/>"#,
        "robot.urdf:33:24: `joint` has a second `axis`, expected one, remove one of them";
    a_letter_among_numbers_is_an_error:
        r#"xyz="0 0.1 0""# => r#"xyz="0 x 0.1 0""#,
        "robot.urdf:32:18: `xyz` of `origin`: `x` is not a number, expected 3 finite numbers, \
         correct the value";
    a_wrong_count_of_numbers_is_an_error:
        r#"xyz="0 0.1 0""# => r#"xyz="0 0.1""#,
        "robot.urdf:32:18: `xyz` of `origin`: it holds 2 numbers, expected 3 finite numbers, \
         correct the value";
    an_infinite_number_is_an_error:
        r#"rpy="1.1 0 0""# => r#"rpy="inf 0 0""#,
        "robot.urdf:32:32: `rpy` of `origin`: `inf` is not finite, expected 3 finite numbers, \
         correct the value";
    a_number_that_is_not_one_is_an_error:
        r#"rpy="1.1 0 0""# => r#"rpy="nan 0 0""#,
        "robot.urdf:32:32: `rpy` of `origin`: `nan` is not finite, expected 3 finite numbers, \
         correct the value";
    a_number_too_large_is_an_error:
        r#"rpy="1.1 0 0""# => r#"rpy="1e999 0 0""#,
        "robot.urdf:32:32: `rpy` of `origin`: `1e999` is not finite, expected 3 finite numbers, \
         correct the value";
    an_empty_number_is_an_error:
        r#"velocity="10""# => r#"velocity="""#,
        "robot.urdf:27:60: `velocity` of `limit`: it holds 0 numbers, expected one finite number, \
         correct the value";
    a_negative_mass_is_an_error:
        r#"<mass value="1.5"/>"# => r#"<mass value="-1.5"/>"#,
        "robot.urdf:4:5: the mass of link `rocker` is -1.5, expected zero or more, correct the \
         value, or take it as it is with --lenient";
    an_infinite_mass_is_an_error:
        r#"<mass value="1.5"/>"# => r#"<mass value="inf"/>"#,
        "robot.urdf:6:20: `value` of `mass`: `inf` is not finite, expected one finite number, \
         correct the value";
    inertia_without_mass_is_an_error:
        r#"<mass value="1.5"/>"# => r#"<mass value="0"/>"#,
        "robot.urdf:4:5: link `rocker` has inertia but no mass, expected a mass, or zero inertia \
         too, correct one of them, or take it as it is with --lenient";
    a_negative_principal_moment_is_an_error:
        r#"ixx="0.02" ixy="0""# => r#"ixx="0.02" ixy="0.01""#,
        "robot.urdf:4:5: the inertia of link `rocker` has the negative principal moment \
         -3.293114e-3, expected moments of zero or more, correct the inertia about the centre of \
         mass, or take it as it is with --lenient";
    a_broken_triangle_inequality_is_an_error:
        r#"izz="0.02""# => r#"izz="0.022""#,
        "robot.urdf:4:5: the principal moments of link `rocker`, 1.000000e-3, 2.000000e-2 and \
         2.200000e-2, break the triangle inequality, expected none above the sum of the others, \
         correct the inertia about the centre of mass, or take it as it is with --lenient";
    an_inertial_without_mass_is_an_error:
        "      <mass value=\"1.5\"/>\n" => "",
        "robot.urdf:4:5: `inertial` has no `mass`, expected <mass …/>, add it or remove the \
         inertial";
    an_inertia_without_an_entry_is_an_error:
        r#" iyz="0" izz="0.02""# => r#" izz="0.02""#,
        r#"robot.urdf:7:7: `inertia` has no `iyz`, expected iyz="a number", add it"#;
    a_link_without_inertial_is_a_warning:
        r#"    <inertial>
      <mass value="0.4"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.0003" iyz="0" izz="0.002"/>
    </inertial>
"# => "",
        "robot.urdf:16:3: link `rod` has no inertial: a massless body, expected mass and inertia, \
         add them if it has any";
    a_zero_mass_is_a_warning:
        "      <mass value=\"0.4\"/>\n      <inertia ixx=\"0.002\" ixy=\"0\" ixz=\"0\" \
         iyy=\"0.0003\" iyz=\"0\" izz=\"0.002\"/>" => "      <mass value=\"0\"/>\n      <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>",
        "robot.urdf:17:5: link `rod` has zero mass: a massless body, expected mass and inertia, \
         add them if it has any";
    a_zero_inertia_is_a_warning:
        r#"ixx="0.002" ixy="0" ixz="0" iyy="0.0003" iyz="0" izz="0.002""# => r#"ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0""#,
        "robot.urdf:17:5: link `rod` has zero inertia: a point mass, expected an inertia, add it \
         if it is known";
    a_joint_needs_a_name:
        r#"<joint name="swing""# => "<joint",
        r#"robot.urdf:29:3: `joint` has no `name`, expected name="…", add it"#,
        "submechanisms.yml:6:23: `jointnames` names the joint `swing`, which does not exist, \
         expected a joint of the URDF, correct the name or add the joint to the URDF",
        "submechanisms.yml:7:36: `jointnames_spanningtree` names the joint `swing`, which does not \
         exist, expected a joint of the URDF, correct the name or add the joint to the URDF";
    an_empty_name_is_an_error:
        r#"<link name="base"/>"# => r#"<link name=""/>"#,
        "robot.urdf:2:15: `name` of `link` is empty, expected a name, fill it in",
        "robot.urdf:23:19: the parent link `base` of joint `elbow` does not exist, expected a link \
         of this file: rod, rocker, stator, correct the name or add the link",
        "robot.urdf:30:19: the parent link `base` of joint `swing` does not exist, expected a link \
         of this file: rod, rocker, stator, correct the name or add the link";
    a_joint_needs_a_type:
        r#" type="continuous""# => "",
        r#"robot.urdf:29:3: `joint` has no `type`, expected type="…", add it"#;
    an_unknown_joint_type_is_an_error_with_the_nearest:
        r#"type="continuous""# => r#"type="continous""#,
        "robot.urdf:29:29: the joint type `continous` is not known, expected revolute, continuous, \
         prismatic, fixed, floating, spherical, ball, planar, universal, did you mean \
         `continuous`?";
    a_universal_joint_needs_two_axes:
        r#"type="continuous""# => r#"type="universal""#,
        "robot.urdf:29:3: the universal joint `swing` has no `axis2`, expected <axis2 xyz=\"…\"/>, \
         add it";
    a_joint_of_one_axis_has_no_second:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0 0"/><axis2 xyz="0 1 0"/>"#,
        "robot.urdf:33:24: `axis2` of the joint `swing`, which has one axis, expected the type \
         `universal`, remove it";
    a_zero_axis_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="0 0 0"/>"#,
        "robot.urdf:33:5: the axis of joint `swing` is zero, expected a direction as 0 0 1, \
         correct it";
    a_minute_axis_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="0 0 1e-200"/>"#,
        "robot.urdf:33:5: the axis of joint `swing` has a length near 1e-200, expected a direction \
         as 0 0 1, correct it";
    a_malformed_axis_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0"/>"#,
        "robot.urdf:33:16: `xyz` of `axis`: it holds 2 numbers, expected 3 finite numbers, correct \
         the value";
    an_axis_without_direction_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => "<axis/>",
        "robot.urdf:33:5: `axis` has no `xyz`, expected a direction as 0 0 1, add it";
    a_revolute_joint_without_limits_is_an_error:
        "    <limit lower=\"-1.5\" upper=\"1.4\" effort=\"100\" velocity=\"10\"/>\n" => "",
        r#"robot.urdf:22:3: the revolute joint `elbow` has no limits, expected <limit lower="…" upper="…" effort="…" velocity="…"/>, add them, or make the joint continuous"#;
    a_prismatic_joint_without_limits_is_an_error:
        "    <limit lower=\"-0.1\" upper=\"0.1\" effort=\"1000\" velocity=\"1\"/>\n" => "",
        r#"robot.urdf:35:3: the prismatic joint `slide` has no limits, expected <limit lower="…" upper="…" effort="…" velocity="…"/>, add them"#;
    limits_without_a_range_are_a_warning:
        r#"lower="-1.5" upper="1.4" "# => "",
        "robot.urdf:27:5: `limit` of the joint `elbow` has neither `lower` nor `upper`, expected \
         the range of the joint, add them; it is read as unbounded";
    limits_without_effort_are_an_error:
        r#" effort="100""# => "",
        r#"robot.urdf:27:5: `limit` has no `effort`, expected effort="a number", add it"#;
    limits_in_the_wrong_order_are_an_error:
        r#"upper="1.4""# => r#"upper="-1.6""#,
        "robot.urdf:27:5: the lower limit -1.5 is above the upper limit -1.6, expected lower ≤ \
         upper, swap them";
    a_negative_effort_is_an_error:
        r#"effort="100""# => r#"effort="-100""#,
        "robot.urdf:27:5: the limit `effort` is -100, expected zero or more, correct the value";
    an_effort_of_minus_one_is_read_as_none:
        r#"effort="100""# => r#"effort="-1""#,
        "robot.urdf:27:5: the limit `effort` is -1, expected zero or more, remove it or correct it; it is read as unbounded";
    a_fault_in_the_axis_of_a_fixed_joint_is_a_warning:
        r#"<link name="base"/>"# => r#"<link name="base"/><link name="cap"/><joint name="f" type="fixed"><parent link="base"/><child link="cap"/><axis xyz="0 0 0 1"/></joint>"#,
        "robot.urdf:2:22: link `cap` has no inertial: a massless body, expected mass and inertia, add them if it has any",
        "robot.urdf:2:109: `xyz` of `axis`, which the joint `f` lacks: it holds 4 numbers, expected 3 finite numbers, remove it; it is not read";
    a_joint_needs_a_child:
        "    <child link=\"stator\"/>\n" => "",
        r#"robot.urdf:29:3: the joint has no `child`, expected <child link="…"/>, add it"#;
    a_link_that_does_not_exist_is_an_error_with_the_nearest:
        r#"<child link="stator"/>"# => r#"<child link="startor"/>"#,
        "robot.urdf:31:18: the child link `startor` of joint `swing` does not exist, expected a \
         link of this file: stator, rod, base, rocker, did you mean `stator`?";
    two_links_of_one_name_are_an_error:
        r#"<link name="base"/>"# => r#"<link name="base"/><link name="rod"/>"#,
        "robot.urdf:16:3: a second link is named `rod`, expected a name of its own, rename one of \
         them",
        "robot.urdf:2:22: link `rod` has no inertial: a massless body, expected mass and inertia, \
         add them if it has any";
    two_joints_of_one_name_are_an_error:
        r#"<joint name="swing""# => r#"<joint name="elbow""#,
        "robot.urdf:29:3: a second joint is named `elbow`, expected a name of its own, rename one \
         of them",
        "submechanisms.yml:6:23: `jointnames` names the joint `swing`, which does not exist, \
         expected a joint of the URDF, correct the name or add the joint to the URDF",
        "submechanisms.yml:7:36: `jointnames_spanningtree` names the joint `swing`, which does not \
         exist, expected a joint of the URDF, correct the name or add the joint to the URDF";
    two_roots_are_an_error:
        r#"<link name="base"/>"# => r#"<link name="base"/><link name="island"/>"#,
        "robot.urdf:2:22: the link `island` is a second root beside `base`, expected one root, \
         connect it by a joint or remove it";
    two_parents_are_an_error:
        r#"<child link="stator"/>"# => r#"<child link="rocker"/>"#,
        "robot.urdf:10:3: the link `stator` is a second root beside `base`, expected one root, \
         connect it by a joint or remove it",
        "robot.urdf:31:18: the link `rocker` has two parents, by the joints `elbow` and `swing`, \
         expected one, cut the loop here and write it as a loop constraint";
    a_cycle_is_an_error:
        "<parent link=\"base\"/>\n    <child \
         link=\"stator\"/>" => "<parent link=\"rod\"/>\n    <child link=\"stator\"/>",
        "robot.urdf:29:3: the joint `swing` closes a cycle of links, expected a tree, cut the loop \
         and write it as a loop constraint";
    a_mimic_of_nothing_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0 0"/><mimic joint="elbw"/>"#,
        "robot.urdf:33:38: the joint `swing` follows `elbw`, which does not exist, expected \
         another moving joint of this robot, did you mean `elbow`?";
    a_mimic_of_itself_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0 0"/><mimic joint="swing"/>"#,
        "robot.urdf:33:38: the joint `swing` follows `swing`, which is itself, expected another \
         moving joint of this robot, name another joint";
    a_mimic_with_a_malformed_factor_is_an_error:
        r#"<axis xyz="2 0 0"/>"# => r#"<axis xyz="2 0 0"/><mimic joint="elbow" multiplier="two"/>"#,
        "robot.urdf:33:57: `multiplier` of `mimic`: `two` is not a number, expected one finite \
         number, correct the value";
    a_mimic_that_is_left_on_a_fixed_joint_is_a_warning:
        "</robot>" => "  <link name=\"tool\"/>\n  <joint name=\"hold\" type=\"fixed\"><parent \
            link=\"rod\"/><child link=\"tool\"/><mimic joint=\"elbow\"/></joint>\n</robot>",
        "robot.urdf:42:3: link `tool` has no inertial: a massless body, expected mass and inertia, \
         add them if it has any",
        "robot.urdf:43:3: the fixed joint `hold` is coupled, expected a joint that moves, remove \
         the mimic or change the type; the coupling is not read";
    a_transmission_of_nothing_is_an_error:
        "</robot>" => "  <transmission name=\"t\"><joint name=\"swng\"><depends_on \
            joint=\"elbow\"/></joint></transmission>\n</robot>",
        "robot.urdf:42:39: the transmission names the joint `swng`, which does not exist, expected \
         a joint of this file, did you mean `swing`?";
    a_joint_coupled_twice_is_an_error:
        "</robot>" => "  <transmission><joint name=\"swing\"><depends_on joint=\"elbow\"/></joint>\
            </transmission>\n  <transmission><joint name=\"swing\"><depends_on joint=\"slide\"/>\
            </joint></transmission>\n</robot>",
        "robot.urdf:43:30: the joint `swing` is coupled a second time, expected one mimic or one \
         transmission, remove one of them";
    a_moving_joint_in_no_submechanism_is_a_warning:
        "</robot>" => r#"  <link name="tool"/>
  <joint name="spin" type="continuous">
    <parent link="rod"/>
    <child link="tool"/>
  </joint>
</robot>"#,
        "robot.urdf:42:3: link `tool` has no inertial: a massless body, expected mass and inertia, \
         add them if it has any",
        "robot.urdf:43:3: the joint `spin` moves but is in no submechanism, expected every moving \
         joint in one, add it to a jointnames_spanningtree or make it fixed; it is read as serial, \
         independent and active",
        "robot.urdf:43:3: no inertia that resists the motion of spin, expected a positive definite \
         reduced mass matrix, give mass or inertia to a link that these joints move; until then \
         forward dynamics answers mass_not_positive";
}
