//! MyActuator RMD: the single motor commands of servo protocol V4.2, which V3 drives know too.
//!
//! Source: MyActuator, *Motor Motion Protocol V4.2*.
//!
//! - Sent on 140 + id, answered on 240 + id; 8 bytes, the first one is the command, numbers are
//!   little-endian. A1 torque: current i16 at 4 [.01 A]. 80 output off. 77 and 78 the holding brake
//!   is opened, is closed. 92 angle at the output. 9A and 9C states. B3 time without commands u32
//!   at 4 [ms] after which the drive turns its output off; 0 none.
//! - Answers: A1 and 9C temperature i8 at 1, current i16 at 2 [.01 A], speed i16 at 4 [°/s], angle
//!   i16 at 6 [°]. 92 angle i32 at 4 [.01°]. 9A temperature i8 at 1, voltage u16 at 4 [.1 V],
//!   faults u16 at 6. 77, 78, 80 and B3 are answered by the same bytes; so is the first torque
//!   after B3's time has passed, which the drive does not follow.
//!
//! The torque is `motor_torque_constant` N m/A at the output. A position comes with each 92; the
//! speed and the torque beside it come from the previous answer. Faults are requested continuously.
//! Power is not reported: two answers to torques count as power. B3 is kept in the drive's ROM: it
//! is written until it is answered, at most three times, and again only after a silence. The
//! drive's own loops of speed and position (A2, A4) are left out: the protocol has no torque limit
//! for them.

use super::keys::motor_torque_constant;
use super::number::{limited, steps_toward_zero};
use super::power_up::{Action, PowerUp};
use super::{Common, Key, Made, Protocol, Settings};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Parameter, Receipt, Reply, Setpoint,
    Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::state::state;
use sarrus_models::Diagnostics;

/// MyActuator RMD.
pub(super) const RMD: Protocol = Protocol {
    name: "rmd",
    about: "MyActuator RMD (torque)",
    modes: &[Mode::Torque],
    fd: false,
    keys: &[
        Key::integer("id", 1, 32, "number of the motor"),
        motor_torque_constant("torque at the output for the current that the drive says [N m/A]"),
    ],
    make,
};

const OFF: u8 = 0x80;
const OPEN_BRAKE: u8 = 0x77;
const CLOSE_BRAKE: u8 = 0x78;
const ANGLE: u8 = 0x92;
const FAULTS: u8 = 0x9A;
const STATE: u8 = 0x9C;
const TORQUE: u8 = 0xA1;
const TIMEOUT: u8 = 0xB3;

/// A step of a current `[A]`, and of an angle `[°]`.
const STEP: f64 = 0.01;
/// Answers to torques after which the motor counts as having power.
const REPLIES_TO_POWER: u8 = 2;
/// How often the watchdog is written at most.
const WRITES: u8 = 3;
/// Time between two questions for faults while it has power `[ns]`.
const FAULTS_NS: u64 = 20_000_000;

const PARAMETERS: &[Parameter] = &[Parameter::whole(FAULTS as u32, "voltage", "V")];

#[derive(Debug)]
struct Rmd {
    id: u16,
    constant: f64,
    common: Common,
    watchdog: Watchdog,
    n_written: u8,
    power_up: PowerUp,
    is_known: bool,
    fault: u32,
    asked_ns: Option<u64>,
    /// The last torque that was sent.
    sent: [u8; 8],
    /// Velocity, torque and temperature as last reported.
    measured: Measurement,
}

fn make(settings: &Settings, common: Common, _diagnostics: &mut Diagnostics) -> Made {
    Some(Box::new(Rmd {
        id: settings.integer("id") as u16,
        constant: settings.number("motor_torque_constant"),
        common,
        watchdog: unknown(common.watchdog_ms),
        n_written: 0,
        power_up: PowerUp::primed(),
        is_known: false,
        fault: 0,
        asked_ns: None,
        sent: [0; 8],
        measured: Measurement::NONE,
    }))
}

const fn unknown(watchdog_ms: u32) -> Watchdog {
    if watchdog_ms > 0 { Watchdog::Unknown } else { Watchdog::Unreadable }
}

impl Rmd {
    fn frame(&self, bytes: [u8; 8]) -> Option<Frame> {
        Frame::classic(Id::Standard(0x140 + self.id), &bytes)
    }

    fn command(&self, command: u8) -> Option<Frame> {
        self.frame([command, 0, 0, 0, 0, 0, 0, 0])
    }

    fn torque_bytes(&self, torque: f64) -> [u8; 8] {
        let current = limited(torque, self.common.torque_limit) / self.constant;
        let [low, high] = (steps_toward_zero(current, STEP, 32_767) as i16).to_le_bytes();
        [TORQUE, 0, 0, 0, low, high, 0, 0]
    }

    fn follow(&mut self, torque: f64, out: &mut FrameQueue) {
        self.sent = self.torque_bytes(torque);
        out.push_some(self.frame(self.sent));
    }

    fn timeout_bytes(&self) -> [u8; 8] {
        let [a, b, c, d] = self.common.watchdog_ms.to_le_bytes();
        [TIMEOUT, 0, 0, 0, a, b, c, d]
    }

    /// Frames without power: off, brake, faults, watchdog and state, in turn.
    fn idle(&mut self, n: u64) -> Option<Frame> {
        match n % 5 {
            1 => self.command(OFF),
            2 => self.command(CLOSE_BRAKE),
            3 => self.command(FAULTS),
            4 if self.watchdog == Watchdog::Unknown && self.n_written < WRITES => {
                self.n_written += 1;
                self.frame(self.timeout_bytes())
            }
            _ => self.command(STATE),
        }
    }

    fn take_state(&mut self, bytes: [u8; 8]) {
        let [_, temperature, i_low, i_high, v_low, v_high, ..] = bytes;
        let whole = |low, high| f64::from(i16::from_le_bytes([low, high]));
        self.measured.temperature = f64::from(temperature as i8);
        self.measured.torque = whole(i_low, i_high) * STEP * self.constant;
        self.measured.velocity = whole(v_low, v_high).to_radians();
    }
}

impl Drive for Rmd {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        let is_ready = self.is_known && self.fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(n) => out.push_some(self.idle(n)),
            Action::Reset => {
                self.fault = 0;
                out.push_some(self.command(FAULTS));
            }
            Action::Withhold => out.push_some(self.command(OFF)),
            // a torque of zero, with which the brake is opened a cycle later
            Action::Prime(_) => self.follow(0.0, out),
            Action::Ask(setpoint) => {
                out.push_some(self.command(OPEN_BRAKE));
                self.follow(setpoint.torque, out);
            }
            Action::Await(setpoint) | Action::Follow(setpoint) => {
                self.follow(setpoint.torque, out);
                if self.asked_ns.is_none_or(|asked| now_ns.saturating_sub(asked) >= FAULTS_NS) {
                    self.asked_ns = Some(now_ns);
                    out.push_some(self.command(FAULTS));
                }
            }
        }
        out.push_some(self.command(ANGLE));
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.frame(self.torque_bytes(setpoint.torque)));
        out.push_some(self.command(ANGLE));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.command(OFF));
        out.push_some(self.command(CLOSE_BRAKE));
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        if frame.id == Id::Standard(0x140 + self.id) {
            return Receipt::Foreign;
        }
        if frame.id != Id::Standard(0x240 + self.id) {
            return Receipt::NotMine;
        }
        let Some(bytes) = frame.exactly::<8>().filter(|_| !frame.is_fd()) else {
            return Receipt::Malformed;
        };
        let [what, .., a, b, c, d] = bytes;
        match what {
            // not followed
            TORQUE if bytes == self.sent => Receipt::Noted,
            TORQUE => {
                self.take_state(bytes);
                self.power_up.count_reply(REPLIES_TO_POWER);
                Receipt::Noted
            }
            STATE => {
                self.take_state(bytes);
                self.is_known = true;
                Receipt::Noted
            }
            FAULTS => {
                self.fault = u32::from(u16::from_le_bytes([c, d]));
                if self.fault != 0 {
                    self.power_up.lose();
                }
                Receipt::Parameter(0, f64::from(u16::from_le_bytes([a, b])) * 0.1)
            }
            TIMEOUT if bytes == self.timeout_bytes() && self.common.watchdog_ms > 0 => {
                self.watchdog = Watchdog::Set(self.common.watchdog_ms);
                Receipt::Noted
            }
            ANGLE => Receipt::Measured(Measurement {
                position: (f64::from(i32::from_le_bytes([a, b, c, d])) * STEP).to_radians(),
                ..self.measured
            }),
            _ => Receipt::Noted,
        }
    }

    fn state(&self) -> DriveState {
        let power = self.power_up.power(self.is_known);
        DriveState { power, fault: self.fault, watchdog: self.watchdog }
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.is_known, self.fault, self.asked_ns) = (false, 0, None);
        (self.watchdog, self.n_written) = (unknown(self.common.watchdog_ms), 0);
        self.measured = Measurement::NONE;
    }

    fn identifiers(&self) -> Vec<Id> {
        vec![Id::Standard(0x140 + self.id), Id::Standard(0x240 + self.id)]
    }

    fn steps(&self) -> Setpoint {
        Setpoint::of_motion(STEP.to_radians(), 1_f64.to_radians(), STEP * self.constant)
    }

    fn replies(&self) -> Vec<Reply> {
        vec![Reply::classic(Id::Standard(0x240 + self.id), 8); 2]
    }

    fn heartbeat(&self) -> Option<(Frame, u64)> {
        Some((self.command(FAULTS)?, FAULTS_NS))
    }

    fn probe(&mut self, out: &mut FrameQueue) {
        out.push_some(self.command(STATE));
    }

    fn parameters(&self) -> &'static [Parameter] {
        PARAMETERS
    }

    fn read_parameter(&mut self, _parameter: usize, out: &mut FrameQueue) {
        out.push_some(self.command(FAULTS));
    }
}

state!(Rmd {
    watchdog, n_written, power_up, is_known, fault, asked_ns, sent, measured; id, constant, common
});
