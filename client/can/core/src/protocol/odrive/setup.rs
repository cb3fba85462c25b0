//! The ODrive's own watchdog: set and read back through its endpoints while the motor has no power.

use crate::drive::{Parameter, Receipt, Watchdog};
use crate::frame::{Frame, Id};
use crate::protocol::number::single;
use crate::state::{state, state_of_enum};

const ENDPOINT: u16 = 0x04;

/// Their endpoints differ from firmware to firmware.
pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter::single(0, "axis0.config.watchdog_timeout", "s"),
    Parameter::whole(0, "axis0.config.enable_watchdog", ""),
];

/// Settings that are written and read, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    WriteTimeout,
    WriteEnable,
    ReadTimeout,
    ReadEnable,
    Done,
}

#[derive(Debug)]
pub(super) struct Setup {
    node: u16,
    /// Endpoints of the watchdog's time and of its switch.
    endpoints: Option<(u16, u16)>,
    watchdog_ms: u32,
    /// The time read back `[s]`.
    time: f64,
    step: Step,
    pub(super) watchdog: Watchdog,
}

impl Setup {
    /// A watchdog of `watchdog_ms`, 0 to leave it unchanged; without endpoints it can be neither
    /// set nor read.
    pub(super) fn new(node: u16, endpoints: Option<(u16, u16)>, watchdog_ms: u32) -> Setup {
        let (step, watchdog) = match (endpoints, watchdog_ms) {
            (None, _) => (Step::Done, Watchdog::Unreadable),
            (Some(_), 0) => (Step::ReadTimeout, Watchdog::Unknown),
            (Some(_), _) => (Step::WriteTimeout, Watchdog::Unknown),
        };
        Setup { node, endpoints, watchdog_ms, time: f64::NAN, step, watchdog }
    }

    /// Begins again.
    pub(super) fn again(&mut self) {
        *self = Setup::new(self.node, self.endpoints, self.watchdog_ms);
    }

    /// Whether all is set and read.
    pub(super) fn is_done(&self) -> bool {
        self.step == Step::Done
    }

    /// The request of this step. A write has no answer: the value that is read afterwards counts.
    pub(super) fn request(&mut self) -> Option<Frame> {
        let (timeout, enable) = self.endpoints?;
        let (frame, next) = match self.step {
            Step::WriteTimeout => {
                let seconds = single(f64::from(self.watchdog_ms) / 1e3);
                (self.frame(1, timeout, &seconds.to_le_bytes()), Step::WriteEnable)
            }
            Step::WriteEnable => (self.frame(1, enable, &[1]), Step::ReadTimeout),
            Step::ReadTimeout => (self.frame(0, timeout, &[]), Step::ReadTimeout),
            Step::ReadEnable => (self.frame(0, enable, &[]), Step::ReadEnable),
            Step::Done => return None,
        };
        self.step = next;
        frame
    }

    /// Asks for a parameter by its place.
    pub(super) fn read_parameter(&self, parameter: usize) -> Option<Frame> {
        let (timeout, enable) = self.endpoints?;
        self.frame(0, if parameter == 0 { timeout } else { enable }, &[])
    }

    /// Parameters that can be read.
    pub(super) fn parameters(&self) -> &'static [Parameter] {
        if self.endpoints.is_some() { PARAMETERS } else { &[] }
    }

    /// 1 writes and 0 reads an endpoint.
    fn frame(&self, write: u8, endpoint: u16, value: &[u8]) -> Option<Frame> {
        let [low, high] = endpoint.to_le_bytes();
        let mut bytes = [write, low, high, 0, 0, 0, 0, 0];
        bytes.iter_mut().skip(4).zip(value).for_each(|(byte, value)| *byte = *value);
        Frame::classic(Id::Standard(self.node << 5 | ENDPOINT), bytes.get(..4 + value.len())?)
    }

    /// The answer of an endpoint.
    pub(super) fn answered(&mut self, endpoint: u16, value: &[u8]) -> Receipt {
        let Some((timeout, enable)) = self.endpoints else { return Receipt::Noted };
        match value {
            [a, b, c, d] if endpoint == timeout => {
                self.time = f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
                if self.step == Step::ReadTimeout {
                    self.step = Step::ReadEnable;
                }
                Receipt::Parameter(0, self.time)
            }
            [on, ..] if endpoint == enable => {
                if self.step == Step::ReadEnable {
                    let ms = self.time * 1e3;
                    self.watchdog = if *on != 0 && ms > 0.0 {
                        Watchdog::Set((ms.round() as u32).max(1))
                    } else {
                        Watchdog::Off
                    };
                    let is_wanted =
                        self.watchdog_ms == 0 || self.watchdog == Watchdog::Set(self.watchdog_ms);
                    self.step = if is_wanted { Step::Done } else { Step::WriteTimeout };
                }
                Receipt::Parameter(1, f64::from(*on))
            }
            _ => Receipt::Noted,
        }
    }
}

state_of_enum!(Step { WriteTimeout, WriteEnable, ReadTimeout, ReadEnable, Done });
state!(Setup { time, step, watchdog; node, endpoints, watchdog_ms });
