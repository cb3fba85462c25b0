//! Small robots of the closures that no bundled robot has.

/// A robot as text.
pub(crate) struct Text {
    pub(crate) name: &'static str,
    /// Its moving links and its joints, in place of a URDF.
    joints: &'static [Part],
    /// Couplings of several joints.
    couplings: &'static str,
    pub(crate) submechanisms: &'static str,
}

/// A joint and its child link: name, kind, parent, origin, axis.
struct Part(&'static str, &'static str, &'static str, &'static str, &'static str);

/// Every one of them.
pub(crate) const TEXTS: [Text; 3] = [
    Text {
        name: "four_bar",
        joints: &[
            Part("crank", "revolute", "base", "0 0 0", "1 0 0"),
            Part("coupler", "revolute", "crank", "0 0 0.3", "1 0 0"),
            Part("follower", "revolute", "base", "0 0.5 0", "1 0 0"),
        ],
        couplings: "",
        submechanisms: "submechanisms:
- type: FOURBAR
  contextual_name: FourBar
  jointnames_spanningtree: [crank, coupler, follower]
  jointnames_independent: [crank]
  jointnames_active: [crank]
  loop_constraints:
  - cut_joint: pin
    predecessor_body: coupler_link
    successor_body: follower_link
    predecessor_placement: {xyz: [0, 0.55, 0.12]}
    successor_placement: {xyz: [0, 0.05, 0.42]}
    cut_joint_type: planar_revolute
    axis: [1, 0, 0]
",
    },
    Text {
        name: "slider_crank",
        joints: &[
            Part("crank", "revolute", "base", "0 0 0", "1 0 0"),
            Part("coupler", "revolute", "crank", "0 0 0.3", "1 0 0"),
            Part("slider", "prismatic", "base", "0 0.8 0", "0 1 0"),
        ],
        couplings: "",
        submechanisms: "submechanisms:
- type: SLIDERCRANK
  contextual_name: SliderCrank
  jointnames_spanningtree: [crank, coupler, slider]
  jointnames_independent: [crank]
  jointnames_active: [slider]
  loop_constraints:
  - cut_joint: pin
    predecessor_body: coupler_link
    successor_body: slider_link
    predecessor_placement: {xyz: [0, 0.8, -0.3]}
    successor_placement: {xyz: [0, 0, 0]}
    cut_joint_type: planar_revolute
    axis: [1, 0, 0]
",
    },
    Text {
        name: "differential",
        joints: &[
            Part("pitch", "revolute", "base", "0 0 0", "0 1 0"),
            Part("roll", "revolute", "pitch", "0 0 0", "1 0 0"),
            Part("left", "revolute", "base", "0 0.1 0", "0 1 0"),
            Part("right", "revolute", "base", "0 -0.1 0", "0 1 0"),
        ],
        couplings: r#"<transmission name="left"><joint name="left">
<depends_on joint="pitch" multiplier="1"/><depends_on joint="roll" multiplier="1"/>
</joint></transmission>
<transmission name="right"><joint name="right">
<depends_on joint="pitch" multiplier="1"/><depends_on joint="roll" multiplier="-1"/>
</joint></transmission>
"#,
        submechanisms: "submechanisms:
- type: DIFFERENTIAL
  contextual_name: Differential
  jointnames_spanningtree: [pitch, roll, left, right]
  jointnames_independent: [pitch, roll]
  jointnames_active: [left, right]
",
    },
];

impl Text {
    /// The URDF; every link has the same inertia.
    pub(crate) fn urdf(&self) -> String {
        let mut urdf = format!("<robot name=\"{}\">\n<link name=\"base_link\"/>\n", self.name);
        for Part(name, kind, parent, origin, axis) in self.joints {
            urdf += &format!(
                r#"<link name="{name}_link"><inertial>
<origin xyz="0.01 0.1 0.05"/><mass value="0.8"/>
<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.004"/></inertial></link>
<joint name="{name}" type="{kind}">
<parent link="{parent}_link"/><child link="{name}_link"/>
<origin xyz="{origin}"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="1000" velocity="10"/></joint>
"#
            );
        }
        urdf + self.couplings + "</robot>\n"
    }
}
