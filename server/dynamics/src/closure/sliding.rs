//! Sliders in a plane: a link that an independent one drives, and the two links of a pair of which
//! one joint slides or two do.
//!
//! ```text
//!   RRP   A + R(θ) r = B + x g           the guide g on the body of B      σ = θ, x
//!   RPR   A + R(φ) (o n + x g) = B       the guide turns with both links   σ = φ, x
//!   PRP   A + x₁ g₁ = B + x₂ g₂          guides on the bodies of A and B   σ = x₁, x₂
//!   PPR   A + x₁ g₁ + x₂ g₂ = B          both on the body of A             σ = x₁, x₂
//! ```
//! n = J g. The rates of σ solve c₁ σ̇₁ + c₂ σ̇₂ = ρ, with ρ the velocity of the right side less
//! that of the left at σ̇ = 0; their accelerations the same with the accelerations at σ̈ = 0.

use crate::closure::plane::{Plane, PlaneLink, Point, add, cross, dot, right};
use crate::closure::{Level, Local, Validity};
use crate::scalar::{Real, constants};

/// A link that an independent slider moves along one before it.
#[derive(Clone, Debug)]
pub(crate) struct DrivenSlide<T> {
    /// Its local joint, and place in y.
    pub(crate) joint: usize,
    pub(crate) place: usize,
    /// The link's anchor at zero on the link before it.
    pub(crate) from: Point<T>,
    pub(crate) to: usize,
    /// The way of the link for a unit of the coordinate.
    pub(crate) guide: Plane<T>,
}

constants! { DrivenSlide:
    keep joint place to;
    map from guide;
}

/// The joints of a pair from the body of A over both links to that of B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Joints {
    Rrp,
    Rpr,
    Prp,
    Ppr,
}

/// Two links from A and from B.
#[derive(Clone, Debug)]
pub(crate) struct SlidingPair<T> {
    pub(crate) joints: Joints,
    pub(crate) from: [Point<T>; 2],
    pub(crate) to: [usize; 2],
    /// Directions of the guides at zero; of one slider the first.
    pub(crate) guides: [Plane<T>; 2],
    /// r of RRP, o of RPR.
    pub(crate) arm: Plane<T>,
    pub(crate) offset: T,
    /// ±1, the sign of a root.
    pub(crate) side: T,
    pub(crate) sliders: Vec<Slider<T>>,
}

constants! { SlidingPair:
    keep joints to;
    number offset side;
    map arm;
    each from guides sliders;
}

/// A slider of the tree: local joint, which σ it is, ±1 where its coordinate grows with that, and
/// the σ at zero.
#[derive(Clone, Debug)]
pub(crate) struct Slider<T> {
    pub(crate) joint: usize,
    pub(crate) sigma: usize,
    pub(crate) sense: T,
    pub(crate) zero: T,
}

constants! { Slider:
    keep joint sigma;
    number sense zero;
}

/// A pair at a pose: the columns c₁ and c₂, their determinant's inverse, and the links' anchors.
struct Closed<T> {
    columns: [Plane<T>; 2],
    inverse: T,
    sigma: [T; 2],
    turns: [(T, T); 2],
    anchors: [Plane<T>; 2],
    /// The guides as they are turned, the arm r.
    guides: [Plane<T>; 2],
    arm: Plane<T>,
}

impl<T: Real> Closed<T> {
    /// σ with c₁ σ₁ + c₂ σ₂ = x.
    #[inline(always)]
    fn solve(&self, x: &Plane<T>) -> [T; 2] {
        let [c1, c2] = &self.columns;
        [cross(x, c2) * self.inverse, cross(c1, x) * self.inverse]
    }
}

impl<T: Real> DrivenSlide<T> {
    /// The link slides on the one before it by the joint's coordinate.
    #[inline(never)]
    pub(super) fn close(&self, m: usize, local: &mut Local<'_, T>, level: Level) {
        let links = &mut local.scratch.plane;
        let from = links[self.from.link];
        let guide = from.arm(&self.guide);
        let arm = add(&guide, local.q[self.joint], &from.arm(&self.from.arm));
        let mut link = from;
        link.at = add(&arm, T::ONE, &from.at);
        if level > Level::Position {
            for k in 0..m {
                link.rate[k] = (from.rate[k].0, from.velocity(&arm, k));
                local.G[self.joint * m + k] = T::ZERO;
            }
            let of_own = &mut link.rate[self.place].1;
            *of_own = add(&guide, T::ONE, of_own);
            local.G[self.joint * m + self.place] = T::ONE;
            local.g[self.joint] = T::ZERO;
        }
        if level == Level::Acceleration {
            let twice = from.speed * local.qd[self.joint];
            link.bias.1 = add(&right(&guide), twice + twice, &from.acceleration(&arm));
        }
        links[self.to] = link;
    }
}

impl<T: Real> SlidingPair<T> {
    /// σ for the links before it.
    #[inline(always)]
    fn meet(&self, a: &PlaneLink<T>, b: &PlaneLink<T>) -> (Closed<T>, Validity<T>) {
        let A = add(&a.arm(&self.from[0].arm), T::ONE, &a.at);
        let B = add(&b.arm(&self.from[1].arm), T::ONE, &b.at);
        let w = add(&A, -T::ONE, &B);
        let of = |link: &PlaneLink<T>, k: usize| link.arm(&self.guides[k]);
        let one = |x: &Plane<T>| dot(x, x);
        match self.joints {
            Joints::Rrp => {
                let g = of(b, 0);
                let k = cross(&g, &w);
                let r_square = one(&self.arm);
                let square = r_square - k * k;
                let x = self.side.mul_add(square.sqrt(), -dot(&g, &w));
                let C = add(&g, x, &B);
                let arm = add(&A, -T::ONE, &C);
                let inverse_r = T::ONE / r_square;
                let turn = (dot(&self.arm, &arm) * inverse_r, cross(&self.arm, &arm) * inverse_r);
                let columns = [right(&arm), [-g[0], -g[1]]];
                let closed = Closed {
                    inverse: T::ONE / cross(&columns[0], &columns[1]),
                    columns,
                    sigma: [T::ZERO, x],
                    turns: [turn, b.turn],
                    anchors: [A, C],
                    guides: [g, g],
                    arm,
                };
                (closed, Validity::of(square, r_square))
            }
            Joints::Rpr => {
                let distance = one(&w);
                let x_square = distance - self.offset * self.offset;
                let x = self.side * x_square.sqrt();
                // o n + x g at zero onto w
                let g0 = self.guides[0];
                let at_zero = add(&right(&g0), self.offset, &[x * g0[0], x * g0[1]]);
                let inverse = T::ONE / distance;
                let turn = (dot(&at_zero, &w) * inverse, cross(&at_zero, &w) * inverse);
                let (c, s) = turn;
                let g = [c.mul_add(g0[0], -(s * g0[1])), s.mul_add(g0[0], c * g0[1])];
                let closed = Closed {
                    columns: [right(&w), g],
                    inverse: T::ONE / cross(&right(&w), &g),
                    sigma: [T::ZERO, x],
                    turns: [turn, turn],
                    anchors: [A, B],
                    guides: [g, g],
                    arm: w,
                };
                (closed, Validity::of(x_square, distance))
            }
            Joints::Prp | Joints::Ppr => {
                let is_cross = self.joints == Joints::Prp;
                let g1 = of(a, 0);
                let second = of(if is_cross { b } else { a }, 1);
                let g2 = if is_cross { [-second[0], -second[1]] } else { second };
                let det = cross(&g1, &g2);
                let inverse = T::ONE / det;
                let x1 = cross(&w, &g2) * inverse;
                let x2 = cross(&g1, &w) * inverse;
                let first = add(&g1, x1, &A);
                let end = if is_cross { first } else { B };
                let closed = Closed {
                    columns: [g1, g2],
                    inverse,
                    sigma: [x1, x2],
                    turns: [a.turn, if is_cross { b.turn } else { a.turn }],
                    anchors: [first, end],
                    guides: [g1, g2],
                    arm: w,
                };
                (closed, Validity::of(det * det, T::ONE))
            }
        }
    }

    /// Both links from A and B on the links before them.
    #[inline(never)]
    pub(super) fn close(
        &self,
        independent: &[usize],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Validity<T> {
        let m = independent.len();
        let ends = self.from.each_ref().map(|from| local.scratch.plane[from.link]);
        let (closed, validity) = self.meet(&ends[0], &ends[1]);
        let gain = T::ONE.larger(validity.gain) * ends[0].gain.larger(ends[1].gain);
        let mut to = [PlaneLink::at_rest(); 2];
        for (k, link) in to.iter_mut().enumerate() {
            (link.turn, link.at, link.gain) = (closed.turns[k], closed.anchors[k], gain);
        }
        for slider in &self.sliders {
            local.q[slider.joint] = slider.sense * (closed.sigma[slider.sigma] - slider.zero);
        }
        if level > Level::Position {
            let arms = self.arms(&closed, &ends);
            let mut speeds = [T::ZERO; 2];
            for (k, i) in independent.iter().enumerate() {
                let of = |e: usize, arm: usize| ends[e].velocity(&arms[arm], k);
                let v = [of(0, 0), of(1, 1), of(0, 2)];
                let sigma = closed.solve(&add(&v[0], -T::ONE, &v[1]));
                let moved = self.carried(&closed, ends.map(|end| end.rate[k].0), v, sigma);
                to.iter_mut().zip(moved).for_each(|(link, moved)| link.rate[k] = moved);
                for slider in &self.sliders {
                    local.G[slider.joint * m + k] = slider.sense * sigma[slider.sigma];
                }
                if level >= Level::Velocity {
                    speeds = [0, 1].map(|x: usize| sigma[x].mul_add(local.qd[*i], speeds[x]));
                }
            }
            let turns = ends.map(|end| end.speed);
            let moved = self.carried(&closed, turns, [[T::ZERO; 2]; 3], speeds);
            to.iter_mut().zip(moved).for_each(|(link, moved)| link.speed = moved.0);
            for slider in self.sliders.iter().filter(|_| level >= Level::Velocity) {
                local.qd[slider.joint] = slider.sense * speeds[slider.sigma];
            }
            if level == Level::Acceleration {
                let sigma = self.bias(&closed, &ends, &arms, speeds, &mut to);
                for slider in &self.sliders {
                    local.g[slider.joint] = slider.sense * sigma[slider.sigma];
                }
            }
        }
        self.to.iter().zip(to).for_each(|(at, link)| local.scratch.plane[*at] = link);
        Validity { gain, ..validity }
    }

    /// Arms from the anchors of the bodies of A and B of the point where the sides are taken at
    /// σ̇ = 0; and from the first one of the point that carries a link along c₁.
    #[inline(always)]
    fn arms(&self, closed: &Closed<T>, [a, b]: &[PlaneLink<T>; 2]) -> [Plane<T>; 3] {
        let of = |link: &PlaneLink<T>, k: usize| link.arm(&self.from[k].arm);
        let to = |link: &PlaneLink<T>, x: &Plane<T>| add(&link.at, -T::ONE, x);
        let [first, end] = &closed.anchors;
        match self.joints {
            Joints::Rrp => [of(a, 0), to(b, end), of(a, 0)],
            Joints::Rpr => [of(a, 0), of(b, 1), of(a, 0)],
            Joints::Prp => [to(a, end), to(b, end), to(a, first)],
            Joints::Ppr => [to(a, end), of(b, 1), to(a, first)],
        }
    }

    /// Rates of both links, of the turn and of the anchor, from those of the bodies' turns, of the
    /// points of [`Self::arms`] and of σ.
    #[inline(always)]
    fn carried(
        &self,
        closed: &Closed<T>,
        [turn_a, turn_b]: [T; 2],
        [x_a, x_b, x]: [Plane<T>; 3],
        sigma: [T; 2],
    ) -> [(T, Plane<T>); 2] {
        let along = add(&closed.columns[0], sigma[0], &x);
        match self.joints {
            Joints::Rrp => [(sigma[0], x_a), (turn_b, along)],
            Joints::Rpr => [(sigma[0], x_a), (sigma[0], x_b)],
            Joints::Prp => [(turn_a, along), (turn_b, along)],
            Joints::Ppr => [(turn_a, along), (turn_a, x_b)],
        }
    }

    /// Accelerations of both links and of σ at ÿ = 0.
    #[inline(always)]
    fn bias(
        &self,
        closed: &Closed<T>,
        ends: &[PlaneLink<T>; 2],
        arms: &[Plane<T>; 3],
        [s1, s2]: [T; 2],
        to: &mut [PlaneLink<T>; 2],
    ) -> [T; 2] {
        let of = |e: usize, arm: usize| ends[e].acceleration(&arms[arm]);
        let a = [of(0, 0), of(1, 1), of(0, 2)];
        let [w_a, w_b] = [ends[0].speed, ends[1].speed];
        // a slider on a guide that turns, and the end of a link that turns
        let guided = |k: usize, w: T, s: T| right(&closed.guides[k]).map(|g| (w + w) * (g * s));
        let outwards = closed.arm.map(|x| x * (s1 * s1));
        let both = |w: T| add(&guided(0, w_a, s1), T::ONE, &guided(1, w, s2)).map(|x| -x);
        let none = [T::ZERO; 2];
        let [sides, along] = match self.joints {
            Joints::Rrp => [add(&guided(0, w_b, s2), T::ONE, &outwards), outwards.map(|x| -x)],
            Joints::Rpr => [add(&guided(0, s1, s2), -T::ONE, &outwards), none],
            Joints::Prp => [both(w_b), guided(0, w_a, s1)],
            Joints::Ppr => [both(w_a), guided(0, w_a, s1)],
        };
        let apart = add(&a[0], -T::ONE, &a[1]);
        let sigma = closed.solve(&add(&sides, T::ONE, &apart));
        let a = [a[0], a[1], add(&along, T::ONE, &a[2])];
        let moved = self.carried(closed, ends.each_ref().map(|end| end.bias.0), a, sigma);
        to.iter_mut().zip(moved).for_each(|(link, moved)| link.bias = moved);
        sigma
    }
}
