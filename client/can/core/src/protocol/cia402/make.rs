//! A drive from its settings.

use sarrus_models::Diagnostics;

use super::drive::Cia402;
use super::setup::{self, Setup};
use crate::drive::{Drive, Mode};
use crate::protocol::power_up::PowerUp;
use crate::protocol::{Common, Settings};

pub(super) fn make(
    settings: &Settings,
    common: Common,
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Drive>> {
    let node = settings.integer("node") as u16;
    let master = settings.integer("master") as u16;
    if node == master {
        diagnostics.error(
            settings.place("master"),
            format!("`master` is {node} like `node`"),
            "another node",
            "give this side a free one",
        );
        return None;
    }
    let counts = settings.number("counts_per_turn");
    let rated_torque = settings.number("rated_torque");
    let velocity_counts = settings.number_or("velocity_counts_per_turn", counts);
    let torque_offset = settings.flag("torque_offset") && common.mode != Mode::Torque;
    let velocity_feedback = settings.flag("velocity_feedback");
    let setup = Setup::new(setup::Desired {
        node,
        master,
        mode: common.mode,
        watchdog_ms: common.watchdog_ms.min(0xFFFF) as u16,
        torque_limit: (common.torque_limit / rated_torque * 1000.0).floor(),
        rated_torque,
        torque_offset,
        velocity_feedback,
        configure: settings.flag("configure"),
        period_ns: common.period_ns,
    });
    Some(Box::new(Cia402 {
        node,
        master,
        mode: common.mode,
        torque_limit: common.torque_limit,
        rated_torque,
        counts,
        velocity_counts,
        torque_offset,
        velocity_feedback,
        watchdog_ms: common.watchdog_ms,
        setup,
        state: None,
        power_up: PowerUp::at_once(),
        emergency: 0,
        emergency_holds: false,
        counted: None,
        n_new: 0,
        heard_ns: None,
        torque: f64::NAN,
        heartbeat_ns: None,
    }))
}
