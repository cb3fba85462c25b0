//! Reads the blocks of a cluster one by one: a block whose loops have a closed form, or that is
//! couplings, with the joints of blocks before it for its independents.

use crate::closure::{Block, BlockForm, Chain, Form, Numerical};
use crate::compile::closed_forms::{Reading, form_of};
use crate::compile::couplings::couplings;
use crate::mechanism::{Body, Cluster, Cut, Dof, Motion};
use crate::scalar::{Dd, Real};

/// The blocks, if each has a form up to rounding.
pub(super) fn read(of: &Reading<'_>, rows: &Numerical<Dd>, rounding: f64) -> Option<Chain<Dd>> {
    let cluster = of.cluster;
    let [blocks] = &rows.choices[..] else { return None };
    if blocks.blocks.len() < 2 || !of.is_simple() || !cluster.locked.is_empty() {
        return None;
    }
    let parts = blocks.blocks.iter().map(|block| Own::new(of, block)?.form(of, block, rounding));
    let turns = |j: &&usize| of.bodies[**j].motion == Motion::Revolute;
    Some(Chain {
        parts: parts.collect::<Option<_>>()?,
        rows: blocks.clone(),
        given: cluster.independent.iter().filter(turns).map(|j| (*j, *j)).collect(),
    })
}

/// The joints of a block's rows in their order in the cluster, and the body that carries all.
struct Own {
    joints: Vec<usize>,
    root: usize,
    is_coupling: bool,
}

impl Own {
    /// None where the block has a part of a cut's rows.
    fn new(of: &Reading<'_>, block: &Block) -> Option<Own> {
        let cluster = of.cluster;
        let mut joints = Vec::new();
        let mut is_coupling = true;
        for rows in &block.cuts {
            let cut = &cluster.cuts[rows.cut];
            if rows.rows.len() != cut.rows.len() {
                return None;
            }
            joints.extend(cut.path.iter().map(|(j, _)| *j));
            for row in &cut.rows {
                joints.extend(row.terms.iter().map(|(j, _)| *j));
                joints.extend(row.curves.iter().map(|curve| curve.of.v));
            }
            is_coupling &= cut.is_coupling();
        }
        loop {
            joints.sort_unstable();
            joints.dedup();
            let carriers = joints.iter().map(|j| cluster.local_parent[*j]);
            let carriers = carriers.filter(|body| *body == 0 || !joints.contains(&(body - 1)));
            let last = carriers.clone().max()?;
            let root = carriers.min()?;
            if root == last || is_coupling {
                return Some(Own { joints, root, is_coupling });
            }
            // what carries only some of them moves too
            joints.push(last - 1);
        }
    }

    fn joint(&self, j: usize) -> Option<usize> {
        self.joints.iter().position(|of| *of == j)
    }

    /// The local body; couplings have none.
    fn body(&self, body: usize) -> Option<usize> {
        if body == self.root || self.is_coupling {
            return Some(0);
        }
        Some(self.joint(body.checked_sub(1)?)? + 1)
    }

    fn dof(&self, dof: Dof) -> Option<Dof> {
        let j = self.joint(dof.v)?;
        Some(Dof { v: j, q: j, body: j, ..dof })
    }

    fn cut(&self, of: &Cut<Dd>) -> Option<Cut<Dd>> {
        let mut cut = of.clone();
        (cut.predecessor, cut.successor) = (self.body(of.predecessor)?, self.body(of.successor)?);
        let terms = cut.rows.iter_mut().flat_map(|row| &mut row.terms).map(|(j, _)| j);
        for j in terms.chain(cut.path.iter_mut().map(|(j, _)| j)) {
            *j = self.joint(*j)?;
        }
        for curve in cut.rows.iter_mut().flat_map(|row| &mut row.curves) {
            curve.of = self.dof(curve.of)?;
        }
        Some(cut)
    }

    fn form(self, of: &Reading<'_>, block: &Block, rounding: f64) -> Option<BlockForm<Dd>> {
        let whole = of.cluster;
        let n = self.joints.len();
        let is_unknown = |j: &usize| block.unknowns.iter().any(|dof| dof.v == self.joints[*j]);
        let (dependent, independent): (Vec<usize>, Vec<usize>) = (0..n).partition(is_unknown);
        let rows: Vec<usize> = (0..dependent.len()).collect();
        let cuts = block.cuts.iter().map(|rows| self.cut(&whole.cuts[rows.cut]));
        let parents = self.joints.iter().map(|j| self.body(whole.local_parent[*j]));
        let cluster = Cluster {
            n,
            n_v: n,
            n_q: n,
            v: 0,
            q: 0,
            n_vy: independent.len(),
            dofs: self.joints.iter().map(|j| self.dof(of.dof(*j))).collect::<Option<_>>()?,
            independent_q: independent.clone(),
            dependent_q: dependent.clone(),
            independent,
            dependent,
            local_parent: parents.collect::<Option<_>>()?,
            cuts: cuts.collect::<Option<_>>()?,
            used: rows.clone(),
            rows,
            units: self.joints.iter().map(|j| whole.units[*j]).collect(),
            ..whole.clone()
        };
        let bodies = self.joints.iter().enumerate().map(|(k, j)| {
            let body = &of.bodies[*j];
            let p_local = if self.root == 0 { body.p_local } else { body.p_parent_body };
            Body { q: k, v: k, p_local, ..body.clone() }
        });
        let bodies: Vec<Body<Dd>> = bodies.collect();
        let order: Vec<usize> = (0..n).collect();
        let form = if self.is_coupling {
            Form::Coupling(couplings(&cluster)?)
        } else {
            form_of(&Reading::new(&cluster, &bodies, &order, &vec![Dd::ZERO; n]), rounding)?
        };
        Some(BlockForm { form, cluster, bodies, joints: self.joints })
    }
}
