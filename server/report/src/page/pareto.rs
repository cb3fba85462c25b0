//! Pareto fronts: points that no other point beats on both axes.

use super::figure::{Figure, Point, Series};
use super::section::Section;

/// The other engines. Their series begin with these names.
pub(crate) const PEERS: [&str; 8] =
    ["Pinocchio", "MuJoCo", "Simbody", "Drake", "RBDL", "pink", "mink", "placo"];
/// The programs of the first ones; the last three have inverse kinematics in one program.
pub(crate) const PROGRAMS: [&str; 5] = ["pinocchio", "mujoco", "simbody", "drake", "rbdl"];

/// Errors up to this are rounding and count as equal in comparisons with a peer.
pub(super) const ROUNDING: f64 = 1e-14;

/// True for the series of another engine.
pub(crate) fn is_peer(name: &str) -> bool {
    PEERS.iter().any(|peer| name.starts_with(peer))
}

/// Every point of a figure that competes, with its series.
fn competitors(figure: &Figure) -> Vec<(&Series, &Point)> {
    let of = figure.series.iter().filter(|series| series.competes);
    let points = of.flat_map(|series| series.points.iter().map(move |point| (series, point)));
    points.filter(|(_, point)| point.x.is_finite() && point.y.is_finite()).collect()
}

/// The front of a figure, from the left to the right; of equal points the first.
pub(crate) fn pareto_front(figure: &Figure) -> Vec<(&Series, &Point)> {
    let mut points = competitors(figure);
    points.sort_by(|(_, a), (_, b)| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut least = f64::INFINITY;
    points.retain(|(_, point)| {
        point.y < least && {
            least = point.y;
            true
        }
    });
    points
}

/// A figure's front and its ends.
#[derive(Clone, Debug)]
pub(super) struct FrontSummary {
    /// Number of points on the front, and of those that are not a peer's.
    pub(super) front: usize,
    pub(super) ours: usize,
    /// Whether a peer competes.
    pub(super) with_peer: bool,
    /// Title of the figure, share of the front, both ends, peers.
    pub(super) cells: Vec<String>,
}

/// The rank in every figure that has a front.
pub(super) fn summaries(sections: &[Section]) -> Vec<FrontSummary> {
    sections.iter().flat_map(|section| &section.figures).filter_map(summary).collect()
}

fn summary(figure: &Figure) -> Option<FrontSummary> {
    let front = pareto_front(figure);
    let fastest = front.first()?;
    let most_exact = front.last()?;
    let words = |(series, point): &(&Series, &Point)| {
        format!("{} ({}; {})", series.name, short(point.x), exponent(point.y))
    };
    let ours = front.iter().filter(|(series, _)| !is_peer(&series.name)).count();
    Some(FrontSummary {
        front: front.len(),
        ours,
        with_peer: figure.series.iter().any(|series| series.competes && is_peer(&series.name)),
        cells: vec![
            figure.title.clone(),
            format!("{ours} of {}", front.len()),
            words(fastest),
            words(most_exact),
            peers(figure),
        ],
    })
}

/// Compares the best point of each peer's series with ours.
fn peers(figure: &Figure) -> String {
    let points = competitors(figure);
    let mut sentences: Vec<String> = Vec::new();
    for series in figure.series.iter().filter(|series| series.competes && is_peer(&series.name)) {
        // the least speed-up of one of our points of at least equal accuracy
        let factor = |theirs: &Point| {
            let ours = points
                .iter()
                .filter(|(of, ours)| !is_peer(&of.name) && ours.y <= theirs.y.max(ROUNDING));
            ours.map(|(_, ours)| theirs.x / ours.x).fold(0.0, f64::max)
        };
        let theirs = points.iter().filter(|(of, _)| of.name == series.name);
        let factors = theirs.map(|(_, point)| factor(point));
        match factors.fold(f64::INFINITY, f64::min) {
            least if least.is_infinite() => sentences.push(format!("{}: no answer", series.name)),
            least if least > 0.0 => sentences
                .push(format!("{}: {least:.2} times our time at no smaller error", series.name)),
            _ => sentences.push(format!("{}: more exact than all of ours", series.name)),
        }
    }
    if sentences.is_empty() { "none measured".to_owned() } else { sentences.join("; ") }
}

/// Three digits.
fn short(x: f64) -> String {
    if (1e-2..1e6).contains(&x) {
        format!("{x:.*}", if x < 10.0 { 2 } else { 0 })
    } else {
        exponent(x)
    }
}

/// Two digits and a power of ten.
pub(crate) fn exponent(x: f64) -> String {
    if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, points: &[(f64, f64)]) -> Series {
        let point = |&(x, y): &(f64, f64)| Point { x, y, label: String::new() };
        Series {
            name: name.to_owned(),
            line: false,
            competes: true,
            points: points.iter().map(point).collect(),
        }
    }

    #[test]
    fn a_front_holds_what_nothing_beats() {
        let figure = Figure {
            series: vec![
                series("a", &[(3.0, 1.0), (1.0, 9.0), (2.0, 9.0)]),
                series("b", &[(2.0, 4.0), (9.0, f64::NAN)]),
            ],
            ..Figure::default()
        };
        let found: Vec<(f64, f64)> =
            pareto_front(&figure).iter().map(|(_, point)| (point.x, point.y)).collect();
        assert_eq!(found, [(1.0, 9.0), (2.0, 4.0), (3.0, 1.0)]);
    }

    #[test]
    fn a_peer_is_compared_with_what_is_no_less_exact() {
        let ours = series("embedding", &[(100.0, 1e-12), (50.0, 1e-6)]);
        let slower = Figure {
            series: vec![ours.clone(), series("Pinocchio FD", &[(400.0, 1e-8)])],
            ..Figure::default()
        };
        assert_eq!(peers(&slower), "Pinocchio FD: 4.00 times our time at no smaller error");
        let better = Figure {
            series: vec![ours.clone(), series("Pinocchio FD", &[(400.0, 1e-13)])],
            ..Figure::default()
        };
        assert_eq!(peers(&better), "Pinocchio FD: more exact than all of ours");
        let rounding = Figure {
            series: vec![series("a", &[(100.0, 9e-15)]), series("Pinocchio FD", &[(300.0, 1e-16)])],
            ..Figure::default()
        };
        assert_eq!(peers(&rounding), "Pinocchio FD: 3.00 times our time at no smaller error");
        assert_eq!(
            peers(&Figure { series: vec![ours.clone()], ..Figure::default() }),
            "none measured"
        );
        let counts =
            |figure| summary(figure).map(|place| (place.ours, place.front, place.with_peer));
        assert_eq!(counts(&better), Some((2, 3, true)));
        assert_eq!(
            counts(&Figure { series: vec![ours], ..Figure::default() }),
            Some((2, 2, false))
        );
        assert!(summary(&Figure::default()).is_none());
    }
}
