//! Names with `*`, `?` and `[…]`, as shells write them.

use glob::Pattern;
use sarrus_dynamics::ModelInfo;

/// True for names with wildcards.
pub(crate) fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?', '['])
}

/// True if a name matches a pattern or equals it: a name may contain `*`, `?` and `[` itself.
pub(crate) fn fits(pattern: &str, name: &str) -> bool {
    if name == pattern || !is_pattern(pattern) {
        return name == pattern;
    }
    // `**` stands for folders in the crate and for letters in a shell, which also reads ^ as !
    let mut pattern = pattern.replace("[^", "[!");
    while pattern.contains("**") {
        pattern = pattern.replace("**", "*");
    }
    Pattern::new(&pattern).is_ok_and(|pattern| pattern.matches(name))
}

/// The tree velocities of the joints whose names match a pattern as shells write them (`AL*`), in
/// the order of the model; empty if none does. A joint of several degrees of freedom is matched by
/// its own name.
pub fn matching_joints(model: &ModelInfo, pattern: &str) -> Vec<u16> {
    // the name itself comes first
    let is_name = model.joints().any(|joint| joint.name == pattern);
    let is_match = |name: &str| if is_name { name == pattern } else { fits(pattern, name) };
    let joints = model.joints().filter(|joint| is_match(joint.name));
    joints.flat_map(|joint| joint.v).filter_map(|v| u16::try_from(v).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_is_any_letters_and_a_question_mark_is_one() {
        assert!(fits("AL*", "ALElbow") && fits("*Elbow", "ALElbow") && fits("*", ""));
        assert!(fits("A?Elbow", "ARElbow") && fits("A*l*w", "ALElbow"));
        assert!(fits("AL**", "ALElbow") && fits("A[^R]*", "ALElbow") && !fits("A[^R]*", "ARElbow"));
        assert!(!fits("AL*", "BALElbow") && !fits("A?Elbow", "AElbow") && !fits("AL", "ALElbow"));
    }

    #[test]
    fn joints_are_matched_as_shells_match_files() {
        let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        let model = ModelInfo {
            tree: names(&["base/rx", "base/ry", "base/rz", "ALElbow", "ARElbow", "odd[1]"]),
            tree_q: names(&[
                "base/qx", "base/qy", "base/qz", "base/qw", "ALElbow", "ARElbow", "odd[1]",
            ]),
            ..ModelInfo::default()
        };
        for (pattern, velocities) in [
            ("base", &[0, 1, 2][..]),
            ("A?Elbow", &[3, 4]),
            ("AL*", &[3]),
            ("*", &[0, 1, 2, 3, 4, 5]),
            ("odd[1]", &[5]),
            ("base/rx", &[]),
            ("A[", &[]),
            ("", &[]),
        ] {
            assert_eq!(matching_joints(&model, pattern), velocities, "{pattern}");
        }
    }
}
