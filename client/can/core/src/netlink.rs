//! State of a CAN interface from the kernel: whether it is up, its bit rates, the state of its
//! controller, and its error frames.
//!
//! Builds one RTM_GETLINK request, which a frontend sends over a route socket, and reads the
//! attributes of its answer. Source: Linux, *rtnetlink(7)*, `linux/if_link.h`,
//! `linux/can/netlink.h`.

use thiserror::Error;

use crate::event::{BusEvent, BusState};

/// Kinds of messages.
const GET_LINK: u16 = 18;
const NEW_LINK: u16 = 16;
const ERROR: u16 = 2;
/// `NLM_F_REQUEST`.
const REQUEST: u16 = 1;
/// Bytes of `nlmsghdr` and of `ifinfomsg`.
const HEAD: usize = 16;
const INFO: usize = 16;
/// `IFF_UP` in the flags of `ifinfomsg`.
const UP: u32 = 1;
/// `IFLA_IFNAME`, `IFLA_MTU`, `IFLA_TXQLEN`, `IFLA_LINKINFO`, and in the last one
/// `IFLA_INFO_DATA`.
const NAME: u16 = 3;
const MTU: u16 = 4;
const QUEUE: u16 = 13;
const LINK_INFO: u16 = 18;
const DATA: u16 = 2;
/// `IFLA_CAN_BITTIMING`, `IFLA_CAN_STATE`, `IFLA_CAN_DATA_BITTIMING`.
const TIMING: u16 = 1;
const STATE: u16 = 4;
const DATA_TIMING: u16 = 9;
/// `CAN_STATE_BUS_OFF`, after which come those of controllers that are stopped or asleep.
const OFF: u32 = 3;
/// Flag bits in an attribute's type.
const FLAGS: u16 = 0xC000;
/// Bit rates that differ by less than this fraction interoperate: clocks do not divide into every
/// rate exactly.
const SAME_RATE: f64 = 0.005;

/// A CAN interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    /// It is up, and its controller is neither stopped nor asleep.
    pub is_up: bool,
    /// Largest frame: 16 without CAN FD, 72 with it.
    pub mtu: u32,
    /// Frames that may wait in the kernel; 0 where it does not report them.
    pub queue: u32,
    /// Bit rate `[bit/s]`; `None` where there is none (`vcan`), or where the kernel does not know
    /// it.
    pub bitrate: Option<u32>,
    /// Bit rate of the data of FD frames `[bit/s]`.
    pub data_bitrate: Option<u32>,
    /// State of the controller; `None` where there is none.
    pub controller: Option<BusState>,
}

/// Why an interface cannot be used.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum InterfaceError {
    /// The kernel has no answer, but an error of the system, by its number.
    #[error("the kernel refuses to tell of it: error {0}")]
    Refused(i32),
    /// The answer is none.
    #[error("the kernel's answer is not understood")]
    Garbled,
    /// It is down.
    #[error("{name} is down: `{set}`")]
    Down {
        /// The interface.
        name: String,
        /// The command that brings it up.
        set: String,
    },
    /// Its controller has left the bus.
    #[error(
        "{0} is bus-off: its controller has left the bus after too many errors; look at wires, \
            termination and the bit rate of every node, \
             then `ip link set {0} type can restart`, or down and up"
    )]
    Off(String),
    /// It carries no CAN FD.
    #[error(
        "{0}: the interface carries no CAN FD, expected an MTU of 72: `ip link set {0} mtu 72`, \
            or `type can fd on` before it is up"
    )]
    NoFd(String),
    /// It has another bit rate.
    #[error(
        "{name} has a {what} of {found} bit/s, expected {expected}: `ip link set {name} down`, \
            then `{set}`"
    )]
    OtherBitrate {
        /// The interface.
        name: String,
        /// Which of its two bit rates.
        what: &'static str,
        /// Its bit rate `[bit/s]`.
        found: u32,
        /// The bit rate of the configuration `[bit/s]`.
        expected: u32,
        /// The command that sets it.
        set: String,
    },
}

impl Interface {
    /// Reads the kernel's answer to [`question`].
    ///
    /// # Errors
    /// [`InterfaceError::Refused`] where there is no such interface, [`InterfaceError::Garbled`].
    pub fn read(answer: &[u8]) -> Result<Interface, InterfaceError> {
        use InterfaceError::Garbled;
        let length = word(answer, 0).ok_or(Garbled)? as usize;
        let kind = answer.get(4..6).and_then(half).ok_or(Garbled)?;
        let message = answer.get(..length).ok_or(Garbled)?;
        if kind == ERROR {
            let code = word(message, HEAD).ok_or(Garbled)? as i32;
            return Err(InterfaceError::Refused(code.wrapping_neg()));
        }
        let flags = word(message, HEAD + 8).ok_or(Garbled)?;
        let list = message.get(HEAD + INFO..).filter(|_| kind == NEW_LINK).ok_or(Garbled)?;
        let mtu = number(list, MTU).ok_or(Garbled)?;
        let data = find(list, LINK_INFO).and_then(|info| find(info, DATA)).unwrap_or_default();
        // the bit rate is the first number of `can_bittiming`; a rate that is
        // not set, or known to the adapter only, is 0 or −1
        let rate = |kind: u16| number(data, kind).filter(|rate| !matches!(*rate, 0 | u32::MAX));
        let state = number(data, STATE);
        let controller = state.map(|state| match state {
            0 => BusState::Active,
            1 => BusState::Warning,
            2 => BusState::Passive,
            _ => BusState::Off,
        });
        Ok(Interface {
            is_up: flags & UP != 0 && state.is_none_or(|state| state <= OFF),
            mtu,
            queue: number(list, QUEUE).unwrap_or(0),
            bitrate: rate(TIMING),
            data_bitrate: rate(DATA_TIMING),
            controller,
        })
    }

    /// Whether the interface `name` can be used with these bit rates `[bit/s]`; `None` for the
    /// first may be any, for the second a classic bus. Returns the event of its controller's state.
    ///
    /// # Errors
    /// The fault, with the command that fixes it.
    pub fn check(
        &self,
        name: &str,
        bitrate: Option<u32>,
        data_bitrate: Option<u32>,
    ) -> Result<Option<BusEvent>, InterfaceError> {
        let set = set_up(name, bitrate, data_bitrate, self.controller.is_some());
        let name = name.to_owned();
        if !self.is_up {
            return Err(InterfaceError::Down { name, set });
        }
        if self.controller == Some(BusState::Off) {
            return Err(InterfaceError::Off(name));
        }
        if data_bitrate.is_some() && self.mtu != FD_MTU {
            return Err(InterfaceError::NoFd(name));
        }
        for (what, found, expected) in [
            ("bit rate", self.bitrate, bitrate),
            ("data bit rate", self.data_bitrate, data_bitrate),
        ] {
            let Some((found, expected)) = found.zip(expected) else { continue };
            if (f64::from(found) / f64::from(expected) - 1.0).abs() > SAME_RATE {
                return Err(InterfaceError::OtherBitrate { name, what, found, expected, set });
            }
        }
        Ok(self.controller.filter(|state| *state != BusState::Active).map(BusState::event))
    }

    /// Advice on a queue in which more than a cycle's frames wait: it makes torques old.
    pub fn advice(&self, name: &str) -> Option<String> {
        (self.queue > LONGEST_QUEUE).then(|| {
            format!(
                "{name} has a txqueuelen of {}, expected about {QUEUE_SET}: a long queue only \
                 makes torques old; `ip link set {name} txqueuelen {QUEUE_SET}`",
                self.queue
            )
        })
    }
}

/// The queue that is advised, and the longest that is not spoken of.
const QUEUE_SET: u32 = 10;
const LONGEST_QUEUE: u32 = 20;
/// MTU of an interface that carries CAN FD.
const FD_MTU: u32 = 72;

/// The command that brings an interface up with the rates of the configuration.
fn set_up(
    name: &str,
    bitrate: Option<u32>,
    data_bitrate: Option<u32>,
    has_controller: bool,
) -> String {
    match (bitrate, data_bitrate) {
        (Some(bitrate), Some(data)) if has_controller => {
            format!("ip link set {name} up type can bitrate {bitrate} dbitrate {data} fd on")
        }
        (Some(bitrate), None) if has_controller => {
            format!("ip link set {name} up type can bitrate {bitrate}")
        }
        _ => format!("ip link set {name} up"),
    }
}

/// The question for an interface: `nlmsghdr` (length, kind, flags, number, sender), an empty
/// `ifinfomsg`, and the name.
pub fn question(name: &str) -> Vec<u8> {
    let attribute = 4 + name.len() + 1;
    let total = HEAD + INFO + attribute.next_multiple_of(4);
    let mut bytes = Vec::with_capacity(total);
    bytes.extend((total as u32).to_ne_bytes());
    bytes.extend([GET_LINK, REQUEST].map(u16::to_ne_bytes).as_flattened());
    bytes.extend([1_u32, 0].map(u32::to_ne_bytes).as_flattened());
    bytes.extend([0; INFO]);
    bytes.extend([attribute as u16, NAME].map(u16::to_ne_bytes).as_flattened());
    bytes.extend(name.as_bytes());
    bytes.resize(total, 0);
    bytes
}

/// The content of the first attribute of a kind. Attributes are length and kind in 16 bits each,
/// content, and padding to four bytes.
fn find(mut list: &[u8], desired: u16) -> Option<&[u8]> {
    loop {
        let length = usize::from(half(list.get(..2)?)?);
        let kind = half(list.get(2..4)?)?;
        let content = list.get(4..length)?;
        if kind & !FLAGS == desired {
            return Some(content);
        }
        list = list.get(length.next_multiple_of(4)..)?;
    }
}

/// The number at the beginning of an attribute.
fn number(list: &[u8], desired: u16) -> Option<u32> {
    word(find(list, desired)?, 0)
}

/// Events of an error frame, from its class and its data, whose second byte is the controller's
/// state: the gravest state, and every loss (`linux/can/error.h`).
pub fn error_events(class: u32, data: &[u8]) -> [Option<BusEvent>; 3] {
    const CONTROLLER: u32 = 0x4;
    const BUS_OFF: u32 = 0x40;
    const RESTARTED: u32 = 0x100;
    let controller = data.get(1).copied().filter(|_| class & CONTROLLER != 0).unwrap_or(0);
    let state = match (class, controller) {
        (class, _) if class & BUS_OFF != 0 => Some(BusEvent::BusOff),
        (class, _) if class & RESTARTED != 0 => Some(BusEvent::Restarted),
        (_, state) if state & 0x30 != 0 => Some(BusEvent::ErrorPassive),
        (_, state) if state & 0x0C != 0 => Some(BusEvent::ErrorWarning),
        (_, state) if state & 0x40 != 0 => Some(BusEvent::ErrorActive),
        _ => None,
    };
    let overrun = (controller & 0x01 != 0).then_some(BusEvent::Overrun(1));
    let dropped = (controller & 0x02 != 0).then_some(BusEvent::Dropped(1));
    [state, overrun, dropped]
}

fn half(bytes: &[u8]) -> Option<u16> {
    bytes.try_into().ok().map(u16::from_ne_bytes)
}

fn word(bytes: &[u8], place: usize) -> Option<u32> {
    bytes.get(place..place + 4)?.try_into().ok().map(u32::from_ne_bytes)
}

#[cfg(test)]
mod tests;
