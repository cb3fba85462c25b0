//! Derivatives of the state and of forces: see [`crate::guide::derivatives`].

use sarrus_proto::{Axes, Field, QueryOptions, Request, Status};

use crate::algorithms::{self, TreeMotion, in_root};
use crate::linalg::{factorise_tree, invert, solve_tree};
use crate::mechanism::{Cluster, Frame};
use crate::model::{Direct, Model, Scope};
use crate::plan::Plan;
use crate::plan::needed::OF_ACTUATORS;
use crate::scalar::{Real, Triple};
use crate::spatial::{Columns, Matrix, Spatial};
use crate::workspace::{Derivatives, Workspace};

impl Plan {
    /// All derivatives of the closed state, after its forces or accelerations.
    #[inline(never)]
    pub(super) fn differentiate<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
    ) -> Result<(), Status> {
        // a workspace without them does not serve this plan
        let Some(mut d) = ws.derivatives.take() else { return Err(Status::WrongSize) };
        let done = self.derivatives(model, ws, input, &mut d);
        ws.derivatives = Some(d);
        done
    }

    fn derivatives<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        d: &mut Derivatives<T>,
    ) -> Result<(), Status> {
        let forward = self.request == Request::ForwardDynamics;
        let of_actuators = self.wants_any(&OF_ACTUATORS);
        if self.steps.force_derivatives {
            self.forces_of_motion(model, ws, input, forward, d);
            if forward {
                d.tau_q.iter_mut().zip(&d.held_q).for_each(|(x, held)| *x -= *held);
            }
        }
        for &c in &model.closed_clusters {
            let closure = &model.closures[c];
            if !closure.is_linear() {
                self.close_derivatives(model, &model.clusters[c], ws, of_actuators, d)?;
            }
        }
        let observes = self.steps.observes;
        if !self.steps.force_derivatives && !observes && !self.wants(Field::DjacobianDy) {
            return Ok(());
        }
        algorithms::world_poses(model, &self.frame_bodies, &ws.motion, &mut ws.world);
        algorithms::moving_bodies(model, (&ws.qd, &ws.qdd), &ws.world, d);
        if observes {
            return self.observe(model, ws, input, d);
        }
        if !self.steps.force_derivatives {
            return Ok(());
        }
        let pushed = self.feels_wrenches();
        if let Some(slot) = self.given().slot(Field::Wrenches).filter(|_| pushed) {
            let wrenches = &input[slot.range()];
            for (k, link) in &self.wrench_links {
                let frame = &model.frames[*link];
                let of = |i: usize| T::Triple::new(wrenches[i], wrenches[i + 1], wrenches[i + 2]);
                let point = T::Triple::of(&in_root(frame, &ws.world).p);
                d.bodies[frame.body].push(point, of(6 * k), of(6 * k + 3));
            }
        }
        let rubs = self.query.options.contains(QueryOptions::FRICTION);
        algorithms::force_derivatives(model, &ws.G, pushed, rubs.then_some(&ws.qd), d);
        let n = model.sizes().n_vy;
        for cluster in nonlinear(model) {
            for k in cluster.independents() {
                let W = &d.W[k * d.widest..][..cluster.n_vy];
                let row = &mut d.tau_y[0][k * n..][cluster.independents()];
                row.iter_mut().zip(W).for_each(|(x, w)| *x += *w);
            }
        }
        if forward {
            return accelerations(model, &ws.G, d);
        }
        if !of_actuators {
            return Ok(());
        }
        actuators(model, &self.needed.scope, ws, d)
    }

    /// Forces of the motion on the tree, and those that the request or the actuators hold.
    fn forces_of_motion<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        forward: bool,
        d: &mut Derivatives<T>,
    ) {
        d.held_q.fill(T::ZERO);
        if forward {
            let wrench = self.feels_wrenches().then_some(ws.wrench.as_slice());
            let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
            let scope = &self.needed.scope;
            algorithms::newton_euler(model, scope, &tree, wrench, &mut ws.motion, &mut d.tau_q);
            self.friction(model, &ws.qd, &mut d.tau_q);
            self.each_given_force(model, input, |v, tau| d.held_q[v] = tau);
        } else {
            d.tau_q.copy_from_slice(&ws.tau_q);
            let actuators = model.order.u_v.iter().zip(&ws.tau_u);
            actuators.for_each(|(v, tau)| d.held_q[*v] = *tau);
        }
    }

    /// Ġ, H1, H2 and W of one cluster.
    fn close_derivatives<T: Real>(
        &self,
        model: &Model<T>,
        cluster: &Cluster<T>,
        ws: &Workspace<T>,
        holds: bool,
        d: &mut Derivatives<T>,
    ) -> Result<(), Status> {
        let bodies = model.bodies_of(cluster);
        let at = cluster.velocities();
        let rates = (&ws.qd[at.clone()], &ws.qdd[at.clone()]);
        let block = cluster.block();
        let G = &ws.G[block.clone()];
        let pose = (&ws.q[cluster.coordinates()], &ws.cos_sin[cluster.bodies()]);
        if !d.second.at(cluster, bodies, pose, rates) {
            return Err(Status::SingularClosure);
        }
        let results = [&mut d.Gd, &mut d.H1, &mut d.H2].map(|x| &mut x[block.clone()]);
        d.second.rates(cluster, bodies, rates, G, results);
        if self.steps.force_derivatives {
            let m = cluster.n_vy;
            let square = &mut d.products[0][..m * m];
            let mut curve = |tau: &[T], to: &mut [T]| {
                d.second.curvature(cluster, (pose.0, G), &tau[at.clone()], square);
                for (j, k) in cluster.independents().enumerate() {
                    to[k * d.widest..][..m].copy_from_slice(&square[j * m..(j + 1) * m]);
                }
            };
            curve(&d.tau_q, &mut d.W);
            if holds {
                curve(&d.held_q, &mut d.held);
            }
        }
        Ok(())
    }

    /// Writes one of the derivatives.
    #[inline(never)]
    pub(super) fn write_derivative<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        field: Field,
        out: &mut [T],
    ) {
        let Some(mut d) = ws.derivatives.take() else { return };
        let rows = &self.needed;
        let n = model.sizes().n_vy;
        let n_u = model.sizes().n_u;
        // entry (i, j) is that of row i by direction j
        let mut dense = |from: &[T], width: usize, rows: &[usize], directions: &[usize]| {
            for (out, i) in out.chunks_exact_mut(directions.len().max(1)).zip(rows) {
                out.iter_mut().zip(directions).for_each(|(x, j)| *x = from[j * width + i]);
            }
        };
        let by_y = &model.order.vy;
        match field {
            Field::DtauYDy | Field::DyddDy => dense(&d.tau_y[0], n, &rows.vy, by_y),
            Field::DtauYDyd | Field::DyddDyd => dense(&d.tau_y[1], n, &rows.vy, by_y),
            Field::DtauUDy => dense(&d.tau_u[0], n_u, &rows.u, by_y),
            Field::DtauUDyd => dense(&d.tau_u[1], n_u, &rows.u, by_y),
            Field::DtauUnactuatedDy => dense(&d.rest[0], n, &rows.vy, by_y),
            Field::DtauUnactuatedDyd => dense(&d.rest[1], n, &rows.vy, by_y),
            Field::DyddDtauU => {
                for (out, i) in out.chunks_exact_mut(n_u.max(1)).zip(&rows.vy) {
                    let column = d.ydd_of_tau_u[*i..].iter().step_by(n);
                    out.iter_mut().zip(column).for_each(|(x, y)| *x = *y);
                }
            }
            Field::TauExternal => {
                out.iter_mut().zip(&rows.vy).for_each(|(x, k)| *x = d.observer[*k][0]);
            }
            Field::Observer => {
                let rows = by_y.iter().map(|k| &d.observer[*k]);
                out.chunks_exact_mut(3).zip(rows).for_each(|(x, row)| x.copy_from_slice(row));
            }
            Field::Gd => blocks(model, out, &rows.v, |at| d.Gd[at]),
            Field::DqddDy => blocks(model, out, &rows.v, |at| d.H2[at]),
            Field::DgBiasDyd => blocks(model, out, &rows.v, |at| d.Gd[at] + d.H1[at]),
            _ => {
                for (link, out) in self.frames.iter().zip(out.chunks_exact_mut((6 * n).max(1))) {
                    self.frame_derivative(model, ws, &mut d, &model.frames[*link], out);
                }
            }
        }
        ws.derivatives = Some(d);
    }

    /// ∂(J ẏ)/∂y of a frame, in the axes and at the point of the view.
    fn frame_derivative<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        d: &mut Derivatives<T>,
        frame: &Frame<T>,
        out: &mut [T],
    ) {
        let n = model.sizes().n_vy;
        let mut moved = core::mem::take(&mut d.frame);
        let mut against = core::mem::take(&mut d.reference);
        displaced(model, &ws.G, d, frame.body, &mut moved);
        let link = self.query().reference().map(|link| &model.frames[link]);
        displaced(model, &ws.G, d, link.map_or(0, |link| link.body), &mut against);
        let V_of = |link: Option<&Frame<T>>| link.map_or(Spatial::zero(), |x| d.bodies[x.body].V);
        let V = d.bodies[frame.body].V.minus(V_of(link));
        let axes = Axes::from_code(self.query().axes).unwrap_or(Axes::Mixed);
        let at = in_root(frame, &ws.world);
        let root = link.map(|link| in_root(link, &ws.world));
        let (R, axes_of) = match (axes, &root) {
            (Axes::Local, _) => (Some(at.R), &moved),
            (_, Some(root)) => (Some(root.R), &against),
            _ => (None, &against),
        };
        let (point, point_of) = match (axes, &root) {
            (Axes::World, Some(root)) => (T::Triple::of(&root.p), &against),
            (Axes::World, None) => (T::Triple::zero(), &against),
            _ => (T::Triple::of(&at.p), &moved),
        };
        let R: Columns<T> = R.map_or(Matrix::identity(), |R| T::Triple::columns_of(&R));
        for (k, external) in model.order.vy_external.iter().enumerate() {
            let change = moved[k][1].minus(against[k][1]);
            let shift = point_of[k][0].at(point);
            let turn = axes_of[k][0].a;
            let w = change.a - turn.cross(V.a);
            let v = change.at(point).add_cross(V.a, shift) - turn.cross(V.at(point));
            let [w, v] = [w, v].map(|x| R.apply_transposed(x));
            for row in 0..3 {
                out[row * n + external] = w[row];
                out[(row + 3) * n + external] = v[row];
            }
        }
        (d.frame, d.reference) = (moved, against);
    }
}

/// The clusters whose G changes.
fn nonlinear<T: Real>(model: &Model<T>) -> impl Iterator<Item = &Cluster<T>> {
    let closed = model.closed_clusters.iter().filter(|c| !model.closures[**c].is_linear());
    closed.map(|c| &model.clusters[*c])
}

/// Displacement of a body and change of its velocity by each independent: D and Ḋ + D × V.
fn displaced<T: Real>(
    model: &Model<T>,
    G: &[T],
    d: &Derivatives<T>,
    body: usize,
    out: &mut [[Spatial<T>; 2]],
) {
    out.fill([Spatial::zero(); 2]);
    let V = d.bodies[body].V;
    let mut i = body;
    while i != 0 {
        let cluster = &model.clusters[model.cluster_of[i]];
        let first = model.bodies[i].v;
        for v in first..first + model.bodies[i].motion.n_v() {
            let of = &d.columns[v].of;
            let change = of.rate.plus(of.moved.cross(V));
            for k in 0..cluster.n_vy {
                let at = cluster.g_offset + (v - cluster.v) * cluster.n_vy + k;
                let [moved, changed] = &mut out[cluster.vy + k];
                *moved = moved.add_scaled(of.moved, G[at]);
                *changed = changed.add_scaled(change, G[at]).add_scaled(of.moved, d.H1[at]);
            }
        }
        i = model.bodies[i].parent;
    }
}

/// The rows of a block matrix of these internal velocities.
fn blocks<T: Real>(
    model: &Model<T>,
    out: &mut [T],
    velocities: &[usize],
    entry: impl Fn(usize) -> T,
) {
    out.fill(T::ZERO);
    for (row, v) in out.chunks_exact_mut(model.sizes().n_vy.max(1)).zip(velocities) {
        let cluster = &model.clusters[model.cluster_of_v[*v]];
        for (k, j) in cluster.independents().enumerate() {
            let at = cluster.g_offset + (v - cluster.v) * cluster.n_vy + k;
            row[model.order.vy_external[j]] = entry(at);
        }
    }
}

/// ∂ÿ/∂y = −M_y⁻¹ (∂τ_y/∂y − held), ∂ÿ/∂ẏ = −M_y⁻¹ ∂τ_y/∂ẏ, ∂ÿ/∂τ_u = M_y⁻¹ G_uᵀ.
fn accelerations<T: Real>(model: &Model<T>, G: &[T], d: &mut Derivatives<T>) -> Result<(), Status> {
    let n = model.sizes().n_vy;
    if !factorise_tree(&model.sparsity, &mut d.M_y) {
        return Err(Status::MassNotPositive);
    }
    d.tau_y.iter_mut().flatten().for_each(|x| *x = -*x);
    d.ydd_of_tau_u.fill(T::ZERO);
    for cluster in &model.clusters {
        for &(u, j) in &cluster.active {
            let row = &mut d.ydd_of_tau_u[u * n..][cluster.independents()];
            row.copy_from_slice(cluster.G(G).row(j));
        }
    }
    let [by_y, by_yd] = &mut d.tau_y;
    for rows in [by_y, by_yd, &mut d.ydd_of_tau_u] {
        rows.chunks_exact_mut(n.max(1)).for_each(|x| solve_tree(&model.sparsity, &d.M_y, x));
    }
    Ok(())
}

/// Derivatives of G_uᵀ τ_u + rest = τ_y, cluster by cluster: dτ_u = P (dτ_y − held) + E. With as
/// many actuators as independents P = G_u⁻ᵀ, E = 0. The least norm of more, and the least squares
/// of fewer, have with N = G_uᵀ G_u or G_u G_uᵀ
///
/// ```text
///   more    P = G_u N⁻¹    E = (1 − P G_uᵀ) ∂(G_u μ)/∂y,  μ = N⁻¹ τ_y
///   fewer   P = N⁻¹ G_u    E = N⁻¹ ∂(G_u rest)/∂y
/// ```
fn actuators<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
    d: &mut Derivatives<T>,
) -> Result<(), Status> {
    let n = model.sizes().n_vy;
    let n_u = model.sizes().n_u;
    d.rest.iter_mut().for_each(|x| x.fill(T::ZERO));
    for &Direct { vy, u, .. } in &scope.direct {
        for order in 0..2 {
            for k in 0..n {
                let x = d.tau_y[order][k * n + vy];
                match u {
                    Some(u) => d.tau_u[order][k * n_u + u] = x,
                    None => d.rest[order][k * n + vy] = x,
                }
            }
        }
    }
    for &c in &scope.joined {
        let cluster = &model.clusters[c];
        let m = cluster.n_vy;
        let own = cluster.active.len();
        projection(cluster, ws)?;
        let is_bent = own != m && own > 0 && !model.closures[c].is_linear();
        if is_bent {
            bend(model, cluster, ws, d)?;
        }
        let P = &ws.dense_spare;
        let E = &ws.dense;
        let G = cluster.G(&ws.G);
        for order in 0..2 {
            for k in 0..n {
                let local = cluster.independents().contains(&k).then(|| k - cluster.vy);
                let local = local.filter(|_| order == 0);
                let x = &mut d.x[..m];
                x.copy_from_slice(&d.tau_y[order][k * n..][cluster.independents()]);
                if local.is_some() {
                    let held = &d.held[k * d.widest..];
                    x.iter_mut().zip(held).for_each(|(x, held)| *x -= *held);
                }
                let rest = &mut d.rest[order][k * n..][cluster.independents()];
                if own < m {
                    rest.copy_from_slice(x);
                }
                for (r, &(u, v)) in cluster.active.iter().enumerate() {
                    let bent = local.filter(|_| is_bent).map_or(T::ZERO, |k| E[r * m + k]);
                    let tau =
                        (P[r * m..].iter().zip(&*x)).fold(bent, |sum, (P, x)| P.mul_add(*x, sum));
                    d.tau_u[order][k * n_u + u] = tau;
                    if own < m {
                        let row = rest.iter_mut().zip(G.row(v));
                        row.for_each(|(x, g)| *x = (-*g).mul_add(tau, *x));
                    }
                }
            }
        }
    }
    Ok(())
}

/// P (n_u × n_vy) of a cluster into `dense_spare`, and where they are not square N⁻¹ into
/// `dense_rhs`.
pub(super) fn projection<T: Real>(
    cluster: &Cluster<T>,
    ws: &mut Workspace<T>,
) -> Result<(), Status> {
    let m = cluster.n_vy;
    let own = cluster.active.len();
    let Workspace { G, dense: A, dense_rhs: inverse, dense_spare: P, .. } = ws;
    let G = cluster.G(G);
    let G_u = |r: usize, k: usize| G[(cluster.active[r].1, k)];
    if own == m {
        for (r, &(_, v)) in cluster.active.iter().enumerate() {
            (0..m).for_each(|k| A[k * m + r] = G[(v, k)]);
        }
        return if invert(A, P, m) { Ok(()) } else { Err(Status::SingularActuation) };
    }
    let side = m.min(own);
    let other = m.max(own);
    for i in 0..side {
        for j in 0..side {
            A[i * side + j] = (0..other).fold(T::ZERO, |sum, k| {
                let of = |i| if own > m { G_u(k, i) } else { G_u(i, k) };
                of(i).mul_add(of(j), sum)
            });
        }
    }
    if !invert(A, inverse, side) {
        return Err(Status::SingularActuation);
    }
    for r in 0..own {
        for k in 0..m {
            P[r * m + k] = (0..side).fold(T::ZERO, |sum, i| {
                let [a, b] = if own > m {
                    [G_u(r, i), inverse[i * side + k]]
                } else {
                    [inverse[r * side + i], G_u(i, k)]
                };
                a.mul_add(b, sum)
            });
        }
    }
    Ok(())
}

/// E (n_u × n_vy) of a cluster into `dense`, after [`projection`].
fn bend<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    ws: &mut Workspace<T>,
    d: &mut Derivatives<T>,
) -> Result<(), Status> {
    let m = cluster.n_vy;
    let own = cluster.active.len();
    let block = cluster.block();
    let G = &ws.G[block.clone()];
    let P = &ws.dense_spare;
    // μ = Pᵀ τ_u, or the rest; as rates of the independents
    for k in 0..m {
        d.x[k] = if own > m {
            let active = cluster.active.iter().enumerate();
            active.fold(T::ZERO, |sum, (r, (u, _))| P[r * m + k].mul_add(ws.tau_u[*u], sum))
        } else {
            ws.tau_rest[cluster.vy + k]
        };
    }
    for (v, rate) in d.rate[..cluster.n_v].iter_mut().enumerate() {
        let row = G[v * m..(v + 1) * m].iter().zip(&d.x);
        *rate = row.fold(T::ZERO, |sum, (g, x)| g.mul_add(*x, sum));
    }
    let bodies = model.bodies_of(cluster);
    let rates = (&d.rate[..cluster.n_v], &d.still[..cluster.n_v]);
    let pose = (&ws.q[cluster.coordinates()], &ws.cos_sin[cluster.bodies()]);
    if !d.second.at(cluster, bodies, pose, rates) {
        return Err(Status::SingularClosure);
    }
    let results = d.products.each_mut().map(|x| &mut x[..block.len()]);
    d.second.rates(cluster, bodies, rates, G, results);
    let H = |r: usize, k: usize| d.products[1][cluster.active[r].1 * m + k];
    let E = &mut ws.dense;
    for k in 0..m {
        for r in 0..own {
            E[r * m + k] = if own < m {
                let N = &ws.dense_rhs[r * own..(r + 1) * own];
                N.iter().enumerate().fold(T::ZERO, |sum, (s, x)| x.mul_add(H(s, k), sum))
            } else {
                (0..m).fold(H(r, k), |sum, i| {
                    let back = cluster
                        .active
                        .iter()
                        .enumerate()
                        .fold(T::ZERO, |sum, (s, (_, v))| G[v * m + i].mul_add(H(s, k), sum));
                    (-P[r * m + i]).mul_add(back, sum)
                })
            };
        }
    }
    Ok(())
}
