//! CANopen drives of the profile CiA 402: cyclic synchronous position, velocity and torque.
//!
//! Sources: CiA 301 4.2.0 (NMT, SYNC, EMCY, SDO, PDO, heartbeat); CiA 402-2 4.0 (state machine,
//! objects 6040 …).
//!
//! - 000 NMT: command, node (01 start, 80 pre-operational). 080 SYNC, empty, at the end of each
//!   cycle, once a bus. 080 + node EMCY: code u16, register u8, five of the maker's. 600 + node and
//!   580 + node SDO, expedited. 700 + node heartbeat, 0 when the drive booted.
//! - 200 + node, sent: control word 6040 u16, then target position 607A i32, target velocity 60FF
//!   i32 or target torque 6071 i16; behind a position or a velocity the torque offset 60B2 i16, if
//!   desired. All little-endian, taken at SYNC.
//! - 180 + node, received after SYNC: status word 6041 u16, position 6064 i32, torque 6077 i16. 280
//!   + node: velocity 606C i32.
//! - Positions in counts, `counts_per_turn` of them in a turn of the output; velocities in
//!   `velocity_counts_per_turn` units for one turn/s; torques in thousandths of the rated torque
//!   6076.
//!
//! Without power the drive is set up by SDO, one request at a time: PDOs, mode 6060 (8, 9, 10), the
//! largest torque 6072, the heartbeat that it waits for 1016 with its reaction to a late one 6007
//! (2: no voltage), and the time between set-points 60C2. The rated torque, the mode, the heartbeat
//! and the reaction to its loss are read back, and in the modes position and velocity, where the
//! drive's own loops produce the torque, so is the largest torque: a drive that does not hold it
//! gets no power. The mode is requested again from a drive that shows another one in 6061, before
//! its start and after it; one that shows none may get power, holds its position until it shows the
//! mode, and has a second to do so. The set-up is repeated after a boot, and when a drive that
//! should be operational is not: after a lost NMT command, or when it missed the heartbeat and went
//! back by itself (1029).
//!
//! The position is unwrapped beyond its 32 bits. A target cannot be: in the mode position a drive
//! outside their range has a fault.

mod drive;
mod setup;
mod states;

use super::{Key, Protocol};
use crate::drive::Mode;
use drive::make;

/// CANopen CiA 402.
pub(super) const CIA402: Protocol = Protocol {
    name: "cia402",
    about: "CANopen drives of the profile CiA 402 (CSP, CSV, CST)",
    modes: &[Mode::Torque, Mode::Position, Mode::Velocity],
    fd: false,
    keys: &[
        Key::integer("node", 1, 126, "node of the drive"),
        Key::integer("master", 1, 127, "node of this side, for its heartbeat").or("127"),
        Key::number("rated_torque", 1e-3, 1e6, "object 6076 [N m], at the motor's output"),
        Key::number("counts_per_turn", 1.0, 1e9, "counts of 6064 in a turn of the motor's output"),
        Key::number(
            "velocity_counts_per_turn",
            1e-3,
            1e9,
            "606C and 60FF at one turn a second; without it the counts of the position",
        )
        .optional(),
        Key::flag("torque_offset", "torque beside position or velocity, by 60B2").or("false"),
        Key::flag("velocity_feedback", "the velocity in a second PDO").or("true"),
        Key::flag("configure", "whether the PDOs are set up by SDO; else they are as above")
            .or("true"),
    ],
    make,
};
