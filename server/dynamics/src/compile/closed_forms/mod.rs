//! Reads the geometry of closed forms off a cluster at its zero pose, and measures how well it
//! fits: one file for each mechanism.

mod agreement;
mod chain;
mod dyads;
mod lengths;
mod loops;
mod parallelogram;
mod planar;
mod platform;
mod rods;

use crate::closure::{self, Closure, Formed, Numerical, constraint_residual};
use crate::compile::couplings::poses_at;
use crate::compile::geometry::norm;
use crate::description::SubmechanismKind;
use crate::mechanism::{Body, Cluster, Cut, CutRow, Dof, Motion};
use crate::scalar::{Dd, Real, Triple};
use crate::spatial::Pose;

/// A closed form and the error of each of its assumptions.
pub(super) struct Form {
    closure: Closure<Dd>,
    deviations: Vec<Deviation>,
}

/// An assumption, its joint if it is not about a loop, and its error relative to the mechanism's
/// size.
type Deviation = (&'static str, Option<usize>, f64);

/// The largest of them.
fn size(deviations: &[Deviation]) -> f64 {
    deviations.iter().fold(0.0, |worst, (_, _, size)| f64::max(worst, *size))
}

impl Form {
    /// The worst deviation and its subject; `names` has a name for each local body.
    pub(super) fn misfit(&self, names: &[String]) -> (String, f64) {
        let worst = self.deviations.iter().max_by(|a, b| a.2.total_cmp(&b.2));
        worst.map_or((String::new(), 0.0), |(what, joint, size)| match joint {
            Some(j) => (format!("{what} of {}", names[*j]), *size),
            None => ((*what).to_owned(), *size),
        })
    }

    /// Adds Newton's method on the true rows.
    pub(super) fn polish(&mut self, numerical: Numerical<Dd>) {
        match &mut self.closure {
            Closure::Coupling(coupling) => coupling.polish = Some(numerical),
            Closure::Rrpr(rrpr) => rrpr.polish = Some(numerical),
            Closure::Planar(planar) => planar.polish = Some(numerical),
            Closure::Platform(platform) => platform.polish = Some(numerical),
            Closure::Serial | Closure::Numerical(_) => {}
        }
    }

    /// True where it has the poses that Newton's method finds beside the zero pose.
    pub(super) fn agrees(
        &self,
        numerical: &Numerical<Dd>,
        cluster: &Cluster<Dd>,
        bodies: &[Body<Dd>],
    ) -> bool {
        agreement::agrees(&self.closure, numerical, cluster, bodies, self.misfit_size())
    }

    pub(super) fn misfit_size(&self) -> f64 {
        size(&self.deviations)
    }

    pub(super) fn closure(self) -> Closure<Dd> {
        self.closure
    }
}

/// The closed form of a type on this cluster with its coordinates at the zero pose: `None` for a
/// type without one, `Some(Err)` with the mismatch of the cluster.
pub(super) fn build(
    kind: SubmechanismKind,
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    order: &[usize],
    zero: &[Dd],
) -> Option<Result<Form, String>> {
    let of = Reading::new(cluster, bodies, order, zero);
    let mut form = match kind {
        SubmechanismKind::Rrpr if of.slides_on_base() => Err("slider is on the base".into()),
        SubmechanismKind::SliderCrank if !of.slides_on_base() => {
            Err("slider is not on the base".into())
        }
        SubmechanismKind::Rrpr | SubmechanismKind::SliderCrank => planar::read(&of, true),
        SubmechanismKind::FourBar => planar::read(&of, false),
        SubmechanismKind::ParallelogramChain => parallelogram::read(&of),
        SubmechanismKind::Spu2U1 | SubmechanismKind::Ups6 => platform::read(&of, false),
        SubmechanismKind::Sprr2U1 => platform::read(&of, true),
        SubmechanismKind::Surrpr2U1 => rods::read(&of),
        _ => return None,
    };
    if let Ok(form) = &mut form {
        form.deviations.push(("a loop that is open at zero", None, of.open(zero)));
    }
    Some(form)
}

/// The closed form of this cluster's geometry up to rounding, of any type; `rows`: its blocks.
pub(super) fn recognised(
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    zero: &[Dd],
    rows: &Numerical<Dd>,
    rounding: f64,
) -> Option<Box<Formed<Dd>>> {
    let order: Vec<usize> = (0..cluster.n).collect();
    let of = Reading::new(cluster, bodies, &order, zero);
    if !of.is_closed || of.open(zero) > rounding {
        return None;
    }
    let chain = || Some(closure::Form::Chain(chain::read(&of, rows, rounding)?));
    let rods = || {
        let (rods, deviations) = lengths::read(&of).ok()?;
        (size(&deviations) <= rounding).then_some(closure::Form::Rods(rods))
    };
    let steps = || Some(closure::Form::Steps(closure::Steps::new(rows, cluster)?));
    let form = form_of(&of, rounding).or_else(chain).or_else(rods).or_else(steps)?;
    Some(Box::new(Formed { form, windings: Vec::new() }))
}

/// The form of a cluster, or of a block, without iterations.
fn form_of(of: &Reading<'_>, rounding: f64) -> Option<closure::Form<Dd>> {
    let fits = |deviations: &[Deviation]| size(deviations) <= rounding;
    let named = [rods::read(of), planar::read(of, true)].into_iter();
    let legs = [false, true].into_iter().map(|offsets| platform::read(of, offsets));
    let mut named = named.chain(legs).flatten().filter(|form| fits(&form.deviations));
    Some(match named.next().map(|form| form.closure) {
        Some(Closure::Platform(platform)) => closure::Form::Platform(platform),
        Some(Closure::Planar(planar)) => closure::Form::Planar(planar),
        Some(Closure::Rrpr(rrpr)) => closure::Form::Rrpr(rrpr),
        _ => closure::Form::Dyads(dyads::read(of).ok().filter(|of| fits(&of.1))?.0),
    })
}

/// True for a plane loop of four joints of which two assemblies can meet.
pub(super) fn has_change_point(
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    order: &[usize],
    zero: &[Dd],
) -> bool {
    let zero = poses_at(cluster, bodies, zero);
    planar::has_change_point(&Reading { cluster, bodies, order, zero, is_closed: true })
}

/// A cluster at zero, from which a closed form is read.
struct Reading<'a> {
    cluster: &'a Cluster<Dd>,
    bodies: &'a [Body<Dd>],
    /// Local joints in the order in which the submechanism lists them.
    order: &'a [usize],
    /// Pose of each local body with all coordinates zero {cluster's parent body}.
    zero: Vec<Pose<Dd>>,
    /// That is the zero pose, at which the loops are closed.
    is_closed: bool,
}

impl<'a> Reading<'a> {
    /// The cluster with its coordinates at the zero pose.
    fn new(
        cluster: &'a Cluster<Dd>,
        bodies: &'a [Body<Dd>],
        order: &'a [usize],
        zero: &[Dd],
    ) -> Reading<'a> {
        let mut rest = vec![Dd::ZERO; cluster.n_q];
        for dof in cluster.dofs.iter().filter(|dof| !dof.single && dof.k == 0) {
            rest[dof.q + dof.motion.n_q() - 1] = Dd::ONE;
        }
        let is_closed = rest == zero;
        Reading { cluster, bodies, order, zero: poses_at(cluster, bodies, &rest), is_closed }
    }

    /// The independent degrees of freedom from the base to the platform that they carry, each with
    /// its place in y; and the platform's local body.
    fn chain(&self) -> Result<(Vec<(Dof, usize)>, usize), String> {
        let of = |(k, v): (usize, &usize)| (self.cluster.dofs[*v], k);
        let mut chain: Vec<(Dof, usize)> =
            self.cluster.independent.iter().enumerate().map(of).collect();
        chain.sort_by_key(|(at, _)| (self.depth(at.body), at.k));
        let mut below = 0;
        for (at, _) in chain.iter().filter(|(at, _)| at.k == 0) {
            if self.cluster.local_parent[at.body] != below {
                return Err("independent joints do not carry the platform one on the other".into());
            }
            below = at.body + 1;
        }
        Ok((chain, below))
    }

    /// The degree of freedom of a joint that has one.
    fn dof(&self, j: usize) -> Dof {
        self.cluster.dofs[self.bodies[j].v - self.cluster.v]
    }

    /// True where a joint's degrees of freedom are independent.
    fn is_independent(&self, j: usize) -> bool {
        self.cluster.independent.contains(&(self.bodies[j].v - self.cluster.v))
    }

    /// True where a slider hangs on the base: of a slider-crank, and not of a lambda.
    fn slides_on_base(&self) -> bool {
        let slides =
            |(body, parent): (&Body<Dd>, &usize)| body.motion == Motion::Prismatic && *parent == 0;
        self.bodies.iter().zip(&self.cluster.local_parent).any(slides)
    }

    /// True where every joint has one degree of freedom, so that one index serves joints,
    /// velocities and coordinates.
    fn is_simple(&self) -> bool {
        self.cluster.n_q == self.cluster.n
    }

    /// For each slider the two turns between the base and it, in the order of the list.
    fn triples(&self) -> Result<Vec<[usize; 3]>, String> {
        let above = |j: usize| self.cluster.local_parent[j].checked_sub(1);
        let sliders = self
            .order
            .iter()
            .filter(|j| self.bodies[**j].motion == Motion::Prismatic && !self.is_independent(**j));
        sliders
            .map(|&j3| match above(j3).and_then(|j2| Some([above(j2)?, j2, j3])) {
                Some([j1, j2, j3])
                    if above(j1).is_none()
                        && [j1, j2].iter().all(|j| self.bodies[*j].motion == Motion::Revolute) =>
                {
                    Ok([j1, j2, j3])
                }
                _ => Err("leg is not a universal joint on the base and a slider".into()),
            })
            .collect()
    }

    /// How far the loops are open at the zero pose: a form takes the cut from one end.
    fn open(&self, zero: &[Dd]) -> f64 {
        let mut phi = vec![Dd::ZERO; self.cluster.rows.len()];
        let pose = poses_at(self.cluster, self.bodies, zero);
        constraint_residual(self.cluster, &pose, zero, &mut phi);
        let rows = self
            .cluster
            .cuts
            .iter()
            .flat_map(|cut| &cut.rows)
            .zip(&phi)
            .filter(|(row, _)| row.terms.is_empty());
        let size =
            |row: &CutRow<Dd>| if norm(&row.linear) > Dd::ZERO { self.cluster.length } else { 1.0 };
        rows.fold(0.0, |open: f64, (row, phi)| open.max(phi.to_f64().abs() / size(row)))
    }

    fn depth(&self, j: usize) -> usize {
        match self.cluster.local_parent[j] {
            0 => 0,
            parent => 1 + self.depth(parent - 1),
        }
    }
}

/// True when the cut is between these two local bodies, either way round.
fn ties(cut: &Cut<Dd>, a: usize, b: usize) -> bool {
    (cut.predecessor, cut.successor) == (a, b) || (cut.predecessor, cut.successor) == (b, a)
}

/// True when the cut is a ball joint: three rows in independent directions.
fn is_ball(cut: &Cut<Dd>) -> bool {
    if cut.angular || cut.rows.len() != 3 {
        return false;
    }
    let [x, y, z] = [0, 1, 2].map(|r| cut.rows[r].linear);
    let volume = x.dot(y.cross(z)).abs();
    volume.to_f64() > 1e-3 * (norm(&x) * norm(&y) * norm(&z)).to_f64()
}

/// ±1.
fn sign(x: Dd) -> Dd {
    if x < Dd::ZERO { -Dd::ONE } else { Dd::ONE }
}
