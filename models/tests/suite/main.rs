//! Robot files, good and bad.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

/// One test for each kind of fault: a text of the good file, its replacement, and every line of
/// the report.
macro_rules! faults {
    (@file urdf $from:literal $to:literal) => { reported(&with(URDF, $from, $to), YAML) };
    (@file yaml $from:literal $to:literal) => { reported(URDF, &with(YAML, $from, $to)) };
    ($file:ident: $($name:ident: $from:literal => $to:literal, $($line:literal),+;)*) => {
        $(#[test]
        fn $name() {
            assert_eq!(faults!(@file $file $from $to).lines().collect::<Vec<_>>(), [$($line),+]);
        })*
    };
}

mod as_published;
mod compounds;
mod curves;
mod cuts;
mod dialects;
mod dimensions;
mod export;
mod fingerprints;
mod gazebo;
mod gepetto;
mod hostile;
mod loops;
mod mjcf;
mod other_faults;
mod reading;
mod rewrite;
mod sdf;
mod suggest;
mod terms;
mod units;
mod urdf_faults;
mod yaml_faults;

use sarrus_models::{LoadError, Options, Source, load};

/// A lambda: rocker, stator, slider.
const URDF: &str = include_str!("lambda.urdf");
const YAML: &str = include_str!("lambda.yml");

/// `text` with its one `from` replaced.
fn with(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from}");
    text.replace(from, to)
}

fn reported(urdf: &str, yaml: &str) -> String {
    reported_of(urdf.as_bytes(), Some(yaml.as_bytes()), false)
}

/// Everything that is reported about a robot, a line each; nothing about a good one.
fn reported_of(urdf: &[u8], yaml: Option<&[u8]>, lenient: bool) -> String {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    match load(&source, &Options { lenient, ..Options::default() }) {
        Ok(loaded) => {
            assert!(loaded.report.errors.is_empty());
            loaded.report.to_string()
        }
        Err(LoadError::Faults(report)) => {
            assert!(!report.errors.is_empty());
            report.to_string()
        }
        Err(other) => panic!("{other}"),
    }
}
