//! Settings of a drive by SDO before it gets power, one request at a time, and their read-back.

use crate::drive::{Mode, Parameter, Receipt, Watchdog};
use crate::frame::{Frame, Id};
use crate::protocol::fault;
use crate::state::state;

/// An unanswered request is sent again after this time `[ns]`.
const TIMEOUT_NS: u64 = 50_000_000;
/// The unit of 60C2 as drives are delivered, which many of them do not change.
const MILLISECONDS: u32 = -3_i8 as u8 as u32;
/// Requests for a mode that is not shown, one timeout apart: before the start, after it.
const TRIES: [u8; 2] = [5, 25];
/// Answers without any mode after the start, after which a drive may get power without one.
const TRIES_OF_NONE: u8 = 5;
/// Relative deviation allowed between rated and configured torque: the object is in whole mN m.
const SAME_TORQUE: f64 = 1e-3;

/// Objects with subindex 0.
pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter::whole(0x1000, "1000 device type", ""),
    Parameter::signed(0x6061, "6061 mode", ""),
    Parameter::whole(0x6076, "6076 rated torque", "mN m"),
    Parameter::whole(0x6075, "6075 rated current", "mA"),
    Parameter::whole(0x6072, "6072 largest torque", "‰"),
    Parameter::whole(0x603F, "603F error code", ""),
    Parameter::signed(0x6064, "6064 position", "counts"),
    Parameter::whole(0x6079, "6079 voltage", "mV"),
];

/// The desired settings of the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Desired {
    pub(super) node: u16,
    pub(super) master: u16,
    pub(super) mode: Mode,
    pub(super) watchdog_ms: u16,
    /// Thousandths of the rated torque; not finite without one.
    pub(super) torque_limit: f64,
    /// `[N m]`
    pub(super) rated_torque: f64,
    pub(super) torque_offset: bool,
    pub(super) velocity_feedback: bool,
    pub(super) configure: bool,
    /// 0 where it is not known.
    pub(super) period_ns: u64,
}

impl Desired {
    /// Object 6072.
    fn most_torque(&self) -> Option<u32> {
        self.torque_limit.is_finite().then(|| self.torque_limit.clamp(0.0, 65_535.0) as u32)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// An NMT command; has no answer.
    Network(u8),
    /// Index, subindex, bytes, value; the drive has to take it.
    Write(u16, u8, u8, u32),
    /// Writes an object that not all drives have.
    Offer(u16, u8, u8, u32),
    /// An object that is assessed when it was read.
    Read(u16, u8),
    /// The mode that the drive shows, unless it was shown already; if it is not after so many
    /// answers the set-up goes on, or, where it is the last chance, has failed.
    ReadMode(u8, bool),
}

#[derive(Debug)]
pub(super) struct Setup {
    desired: Desired,
    steps: Vec<Step>,
    next: usize,
    sent_ns: Option<u64>,
    /// Answers without the desired mode.
    n_tries: u8,
    /// The last value of 6061.
    shown: u32,
    pub(super) watchdog: Watchdog,
    /// The fault, or 0.
    pub(super) fault: u32,
}

/// An expedited write of `len` bytes.
pub(super) fn write(node: u16, index: u16, sub: u8, len: u8, value: u32) -> Option<Frame> {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
    Frame::classic(
        Id::Standard(0x600 + node),
        &[0x23 | (4 - len.clamp(1, 4)) << 2, low, high, sub, a, b, c, d],
    )
}

/// A read.
pub(super) fn read(node: u16, index: u16, sub: u8) -> Option<Frame> {
    let [low, high] = index.to_le_bytes();
    Frame::classic(Id::Standard(0x600 + node), &[0x40, low, high, sub, 0, 0, 0, 0])
}

const fn mode_of(mode: Mode) -> u8 {
    match mode {
        Mode::Position => 8,
        Mode::Velocity => 9,
        Mode::Torque | Mode::Impedance => 10,
    }
}

/// A time as 60C2 holds it: value × 10^exponent s, exactly if that can be.
fn interpolation(period_ns: u64) -> (u8, i8) {
    let scaled = |exponent: i8| period_ns as f64 * 10_f64.powi(-9 - i32::from(exponent));
    let fits = |exponent: &i8| (0.5..255.5).contains(&scaled(*exponent));
    let is_exact = |exponent: &i8| {
        fits(exponent) && (scaled(*exponent) - scaled(*exponent).round()).abs() < 1e-6
    };
    let exponent = [-3, -2, -1, 0, -4, -5, -6]
        .into_iter()
        .find(is_exact)
        .or_else(|| (-6..=0).find(fits))
        .unwrap_or(-3);
    (scaled(exponent).round() as u8, exponent)
}

/// A PDO at `communication` and `mapping` that goes with SYNC and holds these objects; without any
/// it is off.
fn pdo(communication: u16, mapping: u16, id: u32, objects: &[u32], steps: &mut Vec<Step>) {
    const OFF: u32 = 1 << 31;
    if objects.is_empty() {
        return steps.push(Step::Offer(communication, 1, 4, OFF | id));
    }
    steps.push(Step::Write(communication, 1, 4, OFF | id));
    steps.push(Step::Write(communication, 2, 1, 1));
    steps.push(Step::Write(mapping, 0, 1, 0));
    for (i, object) in objects.iter().enumerate() {
        steps.push(Step::Write(mapping, i as u8 + 1, 4, *object));
    }
    steps.push(Step::Write(mapping, 0, 1, objects.len() as u32));
    steps.push(Step::Write(communication, 1, 4, id));
}

impl Setup {
    pub(super) fn new(desired: Desired) -> Setup {
        let node = u32::from(desired.node);
        let mut steps = vec![Step::Network(0x80), Step::Write(0x6040, 0, 2, 0)];
        if desired.configure {
            let target = match desired.mode {
                Mode::Position => 0x607A_0020,
                Mode::Velocity => 0x60FF_0020,
                Mode::Torque | Mode::Impedance => 0x6071_0010,
            };
            let command = [0x6040_0010, target, 0x60B2_0010];
            let n_objects = if desired.torque_offset { 3 } else { 2 };
            pdo(
                0x1400,
                0x1600,
                0x200 + node,
                command.get(..n_objects).unwrap_or_default(),
                &mut steps,
            );
            pdo(0x1800, 0x1A00, 0x180 + node, &[0x6041_0010, 0x6064_0020, 0x6077_0010], &mut steps);
            pdo(
                0x1801,
                0x1A01,
                0x280 + node,
                if desired.velocity_feedback { &[0x606C_0020] } else { &[] },
                &mut steps,
            );
        }
        steps.push(Step::Write(0x6060, 0, 1, u32::from(mode_of(desired.mode))));
        let has_own_loops = desired.mode.has_own_loops();
        if desired.period_ns > 0 && has_own_loops {
            let (value, exponent) = interpolation(desired.period_ns);
            steps.push(Step::Offer(0x60C2, 2, 1, u32::from(exponent as u8)));
            steps.push(Step::Offer(0x60C2, 1, 1, u32::from(value)));
        }
        // in the mode torque the targets themselves are within the limit
        let limit = desired.most_torque();
        match (limit, has_own_loops) {
            (Some(limit), true) => steps.push(Step::Write(0x6072, 0, 2, limit)),
            (Some(limit), false) => steps.push(Step::Offer(0x6072, 0, 2, limit)),
            (None, _) => {}
        }
        if desired.watchdog_ms > 0 {
            steps.push(Step::Offer(0x6007, 0, 2, 2));
            steps.push(Step::Write(
                0x1016,
                1,
                4,
                u32::from(desired.master) << 16 | u32::from(desired.watchdog_ms),
            ));
        }
        if limit.is_some() && has_own_loops {
            steps.push(Step::Read(0x6072, 0));
        }
        let read_back = [(0x1016, 1), (0x6007, 0), (0x6076, 0)];
        steps.extend(read_back.map(|(index, sub)| Step::Read(index, sub)));
        let [before, after] = TRIES;
        steps.extend([
            Step::ReadMode(before, false),
            Step::Network(0x01),
            Step::ReadMode(after, true),
        ]);
        Setup {
            desired,
            steps,
            next: 0,
            sent_ns: None,
            n_tries: 0,
            shown: 0,
            watchdog: Watchdog::Unknown,
            fault: 0,
        }
    }

    /// Begins again.
    pub(super) fn again(&mut self) {
        (self.next, self.sent_ns, self.watchdog, self.fault) = (0, None, Watchdog::Unknown, 0);
        (self.n_tries, self.shown) = (0, 0);
    }

    /// Whether the drive may get power.
    pub(super) fn is_done(&self) -> bool {
        self.next == self.steps.len() || self.shows_none()
    }

    /// It may be a drive that shows its mode only with power.
    fn shows_none(&self) -> bool {
        let is_last = matches!(self.steps.get(self.next), Some(Step::ReadMode(_, true)));
        is_last && self.shown == 0 && self.n_tries >= TRIES_OF_NONE
    }

    /// Whether the drive has shown the desired mode.
    pub(super) fn is_mode_shown(&self) -> bool {
        self.shown == u32::from(mode_of(self.desired.mode))
    }

    /// The next request, or the last one again when it was not answered. A drive that shows no mode
    /// is asked with power only.
    pub(super) fn request(&mut self, now_ns: u64, has_power: bool) -> Option<Frame> {
        if self.fault != 0
            || !has_power && self.shows_none()
            || self.sent_ns.is_some_and(|sent| now_ns.saturating_sub(sent) < TIMEOUT_NS)
        {
            return None;
        }
        let node = self.desired.node;
        self.sent_ns = Some(now_ns);
        match *self.steps.get(self.next)? {
            Step::Network(command) => {
                self.proceed();
                if self.is_mode_shown() {
                    // the second look at the mode is not needed
                    self.next = self.steps.len().min(self.next + 1);
                }
                Frame::classic(Id::Standard(0), &[command, node as u8])
            }
            Step::Write(index, sub, len, value) | Step::Offer(index, sub, len, value) => {
                write(node, index, sub, len, value)
            }
            Step::Read(index, sub) => read(node, index, sub),
            Step::ReadMode(..) => read(node, 0x6061, 0),
        }
    }

    fn proceed(&mut self) {
        self.next += 1;
        self.sent_ns = None;
    }

    /// Takes an answer of the SDO server.
    pub(super) fn answered(&mut self, bytes: [u8; 8]) -> Receipt {
        let [command, low, high, sub, a, b, c, d] = bytes;
        let index = u16::from_le_bytes([low, high]);
        let is_refused = command == 0x80;
        // expedited, with as many bytes as its bits 2 and 3 leave
        let n_bytes = if command & 0x01 != 0 { 4 - (command >> 2 & 3) } else { 4 };
        let value = u32::from_le_bytes([a, b, c, d]) & (u32::MAX >> (8 * (4 - u32::from(n_bytes))));
        let is_read = command & 0xE2 == 0x42;
        let is_written = command == 0x60;
        let step = self.steps.get(self.next).copied();
        let is_answer = match step {
            Some(Step::Write(i, s, ..) | Step::Offer(i, s, ..)) => {
                (i, s) == (index, sub) && (is_refused || is_written)
            }
            Some(Step::Read(i, s)) => (i, s) == (index, sub) && (is_refused || is_read),
            Some(Step::ReadMode(..)) => (index, sub) == (0x6061, 0) && (is_refused || is_read),
            Some(Step::Network(_)) | None => false,
        };
        let held = (!is_refused).then_some(value);
        match step.filter(|_| is_answer) {
            Some(Step::Write(..)) if is_refused => {
                let is_limit = index == 0x6072;
                self.fault = if is_limit { fault::LIMIT_REFUSED } else { fault::SETTING_REFUSED };
            }
            Some(Step::Offer(_, _, _, value)) => {
                // a number in a unit that the drive has not is no time: it keeps its own
                let is_unit = (index, sub) == (0x60C2, 2) && value != MILLISECONDS;
                self.proceed();
                if is_refused && is_unit {
                    self.proceed();
                }
            }
            Some(Step::Read(..)) => {
                self.assess(index, held);
                self.proceed();
            }
            Some(Step::ReadMode(tries, is_last)) => self.show(tries, is_last, held),
            Some(Step::Write(..) | Step::Network(_)) => self.proceed(),
            None => {}
        }
        if !is_read {
            return if is_refused || is_written { Receipt::Noted } else { Receipt::Malformed };
        }
        match sub {
            0 => Parameter::receipt(PARAMETERS, u32::from(index), value, 8 * u32::from(n_bytes)),
            _ => Receipt::Noted,
        }
    }

    /// Takes a value of 6061.
    fn show(&mut self, tries: u8, is_last: bool, value: Option<u32>) {
        self.n_tries += 1;
        self.shown = value.unwrap_or_default();
        if value.is_none() {
            self.fault = fault::SETTING_REFUSED;
        } else if self.is_mode_shown() {
            self.proceed();
        } else if self.n_tries < tries {
            // asked again after the timeout
        } else if is_last {
            self.fault = fault::MODE_REFUSED;
        } else {
            self.n_tries = 0;
            self.proceed();
        }
    }

    fn assess(&mut self, index: u16, value: Option<u32>) {
        match (index, value) {
            (0x1016, Some(value)) => {
                let is_ours = value >> 16 & 0x7F == u32::from(self.desired.master);
                self.watchdog = if is_ours && value & 0xFFFF > 0 {
                    Watchdog::Set(value & 0xFFFF)
                } else {
                    Watchdog::Off
                };
            }
            (0x1016, None) => self.watchdog = Watchdog::Unreadable,
            // reaction to a late heartbeat: none; fault, no voltage or quick stop; the maker's own
            (0x6007, Some(0)) => self.watchdog = Watchdog::Off,
            (0x6007, Some(1..=3)) => {}
            (0x6007, _) if matches!(self.watchdog, Watchdog::Set(_)) => {
                self.watchdog = Watchdog::Unreadable
            }
            (0x6076, Some(value)) => {
                let read = f64::from(value) / 1000.0;
                let configured = self.desired.rated_torque;
                if (read - configured).abs() > SAME_TORQUE * configured + 1e-3 {
                    self.fault = fault::RANGES_DIFFER;
                }
            }
            (0x6072, value)
                if value.zip(self.desired.most_torque()).is_none_or(|(held, most)| held > most) =>
            {
                self.fault = fault::LIMIT_REFUSED;
            }
            (0x6076, None) => self.fault = fault::SETTING_REFUSED,
            _ => {}
        }
    }
}

state!(Setup { next, sent_ns, n_tries, shown, watchdog, fault; desired, steps });
