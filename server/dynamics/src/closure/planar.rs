//! A plane loop of four joints, at most one of them a slider: four-bar and slider-crank.
//!
//! ```text
//!   J0 ──a── J1 ──b── J2 ──c── J3 ──d── J0    J0 is independent, one of J1 to J3 is cut
//! ```
//! Seen from link d, J0 turns (or slides) link a by y and carries J1 along; the position of J1
//! determines the other two links:
//!
//! ```text
//!   two links    b − c = D                b = κ D + η J D,  κ = (|D|² + |b|² − |c|²) / 2|D|²
//!                                         W = b × c = η |D|²
//!   slider       b = L t + ε J t          L = ±√(|b|² − ε²)
//! ```
//! with D from J1 to J3, t the direction of the slider J3 in link d, ε the distance of J1 from the
//! line on which J2 slides, J a turn by a right angle. The branch is the sign of W or of L, which
//! is that of det K_d: it is that of the zero pose for every y. A closed form knows no path: beyond
//! an unreachable gap it answers on the same side again. A loop whose slider lies opposite to J0 is
//! a lambda, see [`super::Rrpr`].

use crate::closure::plane::{Plane, add, cross, dot, right};
use crate::closure::{Level, Local, Numerical, Validity};
use crate::scalar::{Real, constants};

/// Geometry of a plane loop, origin in J0 where it turns {plane of link d}.
#[derive(Clone, Debug)]
pub(crate) struct Planar<T> {
    /// The independent joint, and whether it slides.
    pub(crate) joint: usize,
    pub(crate) slides: bool,
    /// J1 at zero, J3; direction of the slider if there is one.
    pub(crate) a: [T; 2],
    pub(crate) d: [T; 2],
    pub(crate) t: [T; 2],
    /// Links b and c, from J1 and from J3 to J2.
    pub(crate) links: TwoLinks<T>,
    /// J3 is the slider, c its bearing.
    pub(crate) slider: bool,
    /// The dependent joints of the tree.
    pub(crate) others: [LoopJoint<T>; 2],
    /// Newton's method on the true rows, where the geometry is only nearly plane.
    pub(crate) polish: Option<Numerical<T>>,
}

constants! { Planar:
    keep joint slides slider;
    map a d t links;
    each others polish;
}

/// Links b and c that meet in a pin.
#[derive(Clone, Debug)]
pub(crate) struct TwoLinks<T> {
    /// Both at zero, and their squares.
    pub(crate) b: [T; 2],
    pub(crate) c: [T; 2],
    pub(crate) b_square: T,
    pub(crate) c_square: T,
    /// ±1, the sign of W or of L.
    pub(crate) side: T,
}

constants! { TwoLinks:
    number b_square c_square side;
    map b c;
}

/// Two links that rotate, with b − c = D: both, their turns, and W.
pub(super) struct Met<T> {
    b: Plane<T>,
    c: Plane<T>,
    pub(super) turn_b: (T, T),
    pub(super) turn_c: (T, T),
    inverse_W: T,
}

/// A local joint and which one of the loop it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoopJoint<T> {
    pub(crate) joint: usize,
    /// 1 to 3.
    pub(crate) place: usize,
    /// +1 where the joint's coordinate grows as the link after it turns against the one before it,
    /// else −1.
    pub(crate) sense: T,
}

constants! { LoopJoint:
    keep joint place;
    number sense;
}

/// Where the links b and c stand: turns, slide, and the first and second derivatives by y.
struct Links<T> {
    turn_b: (T, T),
    turn_c: (T, T),
    slide: T,
    first: [T; 3],
    second: [T; 3],
}

impl<T: Real> TwoLinks<T> {
    /// Both links for D; rates need a level above the position.
    #[inline(always)]
    pub(super) fn meet(&self, D: &Plane<T>, level: Level) -> (Met<T>, Validity<T>) {
        let b0 = self.b;
        let c0 = self.c;
        let b_square = self.b_square;
        let c_square = self.c_square;
        let half = T::from_f64(0.5);

        // b · D, W
        let square = dot(D, D);
        let along = half * (square + (b_square - c_square));
        let W_square = b_square.mul_add(square, -(along * along));
        let W = self.side * W_square.sqrt();
        let inverse = T::ONE / square;
        let b = add(&right(D), W * inverse, &[along * inverse * D[0], along * inverse * D[1]]);
        let c = [b[0] - D[0], b[1] - D[1]];
        let inverse_b = T::ONE / b_square;
        let inverse_c = T::ONE / c_square;
        let validity = Validity::of(W_square, b_square * c_square)
            .or(Validity::of(square, b_square + c_square));
        let met = Met {
            b,
            c,
            turn_b: (dot(&b0, &b) * inverse_b, cross(&b0, &b) * inverse_b),
            turn_c: (dot(&c0, &c) * inverse_c, cross(&c0, &c) * inverse_c),
            inverse_W: if level > Level::Position { T::ONE / W } else { T::ZERO },
        };
        (met, validity)
    }
}

impl<T: Real> Met<T> {
    /// Rates of both turns for D′: b′ J b − c′ J c = D′.
    #[inline(always)]
    pub(super) fn rates(&self, x: &Plane<T>) -> (T, T) {
        (dot(x, &self.c) * self.inverse_W, dot(x, &self.b) * self.inverse_W)
    }

    /// Accelerations of both for the rates and D″.
    #[inline(always)]
    pub(super) fn bias(&self, (b1, c1): (T, T), x: &Plane<T>) -> (T, T) {
        self.rates(&add(&self.b, b1 * b1, &add(&self.c, -(c1 * c1), x)))
    }
}

impl<T: Real> Planar<T> {
    /// The position, velocity and acceleration level in closed form.
    #[inline]
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let a = self.a;
        let t = self.t;
        let y = local.q[self.joint];

        // J1, its first and second derivative by y, and the turn of link a
        let (turn_a, p, p1, p2) = if self.slides {
            ((T::ONE, T::ZERO), add(&t, y, &a), t, [T::ZERO, T::ZERO])
        } else {
            let (s, c) = y.sin_cos();
            local.cos_sin[self.joint] = (c, s);
            let p = [c.mul_add(a[0], -(s * a[1])), s.mul_add(a[0], c * a[1])];
            ((c, s), p, right(&p), [-p[0], -p[1]])
        };
        let (links, validity) = if self.slider {
            self.slider(&p, &p1, &p2, level)
        } else {
            self.two_links(&p, &p1, &p2, level)
        };

        // joints stand between their links: b − a, c − b, d − c
        let minus =
            |x: (T, T), y: (T, T)| (x.0.mul_add(y.0, x.1 * y.1), x.1.mul_add(y.0, -(x.0 * y.1)));
        for loop_joint in &self.others {
            let sense = loop_joint.sense;
            if self.slider && loop_joint.place == 3 {
                local.q[loop_joint.joint] = -(sense * links.slide);
                continue;
            }
            let (c, s) = match loop_joint.place {
                1 => minus(links.turn_b, turn_a),
                2 => minus(links.turn_c, links.turn_b),
                _ => (links.turn_c.0, -links.turn_c.1),
            };
            local.cos_sin[loop_joint.joint] = (c, sense * s);
            if self.slider {
                local.q[loop_joint.joint] = (sense * s).atan2(c);
            }
        }
        if !self.slider {
            let turns = self.others.each_ref().map(|loop_joint| local.cos_sin[loop_joint.joint]);
            let others = self.others.iter().zip(T::angles_of(turns));
            others.for_each(|(loop_joint, angle)| local.q[loop_joint.joint] = angle);
        }
        if level == Level::Position {
            return validity;
        }
        local.G[self.joint] = T::ONE;
        local.g[self.joint] = T::ZERO;
        let yd = local.qd[self.joint];
        let turn_rate = if self.slides { T::ZERO } else { T::ONE };
        let [b1, c1, s1] = links.first;
        let [b2, c2, s2] = links.second;
        for loop_joint in &self.others {
            let sense = loop_joint.sense;
            let (first, second) = match loop_joint.place {
                1 => (b1 - turn_rate, b2),
                2 => (c1 - b1, c2 - b2),
                _ if self.slider => (-s1, -s2),
                _ => (-c1, -c2),
            };
            local.G[loop_joint.joint] = sense * first;
            if level >= Level::Velocity {
                local.qd[loop_joint.joint] = sense * first * yd;
            }
            if level == Level::Acceleration {
                local.g[loop_joint.joint] = sense * second * (yd * yd);
            }
        }
        validity
    }

    /// Links b and c rotate: where circles about J1 and J3 meet.
    #[inline(always)]
    fn two_links(
        &self,
        p: &Plane<T>,
        p1: &Plane<T>,
        p2: &Plane<T>,
        level: Level,
    ) -> (Links<T>, Validity<T>) {
        let d = self.d;
        let (met, validity) = self.links.meet(&[d[0] - p[0], d[1] - p[1]], level);
        let mut links = Links {
            turn_b: met.turn_b,
            turn_c: met.turn_c,
            slide: T::ZERO,
            first: [T::ZERO; 3],
            second: [T::ZERO; 3],
        };
        if level == Level::Position {
            return (links, validity);
        }
        let (b1, c1) = met.rates(&[-p1[0], -p1[1]]);
        links.first = [b1, c1, T::ZERO];
        if level < Level::Acceleration {
            return (links, validity);
        }
        let (b2, c2) = met.bias((b1, c1), &[-p2[0], -p2[1]]);
        links.second = [b2, c2, T::ZERO];
        (links, validity)
    }

    /// Link c slides on link d along t and does not turn.
    #[inline(always)]
    fn slider(
        &self,
        p: &Plane<T>,
        p1: &Plane<T>,
        p2: &Plane<T>,
        level: Level,
    ) -> (Links<T>, Validity<T>) {
        let a = self.a;
        let b0 = self.links.b;
        let t = self.t;
        let b_square = self.links.b_square;
        let n = right(&t);

        // ε, L; PRECISION: the slide is made of changes since zero, so that it is exact there
        let length0 = dot(&t, &b0);
        let offset0 = dot(&n, &b0);
        let moved = [p[0] - a[0], p[1] - a[1]];
        let change = -dot(&n, &moved);
        let offset = offset0 + change;
        let L_square = b_square - offset * offset;
        let L = self.links.side * L_square.sqrt();
        let extension = -(change * (offset + offset0)) / (L + length0);
        let b = [L.mul_add(t[0], offset * n[0]), L.mul_add(t[1], offset * n[1])];
        let inverse_b = T::ONE / b_square;
        let validity = Validity::of(L_square, b_square);
        let mut links = Links {
            turn_b: (dot(&b0, &b) * inverse_b, cross(&b0, &b) * inverse_b),
            turn_c: (T::ONE, T::ZERO),
            slide: extension + dot(&t, &moved),
            first: [T::ZERO; 3],
            second: [T::ZERO; 3],
        };
        if level == Level::Position {
            return (links, validity);
        }

        // b′ J b − s′ t = −p′, then with the second derivatives of the turns
        let inverse_L = T::ONE / L;
        let solve = |x: &Plane<T>| (dot(x, &n) * inverse_L, -(dot(x, &b) * inverse_L));
        let (b1, s1) = solve(&[-p1[0], -p1[1]]);
        links.first = [b1, T::ZERO, s1];
        if level < Level::Acceleration {
            return (links, validity);
        }
        let (b2, s2) = solve(&add(&b, b1 * b1, &[-p2[0], -p2[1]]));
        links.second = [b2, T::ZERO, s2];
        (links, validity)
    }
}
