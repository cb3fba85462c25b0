//! A motion as a page: the robot beside its curves.

use sarrus_dynamics::{Field, FieldSet, Planned, Query, Request};
use sarrus_models::Loaded;
use serde_json::{Value, json};

use crate::code::{Code, FRAMES};
use crate::mesh::base64;
use crate::{LONGEST, Settings, assembled, scene};

/// Most samples of a page.
pub const POINTS: usize = 2000;
/// Letters of scripts and of a robot without its samples, at most.
const PARTS: usize = 1_000_000;

/// A motion of a robot: its samples and their curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// How many samples the run has, of which these are some.
    pub samples: usize,
    /// Time of each sample `[s]`.
    pub times: Vec<f64>,
    /// Tree coordinates of each (n_q).
    pub q: Vec<Vec<f64>>,
    /// Distance to singularity of each; none without loops.
    pub sigma_min: Vec<f64>,
    /// The curves over time.
    pub charts: Vec<Chart>,
    /// Lines about the run.
    pub texts: Vec<String>,
    /// The command that made it.
    pub command: String,
}

/// Curves with one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Title with the unit.
    pub title: String,
    /// The axis is logarithmic.
    pub log: bool,
    /// At least one curve.
    pub curves: Vec<Curve>,
}

/// A number over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name of the joint, row or energy.
    pub name: String,
    /// One number for each sample; NaN is a gap.
    pub values: Vec<f64>,
    /// Least and greatest number allowed.
    pub limits: [Option<f64>; 2],
}

/// The page of a motion: one HTML file that refers to nothing outside. Allocates.
pub fn motion(loaded: &Loaded, settings: &Settings, motion: &Motion) -> String {
    let mut robot = scene::scene(loaded, settings, &Code::default());
    // samples that fit into a page of single precision
    let width = motion.q.first().map_or(0, Vec::len);
    let columns = width + motion.charts.iter().map(|chart| chart.curves.len()).sum::<usize>() + 4;
    let fitting = (LONGEST - PARTS) / (columns * 16 / 3);
    let shown = sparse(motion.times.len(), fitting.clamp(2, POINTS));
    let some = |list: &[f64]| floats(shown.iter().filter_map(|k| list.get(*k)));
    let curve = |curve: &Curve| {
        let [lower, upper] = curve.limits;
        json!({"name": curve.name, "values": some(&curve.values), "lower": lower, "upper": upper})
    };
    let chart = |chart: &Chart| {
        let curves = chart.curves.iter().map(curve).collect::<Vec<_>>();
        json!({"title": chart.title, "log": chart.log, "curves": curves})
    };
    let picked = |list: &[f64]| shown.iter().filter_map(|k| list.get(*k).copied()).collect();
    let times: Vec<f64> = picked(&motion.times);
    let sigma_min: Vec<f64> = picked(&motion.sigma_min);
    let ends = [motion.q.first(), motion.q.last()];
    robot["run"] = json!({
        "times": times,
        "samples": motion.samples,
        "q": floats(shown.iter().filter_map(|k| motion.q.get(*k)).flatten()),
        "sigma_min": sigma_min,
        "charts": motion.charts.iter().map(chart).collect::<Vec<_>>(),
        "texts": motion.texts,
        "command": motion.command,
        "checks": ends.into_iter().flatten().flat_map(|q| checks(loaded, q)).collect::<Vec<_>>(),
    });
    let template = include_str!("../page/play.html")
        .replace("@UPLOT@", include_str!("../page/uplot/uPlot.min.css"));
    let charts = include_str!("../page/uplot/uPlot.iife.min.js");
    let parts = [charts, "", include_str!("../page/play.js")];
    assembled(&template, loaded, settings, robot, parts)
}

/// Places of at most so many of these samples, the first and the last among them.
pub fn sparse(count: usize, most: usize) -> Vec<usize> {
    let last = count.saturating_sub(1);
    let steps = last.min(most - 1);
    let place = |k: usize| (k * last).checked_div(steps).unwrap_or(0);
    (0..count.min(steps + 1)).map(place).collect()
}

/// Single precision in base64, little-endian.
fn floats<'a>(list: impl Iterator<Item = &'a f64>) -> String {
    base64(list.flat_map(|x| (*x as f32).to_le_bytes()))
}

/// Poses of the kernels, with which the page compares its own: of some links at a closed pose.
fn checks(loaded: &Loaded, q: &[f64]) -> Vec<Value> {
    let model = &loaded.compiled.model;
    let info = model.info();
    let y = info.independent_q.iter().filter_map(|name| {
        let place = info.tree_q.iter().position(|other| other == name)?;
        q.get(place).copied()
    });
    let y: Vec<f64> = y.collect();
    let given = FieldSet::of(&[Field::Y, Field::QGuess]);
    let want = FieldSet::of(&[Field::Q, Field::FramePose]);
    let links: Vec<u16> = (0..info.links.len() as u16).collect();
    let of = |links: &[u16]| {
        let query = Query::new(Request::Kinematics, given, want).with_frames(links);
        let numbers = [(Field::Y, &y[..]), (Field::QGuess, q)];
        let planned = Planned::answered(model, &query, &numbers)?;
        // links in the order of the description
        let place = |link: &u16| {
            let name = &info.links[usize::from(*link)];
            loaded.description.links.iter().position(|other| other.name == *name)
        };
        let places = links.iter().map(place).collect::<Option<Vec<_>>>()?;
        let [q, poses] = [Field::Q, Field::FramePose].map(|field| planned.get(field));
        Some(json!({"q": q, "links": places, "poses": poses}))
    };
    links.chunks(FRAMES).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_the_first_and_the_last_sample_and_no_more_than_it_may() {
        assert_eq!(sparse(0, 5), [0; 0]);
        assert_eq!(sparse(1, 5), [0]);
        assert_eq!(sparse(4, 5), [0, 1, 2, 3]);
        for (count, most) in [(2001, 2000), (501, 2000), (1_000_000, 2000), (7, 2)] {
            let places = sparse(count, most);
            assert_eq!(places.len(), count.min(most));
            assert_eq!((places[0], *places.last().unwrap()), (0, count - 1));
            assert!(places.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
