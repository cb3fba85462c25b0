//! A state is solved and every field of the answer compared.

use std::f64::consts::TAU;

use sarrus_dynamics::description::{Joint, JointKind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, Request, Status, Warnings};

use super::{COARSE, FINE, HELD, Judge, Ledger, REGULAR, SOUGHT, size};
use crate::pairs::algebra::Matrix;
use crate::pairs::draw::Features;
use crate::pairs::oracle::{Motion, Oracle};
use crate::seed::Seeded;
use Field::{
    CY, FrameAcc, FramePose, FrameTwist, GBias, KBias, Limits, MY, Q, Qd, Qdd, Residual, TauQ,
    TauY, U, Ud, Udd, Y, Yd, Ydd,
};

impl Judge<'_> {
    pub(super) fn state(&self, with: Features, seeded: &mut Seeded, ledger: &mut Ledger) {
        let of = self.of;
        let oracle = &self.oracle;
        let model = self.model;
        let length = self.drawn.length;
        let unit = |j: usize| if of.joints[j].kind == JointKind::Prismatic { length } else { 1.0 };

        // targets of the independents that are left
        let zero: Vec<f64> = oracle.zero();
        let mut targets: Vec<(usize, f64)> = Vec::new();
        let mut y = Vec::new();
        let mut seen = Vec::new();
        for name in model.independent_q_names() {
            let base = name.split('/').next().unwrap_or_default();
            let j = of.joints.iter().position(|x| x.name == base).unwrap_or(0);
            if seen.contains(&j) {
                continue;
            }
            seen.push(j);
            let q = oracle.coordinate(j);
            match of.joints[j].kind {
                JointKind::Spherical | JointKind::Floating => {
                    let floats = of.joints[j].kind == JointKind::Floating;
                    if floats {
                        let far = if with.far { 10f64.powf(seeded.within(0.0, 6.0)) } else { 1.0 };
                        y.extend(seeded.vector(far * length));
                    }
                    let quaternion = [(); 4].map(|()| seeded.within(-1.0, 1.0) + 0.3);
                    let n = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                    y.extend(quaternion.map(|x| x / n));
                    let first = y.len() - if floats { 7 } else { 4 };
                    targets.extend(y[first..].iter().enumerate().map(|(k, x)| (q + k, *x)));
                }
                _ => {
                    let far = if with.turns && seeded.chance(0.5) { 10.0 } else { 1.0 };
                    let x = seeded.within(-1.0, 1.0) * self.drawn.reach[j] * unit(j) * far;
                    y.push(x);
                    targets.push((q, x));
                }
            }
        }
        let units_y = self.units(model.independent_names());
        let yd: Vec<f64> = units_y.iter().map(|u| seeded.within(-2.0, 2.0) / u).collect();
        let ydd: Vec<f64> = units_y.iter().map(|u| seeded.within(-4.0, 4.0) / u).collect();

        // the path: locked joints first, of the whole robot, then the rest
        let path = self.path(&zero, &targets, COARSE);
        let regular = path.as_ref().is_some_and(|(_, pivot)| *pivot > REGULAR);

        let frames = [(model.link_names().len() - 1) as u16, (model.link_names().len() / 2) as u16];
        let motion: [(Field, &[f64]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
        let want = [
            Q,
            Qd,
            Qdd,
            U,
            Ud,
            Udd,
            Field::G,
            GBias,
            Field::K,
            KBias,
            MY,
            CY,
            TauY,
            TauQ,
            FramePose,
            FrameTwist,
            FrameAcc,
            Limits,
            Residual,
        ];
        let Some(asked) = self.ask(Request::InverseDynamics, None, &motion, &want, &frames) else {
            ledger.count("no plan");
            self.report(ledger, "no plan", 1.0);
            return;
        };
        ledger.count(asked.answer.status.name());
        for name in asked.answer.warnings.names() {
            ledger.count(name);
        }
        if !asked.ok() {
            // a coarse path may miss a singular pose between two steps
            let finely = || self.path(&zero, &targets, FINE).is_some_and(|(_, x)| x > REGULAR);
            if regular && finely() {
                ledger.refused.push(format!(
                    "{}, {}: {}: {} at a regular pose",
                    self.pair,
                    self.seed,
                    self.drawn.name,
                    asked.answer.status.name()
                ));
            }
            if asked.answer.status == Status::Unreachable && seeded.chance(SOUGHT) {
                self.nearest(&y, ledger);
            }
            return;
        }

        // nothing says where joints are that are gone
        if self.is_reduced && path.is_none() {
            ledger.count("not judged");
            return;
        }

        // q of the answer in the order of the oracle, polished
        let (q_names, v_names) = oracle.names();
        let at = |names: &[String], within: &[String]| -> Vec<usize> {
            let place = |name: &String| within.iter().position(|x| x == name).unwrap_or(0);
            names.iter().map(place).collect()
        };
        let of_q = at(model.tree_q_names(), &q_names);
        let of_v = at(model.tree_names(), &v_names);
        let mut near: Vec<f64> = match &path {
            Some((q, _)) => q.clone(),
            None => zero.clone(),
        };
        self.held.iter().for_each(|(j, x)| near[oracle.coordinate(*j)] = *x);
        of_q.iter().zip(asked.get(Q)).for_each(|(i, x)| near[*i] = *x);
        let mut exact: Vec<Dd> = near.iter().map(|x| Dd::from(*x)).collect();
        let of_independents = oracle.independent_q();
        of_independents.iter().zip(&y).for_each(|(i, y)| exact[*i] = Dd::from(*y));
        let Some((_, pivot)) = oracle.close(&mut exact, 12) else {
            // joints that are gone may stand elsewhere than the path says
            if self.is_reduced && !regular {
                ledger.count("not judged");
            } else if asked.warned(Warnings::ILL_CONDITIONED) || asked.warned(Warnings::LOOP_OPEN) {
                ledger.count("warned, no reference");
            } else {
                self.report(ledger, "q is not near a closed pose", f64::INFINITY);
            }
            return;
        };
        let rates = oracle.rates(&exact, &yd.iter().map(|x| Dd::from(*x)).collect::<Vec<_>>());
        if pivot < 1e-7 || rates.pivot < 1e-7 {
            ledger.count("singular, not judged");
            return;
        }
        let dd = |x: &[f64]| -> Vec<Dd> { x.iter().map(|x| Dd::from(*x)).collect() };
        let pick =
            |of: &[Dd], places: &[usize]| -> Vec<Dd> { places.iter().map(|i| of[*i]).collect() };
        let n_y = yd.len();
        let units_q = self.units(model.tree_q_names());
        let units_v = self.units(model.tree_names());
        let inverse = |units: &[f64]| -> Vec<f64> { units.iter().map(|u| 1.0 / u).collect() };
        let qd = oracle.rate(&rates.G, &dd(&yd));
        let qdd: Vec<Dd> =
            oracle.rate(&rates.G, &dd(&ydd)).iter().zip(&rates.g).map(|(x, g)| *x + *g).collect();
        let speed = size(&yd.iter().zip(&units_y).map(|(x, u)| x * u).collect::<Vec<_>>());
        let acceleration = size(&ydd.iter().zip(&units_y).map(|(x, u)| x * u).collect::<Vec<_>>())
            .max(speed * speed);

        self.compare(ledger, &asked, "q", asked.get(Q), &pick(&exact, &of_q), &units_q, 1e-4);
        self.compare(
            ledger,
            &asked,
            "qd",
            asked.get(Qd),
            &pick(&qd, &of_v),
            &units_v,
            1e-6 * speed,
        );
        self.compare(
            ledger,
            &asked,
            "qdd",
            asked.get(Qdd),
            &pick(&qdd, &of_v),
            &units_v,
            1e-6 * acceleration,
        );
        self.compare(
            ledger,
            &asked,
            "g",
            asked.get(GBias),
            &pick(&rates.g, &of_v),
            &units_v,
            // rounding of terms that cancel in mechanisms that move without bias
            1e-2 * speed * speed,
        );
        let G: Vec<Dd> =
            of_v.iter().flat_map(|v| rates.G[v * n_y..(v + 1) * n_y].to_vec()).collect();
        let units_G: Vec<f64> =
            units_v.iter().flat_map(|u| units_y.iter().map(move |y| u / y)).collect();
        self.compare(ledger, &asked, "G", asked.get(Field::G), &G, &units_G, 1e-6);

        let units_G_all: Vec<f64> = G.iter().zip(&units_G).map(|(g, u)| g.to_f64() * u).collect();

        // assembly and whole turns
        let other = |path: &[f64]| {
            let single = model.independent_names().len() == 1;
            of_q.iter().enumerate().find(|(k, i)| {
                let name = &q_names[**i];
                let slides =
                    |joint: &Joint| joint.name == *name && joint.kind == JointKind::Prismatic;
                let mut apart = asked.get(Q)[*k] - path[**i];
                if !single && !of.joints.iter().any(slides) {
                    apart -= TAU * (apart / TAU).round();
                }
                let apart = (apart * units_q[*k]).abs();
                !name.contains('/') && apart > 1e-3 * path[**i].abs().max(1.0)
            })
        };
        if regular
            && path.as_ref().is_some_and(|(path, _)| other(path).is_some())
            && let Some((fine, pivot)) = self.path(&zero, &targets, FINE)
            && pivot > REGULAR
            && let Some((k, i)) = other(&fine)
        {
            let far = (asked.get(Q)[k] - fine[*i]).abs();
            let what = format!("{} of another assembly or turn at y = {y:?}", q_names[*i]);
            self.report(ledger, &what, far);
        }

        // dynamics
        let poses = oracle.poses(&exact);
        let tree = oracle.forces(&exact, &poses, &qd, &qdd);
        let project = |tau: &[Dd]| -> Vec<Dd> {
            (0..n_y)
                .map(|k| {
                    (0..tau.len()).fold(Dd::ZERO, |sum, v| sum + rates.G[v * n_y + k] * tau[v])
                })
                .collect()
        };
        let tau_y = project(&tree);
        let c_y = project(&oracle.forces(&exact, &poses, &qd, &rates.g));
        let mut M = Matrix::new(n_y, n_y);
        for k in 0..n_y {
            let mut e = vec![Dd::ZERO; n_y];
            e[k] = Dd::ONE;
            let mut one: Vec<Dd> = oracle.rate(&rates.G, &e);
            one.iter_mut().zip(&rates.g).for_each(|(x, g)| *x += *g);
            let column = project(&oracle.forces(&exact, &poses, &qd, &one));
            (0..n_y).for_each(|i| *M.at(i, k) = column[i] - c_y[i]);
        }
        let units_M: Vec<f64> =
            units_y.iter().flat_map(|a| units_y.iter().map(move |b| 1.0 / (a * b))).collect();
        let forces_y = inverse(&units_y);
        self.compare(
            ledger,
            &asked,
            "tau_q",
            asked.get(TauQ),
            &pick(&tree, &of_v),
            &inverse(&units_v),
            0.0,
        );
        self.compare(ledger, &asked, "tau_y", asked.get(TauY), &tau_y, &forces_y, 0.0);
        self.compare(ledger, &asked, "C_y", asked.get(CY), &c_y, &forces_y, 0.0);
        self.compare(ledger, &asked, "M_y", asked.get(MY), M.numbers(), &units_M, 0.0);

        // frames
        let links = oracle.links(&poses, &qd, &qdd);
        for (k, frame) in frames.iter().enumerate() {
            let name = &model.link_names()[usize::from(*frame)];
            let link = of.links.iter().position(|link| link.name == *name).unwrap_or(0);
            let x = &links[link];
            let pose = asked.get(FramePose);
            let inv = 1.0 / length;
            self.compare(
                ledger,
                &asked,
                "position",
                &pose[7 * k..7 * k + 3],
                &x.p,
                &[inv; 3],
                1e-4,
            );
            let twist = asked.get(FrameTwist);
            let [w, d] = [x.w, x.d];
            let all: Vec<Dd> = w.into_iter().chain(d).collect();
            let units = [1.0, 1.0, 1.0, inv, inv, inv];
            self.compare(
                ledger,
                &asked,
                "twist",
                &twist[6 * k..6 * k + 6],
                &all,
                &units,
                1e-2 * speed,
            );
            let all: Vec<Dd> = x.a.into_iter().chain(x.e).collect();
            let acc = asked.get(FrameAcc);
            self.compare(
                ledger,
                &asked,
                "acc",
                &acc[6 * k..6 * k + 6],
                &all,
                &units,
                1e-2 * acceleration,
            );
        }

        if with.sums {
            let moved = Motion { q: exact.clone(), qd: qd.clone(), qdd: qdd.clone() };
            self.sums(&motion, frames, &exact, &rates, &moved, speed, ledger);
        }
        self.pushed(&motion, frames[0], &poses, &rates.G, &tau_y, seeded, ledger);

        // K G = 0 and K q̈ = k
        let K = asked.get(Field::K);
        let n_v = of_v.len();
        let of_qdd = of_v.iter().zip(&units_v).fold(acceleration, |m: f64, (v, u)| {
            m.max((qdd[*v].to_f64() * u).abs()).max((rates.g[*v].to_f64() * u).abs())
        });
        for (r, row) in K.chunks(n_v.max(1)).enumerate() {
            let mut worst = 0.0_f64;
            let mut most = 0.0_f64;
            for c in 0..n_y {
                let terms = row.iter().zip(&of_v).map(|(k, v)| Dd::from(*k) * rates.G[v * n_y + c]);
                let mut sum = Dd::ZERO;
                let mut abs = 0.0;
                terms.for_each(|x| {
                    sum += x;
                    abs += x.to_f64().abs();
                });
                worst = worst.max(sum.to_f64().abs() * 1.0 / units_y[c]);
                most = most.max(abs / units_y[c]);
            }
            // a row that every motion satisfies is rounding
            let largest = size(&row.iter().zip(&units_v).map(|(k, u)| k / u).collect::<Vec<_>>());
            let of_G = size(&units_G_all).max(1.0);
            let row_size = largest.max(self.declared(&model.loop_names()[r])) * of_G;
            let error = worst / most.max(1e-6 * row_size);
            if worst > 0.0
                && error > HELD
                && !asked.warned(Warnings::ILL_CONDITIONED)
                && !asked.warned(Warnings::LOOP_OPEN)
            {
                self.report(ledger, &format!("K G of row {}", model.loop_names()[r]), error);
            }
            let along: Vec<Dd> =
                row.iter().zip(&of_v).map(|(k, v)| Dd::from(*k) * qdd[*v]).collect();
            let sum = along.iter().fold(Dd::ZERO, |sum, x| sum + *x);
            let most = along.iter().fold(0.0, |m: f64, x| m + x.to_f64().abs());
            let off = (sum - Dd::from(asked.get(KBias)[r])).to_f64().abs();
            let error = off / most.max(1e-4 * row_size * of_qdd);
            if off > 0.0
                && error > HELD
                && !asked.warned(Warnings::ILL_CONDITIONED)
                && !asked.warned(Warnings::LOOP_OPEN)
            {
                self.report(ledger, &format!("K qdd of row {}", model.loop_names()[r]), error);
            }
        }
        // rows as they were described
        if !self.is_reduced && K.len() == oracle.n_rows() * n_v && (with.redundant || with.oblique)
        {
            let given = Oracle::new(self.rows_of, &self.independent, &[], length);
            let exact_K = given.jacobian(&exact, &poses);
            // cuts come before couplings of their part; only robots without couplings are compared
            if of.joints.iter().all(|joint| joint.coupling.is_none()) {
                for r in 0..oracle.n_rows() {
                    let row: Vec<Dd> = of_v.iter().map(|v| exact_K.get(r, *v)).collect();
                    let units = inverse(&units_v);
                    let least = 1e-6 * self.declared(&model.loop_names()[r]);
                    let row_of_K = &K[r * n_v..(r + 1) * n_v];
                    self.compare(ledger, &asked, "row of K", row_of_K, &row, &units, least);
                }
            }
        }

        // limits
        let limits = asked.get(Limits);
        let mut exceeded = false;
        let mut doubtful = false;
        for (k, name) in model.tree_names().iter().enumerate() {
            let Some(joint) = of.joints.iter().find(|joint| joint.name == *name) else { continue };
            let Some(limit) = joint.limits else { continue };
            let i = q_names.iter().position(|x| x == name).unwrap_or(0);
            let x = exact[i].to_f64();
            let v = qd[of_v[k]].to_f64();
            for (column, x, low, high) in
                [(0, x, limit.lower, limit.upper), (1, v, -limit.velocity, limit.velocity)]
            {
                let by = if x < low {
                    x - low
                } else if x > high {
                    x - high
                } else {
                    0.0
                };
                let near = |a: f64| (x - a).abs() < 1e-9 * (x.abs() + 1.0);
                doubtful |= near(low) || near(high);
                exceeded |= by != 0.0;
                let off = (limits[3 * k + column] - by).abs();
                if off > 1e-8 * (x.abs().max(1.0))
                    && !near(low)
                    && !near(high)
                    && !asked.warned(Warnings::ILL_CONDITIONED)
                {
                    self.report(ledger, &format!("limit {column} of {name}"), off);
                }
            }
        }
        let warned = asked.warned(Warnings::LIMITS_EXCEEDED);
        if exceeded != warned && !doubtful {
            self.report(ledger, &format!("limits exceeded {exceeded}, warned {warned}"), 1.0);
        }

        self.actuators(&motion, &rates.G, &tau_y, &tree, &of_v, &units_v, ledger);
        self.forward(&motion, &rates.G, &M, &c_y, &units_y, &tau_y, seeded, ledger);
        self.given_q(&asked, &units_q, seeded, ledger);
        self.given_u(&asked, ledger);
        self.abreast(&motion, ledger);
    }
}
