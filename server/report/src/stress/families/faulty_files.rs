//! Files of robots with a fault each.

use sarrus_dynamics::Status;
use sarrus_models::{Options, Source, bundled_text, load};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{At, Case, Cases};

/// Bundled files with one faulty number, joint or link each: refused, with the position.
pub(crate) fn run(cases: &mut Cases, _: &Effort) -> Outcome {
    let (urdf, yaml) = bundled_text("lambda").ok_or("no lambda")?;
    let faults: [(&str, &str, &str); 15] = [
        ("mass NaN", "<mass value=\"1.2\"/>", "<mass value=\"NaN\"/>"),
        ("mass infinite", "<mass value=\"1.2\"/>", "<mass value=\"inf\"/>"),
        ("mass negative", "<mass value=\"1.2\"/>", "<mass value=\"-1.2\"/>"),
        ("mass beyond double", "<mass value=\"1.2\"/>", "<mass value=\"1e999\"/>"),
        ("inertia NaN", "ixx=\"0.014\"", "ixx=\"nan\""),
        ("inertia negative", "ixx=\"0.014\"", "ixx=\"-0.014\""),
        ("inertia of no body", "ixx=\"0.014\"", "ixx=\"14\""),
        ("inertia without mass", "<mass value=\"1.2\"/>", "<mass value=\"0\"/>"),
        ("origin NaN", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 nan 0.0\""),
        ("origin infinite", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 1e400 0.0\""),
        ("axis zero", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 0 0\"/>"),
        ("axis NaN", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 nan 0\"/>"),
        ("axis of a loop zero", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, 0, 0]"),
        ("axis of a loop NaN", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, .nan, 0]"),
        ("axis of a loop along no freedom", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 1, 0, 0]"),
    ];
    for (k, (name, from, to)) in faults.into_iter().enumerate() {
        let replaced = |text: &str| text.replacen(from, to, 1);
        let source = Source::Text {
            urdf: replaced(urdf).into(),
            submechanisms: Some(replaced(yaml).into()),
        };
        let at = At { value: k as f64, method: "file" };
        match load(&source, &Options::default()) {
            Err(error) => {
                let reported = error.to_string().lines().next().unwrap_or_default().to_owned();
                cases.refused("lambda", at, name, "refused at load", reported);
            }
            Ok(loaded) => {
                let case = Case {
                    status: Status::Ok.name().into(),
                    reported: format!("{} warnings", loaded.report.warnings.len()),
                    ..cases.blank("lambda", at, name)
                };
                cases.all.push(case);
            }
        }
    }
    Ok(())
}
