//! Section `extremes`: stress cases. What held, what degraded and said so, what failed and said so;
//! nothing may fail silently.
//!
//! `harness/` asks, compares and assesses; `mechanisms/` are the robots; a file of `families/` is
//! one family of cases, swept over a parameter; `figures.rs` draws them.

mod false_alarms;
mod families;
mod figures;
mod harness;
mod mechanisms;

use self::harness::case::Cases;
use crate::Outcome;
use crate::measure::Effort;
use crate::measure::progress::Progress;
use crate::page::{Assessment, Section};

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

/// Families whose silent failures are counted.
const COUNTED: [(&str, fn(&mut Cases, &Effort) -> Outcome); 6] = [
    ("dead points in series", families::dead_points_in_series::run),
    ("light behind heavy", families::light_behind_heavy::run),
    ("change points", families::change_points::run),
    ("loops that cannot close", families::loops_that_cannot_close::run),
    ("inconsistent input", families::inconsistent_input::run),
    ("cranks that turn", families::cranks_that_turn::run),
];

/// States of each bundled robot at which warnings of good answers are counted.
fn generic_states(effort: &Effort) -> usize {
    if effort.quick { 20 } else { 1400 }
}

/// The same where every field is judged.
fn states_of_fields(effort: &Effort) -> u64 {
    if effort.quick { 2 } else { 30 }
}

/// Fills the section.
pub(crate) fn run(effort: &Effort, progress: &Progress) -> Outcome<Section> {
    let mut cases = Cases::default();
    for (k, (name, family)) in FAMILIES.iter().enumerate() {
        progress.show(name, k as f64 / FAMILIES.len() as f64);
        family(&mut cases, effort)?;
    }
    progress.show("warnings of good answers", 1.0);
    let alarms = false_alarms::count(generic_states(effort))?;
    let mut counted = Vec::new();
    for (name, family) in COUNTED {
        progress.show(name, 1.0);
        counted.push(counts(name, family, effort)?.1);
    }
    let mut section = figures::section(&cases.all);
    section.summary.extend(counted);
    section.summary.push(false_alarms::sum(&alarms).sentence("usual fields"));
    let fields = false_alarms::count_fields(states_of_fields(effort))?;
    section.summary.push(fields.sentence("every field"));
    section.tables.insert(1, false_alarms::table(&alarms));
    Ok(section)
}

/// The cases of a family, and in a line what became of them.
fn counts(
    name: &str,
    family: fn(&mut Cases, &Effort) -> Outcome,
    effort: &Effort,
) -> Outcome<(Cases, String)> {
    let mut cases = Cases::default();
    family(&mut cases, effort)?;
    let of = |assessment| cases.all.iter().filter(|case| case.assessment == assessment).count();
    let counts =
        Assessment::ALL.map(|assessment| format!("{} {}", of(assessment), assessment.name()));
    let line = format!(
        "Counted, {name}: {} cases, {}; {} not judged, as their reference is none.",
        cases.all.len(),
        counts.join(", "),
        cases.not_judged.len()
    );
    Ok((cases, line))
}

#[cfg(test)]
mod tests {
    use super::harness::case::Case;
    use super::*;

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

    /// Counts what the families do and prints the worst that fail silently.
    fn count(effort: &Effort) {
        let only = std::env::var("SARRUS_ONLY").unwrap_or_default();
        for (name, family) in COUNTED.into_iter().filter(|(name, _)| name.contains(&only)) {
            let start = std::time::Instant::now();
            let (cases, line) =
                counts(name, family, effort).unwrap_or_else(|error| panic!("{name}: {error}"));
            let of = |assessment| {
                cases.all.iter().filter(|case| case.assessment == assessment).collect::<Vec<_>>()
            };
            println!(
                "{line} {} ms, held up to {:.1e}",
                start.elapsed().as_millis(),
                of(Assessment::Held).iter().filter_map(|case| case.error).fold(0.0, f64::max)
            );
            let good = cases.all.iter().filter(|case| case.error.is_some_and(|x| x <= 1e-11));
            let warns = good.clone().filter(|case| !case.warnings.is_empty());
            println!("  {} keep eleven digits, {} of these warn", good.count(), warns.count());
            let mut words: Vec<(String, usize)> = Vec::new();
            for case in &cases.all {
                let word = format!(
                    "{} {}",
                    case.status,
                    case.reported.split(':').next_back().unwrap_or("")
                );
                match words.iter_mut().find(|(of, _)| *of == word) {
                    Some((_, n)) => *n += 1,
                    None => words.push((word, 1)),
                }
            }
            words.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
            if std::env::var_os("SARRUS_ALL").is_some() {
                for case in &cases.all {
                    println!(
                        "ALL {name}|{}|{}|{}|{:e}|{}|{}|{:?}|{:?}|{}",
                        case.family,
                        case.mechanism,
                        case.asked,
                        case.value,
                        case.method,
                        case.status,
                        case.assessment,
                        case.error,
                        case.reported
                    );
                }
            }
            words.iter().take(12).for_each(|(word, n)| println!("  {n} × {word}"));
            let mut silent = of(Assessment::FailedSilently);
            silent.sort_by(|a, b| {
                f64::total_cmp(&b.error.unwrap_or(f64::NAN), &a.error.unwrap_or(f64::NAN))
            });
            for case in silent.iter().take(if std::env::var_os("SARRUS_ALL").is_some() {
                100_000
            } else {
                20
            }) {
                println!(
                    "  {:.1e} {}, {}, {:.1e}, {}, {}; {}",
                    case.error.unwrap_or(f64::NAN),
                    case.mechanism,
                    case.asked,
                    case.value,
                    case.method,
                    case.status,
                    case.reported
                );
            }
        }
    }

    /// On the bundled robots at generic states, of answers that keep eleven digits.
    fn count_alarms(effort: &Effort) {
        let start = std::time::Instant::now();
        let counts = false_alarms::count(generic_states(effort)).expect("counts");
        for (name, count) in &counts {
            println!("{name}: {count:?}");
        }
        let sum = false_alarms::sum(&counts);
        println!("{} ({} ms)", sum.sentence("usual fields"), start.elapsed().as_millis());
        assert!(sum.good > 0 && 1000 * sum.alarms <= sum.good, "{sum:?}");
        let sum = false_alarms::count_fields(states_of_fields(effort)).expect("counts");
        println!("{} ({} ms)", sum.sentence("every field"), start.elapsed().as_millis());
        assert!(sum.good > 0 && 1000 * sum.alarms <= sum.good, "{sum:?}");
    }

    #[test]
    fn good_answers_hardly_ever_warn() {
        count_alarms(&Effort { quick: true });
    }

    #[test]
    #[ignore = "takes minutes"]
    fn a_hundred_thousand_good_answers_hardly_ever_warn() {
        count_alarms(&Effort { quick: false });
    }

    #[test]
    #[ignore = "counts"]
    fn silent_failures_are_counted() {
        count(&Effort { quick: std::env::var_os("SARRUS_FULL").is_none() });
    }

    /// For a minute.
    #[test]
    #[ignore = "takes a minute"]
    fn nothing_fails_silently_with_all_effort() {
        check(&Effort { quick: false });
    }
}
