//! Dimensions that `check` derives from the files.

use sarrus_models::{CheckReport, Dimensions};

use super::dialects::{DIALECTS, MOTOR, four_bar};
use super::suggest::slider_crank;
use super::*;

fn checked(urdf: &str, yaml: Option<&str>) -> CheckReport {
    let source = Source::Text { urdf: urdf.into(), submechanisms: yaml.map(Into::into) };
    let report = CheckReport::new(&load(&source, &Options::default())).unwrap();
    assert_eq!(report.errors, []);
    report
}

fn lengths(dimensions: &Dimensions) -> Vec<String> {
    let of = dimensions.lengths.iter();
    of.map(|of| format!("{} {} {} {:.4}", of.link, of.from, of.to, of.length)).collect()
}

#[test]
fn the_lengths_of_a_loop_lie_between_its_joints_and_the_cut() {
    let (urdf, yaml) = slider_crank("SLIDERCRANK");
    let dimensions = checked(&urdf, Some(&yaml)).dimensions.unwrap();
    let expected = [
        "rod drive_joint rod_joint 0.3162",
        "crank rod_joint crank_joint 0.1000",
        "base crank_joint drive_joint 0.3000",
    ];
    assert_eq!(lengths(&dimensions), expected);
    // five centimetres of the slider's origin leave the file valid and are seen here
    let moved = urdf.replace("xyz=\"0.3 0 0\"", "xyz=\"0.35 0.02 0\"");
    let dimensions = checked(&moved, Some(&yaml)).dimensions.unwrap();
    // in the plane of the loop: the offset along the hinges is no length
    assert_eq!(lengths(&dimensions)[0], "rod drive_joint rod_joint 0.3640");
    let loops = checked(&four_bar(&format!("{}{MOTOR}", DIALECTS[1].1)), None);
    let expected = [
        "coupler pin coupler_joint 1.0000",
        "crank coupler_joint crank_joint 1.0000",
        "base crank_joint rocker_joint 1.2000",
        "rocker rocker_joint pin 1.0198",
    ];
    assert_eq!(lengths(&loops.dimensions.unwrap()), expected);
}

#[test]
fn limits_beyond_the_range_in_which_the_loops_close_are_a_warning() {
    let limited = |lower: f64| {
        let limit = format!("<limit lower=\"{lower}\" upper=\"1\" effort=\"1\" velocity=\"1\"/>");
        let urdf = four_bar(&format!("{}{MOTOR}", DIALECTS[1].1));
        let crank = "name=\"crank_joint\" type=\"continuous\">";
        urdf.replace(crank, &format!("name=\"crank_joint\" type=\"revolute\">{limit}"))
    };
    // coupler and rocker in one line
    let far = 1.0 + 1.04_f64.sqrt();
    let expected = ((2.44 - far * far) / 2.4).asin();
    for (lower, warns) in [(-0.7, false), (-0.9, true)] {
        let report = checked(&limited(lower), None);
        let [range] = &report.dimensions.as_ref().unwrap().ranges[..] else { panic!() };
        assert_eq!((range.lower, range.upper, range.closes_to), (Some(lower), Some(1.0), None));
        assert!((range.closes_from.unwrap() - expected).abs() < 1e-6, "{range:?}");
        let warned = report.warnings.iter().find(|of| of.found.contains("the loops of"));
        assert_eq!(warned.is_some(), warns, "{lower}: {:?}", report.warnings);
        assert!(warned.is_none_or(|of| of.found.contains("`crank_joint` close from -0.7521 on")));
        assert!(
            warned.is_none_or(|of| (of.file.as_str(), of.line) == ("robot.urdf", 4)),
            "{warned:?}"
        );
    }
}

#[test]
fn a_link_that_is_denser_than_any_metal_is_a_warning() {
    let (urdf, yaml) = slider_crank("SLIDERCRANK");
    let report = checked(&urdf, Some(&yaml));
    assert_eq!(report.warnings, []);
    let of = &report.dimensions.unwrap().densities;
    let drive = of.iter().find(|of| of.link == "drive").unwrap();
    // a ball of r² = 2/5 R² = 1e-3 / 1.2
    let radius = (2.5 * 1e-3 / 1.2_f64).sqrt();
    let expected = 1.2 / (4.0 / 3.0 * std::f64::consts::PI * radius.powi(3));
    assert!((drive.density / expected - 1.0).abs() < 1e-12, "{drive:?}");
    let heavy = urdf.replace("<mass value=\"1.2\"/>", "<mass value=\"20000\"/>");
    let report = checked(&heavy, Some(&yaml));
    let [warning] = &report.warnings[..] else { panic!("{:?}", report.warnings) };
    assert!(warning.found.contains("link `drive` is denser than"), "{warning}");
}
