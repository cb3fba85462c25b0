//! What happens on a bus besides frames.

/// News of a bus from its adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// The controller takes part fully.
    ErrorActive,
    /// 96 errors or more.
    ErrorWarning,
    /// 128 errors or more: the controller may not signal errors any more, frames may be lost unnoticed.
    ErrorPassive,
    /// The controller has left the bus, or the interface is down.
    BusOff,
    /// The controller came back after bus-off.
    Restarted,
    /// Frames that were not sent because there was no room for them.
    Dropped(u32),
    /// Frames that wait to be sent.
    Backlog(u32),
    /// Frames that were received and lost because nobody took them in time.
    Overrun(u32),
}

impl BusEvent {
    /// The event of a name in recordings; `count` is for those that count frames.
    pub fn named(name: &str, count: u32) -> Option<BusEvent> {
        Some(match name {
            "error_active" => BusEvent::ErrorActive,
            "error_warning" => BusEvent::ErrorWarning,
            "error_passive" => BusEvent::ErrorPassive,
            "bus_off" => BusEvent::BusOff,
            "restarted" => BusEvent::Restarted,
            "dropped" => BusEvent::Dropped(count),
            "backlog" => BusEvent::Backlog(count),
            "overrun" => BusEvent::Overrun(count),
            _ => return None,
        })
    }
}
