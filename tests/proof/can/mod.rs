//! The CAN bridge as a whole: processes, peers from PyPI, the Python package, SocketCAN of a real
//! kernel.

mod chain;
mod end_to_end;
mod frontends;
mod harness;
mod kernel;
mod owners;
// the one place for the time that processes may take
#[path = "../../../client/can/cli/tests/program/allowance.rs"]
mod allowance;
mod peers;
mod python;
mod rules;
mod session;
mod watch;
