//! moteus: registers in sub-frames of CAN FD.
//!
//! Source: mjbots moteus documentation, "CAN protocol" and "registers" (mjbots.github.io/moteus),
//! firmware of 2025.
//!
//! - Identifier: source << 8 | destination, bit 15 asks for an answer; extended beyond 7FF. The
//!   answer has source and destination exchanged. FD with its bit rate switch, filled up with 50.
//! - Sub-frames: write 00, read 10, answer 20, each + 0 int8, 4 int16, 8 int32, C single, + a count
//!   of 1 to 3 (0: the count follows); then the first register and, but for reads, the values,
//!   little-endian. 30, 31 report errors.
//! - Registers: 000 mode (0 stopped, 1 fault, 2 … 4 starts, 10 position, 11 timeout), 001 position,
//!   002 velocity, 003 torque, 00E temperature, 00F fault, 020 position, 021 velocity, 022 torque,
//!   023 and 024 scales of the motor's own gains, 025 largest torque, 027 watchdog (0: its own
//!   default; NaN: none), 028 and 029 limits of velocity and acceleration, 02B scale of the
//!   integrator's limit. Positions in turns, velocities in turns/s, torques in N m, all at the
//!   output.
//!
//! A command takes 37 bytes, which FD sends as 48: mode int8, position and velocity single, torque
//! and largest torque int16 in .01 N m, scales int16 in 1/32767, watchdog int8 in .01 s, and both
//! limits int8 below 0: with a limit, its own or servo.default_accel_limit, a motor would follow a
//! trajectory to the position instead of the position. The modes torque and impedance have no
//! integrator, so its limit is scaled to 0. In the mode torque there is no position, and a command
//! takes 27 bytes, sent as 32. Torques and scales are rounded towards zero, and the motor holds the
//! largest torque over all of its loops. A motor with servo.bemf_feedforward answers a command
//! without such a limit with a fault. The answer takes 24: mode, position, velocity, torque single,
//! voltage, temperature, fault int8. The motor makes the damping's scale no larger than the
//! stiffness's: the rest of the damping is added as torque, at the bus's rate. Its reaction to the
//! end of its watchdog is servo.timeout_mode.

mod subframes;

use std::f64::consts::TAU;

use super::number::{limited, single, steps_toward_zero};
use super::power_up::{Action, PowerUp, Stage};
use super::{Common, Key, Made, Protocol, Settings, fault};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Mode, Pairing, Parameter, Power, Receipt, Reply,
    Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use crate::state::state;
use sarrus_models::Diagnostics;
use subframes::{
    EMPTY, INT8, INT16, INTEGRATOR_SCALE, MODE, OUTPUT_EXACT, POSITION, Payload, SINGLE,
    TEMPERATURE, TORQUE, VOLTAGE, WATCHDOG, each_value,
};

/// moteus.
pub(super) const MOTEUS: Protocol = Protocol {
    name: "moteus",
    about: "mjbots moteus (CAN FD)",
    modes: &[Mode::Torque, Mode::Impedance, Mode::Position],
    fd: true,
    keys: &[
        Key::integer("id", 1, 126, "id.id of the controller"),
        Key::integer("source", 0, 126, "identifier of this side").or("0"),
        Key::number("kp", 1e-6, 1e6, "servo.pid_position.kp [N m/turn], for the mode impedance")
            .optional(),
        Key::number("kd", 1e-6, 1e6, "servo.pid_position.kd [N m s/turn], for the mode impedance")
            .optional(),
    ],
    make,
};

const STOPPED: u8 = 0;
const FAULT: u8 = 1;
const FOLLOWS: u8 = 10;

const FAULT_REGISTER: u32 = 0x00F;
/// No limit of velocity or acceleration: anything below 0.
const NO_LIMIT: u8 = -1_i8 as u8;

const PARAMETERS: &[Parameter] = &[
    Parameter::single(0x00D, "voltage", "V"),
    Parameter::single(0x00A, "motor temperature", "°C"),
    Parameter::single(0x00C, "home state", ""),
    Parameter::single(0x102, "register map version", ""),
];
/// 1 in an int16 scale.
const WHOLE: i32 = 32_767;
/// A step of an int16 torque `[N m]`.
const TORQUE_STEP: f64 = 0.01;

#[derive(Debug)]
struct Moteus {
    id: u32,
    source: u32,
    common: Common,
    /// The motor's own gains at scale 1 `[N m/turn, N m s/turn]`.
    gains: [f64; 2],
    /// Steps of .01 s, 0 for the controller's own.
    watchdog_steps: u8,
    watchdog: Watchdog,
    power_up: PowerUp,
    servo_mode: Option<u8>,
    code: u8,
    not_finite: bool,
    velocity: f64,
}

/// The longest watchdog in eight bits of hundredths of a second `[ms]`.
const LONGEST_WATCHDOG_MS: u32 = 1270;

fn make(settings: &Settings, common: Common, diagnostics: &mut Diagnostics) -> Made {
    if common.mode == Mode::Impedance && !(settings.has("kp") && settings.has("kd")) {
        let found = "the drive has not both of `kp` and `kd`";
        let help = "add servo.pid_position.kp and .kd";
        return settings.wrong(diagnostics, "kp", found, "the controller's own gains", help);
    }
    if common.watchdog_ms > LONGEST_WATCHDOG_MS {
        let found = format!("a watchdog of {} ms", common.watchdog_ms);
        let expected = format!("at most {LONGEST_WATCHDOG_MS} with moteus");
        let help = "make `watchdog_ms` shorter";
        return settings.wrong(diagnostics, "id", found, expected, help);
    }
    Some(Box::new(Moteus {
        id: settings.integer("id") as u32,
        source: settings.integer("source") as u32,
        common,
        gains: [settings.number("kp"), settings.number("kd")],
        watchdog_steps: common.watchdog_ms.div_ceil(10) as u8,
        watchdog: Watchdog::Unknown,
        power_up: PowerUp::at_once(),
        servo_mode: None,
        code: 0,
        not_finite: false,
        velocity: f64::NAN,
    }))
}

impl Moteus {
    fn frame(&self, payload: &Payload) -> Option<Frame> {
        Frame::fd(Id::Extended(0x8000 | self.source << 8 | self.id), true, payload.padded())
    }

    /// The identifier of its answers.
    fn answer(&self) -> Id {
        let number = self.id << 8 | self.source;
        Id::standard(number).unwrap_or(Id::Extended(number))
    }

    /// Mode, position, velocity, torque; voltage, temperature, fault.
    fn query(payload: Payload) -> Payload {
        payload.read(SINGLE, MODE, 4).read(INT8, VOLTAGE, 3)
    }

    fn stop(&self) -> Option<Frame> {
        let payload = EMPTY
            .write(INT8, MODE, &[[STOPPED]])
            .write(INT8, WATCHDOG, &[[self.watchdog_steps]])
            .read(INT8, WATCHDOG, 1);
        self.frame(&Moteus::query(payload))
    }

    fn setpoint(&self, setpoint: &Setpoint) -> Option<Frame> {
        let [kp, kd] = match self.common.mode {
            Mode::Impedance => {
                let [kp, kd] = self.gains;
                let stiffness = (setpoint.stiffness * TAU / kp).clamp(0.0, 1.0);
                [stiffness, (setpoint.damping * TAU / kd).clamp(0.0, stiffness)]
            }
            Mode::Position => [1.0, 1.0],
            Mode::Torque | Mode::Velocity => [0.0, 0.0],
        };
        let mut torque = setpoint.torque;
        if self.common.mode == Mode::Impedance && self.velocity.is_finite() {
            let [_, own] = self.gains;
            torque +=
                (setpoint.damping - kd * own / TAU).max(0.0) * (setpoint.velocity - self.velocity);
        }
        let torque = limited(torque, self.common.torque_limit);
        let torque = steps_toward_zero(torque, TORQUE_STEP, WHOLE) as i16;
        // rounded towards less; the lowest value means the controller's own limit
        let most = (self.common.torque_limit / TORQUE_STEP).floor();
        let most =
            if most.is_finite() { most.clamp(0.0, f64::from(WHOLE)) as i16 } else { i16::MIN };
        let scale = |gain: f64| steps_toward_zero(gain, 1.0 / f64::from(WHOLE), WHOLE) as i16;
        let payload = EMPTY.write(INT8, MODE, &[[FOLLOWS]]);
        let payload = match self.common.mode {
            Mode::Torque | Mode::Velocity => payload,
            Mode::Impedance | Mode::Position => {
                let motion = [setpoint.position, setpoint.velocity];
                let motion = motion.map(|value| single(value / TAU).to_le_bytes());
                payload.write(SINGLE, POSITION, &motion)
            }
        };
        let torques = [torque, scale(kp), scale(kd), most].map(i16::to_le_bytes);
        let payload = payload.write(INT16, TORQUE, &torques).write(
            INT8,
            WATCHDOG,
            &[[self.watchdog_steps], [NO_LIMIT], [NO_LIMIT]],
        );
        let payload = match self.common.mode {
            Mode::Position => payload,
            _ => payload.write(INT8, INTEGRATOR_SCALE, &[[0]]),
        };
        self.frame(&Moteus::query(payload))
    }

    /// Takes a register's value; the position, velocity or torque goes to `measured`.
    fn take(&mut self, register: u32, value: f64, measured: &mut [f64; 5]) -> Option<Receipt> {
        let small = if value.is_finite() { value as i64 as u8 } else { 0 };
        match register {
            MODE => self.servo_mode = Some(small),
            FAULT_REGISTER => self.code = small,
            TEMPERATURE => measured[4] = value,
            WATCHDOG => {
                let ms = value * 1e3;
                self.watchdog = match value.is_nan() {
                    true => Watchdog::Off,
                    // 0 is the controller's own default, which it does not report
                    false if ms < 1.0 => Watchdog::Unreadable,
                    false => Watchdog::Set(ms.round() as u32),
                };
            }
            1..=3 => measured.get_mut(register as usize).into_iter().for_each(|slot| *slot = value),
            _ => {}
        }
        let parameter = PARAMETERS.iter().position(|known| known.address == register);
        parameter.map(|parameter| Receipt::Parameter(parameter, value))
    }

    fn proceed(&mut self) {
        let Some(mode) = self.servo_mode else { return };
        if mode == FAULT && self.power_up.is_asked() {
            self.power_up.lose();
        }
        self.power_up.report(mode == FOLLOWS);
    }
}

impl Drive for Moteus {
    fn cycle(&mut self, _now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        let is_ready = self.servo_mode == Some(STOPPED)
            && self.watchdog != Watchdog::Unknown
            && self.state().fault == 0;
        let frame = match self.power_up.action(command, is_ready) {
            Action::Reset => {
                self.not_finite = false;
                self.stop()
            }
            Action::Idle(_) | Action::Withhold => self.stop(),
            Action::Prime(setpoint)
            | Action::Ask(setpoint)
            | Action::Await(setpoint)
            | Action::Follow(setpoint) => self.setpoint(&setpoint),
        };
        out.push_some(frame);
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        out.push_some(self.setpoint(setpoint));
    }

    fn disable(&self, out: &mut FrameQueue) {
        out.push_some(self.stop());
    }

    fn receive(&mut self, _now_ns: u64, frame: &Frame) -> Receipt {
        // to this motor, with an answer desired, from any source
        if frame.id.number() & !0x7F00 == 0x8000 | self.id {
            return Receipt::Foreign;
        }
        if frame.id.number() != self.id << 8 | self.source {
            return Receipt::NotMine;
        }
        let mut measured = [f64::NAN; 5];
        let mut receipt = Receipt::Noted;
        // nothing is taken before all of it was read
        if each_value(frame.data(), |_, _| {}).is_none() {
            return Receipt::Malformed;
        }
        each_value(frame.data(), |register, number| {
            receipt = self.take(register, number, &mut measured).unwrap_or(receipt);
        });
        self.proceed();
        let [_, position, velocity, torque, temperature] = measured;
        if position.is_nan() && velocity.is_nan() {
            return receipt;
        }
        self.not_finite = !(position.is_finite() && velocity.is_finite());
        if self.not_finite {
            return Receipt::Malformed;
        }
        self.velocity = velocity * TAU;
        let position = position * TAU;
        let torque = if torque.is_finite() { torque } else { f64::NAN };
        Receipt::Measured(Measurement { position, velocity: self.velocity, torque, temperature })
    }

    fn state(&self) -> DriveState {
        let power = match (self.servo_mode, self.power_up.stage) {
            (None, _) => Power::Unknown,
            (Some(FOLLOWS), _) => Power::On,
            (Some(STOPPED), Stage::Asked(_)) | (Some(2..=4), _) => Power::Starting,
            // after a timeout or a fault the motor may brake: it is off in that it follows nothing
            (Some(_), _) => Power::Off,
        };
        // other codes name the limit of a motor without fault
        let code = fault::when(self.servo_mode == Some(FAULT), u32::from(self.code.max(1)));
        let not_finite = fault::when(self.not_finite, fault::NOT_FINITE);
        let fault = fault::first([code, not_finite, self.power_up.fault()]);
        DriveState { power, fault, watchdog: self.watchdog }
    }

    fn prepare(&mut self) {
        self.watchdog = Watchdog::Unknown;
    }

    fn forget(&mut self) {
        self.power_up.forget();
        (self.servo_mode, self.code, self.not_finite) = (None, 0, false);
        self.velocity = f64::NAN;
        self.prepare();
    }

    fn identifiers(&self) -> Vec<Id> {
        vec![Id::Extended(0x8000 | self.source << 8 | self.id), self.answer()]
    }

    fn steps(&self) -> Setpoint {
        let [kp, kd] = self.gains.map(|gain| gain / TAU / f64::from(WHOLE));
        let known = |gain: f64| if gain.is_finite() { gain } else { 0.0 };
        Setpoint {
            torque: TORQUE_STEP,
            stiffness: known(kp),
            damping: known(kd),
            ..Setpoint::default()
        }
    }

    /// More damping than its own gain makes is added as torque.
    fn largest_gains(&self) -> [f64; 2] {
        let [kp, _] = self.gains;
        [if kp.is_finite() { kp / TAU } else { f64::INFINITY }, f64::INFINITY]
    }

    fn pairing(&self) -> Pairing {
        Pairing::Paired
    }

    fn replies(&self) -> Vec<Reply> {
        let kind = FrameKind::Fd { bit_rate_switch: true };
        vec![Reply { id: self.answer(), kind, len: 24 }]
    }

    fn probe(&mut self, out: &mut FrameQueue) {
        out.push_some(self.frame(&Moteus::query(EMPTY)));
    }

    fn set_zero(&mut self, out: &mut FrameQueue) -> bool {
        out.push_some(self.frame(&EMPTY.write(SINGLE, OUTPUT_EXACT, &[0.0_f32.to_le_bytes()])));
        true
    }

    fn parameters(&self) -> &'static [Parameter] {
        PARAMETERS
    }

    fn read_parameter(&mut self, parameter: usize, out: &mut FrameQueue) {
        let Some(parameter) = PARAMETERS.get(parameter) else { return };
        out.push_some(self.frame(&EMPTY.read(SINGLE, parameter.address, 1)));
    }
}

state!(Moteus {
    watchdog, power_up, servo_mode, code, not_finite, velocity;
    id, source, common, gains, watchdog_steps
});
