//! Stiff and extreme cases: what held, what degraded and said so, what failed and said so. Nothing may fail silently.

mod ask;
mod case;
mod chains;
mod far;
mod judge;
mod loops;
mod mass;
mod mechanisms;
mod robot;
mod scale;
mod singular;
mod starts;
mod terms;

pub use case::Case;
pub use judge::Verdict;

use case::Cases;

use crate::Outcome;
/// TEMP
pub(crate) struct Effort {
    pub(crate) quick: bool,
}

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

pub(crate) fn all(effort: &Effort) -> Outcome<Vec<Case>> {
    let mut cases = Cases::default();
    for family in FAMILIES {
        let start = (std::time::Instant::now(), cases.all.len());
        family(&mut cases, effort)?;
        eprintln!("{:?} {} cases", start.0.elapsed(), cases.all.len() - start.1);
    }
    Ok(cases.all)
}

pub(crate) fn temp(quick: bool) -> Outcome {
    let cases = all(&Effort { quick })?;
    for c in &cases {
        println!("{}\t{}\t{:e}\t{}\t{}\t{}\t{}\t{:?}\t{:?}\t{}\t{}", c.family, c.mechanism, c.value, c.method, c.asked, c.status, c.warnings.join(","), c.error, c.backward, c.verdict.name(), c.told);
    }
    for v in Verdict::ALL {
        eprintln!("{} {}", v.name(), cases.iter().filter(|c| c.verdict == v).count());
    }
    Ok(())
}
