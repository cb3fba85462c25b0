//! The CAN bridge as a whole: processes, peers from PyPI, the Python package, SocketCAN of a real
//! kernel.

mod chain;
mod end_to_end;
mod frontends;
mod harness;
mod kernel;
mod peers;
mod python;
mod rules;
mod watch;
