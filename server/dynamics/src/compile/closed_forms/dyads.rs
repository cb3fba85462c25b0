//! Reads plane loops as driven links and pairs of links, with any pin cut.

use nalgebra::Vector3;

use crate::closure::{
    Driven, DrivenSlide, Dyads, Joints, Pair, Pin, Point, Slider, SlidingPair, Step,
};
use crate::compile::closed_forms::loops::pin_in_plane;
use crate::compile::closed_forms::planar::{
    DEGENERATE, Plane, inner, minus, outer, size, two_links,
};
use crate::compile::closed_forms::{Deviation, Reading, sign};
use crate::compile::geometry::{axis, norm, onto_z};
use crate::mechanism::Motion;
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Matrix;

/// A joint between two links; `joint`: its local joint, none of a cut.
struct Edge {
    joint: Option<usize>,
    links: [usize; 2],
    point: Plane,
    /// Of a slider: the way of the second link for a unit of the coordinate.
    guide: Option<Plane>,
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
    if !of.is_simple() || !of.is_closed || !cluster.locked.is_empty() {
        return Err("joints are not single ones at rest at the zero pose".into());
    }
    let turns = |j: &usize| of.bodies[*j].motion == Motion::Revolute;
    let first = (0..cluster.n).find(turns).ok_or("loop has no axis")?;
    let n = axis(&of.zero[first + 1]);
    let axes = onto_z(&n);
    let plane = |v: &Vector3<Dd>| -> Plane { [axes.col(0).dot(*v), axes.col(1).dot(*v)] };
    let mut deviations: Vec<Deviation> = Vec::new();
    let mut edges = Vec::new();
    let mut senses = Vec::new();
    for (j, parent) in cluster.local_parent.iter().enumerate() {
        let pose = &of.zero[j + 1];
        let along = axis(pose);
        let (what, off, guide) = match turns(&j) {
            true => ("axis not parallel to the others", norm(&along.cross(n)), None),
            false => ("slider not in the plane, axis", along.dot(n).abs(), Some(plane(&along))),
        };
        deviations.push((what, Some(j), off.to_f64()));
        senses.push(sign(along.dot(n)));
        edges.push(Edge { joint: Some(j), links: [*parent, j + 1], point: plane(&pose.p), guide });
    }
    for cut in &cluster.cuts {
        pin_in_plane(of, cut, &n, &mut deviations)?;
        let point = plane(&of.zero[cut.predecessor].point(&cut.x_p_cut.p));
        let links = [cut.predecessor, cut.successor];
        edges.push(Edge { joint: None, links, point, guide: None });
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
    let places = |joints: &[usize]| joints.iter().filter(|j| turns(j)).map(|j| (*j, *j)).collect();
    let dyads = Dyads {
        steps,
        others: cluster.dependent.iter().filter(|j| turns(j)).map(pin).collect(),
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
        let Edge { links, point, guide, .. } = &self.edges[joint];
        let to = self.edges[joint].beyond(from).filter(|to| self.anchor[*to].is_none())?;
        let forward = if links[0] == from { Dd::ONE } else { -Dd::ONE };
        let from = self.point(from, point)?;
        self.anchor[to] = Some(*point);
        self.taken[joint] = true;
        if let Some(guide) = guide {
            let guide = guide.map(|x| forward * x);
            return Some(Step::DrivenSlide(DrivenSlide { joint, place, from, to, guide }));
        }
        Some(Step::Driven(Driven { joint, place, from, to, sense: forward * senses[joint] }))
    }

    /// Takes two links that a joint ties, each with another joint on a closed link.
    fn pair(&mut self, independent: &[usize], short: f64) -> Option<Step<Dd>> {
        let is_open = |link: usize| self.anchor[link].is_none();
        let free: Vec<usize> = (0..self.edges.len())
            .filter(|e| !self.taken[*e])
            .filter(|e| self.edges[*e].joint.is_none_or(|j| !independent.contains(&j)))
            .collect();
        // the joint that ties a link to a closed one
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
        let step = if taken.iter().all(|e| self.edges[*e].guide.is_none()) {
            self.pins(from, to, taken, short)?
        } else {
            let mirrored = |[x, y]: [usize; 2]| [y, x];
            self.sliders(from, to, taken, short).or_else(|| {
                let [a, b, c] = taken;
                self.sliders(mirrored(from), mirrored(to), [b, a, c], short)
            })?
        };
        taken.into_iter().for_each(|e| self.taken[e] = true);
        Some(step)
    }

    /// Pins A, B on closed links, and C.
    fn pins(
        &mut self,
        from: [usize; 2],
        to: [usize; 2],
        edges: [usize; 3],
        short: f64,
    ) -> Option<Step<Dd>> {
        let [A, B, C] = edges.map(|e| self.edges[e].point);
        let b = minus(&C, &A);
        let c = minus(&C, &B);
        if size(&b) < short || size(&c) < short {
            return None;
        }
        let links = two_links(b, c, sign(outer(&b, &c)));
        let from = [self.point(from[0], &A)?, self.point(from[1], &B)?];
        self.anchor[to[0]] = Some(A);
        self.anchor[to[1]] = Some(B);
        Some(Step::Pair(Pair { from, to, links }))
    }

    /// The same with sliders; points and guides as [`SlidingPair`] has them, all points of sliders
    /// at that of a pin, so that their ways are zero at zero.
    fn sliders(
        &mut self,
        from: [usize; 2],
        to: [usize; 2],
        edges: [usize; 3],
        short: f64,
    ) -> Option<Step<Dd>> {
        let [a, b, c] = edges.map(|e| &self.edges[e]);
        let none = [Dd::ZERO; 2];
        let mut arm = none;
        let [mut offset, mut side] = [Dd::ZERO, Dd::ONE];
        let mut zero = Dd::ZERO;
        // each slider with its σ, and the link against which that counts
        let (joints, points, guides, sliders, least) = match (a.guide, c.guide, b.guide) {
            (None, None, Some(g)) => {
                arm = minus(&c.point, &a.point);
                side = sign(inner(&g, &arm));
                let points = [a.point, c.point];
                (Joints::Rrp, points, [g; 2], vec![(b, 1, from[1])], inner(&g, &arm))
            }
            (None, Some(g), None) => {
                let w = minus(&b.point, &a.point);
                zero = inner(&g, &w);
                offset = outer(&g, &w);
                side = sign(zero);
                (Joints::Rpr, [a.point, b.point], [g; 2], vec![(c, 1, to[0])], zero)
            }
            (Some(g), None, Some(h)) => {
                let sliders = vec![(a, 0, from[0]), (b, 1, from[1])];
                let turned = outer(&g, &h) * Dd::from_f64(short / DEGENERATE);
                (Joints::Prp, [c.point; 2], [g, h], sliders, turned)
            }
            (Some(g), Some(h), None) => {
                let sliders = vec![(a, 0, from[0]), (c, 1, to[0])];
                let turned = outer(&g, &h) * Dd::from_f64(short / DEGENERATE);
                (Joints::Ppr, [b.point; 2], [g, h], sliders, turned)
            }
            _ => return None,
        };
        if least.abs().to_f64() < short {
            return None;
        }
        let slider = |(edge, sigma, against): (&Edge, usize, usize)| {
            let sense = if edge.links[0] == against { Dd::ONE } else { -Dd::ONE };
            edge.joint.map(|joint| Slider { joint, sigma, sense, zero })
        };
        let sliders = sliders.into_iter().filter_map(slider).collect();
        let from = [self.point(from[0], &points[0])?, self.point(from[1], &points[1])?];
        let anchors = if joints == Joints::Rrp { [points[0], c.point] } else { points };
        for (link, anchor) in to.into_iter().zip(anchors) {
            self.anchor[link] = Some(anchor);
        }
        let pair = SlidingPair { joints, from, to, guides, arm, offset, side, sliders };
        Some(Step::SlidingPair(pair))
    }
}
