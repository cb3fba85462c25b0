//! One motor and its state in the bridge.

use sarrus_proto::actuators::{Reason, flag};

use super::chatter::Chatter;
use super::course::Reference;
use super::monitors::{Monitors, Noise, position};
use super::rest::Rest;
use super::whereabouts::Whereabouts;
use crate::config::MotorConfig;
use crate::drive::{DriveState, Measurement, Mode, Pairing, Watchdog};
use crate::event::BusState;
use crate::mapping::{ActuatorMeasurement, ActuatorSetpoint};
use crate::protocol::fault;
use crate::state::{State, Words, state};

/// A motor.
#[derive(Debug)]
pub(super) struct Motor {
    pub(super) config: MotorConfig,
    /// The mechanism that it acts on.
    pub(super) mechanism: usize,
    /// Its drive's state when it was last polled in this cycle.
    pub(super) drive: DriveState,
    /// Its drive answers each request with one measurement, in this cycle.
    pub(super) is_paired: bool,
    /// It waits for a frame of all motors of its bus.
    pub(super) is_synchronous: bool,
    /// Its last measurement is so old that it counts as silent in this cycle.
    pub(super) is_silent: bool,
    pub(super) measured: ActuatorMeasurement,
    /// Its velocity: reported, or of the last two positions `[rad/s, m/s]`.
    pub(super) velocity: f64,
    /// When it last measured `[ns]`.
    pub(super) measured_ns: Option<u64>,
    /// How long this bridge itself was late since then `[ns]`.
    pub(super) own_late_ns: u64,
    /// Its last answer was not one of its frames.
    pub(super) is_malformed: bool,
    /// It answers; its drive has state to forget.
    is_known: bool,
    /// Time of the last request `[ns]`; `None` once it has answered.
    pub(super) sent_ns: Option<u64>,
    /// Flags of the limits that the last set-point met.
    pub(super) flags: u32,
    /// Position when it began to follow, or when commands became late `[rad, m]`.
    pub(super) hold: f64,
    /// How far its spring was drawn when commands became late `[rad, m]`.
    deflection: f64,
    /// The last set-point's position and effort.
    pub(super) last_position: f64,
    pub(super) last_effort: f64,
    /// Sum of spring, damper and effort of the last set-point `[N m, N]`.
    pub(super) last_total: f64,
    /// Effort that holds it against gravity, by the model; 0 without one `[N m, N]`.
    pub(super) gravity: f64,
    /// Damping of stops: the configured one, or more where that could not stop `[N m s/rad, N
    /// s/m]`.
    pub(super) stop_damping: f64,
    /// The largest damping that it can be given `[N m s/rad, N s/m]`.
    pub(super) most_damping: f64,
    pub(super) stop: Reference,
    /// Deceleration of a stop, and its delay `[rad/s², m/s², s]`.
    pub(super) braking: [f64; 2],
    /// The positions from which it can stop at any allowed speed.
    pub(super) free: [f64; 2],
    /// Speed by which strokes of own loops in its mechanism may hide the mean one `[rad/s, m/s]`.
    pub(super) ripple: f64,
    pub(super) noise: Noise,
    /// The phase of its dither, in turns, and whether its last set-point swung by all of it.
    pub(super) phase: f64,
    pub(super) is_dithered: bool,
    /// How long it has been at rest, without power, and where it was trusted.
    pub(super) rest: Rest,
    pub(super) whereabouts: Whereabouts,
    /// Flags that it always has.
    pub(super) lasting: u32,
    pub(super) chatter: Chatter,
    pub(super) monitors: Monitors,
    /// The last measurement that the monitors saw, when it came `[ns]`, and how much older it may
    /// be `[s]`.
    pub(super) before: ActuatorMeasurement,
    pub(super) seen_ns: Option<u64>,
    pub(super) late_before: f64,
    /// The last two set-points, and the stiffness before the last one's effort was limited.
    pub(super) asked: [ActuatorSetpoint; 2],
    pub(super) stiffness: f64,
}

impl Motor {
    /// A motor of a mechanism, without power; a cycle and the time after which it counts as silent
    /// in ns.
    pub(super) fn new(
        config: MotorConfig,
        mechanism: usize,
        period_ns: u64,
        feedback_ns: u64,
    ) -> Motor {
        let most_damping = config.most_damping();
        let stop_damping = config.stop_damping();
        let braking = [config.braking(), position::delay(period_ns)];
        let free = position::free(&config.limits, braking);
        let is_told = config.drive.counts() || config.dither > 0.0;
        let is_blind = !is_told || config.monitors.frozen == f64::INFINITY;
        Motor {
            monitors: Monitors::new(&config, period_ns, feedback_ns),
            drive: config.drive.state(),
            is_synchronous: config.drive.sync().is_some(),
            is_paired: false,
            is_silent: true,
            mechanism,
            config,
            measured: ActuatorMeasurement::NONE,
            velocity: 0.0,
            measured_ns: None,
            own_late_ns: 0,
            is_malformed: false,
            is_known: false,
            sent_ns: None,
            flags: 0,
            hold: 0.0,
            deflection: 0.0,
            last_position: 0.0,
            last_effort: 0.0,
            last_total: 0.0,
            gravity: 0.0,
            stop_damping,
            most_damping,
            stop: Reference::default(),
            braking,
            free,
            ripple: 0.0,
            noise: Noise::default(),
            phase: 0.0,
            is_dithered: false,
            rest: Rest::default(),
            whereabouts: Whereabouts::default(),
            lasting: if is_blind { flag::FROZEN_UNDETECTABLE } else { 0 },
            chatter: Chatter::default(),
            before: ActuatorMeasurement::NONE,
            seen_ns: None,
            late_before: 0.0,
            asked: [ActuatorSetpoint::default(); 2],
            stiffness: 0.0,
        }
    }

    /// Takes a measurement with a position; gives the time since the motor was asked `[ns]`, once.
    pub(super) fn measured(&mut self, now_ns: u64, measured: &Measurement) -> Option<u64> {
        if !measured.position.is_finite() {
            return None;
        }
        let reply_ns = self.sent_ns.take().map(|sent| now_ns.saturating_sub(sent));
        // only motors that wait for a common frame answer in parts
        let now_ns = match self.is_synchronous {
            true => self.config.drive.position_ns().unwrap_or(now_ns),
            false => now_ns,
        };
        let before = self.measured.position;
        self.measured = self.config.mapping.to_actuator(measured);
        self.velocity = match self.measured_ns {
            _ if self.measured.velocity.is_finite() => self.measured.velocity,
            // by the longest time that may have passed, which frames in a burst do not shorten
            Some(last) if before.is_finite() && now_ns > last => {
                let elapsed = (now_ns - last) as f64 * 1e-9 + self.monitors.punctual.late;
                (self.measured.position - before) / elapsed
            }
            Some(_) => self.velocity,
            None => 0.0,
        };
        // a second part whose first one was lost brings no position
        if let Some(last) = self.measured_ns.filter(|last| !self.is_synchronous || *last != now_ns)
        {
            let elapsed = now_ns.saturating_sub(last) as f64 * 1e-9;
            self.monitors.punctual.take(elapsed);
        }
        (self.measured_ns, self.own_late_ns) = (Some(now_ns), 0);
        (self.is_known, self.is_malformed) = (true, false);
        if self.is_paired {
            self.monitors.age.take(now_ns);
            self.monitors.answers.take();
        }
        reply_ns
    }

    pub(super) fn is_stale(&self, now_ns: u64, feedback_ns: u64) -> bool {
        self.measured_ns.is_none_or(|measured| now_ns.saturating_sub(measured) > feedback_ns)
    }

    /// Why it counts as silent: by itself, or mostly because the bridge did not ask or hear it.
    pub(super) fn silence(&self, now_ns: u64) -> Reason {
        let silent_ns = self.measured_ns.map_or(u64::MAX, |at| now_ns.saturating_sub(at));
        match self.own_late_ns > silent_ns / 2 {
            true => Reason::Stalled,
            false => Reason::FeedbackStale,
        }
    }

    /// The bridge could not hear it for this time `[ns]`.
    pub(super) fn excuse(&mut self, now_ns: u64, late_ns: u64) {
        self.own_late_ns += late_ns;
        self.monitors.age.excuse(now_ns);
    }

    /// The motor's fault, or the bridge's own finding in its answers; 0 without either.
    pub(super) fn fault(&self) -> u32 {
        match self.drive.fault {
            0 if self.is_malformed && self.is_silent => fault::MALFORMED,
            fault => fault,
        }
    }

    /// A motor that no longer answers may come back without its settings.
    pub(super) fn forget_if_silent(&mut self) {
        if self.is_known && self.is_silent {
            self.is_known = false;
            self.monitors.age.forget();
            self.rest = Rest::default();
            self.config.drive.forget();
            self.ask_drive();
        }
    }

    /// An operator confirms its position.
    pub(super) fn confirm(&mut self) {
        if let Some(measured_ns) = self.measured_ns {
            self.whereabouts.trust(measured_ns, &self.measured);
        }
    }

    /// Takes the state of its drive.
    pub(super) fn ask_drive(&mut self) {
        self.drive = self.config.drive.state();
    }

    /// Its position, as last reported.
    pub(super) fn place(&self) -> f64 {
        if self.measured.position.is_finite() { self.measured.position } else { self.hold }
    }

    /// Begins to follow from where it is.
    pub(super) fn hold(&mut self) {
        self.hold = self.place();
        (self.last_position, self.last_effort) = (self.hold, 0.0);
        self.chatter = Chatter::default();
    }

    /// Commands became late.
    pub(super) fn late(&mut self) {
        self.hold = self.place();
        self.deflection = match self.config.common.mode {
            Mode::Impedance | Mode::Torque => self.last_position - self.hold,
            // whose controllers hold loads by themselves
            Mode::Position | Mode::Velocity => 0.0,
        };
    }

    /// Commands came back: the way to the desired position begins where the actuator is, or as far
    /// on the way as its spring was drawn before, so that a load is held as before.
    pub(super) fn resume(&mut self, desired: f64) {
        let place = self.place();
        let limits = self.config.limits;
        let drawn = (place + self.deflection).max(place.min(desired)).min(place.max(desired));
        self.last_position = drawn.max(limits.lower).min(limits.upper);
    }

    /// Why it cannot be armed, or come back inside its limits, however long one waits.
    pub(super) fn never_ready(&self, returns: bool) -> Option<Reason> {
        match self.config.drive.state().watchdog {
            _ if !self.config.is_calibrated => Some(Reason::NotCalibrated),
            _ if self.whereabouts.is_elsewhere => Some(Reason::PositionChanged),
            _ if self.is_beyond() && !returns => Some(Reason::OutsideLimits),
            Watchdog::Unreadable => self.config.missing_watchdog(),
            _ => None,
        }
    }

    /// The condition that arming still waits for.
    pub(super) fn missing(&self, now_ns: u64) -> Option<Reason> {
        if self.is_silent {
            return Some(Reason::FeedbackStale);
        }
        if self.drive.fault != 0 {
            return Some(Reason::MotorFault);
        }
        if let Some(reason) = self.config.wrong_watchdog(self.drive.watchdog) {
            return Some(reason);
        }
        if self.whereabouts.is_elsewhere {
            return Some(Reason::PositionChanged);
        }
        match self.config.drive.pairing() {
            // settings that are read and written hide the age of measurements
            Pairing::SettingUp => return Some(Reason::FeedbackLate),
            Pairing::Paired if self.monitors.age.is_unknown() => return Some(Reason::FeedbackLate),
            Pairing::Paired | Pairing::Unasked => {}
        }
        let round_trip_ns = self.config.drive.round_trip_ns(now_ns);
        if round_trip_ns.is_some_and(|taken_ns| self.monitors.age.is_beyond(taken_ns)) {
            return Some(Reason::FeedbackLate);
        }
        let of_bus = self.monitors.check_bus(now_ns, BusState::Active);
        of_bus.or_else(|| (!self.rest.is_long_enough()).then_some(Reason::Moving))
    }
}

state!(Motor {
    config, drive, is_paired, is_silent, measured, velocity, measured_ns, own_late_ns,
    is_malformed, is_known, sent_ns, flags, hold, deflection, last_position, last_effort,
    last_total, gravity, stop, noise, phase, is_dithered, rest, whereabouts, lasting, chatter,
    monitors, before, seen_ns, late_before, asked, stiffness;
    mechanism, is_synchronous, stop_damping, most_damping, braking, free, ripple
});

/// The drive alone changes.
impl State for MotorConfig {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.drive.carry(words);
    }
}
