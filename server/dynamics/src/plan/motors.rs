//! Capability of the actuators at a state: sets of forces and velocities along the independents,
//! margins and clips of a force, and rotors, dampers and gains seen from the independents.

use sarrus_proto::{
    Field, MOST_VERTICES, OF_ACTUATOR_FORCES, QueryError, Request, Slot, Status, most_vertices,
};

use crate::closure::Level;
use crate::linalg::{Zonotope, dot, solve_pivoted, solve_sound};
use crate::mechanism::Cluster;
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::actuation::{actuator_matrix, lesser};
use crate::plan::needed::Needed;
use crate::scalar::{Real, all_finite};
use crate::workspace::{MOST_SEGMENTS, MotorScratch, Workspace};

/// Part of a force that counts as rounding of the rest of it.
const ACROSS: f64 = 1e-9;
/// Relative difference of two margins that count as one.
const ALIKE: f64 = 1e-9;
/// A margin that actuators without control have, not one of rounded forces.
const THIN: f64 = 1e-10;

/// The clusters of the wanted independents.
#[derive(Clone, Debug)]
pub(super) struct Motors {
    clusters: Vec<usize>,
}

impl Motors {
    /// Of a query that wants some field of them; an error where a set can have too many vertices.
    pub(super) fn new<C>(
        model: &Model<C>,
        want: &sarrus_proto::FieldSet,
        needed: &Needed,
    ) -> Result<Option<Motors>, QueryError> {
        if !want.iter().any(Field::is_of_motors) {
            return Ok(None);
        }
        let is_wanted = |c: &usize| needed.vy.iter().any(|k| has(&model.clusters[*c], *k));
        let clusters: Vec<usize> = (0..model.clusters.len()).filter(is_wanted).collect();
        let n_u = clusters.iter().map(|c| model.clusters[*c].active.len()).sum();
        let p = needed.vy.len();
        let too_many = n_u > MOST_SEGMENTS || most_vertices(n_u, p + 1) == MOST_VERTICES && p > 2;
        if want.iter().any(Field::has_vertex_rows) && too_many {
            return Err(QueryError::TooMany { what: "vertices", limit: MOST_VERTICES });
        }
        let has_more = |c: &usize| model.clusters[*c].active.len() > model.clusters[*c].n_vy;
        if want.has(Field::SpeedVertices) && clusters.iter().any(has_more) {
            return Err(QueryError::NotAnOutput(Field::SpeedVertices));
        }
        Ok(Some(Motors { clusters }))
    }
}

/// True where an independent belongs to a cluster.
fn has<C>(cluster: &Cluster<C>, k: usize) -> bool {
    cluster.independents().contains(&k)
}

impl Plan {
    /// True if some wanted field reads forces of actuators or independents.
    pub(super) fn reads_forces(&self) -> bool {
        self.request != Request::Kinematics && self.wants_any(&OF_ACTUATOR_FORCES)
    }

    /// Writes every wanted field of actuators.
    pub(super) fn write_motors<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        motors: &Motors,
        input: &[T],
        output: &mut [T],
    ) -> Result<(), Status> {
        let is_finite = |c: &usize| all_finite(&ws.tau_y[model.clusters[*c].independents()]);
        if self.reads_forces() && !motors.clusters.iter().all(is_finite) {
            return Err(Status::NonFiniteInput);
        }
        let mut own = ws.motors.take().ok_or(Status::WrongSize)?;
        own.no_limit = false;
        let moves = self.steps.velocity.is_some();
        for ((limits, motor), v) in own.limits.iter_mut().zip(&model.motors).zip(&model.order.u_v) {
            *limits = if motor.has_effort() {
                motor.forces(if moves { ws.qd[*v] } else { T::ZERO })
            } else {
                [T::from_f64(f64::NAN); 2]
            };
        }
        if self.wants_any(&[Field::Margin, Field::Clip, Field::Binding]) {
            self.find_margin(model, ws, motors, &mut own);
        }
        let mut slots = self.want().slots().iter().filter(|slot| slot.field.is_of_motors());
        let written = slots.try_for_each(|slot| {
            let out = &mut output[slot.range()];
            self.write_motor_field(model, ws, motors, &mut own, (slot, input), out)?;
            out.iter_mut().for_each(|x| *x = x.plus_zero());
            // other numbers are too large to be computed with
            let may_miss = slot.field == Field::Margin || slot.field.has_vertex_rows();
            let fits = |x: &T| x.is_finite() || (own.no_limit || may_miss) && x.to_f64().is_nan();
            if out.iter().all(fits) { Ok(()) } else { Err(Status::NonFiniteInput) }
        });
        ws.motors = Some(own);
        written
    }

    fn write_motor_field<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        motors: &Motors,
        own: &mut MotorScratch<T>,
        (slot, input): (&Slot, &[T]),
        out: &mut [T],
    ) -> Result<(), Status> {
        let rows = &self.needed.vy;
        let given = |field| self.given.slot(field).map_or(&[] as &[T], |slot| &input[slot.range()]);
        let of_rotors = |_, v| at(&model.terms.rotors, v, |x| x.v).map_or(T::ZERO, |x| x.inertia);
        let of_dampers = |_, v| at(&model.terms.dampers, v, |x| x.v).map_or(T::ZERO, |x| x.damping);
        let nan = T::from_f64(f64::NAN);
        match slot.field {
            Field::TorqueVertices | Field::TorqueVerticesNet => {
                self.torque_segments(model, ws, motors, own);
                if slot.field == Field::TorqueVerticesNet {
                    own.base.iter_mut().zip(rows).for_each(|(x, k)| *x -= ws.C_net[*k]);
                }
                return write_vertices(rows.len(), own, out);
            }
            Field::SpeedVertices => {
                self.speed_segments(model, ws, motors, own)?;
                return write_vertices(rows.len(), own, out);
            }
            Field::TorqueSupport | Field::TorqueSupportNet => {
                let directions = given(Field::Directions).chunks_exact(model.sizes().n_vy.max(1));
                for (x, d) in out.iter_mut().zip(directions) {
                    *x = support(model, ws, own, d);
                    if slot.field == Field::TorqueSupportNet {
                        let bias = model.order.vy.iter().zip(d);
                        *x -= bias.fold(T::ZERO, |sum, (k, d)| ws.C_net[*k].mul_add(*d, sum));
                    }
                }
            }
            Field::ReflectedInertia => self.congruence(model, ws, of_rotors, out, 0),
            Field::ReflectedDamping => self.congruence(model, ws, of_dampers, out, 0),
            Field::ReflectedForce => {
                let force = |u, v| of_rotors(u, v) * ws.g[v];
                self.along(model, ws, force, |row, x| out[row] = x);
            }
            Field::GainsY => return self.gains(model, ws, motors, own, given(Field::GainsU), out),
            Field::Margin => out.fill(if own.margin.is_finite() { own.margin } else { nan }),
            Field::Clip => {
                let scale = lesser(T::ONE, own.margin);
                let is_known = T::ZERO.lt(own.margin) || own.margin == T::ZERO;
                let scale = if is_known { scale } else { nan };
                out.iter_mut().zip(rows).for_each(|(x, k)| *x = scale * ws.tau_y[*k]);
            }
            Field::ClipNearest => {
                let mut active = motors.clusters.iter().flat_map(|c| &model.clusters[*c].active);
                own.no_limit |= active.any(|(u, _)| !own.limits[*u][0].is_finite());
                let clipped = |u: usize, _| {
                    let [lower, upper] = own.limits[u];
                    let tau = ws.tau_u[u];
                    let tau = T::select_lt(upper, tau, upper, tau);
                    let tau = T::select_lt(tau, lower, lower, tau);
                    if lower.is_finite() { tau } else { nan }
                };
                self.along(model, ws, clipped, |row, x| out[row] = x);
            }
            Field::Binding => {
                out.fill(T::ZERO);
                for (x, v) in own.binding.iter().zip(&model.order.u_v) {
                    out[3 * model.order.v_external[*v] + 2] = *x;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The segments of the set of forces over the wanted independents, and its lowest corner.
    fn torque_segments<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        motors: &Motors,
        own: &mut MotorScratch<T>,
    ) {
        let rows = &self.needed.vy;
        let p = rows.len();
        own.base[..p].fill(T::ZERO);
        own.n = 0;
        for cluster in motors.clusters.iter().map(|c| &model.clusters[*c]) {
            let G = cluster.G(&ws.G);
            for &(u, j) in &cluster.active {
                let [lower, upper] = own.limits[u];
                own.no_limit |= !lower.is_finite();
                for (r, k) in rows.iter().enumerate() {
                    let g = if has(cluster, *k) { G[(j, k - cluster.vy)] } else { T::ZERO };
                    own.base[r] = lower.mul_add(g, own.base[r]);
                    own.segments[own.n * p + r] = (upper - lower) * g;
                }
                own.n += 1;
            }
        }
    }

    /// The segments of the set of velocities, of the columns of G_u⁻¹; fails where it is unbounded.
    fn speed_segments<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        motors: &Motors,
        own: &mut MotorScratch<T>,
    ) -> Result<(), Status> {
        let rows = &self.needed.vy;
        let p = rows.len();
        own.base[..p].fill(T::ZERO);
        own.n = 0;
        for cluster in motors.clusters.iter().map(|c| &model.clusters[*c]) {
            let m = cluster.n_vy;
            if cluster.active.len() != m {
                return Err(Status::SingularActuation);
            }
            let G = cluster.G(&ws.G);
            for (r, &(_, j)) in cluster.active.iter().enumerate() {
                for k in 0..m {
                    ws.dense[r * m + k] = G[(j, k)];
                    ws.dense_rhs[r * m + k] = if r == k { T::ONE } else { T::ZERO };
                }
            }
            solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, m, cluster.least_authority)
                .ok_or(Status::SingularActuation)?;
            for (a, &(u, _)) in cluster.active.iter().enumerate() {
                let motor = &model.motors[u];
                own.no_limit |= !motor.has_velocity();
                let most =
                    T::from_f64(if motor.has_velocity() { motor.velocity } else { f64::NAN });
                for (r, k) in rows.iter().enumerate() {
                    let inverse = match has(cluster, *k) {
                        true => ws.dense_rhs[(k - cluster.vy) * m + a],
                        false => T::ZERO,
                    };
                    own.base[r] = (-most).mul_add(inverse, own.base[r]);
                    own.segments[own.n * p + r] = (most + most) * inverse;
                }
                own.n += 1;
            }
        }
        Ok(())
    }

    /// Gᵤᵀ W G_u with the diagonal W by actuator and tree velocity, into the wanted rows from a
    /// column on.
    fn congruence<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        weight: impl Fn(usize, usize) -> T,
        out: &mut [T],
        from: usize,
    ) {
        let columns = out.len() / self.needed.vy.len().max(1);
        let n = model.sizes().n_vy;
        for (row, k) in self.needed.vy.iter().enumerate() {
            let out = &mut out[row * columns + from..][..n];
            out.fill(T::ZERO);
            for cluster in model.clusters.iter().filter(|cluster| has(cluster, *k)) {
                let G = cluster.G(&ws.G);
                for &(u, j) in &cluster.active {
                    let left = weight(u, cluster.v + j) * G[(j, k - cluster.vy)];
                    for (l, g) in cluster.independents().zip(G.row(j)) {
                        let entry = &mut out[model.order.vy_external[l]];
                        *entry = left.mul_add(*g, *entry);
                    }
                }
            }
        }
    }

    /// G_uᵀ x of the wanted rows, with x by actuator and tree velocity.
    fn along<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        x: impl Fn(usize, usize) -> T,
        mut put: impl FnMut(usize, T),
    ) {
        for (row, k) in self.needed.vy.iter().enumerate() {
            for cluster in model.clusters.iter().filter(|cluster| has(cluster, *k)) {
                let G = cluster.G(&ws.G);
                let sum = cluster.active.iter().fold(T::ZERO, |sum, &(u, j)| {
                    G[(j, k - cluster.vy)].mul_add(x(u, cluster.v + j), sum)
                });
                put(row, sum);
            }
        }
    }

    /// Gains along the independents, [K_y D_y τ_y].
    fn gains<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        motors: &Motors,
        own: &mut MotorScratch<T>,
        gains: &[T],
        out: &mut [T],
    ) -> Result<(), Status> {
        let n = model.sizes().n_vy;
        self.congruence(model, ws, |u, _| gains[2 * u], out, 0);
        self.congruence(model, ws, |u, _| gains[2 * u + 1], out, n);
        let columns = 2 * n + 1;
        let force = |u: usize, _| if self.reads_forces() { ws.tau_u[u] } else { T::ZERO };
        self.along(model, ws, force, |row, x| out[row * columns + 2 * n] = x);
        if !self.reads_forces() {
            return Ok(());
        }
        for c in motors.clusters.iter().filter(|c| !model.clusters[**c].is_serial()) {
            let cluster = &model.clusters[*c];
            bend(model, ws, *c, own)?;
            for (row, k) in self.needed.vy.iter().enumerate().filter(|(_, k)| has(cluster, **k)) {
                let bent = &own.segments[(k - cluster.vy) * cluster.n_vy..][..cluster.n_vy];
                for (l, x) in cluster.independents().zip(bent) {
                    out[row * columns + model.order.vy_external[l]] -= *x;
                }
            }
        }
        Ok(())
    }

    /// The largest s such that s τ_y lies in the set of forces, over the facets of the set of each
    /// cluster, and the actuators at their limits there.
    fn find_margin<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        motors: &Motors,
        own: &mut MotorScratch<T>,
    ) {
        own.margin = T::from_f64(f64::INFINITY);
        own.binding.fill(T::ZERO);
        for cluster in motors.clusters.iter().map(|c| &model.clusters[*c]) {
            let p = cluster.n_vy;
            if ws.tau_y[cluster.independents()].iter().all(|x| *x == T::ZERO) {
                continue;
            }
            // facets of a thin set lose their digits twice
            if cluster.active.len() == p && find_square_margin(cluster, ws, own) {
                continue;
            }
            let MotorScratch { segments, scratch, limits, binding, base, no_limit, margin, .. } =
                &mut *own;
            let tau = &ws.tau_y[cluster.independents()];
            let G = cluster.G(&ws.G);
            for (row, (u, j)) in segments.chunks_exact_mut(p).zip(&cluster.active) {
                row.copy_from_slice(G.row(*j));
                *no_limit |= !limits[*u][0].is_finite();
            }
            let segments = &segments[..cluster.active.len() * p];
            Zonotope::with(segments, p, scratch, |set, rest| {
                let across = &mut base[..p];
                across.copy_from_slice(tau);
                set.across(rest, across);
                let most = T::from_f64(ACROSS * ACROSS) * dot(tau, tau);
                if most.lt(dot(across, across)) {
                    *margin = T::ZERO;
                    binding.fill(T::ZERO);
                    return;
                }
                set.normals(rest, &mut |d| {
                    // outwards, where τ_y leaves
                    let leaves = dot(d, tau);
                    let sign = T::select_lt(leaves, T::ZERO, -T::ONE, T::ONE);
                    let acts = |g: &[T]| {
                        let c = dot(g, d);
                        let least = T::from_f64(ACROSS * ACROSS) * dot(g, g) * dot(d, d);
                        least.lt(c * c).then_some(c * sign)
                    };
                    let rows = || segments.chunks_exact(p).zip(&cluster.active);
                    let reach = rows().fold(T::ZERO, |sum, (g, (u, _))| {
                        let [lower, upper] = limits[*u];
                        acts(g).map_or(sum, |c| (c * lower).larger(c * upper) + sum)
                    });
                    let s = reach / leaves.abs();
                    if !leads(s, margin, binding) {
                        return;
                    }
                    for (g, (u, _)) in rows() {
                        if let Some(c) = acts(g) {
                            binding[*u] = T::select_lt(c, T::ZERO, -T::ONE, T::ONE);
                        }
                    }
                });
            });
        }
        if own.no_limit {
            own.margin = T::from_f64(f64::NAN);
            own.binding.fill(own.margin);
        }
    }
}

/// The margin of as many actuators as independents, by their forces; false where these are not
/// sound.
fn find_square_margin<T: Real>(
    cluster: &Cluster<T>,
    ws: &mut Workspace<T>,
    own: &mut MotorScratch<T>,
) -> bool {
    let p = cluster.n_vy;
    actuator_matrix(cluster, ws);
    let size = cluster.least_authority;
    let is_sound = solve_sound(&mut ws.dense, &mut ws.dense_rhs, p, 1, size).is_some();
    if !is_sound {
        actuator_matrix(cluster, ws);
        if solve_pivoted(&mut ws.dense, &mut ws.dense_rhs, p, 1).is_none() {
            return false;
        }
    }
    let forces = || cluster.active.iter().map(|(u, _)| *u).zip(&ws.dense_rhs);
    let reach = |[lower, upper]: [T; 2], tau: T| T::select_lt(tau, T::ZERO, lower, upper) / tau;
    // forces that few digits tell, but none of these is within the limits
    let thin = T::from_f64(THIN);
    if !is_sound && !forces().any(|(u, tau)| reach(own.limits[u], *tau).lt(thin)) {
        return false;
    }
    for (u, tau) in forces() {
        own.no_limit |= !own.limits[u][0].is_finite();
        if leads(reach(own.limits[u], *tau), &mut own.margin, &mut own.binding) {
            own.binding[u] = T::select_lt(*tau, T::ZERO, -T::ONE, T::ONE);
        }
    }
    true
}

/// Takes a margin that is the least one or like it; others of more than it bind no longer.
fn leads<T: Real>(s: T, margin: &mut T, binding: &mut [T]) -> bool {
    if !s.is_finite() || (*margin * T::from_f64(1.0 + ALIKE)).lt(s) {
        return false;
    }
    if s.lt(*margin * T::from_f64(1.0 - ALIKE)) {
        binding.fill(T::ZERO);
    }
    *margin = lesser(*margin, s);
    true
}

/// The term of a tree velocity, of a list by ascending velocity.
fn at<X>(terms: &[X], v: usize, of: impl Fn(&X) -> usize) -> Option<&X> {
    terms.binary_search_by_key(&v, of).ok().and_then(|at| terms.get(at))
}

/// The largest dᵀ G_uᵀ τ_u, Σ max(τ⁻ (G_u d), τ⁺ (G_u d)); d in the order of y.
fn support<T: Real>(model: &Model<T>, ws: &Workspace<T>, own: &mut MotorScratch<T>, d: &[T]) -> T {
    let mut sum = T::ZERO;
    for cluster in &model.clusters {
        let along = |k: usize| d[model.order.vy_external[k]];
        if cluster.independents().all(|k| along(k) == T::ZERO) {
            continue;
        }
        let G = cluster.G(&ws.G);
        for &(u, j) in &cluster.active {
            let [lower, upper] = own.limits[u];
            own.no_limit |= !lower.is_finite();
            let row = cluster.independents().zip(G.row(j));
            let c = row.fold(T::ZERO, |sum, (k, g)| g.mul_add(along(k), sum));
            sum += (lower * c).larger(upper * c);
        }
    }
    sum
}

/// Writes the vertices of the lowest corner and its segments; missing ones are NaN.
fn write_vertices<T: Real>(
    p: usize,
    own: &mut MotorScratch<T>,
    out: &mut [T],
) -> Result<(), Status> {
    let MotorScratch { segments, scratch, signs, base, n, no_limit, .. } = own;
    let segments = &segments[..*n * p];
    out.fill(T::from_f64(f64::NAN));
    if !all_finite(segments) || !all_finite(&base[..p]) {
        return if *no_limit { Ok(()) } else { Err(Status::NonFiniteInput) };
    }
    if p == 0 {
        return Ok(());
    }
    let count = Zonotope::with(segments, p, scratch, |set, rest| set.vertices(rest, signs));
    for (vertex, signs) in out.chunks_exact_mut(p).zip(&signs[..count]) {
        vertex.copy_from_slice(&base[..p]);
        for (_, g) in segments.chunks_exact(p).enumerate().filter(|(i, _)| signs >> i & 1 == 1) {
            vertex.iter_mut().zip(g).for_each(|(x, g)| *x += *g);
        }
    }
    if p == 2 {
        let written = count.min(out.len() / p) * p;
        around(&base[..p], segments, &mut out[..written]);
    }
    Ok(())
}

/// Orders points of a plane around the middle of the set.
fn around<T: Real>(base: &[T], segments: &[T], points: &mut [T]) {
    let half = T::from_f64(0.5);
    let middle: [T; 2] = core::array::from_fn(|k| {
        segments.iter().skip(k).step_by(2).fold(base[k], |sum, g| half.mul_add(*g, sum))
    });
    let arm = |point: &[T]| [point[0] - middle[0], point[1] - middle[1]];
    // the upper half of the plane first, then by the sign of the cross product
    let is_lower = |[x, y]: [T; 2]| y < T::ZERO || y == T::ZERO && x < T::ZERO;
    let is_before = |a: [T; 2], b: [T; 2]| match (is_lower(a), is_lower(b)) {
        (a_is_lower, b_is_lower) if a_is_lower != b_is_lower => b_is_lower,
        _ => T::ZERO.lt(a[0] * b[1] - a[1] * b[0]),
    };
    for end in 1..points.len() / 2 {
        let mut k = end;
        while k > 0 && is_before(arm(&points[2 * k..]), arm(&points[2 * k - 2..])) {
            points.swap(2 * k, 2 * k - 2);
            points.swap(2 * k + 1, 2 * k - 1);
            k -= 1;
        }
    }
}

/// Σ τ_u ∂²u of the actuators of a cluster (n_vy × n_vy), into the segments: g_u = Σ ∂²u ẏ ẏ is
/// quadratic, so its values at sums of two unit velocities give every second derivative.
fn bend<T: Real>(
    model: &Model<T>,
    ws: &mut Workspace<T>,
    c: usize,
    own: &mut MotorScratch<T>,
) -> Result<(), Status> {
    let cluster = &model.clusters[c];
    let m = cluster.n_vy;
    // the closure starts from the closed pose and leaves everything as it was
    let q = cluster.coordinates();
    let v = cluster.velocities();
    own.kept.clear();
    for part in [&ws.q[q.clone()], &ws.start[q.clone()], &ws.qd[v.clone()], &ws.g[v.clone()]] {
        own.kept.extend_from_slice(part);
    }
    own.kept.extend_from_slice(&ws.G[cluster.block()]);
    let tangent = core::mem::replace(&mut ws.tangent, false);
    let mut result = Ok(());
    for a in 0..m {
        for b in 0..=a {
            ws.start[q.clone()].copy_from_slice(&own.kept[..cluster.n_q]);
            ws.q[q.clone()].copy_from_slice(&own.kept[..cluster.n_q]);
            for (k, &j) in cluster.independent.iter().enumerate() {
                ws.qd[cluster.v + j] = if k == a || k == b { T::ONE } else { T::ZERO };
            }
            let outcome = ws.close(model, c, Level::Acceleration);
            if outcome.status != Status::Ok {
                result = Err(outcome.status);
            }
            let of =
                |sum: T, &(u, j): &(usize, usize)| ws.tau_u[u].mul_add(ws.g[cluster.v + j], sum);
            own.segments[a * m + b] = cluster.active.iter().fold(T::ZERO, of);
        }
    }
    let half = T::from_f64(0.5);
    for a in 0..m {
        for b in 0..a {
            let diagonal = own.segments[a * m + a] + own.segments[b * m + b];
            let mixed = half * (own.segments[a * m + b] - diagonal);
            own.segments[a * m + b] = mixed;
            own.segments[b * m + a] = mixed;
        }
    }
    ws.tangent = tangent;
    let mut from = own.kept.as_slice();
    let parts = [&mut ws.q[q.clone()], &mut ws.start[q], &mut ws.qd[v.clone()], &mut ws.g[v]];
    for part in parts.into_iter().chain([&mut ws.G[cluster.block()]]) {
        let (own, behind) = from.split_at(part.len());
        part.copy_from_slice(own);
        from = behind;
    }
    result
}
