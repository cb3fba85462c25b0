//! Section `extremes`: stiff and extreme cases. What held, what degraded and said so, what failed
//! and said so; nothing may fail silently.

mod families;
mod figures;
mod harness;
mod mechanisms;

use self::families::{
    chains, far, implicit, loops, mass, scale, simulated, singular, starts, terms,
};
use self::harness::case::Cases;
use crate::Outcome;
use crate::measure::Effort;
use crate::measure::progress::Progress;
use crate::page::Section;

/// Families in the order of the page, by what they sweep.
const FAMILIES: [(&str, fn(&mut Cases, &Effort) -> Outcome); 24] = [
    ("mass ratios", mass::ratios),
    ("massless links", mass::massless),
    ("lengths and masses", scale::sizes),
    ("velocities", scale::velocities),
    ("wrenches", scale::wrenches),
    ("gravity", scale::gravity),
    ("chains", chains::run),
    ("singular poses", singular::distances),
    ("targets out of reach", singular::beyond),
    ("big jumps", singular::jumps),
    ("many turns", far::run),
    ("inconsistent starts", starts::inconsistent),
    ("quaternions", starts::quaternions),
    ("what is no number", starts::hostile),
    ("faulty files", starts::files),
    ("redundant rows", loops::redundant),
    ("loops in one subtree", loops::subtree),
    ("terms of joints", terms::run),
    ("stiff simulations", simulated::stiff),
    ("steps and tolerances", simulated::steps),
    ("nothing lost", simulated::conserved),
    ("starts of simulations", simulated::starts),
    ("projection", implicit::projection),
    ("stabilisation", implicit::baumgarte),
];

/// Powers of ten from 10^from to 10^to: every one, or with little effort this many steps.
fn sweep(effort: &Effort, from: i32, to: i32, steps: i32) -> Vec<f64> {
    let steps = if effort.quick { steps } else { to - from };
    (0..=steps).map(|k| 10f64.powi(from + (to - from) * k / steps)).collect()
}

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
