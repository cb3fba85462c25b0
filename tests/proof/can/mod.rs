//! The CAN bridge as a whole: processes, peers from PyPI, the Python package, SocketCAN of a real
//! kernel.

mod chain;
mod end_to_end;
mod frontends;
mod harness;
mod kernel;
mod owners;
// the one place for patience with processes
#[path = "../../../client/can/cli/tests/program/patience.rs"]
mod patience;
mod peers;
mod python;
mod rules;
mod session;
mod watch;
