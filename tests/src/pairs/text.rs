//! A drawn robot as files, each part in a dialect drawn from the seed: loops as constraint axes,
//! cut joints, SDF, URDF+, `<loop_joint>` or `<constraint>`; couplings as `<mimic>`, plug-in,
//! transmission or `<coupling>`; springs and poses in their several ways.

use std::fmt::Write as _;

use sarrus_dynamics::description::{
    Curve, Cut, Description, JointKind, Placement, SubmechanismKind as Kind,
};

use crate::seed::Seeded;

/// The files of a robot.
pub struct Files {
    /// URDF.
    pub urdf: String,
    /// Submechanism file.
    pub yaml: String,
    /// It states an effect that is not modelled: only a lenient load may drop it, with a warning.
    pub drops: Option<&'static str>,
}

fn three(x: [f64; 3]) -> String {
    x.map(|x| format!("{x:?}")).join(" ")
}

fn six(x: [f64; 6]) -> String {
    x.map(|x| format!("{x:?}")).join(", ")
}

/// The cut joint of rows in this order, about or along z of the cut frame.
fn joint_type(rows: &str) -> Option<(&'static str, &'static str)> {
    Some(match rows {
        "xyz" => ("spherical", "ball"),
        "xyzab" => ("revolute", "continuous"),
        "xyzabc" => ("weld", "fixed"),
        "xyab" => ("cylindrical", "cylindrical"),
        "xyabc" => ("prismatic", "prismatic"),
        "xyzu" => ("universal", "universal"),
        _ => return None,
    })
}

fn quaternion(rpy: [f64; 3]) -> [f64; 4] {
    let half = rpy.map(|x| f64::sin_cos(0.5 * x));
    let [(sr, cr), (sp, cp), (sy, cy)] = half;
    [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
}

fn origin(seeded: &mut Seeded, at: &Placement) -> String {
    if seeded.chance(0.2) {
        let q = quaternion(at.rpy).map(|x| format!("{x:?}")).join(" ");
        return format!("<origin xyz=\"{}\" quat_xyzw=\"{q}\"/>", three(at.xyz));
    }
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", three(at.xyz), three(at.rpy))
}

/// `<pose>` of SDF.
fn pose(seeded: &mut Seeded, at: &Placement) -> String {
    let p = three(at.xyz);
    match seeded.below(4) {
        0 => {
            let degrees = at.rpy.map(f64::to_degrees);
            format!("<pose degrees=\"true\">{p} {}</pose>", three(degrees))
        }
        1 => {
            let q = quaternion(at.rpy).map(|x| format!("{x:?}")).join(" ");
            format!("<pose rotation_format=\"quat_xyzw\">{p} {q}</pose>")
        }
        2 => {
            let degrees = at.rpy.map(f64::to_degrees);
            let format = "rotation_format=\"euler_rpy\" degrees=\"1\"";
            format!("<pose {format}>{p} {}</pose>", three(degrees))
        }
        _ => format!("<pose>{p} {}</pose>", three(at.rpy)),
    }
}

/// Writes a robot. Loops have to be of letters as `xyzab`, at cut frames placed on both links.
pub fn written(of: &Description, seeded: &mut Seeded) -> Files {
    let mut urdf = String::from("<robot name=\"drawn\" version=\"1.1\">\n");
    let mut gazebo = String::new();
    let mut drops = None;
    for link in &of.links {
        let inertial = link.inertial.map_or(String::new(), |x| {
            let [xx, xy, xz, yy, yz, zz] = x.inertia;
            format!(
                "<inertial>{}<mass value=\"{:?}\"/><inertia ixx=\"{xx:?}\" ixy=\"{xy:?}\" \
                 ixz=\"{xz:?}\" iyy=\"{yy:?}\" iyz=\"{yz:?}\" izz=\"{zz:?}\"/></inertial>",
                format_args!(
                    "<origin xyz=\"{}\" rpy=\"{}\"/>",
                    three(x.origin.xyz),
                    three(x.origin.rpy)
                ),
                x.mass
            )
        });
        let _ = writeln!(urdf, "<link name=\"{}\">{inertial}</link>", link.name);
    }
    for joint in &of.joints {
        let name = &joint.name;
        let kind = match joint.kind {
            JointKind::Fixed => "fixed",
            JointKind::Prismatic => "prismatic",
            JointKind::Spherical => "spherical",
            JointKind::Floating => "floating",
            _ if joint.limits.is_none() && seeded.chance(0.5) => "continuous",
            _ => "revolute",
        };
        let mut inner = origin(seeded, &joint.origin);
        if !matches!(kind, "fixed" | "spherical" | "floating") {
            let _ = write!(inner, "<axis xyz=\"{}\"/>", three(joint.axis));
        }
        if matches!(kind, "prismatic" | "revolute") {
            let limit = joint.limits.map_or((-1e9, 1e9, 1e9, 1e9), |x| {
                let finite = |x: f64| x.clamp(-1e9, 1e9);
                (finite(x.lower), finite(x.upper), finite(x.velocity), finite(x.effort))
            });
            let _ = write!(
                inner,
                "<limit lower=\"{:?}\" upper=\"{:?}\" velocity=\"{:?}\" effort=\"{:?}\"/>",
                limit.0, limit.1, limit.2, limit.3
            );
        }
        let terms = &joint.terms;
        let spring_in_gazebo = terms.stiffness != 0.0 && seeded.chance(0.5);
        let mut dynamics = format!("damping=\"{:?}\"", terms.damping);
        if spring_in_gazebo {
            let parts = [
                format!("<springStiffness>{:?}</springStiffness>", terms.stiffness),
                format!("<springReference>{:?}</springReference>", terms.rest),
            ];
            if seeded.chance(0.5) {
                let _ = writeln!(
                    gazebo,
                    "<gazebo reference=\"{name}\">{}{}</gazebo>",
                    parts[0], parts[1]
                );
            } else {
                for part in parts {
                    let _ = writeln!(gazebo, "<gazebo reference=\"{name}\">{part}</gazebo>");
                }
            }
        } else if terms.stiffness != 0.0 {
            let _ = write!(
                dynamics,
                " spring_stiffness=\"{:?}\" spring_reference=\"{:?}\"",
                terms.stiffness, terms.rest
            );
        }
        if terms.rotor_inertia != 0.0 {
            if seeded.chance(0.5) {
                let _ = writeln!(
                    gazebo,
                    "<transmission name=\"{name}_t\"><joint name=\"{name}\"/><actuator \
                     name=\"{name}_m\"><rotor_inertia value=\"{:?}\"/>{}</actuator></transmission>",
                    terms.rotor_inertia,
                    if seeded.chance(0.5) {
                        format!("<gear_ratio value=\"{:?}\"/>", terms.gear_ratio)
                    } else {
                        format!("<mechanicalReduction>{:?}</mechanicalReduction>", terms.gear_ratio)
                    }
                );
            } else {
                let _ = write!(
                    dynamics,
                    " rotor_inertia=\"{:?}\" gear_ratio=\"{:?}\"",
                    terms.rotor_inertia, terms.gear_ratio
                );
            }
        }
        if kind != "fixed" && kind != "floating" {
            let _ = write!(inner, "<dynamics {dynamics}/>");
        }
        if let Some(coupling) = &joint.coupling {
            let (k, ratio) = coupling.terms.first().copied().unwrap_or_default();
            let master = &of.joints[k].name;
            let offset = coupling.offset;
            let n = coupling.terms.len() + 2 * coupling.curves.len();
            match (n, seeded.below(3)) {
                (1, 0) => {
                    let _ = write!(
                        inner,
                        "<mimic joint=\"{master}\" multiplier=\"{ratio:?}\" offset=\"{offset:?}\"/>"
                    );
                }
                (1, 1) => {
                    let _ = writeln!(
                        gazebo,
                        "<gazebo><plugin filename=\"libgazebo_mimic_joint.so\" \
                         name=\"{name}_plug\"><joint>{master}</joint><mimicJoint>{name}\
                         </mimicJoint><multiplier>{ratio:?}</multiplier><offset>{offset:?}</offset>\
                         </plugin></gazebo>"
                    );
                }
                _ => {
                    let mut inside = String::new();
                    for (n, (k, ratio)) in coupling.terms.iter().enumerate() {
                        let offset = if n == 0 { offset } else { 0.0 };
                        let _ = write!(
                            inside,
                            "<depends_on joint=\"{}\" multiplier=\"{ratio:?}\" \
                             offset=\"{offset:?}\"/>",
                            of.joints[*k].name
                        );
                    }
                    for (n, (of_joint, curve)) in coupling.curves.iter().enumerate() {
                        let is_first = n == 0 && coupling.terms.is_empty();
                        let offset = if is_first { offset } else { 0.0 };
                        let words =
                            |x: &[f64]| x.iter().map(|x| format!("{x:?} ")).collect::<String>();
                        let by = match curve {
                            Curve::Polynomial { about, coefficients } => {
                                format!(
                                    "polynomial=\"{}\" about=\"{about:?}\"",
                                    words(coefficients)
                                )
                            }
                            Curve::Table(points) => {
                                format!("table=\"{}\"", words(points.as_flattened()))
                            }
                        };
                        let _ = write!(
                            inside,
                            "<depends_on joint=\"{}\" {by} offset=\"{offset:?}\"/>",
                            of.joints[*of_joint].name
                        );
                    }
                    let _ = writeln!(
                        gazebo,
                        "<transmission name=\"{name}_c\"><joint name=\"{name}\">{inside}</joint>\
                         </transmission>"
                    );
                }
            }
        }
        let _ = writeln!(
            urdf,
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{}\"/><child link=\"{}\"/>\
             {inner}</joint>",
            of.links[joint.parent].name, of.links[joint.child].name
        );
    }

    let mut yaml = String::from("submechanisms:\n");
    for part in &of.submechanisms {
        let list = |of_part: &[usize]| {
            of_part.iter().map(|j| of.joints[*j].name.clone()).collect::<Vec<_>>().join(", ")
        };
        let type_name = match part.kind {
            Kind::Rrpr => "RRPR",
            Kind::FourBar => "FOURBAR",
            Kind::SliderCrank => "SLIDERCRANK",
            Kind::Transmission => "TRANSMISSION",
            Kind::Serial => "SERIAL",
            _ => "NUMERICAL",
        };
        let _ = writeln!(
            yaml,
            "- type: {type_name}\n  contextual_name: {}\n  jointnames_spanningtree: [{}]\n  \
             jointnames_independent: [{}]\n  jointnames_active: [{}]",
            part.name,
            list(&part.spanning_tree),
            list(&part.independent),
            list(&part.active)
        );
        let mut loops = String::new();
        for cut in &part.loops {
            let Cut::Placed { predecessor: on_p, successor: on_s } = &cut.cut else { continue };
            let [p, s] = [&of.links[cut.predecessor].name, &of.links[cut.successor].name];
            let letters: String = cut
                .rows
                .iter()
                .map(|row| {
                    let k = row.axis.iter().position(|x| *x != 0.0).unwrap_or(0);
                    if row.against.is_some() { 'u' } else { char::from(b"abcxyz"[k]) }
                })
                .collect();
            let name = &cut.name;
            let known = joint_type(&letters);
            let (cut_type, joint) = known.unwrap_or(("", ""));
            let universal = cut_type == "universal";
            let way = match (known.is_some(), universal) {
                (true, true) => 1 + seeded.below(5),
                // no joint of SDF
                (true, false) if cut_type == "cylindrical" => [0, 1, 3, 4, 5][seeded.below(5)],
                (true, false) => seeded.below(6),
                _ => 0,
            };
            let spun = matches!(cut_type, "revolute" | "cylindrical" | "prismatic" | "universal");
            let second = if universal { "<axis2 xyz=\"1 0 0\"/>" } else { "" };
            let axis = if spun { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
            let damps = way == 2 && seeded.chance(0.15);
            match way {
                2 => {
                    // the pose in the child, the axis in the joint
                    let axis = match (spun, universal) {
                        (true, true) => {
                            "<axis><xyz>0 0 1</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"
                        }
                        (true, false) => "<axis><xyz>0 0 1</xyz></axis>",
                        _ => "",
                    };
                    let dynamics = if damps && spun && !universal {
                        drops = Some("damping of a closing joint");
                        "<axis><xyz>0 0 1</xyz><dynamics><damping>0.5</damping></dynamics></axis>"
                    } else {
                        axis
                    };
                    let at = pose(seeded, on_s);
                    let _ = writeln!(
                        gazebo,
                        "<gazebo><joint name=\"{name}\" type=\"{joint}\"><parent>{p}</parent>\
                         <child>{s}</child>{at}{dynamics}</joint></gazebo>"
                    );
                }
                3 => {
                    let a = origin(seeded, on_p);
                    let b = origin(seeded, on_s);
                    let _ = writeln!(
                        gazebo,
                        "<loop name=\"{name}\" type=\"{joint}\"><predecessor link=\"{p}\">{a}\
                         </predecessor><successor link=\"{s}\">{b}</successor><axis \
                         xyz=\"{}\"/>{second}</loop>",
                        three(axis)
                    );
                }
                4 => {
                    let end = |at: &Placement, link: &str, k: usize| {
                        format!(
                            "<link{k} link=\"{link}\" xyz=\"{}\" rpy=\"{}\"/>",
                            three(at.xyz),
                            three(at.rpy)
                        )
                    };
                    let _ = writeln!(
                        gazebo,
                        "<loop_joint name=\"{name}\" type=\"{joint}\">{}{}<axis xyz=\"{}\"/>\
                         {second}</loop_joint>",
                        end(on_p, p, 1),
                        end(on_s, s, 2),
                        three(axis)
                    );
                }
                5 => {
                    let end = |at: &Placement, what: &str, link: &str| {
                        let along =
                            if universal && what == "child" { [1.0, 0.0, 0.0] } else { axis };
                        format!(
                            "<{what} link=\"{link}\"/><{what}_origin xyz=\"{}\" rpy=\"{}\"/>\
                             <{what}_axis xyz=\"{}\"/>",
                            three(at.xyz),
                            three(at.rpy),
                            three(along)
                        )
                    };
                    let _ = writeln!(
                        gazebo,
                        "<constraint name=\"{name}\" type=\"{joint}\">{}{}</constraint>",
                        end(on_p, "parent", p),
                        end(on_s, "child", s)
                    );
                }
                _ => {
                    let list = |x: [f64; 3]| x.map(|x| format!("{x:?}")).join(", ");
                    let at = |of: &Placement| {
                        format!("{{xyz: [{}], rpy: [{}]}}", list(of.xyz), list(of.rpy))
                    };
                    let _ = writeln!(
                        loops,
                        "  - cut_joint: {name}\n    predecessor_body: {p}\n    successor_body: \
                         {s}\n    predecessor_placement: {}\n    successor_placement: {}",
                        at(on_p),
                        at(on_s)
                    );
                    if way == 1 {
                        let _ = writeln!(loops, "    cut_joint_type: {cut_type}");
                        if spun {
                            let _ = writeln!(loops, "    axis: [{}]", list(axis));
                        }
                        if universal {
                            loops += "    axis2: [1.0, 0.0, 0.0]\n";
                        }
                    } else {
                        let _ = writeln!(loops, "    constraint_axes:");
                        for row in &cut.rows {
                            let _ = writeln!(
                                loops,
                                "    - {{name: {}, axis: [{}]}}",
                                row.name,
                                six(row.axis)
                            );
                        }
                    }
                }
            }
        }
        if !loops.is_empty() {
            yaml += "  loop_constraints:\n";
            yaml += &loops;
        }
    }
    let _ = writeln!(urdf, "{gazebo}</robot>");
    Files { urdf, yaml, drops }
}
