//! Plans of a robot: input and output layouts, and ownership.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use sarrus_proto::{Layout, ModelInfo, Query};

use crate::Error;

/// A prepared plan of one [`crate::Robot`].
///
/// It belongs to the robot that prepared it: any other robot, even one of the same model, returns
/// [`Error::UnknownPlan`]. It outlives restarts of the robot's server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlanId {
    index: usize,
    /// Unique in this process, also among robots.
    number: u64,
    robot: u64,
}

/// A prepared plan: its query and the layouts of input and output.
#[derive(Clone, Debug)]
pub struct Prepared {
    query: Query,
    given: Layout,
    want: Layout,
    number: u64,
    /// Number of times that it was prepared and not released.
    holders: usize,
}

impl Prepared {
    /// The query of the plan.
    pub fn query(&self) -> &Query {
        &self.query
    }

    /// Where the fields lie in the input.
    pub fn given(&self) -> &Layout {
        &self.given
    }

    /// Where the fields lie in the output.
    pub fn want(&self) -> &Layout {
        &self.want
    }
}

/// The plans of one robot; the slot of a released plan is reused.
pub(crate) struct Plans {
    robot: u64,
    places: Vec<Option<Prepared>>,
}

/// Numbers of robots and plans in this process.
fn next_number() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Relaxed)
}

impl Plans {
    pub(crate) fn new() -> Plans {
        Plans { robot: next_number(), places: Vec::new() }
    }

    /// A plan by its slot; never allocates.
    #[inline]
    pub(crate) fn find(&self, plan: PlanId) -> Result<(usize, &Prepared), Error> {
        match self.places.get(plan.index) {
            Some(Some(prepared)) if prepared.number == plan.number => Ok((plan.index, prepared)),
            _ if plan.robot != self.robot => Err(Error::UnknownPlan),
            _ => Err(Error::ReleasedPlan),
        }
    }

    /// The existing plan of a query, held once more.
    pub(crate) fn share(&mut self, query: &Query) -> Option<PlanId> {
        let robot = self.robot;
        let mut places = self.places.iter_mut().enumerate();
        places.find_map(|(index, place)| {
            let prepared = place.as_mut().filter(|prepared| prepared.query == *query)?;
            prepared.holders += 1;
            Some(PlanId { index, number: prepared.number, robot })
        })
    }

    /// A plan for a checked query, in the first free slot.
    pub(crate) fn add(&mut self, query: &Query, model: &ModelInfo) -> (PlanId, usize, usize) {
        let given = Layout::of_given(query, &model.sizes);
        let want = Layout::of_want(query, model);
        let n_in = given.len();
        let n_out = want.len();
        let number = next_number();
        let prepared = Some(Prepared { query: *query, given, want, number, holders: 1 });
        let index = self.places.iter().position(Option::is_none).unwrap_or(self.places.len());
        self.places.resize_with(self.places.len().max(index + 1), || None);
        self.places[index] = prepared;
        (PlanId { index, number, robot: self.robot }, n_in, n_out)
    }

    /// Releases one hold of a plan; its slot if that was the last one.
    pub(crate) fn release(&mut self, plan: PlanId) -> Result<Option<usize>, Error> {
        let (index, _) = self.find(plan)?;
        let Some(prepared) = &mut self.places[index] else { return Ok(None) };
        prepared.holders -= 1;
        if prepared.holders > 0 {
            return Ok(None);
        }
        self.places[index] = None;
        Ok(Some(index))
    }

    /// The plan in a slot.
    pub(crate) fn at(&self, place: usize) -> Option<&Prepared> {
        self.places.get(place)?.as_ref()
    }

    /// All plans, by their slots.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (usize, &Prepared)> {
        let places = self.places.iter().enumerate();
        places.filter_map(|(index, place)| Some((index, place.as_ref()?)))
    }

    /// Most numbers in and out.
    pub(crate) fn needs(&self) -> [usize; 2] {
        let most = |n: fn(&Prepared) -> usize| self.iter().map(|plan| n(plan.1)).max().unwrap_or(0);
        [most(|prepared| prepared.given.len()), most(|prepared| prepared.want.len())]
    }
}
