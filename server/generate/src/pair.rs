//! Pairs: operations that two like parts of a robot have in common.
//!
//! Left and right arm, and the legs of a platform, repeat operations on other numbers. One
//! instruction performs both, which halves the code, and the time of tens of kilobytes of code
//! grows with their length. Pairs are found by the neighbourhood of an operation (the kinds of its
//! operands and users, some steps far, without constants): two operations that alone share a
//! neighbourhood are a pair. From these, pairs spread to users and operands. Pairs that cost more
//! than they save are dissolved. With pairs and checks the upper body's inverse dynamics take
//! 344 ns and its forward dynamics 827 ns, without either 607 and 5153 ns ("Times with generated
//! code" in `benches/README.md`).

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::hash::{DefaultHasher, Hasher as _};
use std::mem::discriminant;

use crate::Kernel;
use crate::graph::{Operation, Term};

/// Steps of a neighbourhood: of these, those that leave the fewest statements.
const STEPS: [usize; 5] = [3, 4, 5, 6, 8];
/// Most operations with one neighbourhood of which pairs are made.
const ALIKE: usize = 8;
/// Rounds in which pairs spread, and in which they are dissolved.
const ROUNDS: usize = 4;
const WEEDED: usize = 10;

/// One statement: an operation, or two at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    One(u32),
    Pair(u32, u32),
}

/// Which operations are done in pairs, and in which order.
pub(crate) struct Pairs<'a> {
    operations: &'a [Operation],
    users: Vec<Vec<u32>>,
    /// The other one of a pair, and the lane of this one.
    mates: Vec<Option<u32>>,
    lanes: Vec<u8>,
    pub(crate) steps: Vec<Step>,
}

/// True where an operation exists for two numbers at once.
fn is_packable(operation: &Operation) -> bool {
    !matches!(operation, Operation::Angle(..) | Operation::Select(..))
}

/// True where nothing is computed for a pair but the numbers of the two are put side by side.
fn is_gathered(operation: &Operation) -> bool {
    use Operation::*;
    matches!(operation, Input(_) | Sine(_) | Cosine(_))
}

/// True where the first two operands may change places.
fn is_commutative(operation: &Operation) -> bool {
    use Operation::*;
    matches!(operation, Add(..) | Multiply(..) | Fused(..))
}

fn hashed(x: impl std::hash::Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    x.hash(&mut hasher);
    hasher.finish()
}

impl<'a> Pairs<'a> {
    pub(crate) fn new(kernel: &'a Kernel) -> Pairs<'a> {
        let [first, others @ ..] = STEPS;
        let shorter = |best: Pairs<'a>, steps| {
            let other = Pairs::of_neighbours(kernel, steps);
            if other.steps.len() < best.steps.len() { other } else { best }
        };
        others.into_iter().fold(Pairs::of_neighbours(kernel, first), shorter)
    }

    fn of_neighbours(kernel: &'a Kernel, steps: usize) -> Pairs<'a> {
        let operations = &kernel.operations;
        let mut users = vec![Vec::new(); operations.len()];
        for (at, operation) in operations.iter().enumerate() {
            let mut operands: Vec<u32> = operation.operands().filter_map(Term::at).collect();
            operands.sort_unstable();
            operands.dedup();
            operands.into_iter().for_each(|from| users[from as usize].push(at as u32));
        }
        let len = operations.len();
        let mates = vec![None; len];
        let lanes = vec![0; len];
        let mut pairs = Pairs { operations, users, mates, lanes, steps: Vec::new() };
        pairs.seed(steps);
        for _ in 0..ROUNDS {
            if !(pairs.spread_to_users() | pairs.spread_to_operands()) {
                break;
            }
        }
        pairs.keep_packable();
        pairs.choose_lanes();
        for _ in 0..WEEDED {
            if !pairs.weed() {
                break;
            }
        }
        pairs.order();
        pairs
    }

    fn operation(&self, at: u32) -> &Operation {
        &self.operations[at as usize]
    }

    pub(crate) fn mate(&self, at: u32) -> Option<u32> {
        self.mates[at as usize]
    }

    /// 0 or 1: where in its pair a number stands.
    pub(crate) fn lane(&self, at: u32) -> u8 {
        self.lanes[at as usize]
    }

    fn join(&mut self, a: u32, b: u32) {
        self.mates[a as usize] = Some(b);
        self.mates[b as usize] = Some(a);
    }

    fn dissolve(&mut self, a: u32) {
        if let Some(b) = self.mates[a as usize].take() {
            self.mates[b as usize] = None;
        }
    }

    /// Pairs of operations that alone have their neighbourhood; of a few, the first two, and so on.
    fn seed(&mut self, steps: usize) {
        let mut colors: Vec<u64> =
            self.operations.iter().map(|x| hashed(discriminant(x))).collect();
        for _ in 0..steps {
            let color = |(at, operation): (usize, &Operation)| {
                let of = |x: Term| x.at().map_or(7, |at| colors[at as usize]);
                let mut from: Vec<u64> = operation.operands().map(of).collect();
                from.sort_unstable();
                let mut to: Vec<u64> = self.users[at].iter().map(|u| colors[*u as usize]).collect();
                to.sort_unstable();
                hashed((discriminant(operation), from, to))
            };
            colors = self.operations.iter().enumerate().map(color).collect();
        }
        let mut alike: HashMap<u64, Vec<u32>> = HashMap::new();
        for (at, color) in colors.iter().enumerate() {
            alike.entry(*color).or_default().push(at as u32);
        }
        for list in alike.values() {
            let is_input = matches!(self.operation(list[0]), Operation::Input(_));
            let most = if is_input { 2 } else { ALIKE };
            if list.len() % 2 == 0 && list.len() <= most {
                list.chunks_exact(2).for_each(|two| self.join(two[0], two[1]));
            }
        }
    }

    /// The operands of two operations of one kind, side by side as they fit best.
    pub(crate) fn aligned(&self, x: u32, y: u32) -> Vec<(Term, Term)> {
        let a: Vec<Term> = self.operation(x).operands().collect();
        let mut b: Vec<Term> = self.operation(y).operands().collect();
        if is_commutative(self.operation(x)) && a.len() >= 2 && b.len() >= 2 {
            let fit = |p: Term, q: Term| match (p.at(), q.at()) {
                (None, None) => 2,
                (None, _) | (_, None) => -2,
                (Some(p), Some(q)) if self.mate(p) == Some(q) => 3,
                (Some(p), Some(q)) if p == q => 1,
                (Some(p), Some(q)) => {
                    i32::from(discriminant(self.operation(p)) == discriminant(self.operation(q)))
                        - 1
                }
            };
            if fit(a[0], b[1]) + fit(a[1], b[0]) > fit(a[0], b[0]) + fit(a[1], b[1]) {
                b.swap(0, 1);
            }
        }
        a.into_iter().zip(b).collect()
    }

    /// The operands of an operation: nodes mapped by `of`, constants all alike.
    fn key(&self, at: u32, of: impl Fn(u32) -> u32) -> u64 {
        let operation = self.operation(at);
        let mut from: Vec<u32> =
            operation.operands().map(|x| x.at().map_or(u32::MAX, &of)).collect();
        if is_commutative(operation) && from.len() >= 2 {
            from[..2].sort_unstable();
        }
        hashed((discriminant(operation), from))
    }

    /// Joins the users of a pair's two nodes, and those of both.
    fn spread_to_users(&mut self) -> bool {
        let len = self.operations.len() as u32;
        let mut places: HashMap<u64, Vec<u32>> = HashMap::new();
        for at in (0..len).filter(|at| self.mate(*at).is_none()) {
            places.entry(self.key(at, |x| x)).or_default().push(at);
        }
        let mut spread = false;
        for at in 0..len {
            let mut operands = self.operation(at).operands().filter_map(Term::at);
            if self.mate(at).is_some() || !operands.any(|x| self.mate(x).is_some()) {
                continue;
            }
            let mirrored = self.key(at, |x| self.mate(x).unwrap_or(x));
            let is_free = |x: &&u32| **x != at && self.mate(**x).is_none();
            let other = places.get(&mirrored).and_then(|list| list.iter().find(is_free)).copied();
            if let Some(other) = other {
                self.join(at, other);
                spread = true;
            }
        }
        spread
    }

    /// Joins the operands of a pair's two nodes.
    fn spread_to_operands(&mut self) -> bool {
        let mut spread = false;
        for x in (0..self.operations.len() as u32).rev() {
            let Some(y) = self.mate(x).filter(|y| x < *y) else { continue };
            for (p, q) in self.aligned(x, y) {
                if let (Some(p), Some(q)) = (p.at(), q.at())
                    && p != q
                    && self.mate(p).is_none()
                    && self.mate(q).is_none()
                    && discriminant(self.operation(p)) == discriminant(self.operation(q))
                {
                    self.join(p, q);
                    spread = true;
                }
            }
        }
        spread
    }

    fn keep_packable(&mut self) {
        for at in 0..self.operations.len() as u32 {
            if !is_packable(self.operation(at)) {
                self.dissolve(at);
            }
        }
    }

    /// Lanes so that operands stand where they are used.
    fn choose_lanes(&mut self) {
        let len = self.operations.len();
        let mut beside: Vec<Vec<u32>> = vec![Vec::new(); len];
        for x in 0..len as u32 {
            let Some(y) = self.mate(x) else { continue };
            for (p, q) in self.aligned(x, y) {
                if let (Some(p), Some(q)) = (p.at(), q.at())
                    && self.mate(p) == Some(q)
                {
                    beside[x as usize].push(p);
                    beside[p as usize].push(x);
                }
            }
        }
        let mut chosen = vec![false; len];
        for first in 0..len as u32 {
            let mut open = vec![(first, 0)];
            while let Some((at, lane)) = open.pop() {
                let Some(mate) = self.mate(at).filter(|_| !chosen[at as usize]) else { continue };
                for (x, lane) in [(at, lane), (mate, 1 - lane)] {
                    chosen[x as usize] = true;
                    self.lanes[x as usize] = lane;
                    open.extend(beside[x as usize].iter().map(|near| (*near, lane)));
                }
            }
        }
    }

    /// The pair in the order of its lanes.
    pub(crate) fn ordered(&self, at: u32) -> Option<(u32, u32)> {
        let mate = self.mate(at)?;
        Some(if self.lane(at) == 0 { (at, mate) } else { (mate, at) })
    }

    /// Dissolves pairs that cost more than they save, counted in instructions.
    fn weed(&mut self) -> bool {
        let is_first = |at: &u32| self.mate(*at).is_some() && self.lane(*at) == 0;
        let is_loss = |x: &u32| {
            let Some(y) = self.mate(*x) else { return false };
            let operation = self.operation(*x);
            let saved = match operation {
                _ if is_gathered(operation) => 0.0,
                Operation::Divide(..) | Operation::Root(_) => 2.0,
                _ => 1.0,
            };
            let mut cost = 0.0;
            if !is_gathered(operation) {
                cost += self.aligned(*x, y).into_iter().map(|two| self.cost(two)).sum::<f64>();
            }
            // the number of the second lane by itself
            let alone = |user: &u32| {
                self.ordered(*user).is_none_or(|(u, w)| {
                    !self.aligned(u, w).iter().any(|(p, q)| q.at() == Some(y) && p.at() == Some(*x))
                })
            };
            cost += if self.users[y as usize].iter().any(alone) { 0.7 } else { 0.0 };
            saved < cost
        };
        let losses: Vec<u32> =
            (0..self.operations.len() as u32).filter(is_first).filter(is_loss).collect();
        losses.iter().for_each(|at| self.dissolve(*at));
        !losses.is_empty()
    }

    /// Instructions that bring two operands side by side.
    fn cost(&self, (p, q): (Term, Term)) -> f64 {
        match (p.at(), q.at()) {
            (None, None) => 0.0,
            (Some(a), Some(b)) if self.mate(a) == Some(b) => {
                let turned = if self.lane(a) == 0 { 0.0 } else { 1.0 };
                turned + if p.is_negated() == q.is_negated() { 0.0 } else { 0.5 }
            }
            (Some(a), Some(b)) if a == b => 0.4,
            _ => 1.0,
        }
    }

    /// Operations in an order in which both of a pair are ready; where there is none (the one hangs
    /// on the other) pairs are dissolved.
    fn order(&mut self) {
        let len = self.operations.len();
        let mut missing: Vec<usize> = vec![0; len];
        self.users.iter().flatten().for_each(|user| missing[*user as usize] += 1);
        let mut done = vec![false; len];
        // the place of a pair is that of its later one
        let key = |pairs: &Pairs, at: u32| pairs.mate(at).map_or(at, |mate| mate.max(at));
        let mut ready: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
        let is_ready = |pairs: &Pairs, missing: &[usize], at: u32| {
            let mate = pairs.mate(at).unwrap_or(at);
            missing[at as usize] == 0 && missing[mate as usize] == 0
        };
        for at in 0..len as u32 {
            if is_ready(self, &missing, at) {
                ready.push(Reverse((key(self, at), at)));
            }
        }
        let mut first = 0;
        loop {
            let Some(Reverse((_, at))) = ready.pop() else {
                // an operation without all operands waits for a pair
                while first < len && done[first] {
                    first += 1;
                }
                let stuck = (first..len).find(|at| !done[*at] && missing[*at] == 0);
                let Some(stuck) = stuck else { return };
                let mate = self.mates[stuck];
                self.dissolve(stuck as u32);
                for at in [Some(stuck as u32), mate].into_iter().flatten() {
                    if missing[at as usize] == 0 {
                        ready.push(Reverse((at, at)));
                    }
                }
                continue;
            };
            if done[at as usize] {
                continue;
            }
            let step = self.ordered(at).map_or(Step::One(at), |(x, y)| Step::Pair(x, y));
            self.steps.push(step);
            let both = [Some(at), self.mate(at)];
            for at in both.into_iter().flatten() {
                done[at as usize] = true;
                for user in self.users[at as usize].clone() {
                    missing[user as usize] -= 1;
                    if is_ready(self, &missing, user) {
                        ready.push(Reverse((key(self, user), user)));
                    }
                }
            }
        }
    }
}
