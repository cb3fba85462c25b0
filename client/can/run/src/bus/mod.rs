//! Buses, which send and receive frames, by python-can's names of interfaces.

mod lines;
mod pseudo;
mod reconnecting;
mod serial;
mod socketcan;

use std::io;
use std::os::fd::{BorrowedFd, OwnedFd};
use std::time::{Duration, SystemTime};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, socket_with};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::config::BusConfig;
use sarrus_can_core::frame::Frame;
use sarrus_can_core::netlink::InterfaceError;
use sarrus_client::now_ns;
use sarrus_proto::socket::timespec;
use thiserror::Error;

pub use pseudo::Pseudo;
pub use reconnecting::Reconnecting;
pub use socketcan::interface;

/// Input that is older when it is read has a time that is not believed.
const OLDEST: Duration = Duration::from_secs(1);

/// Time between two polls of a bus without a descriptor.
pub const POLL: Duration = Duration::from_millis(1);

/// A bus that is open. Its calls do not wait; [`wait_for`] does. A driver that waits all the same
/// delays its own bus only.
pub trait Bus: Send {
    /// Sends a frame, or drops it where there is no room.
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError>;

    /// Sends the frames that [`Bus::send`] has only collected; gives how many are dropped.
    fn flush(&mut self) -> u32 {
        0
    }

    /// The next frame or event that is already there.
    fn next(&mut self) -> Result<Option<Heard>, BusError>;

    /// When the input of the last call of [`Bus::next`] came, by the monotonic clock, where the
    /// system or the adapter tells `[ns]`.
    fn heard_ns(&self) -> Option<u64> {
        None
    }

    /// Frames that were taken and are not on the wire yet, as far as the adapter reports them.
    fn backlog(&self) -> u32;

    /// The descriptor that becomes readable when something arrives, for [`wait_for`]. A bus
    /// without one is polled every [`POLL`].
    fn readable(&self) -> Option<BorrowedFd<'_>>;

    /// Whether nothing is sent on this bus, as in a dry run: all its frames count as dropped.
    fn is_mute(&self) -> bool {
        false
    }

    /// Reports a new state of the adapter to the other side of a simulated bus; false where this
    /// bus cannot.
    fn pretend(&mut self, event: BusEvent) -> Result<bool, BusError> {
        let _ = event;
        Ok(false)
    }
}

/// Result of sending a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// The adapter took it.
    Taken,
    /// There was no room: it will never be sent.
    Dropped,
}

/// Input from a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heard {
    /// A frame of another node.
    Frame(Frame),
    /// News of the bus.
    Event(BusEvent),
}

/// Why a bus cannot be used.
#[derive(Debug, Error)]
pub enum BusError {
    /// No such interface.
    #[error(
        "no interface `{0}`, expected socketcan or slcan; other adapters work through `python -m \
            sarrus.can`"
    )]
    Interface(String),
    /// A bit rate that slcan does not have.
    #[error(
        "{0}: slcan has no bit rate {1}, expected one of 10000, 20000, 50000, 100000, 125000, \
            250000, 500000, 750000, 1000000"
    )]
    Bitrate(String, u32),
    /// A data bit rate that slcan does not have.
    #[error("{0}: slcan has no data bit rate {1}, expected 2000000 or 5000000")]
    DataBitrate(String, u32),
    /// An interface whose settings do not fit the configuration.
    #[error(transparent)]
    Unfit(#[from] InterfaceError),
    /// Another program owns it.
    #[error("{0} is in use by another program; each bus has one owner, end the other one first")]
    Owned(String),
    /// It cannot be opened.
    #[error("{0} cannot be opened: {1}")]
    Open(String, io::Error),
    /// It was open and is gone.
    #[error("{0} is gone: {1}")]
    Gone(String, io::Error),
    /// A driver that is not ours failed, with its message.
    #[error("{0}")]
    Driver(String),
}

/// Where a bus is, in python-can's words.
#[derive(Clone, Debug)]
pub struct Address {
    /// `socketcan` or `slcan`.
    pub interface: String,
    /// Network interface, or path of the serial port, `@` and its speed behind it if it is not
    /// 115200.
    pub channel: String,
    /// `[bit/s]`; socketcan has its own, set by `ip link`, which must be this one. `None`: it may
    /// be any.
    pub bitrate: Option<u32>,
    /// `[bit/s]` with CAN FD.
    pub data_bitrate: Option<u32>,
    /// Nothing is sent, where the adapter can do that also no acknowledgement.
    pub listen_only: bool,
}

impl Address {
    /// Where a bus of a configuration is.
    pub fn of(config: &BusConfig) -> Address {
        Address {
            interface: config.interface.clone(),
            channel: config.channel.clone(),
            bitrate: Some(config.bitrate),
            data_bitrate: config.data_bitrate,
            listen_only: false,
        }
    }
}

/// Whether a channel leads to a pseudo-terminal, as that of simulated motors.
pub fn is_pseudo_terminal(channel: &str) -> bool {
    std::fs::canonicalize(channel).is_ok_and(|path| path.starts_with("/dev/pts"))
}

/// Opens a bus.
pub fn open(address: &Address) -> Result<Box<dyn Bus>, BusError> {
    match address.interface.as_str() {
        "slcan" => Ok(Box::new(serial::Serial::open(address)?)),
        "socketcan" => Ok(Box::new(socketcan::SocketCan::open(address)?)),
        other => Err(BusError::Interface(other.to_owned())),
    }
}

/// A system's time of an event by the monotonic clock `[ns]`; `None` for a time that is not within
/// the last second, as of a clock that was set meanwhile.
pub fn monotonic_ns(at: SystemTime) -> Option<u64> {
    let age = SystemTime::now().duration_since(at).ok()?;
    (age <= OLDEST).then(|| now_ns().saturating_sub(age.as_nanos() as u64))
}

/// Makes this process the owner of an interface until the mark is dropped, also by its death. A
/// serial port is locked when it is opened; the mark of others is a name in the abstract space of
/// Unix sockets, which like CAN interfaces belongs to the network namespace.
pub fn own(address: &Address) -> Result<Option<OwnedFd>, BusError> {
    if address.interface == "slcan" {
        return Ok(None);
    }
    let failed = |error: Errno| match error {
        Errno::ADDRINUSE => BusError::Owned(address.channel.clone()),
        error => BusError::Open(address.channel.clone(), error.into()),
    };
    let name = format!("sarrus-can/{}/{}", address.interface, address.channel);
    let mark = socket_with(AddressFamily::UNIX, SocketType::DGRAM, SocketFlags::CLOEXEC, None)
        .map_err(failed)?;
    bind(&mark, &SocketAddrUnix::new_abstract_name(name.as_bytes()).map_err(failed)?)
        .map_err(failed)?;
    Ok(Some(mark))
}

/// Waits until a bus is readable, or for [`POLL`] if it has no descriptor.
///
/// # Errors
/// The system cannot wait.
pub fn wait_for_bus(bus: &dyn Bus, at_most: Duration) -> Result<(), BusError> {
    match bus.readable() {
        Some(readable) => {
            let mut fds = [PollFd::from_borrowed_fd(readable, PollFlags::IN)];
            wait_for(&mut fds, at_most).map(drop)
        }
        None => wait_for(&mut [], at_most.min(POLL)).map(drop),
    }
}

/// Waits until one of several is readable; false when the time is over or a signal came.
///
/// # Errors
/// The system cannot wait.
pub fn wait_for(fds: &mut [PollFd<'_>], at_most: Duration) -> Result<bool, BusError> {
    match poll(fds, Some(&timespec(at_most))) {
        Ok(n) => Ok(n > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(BusError::Gone("the bus".to_owned(), error.into())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_a_clock_that_was_set_are_not_believed() {
        let before = Duration::from_millis(10);
        let at = monotonic_ns(SystemTime::now() - before).unwrap();
        let age = now_ns() - at;
        assert!((10_000_000..2_000_000_000).contains(&age), "{age}");
        assert_eq!(monotonic_ns(SystemTime::now() - 2 * OLDEST), None);
        assert_eq!(monotonic_ns(SystemTime::now() + before), None);
    }
}
