//! The CAN bridge as a whole: processes, peers from PyPI, the Python package, SocketCAN of a real
//! kernel.

// the attacks and their motors are those of the core's table
#[path = "../../../client/can/sim/tests/suite/attack_table.rs"]
#[allow(dead_code, reason = "the suite of the simulated motors uses all of it")]
mod attack_table;
mod attacks;
mod chain;
mod end_to_end;
mod frontends;
mod harness;
mod kernel;
mod owners;
// the one source of time limits for processes
#[path = "../../../client/can/cli/tests/program/allowance.rs"]
mod allowance;
mod peers;
mod python;
#[path = "../../../client/can/sim/tests/suite/robots.rs"]
#[allow(dead_code, reason = "the suite of the simulated motors uses all of it")]
mod robots;
mod rules;
mod session;
mod watch;
#[path = "../../../client/can/sim/tests/suite/world.rs"]
#[allow(dead_code, reason = "the suite of the simulated motors uses all of it")]
mod world;
