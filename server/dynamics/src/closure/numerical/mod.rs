//! Any loop by Newton's method on its rows, block by block.
//!
//! At load the independent rows and the dependent joints of a cluster are sorted into block
//! triangular form: a block is a smallest set of rows that determines as many joints once the
//! blocks before it are closed (a leg of a platform, one four-bar of a wrist). A block of up to
//! three rows is inverted in closed form, a larger one by sparse elimination in an order fixed at
//! load. The inverse at the accepted pose gives G and g. Requests without a guess start from a
//! table ([`seeds`]) or use a closed form that agrees with it.

mod bias;
mod bifurcation;
pub(super) mod block;
mod chain;
pub(super) mod continuation;
pub(super) mod elimination;
mod form;
mod inverse;
mod jacobian;
mod newton;
mod rods;
pub(crate) mod seeds;
mod series;
mod steps;
mod straight;

use std::sync::Arc;

use sarrus_proto::Status;

use crate::closure::constraint::rows::place;
use crate::closure::numerical::block::Blocks;
use crate::closure::numerical::newton::{CAUTION, Start};
use crate::closure::numerical::seeds::Seeds;
use crate::closure::path::distance;
use crate::closure::{Level, Local, Outcome, Scratch, interpolate};
use crate::mechanism::{Motion, turn_some};
use crate::scalar::{Real, constants};
use crate::spatial::Pose;

pub(crate) use chain::{BlockForm, Chain};
pub(crate) use form::{Form, Formed};
pub(crate) use rods::{FEW_STEPS, Mover, Rod, Rods, screw};
pub(crate) use steps::Steps;

/// Most Newton steps of one straight attempt.
const STEPS: u32 = 10;
/// Gain from which on another choice among redundant rows may be better.
const POOR: f64 = 1e4;

/// When one straight attempt of Newton's method ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    /// Size of the last step, in radians or cluster lengths; `None`: one that leaves only rounding.
    /// With it the pose after all steps stands.
    pub(crate) tolerance: Option<f64>,
    /// How many steps it may take.
    pub(crate) steps: u32,
}

/// Which determinants' signs an attempt has to keep besides those of its own steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::closure) enum Branches {
    /// None.
    Unknown,
    /// The signs in the scratch, of the blocks whose first step would not show their old sign.
    Remembered,
    /// The signs in the scratch, of all blocks.
    All,
}

/// The blocks of a cluster in the order in which they are closed.
#[derive(Clone, Debug)]
pub(crate) struct Numerical<T> {
    /// The blocks of each choice among redundant rows. The first one serves, near a pose where it
    /// is singular the one that is farthest from that.
    pub(crate) choices: Vec<Blocks>,
    /// The closed pose at y = 0 from which a request without a guess starts (n_q).
    pub(crate) zero: Vec<T>,
    /// Coordinates that advance by whole turns with a continuous independent joint.
    pub(crate) turns: Vec<Turn>,
    /// Closed poses near which a request without a guess can start.
    pub(crate) seeds: Option<Arc<Seeds>>,
    /// The closed form that holds where there are seeds.
    pub(crate) form: Option<Box<Formed<T>>>,
    pub(crate) end: End,
    /// How far the independents may go from the zero pose in one attempt, in radians or cluster
    /// lengths. The rule of an attempt asks the same of its start, where they have moved already.
    pub(crate) reach: f64,
    /// Two assemblies can meet: every way is followed along its tangent.
    pub(crate) meets: bool,
}

constants! { Numerical:
    keep choices turns seeds end reach meets;
    list zero;
    other form: |f, form| Box::new(form.map(f));
}

/// A whole turn of an independent joint that brings the loops back to the same pose.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    /// Its local coordinate.
    pub(crate) coordinate: usize,
    /// By how many turns each coordinate has changed (n_q).
    pub(crate) turns: Vec<f64>,
}

impl Turn {
    /// Brings the closed pose `start` within half a turn of the coordinate in `q`.
    #[inline]
    pub(crate) fn bring<T: Real>(&self, start: &mut [T], q: &[T]) {
        let away = (q[self.coordinate] - start[self.coordinate]).to_f64();
        if away.abs() <= core::f64::consts::PI {
            return;
        }
        let turns = (away / core::f64::consts::TAU).round() * core::f64::consts::TAU;
        for (x, of_x) in start.iter_mut().zip(&self.turns) {
            *x += T::from_f64(turns * of_x);
        }
    }
}

impl<T: Real> Numerical<T> {
    /// From the blocks of each choice of rows and a closed pose.
    pub(crate) fn new(choices: Vec<Blocks>, zero: Vec<T>) -> Numerical<T> {
        Numerical {
            choices,
            zero,
            turns: Vec::new(),
            seeds: None,
            form: None,
            end: End { tolerance: None, steps: STEPS },
            reach: f64::INFINITY,
            meets: false,
        }
    }

    /// Sets the reach of attempts from the zero pose, which is in `local.q`.
    pub(crate) fn set_reach(&mut self, local: &mut Local<'_, T>) {
        local.pose();
        let blocks = self.choices[0].blocks.iter().filter(|block| !block.couples);
        let near = blocks.map(|block| block.near(local)).fold(T::ONE, T::larger).to_f64();
        if near.is_finite() {
            self.reach = CAUTION / near.sqrt();
        }
    }

    /// True if the independents are farther from zero than one attempt may go.
    #[inline(always)]
    pub(in crate::closure) fn is_far(&self, local: &Local<'_, T>, moved: T) -> bool {
        local.from_zero && T::from_f64(self.reach).lt(moved)
    }

    /// Marks a mechanism of which two assemblies can meet.
    pub(crate) fn set_meets(&mut self) {
        self.meets = true;
        let blocks = self.choices.iter_mut().flat_map(|choice| &mut choice.blocks);
        blocks.for_each(|block| block.remember = true);
    }

    /// The choice of rows in use.
    #[inline(always)]
    pub(in crate::closure) fn chosen(&self, scratch: &Scratch<T>) -> &Blocks {
        &self.choices[scratch.choice]
    }

    /// Takes the choice of rows that is farthest from a singular pose at the closed pose in
    /// `local.q`.
    fn choose(&self, local: &mut Local<'_, T>) {
        if self.choices.len() == 1 {
            return;
        }
        local.pose();
        let mut least = T::from_f64(f64::INFINITY);
        let mut best = 0;
        for (k, choice) in self.choices.iter().enumerate() {
            let gain = choice.blocks.iter().fold(T::ONE, |gain, block| {
                local.scratch.spend(block.work);
                gain * block.gain(local)
            });
            if gain < least {
                (least, best) = (gain, k);
            }
        }
        local.scratch.choice = best;
    }

    /// Closes every block from the dependents in `local.q`; poses on the paths to all cuts are
    /// fresh after a good end. Returns whether all converged without a doubtful step and without a
    /// change of sign of any block's determinant; `moved` is how far the independents are
    /// from the pose that the dependents are of.
    pub(in crate::closure) fn newton(
        &self,
        local: &mut Local<'_, T>,
        branches: Branches,
        moved: T,
    ) -> (bool, u32) {
        let &mut Local { cluster, bodies, .. } = local;
        local.scratch.pose[0] = Pose::identity();
        let turns = bodies.iter().enumerate().filter(|(_, body)| body.motion == Motion::Revolute);
        turn_some(turns.map(|(j, body)| (j, body.q - cluster.q)), local.q, local.cos_sin);
        let mut good = true;
        let mut taken = 0;
        let Blocks { blocks, after, .. } = self.chosen(local.scratch);
        for (b, block) in blocks.iter().enumerate() {
            for &j in &block.before {
                place(cluster, bodies, j, local.q, local.cos_sin, &mut local.scratch.pose);
            }
            let branch = match branches {
                Branches::All => Some(local.scratch.branch[b]),
                Branches::Remembered if block.remember => Some(local.scratch.branch[b]),
                _ => None,
            };
            let start = Start { branch, moved };
            let (fine, count, own) = block.newton(local, start, self.end);
            block.multiply_gain(b, own, &mut local.scratch.gain);
            local.scratch.spend(u64::from(count) * block.work);
            good &= fine;
            taken += count;
            if !good {
                break;
            }
        }
        for &j in after {
            place(cluster, bodies, j, local.q, local.cos_sin, &mut local.scratch.pose);
        }
        (good, taken)
    }

    /// Takes the best choice of rows at the closed pose in `local.q`, and notes its branch.
    pub(in crate::closure) fn settle(&self, local: &mut Local<'_, T>) {
        self.choose(local);
        self.remember(local);
    }

    /// Notes the branch of the closed pose in `local.q`, of the blocks whose first step would not
    /// show it.
    pub(in crate::closure) fn remember(&self, local: &mut Local<'_, T>) {
        let blocks = &self.chosen(local.scratch).blocks;
        if !blocks.iter().any(|block| block.remember) {
            return;
        }
        local.pose();
        for (b, block) in blocks.iter().enumerate().filter(|(_, block)| block.remember) {
            local.scratch.spend(block.work);
            local.scratch.branch[b] = block.determinant(local);
        }
    }
}

impl<T: Real> Numerical<T> {
    /// Position level from the closed pose `local.start`, then the levels below.
    pub(crate) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Outcome {
        let cluster = local.cluster;
        local.scratch.choice = 0;
        for &i in &cluster.dependent_q {
            local.q[i] = local.start[i];
        }
        if local.from_zero
            && let Some(seeds) = &self.seeds
        {
            if let Some(outcome) = self.close_in_form(seeds, local, level) {
                return outcome;
            }
            if let Some(outcome) = self.close_from(seeds, local) {
                return self.differentiate(local, level, outcome);
            }
            for &i in &cluster.dependent_q {
                local.q[i] = local.start[i];
            }
        }
        let moved = distance(cluster, local.start, local.q);
        let (good, iterations) = if self.meets || self.is_far(local, moved) {
            (false, 0)
        } else {
            self.newton(local, Branches::Unknown, moved)
        };
        let gap = if good { continuation::redundant_gap(local) } else { T::ZERO };
        let outcome = if good && continuation::holds(gap) {
            Outcome { open: gap.to_f64(), ..Outcome::closed(iterations) }
        } else {
            bifurcation::follow_or_bifurcate(self, local, iterations)
        };
        if outcome.status == Status::Ok {
            self.differentiate(local, level, outcome)
        } else {
            outcome
        }
    }

    /// One attempt from a seed, if there is one.
    fn close_from(&self, seeds: &Seeds, local: &mut Local<'_, T>) -> Option<Outcome> {
        let is_there = seeds.find(local.start, local.q)
            && self.form.as_ref().is_none_or(|form| form.complete(local));
        if !is_there {
            return None;
        }
        for (branch, sign) in local.scratch.branch.iter_mut().zip(&seeds.signs) {
            *branch = T::from_f64(*sign);
        }
        self.attempt(local, T::ZERO)
    }

    /// The closed pose where the straight path from the zero pose to `scratch.goal` leaves the
    /// table, and the part of the path before it; `None` without one.
    pub(in crate::closure) fn enter(&self, local: &mut Local<'_, T>) -> Option<f64> {
        let seeds = self.seeds.as_deref().filter(|_| local.from_zero && !self.meets)?;
        let share = seeds.share(local.start, &local.scratch.goal);
        let goal = &local.scratch.goal;
        interpolate(local.cluster, local.start, goal, T::from_f64(share), local.q);
        local.scratch.choice = 0;
        self.close_from(seeds, local)?;
        Some(share)
    }

    /// One straight attempt from the dependents in `local.q`, on the branch whose signs of
    /// determinants are in the scratch; the independents have moved so far from the pose that the
    /// dependents are of.
    pub(crate) fn attempt(&self, local: &mut Local<'_, T>, moved: T) -> Option<Outcome> {
        let (good, iterations) = self.newton(local, Branches::All, moved);
        if !good {
            return None;
        }
        let gap = continuation::redundant_gap(local);
        let outcome = Outcome { open: gap.to_f64(), ..Outcome::closed(iterations) };
        continuation::holds(gap).then_some(outcome)
    }

    /// Determinant of each block at the closed pose in `local.q`, into the scratch.
    pub(crate) fn determinants(&self, local: &mut Local<'_, T>) {
        local.scratch.choice = 0;
        local.pose();
        for (b, block) in self.choices[0].blocks.iter().enumerate() {
            local.scratch.branch[b] = block.determinant(local);
        }
    }

    /// Newton steps from a closed form's answer, on its branch.
    pub(crate) fn polish(&self, local: &mut Local<'_, T>) -> Outcome {
        local.scratch.choice = 0;
        self.remember(local);
        let (good, iterations) = self.newton(local, Branches::Remembered, T::ZERO);
        if good {
            let open = continuation::redundant_gap(local).to_f64();
            Outcome { open, ..Outcome::closed(iterations) }
        } else {
            Outcome::failed(Status::NotConverged, iterations)
        }
    }

    /// The levels below the position, with the reason where a block cannot be inverted.
    #[inline(always)]
    pub(crate) fn differentiate(
        &self,
        local: &mut Local<'_, T>,
        level: Level,
        outcome: Outcome,
    ) -> Outcome {
        let mut sound = level == Level::Position || self.chosen(local.scratch).rates(local, level);
        if self.choices.len() > 1 {
            sound = self.rechosen(local, level, sound);
        }
        if !sound {
            return Outcome::failed(continuation::singular_status(local), outcome.iterations);
        }
        Outcome { gain: self.gain(local).to_f64(), ..outcome }
    }

    /// The largest gain of the blocks, at least 1.
    #[inline(always)]
    fn gain(&self, local: &Local<'_, T>) -> T {
        let gains = &local.scratch.gain[..self.chosen(local.scratch).blocks.len()];
        gains.iter().fold(T::ONE, |largest, gain| largest.larger(*gain))
    }

    /// Whether the levels below the position are sound, by another choice of rows where the one in
    /// use is poor and another one closes the pose to the last digit.
    #[inline(never)]
    fn rechosen(&self, local: &mut Local<'_, T>, level: Level, sound: bool) -> bool {
        if sound && self.gain(local).lt(T::from_f64(POOR)) {
            return sound;
        }
        let before = local.scratch.choice;
        self.choose(local);
        if local.scratch.choice == before {
            return sound;
        }
        self.newton(local, Branches::Unknown, T::ZERO).0
            && (level == Level::Position || self.chosen(local.scratch).rates(local, level))
    }
}
