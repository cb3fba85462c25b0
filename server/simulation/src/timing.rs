//! The fastest motion along a path of y that its actuators can drive.
//!
//! A spline y(s), twice continuously differentiable, goes through the rows. With x = ṡ² and u = s̈
//! the forces of the actuators are a(s) u + b(s) x + d(s) √x + c(s), within limits that depend on
//! their speed. A backward pass finds the greatest x from which the end is reached, a forward pass
//! takes the greatest u below it \[PP18: Pham and Pham, A new approach to time-optimal path
//! parameterization based on reachability analysis, IEEE Transactions on Robotics 34, 2018\].
//! Between the points of the grid, the rows of the table, the motion is the cubic through their y
//! and ẏ. Inverse dynamics looks at it, and the passes are repeated with narrower limits where it
//! finds more than [`ALLOWED`].

use crate::error::{Outcome, answered};
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request};

/// By how much of a limit a motion may exceed it between the points of the grid.
pub const ALLOWED: f64 = 1e-3;
/// Least size of the limit of a force at a speed, as a part of that at rest.
const LEAST: f64 = 1e-6;
/// Intervals of the grid in all, and least number of them between two rows.
const INTERVALS: usize = 400;
const BETWEEN: usize = 2;
/// Most passes, and halvings in the search for x.
const PASSES: u32 = 60;
const HALVINGS: u32 = 60;
/// Greatest rate of s where no limit bounds it, in units of y per second, squared.
const FASTEST: f64 = 1e6;

/// A path in time: rows at ascending times.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Time of each row `[s]`.
    pub times: Vec<f64>,
    /// Independent coordinates, velocities, accelerations, and forces of the actuators.
    pub rows: Vec<[Vec<f64>; 4]>,
    /// The largest part of a limit by which the motion exceeds it between rows.
    pub excess: f64,
}

/// Why a path cannot be driven.
#[derive(Clone, Debug, PartialEq)]
pub enum Stop {
    /// A quantity of a joint (`position`, `velocity`, `effort`) beyond its limits at a place, in
    /// rows of the path.
    Limit {
        /// The place.
        row: f64,
        /// The quantity.
        what: &'static str,
        /// The joint.
        name: String,
        /// Its value.
        value: f64,
        /// Least and greatest value.
        limits: [f64; 2],
    },
    /// No answer at a place.
    Status {
        /// The place.
        row: f64,
        /// Of inverse dynamics there.
        status: sarrus_dynamics::Status,
    },
}

/// A natural cubic spline over the length of the polygon through its knots.
struct Spline<'a> {
    rows: &'a [Vec<f64>],
    knots: Vec<f64>,
    /// Second derivatives at the knots.
    bends: Vec<Vec<f64>>,
}

impl Spline<'_> {
    fn through(rows: &[Vec<f64>]) -> Spline<'_> {
        let mut knots = vec![0.0];
        for pair in rows.windows(2) {
            let square = pair[0].iter().zip(&pair[1]).map(|(a, b)| (b - a) * (b - a)).sum::<f64>();
            knots.push(knots.last().copied().unwrap_or(0.0) + square.sqrt());
        }
        let n = rows.len();
        let width = rows.first().map_or(0, Vec::len);
        let mut bends = vec![vec![0.0; width]; n];
        // (h₋/6) m₋ + ((h₋ + h)/3) m + (h/6) m₊ = slope − slope₋
        let mut upper = vec![0.0; n];
        for k in 1..n.saturating_sub(1) {
            let before = knots[k] - knots[k - 1];
            let behind = knots[k + 1] - knots[k];
            let pivot = (before + behind) / 3.0 - before / 6.0 * upper[k - 1];
            upper[k] = behind / 6.0 / pivot;
            for j in 0..width {
                let turn =
                    (rows[k + 1][j] - rows[k][j]) / behind - (rows[k][j] - rows[k - 1][j]) / before;
                bends[k][j] = (turn - before / 6.0 * bends[k - 1][j]) / pivot;
            }
        }
        for k in (1..n.saturating_sub(1)).rev() {
            for j in 0..width {
                bends[k][j] -= upper[k] * bends[k + 1][j];
            }
        }
        Spline { rows, knots, bends }
    }

    /// y, y′ and y″ at a part of the interval behind a knot.
    fn at(&self, k: usize, part: f64) -> [Vec<f64>; 3] {
        let h = self.knots[k + 1] - self.knots[k];
        let a = 1.0 - part;
        let numbers = |of: &dyn Fn([f64; 4]) -> f64| {
            (0..self.rows[k].len())
                .map(|j| {
                    of([
                        self.rows[k][j],
                        self.rows[k + 1][j],
                        self.bends[k][j],
                        self.bends[k + 1][j],
                    ])
                })
                .collect()
        };
        [
            numbers(&|[p, q, m, n]| {
                a * p + part * q + ((a.powi(3) - a) * m + (part.powi(3) - part) * n) * h * h / 6.0
            }),
            numbers(&|[p, q, m, n]| {
                (q - p) / h + ((1.0 - 3.0 * a * a) * m + (3.0 * part * part - 1.0) * n) * h / 6.0
            }),
            numbers(&|[_, _, m, n]| a * m + part * n),
        ]
    }
}

/// A joint of one freedom with limits.
struct Joint {
    name: String,
    q: usize,
    v: usize,
    position: [f64; 2],
    velocity: f64,
}

impl Joint {
    fn stop(&self, row: f64, what: &'static str, value: f64, limits: [f64; 2]) -> Stop {
        Stop::Limit { row, what, name: self.name.clone(), value, limits }
    }
}

/// The path at a point of the grid: a, b, d, c of each actuator and its speed u′; the greatest x
/// by velocities.
#[derive(Clone)]
struct Point {
    place: f64,
    s: f64,
    terms: Vec<[f64; 4]>,
    speed: Vec<f64>,
    fastest: f64,
}

struct Timing<'a> {
    model: &'a Model<f64>,
    planned: Planned<f64>,
    joints: Vec<Joint>,
}

impl Timing<'_> {
    fn new(model: &Model<f64>) -> Outcome<Timing<'_>> {
        let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
        let want = FieldSet::of(&[Field::Q, Field::Qd, Field::Ud, Field::TauU]);
        let planned = Planned::new(model, &Query::new(Request::InverseDynamics, given, want))?;
        let info = model.info();
        let joints = info.tree.iter().enumerate().filter_map(|(v, name)| {
            let limits = info.limits[v]?;
            Some(Joint {
                name: name.clone(),
                q: info.tree_q.iter().position(|of| of == name)?,
                v,
                position: [
                    limits.lower.unwrap_or(f64::NEG_INFINITY),
                    limits.upper.unwrap_or(f64::INFINITY),
                ],
                velocity: limits.velocity.unwrap_or(f64::INFINITY),
            })
        });
        Ok(Timing { model, planned, joints: joints.collect() })
    }

    /// Inverse dynamics.
    fn run(&mut self, place: f64, [y, yd, ydd]: [&[f64]; 3]) -> Result<(), Stop> {
        self.planned.give(Field::Y, y);
        self.planned.give(Field::Yd, yd);
        self.planned.give(Field::Ydd, ydd);
        answered(self.planned.run(self.model).status)
            .map_err(|status| Stop::Status { row: place, status })
    }

    /// Least and greatest force of an actuator at a speed.
    fn forces(&self, u: usize, speed: f64) -> [f64; 2] {
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        self.model.actuator_forces(u, speed).unwrap_or(none)
    }

    fn limit(&self, row: f64, u: usize, value: f64, limits: [f64; 2]) -> Stop {
        let name = self.model.active_names()[u].clone();
        Stop::Limit { row, what: "effort", name, value, limits }
    }

    /// A point of the path; refused where it is beyond a position, or cannot be held at rest.
    fn point(&mut self, place: f64, s: f64, [y, dy, ddy]: &[Vec<f64>; 3]) -> Result<Point, Stop> {
        let still = vec![0.0; y.len()];
        let back: Vec<f64> = dy.iter().map(|x| -x).collect();
        let mut forces = [(); 4].map(|()| Vec::new());
        let motions = [[&still, &still], [&still, dy], [&back, ddy], [dy, ddy]];
        for (of, [yd, ydd]) in forces.iter_mut().zip(motions) {
            self.run(place, [y, yd, ydd])?;
            of.extend_from_slice(self.planned.get(Field::TauU));
        }
        let q = self.planned.get(Field::Q);
        let mut fastest = FASTEST;
        for of in &self.joints {
            let limits = of.position;
            let value = q[of.q];
            if value < limits[0] || value > limits[1] {
                return Err(of.stop(place, "position", value, limits));
            }
            let rate = self.planned.get(Field::Qd)[of.v].abs();
            if rate > 0.0 {
                fastest = fastest.min((of.velocity / rate).powi(2));
            }
        }
        let [rest, along, against, with] = forces;
        for (u, value) in rest.iter().enumerate() {
            let limits = self.forces(u, 0.0);
            if *value < limits[0] || *value > limits[1] {
                return Err(self.limit(place, u, *value, limits));
            }
        }
        let terms = (0..rest.len()).map(|u| {
            let c = rest[u];
            [along[u] - c, 0.5 * (with[u] + against[u]) - c, 0.5 * (with[u] - against[u]), c]
        });
        let terms = terms.collect();
        Ok(Point { place, s, terms, speed: self.planned.get(Field::Ud).to_vec(), fastest })
    }

    /// The accelerations of s over an interval that the actuators allow at both of its ends, from x
    /// at the first, with their limits times `parts`; the speed is that of the first.
    fn range(&self, i: usize, points: &[Point], x: f64, parts: &[f64]) -> [f64; 2] {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        let root = x.sqrt();
        let h = 2.0 * (points[i + 1].s - points[i].s);
        for (point, part, h) in [(&points[i], parts[i], 0.0), (&points[i + 1], parts[i + 1], h)] {
            for (u, [a, b, d, c]) in point.terms.iter().enumerate() {
                let slope = h.mul_add(*b, *a);
                let rest = b.mul_add(x, d.mul_add(root, *c));
                let limits = self.forces(u, point.speed[u] * root);
                let [lower, upper] = limits.map(|of| part * of - rest);
                if slope.abs() > 1e-12 * (1.0 + rest.abs()) {
                    let ends = [lower / slope, upper / slope];
                    range[0] = range[0].max(ends[0].min(ends[1]));
                    range[1] = range[1].min(ends[0].max(ends[1]));
                } else if lower > 0.0 || upper < 0.0 {
                    return [f64::INFINITY, f64::NEG_INFINITY];
                }
            }
        }
        range
    }

    /// x and u at each point, in the fastest motion below the limits times `parts`; the place at
    /// which it comes to a stop otherwise.
    fn passes(&self, points: &[Point], parts: &[f64]) -> Result<(Vec<f64>, Vec<f64>), usize> {
        let n = points.len();
        let mut most = vec![0.0; n];
        for i in (0..n - 1).rev() {
            let h = 2.0 * (points[i + 1].s - points[i].s);
            let drives = |x: f64| {
                let [least, greatest] = self.range(i, points, x, parts);
                least <= greatest && x + h * least <= most[i + 1] && x + h * greatest >= 0.0
            };
            let mut high = points[i].fastest * parts[i] * parts[i];
            let mut low = if drives(high) { high } else { 0.0 };
            for _ in 0..HALVINGS {
                if high - low <= 1e-12 * high {
                    break;
                }
                let middle = 0.5 * (low + high);
                if drives(middle) { low = middle } else { high = middle }
            }
            if low <= 0.0 && i > 0 {
                return Err(i);
            }
            most[i] = low;
        }
        let mut x = vec![0.0; n];
        let mut u = vec![0.0; n];
        for i in 0..n - 1 {
            let h = 2.0 * (points[i + 1].s - points[i].s);
            let [_, greatest] = self.range(i, points, x[i], parts);
            u[i] = greatest.min((most[i + 1] - x[i]) / h);
            x[i + 1] = (x[i] + h * u[i]).clamp(0.0, most[i + 1]);
            u[i] = (x[i + 1] - x[i]) / h;
            if x[i + 1] <= 0.0 && i + 2 < n {
                return Err(i + 1);
            }
        }
        u[n - 1] = u[n - 2];
        Ok((x, u))
    }

    /// The largest part of a limit by which a state exceeds it: of a force that on its side at its
    /// speed, of a position the largest one of the joint.
    fn excess(&mut self, place: f64, [y, yd, ydd]: &[Vec<f64>; 3]) -> Result<f64, (f64, Stop)> {
        self.run(place, [y, yd, ydd]).map_err(|stop| (f64::INFINITY, stop))?;
        let mut worst = (0.0, None);
        let mut look =
            |value: f64, [lower, upper]: [f64; 2], least: f64, stop: &dyn Fn() -> Stop| {
                let part = |over: f64, limit: f64| over / limit.abs().max(least);
                let over = part(value - upper, upper).max(part(lower - value, lower));
                if over > worst.0 {
                    worst = (over, Some(stop()));
                }
            };
        let size = |limits: [f64; 2]| {
            limits.iter().filter(|x| x.is_finite()).fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        for of in &self.joints {
            let limits = [-of.velocity, of.velocity];
            for (what, value, limits) in [
                ("position", self.planned.get(Field::Q)[of.q], of.position),
                ("velocity", self.planned.get(Field::Qd)[of.v], limits),
            ] {
                look(value, limits, size(limits), &|| of.stop(place, what, value, limits));
            }
        }
        for (k, value) in self.planned.get(Field::TauU).iter().enumerate() {
            let limits = self.forces(k, self.planned.get(Field::Ud)[k]);
            // the limit at this speed, which falls to zero at the greatest
            let least = LEAST * size(self.forces(k, 0.0));
            look(*value, limits, least, &|| self.limit(place, k, *value, limits));
        }
        match worst {
            (over, Some(stop)) if over > ALLOWED => Err((over, stop)),
            (over, _) => Ok(over),
        }
    }
}

/// Times a path of at least two different rows of y, from rest to rest. Every row has to be one
/// that the actuators can hold at rest. Equal rows that follow each other count once. Allocates.
///
/// # Errors
///
/// A model or rows that do not fit; the inner one where the path cannot be driven.
pub fn time_path(
    model: &Model<f64>,
    rows: &[Vec<f64>],
    progress: &mut dyn FnMut(f64),
) -> Outcome<Result<Timed, Stop>> {
    let mut timing = Timing::new(model)?;
    Ok(timing.time(rows, progress))
}

impl Timing<'_> {
    fn time(&mut self, rows: &[Vec<f64>], progress: &mut dyn FnMut(f64)) -> Result<Timed, Stop> {
        let mut places: Vec<usize> = Vec::new();
        for k in 0..rows.len() {
            if places.last().is_none_or(|last| rows[*last] != rows[k]) {
                places.push(k);
            }
        }
        let knots: Vec<Vec<f64>> = places.iter().map(|k| rows[*k].clone()).collect();
        let spline = Spline::through(&knots);
        let count = knots.len().saturating_sub(1);
        let steps = INTERVALS.div_ceil(count.max(1)).max(BETWEEN);
        let n = count * steps + 1;
        let mut points = Vec::with_capacity(n);
        let mut path = Vec::with_capacity(n);
        for i in 0..n {
            let k = (i / steps).min(count.saturating_sub(1));
            let part = (i - k * steps) as f64 / steps as f64;
            let row = places[k] as f64 + part * (places[k + 1] - places[k]) as f64;
            let s = spline.knots[k] + part * (spline.knots[k + 1] - spline.knots[k]);
            path.push(spline.at(k, part));
            points.push(self.point(row, s, &path[i])?);
            progress(0.5 * i as f64 / n as f64);
        }
        let mut parts = vec![1.0_f64; n];
        for pass in 0..PASSES {
            let (x, u) = self.passes(&points, &parts).map_err(|i| self.stopped(&points[i]))?;
            let mut excess = 0.0_f64;
            let mut worst: Option<(f64, Stop)> = None;
            let states: Vec<_> = (0..n).map(|i| state(&path[i], [x[i], u[i]])).collect();
            let mut times = vec![0.0];
            for i in 0..n - 1 {
                let h = 2.0 * (points[i + 1].s - points[i].s) / (x[i].sqrt() + x[i + 1].sqrt());
                times.push(times[i] + h);
                let ends = [&states[i], &states[i + 1]];
                let looked = [0.0, 0.25, 0.5, 0.75, 1.0].map(|part| (part, between(ends, h, part)));
                let looked = looked.iter().map(|(part, at)| (*part, at));
                for (part, at) in looked.chain([(1.0, &states[i + 1])]) {
                    let row = points[i].place + part * (points[i + 1].place - points[i].place);
                    match self.excess(row, at) {
                        Ok(over) => excess = excess.max(over),
                        Err((over, stop)) => {
                            let narrower = 1.0 / (1.0 + over.min(0.5));
                            parts[i] *= narrower;
                            parts[i + 1] *= narrower;
                            if worst.as_ref().is_none_or(|(most, _)| over > *most) {
                                worst = Some((over, stop));
                            }
                        }
                    }
                }
            }
            progress(0.5 + 0.5 * f64::from(pass) / f64::from(PASSES));
            match worst {
                None => return self.timed(&points, times, states, excess),
                // a path beyond a position, or one that no speed helps
                Some((_, stop @ Stop::Limit { what: "position", .. })) => return Err(stop),
                Some((_, stop)) if pass + 1 == PASSES => return Err(stop),
                Some(_) => {}
            }
        }
        Err(self.stopped(&points[0]))
    }

    /// The actuator that leaves least room at rest.
    fn stopped(&self, point: &Point) -> Stop {
        let room = |u: &usize| {
            let [lower, upper] = self.forces(*u, 0.0);
            let value = point.terms[*u][3];
            (upper - value).min(value - lower) / upper.abs().max(lower.abs())
        };
        let least = (0..point.terms.len()).min_by(|a, b| room(a).total_cmp(&room(b))).unwrap_or(0);
        self.limit(point.place, least, point.terms[least][3], self.forces(least, 0.0))
    }

    fn timed(
        &mut self,
        points: &[Point],
        times: Vec<f64>,
        states: Vec<[Vec<f64>; 3]>,
        excess: f64,
    ) -> Result<Timed, Stop> {
        let mut timed = Timed { times, rows: Vec::new(), excess };
        for ([y, yd, ydd], point) in states.into_iter().zip(points) {
            self.run(point.place, [&y, &yd, &ydd])?;
            timed.rows.push([y, yd, ydd, self.planned.get(Field::TauU).to_vec()]);
        }
        Ok(timed)
    }
}

/// y, ẏ and ÿ from y, y′ and y″ at x and u.
fn state([y, dy, ddy]: &[Vec<f64>; 3], [x, u]: [f64; 2]) -> [Vec<f64>; 3] {
    let yd = dy.iter().map(|d| d * x.max(0.0).sqrt()).collect();
    let ydd = dy.iter().zip(ddy).map(|(d, dd)| d * u + dd * x).collect();
    [y.clone(), yd, ydd]
}

/// The cubic through y and ẏ of two states h apart, at a part of the time between them.
fn between(ends: [&[Vec<f64>; 3]; 2], h: f64, part: f64) -> [Vec<f64>; 3] {
    let mut state = [const { Vec::new() }; 3];
    for j in 0..ends[0][0].len() {
        let [[y, yd], [y1, yd1]] = ends.map(|of| [of[0][j], of[1][j]]);
        let mean = (y1 - y) / h;
        let [turn, bend] = [3.0 * mean - 2.0 * yd - yd1, yd + yd1 - 2.0 * mean];
        state[0].push(y + part * h * (yd + part * (turn + part * bend)));
        state[1].push(yd + part * (2.0 * turn + 3.0 * part * bend));
        state[2].push((2.0 * turn + 6.0 * part * bend) / h);
    }
    state
}
