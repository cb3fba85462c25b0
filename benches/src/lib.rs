//! Times and instructions of sarrus in process, beside their errors; see `benches/README.md`.
//!
//! - In process (`cases.rs`, `errors.rs`, `in_process/`): nanoseconds per call of
//!   [`sarrus_dynamics::Plan::run`], in short batches that alternate between all cases, so that
//!   ratios hold on a shared machine; each time with the error of the same answers against
//!   double-double.
//! - Forward dynamics by each method beside the predictions of the cost model (`forward.rs`).
//! - Requests in task space (`tasks.rs`).
//! - Cost against size, with exponents (`scaling.rs`).
//! - Parts of questions as fractions of the whole (`partial.rs`).
//! - Digits against processor time of a published motion (`published.rs`).
//! - Many states at once, compared with one by one (`batches.rs`).
//! - Instructions of one case (`count.rs`, `benches/count.sh`), among them those of the bridge
//!   between commands and motors (`bridge.rs`).
//!
//! Robots, states, references and the clock are those of [`sarrus_report`].
//!
//! Cases are named `robot/closures[/start]/question`: `FD` uses the model's choice of method,
//! `FD-recursion`, `FD-projection` and `FD-kkt` the named one; `chain/N/FD` is a row of N lambdas,
//! whose instructions per lambda must not grow with N; `gravity`, the robot at rest, is counted and
//! not timed.
//!
//! To add a way to close the loops of a bundled robot: one line in
//! `server/report/src/robots/catalogue.rs`. A small robot: `server/report/src/robots/rare.rs`. A
//! case of the regression gate: one line in `count.sh`, then `benches/count.sh --update`.

mod batches;
mod bridge;
mod cases;
pub mod cores;
mod count;
mod errors;
mod forward;
mod in_process;
mod partial;
pub mod printed;
mod published;
mod scaling;
pub mod table;
mod tasks;

pub use self::batches::run as batches;
pub use self::count::run as count;
pub use self::forward::run as forward;
pub use self::in_process::{Options, run as in_process};
pub use self::partial::{PartialOptions, run as partial};
pub use self::published::run as published;
pub use self::scaling::{ScalingOptions, run as scaling};
pub use self::tasks::run as tasks;
