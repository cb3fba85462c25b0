//! VESC: single frame commands and status messages.
//!
//! Source: B. Vedder, VESC firmware, documentation/comm_can.md and comm/comm_can.c.
//!
//! - Extended identifier: command in bits 15 … 8, the VESC's `id` in 7 … 0. Numbers are big-endian.
//! - Sent: 1 current i32 [mA], 3 speed i32 [electrical rpm], 4 position i32 [1e-6 °, 0 … 360], 21
//!   least and largest motor current i32 i32 [mA], not stored.
//! - Received by themselves, as configured in VESC Tool: 9 electrical rpm i32, current i16 [.1 A],
//!   duty i16; 16 temperatures of bridge and motor i16 [.1 °C], input current i16, position i16
//!   [.02 °]; 27 tachometer i32, input voltage i16 [.1 V].
//!
//! The current of status 1 is positive where the motor takes power and negative where it gives some
//! back (`mcpwm_foc_get_tot_current_filtered`). The voltage has the sign of the duty cycle, so the
//! product of both signs is that of the torque; with a duty cycle of 0 the torque is unknown.
//!
//! Status 1 and 4 must arrive in each cycle of the bridge. All numbers are the rotor's:
//! `pole_pairs` electrical turns are one rotor turn, and the position is unwrapped over several
//! turns. A current of zero removes power; no message reports this, nor faults. In the modes
//! velocity and position the VESC holds the current limit: it has no answer, so it is repeated
//! without power and sent once more before power. The timeout is an application setting that no
//! single frame reads or sets.

use std::f64::consts::TAU;

use super::keys::{POLE_PAIRS, motor_torque_constant};
use super::number::{limited, steps, steps_toward_zero};
use super::power_up::{Action, PowerUp};
use super::turns::Unwrapped;
use super::{Common, Key, Made, Protocol, Settings};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::state::state;
use sarrus_models::Diagnostics;

/// VESC.
pub(super) const VESC: Protocol = Protocol {
    name: "vesc",
    about: "VESC by its CAN commands and status messages 1, 4 and 5",
    modes: &[Mode::Torque, Mode::Velocity, Mode::Position],
    fd: false,
    keys: &[
        Key::integer("id", 0, 254, "VESC ID of the controller"),
        motor_torque_constant("torque of the motor for its current [N m/A]"),
        POLE_PAIRS,
    ],
    make,
};

const CURRENT: u32 = 1;
const SPEED: u32 = 3;
const POSITION: u32 = 4;
const STATUS_1: u32 = 9;
const STATUS_4: u32 = 16;
const LIMITS: u32 = 21;
const STATUS_5: u32 = 27;

/// A step of a current `[A]`.
const MILLIAMPERE: f64 = 1e-3;
/// Status 1 counts for this time `[ns]`.
const STALE_NS: u64 = 200_000_000;
/// Measurements after which the motor counts as having power: earlier ones may be older than the
/// set-point.
const REPLIES_TO_POWER: u8 = 2;
/// Steps of the position in a turn.
const POSITIONS: i64 = 18_000;

#[derive(Debug)]
struct Vesc {
    id: u32,
    common: Common,
    constant: f64,
    pole_pairs: f64,
    power_up: PowerUp,
    position: Unwrapped,
    /// Velocity and torque of the last status 1, and when it came `[ns]`.
    reported: Measurement,
    reported_ns: Option<u64>,
}

fn make(settings: &Settings, common: Common, _diagnostics: &mut Diagnostics) -> Made {
    Some(Box::new(Vesc {
        id: settings.integer("id") as u32,
        common,
        constant: settings.number("motor_torque_constant"),
        pole_pairs: settings.number("pole_pairs"),
        power_up: PowerUp::primed(),
        position: Unwrapped::new(POSITIONS, POSITIONS / 2),
        reported: Measurement::NONE,
        reported_ns: None,
    }))
}

impl Vesc {
    fn frame(&self, command: u32, number: i32) -> Option<Frame> {
        Frame::classic(Id::Extended(command << 8 | self.id), &number.to_be_bytes())
    }

    fn current(&self, torque: f64) -> i32 {
        let current = limited(torque, self.common.torque_limit) / self.constant;
        steps_toward_zero(current, MILLIAMPERE, i32::MAX)
    }

    fn release(&self) -> Option<Frame> {
        self.frame(CURRENT, 0)
    }

    /// The limit of current for its own loops.
    fn limits(&self) -> Option<Frame> {
        if !self.common.mode.has_own_loops() || self.common.torque_limit.is_infinite() {
            return None;
        }
        let most = self.current(self.common.torque_limit);
        let bytes = [-most, most].map(i32::to_be_bytes);
        Frame::classic(Id::Extended(LIMITS << 8 | self.id), bytes.as_flattened())
    }

    fn is_known(&self) -> bool {
        self.position.whole().is_some()
    }
}

impl Drive for Vesc {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        match self.power_up.action(command, self.is_known()) {
            Action::Idle(n) => {
                out.push_some(self.release());
                if n % 8 == 1 {
                    out.push_some(self.limits());
                }
            }
            Action::Reset | Action::Withhold => out.push_some(self.release()),
            Action::Prime(_) => {
                out.push_some(self.limits());
                out.push_some(self.release());
            }
            Action::Ask(setpoint) | Action::Await(setpoint) | Action::Follow(setpoint) => {
                self.encode(&setpoint, out);
            }
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(match self.common.mode {
            Mode::Torque | Mode::Impedance => self.frame(CURRENT, self.current(setpoint.torque)),
            Mode::Velocity => {
                let turns = setpoint.velocity * 60.0 / TAU;
                self.frame(SPEED, steps(turns * self.pole_pairs, 1.0, i32::MAX))
            }
            Mode::Position => {
                let degrees = setpoint.position.to_degrees().rem_euclid(360.0);
                self.frame(POSITION, steps(degrees, 1e-6, 360_000_000))
            }
        });
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.release());
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let Id::Extended(id) = frame.id else { return Receipt::NotMine };
        if id & 0xFF != self.id {
            return Receipt::NotMine;
        }
        let status = match id >> 8 {
            status @ (STATUS_1 | STATUS_4 | STATUS_5) => status,
            // duty, currents, speed, position, absolute and relative; limits
            0..=4 | 10..=13 | LIMITS | 22 => return Receipt::Foreign,
            _ => return Receipt::NotMine,
        };
        let whole = |high: &u8, low: &u8| i16::from_be_bytes([*high, *low]);
        match (status, frame.data()) {
            _ if frame.is_fd() => Receipt::Malformed,
            (STATUS_1, [a, b, c, d, e, f, g, h]) => {
                let rpm = f64::from(i32::from_be_bytes([*a, *b, *c, *d]));
                self.reported.velocity = rpm / self.pole_pairs * TAU / 60.0;
                let way = match (whole(e, f), whole(g, h)) {
                    (0, _) => 0.0,
                    (_, 0) => f64::NAN,
                    (_, duty) => f64::from(duty.signum()),
                };
                self.reported.torque = way * f64::from(whole(e, f)) * 0.1 * self.constant;
                self.reported_ns = Some(now_ns);
                Receipt::Noted
            }
            (STATUS_4, [a, b, c, d, _, _, g, h]) => {
                let is_old = self
                    .reported_ns
                    .is_none_or(|reported| now_ns.saturating_sub(reported) > STALE_NS);
                let reported = if is_old { Measurement::NONE } else { self.reported };
                self.power_up.count_reply(REPLIES_TO_POWER);
                let code = self.position.follow(i64::from(whole(g, h)));
                let position = code as f64 * TAU / POSITIONS as f64;
                Receipt::Measured(Measurement {
                    position,
                    temperature: f64::from(whole(a, b).max(whole(c, d))) * 0.1,
                    ..reported
                })
            }
            // nothing of it is needed
            (STATUS_5, [_, _, _, _, _, _, ..]) => Receipt::Noted,
            _ => Receipt::Malformed,
        }
    }

    fn state(&self) -> DriveState {
        let power = self.power_up.power(self.is_known());
        DriveState { power, fault: 0, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        self.power_up.forget();
        self.position.forget();
        self.reported_ns = None;
    }

    /// The commands of this side and the messages of the other.
    fn identifiers(&self) -> Vec<Id> {
        [CURRENT, SPEED, POSITION, STATUS_1, STATUS_4, LIMITS, STATUS_5]
            .map(|command| Id::Extended(command << 8 | self.id))
            .to_vec()
    }

    fn steps(&self) -> Setpoint {
        let velocity = TAU / 60.0 / self.pole_pairs;
        Setpoint::of_motion(0.02_f64.to_radians(), velocity, 0.1 * self.constant)
    }

    fn replies(&self) -> Vec<Reply> {
        [STATUS_1, STATUS_4]
            .map(|status| Reply::classic(Id::Extended(status << 8 | self.id), 8))
            .to_vec()
    }
}

state!(Vesc { power_up, position, reported, reported_ns; id, common, constant, pole_pairs });
