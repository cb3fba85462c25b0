//! A bus whose adapter may go away and come back.

use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::frame::Frame;

use super::{Address, Bus, BusError, Heard, Sent, open};
use crate::stderr::say;

/// Time between two attempts to open a bus that is gone.
const REOPEN: Duration = Duration::from_millis(500);

/// Opens the bus, at the start and after each loss.
type Open = Box<dyn FnMut() -> Result<Box<dyn Bus>, BusError> + Send>;

/// A bus that is off while its adapter is gone. It drops the frames that it is given meanwhile and
/// is opened again when the adapter is back.
pub struct Reconnecting {
    name: String,
    open: Open,
    /// `None` while the adapter is gone.
    port: Option<Box<dyn Bus>>,
    /// Time of the last attempt to open it.
    tried: Instant,
    /// The last message about it.
    said: String,
    /// An event that is not reported yet.
    news: Option<BusEvent>,
}

impl Reconnecting {
    /// Opens the bus of an address, which must be there; messages begin with `name`.
    pub fn open(name: &str, address: Address) -> Result<Reconnecting, BusError> {
        Reconnecting::with(name, Box::new(move || open(&address)))
    }

    /// Opens a bus by a function, which is called again after each loss.
    pub fn with(name: &str, mut open: Open) -> Result<Reconnecting, BusError> {
        let port = Some(open()?);
        Ok(Reconnecting {
            name: name.to_owned(),
            open,
            port,
            tried: Instant::now(),
            said: String::new(),
            news: None,
        })
    }

    fn lose(&mut self, error: &BusError) {
        self.port = None;
        self.tried = Instant::now();
        self.news = Some(BusEvent::BusOff);
        self.report(error.to_string());
    }

    /// Opens the bus again if the last attempt is long enough ago.
    fn reopen(&mut self) {
        if self.tried.elapsed() < REOPEN {
            return;
        }
        let opened = (self.open)();
        self.tried = Instant::now();
        match opened {
            Ok(port) => {
                self.report("open again".to_owned());
                self.port = Some(port);
                self.news = Some(BusEvent::Restarted);
            }
            Err(error) => self.report(error.to_string()),
        }
    }

    /// Reports a message unless it repeats the last one. Messages of some drivers begin with the
    /// bus's name.
    fn report(&mut self, message: String) {
        if self.said != message {
            if message.starts_with(&self.name) {
                say(format_args!("{message}"));
            } else {
                say(format_args!("{}: {message}", self.name));
            }
            self.said = message;
        }
    }
}

impl Bus for Reconnecting {
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        match self.port.as_mut().map(|port| port.send(frame)) {
            Some(Ok(sent)) => return Ok(sent),
            Some(Err(error)) => self.lose(&error),
            None => {}
        }
        Ok(Sent::Dropped)
    }

    fn flush(&mut self) -> u32 {
        self.port.as_mut().map_or(0, |port| port.flush())
    }

    fn next(&mut self) -> Result<Option<Heard>, BusError> {
        if self.news.is_none() {
            match self.port.as_mut().map(|port| port.next()) {
                Some(Ok(heard)) => return Ok(heard),
                Some(Err(error)) => self.lose(&error),
                None => self.reopen(),
            }
        }
        Ok(self.news.take().map(Heard::Event))
    }

    fn heard_ns(&self) -> Option<u64> {
        self.port.as_ref().and_then(|port| port.heard_ns())
    }

    fn backlog(&self) -> u32 {
        self.port.as_ref().map_or(0, |port| port.backlog())
    }

    fn readable(&self) -> Option<BorrowedFd<'_>> {
        self.port.as_ref().and_then(|port| port.readable())
    }

    fn is_mute(&self) -> bool {
        self.port.as_ref().is_some_and(|port| port.is_mute())
    }

    fn pretend(&mut self, event: BusEvent) -> Result<bool, BusError> {
        self.port.as_mut().map_or(Ok(false), |port| port.pretend(event))
    }
}
