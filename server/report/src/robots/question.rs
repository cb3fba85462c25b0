//! The questions to a robot, and the starts of Newton's method.

use sarrus_dynamics::{Field, FieldSet, Method, Model, Plan, Query, QueryError, Request};

/// The start of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// No iteration.
    None,
    /// From the closed pose 1 ms earlier at the state's velocity.
    Warm,
    /// Without a guess.
    Cold,
}

/// A question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// q, q̇, q̈, u, u̇, ü from y, ẏ, ÿ.
    State,
    /// τ_u from y, ẏ, ÿ.
    InverseDynamics,
    /// τ_u of the robot at rest, from y.
    Gravity,
    /// ÿ from y, ẏ, τ_u, by the method that the model chooses.
    ForwardDynamics,
    /// Forward dynamics by this method.
    Forced(Method),
    /// Inverse dynamics with ∂τ_u/∂y and ∂τ_u/∂ẏ.
    InverseDerivatives,
    /// Forward dynamics with ∂ÿ/∂y, ∂ÿ/∂ẏ and ∂ÿ/∂τ_u.
    ForwardDerivatives,
    /// y from targets of links, which `Query::with_tasks` adds.
    InverseKinematics,
}

/// Links with the number of bodies that carry them, the fewest first, and the query of the pose of
/// each from y.
///
/// # Errors
///
/// As [`Plan::new`].
pub(crate) fn links_by_bodies(model: &Model) -> Result<Vec<(usize, usize, Query)>, QueryError> {
    let mut links = Vec::new();
    for link in 0..model.link_names().len().min(u16::MAX as usize) {
        let query = Query::new(Request::Kinematics, Field::Y.into(), Field::FramePose.into());
        let query = query.with_frames(&[link as u16]);
        let bodies = Plan::new(model, &query)?.outline(model).bodies;
        if bodies > 0 {
            links.push((bodies, link, query));
        }
    }
    links.sort_by_key(|(bodies, link, _)| (*bodies, *link));
    Ok(links)
}

impl Question {
    /// With the method that the model chooses.
    pub const CHOSEN: [Question; 3] =
        [Question::State, Question::InverseDynamics, Question::ForwardDynamics];

    /// The questions with derivatives.
    pub const DERIVATIVES: [Question; 2] =
        [Question::InverseDerivatives, Question::ForwardDerivatives];

    /// Its name in tables and in the names of cases.
    pub const fn name(self) -> &'static str {
        match self {
            Question::State => "state",
            Question::InverseDynamics => "ID",
            Question::Gravity => "gravity",
            Question::ForwardDynamics => "FD",
            Question::Forced(Method::Recursion) => "FD-recursion",
            Question::Forced(Method::Projection) => "FD-projection",
            Question::Forced(Method::Kkt) => "FD-kkt",
            Question::InverseDerivatives => "dID",
            Question::ForwardDerivatives => "dFD",
            Question::InverseKinematics => "IK",
        }
    }

    /// True for forward dynamics by any method.
    pub fn is_forward(self) -> bool {
        matches!(self, Question::ForwardDynamics | Question::Forced(_))
    }

    /// The given and the wanted fields, as a query.
    pub fn query(self) -> Query {
        use Field::*;
        let (request, given, want): (_, &[Field], &[Field]) = match self {
            Question::State => (Request::Kinematics, &[Y, Yd, Ydd], &[Q, Qd, Qdd, U, Ud, Udd]),
            Question::InverseDynamics => (Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU]),
            Question::Gravity => (Request::InverseDynamics, &[Y], &[TauU]),
            Question::ForwardDynamics | Question::Forced(_) => {
                (Request::ForwardDynamics, &[Y, Yd, TauU], &[Ydd])
            }
            Question::InverseDerivatives => {
                (Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU, DtauUDy, DtauUDyd])
            }
            Question::ForwardDerivatives => {
                (Request::ForwardDynamics, &[Y, Yd, TauU], &[Ydd, DyddDy, DyddDyd, DyddDtauU])
            }
            Question::InverseKinematics => (Request::InverseKinematics, &[YGuess], &[Y]),
        };
        Query::new(request, FieldSet::of(given), FieldSet::of(want))
    }
}
