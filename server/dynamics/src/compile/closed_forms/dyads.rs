//! Reads plane loops of pins as driven links and pairs of links, with any pin cut.

use nalgebra::Vector3;

use crate::closure::{Driven, Dyads, Pair, Pin, Point, Step};
use crate::compile::closed_forms::loops::pin_in_plane;
use crate::compile::closed_forms::planar::{DEGENERATE, Plane, minus, outer, size, two_links};
use crate::compile::closed_forms::{Deviation, Reading, Subject, sign};
use crate::compile::geometry::{axis, norm, onto_z};
use crate::mechanism::Motion;
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// A pin between two links; `joint`: its local joint, none of a cut.
struct Edge {
    joint: Option<usize>,
    links: [usize; 2],
    point: Plane,
}

impl Edge {
    /// The link on the other side of one of its two.
    fn beyond(&self, link: usize) -> Option<usize> {
        let [a, b] = self.links;
        (a == link).then_some(b).or((b == link).then_some(a))
    }
}

/// The chain of links.
struct Chain {
    edges: Vec<Edge>,
    /// Edges that are taken; of each link its anchor, once it is closed.
    taken: Vec<bool>,
    anchor: Vec<Option<Plane>>,
}

/// The links that independent joints drive, then pairs of the others on these.
pub(super) fn read(of: &Reading<'_>) -> Result<(Dyads<Dd>, Vec<Deviation>), String> {
    let cluster = of.cluster;
    let turns = of.bodies.iter().all(|body| body.motion == Motion::Revolute);
    if !of.is_simple() || !of.is_closed || !turns || !cluster.locked.is_empty() {
        return Err("joints are not single turns at rest at the zero pose".into());
    }
    let n = axis(&of.zero[1]);
    let axes = onto_z(&n);
    let plane = |v: &Vector3<Dd>| -> Plane { [axes.col(0).dot(*v), axes.col(1).dot(*v)] };
    let mut deviations: Vec<Deviation> = Vec::new();
    let mut edges = Vec::new();
    let mut senses = Vec::new();
    for (j, parent) in cluster.local_parent.iter().enumerate() {
        let pose = &of.zero[j + 1];
        let off = norm(&axis(pose).cross(n)).to_f64();
        deviations.push(("axis not parallel to the others".into(), Subject::Joint(j), off));
        senses.push(sign(axis(pose).dot(n)));
        edges.push(Edge { joint: Some(j), links: [*parent, j + 1], point: plane(&pose.p) });
    }
    for cut in &cluster.cuts {
        pin_in_plane(of, cut, &n, &mut deviations)?;
        let point = plane(&of.zero[cut.predecessor].point(&cut.x_p_cut.p));
        edges.push(Edge { joint: None, links: [cut.predecessor, cut.successor], point });
    }

    let mut chain =
        Chain { taken: vec![false; edges.len()], edges, anchor: vec![None; cluster.n + 1] };
    chain.anchor[0] = Some([Dd::ZERO; 2]);
    let mut steps = Vec::new();
    while chain.anchor.contains(&None) {
        let step = chain
            .driven(&cluster.independent, &senses)
            .or_else(|| chain.pair(&cluster.independent, DEGENERATE * cluster.length));
        steps.push(step.ok_or("links are not driven ones and pairs")?);
    }
    if chain.taken.contains(&false) {
        return Err("a link is held twice".into());
    }
    let pin = |v: &usize| Pin { joint: *v, links: chain.edges[*v].links, sense: senses[*v] };
    let places = |joints: &[usize]| joints.iter().map(|j| (*j, *j)).collect();
    let dyads = Dyads {
        steps,
        others: cluster.dependent.iter().map(pin).collect(),
        found: places(&cluster.dependent),
        given: places(&cluster.independent),
    };
    Ok((dyads, deviations))
}

impl Chain {
    /// A point of a closed link from its anchor.
    fn point(&self, link: usize, at: &Plane) -> Option<Point<Dd>> {
        Some(Point { link, arm: minus(at, self.anchor[link].as_ref()?) })
    }

    /// Takes a link that an independent joint drives.
    fn driven(&mut self, independent: &[usize], senses: &[Dd]) -> Option<Step<Dd>> {
        let (place, joint, from) = independent.iter().enumerate().find_map(|(place, j)| {
            let from =
                self.edges[*j].links.into_iter().find(|link| self.anchor[*link].is_some())?;
            (!self.taken[*j]).then_some((place, *j, from))
        })?;
        let Edge { links, point, .. } = &self.edges[joint];
        let to = self.edges[joint].beyond(from).filter(|to| self.anchor[*to].is_none())?;
        let forward = if links[0] == from { Dd::ONE } else { -Dd::ONE };
        let from = self.point(from, point)?;
        self.anchor[to] = Some(*point);
        self.taken[joint] = true;
        Some(Step::Driven(Driven { joint, place, from, to, sense: forward * senses[joint] }))
    }

    /// Takes two links that a pin ties, each with another pin on a closed link.
    fn pair(&mut self, independent: &[usize], short: f64) -> Option<Step<Dd>> {
        let is_open = |link: usize| self.anchor[link].is_none();
        let free: Vec<usize> = (0..self.edges.len())
            .filter(|e| !self.taken[*e])
            .filter(|e| self.edges[*e].joint.is_none_or(|j| !independent.contains(&j)))
            .collect();
        // the pin that ties a link to a closed one
        let held = |link: usize| {
            free.iter().find_map(|e| {
                let from = self.edges[*e].beyond(link)?;
                (!is_open(from)).then_some((*e, from))
            })
        };
        let (to, taken, from) = free.iter().find_map(|e| {
            let [b, c] = self.edges[*e].links;
            let (at_a, from_a) = held(b)?;
            let (at_b, from_b) = held(c)?;
            (is_open(b) && is_open(c)).then_some(([b, c], [at_a, at_b, *e], [from_a, from_b]))
        })?;
        let [A, B, C] = taken.map(|e| self.edges[e].point);
        let b = minus(&C, &A);
        let c = minus(&C, &B);
        if size(&b) < short || size(&c) < short {
            return None;
        }
        let links = two_links(b, c, sign(outer(&b, &c)));
        let from = [self.point(from[0], &A)?, self.point(from[1], &B)?];
        self.anchor[to[0]] = Some(A);
        self.anchor[to[1]] = Some(B);
        taken.into_iter().for_each(|e| self.taken[e] = true);
        Some(Step::Pair(Pair { from, to, links }))
    }
}
