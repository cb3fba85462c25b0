//! The CAN bridge as a whole: processes, peers from PyPI, the Python package, SocketCAN of a real
//! kernel.

mod chain;
mod fronts;
mod harness;
mod kernel;
mod peers;
mod python;
mod rehearsal;
mod rules;
mod watch;
