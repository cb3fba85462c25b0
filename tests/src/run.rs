//! One request in process, with fields by name.

use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Answer, Model, Plan, PlanScalar, Workspace};
use sarrus_proto::{Field, FieldSet, Query, Request, Status};

/// A model with the workspace that it needs to answer.
pub struct Robot<T: PlanScalar> {
    /// The model.
    pub model: Model<T>,
    workspace: Workspace<T>,
}

/// An answer by field.
pub struct Fields<T> {
    /// Status and warnings.
    pub answer: Answer,
    plan: Plan,
    numbers: Vec<T>,
}

impl<T: PlanScalar> Robot<T> {
    /// A model and its workspace.
    pub fn new(model: Model<T>) -> Robot<T> {
        Robot { workspace: Workspace::new(&model), model }
    }

    /// Asks for the wanted fields at the given ones.
    pub fn ask(&mut self, request: Request, given: &[(Field, &[T])], want: &[Field]) -> Fields<T> {
        self.ask_for(Query::new(request, FieldSet::EMPTY, FieldSet::of(want)), given)
    }

    /// [`Self::ask`] from a base query with frames or wrenches.
    pub fn ask_for(&mut self, base: Query, given: &[(Field, &[T])]) -> Fields<T> {
        let mut query = base;
        for (field, _) in given {
            query.given = query.given.with(*field);
        }
        let plan = Plan::new(&self.model, &query).unwrap_or_else(|error| panic!("{error}"));
        let mut input = vec![T::ZERO; plan.given().len()];
        for (field, numbers) in given {
            let slot =
                plan.given().slot(*field).unwrap_or_else(|| panic!("{field:?} is not packed"));
            input[slot.range()].copy_from_slice(numbers);
        }
        let mut numbers = vec![T::ZERO; plan.want().len()];
        let answer = plan.run(&self.model, &mut self.workspace, &input, &mut numbers);
        Fields { answer, plan, numbers }
    }
}

impl<T: Real> Fields<T> {
    /// The numbers of a field.
    pub fn get(&self, field: Field) -> &[T] {
        let slot =
            self.plan.want().slot(field).unwrap_or_else(|| panic!("{field:?} was not wanted"));
        &self.numbers[slot.range()]
    }

    /// Converts the numbers to another scalar.
    pub fn map<D>(self, f: impl Fn(T) -> D) -> Fields<D> {
        Fields {
            answer: self.answer,
            plan: self.plan,
            numbers: self.numbers.into_iter().map(f).collect(),
        }
    }

    /// Returns the answer, or panics if its status is not ok.
    pub fn ok(self) -> Fields<T> {
        assert!(self.answer.status == Status::Ok, "{} instead of ok", self.answer.status);
        self
    }
}
