//! The bridge's half of the protocol.

use super::signals::{Named, Reported, Role, Sent, value};
use crate::drive::{
    Drive, DriveCommand, DriveState, Measurement, Power, Receipt, Reply, Setpoint, Watchdog,
};
use crate::frame::{Frame, FrameQueue, Id};
use crate::protocol::fault;
use crate::protocol::number::limited;
use crate::protocol::power_up::{Action, PowerUp};

/// A temperature counts for this time: it is reported seldom, and changes slowly `[ns]`.
const TEMPERATURE_NS: u64 = 10_000_000_000;

#[derive(Debug)]
pub(super) struct Dbc {
    pub(super) torque_limit: f64,
    pub(super) sent: Vec<Sent>,
    pub(super) enable: [f64; 2],
    pub(super) units: [f64; 5],
    pub(super) position: Reported,
    pub(super) velocity: Option<Reported>,
    pub(super) torque: Option<Reported>,
    pub(super) temperature: Option<Reported>,
    pub(super) fault: Option<Reported>,
    pub(super) enabled: Option<Reported>,
    pub(super) enabled_value: f64,
    pub(super) stale_ns: u64,
    /// The signals of fault or power have stopped.
    pub(super) silent: bool,
    /// Position as last measured `[rad]`.
    pub(super) place: f64,
    pub(super) code: u32,
    pub(super) not_finite: bool,
    pub(super) power: Power,
    pub(super) power_up: PowerUp,
}

impl Dbc {
    fn send(&self, power: bool, desired: &Setpoint, out: &mut FrameQueue) {
        let Setpoint { position, velocity, torque, stiffness, damping } = *desired;
        let setpoint = [position, velocity, limited(torque, self.torque_limit), stiffness, damping];
        let [off, on] = self.enable;
        let value = |role| match role {
            Role::Enable if power => on,
            Role::Enable => off,
            Role::Setpoint(i) => match (setpoint.get(i), self.units.get(i)) {
                (Some(value), Some(unit)) => value / unit,
                _ => 0.0,
            },
            Role::Constant(value) | Role::Limit(value) => value,
        };
        // no power before its set-point, and no set-point before power is gone
        for has_power in [!power, power] {
            self.sent
                .iter()
                .filter(|sent| sent.has_power() == has_power)
                .for_each(|sent| out.push_some(sent.frame(value)));
        }
    }

    fn reported(&self) -> impl Iterator<Item = &Reported> {
        [&self.velocity, &self.torque, &self.temperature, &self.fault, &self.enabled]
            .into_iter()
            .flatten()
            .chain([&self.position])
    }

    /// The motor's report of its fault and power.
    fn health(&self) -> impl Iterator<Item = &Reported> {
        [&self.fault, &self.enabled].into_iter().flatten()
    }

    fn is_silent(&self, now_ns: u64) -> bool {
        self.health().any(|reported| reported.is_old(now_ns, self.stale_ns))
    }

    fn powered(&mut self, is_on: bool) {
        self.power_up.report(is_on);
        self.power = if is_on { Power::On } else { Power::Off };
    }
}

impl Drive for Dbc {
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue) {
        self.silent = self.is_silent(now_ns);
        let is_ready = self.place.is_finite()
            && self.state().power != Power::Unknown
            && self.state().fault == 0;
        match self.power_up.action(command, is_ready) {
            Action::Idle(_) | Action::Reset | Action::Withhold => {
                self.send(false, &Setpoint::still(self.place), out);
            }
            Action::Prime(setpoint) => self.send(false, &setpoint, out),
            Action::Ask(setpoint) | Action::Await(setpoint) | Action::Follow(setpoint) => {
                // a motor that reported power before does not report it again
                if self.power == Power::On {
                    self.power_up.report(true);
                }
                self.send(true, &setpoint, out);
            }
        }
    }

    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue) {
        self.send(true, setpoint, out);
    }

    fn disable(&self, out: &mut FrameQueue) {
        self.send(false, &Setpoint::still(self.place), out);
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt {
        let Some(reported) = self.reported().find(|reported| reported.named.id == frame.id) else {
            let is_sent = self.sent.iter().any(|sent| sent.id == frame.id);
            return if is_sent { Receipt::Foreign } else { Receipt::NotMine };
        };
        if frame.is_fd() || frame.data().len() != reported.named.len {
            return Receipt::Malformed;
        }
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let take = |reported: &mut Option<Reported>, unit: f64| {
            reported.as_mut()?.take(now_ns, frame, unit)
        };
        take(&mut self.velocity, velocity_unit);
        take(&mut self.torque, torque_unit);
        take(&mut self.temperature, 1.0);
        if let Some(value) = take(&mut self.fault, 1.0) {
            // any number that is not 0 is a fault, NaN too; larger ones are the drives' own
            self.code =
                if value == 0.0 { 0 } else { (value.abs() as u32).clamp(1, i32::MAX as u32) };
        }
        if let Some(value) = take(&mut self.enabled, 1.0) {
            let is_on = value == self.enabled_value;
            self.powered(is_on);
        }
        self.silent = self.is_silent(now_ns);
        let Some(position) = self.position.take(now_ns, frame, position_unit) else {
            return Receipt::Noted;
        };
        self.not_finite = !position.is_finite();
        if self.not_finite {
            return Receipt::Malformed;
        }
        self.place = position;
        if self.enabled.is_none() {
            self.power = if self.power_up.is_asked() { Power::On } else { Power::Off };
        }
        Receipt::Measured(Measurement {
            position,
            velocity: value(self.velocity.as_ref(), now_ns, self.stale_ns),
            torque: value(self.torque.as_ref(), now_ns, self.stale_ns),
            temperature: value(self.temperature.as_ref(), now_ns, TEMPERATURE_NS),
        })
    }

    fn state(&self) -> DriveState {
        let is_known = !self.silent && self.health().all(Reported::is_known);
        let power = if is_known { self.power_up.reported(self.power) } else { Power::Unknown };
        let not_finite = fault::when(self.not_finite, fault::NOT_FINITE);
        let silent = fault::when(self.silent, fault::SILENT);
        let fault = fault::first([self.code, not_finite, self.power_up.fault(), silent]);
        DriveState { power, fault, watchdog: Watchdog::Unreadable }
    }

    fn forget(&mut self) {
        let Dbc { position, velocity, torque, temperature, fault, enabled, .. } = self;
        [velocity, torque, temperature, fault, enabled]
            .into_iter()
            .flatten()
            .chain([position])
            .for_each(Reported::forget);
        (self.silent, self.place, self.code, self.not_finite) = (false, f64::NAN, 0, false);
        self.power = Power::Unknown;
        self.power_up.forget();
    }

    fn identifiers(&self) -> Vec<Id> {
        let sent = self.sent.iter().map(|sent| sent.id);
        let mut ids: Vec<Id> = sent.chain(self.reported().map(|of| of.named.id)).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }

    fn steps(&self) -> Setpoint {
        let [position_unit, velocity_unit, torque_unit, ..] = self.units;
        let step = |reported: Option<&Reported>, unit: f64| {
            reported.map_or(0.0, |reported| reported.named.step() * unit.abs())
        };
        Setpoint {
            position: step(Some(&self.position), position_unit),
            velocity: step(self.velocity.as_ref(), velocity_unit),
            torque: step(self.torque.as_ref(), torque_unit),
            ..Setpoint::default()
        }
    }

    fn replies(&self) -> Vec<Reply> {
        let mut replies: Vec<Reply> = Vec::new();
        for reported in self.reported() {
            let Named { id, len, .. } = reported.named;
            if !replies.iter().any(|reply| reply.id == id) {
                replies.push(Reply::classic(id, len));
            }
        }
        replies
    }

    /// Nothing: a DBC file does not name the request that a motor answers.
    fn probe(&mut self, _out: &mut FrameQueue) {}
}
