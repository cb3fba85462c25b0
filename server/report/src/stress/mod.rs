//! Section `extremes`: stress cases. What held, what degraded and said so, what failed and said so;
//! nothing may fail silently.
//!
//! `harness/` asks, compares and assesses; `mechanisms/` are the robots; a file of `families/` is
//! one family of cases, swept over a parameter; `figures.rs` draws them.

mod families;
mod figures;
mod harness;
mod mechanisms;

use self::harness::case::Cases;
use crate::Outcome;
use crate::measure::Effort;
use crate::measure::progress::Progress;
use crate::page::Section;

/// Families in the order of the page, by what they sweep.
const FAMILIES: [(&str, fn(&mut Cases, &Effort) -> Outcome); 25] = [
    ("mass ratios", families::mass_ratios::run),
    ("massless links", families::massless_links::run),
    ("lengths and masses", families::sizes::run),
    ("velocities", families::velocities::run),
    ("wrenches", families::wrenches::run),
    ("gravity", families::gravity::run),
    ("chains", families::chains::run),
    ("singular poses", families::singular_poses::run),
    ("targets out of reach", families::unreachable_targets::run),
    ("big jumps", families::big_jumps::run),
    ("many turns", families::many_turns::run),
    ("inconsistent starts", families::inconsistent_starts::run),
    ("quaternions", families::quaternions::run),
    ("what is no number", families::invalid_numbers::run),
    ("faulty files", families::faulty_files::run),
    ("redundant rows", families::redundant_rows::run),
    ("idle freedoms", families::idle_freedoms::run),
    ("loops in one subtree", families::loops_in_one_subtree::run),
    ("terms of joints", families::joint_terms::run),
    ("stiff simulations", families::stiff_simulations::run),
    ("steps and tolerances", families::steps_and_tolerances::run),
    ("conservation", families::conservation::run),
    ("starts of simulations", families::simulation_starts::run),
    ("projection", families::projection::run),
    ("stabilisation", families::stabilisation::run),
];

/// Fills the section.
pub(crate) fn run(effort: &Effort, progress: &Progress) -> Outcome<Section> {
    let mut cases = Cases::default();
    for (k, (name, family)) in FAMILIES.iter().enumerate() {
        progress.show(name, k as f64 / FAMILIES.len() as f64);
        family(&mut cases, effort)?;
    }
    Ok(figures::section(&cases.all))
}

#[cfg(test)]
mod tests {
    use super::harness::case::Case;
    use super::*;
    use crate::page::Assessment;

    /// The rule for every family. What fails silently is printed as it can be asked again.
    fn check(effort: &Effort) {
        let mut cases = Cases::default();
        for (name, family) in FAMILIES {
            let (start, before) = (std::time::Instant::now(), cases.all.len());
            family(&mut cases, effort).unwrap_or_else(|error| panic!("{name}: {error}"));
            println!(
                "{name}: {} cases in {} ms",
                cases.all.len() - before,
                start.elapsed().as_millis()
            );
        }
        let silent: Vec<&Case> =
            cases.all.iter().filter(|case| case.assessment == Assessment::FailedSilently).collect();
        assert!(
            silent.is_empty(),
            "{} of {} failed silently: {silent:#?}",
            silent.len(),
            cases.all.len()
        );
        // every assessment but the last is met, so that the rule can tell them apart
        for assessment in [Assessment::Held, Assessment::Degraded, Assessment::Failed] {
            assert!(
                cases.all.iter().any(|case| case.assessment == assessment),
                "no case {}",
                assessment.name()
            );
        }
        assert!(cases.all.len() >= 200);
    }

    #[test]
    fn nothing_fails_silently() {
        check(&Effort { quick: true });
    }

    /// For a minute.
    #[test]
    #[ignore = "takes a minute"]
    fn nothing_fails_silently_with_all_effort() {
        check(&Effort { quick: false });
    }
}
