//! Reads the blocks of a cluster one by one: a block whose loops have a closed form, or that is
//! couplings, with the joints of blocks before it for its independents.

use crate::closure::{Block, BlockForm, Chain, Form, Numerical};
use crate::compile::closed_forms::{Reading, form_of};
use crate::compile::couplings::couplings;
use crate::mechanism::{Body, Cluster, Cut, Dof, Motion, Windings};
use crate::scalar::{Dd, Real};

/// The blocks, if each has a form up to rounding.
pub(super) fn read(of: &Reading<'_>, rows: &Numerical<Dd>, rounding: f64) -> Option<Chain<Dd>> {
    let cluster = of.cluster;
    let [blocks] = &rows.choices[..] else { return None };
    if blocks.blocks.len() < 2 || !of.is_simple() || !cluster.locked.is_empty() {
        return None;
    }
    let parts = blocks.blocks.iter().map(|block| part(of, block, rounding));
    let turns = |j: &&usize| of.bodies[**j].motion == Motion::Revolute;
    Some(Chain {
        parts: parts.collect::<Option<_>>()?,
        rows: rows.clone(),
        given: cluster.independent.iter().filter(turns).map(|j| (*j, *j)).collect(),
    })
}

fn part(of: &Reading<'_>, block: &Block, rounding: f64) -> Option<BlockForm<Dd>> {
    let cluster = of.cluster;
    let is_whole =
        |rows: &crate::closure::BlockCut| rows.rows.len() == cluster.cuts[rows.cut].rows.len();
    if !block.cuts.iter().all(is_whole) {
        return None;
    }
    let cuts: Vec<&Cut<Dd>> = block.cuts.iter().map(|rows| &cluster.cuts[rows.cut]).collect();

    // the joints of its rows, all on one body
    let of_rows = |cut: &&Cut<Dd>| {
        let terms = cut.rows.iter().flat_map(|row| {
            let curves = row.curves.iter().map(|curve| curve.of.v);
            row.terms.iter().map(|(j, _)| *j).chain(curves)
        });
        cut.path.iter().map(|(j, _)| *j).chain(terms).collect::<Vec<_>>()
    };
    let mut joints: Vec<usize> = cuts.iter().flat_map(of_rows).collect();
    joints.sort_unstable();
    joints.dedup();
    let is_coupling = cuts.iter().all(|cut| cut.is_coupling());
    let above = |j: &usize| cluster.local_parent[*j].checked_sub(1);
    let carriers = |joints: &[usize]| {
        let mut carriers: Vec<usize> = joints
            .iter()
            .filter(|j| above(j).is_none_or(|up| !joints.contains(&up)))
            .map(|j| cluster.local_parent[*j])
            .collect();
        carriers.sort_unstable();
        carriers.dedup();
        carriers
    };
    while !is_coupling && carriers(&joints).len() > 1 {
        // the last ones of the carriers move too
        let last = carriers(&joints).pop()?.checked_sub(1)?;
        joints.push(last);
        joints.sort_unstable();
    }
    let root = if is_coupling { 0 } else { carriers(&joints).pop()? };
    let own = |j: usize| joints.iter().position(|of| *of == j);
    let body =
        |body: usize| if body == root { Some(0) } else { Some(own(body.checked_sub(1)?)? + 1) };
    let dof = |dof: Dof| Some(Dof { v: own(dof.v)?, q: own(dof.v)?, body: own(dof.v)?, ..dof });

    let bodies = joints.iter().enumerate().map(|(k, j)| {
        let body = &of.bodies[*j];
        let p_local = if root == 0 { body.p_local } else { body.p_parent_body };
        Body { q: k, v: k, p_local, ..body.clone() }
    });
    let bodies: Vec<Body<Dd>> = bodies.collect();
    let is_unknown = |j: &usize| block.unknowns.iter().any(|dof| dof.v == joints[*j]);
    let (dependent, independent): (Vec<usize>, Vec<usize>) =
        (0..joints.len()).partition(is_unknown);
    if dependent.len() != block.unknowns.len() {
        return None;
    }
    let cut = |of: &&Cut<Dd>| {
        let mut cut = (*of).clone();
        [cut.predecessor, cut.successor] =
            if is_coupling { [0; 2] } else { [body(of.predecessor)?, body(of.successor)?] };
        cut.path.iter_mut().try_for_each(|(j, _)| own(*j).map(|own| *j = own))?;
        for row in &mut cut.rows {
            row.terms.iter_mut().try_for_each(|(j, _)| own(*j).map(|own| *j = own))?;
            row.curves.iter_mut().try_for_each(|curve| dof(curve.of).map(|own| curve.of = own))?;
        }
        Some(cut)
    };
    let cuts = cuts.iter().map(cut).collect::<Option<Vec<_>>>()?;
    let n = joints.len();
    let n_rows = dependent.len();
    let parent = |j: &usize| if is_coupling { Some(0) } else { body(cluster.local_parent[*j]) };
    let own_cluster = Cluster {
        parent: 0,
        body: 0,
        n,
        v: 0,
        q: 0,
        n_v: n,
        n_q: n,
        dofs: joints.iter().map(|j| dof(of.dof(*j))).collect::<Option<_>>()?,
        vy: 0,
        n_vy: independent.len(),
        g_offset: 0,
        independent_q: independent.clone(),
        dependent_q: dependent.clone(),
        independent,
        dependent,
        locked: Vec::new(),
        local_parent: joints.iter().map(parent).collect::<Option<_>>()?,
        active: Vec::new(),
        windings: Windings::default(),
        cuts,
        rows: (0..n_rows).collect(),
        used: (0..n_rows).collect(),
        other_rows: Vec::new(),
        length: cluster.length,
        units: joints.iter().map(|j| cluster.units[*j]).collect(),
        least_authority: cluster.least_authority,
    };
    let form = if is_coupling {
        Form::Coupling(couplings(&own_cluster)?)
    } else {
        let order: Vec<usize> = (0..n).collect();
        let zero = vec![Dd::ZERO; n];
        form_of(&Reading::new(&own_cluster, &bodies, &order, &zero), rounding)?
    };
    Some(BlockForm { form, cluster: own_cluster, bodies, joints })
}
