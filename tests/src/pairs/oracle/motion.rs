//! Links move with their joints, and forces of the tree follow from them.

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::scalar::Real;

use super::geometry::{about, converted, number, placement, product, quaternion, then, vector};
use super::{Link, Oracle, Pose};
use crate::pairs::algebra::{V3, add, apply, cross, dot, scaled, sub, turned};

impl Oracle<'_> {
    /// The pose of every link.
    pub fn poses<T: Real>(&self, q: &[T]) -> Vec<Pose<T>> {
        let o = T::ZERO;
        let I = [[T::ONE, o, o], [o, T::ONE, o], [o, o, T::ONE]];
        let mut poses = vec![Pose { R: I, p: [o; 3] }; self.of.links.len()];
        for &j in &self.order {
            let joint = &self.of.joints[j];
            let (origin, axis) = &self.joints[j];
            let mut x = then(&poses[joint.parent], &converted(origin));
            let axis = axis.map(number);
            let q = &q[self.q[j]..];
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous => {
                    x.R = product(&x.R, &about(axis, q[0]));
                }
                JointKind::Prismatic => x.p = add(x.p, apply(&x.R, scaled(axis, q[0]))),
                JointKind::Spherical => x.R = product(&x.R, &quaternion(&q[..4])),
                JointKind::Floating => {
                    x.p = add(x.p, apply(&x.R, [q[0], q[1], q[2]]));
                    x.R = product(&x.R, &quaternion(&q[3..7]));
                }
                _ => {}
            }
            poses[joint.child] = x;
        }
        poses
    }

    /// The motion of every link.
    pub fn links<T: Real>(&self, poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> Vec<Link<T>> {
        let o = [T::ZERO; 3];
        let still = |x: &Pose<T>| Link { R: x.R, p: x.p, w: o, d: o, a: o, e: o };
        let mut links: Vec<Link<T>> = poses.iter().map(still).collect();
        let two = T::from_f64(2.0);
        for &j in &self.order {
            let joint = &self.of.joints[j];
            let parent = links[joint.parent];
            let mut x = links[joint.child];
            // an axis is the same before and after the turn about it
            let axis = apply(&x.R, self.joints[j].1.map(number));
            let qd = &qd[self.v[j]..];
            let qdd = &qdd[self.v[j]..];
            // velocity and acceleration against the parent, seen from it
            let [mut w, mut a, mut d, mut e] = [o; 4];
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous => {
                    (w, a) = (scaled(axis, qd[0]), scaled(axis, qdd[0]));
                }
                JointKind::Prismatic => (d, e) = (scaled(axis, qd[0]), scaled(axis, qdd[0])),
                JointKind::Spherical | JointKind::Floating => {
                    w = apply(&x.R, [qd[0], qd[1], qd[2]]);
                    a = apply(&x.R, [qdd[0], qdd[1], qdd[2]]);
                }
                _ => {}
            }
            if joint.kind == JointKind::Floating {
                d = apply(&x.R, [qd[3], qd[4], qd[5]]);
                e = add(cross(w, d), apply(&x.R, [qdd[3], qdd[4], qdd[5]]));
            }
            let r = sub(x.p, parent.p);
            let W = parent.w;
            x.w = add(W, w);
            x.a = add(add(parent.a, a), cross(W, w));
            x.d = add(add(parent.d, d), cross(W, r));
            let carried = add(cross(parent.a, r), cross(W, cross(W, r)));
            x.e = add(add(parent.e, carried), add(e, scaled(cross(W, d), two)));
            links[joint.child] = x;
        }
        links
    }

    /// Forces of the tree: M q̈ + C, with springs, dampers and rotors.
    pub fn forces<T: Real>(&self, q: &[T], poses: &[Pose<T>], qd: &[T], qdd: &[T]) -> Vec<T> {
        let links = self.links(poses, qd, qdd);
        let gravity = vector(self.of.gravity);
        let o = [T::ZERO; 3];
        // force and moment about the origin of each link, from the leaves inwards
        let mut force = vec![(o, o); links.len()];
        for (k, link) in self.of.links.iter().enumerate() {
            let Some(inertial) = &link.inertial else { continue };
            let x = &links[k];
            let frame = then(&Pose { R: x.R, p: o }, &placement(&inertial.origin));
            let r = frame.p;
            let at = add(add(x.e, cross(x.a, r)), cross(x.w, cross(x.w, r)));
            let f = scaled(sub(at, gravity), T::from_f64(inertial.mass));
            let [xx, xy, xz, yy, yz, zz] = inertial.inertia.map(T::from_f64);
            let I = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
            let of = |v: V3<T>| apply(&frame.R, apply(&I, turned(&frame.R, v)));
            let n = add(of(x.a), cross(x.w, of(x.w)));
            force[k] = (f, add(n, cross(r, f)));
        }
        let mut tau = vec![T::ZERO; self.n_v];
        for &j in self.order.iter().rev() {
            let joint = &self.of.joints[j];
            let x = &links[joint.child];
            let (f, n) = force[joint.child];
            let r = sub(x.p, links[joint.parent].p);
            let parent = &mut force[joint.parent];
            *parent = (add(parent.0, f), add(parent.1, add(n, cross(r, f))));
            let axis = apply(&x.R, self.joints[j].1.map(number));
            let [fb, nb] = [turned(&x.R, f), turned(&x.R, n)];
            let v = self.v[j];
            let tau = &mut tau[v..];
            let terms = &joint.terms;
            let number = T::from_f64;
            match joint.kind {
                JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic => {
                    let along = if joint.kind == JointKind::Prismatic { f } else { n };
                    let rotor = number(terms.gear_ratio)
                        * number(terms.gear_ratio)
                        * number(terms.rotor_inertia);
                    let spring = number(terms.stiffness) * (q[self.q[j]] - number(terms.rest));
                    tau[0] =
                        dot(axis, along) + rotor * qdd[v] + number(terms.damping) * qd[v] + spring;
                }
                JointKind::Spherical => {
                    for k in 0..3 {
                        tau[k] = nb[k] + number(terms.damping) * qd[v + k];
                    }
                }
                JointKind::Floating => {
                    for k in 0..3 {
                        (tau[k], tau[3 + k]) = (nb[k], fb[k]);
                    }
                }
                _ => {}
            }
        }
        tau
    }

    /// Mass, centre of mass, its velocity and acceleration, angular velocity and moment of momentum
    /// about the centre of each link of some that has a mass.
    pub fn bodies<T: Real>(&self, links: &[Link<T>], which: &[bool]) -> Vec<(T, [V3<T>; 5])> {
        let some = self.of.links.iter().enumerate().filter(|(k, _)| which[*k]);
        some.filter_map(|(k, link)| {
            let inertial = link.inertial.as_ref()?;
            let x = &links[k];
            let frame = then(&Pose { R: x.R, p: [T::ZERO; 3] }, &placement(&inertial.origin));
            let r = frame.p;
            let v = add(x.d, cross(x.w, r));
            let a = add(add(x.e, cross(x.a, r)), cross(x.w, cross(x.w, r)));
            let [xx, xy, xz, yy, yz, zz] = inertial.inertia.map(T::from_f64);
            let I = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
            let spin = apply(&frame.R, apply(&I, turned(&frame.R, x.w)));
            Some((T::from_f64(inertial.mass), [add(x.p, r), v, a, x.w, spin]))
        })
        .collect()
    }

    /// Links that a joint moves of these names.
    pub fn moved(&self, names: &[String]) -> Vec<bool> {
        let mut moved = vec![false; self.of.links.len()];
        for (joint, carries) in self.of.joints.iter().zip(&self.carries) {
            let own = |name: &String| name.split('/').next() == Some(joint.name.as_str());
            if names.iter().any(own) {
                moved.iter_mut().zip(carries).for_each(|(moved, x)| *moved |= *x);
            }
        }
        moved
    }
}
