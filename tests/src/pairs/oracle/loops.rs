//! Cuts and couplings give the rows of the loops.

use sarrus_dynamics::description::{Cut, JointKind};
use sarrus_dynamics::scalar::{Dd, Real};

use super::geometry::{converted, inverse, log, number, placement, product, then, vector};
use super::{Link, Oracle, Pose, Row};
use crate::pairs::algebra::{Matrix, V3, add, apply, cross, dot, scaled, sub, turned};

impl Oracle<'_> {
    /// Poses of the cut frames on their links.
    pub(super) fn frames(&self) -> Vec<(usize, usize, Pose<Dd>, Pose<Dd>)> {
        let poses = self.poses(&self.zero::<Dd>());
        let pose = |link: usize| poses[link];
        let loops = self.of.submechanisms.iter().flat_map(|part| &part.loops);
        loops
            .map(|of| {
                let both = |world: Pose<Dd>| {
                    let on = |link: usize| then(&inverse(&pose(link)), &world);
                    (on(of.predecessor), on(of.successor))
                };
                let (p, s) = match &of.cut {
                    Cut::AtJoint(j) => both(pose(self.of.joints[*j].child)),
                    Cut::AtLink(link) => both(pose(*link)),
                    Cut::Placed { predecessor, successor } => {
                        (placement(predecessor), placement(successor))
                    }
                    _ => both(pose(self.root)),
                };
                (of.predecessor, of.successor, p, s)
            })
            .collect()
    }

    /// φ, K q̇ and their rates −k at q̈ = 0 of every row; q̈ counts where it is not zero.
    pub fn rows<T: Real>(&self, q: &[T], poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> [Vec<T>; 3] {
        let links = self.links(poses, qd, qdd);
        let two = T::from_f64(2.0);
        let mut all = [vec![], vec![], vec![]];
        for row in &self.rows {
            let values = match row {
                Row::Coupling(j, masters, offset, bends) => {
                    let sum = |of: &[T], at: &[usize]| {
                        masters.iter().fold(of[at[*j]], |sum, (master, ratio)| {
                            sum - T::from_f64(*ratio) * of[at[*master]]
                        })
                    };
                    let [mut phi, mut rate, mut second] = [
                        sum(q, &self.q) - T::from_f64(*offset),
                        sum(qd, &self.v),
                        sum(qdd, &self.v),
                    ];
                    for (of, bend) in bends {
                        let [f, f1, f2] = bend.at(q[self.q[*of]]);
                        let [d, e] = [qd[self.v[*of]], qdd[self.v[*of]]];
                        phi -= f;
                        rate -= f1 * d;
                        second -= f1 * e + f2 * d * d;
                    }
                    [phi, rate, second]
                }
                Row::Cut { cut, axis, against, line } => {
                    let (p, s, on_p, on_s) = &self.cuts[*cut];
                    let [on_p, on_s] = [on_p, on_s].map(converted::<T>);
                    let [P, S] = [p, s].map(|link| &links[*link]);
                    let R_P = product(&P.R, &on_p.R);
                    let R_S = product(&S.R, &on_s.R);
                    let [angular, linear] =
                        [vector([axis[0], axis[1], axis[2]]), vector([axis[3], axis[4], axis[5]])];
                    if let Some(against) = against {
                        let a = apply(&R_P, angular);
                        let b = apply(&R_S, vector(*against));
                        let [da, db] = [cross(P.w, a), cross(S.w, b)];
                        let dda = add(cross(P.a, a), cross(P.w, da));
                        let ddb = add(cross(S.a, b), cross(S.w, db));
                        [
                            dot(a, b),
                            dot(da, b) + dot(a, db),
                            dot(dda, b) + two * dot(da, db) + dot(a, ddb),
                        ]
                    } else {
                        let at = |x: &Link<T>, r: V3<T>| {
                            let r = apply(&x.R, r);
                            let d = add(x.d, cross(x.w, r));
                            let e = add(x.e, add(cross(x.a, r), cross(x.w, cross(x.w, r))));
                            (add(x.p, r), d, e)
                        };
                        let from = at(P, on_p.p);
                        let to = at(S, on_s.p);
                        let [x, d, e] = [sub(to.0, from.0), sub(to.1, from.1), sub(to.2, from.2)];
                        let rel = sub(d, cross(P.w, x));
                        let acc = sub(
                            sub(e, cross(P.a, x)),
                            add(cross(P.w, cross(P.w, x)), scaled(cross(P.w, rel), two)),
                        );
                        let w = sub(S.w, P.w);
                        let a = sub(sub(S.a, P.a), cross(P.w, w));
                        let R = product(&inverse(&Pose { R: R_P, p: x }).R, &R_S);
                        // of the same zeros as log R, with the rate ω at each
                        let theta = match line {
                            Some(line) => {
                                let line = vector(*line);
                                cross(line, apply(&R, line))
                            }
                            None => log(&R),
                        };
                        let along = |v: V3<T>| dot(linear, turned(&R_P, v));
                        let turn = |v: V3<T>| dot(angular, turned(&R_P, v));
                        [along(x) + dot(angular, theta), along(rel) + turn(w), along(acc) + turn(a)]
                    }
                }
            };
            all.iter_mut().zip(values).for_each(|(all, value)| all.push(value));
        }
        all
    }

    /// K (n_rows × n_v).
    pub fn jacobian<T: Real>(&self, q: &[T], poses: &[Pose<T>]) -> Matrix<T> {
        let mut K = Matrix::new(self.rows.len(), self.n_v);
        for (r, row) in self.rows.iter().enumerate() {
            let (cut, axis, against) = match row {
                Row::Coupling(j, masters, _, bends) => {
                    *K.at(r, self.v[*j]) = T::ONE;
                    for (master, ratio) in masters {
                        *K.at(r, self.v[*master]) += -T::from_f64(*ratio);
                    }
                    for (of, bend) in bends {
                        *K.at(r, self.v[*of]) -= bend.at(q[self.q[*of]])[1];
                    }
                    continue;
                }
                Row::Cut { cut, axis, against, .. } => (*cut, axis, against),
            };
            let (p, s, on_p, on_s) = &self.cuts[cut];
            let P = then(&poses[*p], &converted(on_p));
            let S = then(&poses[*s], &converted(on_s));
            let x = sub(S.p, P.p);
            let turns = apply(&P.R, vector([axis[0], axis[1], axis[2]]));
            let (linear, angular) = match against {
                // d(a·b) = (b × a) · ω
                Some(b) => ([T::ZERO; 3], cross(apply(&S.R, vector(*b)), turns)),
                None => (apply(&P.R, vector([axis[3], axis[4], axis[5]])), turns),
            };
            for (j, joint) in self.of.joints.iter().enumerate() {
                let [on_p, on_s] = [self.carries[j][*p], self.carries[j][*s]];
                if on_p == on_s {
                    // the ends move with each other, and the row in its own axes
                    continue;
                }
                let sign = if on_s { T::ONE } else { -T::ONE };
                let at = &poses[joint.child];
                let axis = apply(&at.R, self.joints[j].1.map(number));
                // of S against P, at the point of S: P's turn carries x with it
                let turn = |w: V3<T>| {
                    let d = cross(w, sub(if on_s { S.p } else { P.p }, at.p));
                    let d = if on_s { d } else { add(d, cross(w, x)) };
                    sign * (dot(linear, d) + dot(angular, w))
                };
                let slide = |d: V3<T>| sign * dot(linear, d);
                let v = self.v[j];
                let column = |k: usize| [at.R[0][k], at.R[1][k], at.R[2][k]];
                match joint.kind {
                    JointKind::Fixed => {}
                    JointKind::Prismatic => *K.at(r, v) = slide(axis),
                    JointKind::Spherical | JointKind::Floating => {
                        (0..3).for_each(|k| *K.at(r, v + k) = turn(column(k)));
                        if joint.kind == JointKind::Floating {
                            (0..3).for_each(|k| *K.at(r, v + 3 + k) = slide(column(k)));
                        }
                    }
                    _ => *K.at(r, v) = turn(axis),
                }
            }
        }
        K
    }
}
