//! SocketCAN: the network interfaces of Linux for CAN.
//!
//! Frames travel as the structures `can_frame` (16 bytes) and `canfd_frame` (72 bytes); the socket
//! echoes each frame of ours when the controller has sent it, which gives the number of those that
//! still wait.
//! Source: Linux, *Documentation/networking/can.rst*, `linux/can.h`, `linux/can/error.h`.

use std::io::{self, IoSliceMut};
use std::os::fd::{AsFd, BorrowedFd};

use rustix::io::Errno;
use rustix::net::sockopt::set_socket_recv_buffer_size;
use rustix::net::{
    AddressFamily, RecvAncillaryBuffer, RecvFlags, SendFlags, SocketFlags, SocketType, recv,
    recvmsg, send, socket_with,
};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::frame::{Frame, FrameKind, Id};
use sarrus_can_core::netlink::{Interface, InterfaceError, error_events, question};
use socketcan::{CanFdSocket, Socket, SocketOptions};

use super::{Address, Bus, BusError, Heard, Sent, monotonic_ns};
use crate::stderr::say;

/// Bytes of `can_frame` and `canfd_frame`.
const CLASSIC: usize = 16;
const FD: usize = 72;
/// Receive buffer `[bytes]`: some thousand frames.
const RECEIVE_BUFFER: usize = 1 << 20;
/// `MSG_CONFIRM`: the frame is an echo of this socket's own.
const CONFIRM: u32 = 0x800;
/// `SOL_SOCKET`, `SO_MEMINFO`, and the place of the count of lost frames in its answer.
const MEMORY: (i32, i32, usize) = (1, 55, 8);
/// Most frames without an echo that are believed to wait; an interface that echoes nothing must not
/// look stuck for ever.
const MOST_WAITING: u32 = 4096;

/// A SocketCAN interface.
pub(super) struct SocketCan {
    name: String,
    socket: CanFdSocket,
    waiting: u32,
    lost: u32,
    /// When the last input came by the kernel's clock `[ns]`.
    heard_ns: Option<u64>,
    /// Events of the last error frame that are not given yet.
    events: [Option<BusEvent>; 3],
}

impl SocketCan {
    /// Opens the interface, which must be up and not bus-off, with the bit rates of the address.
    pub(super) fn open(address: &Address) -> Result<SocketCan, BusError> {
        let name = address.channel.as_str();
        let failed = |error: io::Error| BusError::Open(name.to_owned(), error);
        let socket = CanFdSocket::open(name).map_err(failed)?;
        socket.set_error_filter_accept_all().map_err(failed)?;
        socket.set_recv_own_msgs(true).map_err(failed)?;
        socket.set_recv_timestamp(true).map_err(failed)?;
        // the kernel may allow less; lost frames are counted
        let _ = set_socket_recv_buffer_size(&socket, RECEIVE_BUFFER);
        // after the filter, so that no change of the state is missed
        let interface = interface(name).map_err(failed)?;
        let state = interface.check(name, address.bitrate, address.data_bitrate)?;
        if let Some(advice) = interface.advice(name) {
            say(format_args!("warning: {advice}"));
        }
        Ok(SocketCan {
            name: name.to_owned(),
            socket,
            waiting: 0,
            lost: 0,
            heard_ns: None,
            events: [state, None, None],
        })
    }

    /// Takes the frame that was looked at from the queue, also one that the crate cannot read, and
    /// notes the kernel's time of it.
    fn take(&mut self) {
        let times = self.socket.read_frame_with_timestamps().ok();
        self.heard_ns = times.and_then(|(_, times)| monotonic_ns(times.socket?));
    }

    /// Frames that the receive buffer had no room for, since the last time.
    fn newly_lost(&mut self) -> u32 {
        let mut answer = [0; 4 * 16];
        let (level, name, place) = MEMORY;
        let used = self.socket.get_socket_option_bytes(level, name, &mut answer).unwrap_or(0);
        let counts = answer.get(..used).unwrap_or_default();
        let bytes = counts.get(4 * place..4 * place + 4).and_then(|bytes| bytes.try_into().ok());
        let lost = bytes.map_or(self.lost, u32::from_ne_bytes);
        let new = lost.wrapping_sub(self.lost);
        self.lost = lost;
        new
    }
}

/// Asks the kernel for an interface.
pub fn interface(name: &str) -> io::Result<Interface> {
    let socket = socket_with(AddressFamily::NETLINK, SocketType::RAW, SocketFlags::CLOEXEC, None)?;
    send(&socket, &question(name), SendFlags::empty())?;
    let mut answer = [0; 16384];
    // the answer to one interface's question is there before the question's call is over
    let (used, _) = recv(&socket, &mut answer, RecvFlags::DONTWAIT)?;
    Interface::read(answer.get(..used).unwrap_or_default()).map_err(|error| match error {
        InterfaceError::Refused(number) => io::Error::from_raw_os_error(number),
        other => io::Error::new(io::ErrorKind::InvalidData, other),
    })
}

impl Bus for SocketCan {
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        let mut bytes = [0; FD];
        let used = encode(frame, &mut bytes);
        match send(
            &self.socket,
            bytes.get(..used).unwrap_or_default(),
            SendFlags::DONTWAIT | SendFlags::NOSIGNAL,
        ) {
            Ok(_) => {
                self.waiting = (self.waiting + 1).min(MOST_WAITING);
                Ok(Sent::Taken)
            }
            Err(Errno::NOBUFS | Errno::AGAIN | Errno::INTR) => Ok(Sent::Dropped),
            Err(error) => Err(BusError::Gone(self.name.clone(), error.into())),
        }
    }

    fn next(&mut self) -> Result<Option<Heard>, BusError> {
        loop {
            if let Some(event) = self.events.iter_mut().find_map(Option::take) {
                return Ok(Some(Heard::Event(event)));
            }
            // looked at first: only this call tells echoes apart, and only that of the crate times
            let mut bytes = [0; FD];
            let received = recvmsg(
                &self.socket,
                &mut [IoSliceMut::new(&mut bytes)],
                &mut RecvAncillaryBuffer::new(&mut []),
                RecvFlags::DONTWAIT | RecvFlags::TRUNC | RecvFlags::PEEK,
            );
            let message = match received {
                Ok(message) => message,
                Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => {
                    let lost = self.newly_lost();
                    if lost == 0 {
                        return Ok(None);
                    }
                    // echoes of ours may be among them
                    self.waiting = 0;
                    return Ok(Some(Heard::Event(BusEvent::Overrun(lost))));
                }
                Err(error) => return Err(BusError::Gone(self.name.clone(), error.into())),
            };
            self.take();
            if message.flags.bits() & CONFIRM != 0 {
                self.waiting = self.waiting.saturating_sub(1);
                continue;
            }
            match decode(bytes.get(..message.bytes).unwrap_or_default()) {
                Decoded::Frame(frame) => return Ok(Some(Heard::Frame(frame))),
                Decoded::Errors(events) => {
                    if matches!(events, [Some(BusEvent::BusOff | BusEvent::Restarted), ..]) {
                        // the kernel has discarded waiting frames, which get no echo
                        self.waiting = 0;
                    }
                    self.events = events;
                }
                Decoded::Other => {}
            }
        }
    }

    fn heard_ns(&self) -> Option<u64> {
        self.heard_ns
    }

    fn backlog(&self) -> u32 {
        self.waiting
    }

    fn readable(&self) -> Option<BorrowedFd<'_>> {
        Some(self.socket.as_fd())
    }
}

/// Content of the bytes of a frame.
#[derive(Debug, PartialEq)]
enum Decoded {
    Frame(Frame),
    /// An error frame.
    Errors([Option<BusEvent>; 3]),
    /// A remote frame, or none.
    Other,
}

const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;
const BIT_RATE_SWITCH: u8 = 1;

/// id (host order, with flags), length, flags of FD, two reserved bytes, data.
fn encode(frame: &Frame, bytes: &mut [u8; FD]) -> usize {
    let id = match frame.id {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id | EXTENDED,
    };
    let flags = u8::from(frame.kind == FrameKind::Fd { bit_rate_switch: true }) * BIT_RATE_SWITCH;
    let head = id.to_ne_bytes().into_iter().chain([frame.data().len() as u8, flags, 0, 0]);
    bytes
        .iter_mut()
        .zip(head.chain(frame.data().iter().copied()))
        .for_each(|(place, byte)| *place = byte);
    if frame.is_fd() { FD } else { CLASSIC }
}

fn decode(bytes: &[u8]) -> Decoded {
    let Some((&[a, b, c, d, length, flags, _, _], data)) = bytes.split_first_chunk::<8>() else {
        return Decoded::Other;
    };
    let id = u32::from_ne_bytes([a, b, c, d]);
    if id & ERROR != 0 {
        return Decoded::Errors(error_events(id, data));
    }
    if id & REMOTE != 0 {
        return Decoded::Other;
    }
    let number = id & (EXTENDED - 1);
    let id = if id & EXTENDED != 0 { Id::extended(number) } else { Id::standard(number) };
    let frame = id.zip(data.get(..usize::from(length))).and_then(|(id, data)| match bytes.len() {
        CLASSIC => Frame::classic(id, data),
        FD => Frame::fd(id, flags & BIT_RATE_SWITCH != 0, data),
        _ => None,
    });
    frame.map_or(Decoded::Other, Decoded::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_from_the_structures_of_the_kernel() {
        let frames = [
            Frame::classic(Id::Standard(0x123), &[1, 2, 3]),
            Frame::classic(Id::Extended(0x1ABC_DEF0), &[0xFF; 8]),
            Frame::fd(Id::Standard(0x7FF), true, &[7; 20]),
            Frame::fd(Id::Extended(1), false, &[9; 64]),
        ];
        for frame in frames.into_iter().flatten() {
            let mut bytes = [0; FD];
            let used = encode(&frame, &mut bytes);
            assert_eq!(used, if frame.is_fd() { 72 } else { 16 });
            assert_eq!(decode(&bytes[..used]), Decoded::Frame(frame));
        }
    }

    #[test]
    fn a_classic_frame_has_the_layout_of_can_h() {
        let mut bytes = [0; FD];
        let used =
            encode(&Frame::classic(Id::Extended(0x0100_0003), &[0xAA, 0xBB]).unwrap(), &mut bytes);
        assert_eq!(bytes[..4], 0x8100_0003_u32.to_ne_bytes());
        assert_eq!(bytes[4..used], [2, 0, 0, 0, 0xAA, 0xBB, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn error_frames_tell_the_state_of_the_controller() {
        let event = |class: u32, state: u8| {
            let mut bytes = [0; CLASSIC];
            bytes[..4].copy_from_slice(&(class | ERROR).to_ne_bytes());
            (bytes[4], bytes[9]) = (8, state);
            decode(&bytes)
        };
        assert_eq!(event(0x40, 0), Decoded::Errors([Some(BusEvent::BusOff), None, None]));
        assert_eq!(event(0x100, 0), Decoded::Errors([Some(BusEvent::Restarted), None, None]));
        assert_eq!(event(0x04, 0x20), Decoded::Errors([Some(BusEvent::ErrorPassive), None, None]));
        assert_eq!(event(0x04, 0x08), Decoded::Errors([Some(BusEvent::ErrorWarning), None, None]));
        assert_eq!(event(0x04, 0x40), Decoded::Errors([Some(BusEvent::ErrorActive), None, None]));
        assert_eq!(event(0x04, 0x01), Decoded::Errors([None, Some(BusEvent::Overrun(1)), None]));
        assert_eq!(event(0x08, 0x20), Decoded::Errors([None; 3]));
    }

    #[test]
    fn what_is_no_frame_is_none() {
        assert_eq!(decode(&[]), Decoded::Other);
        let mut bytes = [0; CLASSIC];
        bytes[4] = 9;
        assert_eq!(decode(&bytes), Decoded::Other);
        bytes[..4].copy_from_slice(&(REMOTE | 5).to_ne_bytes());
        assert_eq!(decode(&bytes), Decoded::Other);
    }
    #[test]
    fn frames_that_the_kernel_threw_away_at_bus_off_wait_no_longer() {
        use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
        // a pair of sockets: the other end is the kernel
        let (ours, kernel) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::empty(), None)
                .unwrap();
        let socket = CanFdSocket::from(ours);
        let mut bus = SocketCan {
            name: "pair".to_owned(),
            socket,
            waiting: 0,
            lost: 0,
            heard_ns: None,
            events: [None; 3],
        };
        for (class, event) in [(0x40_u32, BusEvent::BusOff), (0x100, BusEvent::Restarted)] {
            bus.send(&Frame::classic(Id::Standard(1), &[]).unwrap()).unwrap();
            assert_eq!(bus.backlog(), 1);
            let mut bytes = [0; CLASSIC];
            bytes[..4].copy_from_slice(&(class | ERROR).to_ne_bytes());
            send(&kernel, &bytes, SendFlags::empty()).unwrap();
            assert_eq!(bus.next().unwrap(), Some(Heard::Event(event)));
            assert_eq!(bus.backlog(), 0);
        }
        // and a bus whose other end is gone is gone
        drop(kernel);
        assert!(bus.send(&Frame::classic(Id::Standard(1), &[]).unwrap()).is_err());
    }

    #[test]
    fn a_frame_has_the_time_at_which_the_kernel_received_it() {
        use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
        let (ours, kernel) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::empty(), None)
                .unwrap();
        let socket = CanFdSocket::from(ours);
        socket.set_recv_timestamp(true).unwrap();
        let name = "pair".to_owned();
        let mut bus =
            SocketCan { name, socket, waiting: 0, lost: 0, heard_ns: None, events: [None; 3] };
        let before = sarrus_client::now_ns();
        let frame = Frame::classic(Id::Standard(1), &[7]).unwrap();
        let mut bytes = [0; FD];
        let used = encode(&frame, &mut bytes);
        send(&kernel, &bytes[..used], SendFlags::empty()).unwrap();
        assert_eq!(bus.next().unwrap(), Some(Heard::Frame(frame)));
        let at = bus.heard_ns().unwrap();
        // the two clocks are read one after the other
        assert!(at + 1_000_000 >= before && at <= sarrus_client::now_ns(), "{before} {at}");
        assert_eq!(bus.next().unwrap(), None);
    }

    #[test]
    fn the_kernel_answers_a_question() {
        assert_eq!(interface("no such name").unwrap_err().raw_os_error(), Some(19));
        let lo = interface("lo").unwrap();
        assert_eq!((lo.bitrate, lo.controller), (None, None));
    }
}
