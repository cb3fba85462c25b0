//! Integrates the motion of a robot in time.
//!
//! A [`Setup`] is a compiled robot with the springs between its links and the inputs on its joints.
//! [`simulate`] integrates it from a [`Start`] over a span of time by one of several methods and
//! returns a [`Run`]: samples, events, counts and the reason of its end. The independent
//! coordinates are integrated; loops are closed exactly at every evaluation. The crate uses no
//! file, clock or thread.
//!
//! Each module depends only on those before it: `coordinates`; `forces`; `motion`,
//! the right-hand side; `methods`, one a file; `run`. By itself beside them stands `timing`: the
//! fastest motion along a path ([`time_path`]).
//!
//! ```
//! use sarrus_dynamics::description::{Inertial, JointKind};
//! use sarrus_dynamics::{DescriptionBuilder, LinkId, Model};
//! use sarrus_simulation::{Method, Settings, Setup, Start, simulate};
//!
//! // a pendulum: 1 kg, 1 m below a horizontal axis
//! let mut robot = DescriptionBuilder::new("pendulum");
//! let bob = Inertial::point(1.0, [0.0, 0.0, -1.0]);
//! robot.joint("pivot", JointKind::Continuous, LinkId::BASE).axis([0.0, 1.0, 0.0]).inertial(bob);
//! let description = robot.build()?;
//! let compiled = Model::compile(&description)?;
//! let setup = Setup { description: &description, compiled: &compiled, springs: &[], inputs: &[] };
//! let start = Start::Independent { y: vec![0.1], yd: vec![0.0], guess: None };
//! let settings = Settings { step: Some(1e-3), ..Settings::new(Method::RungeKutta, 1.0) };
//! let run = simulate(&setup, &start, &settings, &mut |_| ())?;
//! assert!(run.end.is_finished() && run.drift() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
// the symbols of the equations
#![allow(non_snake_case)]

mod coordinates;
mod error;
mod forces;
mod methods;
mod motion;
mod run;
mod timing;

pub use error::SimulationError;
pub use forces::inputs::{Input, Source, Space};
pub use forces::springs::{Point, Spring};
pub use motion::energy::Energy;
pub use motion::engine::Counts;
pub use run::events::{Event, EventKind};
pub use run::limits::Exceeded;
pub use run::output::{End, Run, Sample};
pub use run::settings::{Method, Settings};
pub use run::setup::Setup;
pub use run::simulate;
pub use run::start::Start;
pub use timing::{ALLOWED, Stop, Timed, time_path};
