use sarrus_proto::{Field, FieldSet, MAX_FRAMES, MAX_WRENCHES, Query, QueryError, Request};

use crate::{Error, PlanId, Robot};

/// A query in the making, by the names that scripts see.
pub struct QueryBuilder<'a> {
    robot: &'a mut Robot,
    query: Query,
}

impl<'a> QueryBuilder<'a> {
    pub(crate) fn new(robot: &'a mut Robot, request: Request) -> QueryBuilder<'a> {
        QueryBuilder { robot, query: Query::new(request, FieldSet::EMPTY, request.default_want()) }
    }

    /// The fields that each request gives, such as `y`.
    ///
    /// # Errors
    /// [`Error::UnknownName`].
    pub fn given(mut self, names: &[&str]) -> Result<QueryBuilder<'a>, Error> {
        self.query.given = FieldSet(self.query.given.0 | fields(names)?.0);
        Ok(self)
    }

    /// The fields that each answer holds, such as `tau_u`; without it, the request's usual ones.
    ///
    /// # Errors
    /// [`Error::UnknownName`].
    pub fn want(mut self, names: &[&str]) -> Result<QueryBuilder<'a>, Error> {
        self.query.want = fields(names)?;
        Ok(self)
    }

    /// The links whose frames are asked; which fields of frames is said in [`QueryBuilder::want`].
    ///
    /// # Errors
    /// [`Error::UnknownName`], [`Error::Query`] when there are too many.
    pub fn frames(mut self, links: &[&str]) -> Result<QueryBuilder<'a>, Error> {
        self.query = self.query.with_frames(&self.links(links, "frames", MAX_FRAMES)?);
        Ok(self)
    }

    /// The links that wrenches act on; adds `wrenches` to what is given.
    ///
    /// # Errors
    /// As [`QueryBuilder::frames`].
    pub fn wrenches(mut self, links: &[&str]) -> Result<QueryBuilder<'a>, Error> {
        self.query = self.query.with_wrenches(&self.links(links, "wrenches", MAX_WRENCHES)?);
        Ok(self)
    }

    /// The set as it stands.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Prepares a plan for the set.
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare(self) -> Result<PlanId, Error> {
        self.robot.prepare(&self.query)
    }

    fn links(&self, names: &[&str], what: &'static str, limit: usize) -> Result<Vec<u16>, Error> {
        if names.len() > limit {
            return Err(Error::Query(QueryError::TooMany { what, limit }));
        }
        let info = self.robot.model();
        let unknown = |name: &str| Error::UnknownName {
            what: "link of this robot",
            name: name.to_owned(),
            help: format!("its {} links are named in `ModelInfo::links`", info.links.len()),
        };
        names.iter().map(|name| info.link(name).ok_or_else(|| unknown(name))).collect()
    }
}

fn fields(names: &[&str]) -> Result<FieldSet, Error> {
    let unknown = |name: &str| {
        let known: Vec<&str> = Field::ALL.iter().map(|field| field.name()).collect();
        Error::UnknownName {
            what: "field",
            name: name.to_owned(),
            help: format!("fields are {}", known.join(", ")),
        }
    };
    names.iter().try_fold(FieldSet::EMPTY, |set, name| {
        Ok(set.with(Field::from_name(name).ok_or_else(|| unknown(name))?))
    })
}
