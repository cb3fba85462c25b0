use core::fmt;

use crate::request::{OF_ACTUATOR_FORCES, Request, TaskParts};
use crate::wire_enum::wire_enum;
use crate::{Field, FieldSet, MOST_VERTEX_COORDINATES, ModelInfo, Rows};
use QueryError::{BadTask, Missing};

/// Most frames of one plan.
pub const MAX_FRAMES: usize = 32;
/// Most links with wrenches of one plan.
pub const MAX_WRENCHES: usize = 16;
/// Most directions of supports of one plan.
pub const MAX_DIRECTIONS: usize = 64;
/// Most runs of neighbouring joints of one plan.
pub const MAX_JOINT_RUNS: usize = 31;
/// Most frames of a query that are held.
pub const MAX_CONTACTS: usize = 4;
/// The version of this package, for messages about unknown numbers.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// The need for forces, in words.
const FORCES: &str = "the forces: give tau_u, tau_y or tau_q";
/// Words of a query that have no meaning yet.
const RESERVED: usize = 10;

wire_enum! {
    /// Axes and reference point of the twists, accelerations and Jacobians of frames.
    Axes: u32 {
        /// Root axes, at the frame's origin.
        Mixed = 0, "mixed";
        /// Root axes, at the root's origin; accelerations stay those of the frame's origin.
        World = 1, "world";
        /// The frame's axes, at its origin.
        Local = 2, "local";
    }
}

/// Additions to the heads of a query's requests and answers, and how long it may take, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[repr(transparent)]
pub struct QueryOptions(pub u64);

impl QueryOptions {
    /// Nothing.
    pub const NONE: QueryOptions = QueryOptions(0);
    /// Requests and answers have a checksum.
    pub const CHECKSUM: QueryOptions = QueryOptions(1);
    /// Requests have a stamp; answers have the request's age and the time taken.
    pub const TIMES: QueryOptions = QueryOptions(2);

    /// Closures are continued and the nearest independents sought as long as it takes; without it
    /// the work of a request is bounded.
    pub const SEARCH: QueryOptions = QueryOptions(4);

    /// Forces count the friction of joints.
    pub const FRICTION: QueryOptions = QueryOptions(8);

    const KNOWN: QueryOptions = QueryOptions::CHECKSUM
        .with(QueryOptions::TIMES)
        .with(QueryOptions::SEARCH)
        .with(QueryOptions::FRICTION);

    /// True when every bit of `other` is set.
    pub const fn contains(self, other: QueryOptions) -> bool {
        self.0 & other.0 == other.0
    }

    /// The bits that change the numbers of an answer.
    #[must_use]
    pub const fn of_numbers(self) -> QueryOptions {
        QueryOptions(self.0 & QueryOptions::FRICTION.0)
    }

    /// The union.
    #[must_use]
    pub const fn with(self, other: QueryOptions) -> QueryOptions {
        QueryOptions(self.0 | other.0)
    }

    /// True if every bit is known to this version.
    pub const fn is_known(self) -> bool {
        QueryOptions::KNOWN.contains(self)
    }
}

/// A bound in radians or lengths of a cluster, kept as its bits: queries are compared and hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[repr(transparent)]
pub struct Tolerance(pub u64);

impl Tolerance {
    /// 1e-6: files with six decimals stay below it.
    pub const USUAL: Tolerance = Tolerance::new(1e-6);

    /// The bound of a number.
    pub const fn new(bound: f64) -> Tolerance {
        Tolerance(bound.to_bits())
    }

    /// The number of the bound.
    pub const fn bound(self) -> f64 {
        f64::from_bits(self.0)
    }
}

impl Default for Tolerance {
    fn default() -> Tolerance {
        Tolerance::USUAL
    }
}

/// The subject of a plan: the fields of the request and the fields of the answer. Its bytes travel
/// unchanged, so it holds plain numbers only, and [`Query::check`] checks it before use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "transport", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Query {
    /// Number of the [`Request`].
    pub request: u32,
    /// Number of entries used in `frames`.
    pub n_frames: u16,
    /// Number of entries used in `wrench_links`.
    pub n_wrenches: u16,
    /// The fields that each request gives.
    pub given: FieldSet,
    /// The fields that each answer holds.
    pub want: FieldSet,
    /// Additions to the heads of requests and answers.
    pub options: QueryOptions,
    /// Gap of a redundant row above which an answer carries [`crate::Warnings::LOOP_OPEN`].
    pub loop_tolerance: Tolerance,
    /// Distance from the given state above which an answer carries
    /// [`crate::Warnings::INPUT_PROJECTED`].
    pub projection_tolerance: Tolerance,
    /// Indices of the links whose frames are wanted.
    pub frames: [u16; MAX_FRAMES],
    /// Indices of the links that wrenches act on.
    pub wrench_links: [u16; MAX_WRENCHES],
    /// Number of entries used in `joints`; 0 means all joints.
    pub n_joint_runs: u32,
    /// The joints whose rows are wanted, as half-open runs of tree velocities, ascending and
    /// disjoint; see [`crate::Rows`].
    pub joints: [[u16; 2]; MAX_JOINT_RUNS],
    /// Number of the [`Axes`] of frames.
    pub axes: u32,
    /// One more than the index of the link that takes the root's place for frames: poses are in its
    /// frame, motions are those that it sees, and Jacobians theirs; 0 for the root.
    pub relative_to: u32,
    /// Number of given directions of supports.
    pub n_directions: u64,
    /// Of a request with tasks: the parts of each of `frames`.
    pub tasks: [TaskParts; MAX_FRAMES],
    /// Zeros: room for numbers of rows, links and parameters of later requests. A server refuses
    /// those that it does not know.
    pub reserved: [u64; RESERVED],
}

/// Why a [`Query`] cannot be planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum QueryError {
    /// The request's number is unknown.
    UnknownRequest(u32),
    /// A bit of `given` or `want` is no field of this version.
    UnknownField,
    /// A bit of `options` or a word of `reserved` is unknown to this version.
    UnknownOption,
    /// A tolerance is negative or not a number.
    BadTolerance,
    /// More frames or wrenches than a plan can name.
    TooMany {
        /// The list that is too long.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
    /// An index names no link of the model.
    UnknownLink(u16),
    /// Runs of joints that are empty, out of order or beyond the model's joints.
    BadJoints,
    /// A task is malformed, or names no part of a frame.
    BadTask(&'static str),
    /// A field cannot be given to this request.
    NotAnInput(Field),
    /// This request cannot return a field.
    NotAnOutput(Field),
    /// None of the fields that this request needs is given.
    Missing(&'static str),
    /// Two given fields exclude each other.
    Conflict(Field, Field),
    /// States all over the limits, nearly all of which have no answer.
    NoStates,
}

impl fmt::Display for QueryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            QueryError::UnknownRequest(code) => {
                write!(f, "request number {code} is unknown; this version knows 1 to 5")
            }
            QueryError::UnknownField => {
                write!(f, "a field number is unknown to sarrus {VERSION}; client and server differ")
            }
            QueryError::UnknownOption => {
                write!(f, "an option is unknown to sarrus {VERSION}; client and server differ")
            }
            QueryError::BadTolerance => {
                f.write_str("a tolerance is negative or no number; give one from 0 on")
            }
            QueryError::TooMany { what, limit } => {
                write!(f, "too many {what}; a plan names at most {limit}")
            }
            QueryError::UnknownLink(index) => write!(f, "link number {index} is not in the model"),
            QueryError::BadJoints => f.write_str(
                "runs of joints are empty, out of order, or beyond the joints of the model",
            ),
            QueryError::BadTask(why) => f.write_str(why),
            QueryError::NotAnInput(field) => {
                write!(f, "`{}` is no input of this request", field.name())
            }
            QueryError::NotAnOutput(field) => {
                write!(f, "`{}` is no output of this request", field.name())
            }
            QueryError::Missing(what) => write!(f, "nothing says {what}"),
            QueryError::NoStates => f.write_str(
                "nearly no state within the limits has an answer; give limits in which loops close",
            ),
            QueryError::Conflict(a, b) => {
                write!(f, "`{}` and `{}` exclude each other; give one", a.name(), b.name())
            }
        }
    }
}

impl core::error::Error for QueryError {}

impl Query {
    /// A query without frames and wrenches.
    pub const fn new(request: Request, given: FieldSet, want: FieldSet) -> Query {
        Query {
            request: request as u32,
            n_frames: 0,
            n_wrenches: 0,
            given,
            want,
            options: QueryOptions::NONE,
            loop_tolerance: Tolerance::USUAL,
            projection_tolerance: Tolerance::USUAL,
            frames: [0; MAX_FRAMES],
            wrench_links: [0; MAX_WRENCHES],
            n_joint_runs: 0,
            joints: [[0; 2]; MAX_JOINT_RUNS],
            axes: Axes::Mixed as u32,
            relative_to: 0,
            n_directions: 0,
            tasks: [TaskParts(0); MAX_FRAMES],
            reserved: [0; RESERVED],
        }
    }

    /// Restricts the query to the rows of these tree velocities, ascending; an empty list selects
    /// all. Runs beyond [`MAX_JOINT_RUNS`] are counted and refused by [`Query::check`].
    #[must_use]
    pub fn with_joints(mut self, velocities: impl IntoIterator<Item = u16>) -> Query {
        let mut runs = 0;
        self.joints = [[0; 2]; MAX_JOINT_RUNS];
        for v in velocities {
            match self.joints[..runs.min(MAX_JOINT_RUNS)].last_mut() {
                Some(run) if run[1] == v => run[1] = v.saturating_add(1),
                _ => {
                    if let Some(run) = self.joints.get_mut(runs) {
                        *run = [v, v.saturating_add(1)];
                    }
                    runs += 1;
                }
            }
        }
        self.n_joint_runs = runs as u32;
        self
    }

    /// Sets the links whose frames are wanted; indices beyond [`MAX_FRAMES`] are counted and
    /// refused by [`Query::check`].
    #[must_use]
    pub fn with_frames(mut self, links: &[u16]) -> Query {
        self.n_frames = links.len().min(u16::MAX as usize) as u16;
        self.frames.iter_mut().zip(links).for_each(|(slot, link)| *slot = *link);
        self
    }

    /// Sets the tasks, as links with their parts; adds [`Field::TaskTarget`] to the given fields of
    /// inverse kinematics, [`Field::TaskMotion`] to those of other requests. Tasks beyond
    /// [`MAX_FRAMES`] are counted and refused by [`Query::check`].
    #[must_use]
    pub fn with_tasks(mut self, tasks: &[(u16, TaskParts)]) -> Query {
        self.n_frames = tasks.len().min(u16::MAX as usize) as u16;
        for ((frame, parts), task) in self.frames.iter_mut().zip(&mut self.tasks).zip(tasks) {
            (*frame, *parts) = *task;
        }
        let request = Request::from_code(self.request).unwrap_or(Request::InverseKinematics);
        self.given = self.given.with(request.of_tasks());
        self
    }

    /// Sets the links that wrenches act on; adds [`Field::Wrenches`] to the given fields.
    #[must_use]
    pub fn with_wrenches(mut self, links: &[u16]) -> Query {
        self.n_wrenches = links.len().min(u16::MAX as usize) as u16;
        self.wrench_links.iter_mut().zip(links).for_each(|(slot, link)| *slot = *link);
        self.given = self.given.with(Field::Wrenches);
        self
    }

    /// Sets the number of directions whose supports are wanted; adds [`Field::Directions`] to the
    /// given fields.
    #[must_use]
    pub const fn with_directions(mut self, count: usize) -> Query {
        self.n_directions = count as u64;
        self.given = self.given.with(Field::Directions);
        self
    }

    /// Sets axes and reference point of twists, accelerations and Jacobians of frames.
    #[must_use]
    pub const fn with_axes(mut self, axes: Axes) -> Query {
        self.axes = axes as u32;
        self
    }

    /// Sets the link that takes the root's place for frames.
    #[must_use]
    pub const fn relative_to(mut self, link: u16) -> Query {
        self.relative_to = link as u32 + 1;
        self
    }

    /// Adds these options to the query.
    #[must_use]
    pub const fn with_options(mut self, options: QueryOptions) -> Query {
        self.options = self.options.with(options);
        self
    }

    /// Sets the allowed gap of redundant rows, in radians or lengths of the cluster.
    #[must_use]
    pub const fn with_loop_tolerance(mut self, tolerance: f64) -> Query {
        self.loop_tolerance = Tolerance::new(tolerance);
        self
    }

    /// Sets the allowed distance of the given state from the answer's, in radians or lengths of the
    /// cluster.
    #[must_use]
    pub const fn with_projection_tolerance(mut self, tolerance: f64) -> Query {
        self.projection_tolerance = Tolerance::new(tolerance);
        self
    }

    /// The links whose frames are wanted.
    pub fn frames(&self) -> &[u16] {
        &self.frames[..(self.n_frames as usize).min(MAX_FRAMES)]
    }

    /// The link that takes the root's place for frames, if any.
    pub fn reference(&self) -> Option<usize> {
        (self.relative_to as usize).checked_sub(1)
    }

    /// The links that wrenches act on.
    pub fn wrench_links(&self) -> &[u16] {
        &self.wrench_links[..(self.n_wrenches as usize).min(MAX_WRENCHES)]
    }

    /// The runs of tree velocities whose rows are wanted; an empty list means all.
    pub fn joint_runs(&self) -> &[[u16; 2]] {
        &self.joints[..(self.n_joint_runs as usize).min(MAX_JOINT_RUNS)]
    }

    /// Checks everything that does not depend on numbers.
    pub fn check(&self, model: &ModelInfo) -> Result<Request, QueryError> {
        let request =
            Request::from_code(self.request).ok_or(QueryError::UnknownRequest(self.request))?;
        self.check_options()?;
        self.check_links(model)?;
        self.check_joints(model)?;
        self.check_given(request)?;
        self.check_tasks(request)?;
        self.check_want(request)?;
        self.check_second()?;
        self.check_motors(model)?;
        Ok(request)
    }

    fn check_options(&self) -> Result<(), QueryError> {
        need(self.given.is_known() && self.want.is_known(), QueryError::UnknownField)?;
        let is_known = self.options.is_known() && Axes::from_code(self.axes).is_some();
        need(is_known && self.reserved == [0; RESERVED], QueryError::UnknownOption)?;
        for tolerance in [self.loop_tolerance, self.projection_tolerance] {
            if tolerance.bound().is_nan() || tolerance.bound() < 0.0 {
                return Err(QueryError::BadTolerance);
            }
        }
        Ok(())
    }

    fn check_links(&self, model: &ModelInfo) -> Result<(), QueryError> {
        at_most(self.n_frames.into(), MAX_FRAMES, "frames")?;
        at_most(self.n_wrenches.into(), MAX_WRENCHES, "wrenches")?;
        if let Some(link) = self.reference().filter(|link| *link >= model.links.len()) {
            return Err(QueryError::UnknownLink(u16::try_from(link).unwrap_or(u16::MAX)));
        }
        let mut links = self.frames().iter().chain(self.wrench_links());
        match links.find(|link| **link as usize >= model.links.len()) {
            Some(link) => Err(QueryError::UnknownLink(*link)),
            None => Ok(()),
        }
    }

    fn check_joints(&self, model: &ModelInfo) -> Result<(), QueryError> {
        at_most(self.n_joint_runs.into(), MAX_JOINT_RUNS, "runs of joints")?;
        let mut end = None;
        for [first, behind] in self.joint_runs() {
            if first >= behind
                || end.is_some_and(|end| first <= end)
                || *behind as usize > model.sizes.n_v
            {
                return Err(QueryError::BadJoints);
            }
            end = Some(behind);
        }
        Ok(())
    }

    fn check_given(&self, request: Request) -> Result<(), QueryError> {
        use Field::*;
        let inputs = request.inputs();
        if let Some(field) = self.given.iter().find(|field| !inputs.has(*field)) {
            return Err(QueryError::NotAnInput(field));
        }
        // one space per order of motion, and one for the forces
        for group in [[Y, Q, U], [Yd, Qd, Ud], [Ydd, Qdd, Udd], [TauQ, TauY, TauU]] {
            let mut given = group.into_iter().filter(|field| self.given.has(*field));
            if let (Some(a), Some(b)) = (given.next(), given.next()) {
                return Err(QueryError::Conflict(a, b));
            }
        }
        if request == Request::InverseKinematics {
            let is_asked = self.given.has_any(&[TaskTarget, ComTarget]);
            return need(is_asked, Missing("what to reach: give tasks or com"));
        }
        let has_position = self.given.has_any(&[Y, Q, U]);
        need(has_position, Missing("where the robot is: give y, q or u"))?;
        let has_time = self.given.has(Dt);
        need(has_time || !request.has_tasks(), Missing("the time of a step: give dt"))?;
        let is_observed = request == Request::Observe;
        let has_forces = self.given.has_any(&[TauQ, TauY, TauU]);
        let needs_forces = is_observed || request == Request::ForwardDynamics;
        need(has_forces || !needs_forces, Missing(FORCES))?;
        let moves = self.given.has_any(&[Yd, Qd, Ud]);
        need(moves || !is_observed, Missing("how the robot moves: give yd, qd or ud"))?;
        let is_timed = has_time && self.given.has(Gain);
        let words = "the time step and the bandwidth: give dt and gain";
        need(is_timed || !is_observed, Missing(words))
    }

    fn check_tasks(&self, request: Request) -> Result<(), QueryError> {
        let is_reached = request.has_tasks();
        let n = if is_reached { self.n_frames as usize } else { 0 };
        let (asked, others) = self.tasks.split_at(n.min(MAX_FRAMES));
        let is_task = asked.iter().all(|parts| parts.is_task(request))
            && others.iter().all(|parts| parts.0 == 0);
        need(is_task, BadTask("a task asks for nothing, or for something unknown"))?;
        let is_held = |parts: &&TaskParts| parts.contains(TaskParts::HELD);
        at_most(asked.iter().filter(is_held).count() as u64, MAX_CONTACTS, "contacts")?;
        let is_paired = !is_reached || self.given.has(request.of_tasks()) == (n > 0);
        need(is_paired, BadTask("tasks and frames are not the same in number"))?;
        let is_of_root = request != Request::Step || self.relative_to == 0;
        need(is_of_root, BadTask("forces of contacts are in root axes"))?;
        let is_mixed = !is_reached || self.axes == Axes::Mixed as u32;
        need(is_mixed, BadTask("targets are in root axes, or in those of a link"))
    }

    fn check_want(&self, request: Request) -> Result<(), QueryError> {
        use Field::*;
        let outputs = request.outputs();
        if let Some(field) = self.want.iter().find(|field| !outputs.has(*field)) {
            return Err(QueryError::NotAnOutput(field));
        }
        let forces_given = self.given.has_any(&[TauQ, TauY, TauU]);
        let wants_forces = self.want.has_any(&[TauY, TauU, TauUnactuated])
            || self.want.has_any(&OF_ACTUATOR_FORCES);
        need(forces_given || request != Request::Map || !wants_forces, Missing(FORCES))
    }

    /// Second derivatives go along a direction of y, ẏ and τ_u.
    fn check_second(&self) -> Result<(), QueryError> {
        use Field::*;
        let of_ydd = self.want.has(D2YddV);
        if of_ydd || self.want.has(D2TauYV) {
            need(self.given.has(Direction), Missing("along what: give direction"))?;
            let is_along =
                !self.given.has_any(&[Q, U, Qd, Ud, Qdd, Udd]) && (self.given.has(TauU) || !of_ydd);
            need(is_along, Missing("y, yd, ydd, tau_u: a direction goes along them"))?;
        }
        Ok(())
    }

    fn check_motors(&self, model: &ModelInfo) -> Result<(), QueryError> {
        use Field::*;
        at_most(self.n_directions, MAX_DIRECTIONS, "directions")?;
        let has_directions = self.n_directions > 0;
        let reads_directions = self.want.has_any(&[TorqueSupport, TorqueSupportNet]);
        let is_directed = has_directions == self.given.has(Directions);
        let is_along = is_directed && (has_directions || !reads_directions);
        need(is_along, Missing("along what: give directions"))?;
        let has_gains = self.given.has(GainsU) || !self.want.has(GainsY);
        need(has_gains, Missing("the gains: give gains_u"))?;
        let mut sets = self.want.iter().filter(|field| field.has_vertex_rows());
        let n = if sets.next().is_some() { Rows::of(self, model).vy.len() } else { 0 };
        at_most(n as u64, MOST_VERTEX_COORDINATES, "coordinates of vertices; pick joints")
    }
}

/// The fault of a query that does not meet a condition.
fn need(is_met: bool, fault: QueryError) -> Result<(), QueryError> {
    if is_met { Ok(()) } else { Err(fault) }
}

fn at_most(found: u64, limit: usize, what: &'static str) -> Result<(), QueryError> {
    need(found <= limit as u64, QueryError::TooMany { what, limit })
}
