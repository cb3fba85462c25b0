//! Four-bars in a row (IFToMM A02): as text, and their motion by other means.

use sarrus_models::Source;

/// N four-bars in a row, upright at zero: cranks A0 to AN on the ground and couplers B0 …, all rods
/// of 1 m and 1 kg. A0 is independent.
pub fn four_bars(n: usize) -> Source {
    let mut urdf = "<robot name=\"r\"><link name=\"ground\"/>\n".to_owned();
    let mut names = Vec::new();
    // a rod on a hinge, from the hinge along x or z
    let mut rod = |hinge: String, [parent, link]: [&str; 2], at: [usize; 2], middle: [f64; 2]| {
        urdf += &format!(
            r#"<link name="{link}"><inertial><origin xyz="{} 0 {}"/><mass value="1"/>
<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial></link>
<joint name="{hinge}" type="continuous"><parent link="{parent}"/><child link="{link}"/>
<origin xyz="{} 0 {}"/><axis xyz="0 -1 0"/></joint>
"#,
            middle[0],
            middle[1],
            middle[1] / 6.0,
            1.0 / 12.0,
            middle[0] / 6.0,
            at[0],
            at[1]
        );
        names.push(hinge);
    };
    let mut loops = String::new();
    for i in 0..=n {
        let crank = format!("crank{i}");
        rod(format!("A{i}"), ["ground", &crank], [i, 0], [0.0, 0.5]);
        if i < n {
            let coupler = format!("coupler{i}");
            rod(format!("B{i}"), [&crank, &coupler], [0, 1], [0.5, 0.0]);
            loops += &format!(
                "  - {{cut_joint: C{i}, predecessor_body: {coupler}, successor_body: crank{}, \
                predecessor_placement: {{xyz: [1, 0, 0]}}, successor_placement: {{xyz: [0, 0, \
                1]}}, cut_joint_type: planar_revolute, axis: [0, 1, 0]}}\n",
                i + 1
            );
        }
    }
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: r\n  jointnames_spanningtree: \
        [{}]\n  jointnames_independent: [A0]\n  jointnames_active: \
        [A0]\n  loop_constraints:\n{loops}",
        names.join(", ")
    );
    Source::Text { urdf: (urdf + "</robot>").into_bytes(), submechanisms: Some(yaml.into_bytes()) }
}

/// Angle `[rad]` and rate `[rad/s]` of N four-bars that move as parallelograms, after `duration`
/// `[s]`: one pendulum, ((N+1)/3 + N) θ̈ = −((N+1)/2 + N) g cos θ, by a Runge-Kutta method with a
/// step of negligible error.
pub fn pendulum(n: f64, [mut angle, mut rate]: [f64; 2], duration: f64) -> [f64; 2] {
    let pull = |angle: f64| -((n + 1.0) / 2.0 + n) * 9.81 * angle.cos() / ((n + 1.0) / 3.0 + n);
    let steps = 200_000;
    let h = duration / f64::from(steps);
    for _ in 0..steps {
        let a = [rate, pull(angle)];
        let b = [rate + 0.5 * h * a[1], pull(angle + 0.5 * h * a[0])];
        let c = [rate + 0.5 * h * b[1], pull(angle + 0.5 * h * b[0])];
        let d = [rate + h * c[1], pull(angle + h * c[0])];
        angle += h / 6.0 * (a[0] + 2.0 * (b[0] + c[0]) + d[0]);
        rate += h / 6.0 * (a[1] + 2.0 * (b[1] + c[1]) + d[1]);
    }
    [angle, rate]
}
