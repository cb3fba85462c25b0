//! slcan from the adapter's side: a pseudo-terminal that a bridge opens like a serial adapter.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::frame::{Frame, Id};
use sarrus_can_core::slcan::Line;

use super::lines::LinePort;
use super::{Bus, BusError, Heard, Sent};

/// A simulated adapter. Frames pass while its host has the channel open.
pub struct Pseudo {
    port: LinePort,
    /// The host's end stays open here, so that a host may come and go.
    _host: OwnedFd,
    open: bool,
    listen_only: bool,
    off: bool,
}

impl Pseudo {
    /// Makes a pseudo-terminal.
    pub fn new() -> Result<Pseudo, BusError> {
        let failed =
            |error: rustix::io::Errno| BusError::Open("a pseudo-terminal".to_owned(), error.into());
        let fd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
            .map_err(failed)?;
        grantpt(&fd).map_err(failed)?;
        unlockpt(&fd).map_err(failed)?;
        let name = ptsname(&fd, Vec::new()).map_err(failed)?.to_string_lossy().into_owned();
        let host = rustix::fs::open(
            name.as_str(),
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC,
            Mode::empty(),
        )
        .map_err(failed)?;
        let mut terminal = tcgetattr(&host).map_err(failed)?;
        terminal.make_raw();
        tcsetattr(&host, OptionalActions::Now, &terminal).map_err(failed)?;
        fcntl_setfl(&fd, fcntl_getfl(&fd).map_err(failed)? | OFlags::NONBLOCK).map_err(failed)?;
        Ok(Pseudo {
            port: LinePort::new(name, fd),
            _host: host,
            open: false,
            listen_only: false,
            off: false,
        })
    }

    /// Path of the host's end.
    pub fn path(&self) -> &str {
        &self.port.name
    }

    /// An answer; a host that reads none loses it.
    fn answer(&mut self, line: &[u8]) -> Result<(), BusError> {
        self.port.send_line(line).map(drop)
    }
}

impl Bus for Pseudo {
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        if !self.open || self.off {
            return Ok(Sent::Dropped);
        }
        self.port.send(frame)
    }

    fn next(&mut self) -> Result<Option<Heard>, BusError> {
        loop {
            let Some(line) = self.port.next()? else { return Ok(None) };
            match line {
                Line::Frame(frame) if self.open && !self.listen_only && !self.off => {
                    let taken = if matches!(frame.id, Id::Standard(_)) { b"z\r" } else { b"Z\r" };
                    self.answer(taken)?;
                    return Ok(Some(Heard::Frame(frame)));
                }
                Line::Remote if self.open => self.answer(b"\r")?,
                Line::Open | Line::ListenOnly if !self.open => {
                    (self.open, self.listen_only) = (true, line == Line::ListenOnly);
                    self.answer(b"\r")?;
                }
                Line::Close => {
                    self.open = false;
                    self.answer(b"\r")?;
                }
                Line::Version => self.answer(b"V1013\r")?,
                Line::SerialNumber => self.answer(b"NSARR\r")?,
                Line::Status => self.answer(if self.off { b"F80\r" } else { b"F00\r" })?,
                Line::Bitrate(_) | Line::DataBitrate(_) | Line::Setting(_) if !self.open => {
                    self.answer(b"\r")?
                }
                Line::Done => self.answer(b"\r")?,
                _ => self.answer(b"\x07")?,
            }
        }
    }

    fn backlog(&self) -> u32 {
        self.port.backlog()
    }

    fn readable(&self) -> Option<BorrowedFd<'_>> {
        Some(self.port.fd.as_fd())
    }

    fn pretend(&mut self, event: BusEvent) -> Result<bool, BusError> {
        let line: &[u8] = match event {
            BusEvent::ErrorActive | BusEvent::Restarted => b"sa000000\r",
            BusEvent::ErrorWarning => b"sw000100\r",
            BusEvent::ErrorPassive => b"sp000130\r",
            BusEvent::BusOff => b"sb000255\r",
            BusEvent::Overrun(_) => b"e1o\r",
            BusEvent::Dropped(_) | BusEvent::Backlog(_) | BusEvent::Late => return Ok(false),
        };
        self.off = match event {
            BusEvent::BusOff => true,
            BusEvent::ErrorActive | BusEvent::Restarted => false,
            _ => self.off,
        };
        self.answer(line)?;
        Ok(true)
    }
}
