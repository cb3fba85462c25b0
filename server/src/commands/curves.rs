//! Curves of a motion over time, one chart for each unit, and the command that made them.

use sarrus_dynamics::JointLimits;
use sarrus_dynamics::description::JointKind;
use sarrus_models::Loaded;
use sarrus_show::{Chart, Curve};

/// The limits of a curve from those of its joint.
type Limit = fn(JointLimits) -> [Option<f64>; 2];

/// Charts of y, ẏ, u and τ_u with their limits; rows that are missing have no chart.
pub(super) fn charts(loaded: &Loaded, [y, yd, u, tau_u]: [Vec<Vec<f64>>; 4]) -> Vec<Chart> {
    let info = loaded.compiled.model.info();
    let slides = |name: &str| {
        let joint = name.split('/').next();
        let of = |joint: &&sarrus_dynamics::description::Joint| joint.kind == JointKind::Prismatic;
        let part = name.split_once('/').map_or("", |(_, part)| part);
        let found = loaded.description.joints.iter().find(|of| Some(of.name.as_str()) == joint);
        found.as_ref().is_some_and(of) || part.starts_with(['t', 'x', 'y', 'z'])
    };
    let mut charts = Vec::new();
    let mut add =
        |symbol: &str, units: [&str; 2], names: &[String], rows: &[Vec<f64>], of: Limit| {
            for (unit, is_slide) in units.into_iter().zip([false, true]) {
                let curve = |(k, name): (usize, &String)| {
                    let values = rows.iter().map(|row| row.get(k).copied().unwrap_or(f64::NAN));
                    let limits = info.limits_of(name).map_or([None; 2], of);
                    Curve { name: name.clone(), values: values.collect(), limits }
                };
                let names = names.iter().enumerate().filter(|(_, name)| slides(name) == is_slide);
                let curves: Vec<Curve> = names.map(curve).collect();
                if !curves.is_empty() && !rows.is_empty() {
                    charts.push(Chart { title: format!("{symbol}, {unit}"), log: false, curves });
                }
            }
        };
    add("y", ["rad", "m"], &info.independent_q, &y, |x| [x.lower, x.upper]);
    add("ẏ", ["rad/s", "m/s"], &info.independent, &yd, |x| {
        [x.velocity.map(|most| -most), x.velocity]
    });
    if info.active != info.independent {
        add("u", ["rad", "m"], &info.active, &u, |x| [x.lower, x.upper]);
    }
    add("τ_u of this motion", ["N m", "N"], &info.active, &tau_u, |x| {
        [x.effort.map(|most| -most), x.effort]
    });
    charts
}

/// The command of this process as a shell takes it.
pub(super) fn command_line() -> String {
    let quoted = |word: String| {
        let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:".contains(c);
        if word.chars().all(is_plain) { word } else { format!("'{word}'") }
    };
    format!("sarrus {}", std::env::args().skip(1).map(quoted).collect::<Vec<_>>().join(" "))
}
