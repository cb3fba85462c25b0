//! A query by names, which reports every unknown name.

use std::fmt;

use sarrus_models::{matching_joints, nearest};
use sarrus_proto::{Axes, QueryOptions, Request, TaskParts};
use sarrus_proto::{Field, FieldSet, MAX_FRAMES, MAX_WRENCHES, Query, QueryError};

use crate::{Error, PlanId, Robot};

/// An unknown name in a query.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct UnknownName {
    /// The name.
    pub name: String,
    /// The expected kind: `field`, `link of this robot` or `joint of this robot`.
    pub what: &'static str,
    /// The known name that it most likely means.
    pub nearest: Option<String>,
    /// The place where the known names are listed.
    pub help: String,
}

/// [`UnknownName::what`] of joints.
const JOINT: &str = "joint of this robot";

impl UnknownName {
    /// An unknown name; the help shows the first known ones.
    fn new(name: &str, what: &'static str, known: Vec<&str>) -> UnknownName {
        const SHOWN: usize = 6;
        let rest = if known.len() > SHOWN { ", …" } else { "" };
        let first = known[..known.len().min(SHOWN)].join(", ");
        UnknownName {
            name: name.to_owned(),
            what,
            help: format!("it has {}: {first}{rest}", known.len()),
            nearest: nearest(name, known).map(str::to_owned),
        }
    }
}

impl fmt::Display for UnknownName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let UnknownName { name, what, nearest, help } = self;
        match nearest {
            Some(nearest) => write!(f, "`{name}` is no {what}; did you mean `{nearest}`?"),
            None => write!(f, "`{name}` is no {what}; {help}"),
        }
    }
}

/// Builds a query by the names that scripts use or by [`Field`].
///
/// Nothing fails before [`QueryBuilder::prepare`], which reports all unknown names together.
#[must_use = "a query is made to be prepared"]
pub struct QueryBuilder<'a> {
    robot: &'a mut Robot,
    query: Query,
    unknown: Vec<UnknownName>,
    too_many: Option<QueryError>,
}

impl<'a> QueryBuilder<'a> {
    pub(crate) fn new(robot: &'a mut Robot, request: Request) -> QueryBuilder<'a> {
        let query = Query::new(request, FieldSet::EMPTY, request.default_want());
        QueryBuilder { robot, query, unknown: Vec::new(), too_many: None }
    }

    /// The fields that each request gives, such as `y`; called again, more of them.
    pub fn given<F: AsRef<str>>(mut self, fields: impl IntoIterator<Item = F>) -> Self {
        let fields = self.fields(fields);
        self.query.given |= fields;
        self
    }

    /// The fields that each answer holds, such as `tau_u`; without it, the request's usual ones.
    pub fn want<F: AsRef<str>>(mut self, fields: impl IntoIterator<Item = F>) -> Self {
        self.query.want = self.fields(fields);
        self
    }

    /// The links whose frames are wanted; [`QueryBuilder::want`] selects the fields of frames.
    pub fn frames<L: AsRef<str>>(mut self, links: impl IntoIterator<Item = L>) -> Self {
        let links = self.links(links, "frames", MAX_FRAMES);
        self.query = self.query.with_frames(&links);
        self
    }

    /// The number of directions whose supports are wanted, at most 64; adds `directions` to the
    /// given fields.
    pub fn directions(mut self, count: usize) -> Self {
        self.query = self.query.with_directions(count);
        self
    }

    /// The tasks of [`Request::InverseKinematics`]: links, each with the parts of its frame that
    /// have a target (position, orientation, z axis); adds `task_target` to the given fields. Of
    /// other requests with tasks: parts that have a wanted motion, `task_motion`. The tasks are the
    /// frames of the query.
    pub fn tasks<L: AsRef<str>>(mut self, tasks: impl IntoIterator<Item = (L, TaskParts)>) -> Self {
        let (names, parts): (Vec<L>, Vec<TaskParts>) = tasks.into_iter().unzip();
        let links = self.links(names, "frames", MAX_FRAMES);
        let tasks: Vec<(u16, TaskParts)> = links.into_iter().zip(parts).collect();
        self.query = self.query.with_tasks(&tasks);
        self
    }

    /// Axes and reference point of twists, accelerations and Jacobians of frames; root axes at the
    /// frame's origin by default.
    pub fn axes(mut self, axes: Axes) -> Self {
        self.query = self.query.with_axes(axes);
        self
    }

    /// The link that takes the root's place for frames: poses are in its frame, motions are those
    /// that it sees, and Jacobians theirs.
    pub fn relative_to(mut self, link: impl AsRef<str>) -> Self {
        let found = self.links([link], "links of reference", 1);
        self.query = found.first().map_or(self.query, |link| self.query.relative_to(*link));
        self
    }

    /// The joints whose rows are wanted, by names with `*`, `?` and `[…]` as in shells (`AL*`):
    /// coordinates, forces and rows of matrices, in the order of the model. Only quantities on
    /// which these rows depend are computed; a closure that no row needs cannot fail the request.
    /// Without it, all joints.
    pub fn joints<J: AsRef<str>>(mut self, patterns: impl IntoIterator<Item = J>) -> Self {
        let info = self.robot.model();
        let mut velocities = Vec::new();
        for pattern in patterns {
            let pattern = pattern.as_ref();
            let matching = matching_joints(info, pattern);
            if matching.is_empty() {
                let known = info.joints().map(|joint| joint.name).collect();
                self.unknown.push(UnknownName::new(pattern, JOINT, known));
            }
            velocities.extend(matching);
        }
        // an empty list would mean all
        if velocities.is_empty() && self.unknown.is_empty() {
            self.unknown.push(UnknownName {
                name: String::new(),
                what: JOINT,
                nearest: None,
                help: "name one, or leave `joints` out".to_owned(),
            });
        }
        velocities.sort_unstable();
        velocities.dedup();
        self.query = self.query.with_joints(velocities);
        self
    }

    /// The links that wrenches act on; adds `wrenches` to the given fields.
    pub fn wrenches<L: AsRef<str>>(mut self, links: impl IntoIterator<Item = L>) -> Self {
        let links = self.links(links, "wrenches", MAX_WRENCHES);
        self.query = self.query.with_wrenches(&links);
        self
    }

    /// Adds these options, of which the next four methods add one each.
    pub fn options(mut self, options: QueryOptions) -> Self {
        self.query = self.query.with_options(options);
        self
    }

    /// Adds a checksum to every request and answer: if memory changes in transit, the answer has
    /// the status `corrupt_answer` and NaN for numbers. Costs some tens of nanoseconds; has no
    /// effect in process.
    pub fn checksum(mut self) -> Self {
        self.query = self.query.with_options(QueryOptions::CHECKSUM);
        self
    }

    /// Adds the request's age and the time taken to every answer; see [`Robot::times`].
    pub fn times(mut self) -> Self {
        self.query = self.query.with_options(QueryOptions::TIMES);
        self
    }

    /// Lets closures be continued, and `nearest_y` be sought, as long as it takes: without it the
    /// work of a request is bounded, and a state that needs more is `not_converged`.
    pub fn search(mut self) -> Self {
        self.query = self.query.with_options(QueryOptions::SEARCH);
        self
    }

    /// Forces count the friction of joints, as the model has it.
    pub fn friction(mut self) -> Self {
        self.query = self.query.with_options(QueryOptions::FRICTION);
        self
    }

    /// The largest gap of redundant rows, in radians or lengths of the cluster, without the warning
    /// `loop_open`; 1e-6 by default.
    pub fn loop_tolerance(mut self, tolerance: f64) -> Self {
        self.query = self.query.with_loop_tolerance(tolerance);
        self
    }

    /// The largest distance of an answer from the given q or q̇, in radians or lengths of the
    /// cluster, without the warning `input_projected`; 1e-6 by default.
    pub fn projection_tolerance(mut self, tolerance: f64) -> Self {
        self.query = self.query.with_projection_tolerance(tolerance);
        self
    }

    /// The query so far, without unknown names.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Prepares a plan for the query.
    ///
    /// # Errors
    /// [`Error::UnknownNames`] with every unknown name; else as [`Robot::prepare`].
    pub fn prepare(self) -> Result<PlanId, Error> {
        if !self.unknown.is_empty() {
            return Err(Error::UnknownNames(self.unknown));
        }
        if let Some(error) = self.too_many {
            return Err(Error::Query(error));
        }
        self.robot.prepare(&self.query)
    }

    fn fields<F: AsRef<str>>(&mut self, fields: impl IntoIterator<Item = F>) -> FieldSet {
        let mut set = FieldSet::EMPTY;
        for field in fields {
            let name = field.as_ref();
            match Field::from_name(name) {
                Some(field) => set |= field,
                None => self.unknown.push(UnknownName {
                    nearest: nearest(name, Field::ALL.iter().map(|field| field.name()))
                        .map(str::to_owned),
                    name: name.to_owned(),
                    what: "field",
                    help: format!("fields are {}", FieldSet::of(Field::ALL)),
                }),
            }
        }
        set
    }

    fn links<L: AsRef<str>>(
        &mut self,
        links: impl IntoIterator<Item = L>,
        what: &'static str,
        limit: usize,
    ) -> Vec<u16> {
        let info = self.robot.model();
        let mut found = Vec::new();
        for link in links {
            let name = link.as_ref();
            match info.link(name) {
                Some(link) => found.push(link),
                None => {
                    let known = info.links.iter().map(String::as_str).collect();
                    self.unknown.push(UnknownName::new(name, "link of this robot", known));
                }
            }
        }
        if found.len() > limit {
            self.too_many.get_or_insert(QueryError::TooMany { what, limit });
        }
        found
    }
}
