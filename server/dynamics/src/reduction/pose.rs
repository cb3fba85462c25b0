//! The pose of the robot with some joints held: the closed pose of the whole robot, and the joints
//! that stay in it.

use std::collections::{BTreeMap, BTreeSet};

use sarrus_proto::{Field, FieldSet, Query, Request};

use crate::compile::Structure;
use crate::description::{Description, JointKind, SubmechanismKind};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::initial_pose::n_q;
use crate::model::Model;
use crate::plan::Planned;
use crate::reduction::choice::Choice;
use crate::scalar::{Dd, Real, noise};

/// Number of poses at which joints are checked for motion, and their distance, in radians or
/// mechanism lengths.
const POSES: usize = 3;
const REACH: f64 = 0.1;
/// Coordinates that count as rest at the zero pose: the compiler closes such a pose.
const REST: f64 = 1e-12;
/// Velocity of a still joint, relative to that of the remaining independents.
const STILL: f64 = 1e-9;

/// The still joints, and the others of their mechanisms.
#[derive(Default)]
pub(super) struct Held {
    /// Position of each still joint of one freedom.
    pub(super) at: BTreeMap<usize, f64>,
    /// Coordinates of each still joint.
    pub(super) fixed: BTreeMap<usize, Vec<f64>>,
    /// Joints that still move, each with its cluster.
    pub(super) remaining: BTreeSet<(usize, usize)>,
    /// Coordinates of those that loops determine and that are not zero at y = 0.
    pub(super) elsewhere: Vec<(usize, Vec<f64>)>,
}

impl Held {
    /// Finds them for all clusters with locked joints.
    pub(super) fn find(
        description: &Description,
        structure: &Structure,
        choices: &[Choice],
    ) -> Result<Held, CompileError> {
        let mut held = Held::default();
        for &(j, x) in choices.iter().filter(|of| !of.closed).flat_map(|of| &of.locked) {
            held.fix(j, at(description.joints[j].kind, x));
        }
        let closed: Vec<&Choice> = choices.iter().filter(|of| of.closed).collect();
        if closed.is_empty() {
            return Ok(held);
        }
        let trial = Trial::new(description, structure, &closed)?;
        let Some((q, _)) = trial.pose(0) else { return Err(trial.fault(description, &closed)) };
        let still = trial.still();
        for of in closed {
            for &j in &structure.clusters[of.cluster] {
                let own = q[j].clone();
                let is_locked = of.locked.iter().any(|lock| lock.0 == j);
                let is_free = of.independent.contains(&j);
                if of.independent.is_empty() || is_locked || (!is_free && still.contains(&j)) {
                    held.fix(j, own);
                    continue;
                }
                held.remaining.insert((j, of.cluster));
                let kind = description.joints[j].kind;
                let is_at_rest = own.iter().zip(at(kind, 0.0)).all(|(q, x)| (q - x).abs() < REST);
                if !is_free && structure.has_loop(of.cluster) && !is_at_rest {
                    held.elsewhere.push((j, own));
                }
            }
        }
        Ok(held)
    }

    fn fix(&mut self, j: usize, q: Vec<f64>) {
        if let [x] = q[..] {
            self.at.insert(j, x);
        }
        self.fixed.insert(j, q);
    }
}

/// Where a joint is at the zero pose of its robot.
pub(super) fn zero_position(description: &Description, model: &Model<Dd>, joint: usize) -> f64 {
    let mut names = description.submechanisms.iter().flat_map(|of| &of.spanning_tree);
    let e: usize = (names.by_ref().take_while(|j| **j != joint))
        .map(|j| n_q(description.joints[*j].kind))
        .sum();
    model.order.q.get(e).map_or(0.0, |q| model.zero[*q].to_f64())
}

/// The whole robot, with the locked joints as independents.
struct Trial {
    description: Description,
    model: Model<Dd>,
    /// y at which the joints are locked, and for each coordinate how far it may go from there.
    y: Vec<f64>,
    reach: Vec<f64>,
    /// Whether the joint of each coordinate is independent still.
    left: Vec<bool>,
}

impl Trial {
    fn new(
        description: &Description,
        structure: &Structure,
        choices: &[&Choice],
    ) -> Result<Trial, CompileError> {
        let mut trial = description.clone();
        for (s, of) in trial.submechanisms.iter_mut().enumerate() {
            for choice in choices {
                let joints = &structure.clusters[choice.cluster];
                let others = choice.locked.iter().map(|lock| lock.0);
                let others = others.filter(|j| !of.independent.contains(j));
                let others: Vec<usize> = others.filter(|j| of.spanning_tree.contains(j)).collect();
                let is_changed = !choice.dropped.is_empty();
                of.independent.retain(|j| !choice.dropped.contains(j));
                of.independent.extend(others);
                // a closed form is driven by its own independents
                if is_changed && of.spanning_tree.iter().any(|j| joints.contains(j)) {
                    of.kind = SubmechanismKind::Numerical;
                    of.loops.clone_from(&structure.loops[s]);
                }
            }
        }
        let compiled = Model::compile(&trial)?;
        let lengths: Vec<f64> = compiled.model.closures().iter().map(|of| of.length).collect();
        let mut y = Vec::new();
        let mut reach = Vec::new();
        let mut left = Vec::new();
        for (s, of) in trial.submechanisms.iter().enumerate() {
            for j in &of.independent {
                let kind = trial.joints[*j].kind;
                let locks = choices.iter().flat_map(|of| &of.locked);
                let position = locks.into_iter().find(|lock| lock.0 == *j).map(|lock| lock.1);
                let is_left = choices.iter().any(|of| of.independent.contains(j));
                let unit = match kind {
                    JointKind::Revolute | JointKind::Continuous => 1.0,
                    JointKind::Prismatic => lengths[s],
                    _ => 0.0,
                };
                y.extend(at(kind, position.unwrap_or(0.0)));
                reach.resize(y.len(), if is_left { REACH * unit } else { 0.0 });
                left.resize(y.len(), is_left);
            }
        }
        Ok(Trial { description: trial, model: compiled.exact, y, reach, left })
    }

    /// Coordinates of each joint at the k-th pose around the locks, and for each whether it stands
    /// still while the independents move that are left; `None` where the loops do not close.
    fn pose(&self, k: usize) -> Option<(Vec<Vec<f64>>, Vec<bool>)> {
        let model = &self.model;
        let description = &self.description;
        let want = FieldSet::of(&[Field::Q, Field::G]);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let off = |i: usize| if k == 0 { 0.0 } else { self.reach[i] * noise(53 * k + i) };
        let y: Vec<Dd> =
            self.y.iter().enumerate().map(|(i, y)| Dd::from_f64(*y + off(i))).collect();
        let planned = Planned::answered(model, &query, &[(Field::Y, &y)])?;
        let [q, G] = [Field::Q, Field::G].map(|field| planned.get(field));
        let n_vy = model.sizes().n_vy;
        // the columns of the independents that are left
        let kinds = |of: &[usize]| -> Vec<(usize, JointKind)> {
            of.iter().map(|j| (*j, description.joints[*j].kind)).collect()
        };
        let mut columns = Vec::new();
        let mut at_y = 0;
        for (_, kind) in description.submechanisms.iter().flat_map(|of| kinds(&of.independent)) {
            columns.resize(columns.len() + n_v(kind), self.left[at_y]);
            at_y += n_q(kind);
        }
        let mut at_q = 0;
        let mut at_v = 0;
        let mut found = vec![Vec::new(); description.joints.len()];
        let mut still = vec![false; description.joints.len()];
        for (j, kind) in description.submechanisms.iter().flat_map(|of| kinds(&of.spanning_tree)) {
            found[j] = q[at_q..at_q + n_q(kind)].iter().map(|x| x.to_f64()).collect();
            still[j] = (at_v..at_v + n_v(kind)).all(|v| {
                let row = G[v * n_vy..(v + 1) * n_vy].iter().zip(&columns);
                row.filter(|(_, is_left)| **is_left).all(|(x, _)| x.to_f64().abs() < STILL)
            });
            (at_q, at_v) = (at_q + n_q(kind), at_v + n_v(kind));
        }
        Some((found, still))
    }

    /// Joints that the independents that are left do not move, at several poses.
    fn still(&self) -> BTreeSet<usize> {
        let poses: Vec<Vec<bool>> =
            (0..POSES).filter_map(|k| self.pose(k)).map(|pose| pose.1).collect();
        let is_still = |j: &usize| poses.len() > 1 && poses.iter().all(|pose| pose[*j]);
        // a joint of several degrees of freedom at rest has no reach, and is left alone
        let moves = self.reach.iter().any(|reach| *reach != 0.0);
        (0..self.description.joints.len()).filter(|j| moves && is_still(j)).collect()
    }

    /// A pose that is not reached.
    fn fault(&self, description: &Description, choices: &[&Choice]) -> CompileError {
        let locks = || choices.iter().flat_map(|of| &of.locked);
        let name = |(j, x): &(usize, f64)| format!("{} at {x}", description.joints[*j].name);
        let names = locks().map(name).collect::<Vec<_>>().join(", ");
        let site = locks().next().map_or(Site::Robot, |lock| Site::Joint(lock.0));
        let error = Diagnostic::new(
            site,
            format!("loops that do not close on the way to {names}"),
            "positions that are reached from the zero pose, all other independents at 0",
            "lock at positions nearer to the zero pose",
        );
        CompileError::of(vec![error])
    }
}

/// Coordinates of a joint at a position; of several degrees of freedom at rest.
pub(super) fn at(kind: JointKind, x: f64) -> Vec<f64> {
    let mut q = vec![0.0; n_q(kind)];
    if let Some(last) = q.last_mut() {
        *last = if n_v(kind) > 1 { 1.0 } else { x };
    }
    q
}

/// Velocities of a joint.
pub(super) const fn n_v(kind: JointKind) -> usize {
    match kind {
        JointKind::Spherical | JointKind::Floating => n_q(kind) - 1,
        _ => n_q(kind),
    }
}
