//! Block triangular form of a cluster's rows: the smallest sets of rows that determine as many
//! joints, in the order of solution.

use crate::closure::{Block, BlockCut, Blocks, RowKind};
use crate::compile::elimination;
use crate::mechanism::{Cluster, Cut, CutRow, Dof};

/// Block triangular form of the used rows against the dependents, in the order of solution.
///
/// `K` is that of a generic pose, `others` those at which pivots have to be large enough as well.
pub(super) fn blocks(
    cluster: &Cluster<f64>,
    used: &[usize],
    K: &[f64],
    others: &[&[f64]],
) -> Blocks {
    let (n, m) = (cluster.n_v, cluster.dependent.len());
    let of = |v: usize| cluster.dofs[v];
    // which dependent each row can see
    let mut sees = vec![vec![false; m]; m];
    let mut home = Vec::new();
    let mut r = 0;
    for (c, cut) in cluster.cuts.iter().enumerate() {
        for k in 0..cut.rows.len() {
            home.push((c, k));
            if let Some(i) = used.iter().position(|u| *u == r) {
                for (a, j) in cluster.dependent.iter().enumerate() {
                    sees[i][a] = cut.path.iter().any(|(on, _)| on == j);
                }
            }
            r += 1;
        }
    }
    let matched = matching(&sees, |i, a| K[used[i] * n + cluster.dependent[a]].abs());
    // strongly connected sets of joints: a joint needs those that its row sees
    let mut row_of = vec![0; m];
    matched.iter().enumerate().for_each(|(i, a)| row_of[*a] = i);
    let sets =
        strongly_connected(m, |a| (0..m).filter(|b| *b != a && sees[row_of[a]][*b]).collect());

    let mut known = vec![false; n];
    let mut placed = vec![false; cluster.n];
    let mut offset = 0;
    let mut blocks: Vec<Block> = Vec::new();
    for set in sets {
        let (set_rows, set_columns, elimination) =
            elimination::order(&set, &row_of, &sees, others.len(), |k, i, a| {
                others[k][used[i] * n + cluster.dependent[a]]
            });
        let unknowns: Vec<usize> = set_columns.iter().map(|a| cluster.dependent[*a]).collect();
        let mut cuts: Vec<BlockCut> = Vec::new();
        for (i, row) in set_rows.iter().enumerate() {
            let (c, k) = home[used[*row]];
            match cuts.iter_mut().find(|cut| cut.cut == c) {
                Some(cut) => cut.rows.push((k, i)),
                None => {
                    let path = &cluster.cuts[c].path;
                    let column = |j: &usize| unknowns.iter().position(|u| u == j);
                    let independent = |j: &usize| cluster.independent.iter().position(|i| i == j);
                    cuts.push(BlockCut {
                        cut: c,
                        rows: vec![(k, i)],
                        units: Vec::new(),
                        kind: RowKind::Any,
                        solve: path
                            .iter()
                            .filter_map(|(j, side)| column(j).map(|a| (of(*j), *side, a)))
                            .collect(),
                        independent: path
                            .iter()
                            .filter_map(|(j, side)| independent(j).map(|k| (of(*j), *side, k)))
                            .collect(),
                        earlier: path
                            .iter()
                            .filter(|(j, _)| known[*j])
                            .map(|(j, side)| (of(*j), *side))
                            .collect(),
                    });
                }
            }
        }
        for cut in &mut cuts {
            cut.kind = row_kind(&cluster.cuts[cut.cut], &cut.rows);
            if elimination.is_some() && cut.kind == RowKind::Ball {
                // the order of elimination is that of the rows as they are
                let angular = cluster.cuts[cut.cut].angular;
                cut.kind = if angular { RowKind::Any } else { RowKind::Linear };
            }
            let unit = |r: usize| {
                if is_length(cluster, &cluster.cuts[cut.cut].rows[r]) {
                    1.0
                } else {
                    cluster.length
                }
            };
            if cut.rows.iter().any(|(r, _)| unit(*r) != 1.0) {
                cut.units = cut.rows.iter().map(|(r, _)| unit(*r)).collect();
            }
        }
        let mut on_way = vec![false; cluster.n];
        cuts.iter().for_each(|cut| mark_way(cluster, &cluster.cuts[cut.cut], &mut on_way));
        // bodies that the unknowns carry or move; what is on the paths and not one of them is
        // placed before, where it is not yet
        let carried = |body: usize| unknowns.iter().any(|v| cluster.dofs[*v].body == body);
        let mut moves = vec![false; cluster.n];
        for j in 0..cluster.n {
            let parent = cluster.local_parent[j];
            moves[j] = carried(j) || parent != 0 && moves[parent - 1];
        }
        let single = |body: usize| cluster.dofs.iter().all(|at| at.body != body || at.single);
        let held = |body: usize| {
            single(body)
                && !(cluster.local_parent[body] != 0 && moves[cluster.local_parent[body] - 1])
        };
        let bodies: Vec<(usize, bool)> = (0..cluster.n)
            .filter(|j| carried(*j) || on_way[*j] && moves[*j])
            .map(|j| (j, held(j)))
            .collect();
        let before: Vec<usize> =
            (0..cluster.n).filter(|j| on_way[*j] && !moves[*j] && !placed[*j]).collect();
        (0..cluster.n).filter(|j| moves[*j]).for_each(|j| placed[j] = false);
        before.iter().chain(bodies.iter().map(|(j, _)| j)).for_each(|j| placed[*j] = true);
        unknowns.iter().for_each(|j| known[*j] = true);
        let known_from =
            |v: usize| blocks.iter().position(|block| block.unknowns.iter().any(|dof| dof.v == v));
        let dofs = cuts.iter().flat_map(|cut| &cut.earlier);
        let mut earlier: Vec<usize> = dofs.filter_map(|(dof, _)| known_from(dof.v)).collect();
        earlier.sort_unstable();
        earlier.dedup();
        let size = unknowns.len();
        let unknowns: Vec<Dof> = unknowns.into_iter().map(of).collect();
        let series = series(cluster, &unknowns, &cuts, &bodies);
        let remember = cuts.iter().any(|cut| !one_sided(cut));
        blocks.push(Block {
            unknowns,
            cuts,
            bodies,
            before,
            earlier,
            offset,
            elimination,
            series,
            remember,
        });
        offset += size * size;
    }
    // bodies on the paths to any cut, and those that the blocks leave without a fresh pose
    let mut on_way = vec![false; cluster.n];
    cluster.cuts.iter().for_each(|cut| mark_way(cluster, cut, &mut on_way));
    let on_way: Vec<usize> = (0..cluster.n).filter(|j| on_way[*j]).collect();
    let after = on_way.iter().copied().filter(|j| !placed[*j]).collect();
    Blocks { blocks, on_way, after }
}

/// Marks the bodies between the cluster's parent body and the two of a cut.
fn mark_way(cluster: &Cluster<f64>, cut: &Cut<f64>, on_way: &mut [bool]) {
    for mut at in [cut.predecessor, cut.successor] {
        while at != 0 {
            on_way[at - 1] = true;
            at = cluster.local_parent[at - 1];
        }
    }
}

/// True when the value of a row is a length; else it is an angle.
pub(super) fn is_length(cluster: &Cluster<f64>, row: &CutRow<f64>) -> bool {
    match row.terms.first() {
        Some((own, _)) => cluster.dofs[*own].slides(),
        None => row.against.is_none() && row.linear.norm() > 0.0,
    }
}

/// True when a new y leaves the block's part of K at the old unknowns as it was, up to a turn of
/// the rows: the unknowns move the successor alone, whose cut point the velocities are those of.
fn one_sided(cut: &BlockCut) -> bool {
    cut.solve.iter().all(|(_, on_successor, _)| *on_successor)
}

/// Whether up to three joints in series carry one end of the block's only cut, and which: true for
/// the successor's.
fn series(
    cluster: &Cluster<f64>,
    unknowns: &[Dof],
    cuts: &[BlockCut],
    bodies: &[(usize, bool)],
) -> Option<bool> {
    let [rows] = cuts else { return None };
    let cut = &cluster.cuts[rows.cut];
    let side = rows.solve.first()?.1;
    let end = if side { cut.successor } else { cut.predecessor };
    let in_series = unknowns.len() <= 3
        && unknowns.iter().all(|dof| dof.single)
        && bodies.iter().map(|(j, _)| *j).eq(unknowns.iter().map(|dof| dof.body))
        && unknowns.windows(2).all(|pair| cluster.local_parent[pair[1].body] == pair[0].body + 1)
        && unknowns.last().is_some_and(|dof| dof.body + 1 == end);
    let one_sided = rows.solve.len() == unknowns.len() && rows.solve.iter().all(|x| x.1 == side);
    let in_order = rows.rows.iter().enumerate().all(|(k, (_, i))| k == *i);
    let linear = match rows.kind {
        RowKind::Ball => true,
        RowKind::Linear => side,
        RowKind::Any => false,
    };
    (in_series && one_sided && in_order && linear && rows.rows.len() == unknowns.len())
        .then_some(side)
}

/// What is common to a block's rows of a cut.
fn row_kind(cut: &Cut<f64>, rows: &[(usize, usize)]) -> RowKind {
    let linear =
        rows.iter().all(|(r, _)| cut.rows[*r].terms.is_empty() && cut.rows[*r].linear.norm() > 0.0);
    match is_ball(cut, rows) {
        true => RowKind::Ball,
        false if linear && !cut.angular => RowKind::Linear,
        false => RowKind::Any,
    }
}

/// True when the block's rows of a cut, one after the other, tie all three directions of a point.
fn is_ball(cut: &Cut<f64>, rows: &[(usize, usize)]) -> bool {
    let &[(a, i), (b, j), (c, k)] = rows else { return false };
    let of = |r: usize| &cut.rows[r];
    let linear = [a, b, c].iter().all(|r| of(*r).terms.is_empty() && of(*r).angular.norm() == 0.0);
    let (x, y, z) = (of(a).linear, of(b).linear, of(c).linear);
    linear
        && (j, k) == (i + 1, i + 2)
        && x.dot(&y.cross(&z)).abs() > 1e-3 * x.norm() * y.norm() * z.norm()
}

/// One joint for each row, by augmenting paths that try large entries first \[K55\].
fn matching(sees: &[Vec<bool>], size: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let m = sees.len();
    let mut row_of: Vec<Option<usize>> = vec![None; m];
    fn augment(
        i: usize,
        order: &[Vec<usize>],
        row_of: &mut [Option<usize>],
        tried: &mut [bool],
    ) -> bool {
        for &a in &order[i] {
            if !tried[a] {
                tried[a] = true;
                if row_of[a].is_none_or(|other| augment(other, order, row_of, tried)) {
                    row_of[a] = Some(i);
                    return true;
                }
            }
        }
        false
    }
    let order: Vec<Vec<usize>> = (0..m)
        .map(|i| {
            let mut columns: Vec<usize> = (0..m).filter(|a| sees[i][*a]).collect();
            columns.sort_by(|a, b| size(i, *b).total_cmp(&size(i, *a)));
            columns
        })
        .collect();
    for i in 0..m {
        augment(i, &order, &mut row_of, &mut vec![false; m]);
    }
    let mut matched = vec![0; m];
    for (a, row) in row_of.iter().enumerate() {
        if let Some(i) = row {
            matched[*i] = a;
        }
    }
    matched
}

/// Tarjan's strongly connected components \[T72\]; a component comes after all that it needs.
fn strongly_connected(n: usize, needs: impl Fn(usize) -> Vec<usize>) -> Vec<Vec<usize>> {
    struct Walk {
        number: Vec<usize>,
        low: Vec<usize>,
        on_stack: Vec<bool>,
        stack: Vec<usize>,
        next: usize,
        sets: Vec<Vec<usize>>,
    }
    fn visit(a: usize, needs: &dyn Fn(usize) -> Vec<usize>, walk: &mut Walk) {
        walk.number[a] = walk.next;
        walk.low[a] = walk.next;
        walk.next += 1;
        walk.stack.push(a);
        walk.on_stack[a] = true;
        for b in needs(a) {
            if walk.number[b] == usize::MAX {
                visit(b, needs, walk);
                walk.low[a] = walk.low[a].min(walk.low[b]);
            } else if walk.on_stack[b] {
                walk.low[a] = walk.low[a].min(walk.number[b]);
            }
        }
        if walk.low[a] == walk.number[a] {
            let mut set = Vec::new();
            while let Some(b) = walk.stack.pop() {
                walk.on_stack[b] = false;
                set.push(b);
                if b == a {
                    break;
                }
            }
            set.sort_unstable();
            walk.sets.push(set);
        }
    }
    let mut walk = Walk {
        number: vec![usize::MAX; n],
        low: vec![0; n],
        on_stack: vec![false; n],
        stack: Vec::new(),
        next: 0,
        sets: Vec::new(),
    };
    for a in 0..n {
        if walk.number[a] == usize::MAX {
            visit(a, &needs, &mut walk);
        }
    }
    walk.sets
}
