//! Simulations against a second integration of the oracle's equations, by extrapolation.

use sarrus_dynamics::Field::Y;
use sarrus_dynamics::description::{Joint, JointKind};
use sarrus_dynamics::{Compiled, Request};
use sarrus_simulation::{
    EventKind, Input, Method, Point, Settings, Setup, Source, Space, Spring, Start, simulate,
};

use super::{Judge, Ledger, REGULAR, size};
use crate::pairs::algebra::{Matrix, V3, add, apply, cross, dot, eliminate, sub};
use crate::pairs::oracle::Link;
use crate::seed::Seeded;
use sarrus_dynamics::Field::Q;

/// Columns of the extrapolation, and pieces of the time.
const COLUMNS: usize = 8;
const PIECES: usize = 8;
/// Error by size of a simulation that is right, and of a reference that counts.
const RIGHT: f64 = 1e-6;
const SURE: f64 = 1e-9;
/// How long, in units of the root of a length over gravity `[s]`.
const LONG: f64 = 0.25;

/// The second set of equations of motion: y, ẏ and the closed pose near by.
struct Equations<'a> {
    judge: &'a Judge<'a>,
    springs: Vec<Spring>,
    /// Links of the springs' ends, forces on the independents and on the actuators, by velocity.
    ends: Vec<[usize; 2]>,
    inputs: Vec<(usize, Drive)>,
}

/// A constant force, or gains towards a target.
#[derive(Clone, Copy)]
enum Drive {
    Force(f64),
    Gains(f64, f64, f64),
}

/// A state of motion: the closed pose with y in it, and ẏ.
#[derive(Clone)]
struct At {
    q: Vec<f64>,
    y: Vec<f64>,
    yd: Vec<f64>,
}

impl Equations<'_> {
    /// Closes the loops at y from the pose near by; ÿ and the least pivot there.
    fn accelerations(&self, at: &mut At) -> Option<(Vec<f64>, f64)> {
        let oracle = &self.judge.oracle;
        let n = at.y.len();
        for (i, y) in oracle.independent_q().iter().zip(&at.y) {
            at.q[*i] = *y;
        }
        let (_, pivot) = oracle.close(&mut at.q, 8)?;
        let rates = oracle.rates(&at.q, &at.yd);
        let poses = oracle.poses(&at.q);
        let qd = oracle.rate(&rates.G, &at.yd);
        let project = |tau: &[f64]| -> Vec<f64> {
            let along =
                |k: usize| tau.iter().enumerate().map(|(v, x)| rates.G[v * n + k] * x).sum();
            (0..n).map(along).collect()
        };
        let c = project(&oracle.forces(&at.q, &poses, &qd, &rates.g));
        let mut M = Matrix::new(n, n);
        let mut right = Matrix::new(n, 1);
        for k in 0..n {
            let mut e = vec![0.0; n];
            e[k] = 1.0;
            let mut one = oracle.rate(&rates.G, &e);
            one.iter_mut().zip(&rates.g).for_each(|(x, g)| *x += g);
            let column = project(&oracle.forces(&at.q, &poses, &qd, &one));
            (0..n).for_each(|i| *M.at(i, k) = column[i] - c[i]);
        }
        let mut tau = vec![0.0; qd.len()];
        for (v, drive) in &self.inputs {
            tau[*v] += match drive {
                Drive::Force(x) => *x,
                Drive::Gains(kp, kd, target) => {
                    kp * (target - at.q[self.judge.oracle.coordinate_of(*v)]) - kd * qd[*v]
                }
            };
        }
        let mut given = project(&tau);
        let still = vec![0.0; qd.len()];
        let links = oracle.links(&poses, &qd, &still);
        for (spring, ends) in self.springs.iter().zip(&self.ends) {
            let point = |links: &[Link<f64>], k: usize, at: [f64; 3]| -> [V3<f64>; 2] {
                let x = &links[ends[k]];
                let arm = apply(&x.R, at);
                [add(x.p, arm), add(x.d, cross(x.w, arm))]
            };
            let both = |links: &[Link<f64>]| {
                let [a, b] = [point(links, 0, spring.from.at), point(links, 1, spring.to.at)];
                [sub(b[0], a[0]), sub(b[1], a[1])]
            };
            let [d, rate] = both(&links);
            let l = dot(d, d).sqrt();
            let force = spring.stiffness * (l - spring.rest) + spring.damping * dot(d, rate) / l;
            for k in 0..n {
                let mut e = vec![0.0; n];
                e[k] = 1.0;
                let unit = oracle.links(&poses, &oracle.rate(&rates.G, &e), &still);
                given[k] -= force * dot(d, both(&unit)[1]) / l;
            }
        }
        let scale: Vec<f64> = (0..n).map(|i| 1.0 / M.get(i, i).abs().sqrt()).collect();
        for i in 0..n {
            (0..n).for_each(|j| *M.at(i, j) *= scale[i] * scale[j]);
            *right.at(i, 0) = (given[i] - c[i]) * scale[i];
        }
        let (x, of_mass) = eliminate(M, right);
        (of_mass > 1e-6).then(|| ((0..n).map(|i| x.get(i, 0) * scale[i]).collect(), pivot))
    }

    /// Bulirsch and Stoer's extrapolation of the midpoint rule over a time; the least pivot and an
    /// estimate of the error by size.
    fn piece(&self, from: &At, time: f64) -> Option<(At, f64, f64)> {
        let mut least = f64::INFINITY;
        let mut last: Vec<Vec<f64>> = Vec::new();
        let mut error = f64::INFINITY;
        let mut end = from.clone();
        for column in 0..COLUMNS {
            let n = 2 * (column + 1);
            let h = time / n as f64;
            let mut rate = |at: &mut At| {
                let (ydd, pivot) = self.accelerations(at)?;
                least = least.min(pivot);
                Some(ydd)
            };
            let mut before = from.clone();
            let ydd = rate(&mut before)?;
            let moved = |from: &At, q: &At, by: &[f64], ydd: &[f64], h: f64| At {
                q: q.q.clone(),
                y: from.y.iter().zip(by).map(|(y, v)| y + h * v).collect(),
                yd: from.yd.iter().zip(ydd).map(|(v, a)| v + h * a).collect(),
            };
            let mut now = moved(&before, &before, &before.yd, &ydd, h);
            for _ in 1..n {
                let ydd = rate(&mut now)?;
                let yd = now.yd.clone();
                let next = moved(&before, &now, &yd, &ydd, 2.0 * h);
                before = std::mem::replace(&mut now, next);
            }
            let mut row = vec![now.y.iter().chain(&now.yd).copied().collect::<Vec<f64>>()];
            for (k, older) in last.iter().enumerate() {
                let ratio = (n as f64 / (2 * (column - k)) as f64).powi(2);
                let better = row[k].iter().zip(older).map(|(x, y)| x + (x - y) / (ratio - 1.0));
                row.push(better.collect());
            }
            if column > 0 {
                let [a, b] = [&row[column], &row[column - 1]];
                let off: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
                error = size(&off) / size(a).max(1e-3);
            }
            let n_y = from.y.len();
            end = At { q: now.q, y: row[column][..n_y].to_vec(), yd: row[column][n_y..].to_vec() };
            last = row;
            if error < 1e-13 {
                break;
            }
        }
        self.accelerations(&mut end)?;
        Some((end, least, error))
    }
}

impl Judge<'_> {
    /// Simulates from a state for a short time with inputs and springs between links.
    pub(super) fn simulated(&self, compiled: &Compiled, seeded: &mut Seeded, ledger: &mut Ledger) {
        let model = self.model;
        let oracle = &self.oracle;
        let length = self.drawn.length;
        if model.independent_names().is_empty() || self.has_quaternions() {
            return ledger.count("no simulation");
        }
        let joint = |name: &String| self.of.joints.iter().position(|joint| joint.name == *name);
        let places: Vec<usize> = model.independent_names().iter().filter_map(joint).collect();
        let unit = |j: usize| {
            if self.of.joints[j].kind == JointKind::Prismatic { length } else { 1.0 }
        };
        let y: Vec<f64> = places
            .iter()
            .map(|j| 0.5 * seeded.within(-1.0, 1.0) * self.drawn.reach[*j] * unit(*j))
            .collect();
        let yd: Vec<f64> = places.iter().map(|j| seeded.within(-1.0, 1.0) * unit(*j)).collect();
        let zero: Vec<f64> = oracle.zero();
        let targets: Vec<(usize, f64)> =
            oracle.independent_q().into_iter().zip(y.iter().copied()).collect();
        let Some((q, pivot)) = self.path(&zero, &targets, super::COARSE) else {
            return ledger.count("no start");
        };
        // of a start that the library reaches in the same assembly
        let Some(asked) = self.ask(Request::Kinematics, None, &[(Y, &y)], &[Q], &[]) else {
            return;
        };
        let (q_names, v_names) = oracle.names();
        let place = |names: &[String], name: &String| names.iter().position(|x| x == name);
        let same = model.tree_q_names().iter().zip(asked.get(Q)).all(|(name, x)| {
            place(&q_names, name).is_some_and(|i| (q[i] - x).abs() < 1e-3 * x.abs().max(1.0))
        });
        if !asked.ok() || !same || pivot < REGULAR {
            return ledger.count("no regular start");
        }

        // forces of the size of gravity's, springs between links
        let masses: Vec<f64> =
            self.of.links.iter().filter_map(|link| Some(link.inertial?.mass)).collect();
        let mass = masses.iter().sum::<f64>() / masses.len().max(1) as f64;
        let weight = 5.0 * mass;
        let mut inputs = Vec::new();
        let mut drives = Vec::new();
        for space in [Space::Independent, Space::Actuator] {
            let names = match space {
                Space::Independent => model.independent_names(),
                Space::Actuator => model.active_names(),
            };
            if names.is_empty() || seeded.chance(0.4) {
                continue;
            }
            let units: Vec<f64> = names.iter().filter_map(joint).map(unit).collect();
            let mut list = |most: f64, power: i32| -> Vec<f64> {
                units.iter().map(|u| seeded.within(-1.0, 1.0) * most * u.powi(power)).collect()
            };
            let force = weight * length;
            let source = if list(1.0, 0)[0] < 0.0 {
                Source::Constant(list(force, -1))
            } else {
                Source::Gains {
                    stiffness: list(2.0 * force, -2).iter().map(|x| x.abs()).collect(),
                    damping: list(0.3 * force, -2).iter().map(|x| x.abs()).collect(),
                    target: list(1.0, 1),
                }
            };
            for (k, name) in names.iter().enumerate() {
                let Some(v) = place(&v_names, name) else { continue };
                drives.push((
                    v,
                    match &source {
                        Source::Gains { stiffness, damping, target } => {
                            Drive::Gains(stiffness[k], damping[k], target[k])
                        }
                        Source::Constant(forces) => Drive::Force(forces[k]),
                        _ => continue,
                    },
                ));
            }
            inputs.push(Input { space, source });
        }
        let mut springs = Vec::new();
        let mut ends = Vec::new();
        for _ in 0..seeded.below(3) {
            let links = model.link_names();
            let [a, b] = [(); 2].map(|()| seeded.below(links.len()));
            if a == b {
                continue;
            }
            let point =
                |seeded: &mut Seeded, link: usize| Point { link, at: seeded.vector(length) };
            let [from, to] = [a, b].map(|link| point(seeded, link));
            springs.push(Spring {
                from,
                to,
                stiffness: seeded.within(0.0, 4.0) * weight / length,
                damping: seeded.within(0.0, 0.5) * weight / length,
                rest: seeded.within(0.0, 2.0) * length,
            });
            let own = |link: usize| {
                self.of.links.iter().position(|of| of.name == links[link]).unwrap_or(0)
            };
            ends.push([own(a), own(b)]);
        }

        let equations = Equations { judge: self, springs: springs.clone(), ends, inputs: drives };
        let mut at = At { q, y: y.clone(), yd: yd.clone() };
        let mut visited = vec![at.clone()];
        for _ in 0..PIECES {
            let Some((next, pivot, error)) = equations.piece(&at, LONG / PIECES as f64) else {
                return ledger.count("no reference");
            };
            if error > SURE || pivot < REGULAR {
                return ledger.count("no sure reference");
            }
            at = next;
            visited.push(at.clone());
        }

        let setup =
            Setup { description: self.description, compiled, springs: &springs, inputs: &inputs };
        let start = Start::Independent { y, yd, guess: None };
        for method in [Method::Dop853, Method::Radau5, Method::Projection] {
            // steps of a fixed length cost the most
            if method == Method::Projection && !seeded.chance(0.2) {
                continue;
            }
            let tight = Settings {
                rtol: 1e-10,
                atol: 1e-10 * length.min(1.0),
                ..Settings::new(method, LONG)
            };
            let settings = match method {
                Method::Projection => Settings { step: Some(LONG / 512.0), ..tight },
                _ => Settings { every: Some(LONG / PIECES as f64), ..tight },
            };
            let run = match simulate(&setup, &start, &settings, &mut |_| ()) {
                Ok(run) => run,
                Err(error) => {
                    let words = error.to_string();
                    return self.report(ledger, &format!("{}: {words}", method.name()), 1.0);
                }
            };
            ledger.count(&format!("{}: {}", method.name(), run.end.name()));
            if !run.end.is_finished() {
                ledger.refused.push(format!(
                    "{}, {}: {}: {} ends by {} on a regular way",
                    self.pair,
                    self.seed,
                    self.drawn.name,
                    method.name(),
                    run.end.name()
                ));
                continue;
            }
            let Some(last) = run.last() else { continue };
            ledger.answers += 1;
            let error = |a: &[f64], b: &[f64]| {
                let off = a.iter().zip(b).zip(&places).map(|((a, b), j)| (a - b) / unit(*j));
                let all = b.iter().zip(&places).map(|(b, j)| b / unit(*j));
                size(&off.collect::<Vec<_>>()) / size(&all.collect::<Vec<_>>()).max(0.1)
            };
            let [of_y, of_yd] = [error(&last.y, &at.y), error(&last.yd, &at.yd)];
            // Radau's order is five, and roundings of near rows grow
            let allowed = if method == Method::Dop853 { RIGHT } else { 10.0 * RIGHT };
            if of_y.is_nan() || of_yd.is_nan() || of_y.max(of_yd) >= allowed {
                let events: Vec<&EventKind> = run.events.iter().map(|event| &event.kind).collect();
                let what = format!("{} {events:?}", method.name());
                self.report(ledger, &what, of_y.max(of_yd));
            }
            self.limits_of(&run, &visited, ledger);
        }
    }

    /// Limits that the run says to exceed are those of the reference at the samples.
    fn limits_of(&self, run: &sarrus_simulation::Run, visited: &[At], ledger: &mut Ledger) {
        let info = self.model.info();
        let told = run.exceeded(info);
        let (q_names, _) = self.oracle.names();
        for name in self.model.tree_names() {
            let Some(joint) = self.of.joints.iter().find(|joint: &&Joint| joint.name == *name)
            else {
                continue;
            };
            let (Some(limit), Some(i)) = (joint.limits, q_names.iter().position(|x| x == name))
            else {
                continue;
            };
            let by = visited
                .iter()
                .map(|at| (limit.lower - at.q[i]).max(at.q[i] - limit.upper))
                .fold(f64::NEG_INFINITY, f64::max);
            let says = told.iter().any(|of| of.name == *name && of.what == "position");
            // between two samples it may turn back
            if by > 1e-5 && !says || by < -0.5 && says {
                self.report(ledger, &format!("limit of {name}: told {says}"), by);
            }
        }
    }
}
