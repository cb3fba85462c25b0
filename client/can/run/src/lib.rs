//! The loop of the CAN bridge, over any bus.
//!
//! [`prepare`] creates the services of a bridge and opens its buses; [`Prepared::start`] starts its
//! threads. One thread runs the rules of `sarrus-can-core` at absolute deadlines. Each bus has a
//! thread of its own, which waits for frames and sends those of the newest cycle, so that a slow
//! adapter delays no other bus. Another thread writes the logs. The threads share queues of fixed
//! size and no locks, and a cycle allocates nothing.
//!
//! A bus implements the trait [`bus::Bus`]. [`bus`] holds SocketCAN and slcan; `python -m
//! sarrus.can` implements it with python-can.

#![forbid(unsafe_code)]

pub mod bus;
mod bus_thread;
mod journal;
mod positions;
pub mod realtime;
mod rules;
mod running;
pub mod stderr;

pub use journal::{Journal, JournalWriter, journal};
pub use positions::write_whole;
pub use rules::Report;
pub use running::{Prepared, Running, Settings, prepare};
