//! The CAN bridge as a whole: processes, peers from PyPI, the Python package.

mod chain;
mod fronts;
mod harness;
mod peers;
mod python;
mod rehearsal;
mod rules;
mod watch;
