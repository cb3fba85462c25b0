//! T-Motor (CubeMars) AK series in its servo mode: current commands and the uploaded state.
//!
//! Source: CubeMars, *AK series actuator driver manual* V1.0.8, chapters 5.1 and 5.2.1.
//!
//! - Extended identifier: command in bits 28 … 8, the motor's `id` in 7 … 0. Numbers are
//!   big-endian. Sent: 1 current i32 [mA], 5 zero here (0: until the supply is away).
//! - Uploaded by the motor, at 1 to 500 Hz as configured, as message `upload`: position i16 [.1° of
//!   the output], speed i16 [10 electrical rpm], current i16 [.01 A], temperature i8, fault u8.
//!
//! The torque is `motor_torque_constant` N m/A at the output; `pole_pairs` × `reduction` electrical
//! turns are one of the output. A current of zero removes power, which no message reports. The
//! motor's own loops of speed and position (3, 4, 6) are left out: the protocol has no torque limit
//! for them. Beyond ± 3200° the motor reports no position. Nothing reads or sets its timeout.

use std::f64::consts::TAU;

use super::keys::{POLE_PAIRS, motor_torque_constant};
use super::number::{limited, steps_toward_zero};
use super::power_up::{Action, PowerUp};
use super::{Common, Key, Made, Protocol, Settings, fault};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::state::state;
use sarrus_models::Diagnostics;

/// T-Motor AK in servo mode.
pub(super) const AK_SERVO: Protocol = Protocol {
    name: "ak_servo",
    about: "T-Motor (CubeMars) AK in servo mode (torque)",
    modes: &[Mode::Torque],
    fd: false,
    keys: &[
        Key::integer("id", 0, 255, "number of the motor"),
        Key::integer("upload", 0, 0xFF, "command in the identifier of the uploaded state")
            .or("0x29"),
        motor_torque_constant("torque at the output for the motor's current [N m/A]"),
        POLE_PAIRS,
        Key::number("reduction", 1e-3, 1e6, "turns of the rotor in one of the output"),
    ],
    make,
};

const CURRENT: u32 = 1;
const ZERO: u32 = 5;
/// A step of a current `[A]`.
const MILLIAMPERE: f64 = 1e-3;
/// The largest current of the manual `[mA]`.
const MOST: i32 = 60_000;
/// The last code of a position.
const END: i16 = 32_000;
/// States after which the motor counts as having power: earlier ones may be older than the
/// set-point.
const REPLIES_TO_POWER: u8 = 2;

#[derive(Debug)]
struct AkServo {
    id: u32,
    upload: u32,
    torque_limit: f64,
    constant: f64,
    /// rad/s of the output for an electrical rpm.
    speed: f64,
    power_up: PowerUp,
    is_known: bool,
    is_outside: bool,
    fault: u32,
}

fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    let upload = settings.integer("upload") as u32;
    if upload <= 6 {
        let found = format!("`upload` is {upload}, which is a command");
        let expected = "the number in the identifier of the uploaded state";
        return settings.wrong(diagnostics, "upload", found, expected, "correct it");
    }
    let electrical = settings.number("pole_pairs") * settings.number("reduction");
    Some(Box::new(AkServo {
        id: settings.integer("id") as u32,
        upload,
        torque_limit: common.torque_limit,
        constant: settings.number("motor_torque_constant"),
        speed: TAU / 60.0 / electrical,
        power_up: PowerUp::at_once(),
        is_known: false,
        is_outside: false,
        fault: 0,
    }))
}

impl AkServo {
    fn current(&self, torque: f64) -> Option<Frame> {
        let current = limited(torque, self.torque_limit) / self.constant;
        let bytes = steps_toward_zero(current, MILLIAMPERE, MOST).to_be_bytes();
        Frame::classic(Id::Extended(CURRENT << 8 | self.id), &bytes)
    }
}

impl Drive for AkServo {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        let is_ready = self.is_known && self.state().fault == 0;
        let torque = match self.power_up.action(command, is_ready) {
            Action::Ask(setpoint) | Action::Await(setpoint) | Action::Follow(setpoint) => {
                setpoint.torque
            }
            _ => 0.0,
        };
        out.push_some(self.current(torque));
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.current(setpoint.torque));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.current(0.0));
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        let Id::Extended(id) = frame.id else { return Receipt::NotMine };
        match (id & 0xFF == self.id, id >> 8) {
            (true, 0..=6) => return Receipt::Foreign,
            (true, what) if what == self.upload => {}
            _ => return Receipt::NotMine,
        }
        let Some([p, q, v, w, i, j, temperature, fault]) =
            frame.exactly::<8>().filter(|_| !frame.is_fd())
        else {
            return Receipt::Malformed;
        };
        let whole = |high, low| i16::from_be_bytes([high, low]);
        self.fault = u32::from(fault);
        if fault != 0 {
            self.power_up.lose();
        }
        self.power_up.count_reply(REPLIES_TO_POWER);
        self.is_outside = whole(p, q).unsigned_abs() >= END.unsigned_abs();
        self.is_known = true;
        Receipt::Measured(Measurement {
            position: (f64::from(whole(p, q)) * 0.1).to_radians(),
            velocity: f64::from(whole(v, w)) * 10.0 * self.speed,
            torque: f64::from(whole(i, j)) * 0.01 * self.constant,
            temperature: f64::from(temperature as i8),
        })
    }

    fn state(&self) -> DriveState {
        let power = self.power_up.power(self.is_known);
        let outside = fault::when(self.is_outside, fault::OUT_OF_RANGE);
        let fault = fault::first([self.fault, outside]);
        DriveState { power, fault, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.is_known, self.is_outside, self.fault) = (false, false, 0);
    }

    fn identifiers(&self) -> Vec<Id> {
        [CURRENT, ZERO, self.upload].map(|what| Id::Extended(what << 8 | self.id)).to_vec()
    }

    fn steps(&self) -> Setpoint {
        Setpoint::of_motion(0.1_f64.to_radians(), 10.0 * self.speed.abs(), 0.01 * self.constant)
    }

    fn replies(&self) -> Vec<Reply> {
        vec![Reply::classic(Id::Extended(self.upload << 8 | self.id), 8)]
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(Frame::classic(Id::Extended(ZERO << 8 | self.id), &[0]));
        true
    }
}

state!(AkServo {
    power_up, is_known, is_outside, fault; id, upload, torque_limit, constant, speed
});
