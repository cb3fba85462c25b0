//! A drive from its settings.

use sarrus_models::Diagnostics;

use super::drive::{CyberGear, Step, unknown};
use crate::drive::Drive;
use crate::protocol::codes::Codes;
use crate::protocol::number::single;
use crate::protocol::power_up::PowerUp;
use crate::protocol::scale::Scale;
use crate::protocol::turns::Turns;
use crate::protocol::{Common, Settings};

/// Ranges of a CyberGear, in the order of [`RANGES`].
const CYBERGEAR_RANGES: [f64; 4] = [30.0, 12.0, 500.0, 5.0];
const RANGES: [&str; 4] = ["velocity_range", "torque_range", "stiffness_range", "damping_range"];

pub(super) fn make(
    settings: &Settings,
    common: Common,
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Drive>> {
    let is_cybergear = settings.text("model") == "cybergear";
    let mut ranges = CYBERGEAR_RANGES;
    let mut good = true;
    for (key, range) in RANGES.iter().zip(&mut ranges) {
        if settings.has(key) {
            *range = settings.number(key);
        } else if !is_cybergear {
            let found = format!("the drive has no `{key}`");
            diagnostics.error(
                settings.place("model"),
                found,
                "the range of this RobStride",
                "add it from the motor's manual",
            );
            good = false;
        }
    }
    let [velocity, torque, stiffness, damping] = ranges;
    let watchdog_index = match settings.has("watchdog_index") {
        true => settings.integer("watchdog_index") as u16,
        false if is_cybergear => 0x200C,
        false => 0x7028,
    };
    good.then(|| {
        Box::new(CyberGear {
            id: settings.integer("id") as u32,
            host: settings.integer("host_id") as u32,
            can_save: !is_cybergear,
            mode: common.mode,
            torque_limit: common.torque_limit,
            codes: Codes {
                position: Scale::around_zero(settings.number("position_range"), 16),
                velocity: Scale::around_zero(velocity, 16),
                torque: Scale::around_zero(torque, 16),
                stiffness: Scale::from_zero(stiffness, 16),
                damping: Scale::from_zero(damping, 16),
            },
            limit: common
                .torque_limit
                .is_finite()
                .then(|| single(common.torque_limit.clamp(0.0, torque))),
            watchdog_index,
            watchdog_ms: common.watchdog_ms,
            watchdog: unknown(watchdog_index),
            step: Step::WriteMode,
            power_up: PowerUp::primed(),
            runs: None,
            motor_fault: 0,
            reported_fault: 0,
            refused: 0,
            turns: Turns::default(),
            measured: None,
            odd: false,
        }) as Box<dyn Drive>
    })
}
