//! Settings of the protocol.

use crate::protocol::Key;

pub(super) const KEYS: &[Key] = &[
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
    Key::flag("configure", "whether the PDOs are set up by SDO; else they are as above").or("true"),
];
