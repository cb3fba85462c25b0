//! Section `extremes`: stiff and extreme cases. What held, what degraded and said so, what failed and said so; nothing may fail silently.

mod ask;
mod case;
mod chains;
mod far;
mod judge;
mod loops;
mod mass;
mod mechanisms;
mod page;
mod robot;
mod scale;
mod singular;
mod starts;
mod terms;

use self::case::{Case, Cases};
use crate::Outcome;
use crate::progress::Progress;
use crate::report::{Effort, Section};

/// Families in the order of the page.
const FAMILIES: &[fn(&mut Cases, &Effort) -> Outcome] = &[
    mass::ratios,
    mass::massless,
    scale::sizes,
    scale::velocities,
    scale::wrenches,
    scale::gravity,
    chains::run,
    singular::distances,
    singular::beyond,
    singular::jumps,
    far::run,
    starts::inconsistent,
    starts::quaternions,
    starts::hostile,
    starts::files,
    loops::redundant,
    loops::subtree,
    terms::run,
];

/// Powers of ten from 10^from to 10^to: every one, or with little effort this many steps.
fn sweep(effort: &Effort, from: i32, to: i32, steps: i32) -> Vec<f64> {
    let steps = if effort.quick { steps } else { to - from };
    (0..=steps).map(|k| 10f64.powi(from + (to - from) * k / steps)).collect()
}

/// Every case.
fn all(effort: &Effort, progress: &Progress) -> Outcome<Vec<Case>> {
    let mut cases = Cases::default();
    for (k, family) in FAMILIES.iter().enumerate() {
        progress.show("extreme cases", k as f64 / FAMILIES.len() as f64);
        let start = (std::time::Instant::now(), cases.all.len());
        family(&mut cases, effort)?;
        eprintln!("{:?} {} cases", start.0.elapsed(), cases.all.len() - start.1);
    }
    Ok(cases.all)
}

/// Fills the section.
pub(crate) fn run(effort: &Effort, progress: &Progress) -> Outcome<Section> {
    Ok(page::section(&all(effort, progress)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Verdict;

    #[test]
    fn dump() {
        let cases = all(&Effort { quick: std::env::var("FULL").is_err() }, &Progress::silent()).unwrap();
        for c in &cases {
            println!(
                "{}\t{}\t{:e}\t{}\t{}\t{}\t{}\t{:.1e}\t{:.1e}\t{}\t{}",
                c.family,
                c.mechanism,
                c.value,
                c.method,
                c.asked,
                c.status,
                c.warnings.join(","),
                c.error.unwrap_or(f64::NAN),
                c.backward.unwrap_or(f64::NAN),
                c.verdict.name(),
                c.told
            );
        }
        for v in Verdict::ALL {
            eprintln!("{} {}", v.name(), cases.iter().filter(|c| c.verdict == v).count());
        }
    }
}
