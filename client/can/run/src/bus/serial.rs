//! slcan from the host's side: a serial port, or the pseudo-terminal of simulated motors.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::slcan::{BITRATES, DATA_BITRATES, Line};

use super::lines::LinePort;
use super::{Address, Bus, BusError, Heard, Sent};

/// Default speed of a serial port, as in python-can `[bit/s]`.
const SPEED: u32 = 115_200;

/// A serial adapter. The channel is open from [`Serial::open`] until it is dropped.
pub(super) struct Serial(LinePort);

impl Serial {
    /// Opens and locks the port, sets the bit rate and opens the channel.
    pub(super) fn open(address: &Address) -> Result<Serial, BusError> {
        let channel = address.channel.as_str();
        let (path, speed) = match channel.rsplit_once('@') {
            Some((path, speed)) => {
                (path, speed.parse().map_err(|_| refused(channel, "its speed is no number"))?)
            }
            None => (channel, SPEED),
        };
        let Some(code) = BITRATES.iter().position(|&bitrate| Some(bitrate) == address.bitrate)
        else {
            return Err(BusError::Bitrate(path.to_owned(), address.bitrate.unwrap_or(0)));
        };
        let data_code = |bitrate: u32| {
            let found = DATA_BITRATES.iter().find(|(_, known)| *known == bitrate);
            found.ok_or_else(|| BusError::DataBitrate(path.to_owned(), bitrate))
        };
        let data_code = address.data_bitrate.map(data_code).transpose()?;

        let failed = |error: Errno| BusError::Open(path.to_owned(), error.into());
        let fd = rustix::fs::open(
            path,
            OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC,
            Mode::empty(),
        )
        .map_err(failed)?;
        flock(&fd, FlockOperation::NonBlockingLockExclusive).map_err(|error| match error {
            Errno::WOULDBLOCK => BusError::Owned(path.to_owned()),
            error => failed(error),
        })?;
        let mut terminal = tcgetattr(&fd).map_err(failed)?;
        terminal.make_raw();
        terminal.set_speed(speed).map_err(failed)?;
        tcsetattr(&fd, OptionalActions::Now, &terminal).map_err(failed)?;
        tcflush(&fd, QueueSelector::IFlush).map_err(failed)?;

        let mut serial = Serial(LinePort::new(path.to_owned(), fd));
        // an empty line first: it ends a command that the adapter has half read
        serial.tell("\rC\r")?;
        serial.tell(&format!("S{code}\r"))?;
        if let Some((code, _)) = data_code {
            serial.tell(&format!("Y{code}\r"))?;
        }
        serial.tell(if address.listen_only { "L\r" } else { "O\r" })?;
        Ok(serial)
    }

    fn tell(&mut self, line: &str) -> Result<(), BusError> {
        match self.0.send_line(line.as_bytes()) {
            Ok(Sent::Taken) => Ok(()),
            Ok(Sent::Dropped) => Err(refused(
                &self.0.name,
                "it takes no bytes; is the adapter, or the program behind the terminal, alive?",
            )),
            Err(BusError::Gone(name, error)) => Err(BusError::Open(name, error)),
            Err(error) => Err(error),
        }
    }
}

fn refused(name: &str, why: &str) -> BusError {
    BusError::Open(name.to_owned(), io::Error::new(io::ErrorKind::InvalidInput, why.to_owned()))
}

impl Bus for Serial {
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.0.send(frame)
    }

    fn next(&mut self) -> Result<Option<Heard>, BusError> {
        loop {
            match self.0.next()? {
                None => return Ok(None),
                Some(Line::Frame(frame)) => return Ok(Some(Heard::Frame(frame))),
                Some(line) => {
                    if let Some(event) = line.event() {
                        return Ok(Some(Heard::Event(event)));
                    }
                }
            }
        }
    }

    fn backlog(&self) -> u32 {
        self.0.backlog()
    }

    fn readable(&self) -> Option<BorrowedFd<'_>> {
        Some(self.0.fd.as_fd())
    }
}

impl Drop for Serial {
    fn drop(&mut self) {
        // a port that is gone needs no closing
        let _ = self.0.send_line(b"C\r");
    }
}
