//! Faults of submechanism files, each with its whole message. The text before `=>` becomes the text
//! after it.

use super::*;

faults! { yaml:
    what_is_not_yaml_is_reported_where_it_breaks:
        "[elbow, swing, slide]\n  jointnames_spanningtree" => "[elbow, swing, slide\n  \
            jointnames_spanningtree",
        "submechanisms.yml:7:26: this is not YAML: illegal placement of ':' indicator, expected a \
         submechanism file, correct the file at this position";
    a_key_that_is_not_known_holds_an_alias:
        "[elbow]\n" => "&one [elbow]\n  jointnames_other: *one\n",
        "submechanisms.yml:9:3: the key `jointnames_other` of a submechanism is not known, \
         expected type, contextual_name, name, file_path, jointnames, jointnames_spanningtree, \
         jointnames_independent, jointnames_active, loop_constraints, closed_forms, did you \
         mean `jointnames_active`?";
    an_alias_of_nothing_is_an_error:
        "[elbow]\n" => "*one\n",
        "submechanisms.yml:8:27: this is not YAML: while parsing node, found unknown anchor, \
         expected a submechanism file, correct the file at this position";
    an_alias_within_its_own_value_is_an_error:
        "[elbow]\n" => "&one [elbow, *one]\n",
        "submechanisms.yml:8:40: an alias (`*…`) within the value that it stands for, expected a \
         value that ends, write the value out";
    a_merge_of_keys_is_an_error:
        "file_path: lambda.urdf" => "<<: {file_path: lambda.urdf}",
        "submechanisms.yml:5:3: the key `<<` of a submechanism is not known, expected type, \
         contextual_name, name, file_path, jointnames, jointnames_spanningtree, \
         jointnames_independent, jointnames_active, loop_constraints, closed_forms, write out the \
         keys that it merges";
    a_tag_is_an_error:
        "file_path: lambda.urdf" => "file_path: !path lambda.urdf",
        "submechanisms.yml:5:14: a tag (`!…`), expected plain values, remove it";
    a_second_document_is_an_error:
        "submechanisms:\n" => "submechanisms: []\n---\nsubmechanisms:\n",
        "submechanisms.yml:1:16: `submechanisms` is empty, expected at least one, list the joints \
         in submechanisms",
        "submechanisms.yml:2:1: a second document, expected one, remove what follows `---`";
    a_file_without_submechanisms_is_an_error:
        "submechanisms:\n" => "robots:\n",
        "submechanisms.yml:1:1: the key `robots` of the file is not known, expected submechanisms, \
         actuators, exoskeletons, remove it",
        "submechanisms.yml:1:1: the file has no `submechanisms`, expected a list of at least one, \
         add it";
    an_unknown_key_is_an_error_with_the_nearest:
        "jointnames_active" => "jointname_active",
        "submechanisms.yml:2:3: the submechanism has no `jointnames_active`, expected a list of \
         joints, which may be empty, add it",
        "submechanisms.yml:9:3: the key `jointname_active` of a submechanism is not known, \
         expected type, contextual_name, name, file_path, jointnames, jointnames_spanningtree, \
         jointnames_independent, jointnames_active, loop_constraints, closed_forms, did you \
         mean `jointnames_active`?";
    an_unknown_key_of_a_loop_is_an_error:
        "predecessor_body" => "body",
        "submechanisms.yml:11:5: the loop constraint has no `predecessor_body`, expected \
         `predecessor_body: NAME`, add it",
        "submechanisms.yml:12:5: the key `body` of a loop constraint is not known, expected \
         cut_joint, predecessor_body, successor_body, frames, constraint_axes, cut_joint_type, \
         axis, axis2, baumgarte_stabilization_parameter, predecessor_placement, successor_placement, \
         remove it";
    an_unknown_key_of_an_axis_is_an_error:
        "{name: y," => "{name: y, unit: m,",
        "submechanisms.yml:15:17: the key `unit` of a constraint axis is not known, expected name, \
         axis, baumgarte_stabilization_parameter, remove it";
    a_key_that_is_there_twice_is_an_error:
        "file_path: lambda.urdf" => "type: RRPR",
        "submechanisms.yml:5:3: the key `type` of a submechanism is there twice, expected one, \
         remove one of them";
    exoskeletons_are_a_warning:
        "submechanisms:\n" => "exoskeletons: [{name: a}]\nsubmechanisms:\n",
        "submechanisms.yml:1:15: `exoskeletons` is not used, expected submechanisms only, couple \
         their joints by <mimic> in the URDF";
    a_name_that_is_a_list_is_an_error:
        "contextual_name: elbow_joint" => "contextual_name: [a]",
        "submechanisms.yml:4:20: `contextual_name` holds a list, expected a name, write a name";
    a_list_that_is_a_word_is_an_error:
        "[slide]" => "slide",
        "submechanisms.yml:9:22: `jointnames_active` is `slide`, expected a list, write \
         `jointnames_active: [...]`";
    a_submechanism_without_type_is_an_error:
        "  type: NUMERICAL\n" => "",
        "submechanisms.yml:2:3: the submechanism has no `type`, expected a type as 3R, RRPR or \
         NUMERICAL, add it";
    a_submechanism_without_a_list_is_an_error:
        "  jointnames_active: [slide]\n" => "",
        "submechanisms.yml:2:3: the submechanism has no `jointnames_active`, expected a list of \
         joints, which may be empty, add it";
    a_submechanism_without_a_name_is_an_error:
        "name: lambda_mechanism\n  type: NUMERICAL\n  contextual_name: \
         elbow_joint\n" => "type: NUMERICAL\n",
        "submechanisms.yml:2:3: the submechanism has no `contextual_name`, expected a name of its \
         own, add it";
    an_axis_of_five_numbers_is_an_error:
        "[0, 0, 0, 0, 1, 0]" => "[0, 0, 0, 1, 0]",
        "submechanisms.yml:15:23: `axis` of a constraint axis holds 5 values, expected 6 finite \
         numbers, correct the list";
    a_letter_in_an_axis_is_an_error:
        "[0, 0, 0, 0, 1, 0]" => "[0, 0, x, 0, 1, 0]",
        "submechanisms.yml:15:30: `axis`: `x` is not a number, expected one finite number, correct \
         the value";
    a_quoted_number_is_an_error:
        "[0, 0, 0, 0, 1, 0]" => r#"[0, 0, 0, 0, "1", 0]"#,
        "submechanisms.yml:15:36: `axis`: `1` is a text in quotes, expected one finite number, \
         correct the value";
    an_infinite_axis_is_an_error:
        "[0, 0, 0, 0, 1, 0]" => "[0, 0, 0, 0, .inf, 0]",
        "submechanisms.yml:15:36: `axis`: `.inf` is not finite, expected one finite number, \
         correct the value";
    a_zero_constraint_axis_is_an_error:
        "[0, 0, 0, 0, 1, 0]" => "[0, 0, 0, 0, 0, 0]",
        "submechanisms.yml:15:23: the constraint axis is zero, expected a direction [wx, wy, wz, \
         vx, vy, vz], correct it";
    a_malformed_stabilisation_parameter_is_an_error:
        "0.02" => "often",
        "submechanisms.yml:17:40: `baumgarte_stabilization_parameter`: `often` is not a number, \
         expected one finite number, correct the value";
    axes_of_one_name_are_an_error:
        "name: z" => "name: y",
        "submechanisms.yml:16:14: a second axis of this loop is named `y`, expected a name of its \
         own, rename one of them";
    a_loop_without_axes_is_an_error:
        "    constraint_axes:\n    - {name: y, axis: [0, 0, 0, 0, 1, 0]}\n    - \
         {name: z, axis: [0, 0, 0, 0, 0, 1]}\n" => "",
        "submechanisms.yml:11:5: the loop constraint has no `constraint_axes`, expected at least \
         one, list the constrained directions, or give a cut_joint_type";
    a_loop_without_a_body_is_an_error:
        "    successor_body: rod\n" => "",
        "submechanisms.yml:11:5: the loop constraint has no `successor_body`, expected \
         `successor_body: NAME`, add it";
    one_placement_alone_is_an_error:
        "    successor_body: rod\n" => "    successor_body: rod\n    successor_placement: \
            {xyz: [0, 0, 0]}\n",
        "submechanisms.yml:14:26: the loop has `successor_placement` but no \
         `predecessor_placement`, expected both or neither, add `predecessor_placement`";
    frames_beside_other_placements_are_an_error:
        "    predecessor_body: rocker\n    successor_body: rod\n" => "    predecessor_body: \
            rocker\n    frames: [rocker]\n",
        "submechanisms.yml:12:23: the loop has `frames` and `predecessor_body`, expected one of \
         them, remove the other",
        "submechanisms.yml:13:13: `frames` holds 1 names, expected two links, write `frames: \
         [LINK, LINK]`";
    frames_that_are_apart_leave_the_loop_open:
        "    predecessor_body: rocker\n    successor_body: rod\n" => "    frames: [rocker, rod]\n",
        "submechanisms.yml:4:20: a loop that is open by 3.563e-1 m (or rad) at the zero pose, \
         expected placements that coincide at zero, correct predecessor_placement, \
         successor_placement or the joints' origins; `sarrus check --assemble --write OUT.urdf` \
         does it";
    a_malformed_placement_is_an_error:
        "    successor_body: rod\n" => "    successor_body: rod\n    predecessor_placement: \
            {xyz: [0, 0]}\n    successor_placement: {xyz: [0, 0, a], rot: 3}\n",
        "submechanisms.yml:14:34: `xyz` of predecessor_placement holds 2 values, expected 3 finite \
         numbers, correct the list",
        "submechanisms.yml:15:39: `xyz`: `a` is not a number, expected one finite number, correct \
         the value",
        "submechanisms.yml:15:43: the key `rot` of successor_placement is not known, expected xyz, \
         rpy, remove it";
    a_joint_that_does_not_exist_is_an_error_with_the_nearest:
        "jointnames: [elbow, swing" => "jointnames: [elbow, sving",
        "submechanisms.yml:6:23: `jointnames` names the joint `sving`, which does not exist, \
         expected a joint of the URDF, did you mean `swing`?";
    a_tree_joint_that_does_not_exist_is_an_error_with_the_nearest:
        "jointnames_spanningtree: [elbow, swing" => "jointnames_spanningtree: [elbow, sving",
        "submechanisms.yml:7:36: `jointnames_spanningtree` names the joint `sving`, which does not \
         exist, expected a joint of the URDF, did you mean `swing`?",
        "robot.urdf:29:3: the joint `swing` moves but is in no submechanism, expected every moving \
         joint in one, add it to a jointnames_spanningtree or make it fixed; it is read as serial, \
         independent and active";
    a_name_that_is_there_twice_is_an_error:
        "jointnames_spanningtree: [elbow, swing" => "jointnames_spanningtree: [elbow, elbow, swing",
        "submechanisms.yml:7:36: `elbow` is in `jointnames_spanningtree` twice, expected once, \
         remove one of them";
    an_independent_joint_outside_the_tree_is_an_error:
        "jointnames_independent: [elbow]" => "jointnames_independent: [shoulder]",
        "submechanisms.yml:8:28: `jointnames_independent` names `shoulder`, which is not in the \
         spanning tree, expected names of jointnames_spanningtree, add it to \
         jointnames_spanningtree or remove it";
    an_active_joint_outside_the_tree_is_an_error:
        "[slide]" => "[slid]",
        "submechanisms.yml:9:23: `jointnames_active` names `slid`, which is not in the spanning \
         tree, expected names of jointnames_spanningtree, did you mean `slide`?";
    a_body_that_does_not_exist_is_an_error_with_the_nearest:
        "predecessor_body: rocker" => "predecessor_body: roker",
        "submechanisms.yml:12:23: `predecessor_body` names the link `roker`, which does not exist, \
         expected a link of the URDF: rocker, rod, base, stator, did you mean `rocker`?";
    a_loop_of_one_body_is_an_error:
        "predecessor_body: rocker" => "predecessor_body: rod",
        "submechanisms.yml:13:21: `rod` is both predecessor and successor, expected two bodies, \
         correct one of them";
    a_cut_joint_that_is_no_joint_is_a_warning:
        "cut_joint: slide" => "cut_joint: RodEnd",
        "submechanisms.yml:11:16: the cut joint `RodEnd` is no joint of the URDF, so the frame of \
         `rocker` is taken, expected the frame of a joint, name a joint, or give \
         predecessor_placement and successor_placement";
    submechanisms_of_one_name_and_a_joint_in_two_of_them_are_errors:
        "submechanisms:\n" => "submechanisms:\n- \
            {type: R, contextual_name: elbow_joint, jointnames_spanningtree: [elbow], jointnames_independent: [elbow], jointnames_active: [elbow]}\n",
        "submechanisms.yml:5:20: a second submechanism is named `elbow_joint`, expected a \
         contextual_name of its own, rename one of them",
        "submechanisms.yml:8:29: the joint `elbow` is already in the submechanism `elbow_joint`, \
         expected each joint in one, remove it from one of them";
    an_unknown_submechanism_type_is_an_error_with_the_nearest:
        "NUMERICAL" => "NUMERIC",
        "submechanisms.yml:3:9: the submechanism type `NUMERIC` is not known, expected SERIAL, \
         RRPR, rrPr, 2SPU+1U, 2SPRR+1U, 2SURRPR+1U, 6UPS, 3RUS2, 3RUS2_ANKLE, PARALLELOGRAMCHAIN, \
         FOURBAR, SLIDERCRANK, DIFFERENTIAL, TRANSMISSION, NUMERICAL, or joints in letters as 3R \
         or 3T+3R, did you mean `NUMERICAL`?";
    a_type_far_from_all_is_reported_with_what_to_do:
        "NUMERICAL" => "4-bar",
        "submechanisms.yml:3:9: the submechanism type `4-bar` is not known, expected SERIAL, RRPR, \
         rrPr, 2SPU+1U, 2SPRR+1U, 2SURRPR+1U, 6UPS, 3RUS2, 3RUS2_ANKLE, PARALLELOGRAMCHAIN, \
         FOURBAR, SLIDERCRANK, DIFFERENTIAL, TRANSMISSION, NUMERICAL, or joints in letters as 3R \
         or 3T+3R, use NUMERICAL with loop_constraints for any other mechanism";
    a_lambda_has_three_joints_and_one_of_them_independent:
        "type: NUMERICAL" => "type: 2SPU+1U",
        "submechanisms.yml:3:9: `2SPU+1U` with 3 spanning-tree joints, expected 8, correct \
         jointnames_spanningtree or use RRPR or rrPr or FOURBAR or SLIDERCRANK or NUMERICAL",
        "submechanisms.yml:3:9: `2SPU+1U` with 1 independent joint, expected 2, correct \
         jointnames_independent";
    a_serial_type_has_every_joint_independent_and_no_loop:
        "type: NUMERICAL" => "type: SERIAL",
        "submechanisms.yml:3:9: the serial type `SERIAL` with 1 of 3 joints independent, expected \
         all of them, list every joint in jointnames_independent",
        "submechanisms.yml:11:5: the serial type `SERIAL` has loop constraints, expected none, use \
         NUMERICAL or the type of the mechanism";
    the_letters_of_a_serial_type_fit_its_joints:
        "type: NUMERICAL
  contextual_name: elbow_joint
  file_path: lambda.urdf
  jointnames: [elbow, swing, slide]
  jointnames_spanningtree: [elbow, swing, slide]
  jointnames_independent: [elbow]
  jointnames_active: [slide]
  loop_constraints:
  - cut_joint: slide
    predecessor_body: rocker
    successor_body: rod
    constraint_axes:
    - {name: y, axis: [0, 0, 0, 0, 1, 0]}
    - {name: z, axis: [0, 0, 0, 0, 0, 1]}
    baumgarte_stabilization_parameter: 0.02
" => "type: 2R+2P
  contextual_name: elbow_joint
  jointnames_spanningtree: [elbow, swing, slide]
  jointnames_independent: [elbow, swing, slide]
  jointnames_active: []
",
        "submechanisms.yml:3:9: the type `2R+2P` stands over 2 rotations and 1 translation, \
         expected 2 and 2, correct the type or jointnames_spanningtree";
    a_numerical_submechanism_needs_loops:
        "  loop_constraints:
  - cut_joint: slide
    predecessor_body: rocker
    successor_body: rod
    constraint_axes:
    - {name: y, axis: [0, 0, 0, 0, 1, 0]}
    - {name: z, axis: [0, 0, 0, 0, 0, 1]}
    baumgarte_stabilization_parameter: 0.02
" => "",
        "submechanisms.yml:2:3: NUMERICAL without `loop_constraints`, expected at least one loop, \
         add loop_constraints";
    a_transmission_needs_couplings:
        "type: NUMERICAL
  contextual_name: elbow_joint
  file_path: lambda.urdf
  jointnames: [elbow, swing, slide]
  jointnames_spanningtree: [elbow, swing, slide]
  jointnames_independent: [elbow]
  jointnames_active: [slide]
  loop_constraints:
  - cut_joint: slide
    predecessor_body: rocker
    successor_body: rod
    constraint_axes:
    - {name: y, axis: [0, 0, 0, 0, 1, 0]}
    - {name: z, axis: [0, 0, 0, 0, 0, 1]}
    baumgarte_stabilization_parameter: 0.02
" => "type: TRANSMISSION
  contextual_name: elbow_joint
  jointnames_spanningtree: [elbow, swing, slide]
  jointnames_independent: [elbow]
  jointnames_active: []
",
        "submechanisms.yml:3:9: `TRANSMISSION` of 2 dependent joints, of which URDF couples 0, \
         expected a coupling for each, add <mimic> or <transmission> with <depends_on> to it, or \
         to the file of `file_path`";
    a_loop_of_seven_rows_is_an_error:
        "{name: y, axis: [0, 0, 0, 0, 1, 0]}" => "{name: a, axis: [1, 0, 0, 0, 0, 0]}\n    - \
            {name: b, axis: [0, 1, 0, 0, 0, 0]}\n    - {name: c, axis: [0, 0, 1, 0, 0, 0]}\n    - \
            {name: d, axis: [0, 0, 0, 1, 0, 0]}\n    - {name: e, axis: [0, 0, 0, 0, 1, 0]}\n    - \
            {name: f, axis: [0, 0, 0, 0, 1, 1]}",
        "submechanisms.yml:21:7: the loop constraint has 7 constraint_axes, expected at most six, \
         remove those that the others imply";
    a_mobility_that_differs_from_the_independents_is_an_error:
        "[elbow]\n" => "[elbow, swing]\n",
        "submechanisms.yml:4:20: mobility 1 (3 joints less rank 2 of 2 rows), expected mobility 2 \
         as declared by jointnames_independent, change jointnames_independent (such as [elbow]) or \
         loop_constraints";
    redundant_rows_are_reported_and_idle_joints_named:
        "    - {name: y, axis: [0, 0, 0, 0, 1, 0]}\n" => "    - {name: x, axis: [0, 0, 0, 1, 0, 0]}\n",
        "submechanisms.yml:4:20: mobility 2 (3 joints less rank 1 of 2 rows); redundant rows: \
         slide/x; joints that the independents do not determine: swing, slide, expected mobility 1 \
         as declared by jointnames_independent, change jointnames_independent (such as [elbow, \
         slide]) or loop_constraints";
    placements_that_leave_a_loop_open_are_an_error:
        "    successor_body: rod\n" => "    successor_body: rod\n    predecessor_placement: \
            {xyz: [0, 0, 0]}\n    successor_placement: {xyz: [0, 0, 0]}\n",
        "submechanisms.yml:4:20: a loop that is open by 3.563e-1 m (or rad) at the zero pose, \
         expected placements that coincide at zero, correct predecessor_placement, \
         successor_placement or the joints' origins; `sarrus check --assemble --write OUT.urdf` \
         does it";
}

/// The name that the URDF lacks is the slip: it is no help for the others.
#[test]
fn a_misspelt_joint_of_the_tree_is_not_proposed() {
    let yaml = with(YAML, "jointnames_spanningtree: [elbow", "jointnames_spanningtree: [elbw");
    let lines = [
        "submechanisms.yml:7:29: `jointnames_spanningtree` names the joint `elbw`, which does not \
         exist, expected a joint of the URDF, did you mean `elbow`?",
        "submechanisms.yml:8:28: `jointnames_independent` names `elbow`, which is not in the \
         spanning tree, expected names of jointnames_spanningtree, add it to \
         jointnames_spanningtree or remove it",
    ];
    let reported = reported(URDF, &yaml);
    assert_eq!(reported.lines().take(2).collect::<Vec<_>>(), lines);
}
