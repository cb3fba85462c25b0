//! Masses and lengths in other units.

use super::*;

/// The lambda with each mass, inertia and length times a factor.
fn scaled(mass: f64, inertia: f64, length: f64) -> String {
    let mut urdf = String::new();
    for line in URDF.lines() {
        let factor = |name: &str| match name {
            "value" => mass,
            "ixx" | "ixy" | "ixz" | "iyy" | "iyz" | "izz" => inertia,
            _ => length,
        };
        let mut line = line.to_owned();
        for name in ["value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "xyz"] {
            let is_axis = line.contains("<axis");
            let Some(start) = line.find(&format!("{name}=\"")).filter(|_| !is_axis) else {
                continue;
            };
            let start = start + name.len() + 2;
            let end = start + line[start..].find('"').unwrap();
            let numbers = line[start..end].split(' ').map(|x| x.parse::<f64>().unwrap());
            let numbers: Vec<String> = numbers.map(|x| (x * factor(name)).to_string()).collect();
            line.replace_range(start..end, &numbers.join(" "));
        }
        urdf += &(line + "\n");
    }
    urdf
}

#[test]
fn masses_in_grams_are_a_warning() {
    for inertia in [1.0, 1e3] {
        let reported = reported(&scaled(1e3, inertia, 1.0), YAML);
        assert_eq!(reported.matches("expected masses in kilograms").count(), 1, "{reported}");
        assert!(!reported.contains("lengths"), "{reported}");
    }
}

#[test]
fn lengths_in_millimetres_are_a_warning() {
    for inertia in [1.0, 1e6] {
        let reported = reported(&scaled(1.0, inertia, 1e3), YAML);
        assert_eq!(reported.matches("expected lengths in metres").count(), 1, "{reported}");
        assert!(!reported.contains("kilograms"), "{reported}");
    }
}

/// Steel scales with the cube: from millimetres to an excavator.
#[test]
fn machines_of_steel_of_any_size_pass() {
    for size in [1e-3_f64, 1e-2, 0.1, 1.0, 5.0, 20.0] {
        let cube = size.powi(3);
        let reported = reported(&scaled(cube * 20.0, cube * 20.0 * size * size, size), YAML);
        assert!(
            !reported.contains("kilograms") && !reported.contains("metres"),
            "{size}: {reported}"
        );
    }
}
