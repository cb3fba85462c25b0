//! Plane loops as an Assur chain: driven links, and dyads of two links on three pins, each closed
//! on the links before it.
//!
//! ```text
//!   A ──b── C ──c── B      b − c = D = B − A       see [`super::planar`]
//! ```
//! A and B lie on links whose pose is known, C joins the two new ones; any of the three pins may be
//! cut. Sliders take the place of pins in [`super::sliding`]. A link's point X at the arm r from
//! the link's anchor, with the link's turn θ:
//!
//! ```text
//!   X = x + R(θ) r        Ẋ = ẋ + θ̇ J r        Ẍ = ẍ + θ̈ J r − θ̇² r
//! ```

use crate::closure::plane::{PlaneLink, Point, add};
use crate::closure::sliding::{DrivenSlide, SlidingPair};
use crate::closure::{Level, Local, TwoLinks, Validity};
use crate::mechanism::{read_turns, turn};
use crate::scalar::{Real, constants};

/// Links of a plane in the order in which they are closed.
#[derive(Clone, Debug)]
pub(crate) struct Dyads<T> {
    pub(crate) steps: Vec<Step<T>>,
    /// The dependent pins of the tree.
    pub(crate) others: Vec<Pin<T>>,
    /// Cosine and sine, and coordinate, of these and of the independents.
    pub(crate) found: Vec<(usize, usize)>,
    pub(crate) given: Vec<(usize, usize)>,
}

constants! { Dyads:
    keep found given;
    each steps others;
}

/// One or two links that are closed.
#[derive(Clone, Debug)]
pub(crate) enum Step<T> {
    Driven(Driven<T>),
    Pair(Pair<T>),
    DrivenSlide(DrivenSlide<T>),
    SlidingPair(SlidingPair<T>),
}

constants! { enum Step:
    map Driven Pair DrivenSlide SlidingPair;
}

/// A link that an independent joint turns against one before it.
#[derive(Clone, Debug)]
pub(crate) struct Driven<T> {
    /// Its local joint, and place in y.
    pub(crate) joint: usize,
    pub(crate) place: usize,
    pub(crate) from: Point<T>,
    pub(crate) to: usize,
    /// +1 where the link's turn against the other grows with the coordinate, else −1.
    pub(crate) sense: T,
}

constants! { Driven:
    keep joint place to;
    number sense;
    map from;
}

/// Two links from A and from B to C.
#[derive(Clone, Debug)]
pub(crate) struct Pair<T> {
    pub(crate) from: [Point<T>; 2],
    pub(crate) to: [usize; 2],
    pub(crate) links: TwoLinks<T>,
}

constants! { Pair:
    keep to;
    map links;
    each from;
}

/// A dependent joint of the tree, its parent's and its child's link.
#[derive(Clone, Debug)]
pub(crate) struct Pin<T> {
    pub(crate) joint: usize,
    pub(crate) links: [usize; 2],
    /// +1 where its axis is the plane's normal, −1 against it.
    pub(crate) sense: T,
}

constants! { Pin:
    keep joint links;
    number sense;
}

impl<T: Real> Dyads<T> {
    /// The position, velocity and acceleration level in closed form.
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let cluster = local.cluster;
        match cluster.n_vy {
            1 if T::UNROLLED => self.close_for::<1>(&cluster.independent, local, level),
            2 if T::UNROLLED => self.close_for::<2>(&cluster.independent, local, level),
            _ => self.close_for::<0>(&cluster.independent, local, level),
        }
    }

    /// For N independents, or for any number of them.
    fn close_for<const N: usize>(
        &self,
        independent: &[usize],
        local: &mut Local<'_, T>,
        level: Level,
    ) -> Validity<T> {
        let m = if N == 0 { independent.len() } else { N };
        let independent = &independent[..m];
        turn(&self.given, local.q, local.cos_sin);
        let mut validity = Validity::fine();
        for step in &self.steps {
            match step {
                Step::Driven(driven) => driven.close(m, local, level),
                Step::Pair(pair) => {
                    validity = validity.or(pair.close(independent, local, level));
                }
                Step::DrivenSlide(driven) => driven.close(m, local, level),
                Step::SlidingPair(pair) => {
                    validity = validity.or(pair.close(independent, local, level));
                }
            }
        }

        // joints stand between their links
        let links = &local.scratch.plane;
        for pin in &self.others {
            let [(c0, s0), (c1, s1)] = pin.links.map(|link| links[link].turn);
            let cosine = c1.mul_add(c0, s1 * s0);
            let sine = s1.mul_add(c0, -(c1 * s0));
            local.cos_sin[pin.joint] = (cosine, pin.sense * sine);
        }
        read_turns(&self.found, local.cos_sin, local.q);
        if level == Level::Position {
            return validity;
        }
        for pin in &self.others {
            let [parent, child] = pin.links.map(|link| &links[link]);
            for k in 0..m {
                local.G[pin.joint * m + k] = pin.sense * (child.rate[k].0 - parent.rate[k].0);
            }
            if level >= Level::Velocity {
                local.qd[pin.joint] = pin.sense * (child.speed - parent.speed);
            }
            if level == Level::Acceleration {
                local.g[pin.joint] = pin.sense * (child.bias.0 - parent.bias.0);
            }
        }
        validity
    }
}

impl<T: Real> Driven<T> {
    /// The link turns on the one before it by the joint's coordinate.
    #[inline(always)]
    fn close(&self, m: usize, local: &mut Local<'_, T>, level: Level) {
        let links = &mut local.scratch.plane;
        let from = links[self.from.link];
        let arm = from.arm(&self.from.arm);
        let (c, s) = local.cos_sin[self.joint];
        let s = self.sense * s;
        let mut link = PlaneLink::at_rest();
        let (c0, s0) = from.turn;
        link.turn = (c.mul_add(c0, -(s * s0)), s.mul_add(c0, c * s0));
        link.at = add(&arm, T::ONE, &from.at);
        link.gain = from.gain;
        if level > Level::Position {
            for k in 0..m {
                link.rate[k] = (from.rate[k].0, from.velocity(&arm, k));
                local.G[self.joint * m + k] = T::ZERO;
            }
            link.rate[self.place].0 += self.sense;
            local.G[self.joint * m + self.place] = T::ONE;
            local.g[self.joint] = T::ZERO;
        }
        if level >= Level::Velocity {
            link.speed = self.sense.mul_add(local.qd[self.joint], from.speed);
        }
        if level == Level::Acceleration {
            link.bias = (from.bias.0, from.acceleration(&arm));
        }
        links[self.to] = link;
    }
}

impl<T: Real> Pair<T> {
    /// Both links from A and B on the links before them.
    #[inline(always)]
    fn close(&self, independent: &[usize], local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let links = &mut local.scratch.plane;
        let [from_a, from_b] = [&links[self.from[0].link], &links[self.from[1].link]];
        let arms = [from_a.arm(&self.from[0].arm), from_b.arm(&self.from[1].arm)];
        let mut b = PlaneLink::at_rest();
        let mut c = PlaneLink::at_rest();
        b.at = add(&arms[0], T::ONE, &from_a.at);
        c.at = add(&arms[1], T::ONE, &from_b.at);
        let (met, validity) = self.links.meet(&[c.at[0] - b.at[0], c.at[1] - b.at[1]], level);
        b.turn = met.turn_b;
        c.turn = met.turn_c;
        let gain = T::ONE.larger(validity.gain) * from_a.gain.larger(from_b.gain);
        (b.gain, c.gain) = (gain, gain);
        if level > Level::Position {
            for k in 0..independent.len() {
                let v = [from_a.velocity(&arms[0], k), from_b.velocity(&arms[1], k)];
                let (turn_b, turn_c) = met.rates(&[v[1][0] - v[0][0], v[1][1] - v[0][1]]);
                b.rate[k] = (turn_b, v[0]);
                c.rate[k] = (turn_c, v[1]);
            }
        }
        if level >= Level::Velocity {
            for (k, i) in independent.iter().enumerate() {
                b.speed = b.rate[k].0.mul_add(local.qd[*i], b.speed);
                c.speed = c.rate[k].0.mul_add(local.qd[*i], c.speed);
            }
        }
        if level == Level::Acceleration {
            let a = [from_a.acceleration(&arms[0]), from_b.acceleration(&arms[1])];
            let D2 = [a[1][0] - a[0][0], a[1][1] - a[0][1]];
            let (bias_b, bias_c) = met.bias((b.speed, c.speed), &D2);
            b.bias = (bias_b, a[0]);
            c.bias = (bias_c, a[1]);
        }
        links[self.to[0]] = b;
        links[self.to[1]] = c;
        Validity { gain, ..validity }
    }
}
