//! Wrenches, actuators and forward dynamics are compared with the oracle.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Method, Query, QueryOptions, Request};

use super::{Judge, Ledger, size};
use crate::pairs::algebra::{Matrix, eliminate};
use crate::pairs::oracle::Pose;
use crate::seed::Seeded;
use Field::{Lambda, TauU, TauUnactuated, TauY, Ydd};

impl Judge<'_> {
    /// A wrench on a link takes Gᵀ Jᵀ w off the forces; J moves the link.
    pub(super) fn pushed(
        &self,
        motion: &[(Field, &[f64]); 3],
        frame: u16,
        poses: &[Pose<Dd>],
        G: &[Dd],
        tau_y: &[Dd],
        seeded: &mut Seeded,
        ledger: &mut Ledger,
    ) {
        let n = tau_y.len();
        let name = &self.model.link_names()[usize::from(frame)];
        let link = self.of.links.iter().position(|link| link.name == *name).unwrap_or(0);
        let still = vec![Dd::ZERO; self.oracle.n_v()];
        // moments and forces of the size of the others
        let units_y = self.units(self.model.independent_names());
        let most =
            tau_y.iter().zip(&units_y).fold(0.0, |m: f64, (x, u)| m.max((x.to_f64() / u).abs()));
        let inv = 1.0 / self.drawn.length;
        let wrench: Vec<f64> = (0..6)
            .map(|k| seeded.within(-1.0, 1.0) * most * if k < 3 { 1.0 } else { inv })
            .collect();
        let mut exact = tau_y.to_vec();
        let mut J = Matrix::new(6, n);
        for k in 0..n {
            let mut e = vec![Dd::ZERO; n];
            e[k] = Dd::ONE;
            let x = self.oracle.links(poses, &self.oracle.rate(G, &e), &still)[link];
            for (i, v) in x.w.into_iter().chain(x.d).enumerate() {
                *J.at(i, k) = v;
                exact[k] += -(v * Dd::from(wrench[i]));
            }
        }
        let query = |want: &[Field], given: &[(Field, &[f64])]| {
            let set = given.iter().fold(FieldSet::EMPTY, |set, (field, _)| set.with(*field));
            let query = Query::new(Request::InverseDynamics, set, FieldSet::of(want));
            query.with_wrenches(&[frame]).with_frames(&[frame]).with_options(QueryOptions::SEARCH)
        };
        let given = [motion[0], motion[1], motion[2], (Field::Wrenches, wrench.as_slice())];
        let query = query(&[TauY, Field::JacobianIndependent], &given);
        let Some(asked) = self.run(&query, None, &given) else {
            ledger.count("no plan with wrenches");
            return;
        };
        if !asked.ok() {
            ledger.count(&format!("pushed: {}", asked.answer.status.name()));
            return;
        }
        let units: Vec<f64> = units_y.iter().map(|u| 1.0 / u).collect();
        self.compare(ledger, &asked, "tau_y with a wrench", asked.get(TauY), &exact, &units, most);
        let rows = [1.0, 1.0, 1.0, inv, inv, inv];
        let units: Vec<f64> =
            rows.iter().flat_map(|a| units_y.iter().map(move |b| a / b)).collect();
        let numbers = asked.get(Field::JacobianIndependent);
        self.compare(ledger, &asked, "J_y", numbers, J.numbers(), &units, 1e-2);
    }

    /// G_uᵀ τ_u + τ_unactuated = τ_y, and M q̈ + C = τ + Kᵀ λ.
    pub(super) fn actuators(
        &self,
        motion: &[(Field, &[f64]); 3],
        G: &[Dd],
        tau_y: &[Dd],
        tree: &[Dd],
        of_v: &[usize],
        units_v: &[f64],
        ledger: &mut Ledger,
    ) {
        let model = self.model;
        let want = [TauU, TauUnactuated, Lambda, Field::K];
        let n_y = tau_y.len();
        let Some(asked) = self.ask(Request::InverseDynamics, None, motion, &want, &[]) else {
            ledger.count("no plan for actuators");
            return;
        };
        ledger.count(&format!("actuators: {}", asked.answer.status.name()));
        if !asked.ok() {
            return;
        }
        let (_, v_names) = self.oracle.names();
        let v_of = |name: &String| v_names.iter().position(|x| x == name).unwrap_or(0);
        let active: Vec<usize> = model.active_names().iter().map(v_of).collect();
        let mut sum: Vec<Dd> = asked.get(TauUnactuated).iter().map(|x| Dd::from(*x)).collect();
        for (u, v) in asked.get(TauU).iter().zip(&active) {
            (0..n_y).for_each(|k| sum[k] += G[v * n_y + k] * Dd::from(*u));
        }
        let units: Vec<f64> =
            self.units(model.independent_names()).iter().map(|u| 1.0 / u).collect();
        // forces of actuators that nearly cancel keep the digits of the largest
        let most = asked.get(TauU).iter().zip(&active).fold(0.0, |m: f64, (u, v)| {
            (0..n_y).fold(m, |m, k| m.max((G[v * n_y + k].to_f64() * u * units[k]).abs()))
        });
        let numbers: Vec<f64> = sum.iter().map(|x| x.to_f64()).collect();
        self.compare(ledger, &asked, "tau_y from tau_u", &numbers, tau_y, &units, most);

        // the rest of the tree's forces is that of the loops
        let n_v = of_v.len();
        let mut rest: Vec<Dd> = of_v.iter().map(|v| tree[*v]).collect();
        let mut most =
            size(&rest.iter().zip(units_v).map(|(x, u)| x.to_f64() / u).collect::<Vec<_>>());
        let place = |v: &usize| of_v.iter().position(|x| x == v);
        for (u, v) in asked.get(TauU).iter().zip(&active) {
            if let Some(k) = place(v) {
                rest[k] += -Dd::from(*u);
                most = most.max((u / units_v[k]).abs());
            }
        }
        let independents = self.oracle.independents();
        for (x, v) in asked.get(TauUnactuated).iter().zip(&independents) {
            if let Some(k) = place(v) {
                rest[k] += -Dd::from(*x);
            }
        }
        let mut sum = vec![Dd::ZERO; n_v];
        for (row, lambda) in asked.get(Field::K).chunks(n_v.max(1)).zip(asked.get(Lambda)) {
            for k in 0..n_v {
                sum[k] += Dd::from(row[k]) * Dd::from(*lambda);
                most = most.max((row[k] * lambda / units_v[k]).abs());
            }
        }
        let numbers: Vec<f64> = sum.iter().map(|x| x.to_f64()).collect();
        let units: Vec<f64> = units_v.iter().map(|u| 1.0 / u).collect();
        self.compare(ledger, &asked, "K^T lambda", &numbers, &rest, &units, most);
    }

    pub(super) fn forward(
        &self,
        motion: &[(Field, &[f64]); 3],
        G: &[Dd],
        M: &Matrix<Dd>,
        c_y: &[Dd],
        units_y: &[f64],
        tau_y: &[Dd],
        seeded: &mut Seeded,
        ledger: &mut Ledger,
    ) {
        let n = c_y.len();
        let scale: Vec<f64> = (0..n).map(|i| 1.0 / M.get(i, i).to_f64().abs().sqrt()).collect();
        let solved = |tau: &[Dd]| -> Option<Vec<Dd>> {
            let mut A = Matrix::new(n, n);
            let mut B = Matrix::new(n, 1);
            for i in 0..n {
                for j in 0..n {
                    *A.at(i, j) = M.get(i, j) * Dd::from(scale[i]) * Dd::from(scale[j]);
                }
                *B.at(i, 0) = (tau[i] - c_y[i]) * Dd::from(scale[i]);
            }
            let (x, pivot) = eliminate(A, B);
            let ydd = (0..n).map(|i| x.get(i, 0) * Dd::from(scale[i])).collect();
            (pivot > 1e-12).then_some(ydd)
        };
        let tau: Vec<f64> =
            tau_y.iter().map(|x| x.to_f64() * (1.0 + seeded.within(-0.5, 0.5))).collect();
        let Some(exact) = solved(&tau.iter().map(|x| Dd::from(*x)).collect::<Vec<_>>()) else {
            ledger.count("M_y is singular");
            return;
        };
        let (_, v_names) = self.oracle.names();
        let v_of = |name: &String| v_names.iter().position(|x| x == name).unwrap_or(0);
        let active: Vec<usize> = self.model.active_names().iter().map(v_of).collect();
        let most = size(&tau.iter().zip(units_y).map(|(x, u)| x / u).collect::<Vec<_>>());
        let units_u = self.units(self.model.active_names());
        let tau_u: Vec<f64> = units_u.iter().map(|u| seeded.within(-1.0, 1.0) * most * u).collect();
        let mut of_u = vec![Dd::ZERO; n];
        for (u, v) in tau_u.iter().zip(&active) {
            (0..n).for_each(|k| of_u[k] += G[v * n + k] * Dd::from(*u));
        }
        let from_u = solved(&of_u).unwrap_or_default();
        // forces that happen to cancel the bias keep its digits
        let rest = solved(&vec![Dd::ZERO; n]).unwrap_or_default();
        let free: Vec<f64> = rest.iter().zip(units_y).map(|(x, u)| x.to_f64() * u).collect();
        let least = 1e-3 * size(&free);
        for method in Method::ALL {
            for (field, tau, exact) in [(TauY, &tau, &exact), (TauU, &tau_u, &from_u)] {
                if tau.is_empty() {
                    continue;
                }
                let given: [(Field, &[f64]); 3] = [motion[0], motion[1], (field, tau)];
                let request = Request::ForwardDynamics;
                let Some(asked) = self.ask(request, Some(method), &given, &[Ydd], &[]) else {
                    continue;
                };
                let name = format!("ydd by {} from {}", method.name(), field.name());
                ledger.count(&format!("{name}: {}", asked.answer.status.name()));
                if asked.ok() {
                    self.compare(ledger, &asked, &name, asked.get(Ydd), exact, units_y, least);
                }
            }
        }
    }
}
