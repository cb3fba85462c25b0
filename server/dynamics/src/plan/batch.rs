//! Answers many states of one plan, several at a time.
//!
//! States that take the same branches of a plan share its run over lanes, and each has the bits
//! that it has alone. A state runs alone if it fails, gets a warning other than of limits, or takes
//! another branch than the first of its lanes ([`crate::scalar::BranchValue`]). Closures by
//! Newton's method take a different number of steps for each state: they are closed state by state
//! first ([`Plan::close`]), and the packet computes the rest.

mod fields;
mod tile;

use std::iter;
use std::sync::Arc;

pub use fields::PackedRows;
use sarrus_proto::{Answer, Field, FieldSet, Request, Status, Warnings};

use crate::model::{Method, Model};
use crate::plan::Plan;
use crate::plan::batch::tile::Tile;
use crate::scalar::{FUSED, LANES, Packet, Real};
use crate::workspace::{Workspace, most_closed};

/// Most states that [`BatchWorkspace::close_rows`] closes at once.
pub const MOST_ROWS: usize = 8;
const _: () = assert!(LANES <= MOST_ROWS);

/// Every row runs alone.
const ALL: u32 = u32::MAX;

/// The answer of a row whose turn ended before it was closed.
pub const CUT_SHORT: Answer = Answer { status: Status::NotConverged, warnings: Warnings::NONE };

/// Fields that a packet of states, or a kernel, may give: numbers of each state alone.
pub const STRAIGHT_GIVEN: FieldSet = FieldSet::of(&[
    Field::Y,
    Field::Yd,
    Field::Ydd,
    Field::QGuess,
    Field::QdGuess,
    Field::TauQ,
    Field::TauY,
    Field::TauU,
    Field::Wrenches,
]);

/// The fields whose numbers kernels compute in a straight line: one run of a plan over a scalar
/// that stands for several states, or for all, gives them.
pub const STRAIGHT_FIELDS: FieldSet = FieldSet::of(&[
    Field::Y,
    Field::Yd,
    Field::Ydd,
    Field::Q,
    Field::Qd,
    Field::Qdd,
    Field::U,
    Field::Ud,
    Field::Udd,
    Field::TauQ,
    Field::TauY,
    Field::TauU,
    Field::TauUnactuated,
    Field::G,
    Field::GBias,
    Field::GU,
    Field::GUBias,
    Field::MY,
    Field::CY,
    Field::FramePose,
    Field::FrameTwist,
    Field::FrameAcc,
    Field::JacobianTree,
    Field::JacobianIndependent,
    Field::JacobianActuator,
]);

/// A plan with the scratch for many states; a clone for each thread shares the constants.
///
/// ```
/// use std::sync::Arc;
///
/// use sarrus_dynamics::description::Inertial;
/// use sarrus_dynamics::{
///     Answer, Batch, DescriptionBuilder, Field, FieldSet, LinkId, Plan, Query, Request, Status,
///     Warnings,
/// };
///
/// // a pendulum: 1 kg, 1 m below a horizontal axis
/// let mut robot = DescriptionBuilder::new("pendulum");
/// let bob = Inertial::point(1.0, [0.0, 0.0, -1.0]);
/// robot.revolute("pivot", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(bob);
/// let model = Arc::new(robot.compile()?.model);
/// let (given, want) = (FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::TauU]));
/// let plan = Plan::new(&model, &Query::new(Request::InverseDynamics, given, want))?;
/// let mut batch = Batch::new(&model, &plan);
/// let angles: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
/// let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
/// let (mut forces, mut answers) = (vec![0.0; 100], vec![unknown; 100]);
/// batch.run(&angles, &mut forces, &mut answers);
/// assert!(answers.iter().all(|answer| answer.status == Status::Ok));
/// assert!((forces[99] - 9.81 * 0.99_f64.sin()).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Batch {
    plan: Plan,
    workspace: BatchWorkspace,
    packed: PackedRows,
}

impl Batch {
    /// Scratch for many states of a plan of this model; of a plan of another model every answer is
    /// [`Status::WrongModel`]. Allocates; nothing after it does.
    pub fn new(model: &Arc<Model<f64>>, plan: &Plan) -> Batch {
        let packed = plan.abreast() > 1;
        let width = plan.given().len() + plan.closed_len();
        let workspace = BatchWorkspace {
            model: Arc::clone(model),
            workspace: Workspace::for_plans(model, [plan]),
            closed: vec![0.0; if plan.closes_apart() { MOST_ROWS * width } else { 0 }],
            tile: packed.then(|| {
                let constants = model.convert(Packet::splat);
                let workspace = Workspace::for_plans(&constants, [plan]);
                Box::new(Tile::new(constants, workspace, width, plan.want().len()))
            }),
            alone: 0,
            cut: None,
        };
        let packed = PackedRows::new(LANES, plan.given().len(), plan.want().len());
        Batch { plan: plan.clone(), workspace, packed }
    }

    /// How many states it answered one by one so far.
    pub fn alone(&self) -> u64 {
        self.workspace.alone
    }

    /// How many states go abreast: [`LANES`], or 1 where each is answered alone.
    pub fn lanes(&self) -> usize {
        self.plan.abreast()
    }

    /// The plan, and the scratch for it.
    pub fn parts(&mut self) -> (&Plan, &mut BatchWorkspace) {
        (&self.plan, &mut self.workspace)
    }

    /// Answers as many states as there are places for answers; `input` and `output` hold their rows
    /// one after the other, packed by [`Plan::given`] and [`Plan::want`]. Each row, status and
    /// warning is that of [`Plan::run`], to the bit. Where the sizes do not fit every row is
    /// [`Status::WrongSize`] and NaN. Allocates never.
    pub fn run(&mut self, input: &[f64], output: &mut [f64], answers: &mut [Answer]) {
        self.workspace.run(&self.plan, input, output, answers);
    }
}

/// Scratch for one state and for many, of any plan of a model.
#[derive(Clone, Debug)]
pub struct BatchWorkspace {
    model: Arc<Model<f64>>,
    workspace: Workspace<f64>,
    /// Given numbers of up to [`MOST_ROWS`] states, each row followed by its closure results; empty
    /// for models without separate closures.
    closed: Vec<f64>,
    /// Where states go abreast.
    tile: Option<Box<Tile>>,
    alone: u64,
    /// In turns: the row of the last tile that took its turn without being closed.
    cut: Option<usize>,
}

impl BatchWorkspace {
    /// Scratch for every plan of this model that takes and gives at most so many numbers, but those
    /// that force [`Method::Kkt`]. Allocates; nothing after it does.
    pub fn new(model: &Arc<Model<f64>>, n_in: usize, n_out: usize) -> BatchWorkspace {
        let closed = most_closed(model);
        let width = n_in + closed;
        BatchWorkspace {
            model: Arc::clone(model),
            workspace: Workspace::new(model),
            closed: vec![0.0; if closed > 0 { MOST_ROWS * width } else { 0 }],
            tile: FUSED.then(|| {
                let constants = model.convert(Packet::splat);
                let workspace = Workspace::new(&constants);
                Box::new(Tile::new(constants, workspace, width, n_out))
            }),
            alone: 0,
            cut: None,
        }
    }

    /// As [`Workspace::answer_in_turns`]; rows are answered up to the first that goes alone.
    pub fn answer_in_turns(&mut self) {
        self.workspace.answer_in_turns();
    }

    /// True after [`BatchWorkspace::answer_in_turns`].
    pub fn answers_in_turns(&self) -> bool {
        self.workspace.is_in_turns()
    }

    /// In turns: true if this row of the last tile took its turn without being closed. It has
    /// [`CUT_SHORT`], and [`Plan::is_cut_short`] holds.
    pub fn is_cut(&self, row: usize) -> bool {
        self.cut == Some(row) && self.workspace.is_cut()
    }

    /// The model that it was made for.
    pub fn model(&self) -> &Model<f64> {
        &self.model
    }

    /// Model and workspace of a single state, for [`Plan::run`].
    #[inline]
    pub fn one(&mut self) -> (&Model<f64>, &mut Workspace<f64>) {
        (&self.model, &mut self.workspace)
    }

    /// Closes up to [`MOST_ROWS`] states of a plan by [`Plan::close`], as many as `given` has: one
    /// after the other, rows for [`Plan::run_closed`], and a bit for each that has none, in whose
    /// place stands one that has. `None` where none has one, or there is no room. Allocates never.
    pub fn close_rows(&mut self, plan: &Plan, given: &[f64]) -> Option<(&[f64], u32)> {
        let BatchWorkspace { model, workspace, closed, cut, .. } = self;
        close_rows(plan, model, workspace, (closed, cut), given)
    }

    /// Answers states of a plan, as [`Batch::run`]; how many, which are all but in turns.
    pub fn run(
        &mut self,
        plan: &Plan,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> usize {
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let rows = answers.len();
        if Some(input.len()) != rows.checked_mul(n_in)
            || Some(output.len()) != rows.checked_mul(n_out)
        {
            output.fill(f64::NAN);
            answers.fill(Answer { status: Status::WrongSize, warnings: Warnings::NONE });
            return rows;
        }
        let mut done = 0;
        let packed =
            plan.batch_width > 1 && self.tile.as_ref().is_some_and(|tile| tile.holds(plan));
        let mut input = input;
        let mut output = output;
        let mut answers = answers;
        while !answers.is_empty() {
            let rows = answers.len().min(LANES);
            let (given, rest) = input.split_at(rows * n_in);
            input = rest;
            let (want, rest) = output.split_at_mut(rows * n_out);
            output = rest;
            let (of_rows, rest) = answers.split_at_mut(rows);
            answers = rest;
            let packed = packed && rows == LANES;
            let alone = if packed { self.run_tile(plan, given, want, of_rows) } else { ALL };
            for row in (0..rows).filter(|row| alone >> row & 1 != 0) {
                if packed && self.is_cut(row) {
                    of_rows[row] = CUT_SHORT;
                    return done + row + 1;
                }
                self.alone += 1;
                of_rows[row] = plan.run(
                    &self.model,
                    &mut self.workspace,
                    &given[row * n_in..][..n_in],
                    &mut want[row * n_out..][..n_out],
                );
                if self.answers_in_turns() {
                    return done + row + 1;
                }
            }
            done += rows;
        }
        done
    }

    /// Answers [`LANES`] states but for those in the bits that it returns, which have to go alone.
    fn run_tile(
        &mut self,
        plan: &Plan,
        given: &[f64],
        want: &mut [f64],
        answers: &mut [Answer],
    ) -> u32 {
        let BatchWorkspace { model, workspace, closed, tile: Some(tile), cut, .. } = self else {
            return ALL;
        };
        let (given, open) = if plan.closes_apart() {
            let Some(closed) = close_rows(plan, model, workspace, (closed, cut), given) else {
                return ALL;
            };
            closed
        } else {
            (given, 0)
        };
        let given = iter::once((given, plan.given().len() + plan.closed_len()));
        let want = iter::once((want, plan.want().len()));
        open | tile.run(plan, given, want, answers)
    }
}

/// As [`BatchWorkspace::close_rows`].
fn close_rows<'a>(
    plan: &Plan,
    model: &Model<f64>,
    workspace: &mut Workspace<f64>,
    (closed, cut): (&'a mut [f64], &mut Option<usize>),
    given: &[f64],
) -> Option<(&'a [f64], u32)> {
    let n_in = plan.given().len();
    let width = n_in + plan.closed_len();
    let rows = given.len().checked_div(n_in)?.min(MOST_ROWS);
    let closed = closed.get_mut(..rows * width)?;
    let in_turns = workspace.is_in_turns();
    let mut open = 0;
    let mut sound = None;
    for row in 0..rows {
        let given = &given[row * n_in..][..n_in];
        match plan.close(model, workspace, given) {
            Some(numbers) => {
                closed[row * width..][..width].copy_from_slice(numbers);
                sound = Some(row);
            }
            // it goes alone, and those behind it have their turn later
            None if in_turns => {
                *cut = Some(row);
                open |= u32::MAX << row;
                break;
            }
            None => open |= 1 << row,
        }
    }
    let sound = sound? * width;
    for row in (0..rows).filter(|row| open >> row & 1 != 0) {
        closed.copy_within(sound..sound + width, row * width);
    }
    Some((closed, open))
}

impl Plan {
    /// How many states of this plan go abreast: [`LANES`], or 1 where each is answered alone.
    pub fn abreast(&self) -> usize {
        self.batch_width
    }

    /// True if the last [`Plan::close`] of this workspace took its whole turn; where it returned
    /// nothing the answer is [`CUT_SHORT`].
    pub fn spent_turn<T: Real>(&self, workspace: &Workspace<T>) -> bool {
        self.closes_apart() && workspace.is_cut()
    }

    /// Computes the batch width. Forward dynamics of the whole KKT system, a check of the other
    /// methods, runs state by state by choice.
    pub(super) fn batch_width_on<C>(&self, model: &Model<C>) -> usize {
        let is_only = |fields: FieldSet, of: FieldSet| fields.0 & !of.0 == 0;
        let whole = self.request == Request::ForwardDynamics && self.method == Method::Kkt;
        let packed = FUSED
            && !whole
            && is_only(self.query.given, STRAIGHT_GIVEN)
            && is_only(self.query.want, STRAIGHT_FIELDS)
            && (self.closes_apart()
                || self.needed.scope.closed.iter().all(|c| model.closures[*c].is_closed_form()));
        if packed { LANES } else { 1 }
    }
}
