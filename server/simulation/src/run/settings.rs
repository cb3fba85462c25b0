//! By which method, how long, how exactly.

use crate::error::{Outcome, SimulationError};
use crate::methods::Stepper;
use crate::methods::dop853::Dop853;
use crate::methods::fixed_step::FixedStep;
use crate::methods::radau5::Radau;
use crate::methods::runge_kutta::RungeKutta;
use crate::methods::semi_implicit_euler::SemiImplicitEuler;

/// Steps of a fixed length that one simulation may have.
const MOST: f64 = 1e9;
/// Baumgarte's rates by steps, where none are given.
const RATE: f64 = 0.1;

sarrus_dynamics::named_enum! {
    /// A method of integration.
    pub enum Method {
        /// Semi-implicit Euler with a fixed step: order 1.
        Euler = "euler",
        /// The classical method of Runge and Kutta with a fixed step: order 4.
        RungeKutta = "rk4",
        /// Dormand and Prince's explicit method of order 8 with its own step.
        Dop853 = "dop853",
        /// Radau's implicit method of order 5 with its own step, for stiff problems.
        Radau5 = "radau5",
        /// For comparison: Runge and Kutta's method in all tree coordinates, with Baumgarte's
        /// stabilisation of the loops.
        Baumgarte = "baumgarte",
        /// For comparison: the same without stabilisation, projected onto the closed states after
        /// each step.
        Projection = "projection",
    }
}

impl Method {
    /// True where all tree coordinates are integrated, and loops are constraints.
    pub const fn is_implicit_form(self) -> bool {
        matches!(self, Method::Baumgarte | Method::Projection)
    }

    /// True where the step is given and not found.
    pub const fn is_fixed(self) -> bool {
        !matches!(self, Method::Dop853 | Method::Radau5)
    }
}

/// How to simulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// By which method.
    pub method: Method,
    /// How long `[s]`.
    pub duration: f64,
    /// The step of a method of fixed step; the first one of the others `[s]`.
    pub step: Option<f64>,
    /// Relative tolerance of the methods with their own step.
    pub rtol: f64,
    /// Absolute tolerance of these `[m, rad, m/s, rad/s]`.
    pub atol: f64,
    /// Baumgarte's rates α = β `[1/s]`; without it a tenth of the inverse step.
    pub stabilisation: Option<f64>,
    /// Time between samples, without which every step is one `[s]`. DOP853 interpolates them, the
    /// steps of the other methods meet them.
    pub every: Option<f64>,
    /// Goes on with other independents near a singularity of those in use.
    pub switching: bool,
    /// Computes in double-double near singular closures and where the robot is ill-conditioned,
    /// which costs some thirty times as much there.
    pub precise: bool,
    /// Counts the friction of joints.
    pub friction: bool,
    /// Keeps the forces of actuators within their limits.
    pub limited: bool,
    /// Stiffness of one-sided stops at the limits of joints; none without it `[N m/rad, N/m]`.
    pub stops: Option<f64>,
    /// Estimates the error by a second simulation with other steps.
    pub estimate: bool,
    /// The most steps and rejected steps.
    pub most_steps: u64,
}

impl Settings {
    /// Tolerances of 1e-8, every step a sample, switching, double-double where it is needed, no
    /// estimate.
    pub fn new(method: Method, duration: f64) -> Settings {
        Settings {
            method,
            duration,
            step: None,
            rtol: 1e-8,
            atol: 1e-8,
            stabilisation: None,
            every: None,
            switching: true,
            precise: true,
            friction: false,
            limited: false,
            stops: None,
            estimate: false,
            most_steps: MOST as u64,
        }
    }

    /// Numbers that can be used.
    pub(crate) fn check(&self) -> Outcome {
        let check = SimulationError::check_setting;
        check("the duration", self.duration, self.duration > 0.0, "a positive number of seconds")?;
        let has_effects = self.friction || self.limited || self.stops.is_some();
        let what = "friction, limits or stops in a method for comparison";
        let fits = !self.method.is_implicit_form() || !has_effects;
        check(what, 1.0, fits, "another method")?;
        if let Some(stops) = self.stops {
            let is_stiff = stops > 0.0 && stops.is_finite();
            check("the stiffness of stops", stops, is_stiff, "a positive number")?;
        }
        if let Some(step) = self.step {
            check(
                "the step",
                step,
                step > 0.0 && self.duration / step < MOST,
                "a positive number of seconds, a thousand-millionth of the duration or more",
            )?;
        } else {
            let expected = "a step; this method does not find its own";
            check("the step", 0.0, !self.method.is_fixed(), expected)?;
        }
        if let Some(rate) = self.stabilisation {
            check("the rate of stabilisation", rate, rate >= 0.0, "a number that is not negative")?;
        }
        if let Some(every) = self.every {
            check(
                "the time between samples",
                every,
                every > 0.0 && self.duration / every < MOST,
                "a positive number of seconds",
            )?;
        }
        if !self.method.is_fixed() {
            check(
                "the relative tolerance",
                self.rtol,
                self.rtol >= 1e-14 && self.rtol < 1.0,
                "a number from 1e-14 to 1",
            )?;
            check("the absolute tolerance", self.atol, self.atol > 0.0, "a positive number")?;
        }
        Ok(())
    }

    /// The method at its start.
    pub(crate) fn stepper(&self) -> Box<dyn Stepper> {
        let step = self.step.unwrap_or(self.duration);
        match self.method {
            Method::Euler => Box::new(FixedStep::<SemiImplicitEuler>::new(step)),
            Method::RungeKutta | Method::Baumgarte | Method::Projection => {
                Box::new(FixedStep::<RungeKutta>::new(step))
            }
            Method::Dop853 => Box::new(Dop853::new(self.rtol, self.atol, self.duration, self.step)),
            Method::Radau5 => Box::new(Radau::new(self.rtol, self.atol, self.step)),
        }
    }

    /// When the next sample is due after so many; a crumb at the end is no interval of its own.
    pub(crate) fn sample_after(&self, sampled: u64) -> f64 {
        let end = self.duration;
        let next = self.every.map_or(end, |every| (sampled as f64 + 1.0) * every);
        if next > end - 1e-9 * end { end } else { next }
    }

    /// α = β of Baumgarte's stabilisation; projection needs none.
    pub(crate) fn rate(&self) -> f64 {
        match (self.method, self.step) {
            (Method::Baumgarte, step) => {
                self.stabilisation.unwrap_or(RATE / step.unwrap_or(f64::INFINITY))
            }
            _ => 0.0,
        }
    }

    /// These settings with finer steps, and the factor by which the difference of both runs
    /// estimates the error of the coarser.
    pub(crate) fn finer(&self) -> (Settings, f64) {
        let once = Settings { estimate: false, ..*self };
        let half = self.step.map(|step| 0.5 * step);
        match self.method {
            Method::Euler => (Settings { step: half, ..once }, 2.0),
            Method::RungeKutta | Method::Baumgarte | Method::Projection => {
                (Settings { step: half, ..once }, 16.0 / 15.0)
            }
            // with a first step that leads to other steps
            _ => {
                let step = self.step.unwrap_or(self.duration / 37.0).min(self.duration / 37.0);
                let rtol = (0.01 * self.rtol).max(1e-14);
                let atol = 0.01 * self.atol;
                (Settings { rtol, atol, step: Some(step), ..once }, 1.0)
            }
        }
    }
}

/// Times that end a step: kinks of forces and samples; of the finer of two runs also the middle
/// between two of these, so that no step of it is as long as the coarser run's.
pub(super) struct Stops {
    halved: bool,
    from: f64,
    to: f64,
}

impl Stops {
    pub(super) fn new(halved: bool) -> Stops {
        Stops { halved, from: 0.0, to: 0.0 }
    }

    /// The next one after t, where the next kink or sample is at `to`.
    pub(super) fn after(&mut self, t: f64, to: f64) -> f64 {
        if to != self.to {
            (self.from, self.to) = (t, to);
        }
        let middle = 0.5 * (self.from + to);
        if self.halved && t < middle { middle } else { to }
    }
}
