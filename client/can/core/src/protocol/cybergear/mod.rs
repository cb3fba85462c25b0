//! CyberGear, and RobStride motors in their private protocol.
//!
//! Sources: Xiaomi CyberGear instruction manual, chapter 4; RobStride 00 manual, "private
//! communication protocol".
//!
//! - Extended identifier: kind in bits 28 … 24, data in 23 … 8, receiver in 7 … 0. 8 data bytes.
//! - 1 set-point: the identifier's data is the torque; bytes position, velocity, stiffness,
//!   damping, each 16 bits big-endian. Code 0 is the low end of a range and FFFF the high end: ±
//!   `position_range` rad, ± `velocity_range` rad/s, ± `torque_range` N m, 0 … `stiffness_range` N
//!   m/rad, 0 … `damping_range` N m s/rad. 3 power on, 4 power off (byte 0 = 1: forget faults), 6
//!   zero here (byte 0 = 1), 7 another identifier (upper half of the data), 22 store (RobStride,
//!   bytes 1 … 8), 17 read and 18 write a parameter: index u16, 0 0, value of 4 bytes,
//!   little-endian. There the identifier's data is the host.
//! - 2 feedback to the host: data = mode (2 bits: 0 reset, 1 calibration, 2 runs), faults (6 bits),
//!   motor (8 bits); bytes position, velocity, torque, temperature × 10, big-endian. 17 answers a
//!   read, 21 reports faults u32 and warnings u32, 0 answers a search.
//!
//! The largest torque is the parameter limit_torque: it is set and read back before power.
//!
//! Around zero a range has no code for zero: the two codes beside it are sent in turn. Beyond ±
//! `position_range` the feedback is unwrapped and reported as a fault. The motor's watchdog is the
//! parameter canTimeout in units of 50 µs; it is off by default.

mod drive;
mod keys;

use super::Protocol;
use crate::drive::Mode;
use drive::make;
use keys::KEYS;

/// CyberGear and RobStride.
pub(super) const CYBERGEAR: Protocol = Protocol {
    name: "cybergear",
    about: "CyberGear, and RobStride in its private protocol",
    modes: &[Mode::Impedance, Mode::Torque],
    fd: false,
    keys: KEYS,
    make,
};
