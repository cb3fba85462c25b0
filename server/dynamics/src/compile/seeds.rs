//! Tabulates the closed poses of numerical closures of few independents around the zero pose.
//!
//! The range of each independent is that of its limits, or a bounded one, as far as the loops close
//! regularly while the others stay at zero. Each node is reached from a neighbour, from the zero
//! pose outwards; a cell is used if it passes the checks that [`Seeds`](crate::closure::Seeds)
//! states.

mod form;
mod grid;

use core::f64::consts::PI;
use std::sync::Arc;

use crate::closure::{
    Axis, Closure, Formed, LANES, Level, MOST, Numerical, Seeds, column_unit, distance,
};
use crate::compile::seeds::form::AGREES;
use crate::compile::seeds::grid::{Grid, center};
use crate::mechanism::{Cluster, Motion};
use crate::model::Model;
use crate::workspace::{Needs, Workspace};

/// Bounds of one robot's tables: bytes, nodes in total, and most and least nodes along one
/// independent by the number of independents.
const BYTES: usize = 256 << 10;
const NODES: usize = 2048;
/// Dependents of all nodes of a table together: loading closes the loops at each node. Where a form
/// has them by itself, and memory sets no bound, twice as many.
const WORK: usize = 17_000;
const ALONG: [usize; MOST] = [129, 41, 12];
const LEAST_ALONG: usize = 4;
/// Longest travel of a sliding independent without limits, in cluster lengths.
const SLIDE: f64 = 2.0;
/// Steps over the range of an independent.
const STEPS: usize = 32;
/// Substeps between neighbours where one step is refused.
const SUBSTEPS: usize = 4;
/// Least sine of the distance to a singular pose, within the range.
const REGULAR: f64 = 0.05;
/// Largest error of a seed, in radians or cluster lengths, and relative to the distance to the
/// nearest singular pose.
const ERROR: f64 = 2e-3;
const CLEAR: f64 = 0.02;

/// A table of a cluster.
pub(super) struct Found {
    pub(super) cluster: usize,
    pub(super) seeds: Arc<Seeds>,
    /// The cluster's closed form, if it holds in every used cell.
    pub(super) form: Option<Box<Formed<f64>>>,
}

/// The tables of all clusters that can have one. Allocates.
pub(super) fn find(model: &Model<f64>) -> Vec<Found> {
    let mut chosen: Vec<(usize, &Numerical<f64>)> = Vec::new();
    for &c in &model.closed_clusters {
        let cluster = &model.clusters[c];
        let single = cluster.dofs.iter().all(|dof| dof.single);
        if let Closure::Numerical(numerical) = &model.closures[c]
            && single
            && !numerical.meets
            && (1..=MOST).contains(&cluster.n_vy)
            && !cluster.dependent.is_empty()
        {
            chosen.push((c, numerical));
        }
    }
    let mut ws = Workspace::sized(model, Needs::default());
    let mut found: Vec<Found> = Vec::new();
    for &(c, numerical) in &chosen {
        let form = numerical.form.clone();
        let mut table = Table { model, c, numerical, ws: &mut ws, signs: Vec::new(), form };
        let tables = chosen.len();
        let mut whole = table.seeds(tables);
        // where a form does not hold, what it would leave out has to be in the table
        if table.tabled().is_some() && whole.as_ref().is_none_or(|(_, form)| form.is_none()) {
            table.form = None;
            whole = table.seeds(tables);
        }
        if let Some((seeds, form)) = whole {
            // equal limbs share one
            let equal = found.iter().find(|other| *other.seeds == seeds);
            let seeds = equal.map_or_else(|| Arc::new(seeds), |other| other.seeds.clone());
            found.push(Found { cluster: c, seeds, form });
        }
    }
    found
}

/// A table under way.
struct Table<'a> {
    model: &'a Model<f64>,
    c: usize,
    numerical: &'a Numerical<f64>,
    ws: &'a mut Workspace<f64>,
    signs: Vec<f64>,
    /// The closed form to be compared.
    form: Option<Box<Formed<f64>>>,
}

/// A closed pose: local coordinates, G, and 1/sin² of the distance to a singular pose.
#[derive(Clone)]
struct Node {
    q: Vec<f64>,
    G: Vec<f64>,
    gain: f64,
}

impl Table<'_> {
    fn cluster(&self) -> &Cluster<f64> {
        &self.model.clusters[self.c]
    }

    /// The dependents that a form asks for, where it does not leave all in the table.
    fn tabled(&self) -> Option<Vec<usize>> {
        Some(self.form.as_ref()?.tabled()?.iter().map(|dof| dof.v).collect())
    }

    /// The seed of the independents in `q`, with all dependents; false where there is none.
    fn seed(&mut self, seeds: &Seeds, zero: &[f64], q: &mut [f64]) -> bool {
        let cluster = &self.model.clusters[self.c];
        let at = cluster.coordinates();
        let mut found = seeds.find(zero, q);
        if let Some(form) = &self.form {
            self.ws.q[at.clone()].copy_from_slice(q);
            self.ws.start[at.clone()].copy_from_slice(zero);
            let bodies = self.model.bodies_of(cluster);
            found &= form.complete(&mut self.ws.local(cluster, bodies));
            q.copy_from_slice(&self.ws.q[at]);
        }
        found
    }

    /// The table, and the closed form that holds in it.
    fn seeds(&mut self, tables: usize) -> Option<(Seeds, Option<Box<Formed<f64>>>)> {
        let model = self.model;
        let c = self.c;
        let cluster = &model.clusters[c];
        let n = cluster.n_vy;
        let tabled = self.tabled().unwrap_or_else(|| cluster.dependent.clone());
        let columns: Vec<usize> = tabled.iter().map(|v| cluster.dofs[*v].q).collect();
        let stride = columns.len().next_multiple_of(LANES);

        // the zero pose and its signs
        let zero = model.zero[cluster.coordinates()].to_vec();
        self.ws.q[cluster.coordinates()].copy_from_slice(&zero);
        self.ws.start[cluster.coordinates()].copy_from_slice(&zero);
        let bodies = model.bodies_of(cluster);
        self.numerical.determinants(&mut self.ws.local(cluster, bodies));
        self.signs = self.ws.scratch.branch[..self.numerical.choices[0].blocks.len()]
            .iter()
            .map(|det| det.signum())
            .collect();
        let origin = self.step(&zero, &zero)?;
        if !self.is_regular(&origin) {
            return None;
        }

        // nodes along each independent
        let of_table = (BYTES / tables / (stride * size_of::<f32>()).max(1)) >> n;
        let work = if self.exact().is_some() { 2 * WORK } else { WORK };
        let of_table = of_table.min(NODES / tables).min(work / cluster.dependent.len());
        let along = (1..=ALONG[n - 1]).rev().find(|along| along.pow(n as u32) <= of_table)?;
        if along < LEAST_ALONG {
            return None;
        }
        let axes = (0..n).map(|k| self.axis(k, along, &origin)).collect::<Option<Vec<_>>>()?;
        let nodes = self.nodes(&axes, origin);
        let mut seeds = Seeds {
            values: values(cluster, &zero, &tabled, &axes, &nodes),
            cells: vec![true; axes.iter().map(|axis| axis.nodes - 1).product()],
            axes,
            columns,
            signs: self.signs.clone(),
        };
        let cells = self.cells(&seeds, &zero, &nodes);
        let any = cells.contains(&true);
        seeds.cells = cells;
        if !any {
            return None;
        }
        let form = self.form(&seeds, &zero, &nodes);
        Some((seeds, form))
    }

    /// The nodes along independent k.
    fn axis(&mut self, k: usize, along: usize, origin: &Node) -> Option<Axis> {
        let cluster = self.cluster();
        let dof = cluster.dofs[cluster.independent[k]];
        let widest = if dof.motion == Motion::Revolute { PI } else { SLIDE * cluster.length };
        let limit = self.model.limits.iter().find(|limit| limit.q == cluster.q + dof.q);
        let zero = origin.q[dof.q];
        let (lower, upper) = limit.map_or((-widest, widest), |limit| {
            ((limit.lower - zero).max(-widest), (limit.upper - zero).min(widest))
        });
        let (below, above) =
            (-self.reach(dof.q, lower.min(0.0), origin), self.reach(dof.q, upper.max(0.0), origin));
        let intervals = (along - 1) as f64;
        let nodes_below = (intervals * below / (below + above)).round();
        let nodes_above = intervals - nodes_below;
        let step = |range: f64, nodes: f64| if nodes > 0.0 { range / nodes } else { f64::INFINITY };
        let step = step(below, nodes_below).min(step(above, nodes_above));
        let axis = Axis { coordinate: dof.q, nodes: along, below: nodes_below as usize, step };
        (step > 0.0 && step.is_finite()).then_some(axis)
    }

    /// How far towards this the loops close regularly along one coordinate.
    fn reach(&mut self, coordinate: usize, to: f64, origin: &Node) -> f64 {
        let mut at = origin.q.clone();
        for i in 1..=STEPS {
            let mut goal = at.clone();
            goal[coordinate] = origin.q[coordinate] + to * i as f64 / STEPS as f64;
            match self.step(&at, &goal) {
                Some(node) if self.is_regular(&node) => at = node.q,
                _ => break,
            }
        }
        at[coordinate] - origin.q[coordinate]
    }

    /// The form, where it has all dependents by itself, so that nothing is interpolated.
    fn exact(&self) -> Option<&Formed<f64>> {
        self.form.as_deref().filter(|form| form.tabled().is_some_and(<[_]>::is_empty))
    }

    fn is_regular(&self, node: &Node) -> bool {
        node.gain < self.exact().map_or(REGULAR.powi(-2), Formed::most_gain)
    }

    /// The closed pose at the independents of `goal`, by attempts along the straight path from
    /// another one.
    fn step(&mut self, from: &[f64], goal: &[f64]) -> Option<Node> {
        self.steps(from, goal, 1).or_else(|| self.steps(from, goal, SUBSTEPS))
    }

    fn steps(&mut self, from: &[f64], goal: &[f64], steps: usize) -> Option<Node> {
        let model = self.model;
        let numerical = self.numerical;
        let c = self.c;
        let cluster = &model.clusters[c];
        let bodies = model.bodies_of(cluster);
        let at = cluster.coordinates();
        self.ws.start[at.clone()].copy_from_slice(from);
        let mut outcome = None;
        for k in 1..=steps {
            let start = &self.ws.start[at.clone()];
            let q = &mut self.ws.q[at.clone()];
            q.copy_from_slice(start);
            for &i in &cluster.independent_q {
                q[i] = from[i] + (goal[i] - from[i]) * k as f64 / steps as f64;
            }
            let moved = distance(cluster, start, q);
            for (branch, sign) in self.ws.scratch.branch.iter_mut().zip(&self.signs) {
                *branch = *sign;
            }
            let mut local = self.ws.local(cluster, bodies);
            outcome = Some(numerical.attempt(&mut local, moved)?);
            self.ws.start[at.clone()].copy_from_slice(&self.ws.q[at.clone()]);
        }
        let mut local = self.ws.local(cluster, bodies);
        let ended = numerical.differentiate(&mut local, Level::Velocity, outcome?);
        (ended.status == sarrus_proto::Status::Ok).then(|| Node {
            q: self.ws.q[at].to_vec(),
            G: self.ws.G[cluster.block()].to_vec(),
            gain: ended.gain,
        })
    }

    /// The closed pose of each node that is reached from the one before it.
    fn nodes(&mut self, axes: &[Axis], origin: Node) -> Vec<Option<Node>> {
        let grid = Grid::of_nodes(axes);
        let zero = origin.q.clone();
        let mut nodes: Vec<Option<Node>> = vec![None; grid.len()];
        nodes[grid.number(&grid.below)] = Some(origin);
        for number in grid.outwards() {
            let place = grid.place(number);
            let mut inner = (0..axes.len()).filter_map(|a| grid.inwards(&place, a));
            let Some(from) = inner.find_map(|inner| nodes[inner].as_ref().map(|x| x.q.clone()))
            else {
                continue;
            };
            let mut goal = from.clone();
            for (axis, i) in axes.iter().zip(&place) {
                goal[axis.coordinate] =
                    zero[axis.coordinate] + (*i as f64 - axis.below as f64) * axis.step;
            }
            let node = self.step(&from, &goal);
            nodes[number] = node.filter(|node| self.is_regular(node));
        }
        nodes
    }

    /// Which cells are used.
    fn cells(&mut self, seeds: &Seeds, zero: &[f64], nodes: &[Option<Node>]) -> Vec<bool> {
        let axes = &seeds.axes;
        let grid = Grid::of_cells(axes);
        let corners = Grid::of_nodes(axes);
        let places: Vec<Vec<usize>> = (0..grid.len()).map(|number| grid.place(number)).collect();
        let mut is_sound = |place: &Vec<usize>| {
            let around = corners.corners(place).map(|corner| nodes[corner].as_ref());
            let around: Option<Vec<&Node>> = around.collect();
            around.is_some_and(|around| self.is_smooth(seeds, zero, place, &around))
        };
        let sound: Vec<bool> = places.iter().map(&mut is_sound).collect();
        let unsound = places.iter().zip(&sound).filter(|(_, sound)| !**sound);
        let unsound: Vec<&Vec<usize>> = unsound.map(|(place, _)| place).collect();
        let is_used = |place: &Vec<usize>| !unsound.iter().any(|cell| grid.crosses(place, cell));
        places.iter().zip(sound).map(|(place, sound)| sound && is_used(place)).collect()
    }

    /// True where the closed pose at the center of a cell is where the interpolation has it.
    fn is_smooth(
        &mut self,
        seeds: &Seeds,
        zero: &[f64],
        place: &[usize],
        around: &[&Node],
    ) -> bool {
        let mut q = center(&seeds.axes, zero, place);
        if !self.seed(seeds, zero, &mut q) {
            return false;
        }
        let Some(center) = self.step(&around[0].q, &q) else { return false };
        let gain = around.iter().fold(center.gain, |gain, node| gain.max(node.gain));
        let cluster = self.cluster();
        let error = cluster.dependent.iter().fold(0.0_f64, |error, v| {
            let i = cluster.dofs[*v].q;
            error.max((q[i] - center.q[i]).abs() / column_unit(cluster, *v))
        });
        let most = if self.exact().is_some() { AGREES } else { ERROR };
        error < most && error * error * gain < CLEAR * CLEAR
    }
}

/// The numbers of a table; where a node is missing they are zero.
fn values(
    cluster: &Cluster<f64>,
    zero: &[f64],
    tabled: &[usize],
    axes: &[Axis],
    nodes: &[Option<Node>],
) -> Vec<f32> {
    let grid = Grid::of_nodes(axes);
    let n = axes.len();
    let m = tabled.len();
    let stride = m.next_multiple_of(LANES);
    let at = |number: usize, d: usize, a: usize| {
        (((number * stride + a / LANES * LANES) << n) + d * LANES) + a % LANES
    };
    let mut values = vec![0.0; (grid.len() * stride) << n];
    for (number, node) in nodes.iter().enumerate() {
        let Some(node) = node else { continue };
        for (a, v) in tabled.iter().enumerate() {
            let i = cluster.dofs[*v].q;
            values[at(number, 0, a)] = node.q[i] - zero[i];
            for (k, axis) in axes.iter().enumerate() {
                values[at(number, 1 << k, a)] = node.G[v * n + k] * axis.step;
            }
        }
    }
    // mixed derivatives: differences along their last axis
    for d in (0..1_usize << n).filter(|d| d.count_ones() > 1) {
        let last = d.ilog2() as usize;
        for number in 0..grid.len() {
            let place = grid.place(number);
            let beside = |up: bool| {
                let to = if up { place[last] + 1 } else { place[last].checked_sub(1)? };
                let mut place = place.clone();
                place[last] = to;
                (to < axes[last].nodes).then(|| grid.number(&place))
            };
            let reached = |up: bool| beside(up).filter(|x| nodes[*x].is_some());
            let below = reached(false);
            let above = reached(true);
            let span = usize::from(below.is_some()) + usize::from(above.is_some());
            if span == 0 || nodes[number].is_none() {
                continue;
            }
            let below = below.unwrap_or(number);
            let above = above.unwrap_or(number);
            let inner = d ^ 1 << last;
            for a in 0..m {
                values[at(number, d, a)] =
                    (values[at(above, inner, a)] - values[at(below, inner, a)]) / span as f64;
            }
        }
    }
    values.into_iter().map(|x| x as f32).collect()
}
