//! Block triangular form of a cluster's rows: the smallest sets of rows that determine as many
//! joints, in the order of solution.

use crate::closure::{Block, BlockCut, Blocks, Elimination, RowKind, column_unit, row_unit};
use crate::compile::elimination;
use crate::compile::matching::{matching, strongly_connected};
use crate::mechanism::{Cluster, Cut, CutRow, Dof};
use crate::spatial::Pose;

/// Block triangular form of the used rows against the dependents, in the order of solution.
///
/// `K` belongs to a generic pose; pivots are large enough at the poses of `others` as well.
pub(super) fn blocks(
    cluster: &Cluster<f64>,
    used: &[usize],
    K: &[f64],
    others: &[&[f64]],
) -> Blocks {
    let n = cluster.n_v;
    let m = cluster.dependent.len();
    let sees = incidence(cluster, used);
    let matched = matching(&sees, |i, a| K[used[i] * n + cluster.dependent[a]].abs());
    // strongly connected sets of joints: a joint needs the joints in its row
    let mut row_of = vec![0; m];
    matched.iter().enumerate().for_each(|(i, a)| row_of[*a] = i);
    let sets =
        strongly_connected(m, |a| (0..m).filter(|b| *b != a && sees[row_of[a]][*b]).collect());

    let homes: Vec<(usize, usize)> = (cluster.cuts.iter().enumerate())
        .flat_map(|(c, cut)| (0..cut.rows.len()).map(move |k| (c, k)))
        .collect();
    let mut form = Form {
        cluster,
        known: vec![false; n],
        placed: vec![false; cluster.n],
        offset: 0,
        blocks: Vec::new(),
    };
    for set in sets {
        let (rows, columns, elimination) =
            elimination::order(&set, &row_of, &sees, others.len(), |k, i, a| {
                others[k][used[i] * n + cluster.dependent[a]]
            });
        let unknowns: Vec<usize> = columns.iter().map(|a| cluster.dependent[*a]).collect();
        let rows: Vec<(usize, usize)> = rows.iter().map(|row| homes[used[*row]]).collect();
        form.push(unknowns, &rows, elimination);
    }
    // bodies on the paths to any cut, and those among them without a pose from the blocks
    let on_way = bodies_on_way(cluster, cluster.cuts.iter());
    let on_way: Vec<usize> = (0..cluster.n).filter(|j| on_way[*j]).collect();
    let after = on_way.iter().copied().filter(|j| !form.placed[*j]).collect();
    Blocks { blocks: form.blocks, on_way, after }
}

/// The largest squares of a block's columns, from the scaled K at some poses.
pub(super) fn sizes(cluster: &Cluster<f64>, block: &Block, poses: &[&[f64]]) -> Vec<f64> {
    let first = |cut: usize| cluster.cuts[..cut].iter().map(|cut| cut.rows.len()).sum::<usize>();
    let square = |K: &[f64], v: usize| -> f64 {
        let of_cut = |held: &BlockCut| -> f64 {
            let entry = |(k, (r, _)): (usize, &(usize, usize))| {
                let unit = row_unit(cluster, &cluster.cuts[held.cut].rows[*r]);
                let x = K[(first(held.cut) + r) * cluster.n_v + v];
                held.in_lengths(k, x / (unit * column_unit(cluster, v)))
            };
            held.rows.iter().enumerate().map(entry).map(|x: f64| x * x).sum()
        };
        block.cuts.iter().map(of_cut).sum()
    };
    let largest = |dof: &Dof| poses.iter().map(|K| square(K, dof.v)).fold(0.0, f64::max);
    block.unknowns.iter().map(largest).collect()
}

/// Part of a lever that its column shows, squared, below which the rest counts.
const IN_SIGHT: f64 = 0.25;

/// The squares of the levers of a block, if its rows see a small part of one at some pose.
pub(super) fn levers(
    cluster: &Cluster<f64>,
    block: &Block,
    poses: &[&[Pose<f64>]],
) -> Option<[f64; 3]> {
    let [held] = &block.cuts[..] else { return None };
    let cut = &cluster.cuts[held.cut];
    let rows: Vec<&CutRow<f64>> = held.rows.iter().map(|(r, _)| &cut.rows[*r]).collect();
    // points alone, in fewer directions than space has
    let slides = rows.iter().all(|row| row.terms.is_empty() && row.angular.norm() == 0.0);
    if rows.len() != 2 || !slides || !held.solve.iter().all(|(dof, ..)| dof.single) {
        return None;
    }
    let mut levers = [0.0_f64; 3];
    let mut hidden = false;
    for pose in poses {
        let frame = &pose[cut.predecessor];
        let at = frame.point(&cut.x_p_cut.p);
        for (dof, _, a) in &held.solve {
            let body = &pose[dof.body + 1];
            let axis = body.R.column(2).into_owned();
            let lever = if dof.slides() { axis } else { axis.cross(&(at - body.p)) };
            let all = lever.norm_squared();
            let seen: f64 =
                rows.iter().map(|row| (frame.R * row.linear_p).dot(&lever).powi(2)).sum();
            hidden |= seen < IN_SIGHT * all;
            levers[*a] = levers[*a].max(all);
        }
    }
    hidden.then_some(levers)
}

/// For each used row the dependents on the path of its cut.
fn incidence(cluster: &Cluster<f64>, used: &[usize]) -> Vec<Vec<bool>> {
    let cuts: Vec<&Cut<f64>> =
        cluster.cuts.iter().flat_map(|cut| cut.rows.iter().map(move |_| cut)).collect();
    let on_path = |r: &usize, j: &usize| cuts[*r].path.iter().any(|(v, _)| v == j);
    used.iter().map(|r| cluster.dependent.iter().map(|j| on_path(r, j)).collect()).collect()
}

/// A block triangular form under construction.
struct Form<'a> {
    cluster: &'a Cluster<f64>,
    /// Velocities that earlier blocks determine.
    known: Vec<bool>,
    /// Bodies with a pose from the blocks so far.
    placed: Vec<bool>,
    /// First entry of the next block's inverse.
    offset: usize,
    blocks: Vec<Block>,
}

impl Form<'_> {
    /// Adds the block that determines some velocities by rows (cut, row of it), both in the order
    /// of elimination.
    fn push(
        &mut self,
        unknowns: Vec<usize>,
        rows: &[(usize, usize)],
        elimination: Option<Elimination>,
    ) {
        let cluster = self.cluster;
        let mut cuts: Vec<BlockCut> = Vec::new();
        for (i, &(c, k)) in rows.iter().enumerate() {
            match cuts.iter_mut().find(|cut| cut.cut == c) {
                Some(cut) => cut.rows.push((k, i)),
                None => cuts.push(self.cut(c, (k, i), &unknowns)),
            }
        }
        for cut in &mut cuts {
            set_kind_and_units(cluster, cut, elimination.is_some());
        }
        let on_way = bodies_on_way(cluster, cuts.iter().map(|cut| &cluster.cuts[cut.cut]));
        let (bodies, before) = self.place(&unknowns, &on_way);
        unknowns.iter().for_each(|j| self.known[*j] = true);
        let earlier = self.earlier(&cuts);
        let size = unknowns.len();
        let unknowns: Vec<Dof> = unknowns.into_iter().map(|v| cluster.dofs[v]).collect();
        let series = series(cluster, &unknowns, &cuts, &bodies);
        let is_linear = |cut: &BlockCut| cluster.cuts[cut.cut].rows[0].is_linear();
        let couples = cuts.iter().all(is_linear);
        let remember = cuts.iter().any(|cut| !one_sided(cut));
        let offset = self.offset;
        self.offset += size * size;
        let mut block = Block {
            unknowns,
            cuts,
            bodies,
            before,
            earlier,
            offset,
            elimination,
            series,
            sizes: vec![0.0; size],
            volume: 0.0,
            levers: [0.0; 3],
            couples,
            remember,
            work: 0,
        };
        block.work = block.operations();
        self.blocks.push(block);
    }

    /// A cut with its first row in a block, and the velocities on its path by their role.
    fn cut(&self, c: usize, row: (usize, usize), unknowns: &[usize]) -> BlockCut {
        let cluster = self.cluster;
        let dofs = |list: &[usize]| {
            let place = |j: &usize| list.iter().position(|v| v == j);
            let path = cluster.cuts[c].path.iter();
            path.filter_map(|(j, side)| place(j).map(|a| (cluster.dofs[*j], *side, a))).collect()
        };
        let path = cluster.cuts[c].path.iter();
        BlockCut {
            cut: c,
            rows: vec![row],
            units: Vec::new(),
            kind: RowKind::Any,
            solve: dofs(unknowns),
            independent: dofs(&cluster.independent),
            earlier: path
                .filter(|(j, _)| self.known[*j])
                .map(|(j, side)| (cluster.dofs[*j], *side))
                .collect(),
        }
    }

    /// Bodies that the unknowns carry or move, each with true if only its own joint moves it within
    /// the block; and the other bodies on the paths that have no pose yet.
    fn place(&mut self, unknowns: &[usize], on_way: &[bool]) -> (Vec<(usize, bool)>, Vec<usize>) {
        let cluster = self.cluster;
        let carried = |body: usize| unknowns.iter().any(|v| cluster.dofs[*v].body == body);
        let mut moves = vec![false; cluster.n];
        for j in 0..cluster.n {
            let parent = cluster.local_parent[j];
            moves[j] = carried(j) || parent != 0 && moves[parent - 1];
        }
        let single = |body: usize| cluster.dofs.iter().all(|dof| dof.body != body || dof.single);
        let held = |body: usize| {
            let parent = cluster.local_parent[body];
            single(body) && !(parent != 0 && moves[parent - 1])
        };
        let bodies: Vec<(usize, bool)> = (0..cluster.n)
            .filter(|j| carried(*j) || on_way[*j] && moves[*j])
            .map(|j| (j, held(j)))
            .collect();
        let before: Vec<usize> =
            (0..cluster.n).filter(|j| on_way[*j] && !moves[*j] && !self.placed[*j]).collect();
        (0..cluster.n).filter(|j| moves[*j]).for_each(|j| self.placed[j] = false);
        before.iter().chain(bodies.iter().map(|(j, _)| j)).for_each(|j| self.placed[*j] = true);
        (bodies, before)
    }

    /// Earlier blocks that determine velocities on the paths of these cuts.
    fn earlier(&self, cuts: &[BlockCut]) -> Vec<usize> {
        let determines = |block: &Block, v: usize| block.unknowns.iter().any(|dof| dof.v == v);
        let dofs = cuts.iter().flat_map(|cut| &cut.earlier);
        let block = |v: usize| self.blocks.iter().position(|block| determines(block, v));
        let mut earlier: Vec<usize> = dofs.filter_map(|(dof, _)| block(dof.v)).collect();
        earlier.sort_unstable();
        earlier.dedup();
        earlier
    }
}

/// Kind and units of the rows of a cut in a block.
fn set_kind_and_units(cluster: &Cluster<f64>, cut: &mut BlockCut, eliminated: bool) {
    let whole = &cluster.cuts[cut.cut];
    cut.kind = row_kind(whole, &cut.rows);
    if eliminated && cut.kind == RowKind::Ball {
        // the order of elimination is that of the original rows
        cut.kind = RowKind::Linear;
    }
    let unit = |r: usize| if is_length(cluster, &whole.rows[r]) { 1.0 } else { cluster.length };
    if cut.rows.iter().any(|(r, _)| unit(*r) != 1.0) {
        cut.units = cut.rows.iter().map(|(r, _)| unit(*r)).collect();
    }
}

/// Marks the bodies between the cluster's parent body and the two of each cut.
fn bodies_on_way<'a>(
    cluster: &Cluster<f64>,
    cuts: impl Iterator<Item = &'a Cut<f64>>,
) -> Vec<bool> {
    let mut on_way = vec![false; cluster.n];
    for mut body in cuts.flat_map(|cut| [cut.predecessor, cut.successor]) {
        while body != 0 {
            on_way[body - 1] = true;
            body = cluster.local_parent[body - 1];
        }
    }
    on_way
}

/// True when the value of a row is a length; else it is an angle.
pub(super) fn is_length(cluster: &Cluster<f64>, row: &CutRow<f64>) -> bool {
    match row.terms.first() {
        Some((own, _)) => cluster.dofs[*own].slides(),
        None => row.against.is_none() && row.linear.norm() > 0.0,
    }
}

/// True when a new y leaves the block's part of K at the old unknowns unchanged, up to a rotation
/// of the rows: the unknowns move the successor alone, and the velocities are those of its cut
/// point.
fn one_sided(cut: &BlockCut) -> bool {
    cut.solve.iter().all(|(_, on_successor, _)| *on_successor)
}

/// The end of the block's only cut that up to three joints in series carry: true for the
/// successor's.
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

/// The common kind of a block's rows of a cut.
fn row_kind(cut: &Cut<f64>, rows: &[(usize, usize)]) -> RowKind {
    let linear = |(r, _): &(usize, usize)| {
        let CutRow { terms, against, linear, angular, .. } = &cut.rows[*r];
        terms.is_empty() && against.is_none() && angular.norm() == 0.0 && linear.norm() > 0.0
    };
    match is_ball(cut, rows) {
        true => RowKind::Ball,
        false if rows.iter().all(linear) => RowKind::Linear,
        false => RowKind::Any,
    }
}

/// True when the block's rows of a cut, one after the other, tie all three directions of a point.
fn is_ball(cut: &Cut<f64>, rows: &[(usize, usize)]) -> bool {
    let &[(a, i), (b, j), (c, k)] = rows else { return false };
    let rows = [a, b, c].map(|r| &cut.rows[r]);
    let linear = rows.iter().all(|row| row.terms.is_empty() && row.angular.norm() == 0.0);
    let [x, y, z] = rows.map(|row| row.linear);
    linear
        && (j, k) == (i + 1, i + 2)
        && x.dot(&y.cross(&z)).abs() > 1e-3 * x.norm() * y.norm() * z.norm()
}
