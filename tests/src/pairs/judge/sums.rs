//! Sums over the links, and frames in other axes and against links, are compared with the oracle.

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Axes, Field, FieldSet, Query, QueryOptions, Request};

use super::{Judge, Ledger, size};
use crate::pairs::algebra::{M3, V3, add, cross, dot, scaled, sub, turned};
use crate::pairs::oracle::{Link, Motion, Pose, Rates};
use Field::{
    Centroidal, Com, ComBias, ComJacobian, Energy, FrameAcc, FramePose, FrameTwist,
    JacobianIndependent, JdYd, Momentum,
};

/// Centre of mass, its velocity and acceleration, momentum about it and of it.
fn summed(bodies: &[(Dd, [V3<Dd>; 5])]) -> [V3<Dd>; 5] {
    let zero = [Dd::ZERO; 3];
    let mass = bodies.iter().fold(Dd::ZERO, |sum, (m, _)| sum + *m);
    let mean = |k: usize| {
        let sum = bodies.iter().fold(zero, |sum, (m, x)| add(sum, scaled(x[k], *m)));
        scaled(sum, Dd::ONE / mass)
    };
    let [c, v, a] = [mean(0), mean(1), mean(2)];
    let about = |sum: V3<Dd>, (m, [at, rate, _, _, spin]): &(Dd, [V3<Dd>; 5])| {
        add(sum, add(*spin, scaled(cross(sub(*at, c), sub(*rate, v)), *m)))
    };
    [c, v, a, bodies.iter().fold(zero, about), scaled(v, mass)]
}

impl Judge<'_> {
    /// Compares the sums over the links and a frame in every view.
    pub(super) fn sums(
        &self,
        given: &[(Field, &[f64]); 3],
        frames: [u16; 2],
        exact: &[Dd],
        rates: &Rates<Dd>,
        motion: &Motion<Dd>,
        speed: f64,
        ledger: &mut Ledger,
    ) {
        let oracle = &self.oracle;
        let model = self.model;
        let length = self.drawn.length;
        let poses = oracle.poses(exact);
        let Motion { qd, qdd, .. } = motion;
        let still = vec![Dd::ZERO; oracle.n_v()];
        let links = oracle.links(&poses, qd, qdd);
        let bias = oracle.links(&poses, qd, &rates.g);
        let n = model.independent_names().len();
        let units: Vec<Vec<Link<Dd>>> = (0..n)
            .map(|k| {
                let mut e = vec![Dd::ZERO; n];
                e[k] = Dd::ONE;
                oracle.links(&poses, &oracle.rate(&rates.G, &e), &still)
            })
            .collect();
        let moved = oracle.moved(model.tree_names());
        let bodies = oracle.bodies(&links, &moved);
        if bodies.is_empty() {
            return;
        }
        let mass = bodies.iter().fold(0.0, |sum, (m, _)| sum + m.to_f64());
        let [com, _, _, angular, linear] = summed(&bodies);
        let [_, _, com_bias, ..] = summed(&oracle.bodies(&bias, &moved));
        let columns: Vec<[V3<Dd>; 5]> =
            units.iter().map(|links| summed(&oracle.bodies(links, &moved))).collect();

        let want = [Com, ComJacobian, ComBias, Momentum, Centroidal, Energy];
        let Some(asked) = self.ask(Request::Kinematics, None, given, &want, &[]) else {
            return self.report(ledger, "no plan of sums", 1.0);
        };
        ledger.count(&format!("sums: {}", asked.answer.status.name()));
        if !asked.ok() {
            return;
        }
        let inv = 1.0 / length;
        let units_y = self.units(model.independent_names());
        let of_y = |unit: f64| -> Vec<f64> {
            (0..3).flat_map(|_| units_y.iter().map(move |y| unit / y)).collect()
        };
        let row = |of: &dyn Fn(&[V3<Dd>; 5]) -> V3<Dd>| -> Vec<Dd> {
            (0..3).flat_map(|i| columns.iter().map(move |x| of(x)[i])).collect()
        };
        let mut check = |what: &str, x: &[f64], exact: &[Dd], units: &[f64], least: f64| {
            self.compare(ledger, &asked, what, x, exact, units, least)
        };
        check("com", asked.get(Com), &com, &[inv; 3], 1e-4);
        check("com_jacobian", asked.get(ComJacobian), &row(&|x| x[1]), &of_y(inv), 1e-2);
        check("com_bias", asked.get(ComBias), &com_bias, &[inv; 3], 1e-2 * speed * speed);
        let [momentum, turn] = [mass * length, mass * length * length];
        // each place is a sum of some ten numbers, rounded to a part of its distance from the root
        let arm = 1e-2 + 5e-6 * size(&com.map(|x| x.to_f64() * inv));
        let x = asked.get(Momentum);
        check("momentum", &x[3..], &linear, &[1.0 / momentum; 3], 1e-2 * speed);
        check("angular momentum", &x[..3], &angular, &[1.0 / turn; 3], arm * speed);
        let x = asked.get(Centroidal);
        let (top, bottom) = x.split_at(3 * n);
        check("centroidal, angular", top, &row(&|x| x[3]), &of_y(1.0 / turn), arm);
        check("centroidal, linear", bottom, &row(&|x| x[4]), &of_y(1.0 / momentum), 1e-2);

        // ½ Σ (m v² + ω · I ω) and rotors; −m g · c and springs
        let half = Dd::from(0.5);
        let mut kinetic = bodies.iter().fold(Dd::ZERO, |sum, (m, [_, v, _, w, spin])| {
            sum + (*m * dot(*v, *v) + dot(*w, *spin)) * half
        });
        let gravity = self.of.gravity.map(Dd::from);
        let mut potential =
            -dot(gravity, com) * bodies.iter().fold(Dd::ZERO, |sum, (m, _)| sum + *m);
        let weight =
            size(&self.of.gravity) * mass * com.map(|x| x.to_f64().abs()).iter().sum::<f64>();
        let mut largest = weight;
        let (q_names, v_names) = oracle.names();
        for joint in &self.of.joints {
            let one = matches!(
                joint.kind,
                JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic
            );
            let place = |names: &[String]| names.iter().position(|x| *x == joint.name);
            if !one || !model.tree_names().contains(&joint.name) {
                continue;
            }
            let (Some(i), Some(v)) = (place(&q_names), place(&v_names)) else { continue };
            let terms = &joint.terms;
            let rotor = Dd::from(terms.rotor_inertia)
                * (Dd::from(terms.gear_ratio) * Dd::from(terms.gear_ratio));
            kinetic += rotor * (qd[v] * qd[v]) * half;
            let off = exact[i] - Dd::from(terms.rest);
            let spring = Dd::from(terms.stiffness) * (off * off) * half;
            potential += spring;
            largest += spring.to_f64();
        }
        let x = asked.get(Energy);
        check("kinetic energy", &x[..1], &[kinetic], &[1.0], 1e-12 * turn * speed * speed);
        check("potential energy", &x[1..], &[potential], &[1.0], largest);

        for axes in [Axes::Mixed, Axes::World, Axes::Local] {
            for reference in [None, Some(frames[1])] {
                self.view(
                    given,
                    frames[0],
                    axes,
                    reference,
                    [&links, &bias],
                    &units,
                    speed,
                    ledger,
                );
            }
        }
    }

    /// One frame in some axes, against the root or a link.
    fn view(
        &self,
        given: &[(Field, &[f64]); 3],
        frame: u16,
        axes: Axes,
        reference: Option<u16>,
        [links, bias]: [&[Link<Dd>]; 2],
        units: &[Vec<Link<Dd>>],
        speed: f64,
        ledger: &mut Ledger,
    ) {
        let want = [FramePose, FrameTwist, FrameAcc, JacobianIndependent, JdYd];
        let set = FieldSet::of(&[given[0].0, given[1].0, given[2].0]);
        let query = Query::new(Request::Kinematics, set, FieldSet::of(&want));
        let mut query =
            query.with_options(QueryOptions::SEARCH).with_frames(&[frame]).with_axes(axes);
        if let Some(link) = reference {
            query = query.relative_to(link);
        }
        let Some(asked) = self.run(&query, None, given) else {
            return self.report(ledger, "no plan of a view", 1.0);
        };
        if !asked.ok() {
            return ledger.count(&format!("view: {}", asked.answer.status.name()));
        }
        let place = |link: u16| {
            let name = &self.model.link_names()[usize::from(link)];
            self.of.links.iter().position(|link| link.name == *name).unwrap_or(0)
        };
        let f = place(frame);
        let r = reference.map(place);
        // velocity, acceleration of the view, and the rate of its twist, from the link's
        let seen = |links: &[Link<Dd>]| -> (V3<Dd>, M3<Dd>, [V3<Dd>; 4], V3<Dd>) {
            let x = links[f];
            let o = Dd::ZERO;
            let one = Dd::ONE;
            let I = [[one, o, o], [o, one, o], [o, o, one]];
            let root = Pose { R: I, p: [o; 3] };
            let (root, w_r, d_r, a_r, e_r) = match r.map(|r| links[r]) {
                Some(r) => (Pose { R: r.R, p: r.p }, r.w, r.d, r.a, r.e),
                None => (root, [o; 3], [o; 3], [o; 3], [o; 3]),
            };
            let p = sub(x.p, root.p);
            let w = sub(x.w, w_r);
            let v = sub(sub(x.d, d_r), cross(w_r, p));
            let a = sub(sub(x.a, a_r), cross(w_r, w));
            let two = Dd::from(2.0);
            let carried = add(cross(a_r, p), cross(w_r, cross(w_r, p)));
            let e = sub(sub(sub(x.e, e_r), carried), scaled(cross(w_r, v), two));
            // in the reference's axes
            let into = |x: V3<Dd>| turned(&root.R, x);
            let R: M3<Dd> = std::array::from_fn(|i| {
                std::array::from_fn(|j| (0..3).fold(o, |sum, k| sum + root.R[k][i] * x.R[k][j]))
            });
            (into(p), R, [into(w), into(v), into(a), into(e)], p)
        };
        let (p, R, [w, v, a, e], _) = seen(links);
        let (_, _, [_, v_b, a_b, e_b], _) = seen(bias);
        let in_axes = |x: V3<Dd>| if axes == Axes::Local { turned(&R, x) } else { x };
        let twist = |w: V3<Dd>, v: V3<Dd>| -> Vec<Dd> {
            let v = if axes == Axes::World { add(v, cross(p, w)) } else { v };
            in_axes(w).into_iter().chain(in_axes(v)).collect()
        };
        // the rate of the twist: of v + p × ω, or of Rᵀ ω and Rᵀ v
        let rate = match axes {
            Axes::Mixed => twist(a_b, e_b),
            _ => twist(a_b, sub(e_b, cross(w, v_b))),
        };
        let J: Vec<Vec<Dd>> = units
            .iter()
            .map(|links| {
                let (_, _, [w, v, ..], _) = seen(links);
                twist(w, v)
            })
            .collect();
        let J: Vec<Dd> = (0..6).flat_map(|i| J.iter().map(move |x| x[i])).collect();
        let acc: Vec<Dd> = in_axes(a).into_iter().chain(in_axes(e)).collect();

        let inv = 1.0 / self.drawn.length;
        let rows = [1.0, 1.0, 1.0, inv, inv, inv];
        let units_y = self.units(self.model.independent_names());
        let of_J: Vec<f64> = rows.iter().flat_map(|a| units_y.iter().map(move |y| a / y)).collect();
        // points that are far apart move by the turns between them
        let far = size(&p.map(|x| x.to_f64() * inv)).max(1.0);
        let name = |what: &str| format!("{what} in {} axes, {reference:?}", axes.name());
        let mut check = |what: &str, x: &[f64], exact: &[Dd], units: &[f64], least: f64| {
            self.compare(ledger, &asked, &name(what), x, exact, units, least)
        };
        // a common motion of both links cancels in the acceleration between them
        let moved = |link: &Link<Dd>| {
            size(&link.a.map(|x| x.to_f64())).max(size(&link.e.map(|x| x.to_f64() * inv)))
        };
        let acceleration = r.map_or(0.0, |r| moved(&links[r])).max(moved(&links[f]));
        let acceleration = acceleration.max(speed * speed);
        check("position", &asked.get(FramePose)[..3], &p, &[inv; 3], 1e-4 * far);
        check("twist", asked.get(FrameTwist), &twist(w, v), &rows, 1e-2 * speed * far);
        check("acc", asked.get(FrameAcc), &acc, &rows, 1e-2 * acceleration * far);
        check("Jd_yd", asked.get(JdYd), &rate, &rows, 1e-2 * speed * speed * far);
        check("J_y", asked.get(JacobianIndependent), &J, &of_J, 1e-2 * far);
    }
}
