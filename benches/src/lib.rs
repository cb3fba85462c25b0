//! Every number that is published: time beside error, of one run, on the same models and states.
//!
//! ```text
//! cargo run --release -p sarrus-benches                       # in process, up to 3 minutes
//! cargo run --release -p sarrus-benches -- --quick            # the same with fewer repetitions
//! cargo run --release -p sarrus-benches -- --only upper_body/analytic --format markdown
//! cargo run --release -p sarrus-benches -- --list             # the names of the cases
//! cargo run --release -p sarrus-benches -- --forward          # forward dynamics by each method, beside what the cost model predicts
//! cargo run --release -p sarrus-round-trip                    # both doors of a server process, beside plain shared memory
//! benches/count.sh --check                                    # instructions per call against benches/instructions.tsv
//! sarrus report                                               # error against run time, integration and extreme cases as a page
//! ```
//!
//! - In process (`cases.rs`, `states.rs`, `timing.rs`, `error.rs`, `in_process/`): nanoseconds per
//!   call of [`sarrus_dynamics::Plan::run`], in short batches that take turns through all cases, so
//!   that ratios hold on a machine that others use too; each time beside the error of the same
//!   answers against double-double.
//! - Peers (`peer/`, `benches/peers/`): other engines on the same robots and states, by programs
//!   that `benches/peers/build.sh` builds.
//! - The page (`report/`): sections, each a folder that fills a [`report::Section`].
//!
//! - Cases are named `robot/closures[/start]/asked`: `FD` goes by the method that the model
//!   chooses, `FD-recursion`, `FD-projection` and `FD-kkt` by that one; `chain/N/FD` is a row of N
//!   lambdas, whose instructions per lambda must not grow with N.
//!
//! To add a bundled robot or a way to close its loops: one line in `cases.rs`. A small robot as
//! text: `extra.rs`. A case of the regression gate: one line in `count.sh`, then `benches/count.sh
//! --update`. A section of the page: a folder, and one line in `report/mod.rs`.

mod accuracy;
pub mod cases;
mod chain;
pub mod cores;
mod count;
mod error;
mod extra;
mod extremes;
mod forward;
mod in_process;
mod integration;
pub mod peer;
pub mod printed;
pub mod progress;
pub mod report;
pub mod states;
pub mod table;
pub mod timing;

pub use self::count::run as count;
pub use self::forward::run as forward;
pub use self::in_process::{Options, run as in_process};
pub use self::integration::{four_bars, pendulum};

/// A benchmark that fails stops and says why.
pub type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;
