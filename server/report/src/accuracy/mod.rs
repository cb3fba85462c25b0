//! Section `accuracy`: error against run time, one figure per robot and question.
//!
//! A method is one line in `methods.rs`; `runner.rs` calls it, `measure.rs` times it, `figures.rs`
//! draws it, and `defaults.rs` tabulates the defaults. `inverse.rs` has inverse kinematics, whose
//! searches have no reference.

mod defaults;
mod figures;
mod inverse;
mod measure;
mod methods;
mod runner;

use std::time::Duration;

use sarrus_dynamics::Model;

use self::defaults::{DefaultRow, row, sentence};
use self::figures::{aim, figure, of_peer};
use self::measure::measure;
use self::methods::Method;
use crate::Outcome;
use crate::measure::progress::Progress;
use crate::measure::{Amount, Effort};
use crate::page::{Figure, Section, Table, columns, exponent};
use crate::peer;
use crate::reference::{References, worse};
use crate::robots::catalogue::{numerical, variants};
use crate::robots::{Question, Robot, Subject, Variant};

/// The robots.
const ROBOTS: [Subject; 8] = [
    Subject::Bundled("lambda"),
    Subject::Bundled("torso"),
    Subject::Bundled("ankle"),
    Subject::Bundled("wrist"),
    Subject::Bundled("stewart"),
    Subject::Bundled("rh5v2_upper_body"),
    Subject::Bundled("rh5v2_full"),
    Subject::Chain(1),
];
/// The questions, by their names in the page and the files.
const QUESTIONS: [(Question, &str, &str); 5] = [
    (Question::State, "state", "state"),
    (Question::InverseDynamics, "inverse dynamics", "id"),
    (Question::ForwardDynamics, "forward dynamics", "fd"),
    (Question::InverseDerivatives, "derivatives of inverse dynamics", "did"),
    (Question::ForwardDerivatives, "derivatives of forward dynamics", "dfd"),
];

const QUICK: Amount = Amount { states: 16, rounds: Duration::from_millis(1000), of_peer: 0.02 };
/// Targets of inverse kinematics, and the errors at which the peers stop.
const QUICK_SEARCHES: (usize, &[f64]) = (8, &[1e-3, 1e-6]);
const SEARCHES: (usize, &[f64]) = (50, &[1e-1, 1e-3, 1e-5, 1e-7, 1e-9]);
const FULL: Amount = Amount { states: 128, rounds: Duration::from_secs(20), of_peer: 0.3 };

/// Fills the section.
pub(crate) fn run(effort: &Effort, own: Option<Subject>, progress: &Progress) -> Outcome<Section> {
    let amount = if effort.quick { QUICK } else { FULL };
    let robots = own.map_or(ROBOTS.to_vec(), |own| vec![own]);
    let mut section = Section::new("accuracy", "Error against run time");
    let mut rows = Vec::new();
    let mut places = Vec::new();
    let mut absent = Vec::new();
    for (k, &subject) in robots.iter().enumerate() {
        let share = |done: f64| (k as f64 + done) / robots.len() as f64;
        progress.show(&title(subject), share(0.0));
        let robot = load(subject, amount.states)?;
        let (figures, measured, mut missing) =
            robot_figures(&robot, amount, |done| progress.show(&title(subject), share(done)))?;
        let defaults = measured.iter().filter(|of| of.default).filter_map(|of| {
            let figure = figures.iter().find(|figure| figure.id == id(subject, of.question))?;
            Some(row(&robot, figure, of))
        });
        let of_robot: Vec<DefaultRow> = defaults.collect();
        places.push(sentence(subject, &of_robot));
        for of in &of_robot {
            section.worst_error = Some(worse(section.worst_error.unwrap_or(0.0), of.error));
        }
        rows.extend(of_robot.into_iter().map(|of| of.cells));
        section.figures.extend(figures);
        let (targets, stops) = if effort.quick { QUICK_SEARCHES } else { SEARCHES };
        section.figures.extend(inverse::figure(subject, targets, stops)?);
        if k == 0 {
            absent.append(&mut missing);
        }
    }
    let worst = section.worst_error.map_or("-".to_owned(), exponent);
    section.summary.push(format!("largest error of the default methods: {worst}"));
    section.summary.append(&mut places);
    section.summary.append(&mut absent);
    section.tables.push(Table {
        id: "accuracy-defaults".into(),
        title: "Default methods".into(),
        caption: "Time and error of the default methods, and the time against the fastest method \
            of the figure that is no less exact."
            .into(),
        columns: columns("robot | asked | method | ns per call | error | loop residual | place"),
        rows,
    });
    Ok(section)
}

/// A robot with its own closures and by Newton's method, on the same states.
fn load(subject: Subject, n_states: usize) -> Outcome<Robot> {
    let n_states = subject.states(n_states);
    let (description, mut all) = variants(subject, |name| !name.starts_with("hybrid-"))?;
    if matches!(subject, Subject::Chain(_)) {
        all.push(Variant {
            closures: "numerical",
            compiled: Model::compile(&numerical(description.clone()))?,
        });
    }
    Robot::with_variants(subject, description, all, n_states)
}

fn title(subject: Subject) -> String {
    if matches!(subject, Subject::Chain(_)) {
        "chain of 100 lambdas".to_owned()
    } else {
        subject.name().to_owned()
    }
}

fn id(subject: Subject, question: Question) -> String {
    format!("accuracy-{}-{}", subject.name(), words(question)[1])
}

/// A question, by its name in the page and the files.
fn words(question: Question) -> [&'static str; 2] {
    let words = QUESTIONS.iter().find(|(of, ..)| *of == question);
    words.map_or([""; 2], |(_, name, id)| [*name, *id])
}

/// The figures of one robot, their contents, and the reasons of missing peers.
fn robot_figures(
    robot: &Robot,
    amount: Amount,
    shown: impl Fn(f64),
) -> Outcome<(Vec<Figure>, Vec<Method>, Vec<String>)> {
    let mut methods = methods::of_robot(robot)?;
    let mut references = References::new(robot);
    measure(robot, &mut methods, &mut references, amount.rounds, shown)?;
    let (runs, missing) = peer::peers(robot, 0, amount.of_peer)?;
    let mut figures = Vec::new();
    for (question, name, _) in QUESTIONS {
        let of = methods.iter().filter(|of| of.question == question);
        let Some(_) = of.clone().next() else { continue };
        let mut figure = figure(robot, question, name, of);
        figure.series.extend(of_peer(robot, &mut references, &runs, question)?);
        figure.series.extend(aim(&figure, question, &methods));
        if robot.subject != Subject::Chain(1) {
            missing.iter().for_each(|why| figure.caption += &format!(" {why}"));
        }
        figures.push(figure);
    }
    // the same span of times and of errors in figures of one kind
    for figures in figures.chunks_mut(Question::CHOSEN.len()) {
        let points = figures.iter().flat_map(|figure| &figure.series).flat_map(|of| &of.points);
        let drawn = points.filter(|of| of.x.is_finite() && of.y.is_finite());
        let (xs, ys): (Vec<f64>, Vec<f64>) = drawn.map(|of| (of.x, of.y)).unzip();
        for figure in figures {
            (figure.x.shared, figure.y.shared) = (xs.clone(), ys.clone());
        }
    }
    Ok((figures, methods, missing))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails panics")]
mod tests {
    use super::*;
    use crate::page::pareto_front;

    const SMALL: Amount = Amount { states: 6, rounds: Duration::from_millis(150), of_peer: 0.001 };

    fn figures(subject: Subject) -> (Vec<Figure>, Vec<Method>) {
        let robot = load(subject, SMALL.states).unwrap();
        let (figures, measured, _) = robot_figures(&robot, SMALL, |_| {}).unwrap();
        (figures, measured)
    }

    fn setting(label: &str) -> f64 {
        label.rsplit(' ').find_map(|word| word.parse().ok()).unwrap()
    }

    #[test]
    fn errors_are_finite_and_a_tighter_end_is_never_much_worse() {
        for subject in [
            Subject::Bundled("torso"),
            Subject::Bundled("wrist"),
            Subject::Bundled("stewart"),
            Subject::Chain(0),
        ] {
            let (figures, measured) = figures(subject);
            assert_eq!(figures.len(), 5);
            for of in &measured {
                let Method { series, label, error, ns, fault, .. } = of;
                assert!(
                    fault.is_none() && error.is_finite() && *ns > 0.0,
                    "{series}, {label}: {error:e} {fault:?}"
                );
                if of.default {
                    assert!(*error < 1e-11, "{series}, {label}: {error:e}");
                }
                if let Some(residual) = of.residual {
                    assert!(
                        residual <= 10.0 * error.max(1e-16),
                        "{series}, {label}: {residual:e} and {error:e}"
                    );
                }
            }
            for figure in &figures {
                for series in figure.series.iter().filter(|series| {
                    series.points.iter().any(|point| point.label.starts_with("tolerance"))
                }) {
                    let ends =
                        series.points.iter().filter(|point| point.label.starts_with("tolerance"));
                    let mut ends: Vec<(f64, f64)> =
                        ends.map(|point| (setting(&point.label), point.y)).collect();
                    ends.sort_by(|a, b| b.0.total_cmp(&a.0));
                    for pair in ends.windows(2) {
                        assert!(
                            pair[1].1 <= 3.0 * pair[0].1 + 1e-11,
                            "{}, {}: {pair:?}",
                            figure.title,
                            series.name
                        );
                    }
                }
            }
            // more steps are no worse; one is enough after a tabulated start
            let bounded = measured.iter().filter(|of| {
                of.question == Question::State && of.series == "Newton, cold, double, bounded steps"
            });
            let errors: Vec<f64> = bounded.map(|of| of.error).collect();
            assert!(
                errors.len() > 3
                    && errors.last().unwrap() < &1e-9
                    && errors.windows(2).all(|pair| pair[1] <= 3.0 * pair[0] + 1e-15),
                "{errors:?}"
            );
        }
    }

    #[test]
    fn targets_within_limits_are_found() {
        let figure = inverse::figure(Subject::Bundled("stewart"), 6, &[]).unwrap().unwrap();
        let [ours] = &figure.series[..] else { panic!("{:?}", figure.series) };
        let [point] = &ours.points[..] else { panic!("{ours:?}") };
        assert!(point.label.ends_with(", 6 of 6 found"), "{point:?}");
        assert!(point.x > 0.0 && point.y > 0.0 && point.y < 1e-9, "{point:?}");
        assert!(inverse::figure(Subject::Bundled("lambda"), 6, &[]).unwrap().is_none());
        assert!(inverse::figure(Subject::Chain(1), 6, &[]).unwrap().is_none());
    }

    #[test]
    fn nothing_on_a_front_is_beaten_and_every_default_has_its_place() {
        let subject = Subject::Bundled("lambda");
        let (figures, measured) = figures(subject);
        for figure in &figures {
            let best = pareto_front(figure);
            assert!(!best.is_empty());
            let points = || {
                figure
                    .series
                    .iter()
                    .filter(|series| series.competes)
                    .flat_map(|series| &series.points)
            };
            for (_, of) in &best {
                assert!(
                    !points().any(|point| point.x < of.x && point.y < of.y),
                    "{}: {of:?}",
                    figure.title
                );
            }
            // points off the front are dominated or equalled
            for point in points().filter(|point| point.x.is_finite() && point.y.is_finite()) {
                assert!(
                    best.iter().any(|(_, of)| of.x <= point.x && of.y <= point.y),
                    "{}: {point:?}",
                    figure.title
                );
            }
            let unique: std::collections::HashSet<_> =
                figure.series.iter().map(|series| &series.name).collect();
            assert_eq!(unique.len(), figure.series.len());
        }
        let robot = load(subject, 2).unwrap();
        let defaults: Vec<&Method> = measured.iter().filter(|of| of.default).collect();
        assert_eq!(defaults.len(), 5);
        for of in defaults {
            let figure =
                figures.iter().find(|figure| figure.id == id(subject, of.question)).unwrap();
            let place = row(&robot, figure, of);
            assert!(place.factor >= 1.0 && place.cells.len() == 7, "{:?}", place.cells);
            assert!(!place.on_front || place.factor < 1.0 + 1e-12, "{:?}", place.cells);
        }
    }
}
