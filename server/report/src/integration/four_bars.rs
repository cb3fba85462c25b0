//! Four-bars in a row (IFToMM A02): as text, and their motion by other means.

use sarrus_models::Source;

/// N four-bars in a row, upright at zero: cranks A0 to AN on the ground and couplers B0 …, all rods
/// of 1 m and 1 kg. A0 is independent.
pub fn four_bars(n: usize) -> Source {
    let inertial = |x: f64, z: f64| {
        let [ixx, izz] = [z, x].map(|length| if length > 0.0 { 1.0 / 12.0 } else { 0.0 });
        format!(
            "<inertial><origin xyz=\"{x} 0 {z}\"/><mass value=\"1\"/><inertia ixx=\"{ixx}\" \
            ixy=\"0\" ixz=\"0\" iyy=\"{}\" iyz=\"0\" izz=\"{izz}\"/></inertial>",
            1.0 / 12.0
        )
    };
    let joint = |name: &str, parent: &str, child: &str, x: usize, z: usize| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child \
            link=\"{child}\"/><origin xyz=\"{x} 0 {z}\"/><axis xyz=\"0 -1 0\"/></joint>\n"
        )
    };
    let (mut urdf, mut names, mut loops) =
        ("<robot name=\"r\"><link name=\"ground\"/>\n".to_owned(), Vec::new(), String::new());
    for i in 0..=n {
        urdf += &format!(
            "<link name=\"crank{i}\">{}</link>{}",
            inertial(0.0, 0.5),
            joint(&format!("A{i}"), "ground", &format!("crank{i}"), i, 0)
        );
        names.push(format!("A{i}"));
        if i < n {
            let parent = format!("crank{i}");
            let child = format!("coupler{i}");
            urdf += &format!(
                "<link name=\"{child}\">{}</link>{}",
                inertial(0.5, 0.0),
                joint(&format!("B{i}"), &parent, &child, 0, 1)
            );
            names.push(format!("B{i}"));
            loops += &format!(
                "  - {{cut_joint: C{i}, predecessor_body: {child}, successor_body: crank{}, \
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
/// `[s]`: one pendulum, ((N+1)/3 + N) θ̈ = −((N+1)/2 + N) g cos θ, by Runge and Kutta's method at a
/// step that leaves nothing to be seen.
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
