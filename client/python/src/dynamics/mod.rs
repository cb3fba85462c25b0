//! Dynamics for Python: the robot of `sarrus-client`, asked with numpy's arrays.
//!
//! `arrays` reads and makes numpy's arrays, `shared` is a robot that Python's threads share,
//! `signals` how its waits end by Ctrl-C, `asked` a plan of it, `batch` answers rows of states;
//! `origin`, `robot` and `query` are the Python classes, `options` the words of a call,
//! `simulation` is the robot in time.

mod arrays;
mod asked;
mod batch;
mod errors;
mod options;
mod origin;
mod query;
mod robot;
mod shared;
mod signals;
mod simulation;

pub(crate) use arrays::refuse_masked;
pub(crate) use batch::forked;
pub(crate) use errors::load_error;
pub(crate) use origin::{PyOrigin, bundled_names, imported};
pub(crate) use query::PyQuery;
pub(crate) use robot::PyRobot;
pub(crate) use shared::{status_help, statuses, warning_bits};
