//! The result of an assembly, and the ways to use it.

use sarrus_dynamics::description::Placement;
use sarrus_models::{AssemblyReport, Moved};

use crate::commands::output::table;

/// The pose, and for files with loops open at zero the numbers that close them.
pub(super) fn in_words(report: &AssemblyReport) -> String {
    let mut text = match &report.error {
        None => format!(
            "assembled: residual {:.1e} before, {:.1e} after, distance {:.6}, {} steps\n",
            report.residual_before, report.residual, report.distance, report.iterations
        ),
        Some(error) => format!("not assembled: {error}\n"),
    };
    let row = |moved: &Moved| {
        let Moved { name, given, found } = moved;
        vec![name.clone(), given.to_string(), found.to_string(), format!("{:+.3e}", found - given)]
    };
    let rows: Vec<Vec<String>> = report.q.iter().map(row).collect();
    text += &table("joint | given | found | moved", &rows);
    if report.error.is_some() {
        return text;
    }
    if !report.written.is_empty() {
        return text
            + &format!("written with this pose as zero pose: {}\n", report.written.join(", "));
    }
    if report.new_zero.is_empty() {
        return text + "use it as q_guess of a request, or as q\n";
    }

    // both changes close the loops at the zero pose
    text += "\nto make it the zero pose, write these origins into the URDF and take off what each \
        joint moved from its limits and its spring's rest (--write OUT.urdf does it)\n";
    let list = |x: [f64; 3], between: &str| x.map(|x| x.to_string()).join(between);
    for (joint, origin) in &report.new_zero.origins {
        text += &format!(
            "  {joint}: <origin xyz=\"{}\" rpy=\"{}\"/>\n",
            list(origin.xyz, " "),
            list(origin.rpy, " ")
        );
    }
    let yaml = |key: &str, placements: &[(String, Placement)]| {
        let line = |(name, at): &(String, Placement)| {
            format!(
                "  {name}: {key}: {{xyz: [{}], rpy: [{}]}}\n",
                list(at.xyz, ", "),
                list(at.rpy, ", ")
            )
        };
        placements.iter().map(line).collect::<String>()
    };
    if !report.new_zero.predecessors.is_empty() {
        text += "and these placements into the submechanism file\n";
        text += &yaml("predecessor_placement", &report.new_zero.predecessors);
        text += &yaml("successor_placement", &report.new_zero.successors);
    }
    if report.at_zero.is_empty() {
        return text;
    }
    text += "or, where the joints are right and the placements are not, write placements that \
        coincide at the zero pose as it is\n";
    text + &yaml("successor_placement", &report.at_zero.successors)
}
