//! Events and states of a bus.

/// News of a bus from its adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// The controller is error-active.
    ErrorActive,
    /// 96 errors or more.
    ErrorWarning,
    /// 128 errors or more: the controller may not signal errors any more, frames may be lost
    /// unnoticed.
    ErrorPassive,
    /// The controller has left the bus, or the interface is down.
    BusOff,
    /// The controller came back after bus-off.
    Restarted,
    /// Frames that were not sent because the queue was full.
    Dropped(u32),
    /// Frames that wait to be sent.
    Backlog(u32),
    /// Frames that were received and lost because no reader took them in time.
    Overrun(u32),
    /// The program's own thread of the bus did not get to run since the last cycle.
    Late,
}

sarrus_proto::wire_enum! {
    /// The state of a bus.
    BusState: u32 {
        /// No errors.
        Active = 0, "active";
        /// Many errors.
        Warning = 1, "warning";
        /// Error-passive: nothing is armed.
        Passive = 2, "passive";
        /// Off the bus: its mechanisms are in fault.
        Off = 3, "off";
    }
}

impl BusState {
    /// The event of a bus that gets there.
    pub(crate) const fn event(self) -> BusEvent {
        match self {
            BusState::Active => BusEvent::ErrorActive,
            BusState::Warning => BusEvent::ErrorWarning,
            BusState::Passive => BusEvent::ErrorPassive,
            BusState::Off => BusEvent::BusOff,
        }
    }
}

impl BusEvent {
    /// The event of a name in recordings; `count` is for those that count frames.
    pub fn named(name: &str, count: u32) -> Option<BusEvent> {
        let all = [
            BusEvent::ErrorActive,
            BusEvent::ErrorWarning,
            BusEvent::ErrorPassive,
            BusEvent::BusOff,
            BusEvent::Restarted,
            BusEvent::Dropped(count),
            BusEvent::Backlog(count),
            BusEvent::Overrun(count),
            BusEvent::Late,
        ];
        all.into_iter().find(|event| event.name() == name)
    }

    /// Its name in recordings.
    pub const fn name(self) -> &'static str {
        match self {
            BusEvent::ErrorActive => "error_active",
            BusEvent::ErrorWarning => "error_warning",
            BusEvent::ErrorPassive => "error_passive",
            BusEvent::BusOff => "bus_off",
            BusEvent::Restarted => "restarted",
            BusEvent::Dropped(_) => "dropped",
            BusEvent::Backlog(_) => "backlog",
            BusEvent::Overrun(_) => "overrun",
            BusEvent::Late => "late",
        }
    }

    /// The frames that it counts; `None` for events that count none.
    pub const fn count(self) -> Option<u32> {
        match self {
            BusEvent::Dropped(count) | BusEvent::Backlog(count) | BusEvent::Overrun(count) => {
                Some(count)
            }
            _ => None,
        }
    }
}
