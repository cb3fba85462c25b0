//! A bus whose adapter may go away and come back.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::{Duration, Instant};

use rustix::event::{EventfdFlags, eventfd};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::frame::Frame;

use super::{Address, Bus, BusError, Heard, Sent, open};
use crate::stderr::say;

/// A bus that is gone is opened anew this often.
const REOPEN: Duration = Duration::from_millis(500);

/// A bus that is off while its adapter is gone, drops what it is to send meanwhile, and is opened
/// anew when the adapter is there again.
pub(crate) struct Reconnecting {
    name: String,
    interface: String,
    channel: String,
    bitrate: Option<u32>,
    data_bitrate: Option<u32>,
    listen_only: bool,
    /// `None` while the adapter is gone.
    port: Option<Box<dyn Bus>>,
    /// Never readable; what there is to wait for while the adapter is gone.
    nothing: OwnedFd,
    /// When it was last tried to open it.
    tried: Instant,
    /// What was last said of it.
    said: String,
    /// What happened and was not given yet.
    news: Option<BusEvent>,
}

impl Reconnecting {
    /// Opens a bus, which must be there; `name` is for what is said of it.
    pub(crate) fn open(name: &str, address: Address<'_>) -> Result<Reconnecting, BusError> {
        let port = Some(open(address)?);
        let flags = EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC;
        let nothing =
            eventfd(0, flags).map_err(|error| BusError::Open(name.to_owned(), error.into()))?;
        let Address { interface, channel, bitrate, data_bitrate, listen_only } = address;
        let [name, interface, channel] = [name, interface, channel].map(str::to_owned);
        Ok(Reconnecting {
            name,
            interface,
            channel,
            bitrate,
            data_bitrate,
            listen_only,
            port,
            nothing,
            tried: Instant::now(),
            said: String::new(),
            news: None,
        })
    }

    fn lose(&mut self, error: &BusError) {
        (self.port, self.tried, self.news) = (None, Instant::now(), Some(BusEvent::BusOff));
        self.say(error.to_string());
    }

    /// Opens the bus anew, not too often.
    fn reopen(&mut self) {
        if self.tried.elapsed() < REOPEN {
            return;
        }
        self.tried = Instant::now();
        let (interface, channel) = (self.interface.as_str(), self.channel.as_str());
        let Reconnecting { bitrate, data_bitrate, listen_only, .. } = *self;
        match open(Address { interface, channel, bitrate, data_bitrate, listen_only }) {
            Ok(port) => {
                self.say("open again".to_owned());
                (self.port, self.news) = (Some(port), Some(BusEvent::Restarted));
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// Says something once.
    fn say(&mut self, what: String) {
        if self.said != what {
            say(format_args!("{}: {what}", self.name));
            self.said = what;
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

    fn backlog(&self) -> u32 {
        self.port.as_ref().map_or(0, |port| port.backlog())
    }

    fn readable(&self) -> BorrowedFd<'_> {
        self.port.as_ref().map_or(self.nothing.as_fd(), |port| port.readable())
    }

    fn pretend(&mut self, event: BusEvent) -> Result<bool, BusError> {
        self.port.as_mut().map_or(Ok(false), |port| port.pretend(event))
    }
}
