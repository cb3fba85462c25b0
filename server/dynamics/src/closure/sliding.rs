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

use crate::closure::dyads::Point;
use crate::closure::plane::{Plane, PlaneLink, add, cross, dot, right};
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
        let links = &mut local.scratch.plane;
        let [a, b] = [links[self.from[0].link], links[self.from[1].link]];
        let (closed, validity) = self.meet(&a, &b);
        let gain = T::ONE.larger(validity.gain) * a.gain.larger(b.gain);
        let mut first = PlaneLink::at_rest();
        let mut second = PlaneLink::at_rest();
        (first.turn, first.at, first.gain) = (closed.turns[0], closed.anchors[0], gain);
        (second.turn, second.at, second.gain) = (closed.turns[1], closed.anchors[1], gain);
        for slider in &self.sliders {
            local.q[slider.joint] = slider.sense * (closed.sigma[slider.sigma] - slider.zero);
        }
        if level == Level::Position {
            (links[self.to[0]], links[self.to[1]]) = (first, second);
            return Validity { gain, ..validity };
        }

        // points in which the sides are taken at σ̇ = 0, from the anchors of the bodies of A and B
        let [A, B] = [(&a, 0), (&b, 1)].map(|(link, k)| link.arm(&self.from[k].arm));
        let end = closed.anchors[1];
        let from = |link: &PlaneLink<T>, x: &Plane<T>| add(&link.at, -T::ONE, x);
        let [arm_a, arm_b] = match self.joints {
            Joints::Rrp => [A, from(&b, &end)],
            Joints::Rpr => [A, B],
            Joints::Prp => [from(&a, &end), from(&b, &end)],
            Joints::Ppr => [from(&a, &end), B],
        };
        let solve = |x: &Plane<T>| {
            let [c1, c2] = &closed.columns;
            [cross(x, c2) * closed.inverse, cross(c1, x) * closed.inverse]
        };
        let [g1, g2] = closed.guides;
        let moved = add(&a.at, -T::ONE, &closed.anchors[0]);
        let mut speeds = [T::ZERO; 2];
        for k in 0..m {
            let (v_a, v_b) = (a.velocity(&arm_a, k), b.velocity(&arm_b, k));
            let [s1, s2] = solve(&add(&v_a, -T::ONE, &v_b));
            let (turn_a, turn_b) = (a.rate[k].0, b.rate[k].0);
            (first.rate[k], second.rate[k]) = match self.joints {
                Joints::Rrp => ((s1, v_a), (turn_b, add(&right(&closed.arm), s1, &v_a))),
                Joints::Rpr => ((s1, v_a), (s1, v_b)),
                Joints::Prp => {
                    let v = add(&g1, s1, &v_a);
                    ((turn_a, v), (turn_b, v))
                }
                Joints::Ppr => ((turn_a, add(&g1, s1, &a.velocity(&moved, k))), (turn_a, v_b)),
            };
            if level >= Level::Velocity {
                let yd = local.qd[independent[k]];
                speeds = [s1.mul_add(yd, speeds[0]), s2.mul_add(yd, speeds[1])];
            }
            for slider in &self.sliders {
                local.G[slider.joint * m + k] = slider.sense * [s1, s2][slider.sigma];
            }
        }
        if level >= Level::Velocity {
            (first.speed, second.speed) = match self.joints {
                Joints::Rrp => (speeds[0], b.speed),
                Joints::Rpr => (speeds[0], speeds[0]),
                Joints::Prp => (a.speed, b.speed),
                Joints::Ppr => (a.speed, a.speed),
            };
            for slider in &self.sliders {
                local.qd[slider.joint] = slider.sense * speeds[slider.sigma];
            }
        }
        if level == Level::Acceleration {
            let (a_a, a_b) = (a.acceleration(&arm_a), b.acceleration(&arm_b));
            let x = add(&a_a, -T::ONE, &a_b);
            let twice = |w: T, v: T| (w + w) * v;
            let x = match self.joints {
                // a guide is that of c₂, with the other sign where it is on the right side
                Joints::Rrp => {
                    let on_guide = add(&right(&g1), twice(b.speed, speeds[1]), &x);
                    add(&closed.arm, speeds[0] * speeds[0], &on_guide)
                }
                Joints::Rpr => {
                    let on_guide = add(&right(&g1), -twice(speeds[0], speeds[1]), &x);
                    add(&closed.arm, speeds[0] * speeds[0], &on_guide)
                }
                Joints::Prp | Joints::Ppr => {
                    let turning = if self.joints == Joints::Prp { b.speed } else { a.speed };
                    let on_first = add(&right(&g1), -twice(a.speed, speeds[0]), &x);
                    add(&right(&g2), -twice(turning, speeds[1]), &on_first)
                }
            };
            let [s1, s2] = solve(&x);
            (first.bias, second.bias) = match self.joints {
                Joints::Rrp => {
                    let turned = add(&right(&closed.arm), s1, &a_a);
                    let of_pin = add(&closed.arm, -(speeds[0] * speeds[0]), &turned);
                    ((s1, a_a), (b.bias.0, of_pin))
                }
                Joints::Rpr => ((s1, a_a), (s1, a_b)),
                Joints::Prp | Joints::Ppr => {
                    let on_guide = add(&g1, s1, &a.acceleration(&moved));
                    let of_first = add(&right(&g1), twice(a.speed, speeds[0]), &on_guide);
                    match self.joints {
                        Joints::Prp => ((a.bias.0, of_first), (b.bias.0, of_first)),
                        _ => ((a.bias.0, of_first), (a.bias.0, a_b)),
                    }
                }
            };
            for slider in &self.sliders {
                local.g[slider.joint] = slider.sense * [s1, s2][slider.sigma];
            }
        }
        (links[self.to[0]], links[self.to[1]]) = (first, second);
        Validity { gain, ..validity }
    }
}
