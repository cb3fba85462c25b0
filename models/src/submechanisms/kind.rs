//! The types of submechanisms: their names and numbers of joints.

use sarrus_dynamics::description::{JointKind, SubmechanismKind as Kind};

/// A known type.
pub(crate) struct Known {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    /// Numbers of spanning-tree joints that the type can have; empty for any.
    pub(crate) tree: &'static [usize],
    /// Number of independent joints, if the type fixes it.
    pub(crate) independent: Option<usize>,
}

const fn known(
    name: &'static str,
    kind: Kind,
    tree: &'static [usize],
    independent: Option<usize>,
) -> Known {
    Known { name, kind, tree, independent }
}

/// Every type but the letter runs of serial ones. A universal joint counts two, a spherical one
/// none: it is cut.
pub(crate) const KNOWN: [Known; 15] = [
    known("SERIAL", Kind::Serial, &[], None),
    known("RRPR", Kind::Rrpr, &[3], Some(1)),
    known("rrPr", Kind::Rrpr, &[3], Some(1)),
    known("2SPU+1U", Kind::Spu2U1, &[8], Some(2)),
    // with and without the revolutes on the side of the foot
    known("2SPRR+1U", Kind::Sprr2U1, &[8, 10], Some(2)),
    // with and without the universal joints of the rods' far ends
    known("2SURRPR+1U", Kind::Surrpr2U1, &[12, 16], Some(2)),
    known("6UPS", Kind::Ups6, &[24], Some(6)),
    known("3RUS2", Kind::Rus3x2, &[18, 21], Some(3)),
    known("3RUS2_ANKLE", Kind::Rus3x2, &[18, 21], Some(3)),
    known("PARALLELOGRAMCHAIN", Kind::ParallelogramChain, &[], None),
    known("FOURBAR", Kind::FourBar, &[3], Some(1)),
    known("SLIDERCRANK", Kind::SliderCrank, &[3], Some(1)),
    // with and without the spider
    known("DIFFERENTIAL", Kind::Differential, &[3, 4], Some(2)),
    known("TRANSMISSION", Kind::Transmission, &[], None),
    known("NUMERICAL", Kind::Numerical, &[], None),
];

/// Number of freedoms of a joint; 1 for an unknown joint.
pub(crate) fn freedoms(kind: Option<JointKind>) -> usize {
    match kind {
        Some(JointKind::Spherical) => 3,
        Some(JointKind::Floating) => 6,
        _ => 1,
    }
}

/// Number of joints of each sort in a letter run such as `3T+3R` or `RRP`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Letters {
    /// `R`.
    pub(crate) rotations: usize,
    /// `T` or `P`.
    pub(crate) translations: usize,
}

/// Reads a sum of groups, each a number and one letter, or letters alone.
pub(crate) fn letters(written: &str) -> Option<Letters> {
    let mut sum = Letters::default();
    for group in written.split('+') {
        let digits = group.len() - group.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (number, run) = group.split_at(digits);
        let times: usize = match number {
            "" => 1,
            _ if run.len() != 1 => return None,
            _ => number.parse().ok().filter(|times| (1..=1000).contains(times))?,
        };
        if run.is_empty() {
            return None;
        }
        for letter in run.chars() {
            match letter {
                'R' => sum.rotations += times,
                'T' | 'P' => sum.translations += times,
                _ => return None,
            }
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_types_in_the_readme_is_true() {
        let readme = include_str!("../../README.md");
        let rows: Vec<Vec<&str>> = readme
            .lines()
            .skip_while(|line| !line.starts_with("| type | joints |"))
            .take_while(|line| line.starts_with('|'))
            .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
            .collect();
        let any = |text: String| if text.is_empty() { "any".to_owned() } else { text };
        for known in KNOWN.iter().filter(|known| known.kind != Kind::Serial) {
            let name = format!("`{}`", known.name);
            let row = rows.iter().find(|row| row[0].split(", ").any(|of| of == name)).unwrap();
            let joints = known.tree.iter().map(usize::to_string).collect::<Vec<_>>().join(" or ");
            let independent = known.independent.map(|count| count.to_string()).unwrap_or_default();
            assert_eq!([row[1], row[3]], [any(joints), any(independent)], "{name}");
        }
        assert_eq!(rows.len(), 2 + 12);
    }

    #[test]
    fn letter_runs_are_sums_of_groups() {
        let sum = |written| letters(written).map(|sum| (sum.rotations, sum.translations));
        assert_eq!(sum("R"), Some((1, 0)));
        assert_eq!(sum("RR"), Some((2, 0)));
        assert_eq!(sum("3R"), Some((3, 0)));
        assert_eq!(sum("3T+3R"), Some((3, 3)));
        assert_eq!(sum("RPT+2P"), Some((1, 4)));
        for wrong in
            ["", "3", "3RR", "R+", "+R", "0R", "r", "2SPU+1U", "99999999999999999999R", "R R"]
        {
            assert_eq!(sum(wrong), None, "{wrong}");
        }
    }
}
