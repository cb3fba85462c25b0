//! What the kernel knows of a CAN interface: whether it is up, its bit rates, the state of its controller.
//!
//! One question RTM_GETLINK over a route socket, and the attributes of its answer. Source: Linux, *rtnetlink(7)*, `linux/if_link.h`,
//! `linux/can/netlink.h`.

use std::io;

use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, recv, send, socket_with};

use super::{Address, BusError};

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
/// `IFLA_IFNAME`, `IFLA_MTU`, `IFLA_LINKINFO`, and in the last one `IFLA_INFO_DATA`.
const NAME: u16 = 3;
const MTU: u16 = 4;
const LINK_INFO: u16 = 18;
const DATA: u16 = 2;
/// `IFLA_CAN_BITTIMING`, `IFLA_CAN_STATE`, `IFLA_CAN_DATA_BITTIMING`.
const TIMING: u16 = 1;
const STATE: u16 = 4;
const DATA_TIMING: u16 = 9;
/// Where an attribute's kind has flags.
const FLAGS: u16 = 0xC000;
/// Bit rates that differ by less than this part of them work together: clocks do not divide into every one exactly.
const SAME_RATE: f64 = 0.005;

/// How a controller stands on its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Controller {
    Active,
    Warning,
    Passive,
    Off,
    /// Stopped or asleep: the interface is down.
    Stopped,
}

/// A CAN interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Interface {
    is_up: bool,
    pub(super) mtu: u32,
    /// Bit rate `[bit/s]`; `None` where there is none (`vcan`), or where the kernel does not know it.
    bitrate: Option<u32>,
    /// Bit rate of the data of FD frames `[bit/s]`.
    data_bitrate: Option<u32>,
    /// `None` where there is no controller.
    pub(super) controller: Option<Controller>,
}

impl Interface {
    /// Asks the kernel.
    pub(super) fn read(name: &str) -> io::Result<Interface> {
        let socket = socket_with(AddressFamily::NETLINK, SocketType::RAW, SocketFlags::CLOEXEC, None)?;
        send(&socket, &question(name), SendFlags::empty())?;
        let mut answer = [0; 16384];
        // the answer to one interface's question is there before the question's call is over
        let (used, _) = recv(&socket, &mut answer, RecvFlags::DONTWAIT)?;
        parse(answer.get(..used).unwrap_or_default())
    }

    /// Whether it can be used as the configuration says.
    pub(super) fn check(&self, address: Address<'_>) -> Result<(), BusError> {
        let name = address.channel.to_owned();
        let set = set_up(address, self.controller.is_some());
        if !self.is_up || self.controller == Some(Controller::Stopped) {
            return Err(BusError::Down(name, set));
        }
        if self.controller == Some(Controller::Off) {
            return Err(BusError::Off(name));
        }
        if address.data_bitrate.is_some() && self.mtu != FD_MTU {
            return Err(BusError::NoFd(name));
        }
        for (what, found, expected) in
            [("bit rate", self.bitrate, address.bitrate), ("data bit rate", self.data_bitrate, address.data_bitrate)]
        {
            match (found, expected) {
                (Some(found), Some(expected)) if (f64::from(found) / f64::from(expected) - 1.0).abs() > SAME_RATE => {
                    return Err(BusError::OtherBitrate { name, what, found, expected, set });
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// MTU of an interface that carries CAN FD.
const FD_MTU: u32 = 72;

/// The command that brings an interface up as the configuration says.
fn set_up(address: Address<'_>, has_controller: bool) -> String {
    let name = address.channel;
    match (address.bitrate, address.data_bitrate) {
        (Some(bitrate), Some(data)) if has_controller => {
            format!("ip link set {name} up type can bitrate {bitrate} dbitrate {data} fd on")
        }
        (Some(bitrate), None) if has_controller => format!("ip link set {name} up type can bitrate {bitrate}"),
        _ => format!("ip link set {name} up"),
    }
}

/// `nlmsghdr` (length, kind, flags, number, sender), an empty `ifinfomsg`, and the name.
fn question(name: &str) -> Vec<u8> {
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

/// Reads an answer: the interface, or why there is none.
fn parse(message: &[u8]) -> io::Result<Interface> {
    let garbled = || io::Error::new(io::ErrorKind::InvalidData, "the kernel's answer is not understood");
    let length = word(message, 0).ok_or_else(garbled)? as usize;
    let kind = message.get(4..6).and_then(half).ok_or_else(garbled)?;
    let message = message.get(..length).ok_or_else(garbled)?;
    if kind == ERROR {
        let code = word(message, HEAD).ok_or_else(garbled)? as i32;
        return Err(io::Error::from_raw_os_error(code.wrapping_neg()));
    }
    let flags = word(message, HEAD + 8).ok_or_else(garbled)?;
    let list = message.get(HEAD + INFO..).filter(|_| kind == NEW_LINK).ok_or_else(garbled)?;
    let mtu = find(list, MTU).and_then(|bytes| word(bytes, 0)).ok_or_else(garbled)?;
    let data = find(list, LINK_INFO).and_then(|info| find(info, DATA)).unwrap_or_default();
    // the bit rate is the first number of `can_bittiming`; a rate that nobody has set, or that only the adapter knows, is 0 or −1
    let rate = |kind: u16| find(data, kind).and_then(|timing| word(timing, 0)).filter(|rate| !matches!(*rate, 0 | u32::MAX));
    let controller = find(data, STATE).and_then(|state| word(state, 0)).map(|state| match state {
        0 => Controller::Active,
        1 => Controller::Warning,
        2 => Controller::Passive,
        3 => Controller::Off,
        _ => Controller::Stopped,
    });
    Ok(Interface { is_up: flags & UP != 0, mtu, bitrate: rate(TIMING), data_bitrate: rate(DATA_TIMING), controller })
}

/// The content of the first attribute of a kind. Attributes are length and kind in 16 bits each, content, and what fills four bytes.
fn find(mut list: &[u8], wanted: u16) -> Option<&[u8]> {
    loop {
        let (length, kind) = (usize::from(half(list.get(..2)?)?), half(list.get(2..4)?)?);
        let content = list.get(4..length)?;
        if kind & !FLAGS == wanted {
            return Some(content);
        }
        list = list.get(length.next_multiple_of(4)..)?;
    }
}

fn half(bytes: &[u8]) -> Option<u16> {
    bytes.try_into().ok().map(u16::from_ne_bytes)
}

fn word(bytes: &[u8], place: usize) -> Option<u32> {
    bytes.get(place..place + 4)?.try_into().ok().map(u32::from_ne_bytes)
}
