//! The common requests, one method each: the plan is prepared on first use, sizes are checked, and
//! a state without an answer is an error.

use sarrus_proto::{Field, FieldSet, Query, QueryOptions, Request, Warnings};

use crate::{Error, PlanId, Robot};

/// The questions, by their place in [`QUERIES`] and in [`Direct::plans`].
#[derive(Clone, Copy)]
enum Question {
    InverseDynamics,
    ForwardDynamics,
    State,
    ToActuators,
    ToIndependent,
}

const INDEPENDENT: &[Field] = &[Field::Y, Field::Yd, Field::Ydd];
const ACTUATORS: &[Field] = &[Field::U, Field::Ud, Field::Udd];
const TREE: &[Field] = &[Field::Q, Field::Qd, Field::Qdd];

const QUESTIONS: usize = 5;

/// The plans and scratch of the common requests.
#[derive(Default)]
pub(crate) struct Direct {
    options: QueryOptions,
    plans: [Option<PlanId>; QUESTIONS],
}

const QUERIES: [Query; QUESTIONS] = [
    query(Request::InverseDynamics, INDEPENDENT, &[Field::TauU]),
    query(Request::ForwardDynamics, &[Field::Y, Field::Yd, Field::TauU], &[Field::Ydd]),
    query(Request::Kinematics, INDEPENDENT, TREE),
    query(Request::Kinematics, INDEPENDENT, ACTUATORS),
    query(Request::Map, ACTUATORS, INDEPENDENT),
];

const fn query(request: Request, given: &[Field], want: &[Field]) -> Query {
    Query::new(request, FieldSet::of(given), FieldSet::of(want))
}

/// The common requests.
///
/// The first call of each allocates, because it prepares its plan; later ones never do, through a
/// lane and in process. `prepare_…` does the same ahead of time. Each writes its results and gives
/// the warnings; after an error all results are NaN.
impl Robot {
    /// Adds a checksum, times or both to every later common request, as
    /// [`crate::QueryBuilder::checksum`] and [`crate::QueryBuilder::times`] do for other queries;
    /// the default is neither. Memory that changes in transit is then [`Error::Failed`] with the
    /// status `corrupt_answer`.
    ///
    /// The next call of each request prepares its plan, and allocates, unless it had these options
    /// before; plans from `prepare_…` stay unchanged.
    ///
    /// ```no_run
    /// use sarrus_client::{QueryOptions, Robot};
    ///
    /// let mut robot = Robot::connect("elbow")?;
    /// robot.set_options(QueryOptions::CHECKSUM.with(QueryOptions::TIMES));
    /// let mut tau_u = [0.0];
    /// robot.inverse_dynamics(&[0.2], &[1.0], &[0.0], &mut tau_u)?;
    /// println!("{tau_u:?} {:?}", robot.times());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_options(&mut self, options: QueryOptions) {
        self.direct = Direct { options, ..Direct::default() };
    }

    /// Actuator forces for a motion: τ_u = G_u⁻ᵀ (M_y ÿ + C_y).
    ///
    /// `y` `[m, rad]` (n_qy), `yd` and `ydd` (n_vy), `tau_u` `[N, N m]` (n_u).
    ///
    /// ```
    /// use sarrus_client::{Options, Robot, Source};
    ///
    /// let mut robot = Robot::load(&Source::Bundled("lambda".into()), &Options::default())?;
    /// let mut tau_u = [0.0];
    /// robot.inverse_dynamics(&[0.2], &[1.0], &[0.0], &mut tau_u)?;
    /// assert!(tau_u[0].is_finite());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::WrongSize`] names the array that does not fit; [`Error::Failed`] has the reason why
    /// this state has no answer; else those of [`Robot::ask`], and for the first call of
    /// [`Robot::prepare`].
    pub fn inverse_dynamics(
        &mut self,
        y: &[f64],
        yd: &[f64],
        ydd: &[f64],
        tau_u: &mut [f64],
    ) -> Result<Warnings, Error> {
        self.ask_directly(Question::InverseDynamics, &[y, yd, ydd], &mut [tau_u])
    }

    /// Motion under actuator forces: ÿ = M_y⁻¹ (G_uᵀ τ_u − C_y).
    ///
    /// `y` `[m, rad]` (n_qy), `yd` (n_vy), `tau_u` `[N, N m]` (n_u), `ydd` (n_vy).
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn forward_dynamics(
        &mut self,
        y: &[f64],
        yd: &[f64],
        tau_u: &[f64],
        ydd: &mut [f64],
    ) -> Result<Warnings, Error> {
        self.ask_directly(Question::ForwardDynamics, &[y, yd, tau_u], &mut [ydd])
    }

    /// The whole tree's motion with all loops closed: q, q̇ = G ẏ, q̈ = G ÿ + g.
    ///
    /// `y` (n_qy), `yd` and `ydd` (n_vy); `q` (n_q), `qd` and `qdd` (n_v) `[m, rad]` and their
    /// rates.
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn state(
        &mut self,
        y: &[f64],
        yd: &[f64],
        ydd: &[f64],
        q: &mut [f64],
        qd: &mut [f64],
        qdd: &mut [f64],
    ) -> Result<Warnings, Error> {
        self.ask_directly(Question::State, &[y, yd, ydd], &mut [q, qd, qdd])
    }

    /// The actuators' motion: u, u̇ = G_u ẏ, ü = G_u ÿ + g_u.
    ///
    /// `y` (n_qy), `yd` and `ydd` (n_vy); `u`, `ud` and `udd` (n_u) `[m, rad]` and their rates.
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn to_actuators(
        &mut self,
        y: &[f64],
        yd: &[f64],
        ydd: &[f64],
        u: &mut [f64],
        ud: &mut [f64],
        udd: &mut [f64],
    ) -> Result<Warnings, Error> {
        self.ask_directly(Question::ToActuators, &[y, yd, ydd], &mut [u, ud, udd])
    }

    /// The independent motion from the encoders of the actuators: the inverse of
    /// [`Robot::to_actuators`], from the pose where all coordinates are zero.
    ///
    /// # Errors
    /// As [`Robot::inverse_dynamics`].
    pub fn to_independent(
        &mut self,
        u: &[f64],
        ud: &[f64],
        udd: &[f64],
        y: &mut [f64],
        yd: &mut [f64],
        ydd: &mut [f64],
    ) -> Result<Warnings, Error> {
        self.ask_directly(Question::ToIndependent, &[u, ud, udd], &mut [y, yd, ydd])
    }

    /// Prepares [`Robot::inverse_dynamics`], so that its first call does not allocate either.
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare_inverse_dynamics(&mut self) -> Result<PlanId, Error> {
        self.direct_plan(Question::InverseDynamics)
    }

    /// Prepares [`Robot::forward_dynamics`].
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare_forward_dynamics(&mut self) -> Result<PlanId, Error> {
        self.direct_plan(Question::ForwardDynamics)
    }

    /// Prepares [`Robot::state`].
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare_state(&mut self) -> Result<PlanId, Error> {
        self.direct_plan(Question::State)
    }

    /// Prepares [`Robot::to_actuators`].
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare_to_actuators(&mut self) -> Result<PlanId, Error> {
        self.direct_plan(Question::ToActuators)
    }

    /// Prepares [`Robot::to_independent`].
    ///
    /// # Errors
    /// As [`Robot::prepare`].
    pub fn prepare_to_independent(&mut self) -> Result<PlanId, Error> {
        self.direct_plan(Question::ToIndependent)
    }

    /// The plan of a request, prepared if it is missing or was released.
    fn direct_plan(&mut self, question: Question) -> Result<PlanId, Error> {
        if let Some(plan) = self.direct.plans[question as usize]
            && self.plans.find(plan).is_ok()
        {
            return Ok(plan);
        }
        let plan = self.prepare(&QUERIES[question as usize].with_options(self.direct.options))?;
        self.direct.plans[question as usize] = Some(plan);
        Ok(plan)
    }

    /// Asks with each field in a separate array, in packing order.
    fn ask_directly(
        &mut self,
        question: Question,
        given: &[&[f64]],
        want: &mut [&mut [f64]],
    ) -> Result<Warnings, Error> {
        let outcome = self.try_directly(question, given, want);
        if outcome.is_err() {
            want.iter_mut().for_each(|field| field.fill(f64::NAN));
        }
        outcome
    }

    fn try_directly(
        &mut self,
        question: Question,
        given: &[&[f64]],
        want: &mut [&mut [f64]],
    ) -> Result<Warnings, Error> {
        let plan = self.direct_plan(question)?;
        let (_, prepared) = self.plans.find(plan)?;
        let found_in = given.iter().map(|field| field.len());
        let found_out = want.iter().map(|field| field.len());
        let slots = prepared.given().slots().iter().zip(found_in);
        for (slot, found) in slots.chain(prepared.want().slots().iter().zip(found_out)) {
            let expected = slot.range().len();
            if found != expected {
                return Err(Error::WrongSize { field: slot.field, found, expected });
            }
        }

        // the fields one after the other, and back
        let (mut packed, mut unpacked) =
            (std::mem::take(&mut self.packed), std::mem::take(&mut self.unpacked));
        let mut n_in = 0;
        for field in given {
            packed[n_in..n_in + field.len()].copy_from_slice(field);
            n_in += field.len();
        }
        let n_out = want.iter().map(|field| field.len()).sum();
        let outcome = self.ask(plan, &packed[..n_in], &mut unpacked[..n_out]);
        let mut rest = &unpacked[..n_out];
        for field in want {
            let (numbers, after) = rest.split_at(field.len());
            field.copy_from_slice(numbers);
            rest = after;
        }
        (self.packed, self.unpacked) = (packed, unpacked);
        Ok(outcome?.ok()?)
    }
}
