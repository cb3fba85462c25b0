//! Exchanges independents for dependent joints that are held still, by G.

use sarrus_proto::{Field, FieldSet, Query, Request};

use crate::description::{Description, JointKind};
use crate::model::Model;
use crate::plan::Planned;
use crate::reduction::pose::{at, n_v};
use crate::scalar::noise;

/// Number of poses at which joints that are still at the zero pose are checked, and their distance,
/// in radians or mechanism lengths.
const POSES: usize = 4;
const REACH: f64 = 0.1;
/// Velocity of a still joint, relative to that of an independent, in the units of each.
const STILL: f64 = 1e-9;
/// Relative remainder of a row below which it counts as dependent.
const SPENT: f64 = 1e-6;
/// Share of the largest entry above which an independent may be exchanged.
const ENOUGH: f64 = 0.3;

/// Held joints and the independents that they replace.
#[derive(Debug, Default)]
pub(super) struct Exchange {
    /// The held joints that determine others, and as many independents that depend on them then.
    pub(super) held: Vec<usize>,
    pub(super) dropped: Vec<usize>,
}

/// Exchanges as many of the held joints as move independently of each other while `independents`
/// alone move: those with a given position first. Judged at the zero pose, from which the robot
/// moves to the locks, or at another pose where more of them move. Allocates.
pub(super) fn exchange(
    description: &Description,
    model: &Model<f64>,
    [with_position, without]: [&[usize]; 2],
    independents: &[usize],
) -> Exchange {
    let wanted = independents.len().min(with_position.len() + without.len());
    let mut best = Exchange::default();
    for k in 0..POSES {
        let Some(gains) = Gains::at(description, model, k) else { continue };
        let mut tableau = Tableau::new(&gains, independents);
        tableau.take(&gains, with_position);
        tableau.take(&gains, without);
        if tableau.found.held.len() > best.held.len() {
            best = tableau.found;
        }
        if best.held.len() == wanted {
            break;
        }
    }
    best
}

/// G at a closed pose, by joints of one degree of freedom, each in its unit.
struct Gains {
    /// Row of each joint of the robot; empty for joints of several degrees of freedom.
    rows: Vec<Vec<f64>>,
    /// Column of each joint that is independent.
    columns: Vec<Option<usize>>,
}

impl Gains {
    /// At the k-th pose; `None` where the loops do not close.
    fn at(description: &Description, model: &Model<f64>, k: usize) -> Option<Gains> {
        let lengths: Vec<f64> = model.closures().iter().map(|of| of.length).collect();
        let unit = |s: usize, j: usize| match description.joints[j].kind {
            JointKind::Prismatic => lengths[s],
            _ => 1.0,
        };
        let n = description.joints.len();
        let mut y = Vec::new();
        let mut columns = vec![None; n];
        let mut units = Vec::new();
        for (s, of) in description.submechanisms.iter().enumerate() {
            for &j in &of.independent {
                let kind = description.joints[j].kind;
                columns[j] = (n_v(kind) == 1).then_some(units.len());
                units.resize(units.len() + n_v(kind), unit(s, j));
                let off = if k == 0 { 0.0 } else { REACH * unit(s, j) * noise(71 * k + y.len()) };
                y.extend(at(kind, off));
            }
        }
        let want = FieldSet::of(&[Field::G]);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let planned = Planned::answered(model, &query, &[(Field::Y, &y)])?;
        let mut rows = vec![Vec::new(); n];
        let mut G = planned.output.chunks_exact(units.len().max(1));
        for (s, of) in description.submechanisms.iter().enumerate() {
            for &j in &of.spanning_tree {
                let own: Vec<&[f64]> = G.by_ref().take(n_v(description.joints[j].kind)).collect();
                if let [row] = own[..] {
                    rows[j] = row.iter().zip(&units).map(|(x, to)| x * to / unit(s, j)).collect();
                }
            }
        }
        Some(Gains { rows, columns })
    }
}

/// Elimination in which rows are the held joints and columns the independents.
struct Tableau {
    independents: Vec<usize>,
    columns: Vec<usize>,
    /// Rows that were taken, scaled to 1 in the column of their independent.
    taken: Vec<(Vec<f64>, usize)>,
    found: Exchange,
}

impl Tableau {
    fn new(gains: &Gains, independents: &[usize]) -> Tableau {
        let of = independents.iter().filter_map(|j| Some((*j, gains.columns[*j]?)));
        let (independents, columns) = of.unzip();
        Tableau { independents, columns, taken: Vec::new(), found: Exchange::default() }
    }

    /// Takes the joints with independent rows, the one with the largest remainder first.
    fn take(&mut self, gains: &Gains, joints: &[usize]) {
        let mut left: Vec<usize> = joints.to_vec();
        loop {
            let next = left.iter().filter_map(|j| Some((*j, self.rest(gains.rows.get(*j)?)?)));
            let next = next.max_by(|(_, a), (_, b)| largest(a).total_cmp(&largest(b)));
            let Some((joint, rest)) = next else { return };
            // the last sufficient independent: those declared first stay
            let enough = ENOUGH * largest(&rest);
            let Some(place) = rest.iter().rposition(|x| x.abs() >= enough) else { return };
            let scale = rest[place];
            self.taken.push((rest.iter().map(|x| x / scale).collect(), place));
            self.found.held.push(joint);
            self.found.dropped.push(self.independents[place]);
            left.retain(|j| *j != joint);
        }
    }

    /// Remainder of a row after elimination of those taken, relative to it; `None` if negligible.
    fn rest(&self, row: &[f64]) -> Option<Vec<f64>> {
        let mut rest: Vec<f64> =
            self.columns.iter().map(|c| row.get(*c).copied()).collect::<Option<_>>()?;
        let size = largest(&rest);
        for (taken, place) in &self.taken {
            let share = rest[*place];
            rest.iter_mut().zip(taken).for_each(|(x, of)| *x -= share * of);
            rest[*place] = 0.0;
        }
        rest.iter_mut().for_each(|x| *x /= size);
        (size > STILL && largest(&rest) > SPENT).then_some(rest)
    }
}

fn largest(row: &[f64]) -> f64 {
    row.iter().fold(0.0, |largest, x| f64::max(largest, x.abs()))
}
