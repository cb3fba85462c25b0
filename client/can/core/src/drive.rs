//! The trait of protocols: the bridge's half of the communication with one motor.
//!
//! A [`Drive`] knows no bus, no clock and no safety rule. It turns commands for its motor into
//! frames and reads the motor's answers. All its numbers are on the motor's side: radians at the
//! motor's output shaft, N m, and the motor's sign.

use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use crate::state::{State, state, state_of_enum};

/// Set-point of a motor, on the motor's side of gear and sign.
///
/// All numbers are finite: the bridge rejects others. `Impedance` uses all of them; every other
/// mode uses the number that it is named after, with those below it as feed-forward where the
/// protocol has room for them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Position `[rad]`.
    pub position: f64,
    /// Velocity `[rad/s]`.
    pub velocity: f64,
    /// Torque `[N m]`.
    pub torque: f64,
    /// Stiffness `[N m/rad]`.
    pub stiffness: f64,
    /// Damping `[N m s/rad]`.
    pub damping: f64,
}

impl Setpoint {
    /// Holds the motor's position; an unknown position is 0.
    pub(crate) fn still(position: f64) -> Setpoint {
        let position = if position.is_finite() { position } else { 0.0 };
        Setpoint { position, ..Setpoint::default() }
    }

    /// Without stiffness and damping.
    pub(crate) fn of_motion(position: f64, velocity: f64, torque: f64) -> Setpoint {
        Setpoint { position, velocity, torque, ..Setpoint::default() }
    }
}

sarrus_proto::named_enum! {
    /// Mode of a motor's own controller.
    pub enum Mode {
        /// τ + k (p* − p) + d (v* − v), in the motor.
        Impedance = "impedance",
        /// A position, with velocity and torque as feed-forward.
        Position = "position",
        /// A velocity, with torque as feed-forward.
        Velocity = "velocity",
        /// A torque. The bridge adds stiffness and damping at its own rate.
        Torque = "torque",
    }
}

impl Mode {
    /// Whether loops of the motor make the torque, within a limit of its own.
    pub const fn has_own_loops(self) -> bool {
        matches!(self, Mode::Position | Mode::Velocity)
    }
}

/// Command for a motor in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveCommand {
    /// No power; the motor reports its position. Meanwhile the drive sets the motor's watchdog and
    /// mode and reads them back.
    Off,
    /// No power, and a latched fault is cleared.
    Reset,
    /// Follow the set-point; the drive takes the steps that lead there, one a cycle where the motor
    /// has to answer in between, and never gives power before the motor has this set-point or a
    /// zero torque.
    On(Setpoint),
}

sarrus_proto::named_enum! {
    /// Power of a motor, by its answers.
    #[derive(Default)]
    pub enum Power {
        /// It has not answered yet.
        #[default]
        Unknown = "unknown",
        /// Without power.
        Off = "off",
        /// On the way to power.
        Starting = "starting",
        /// Follows set-points.
        On = "on",
    }
}

/// State of the watchdog in the motor: the time without commands after which it turns its
/// torque off by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Watchdog {
    /// Not read back yet.
    #[default]
    Unknown,
    /// It is off.
    Off,
    /// Read back from the motor `[ms]`, at least 1.
    Set(u32),
    /// This protocol cannot read it.
    Unreadable,
}

impl Watchdog {
    /// A watchdog of this time `[ms]` in a motor where 0 is off.
    pub(crate) fn of_counts(counts: u32, per_ms: u32) -> Watchdog {
        if counts == 0 { Watchdog::Off } else { Watchdog::Set((counts / per_ms).max(1)) }
    }
}

/// State of a motor, as its drive has seen it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveState {
    /// Power.
    pub power: Power,
    /// The motor's own code of its fault, or one of [`fault`](crate::protocol::fault); 0 without
    /// one.
    pub fault: u32,
    /// The motor's watchdog.
    pub watchdog: Watchdog,
}

/// Measurement of a motor, on the motor's side; NaN for numbers that its protocol does not report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Position `[rad]`, continuous across the ends of the protocol's range.
    pub position: f64,
    /// Velocity `[rad/s]`.
    pub velocity: f64,
    /// Torque `[N m]`.
    pub torque: f64,
    /// Temperature `[°C]`.
    pub temperature: f64,
}

impl Measurement {
    /// Nothing is known.
    pub(crate) const NONE: Measurement = Measurement {
        position: f64::NAN,
        velocity: f64::NAN,
        torque: f64::NAN,
        temperature: f64::NAN,
    };
}

/// Meaning of a frame to a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Receipt {
    /// Nothing: the frame is another's.
    NotMine,
    /// It has this motor's identifier and is none of its frames (length, checksum, format); nothing
    /// was taken from it.
    Malformed,
    /// It is one that only this drive sends, and came from another sender.
    Foreign,
    /// It was read and holds no measurement.
    Noted,
    /// A measurement.
    Measured(Measurement),
    /// The value of a parameter, by its place in [`Drive::parameters`].
    Parameter(usize, f64),
}

/// A parameter of a motor that can be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in the protocol's own words.
    pub name: &'static str,
    /// Unit; empty without one.
    pub unit: &'static str,
    /// Its register, object or index in the protocol.
    pub(crate) address: u32,
    pub(crate) kind: ParameterKind,
}

/// How the bits of a parameter are a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParameterKind {
    Whole,
    Signed,
    Single,
}

impl Parameter {
    /// A whole number.
    pub(crate) const fn whole(address: u32, name: &'static str, unit: &'static str) -> Parameter {
        Parameter { name, unit, address, kind: ParameterKind::Whole }
    }

    /// A whole number with a sign.
    pub(crate) const fn signed(address: u32, name: &'static str, unit: &'static str) -> Parameter {
        Parameter { name, unit, address, kind: ParameterKind::Signed }
    }

    /// A single.
    pub(crate) const fn single(address: u32, name: &'static str, unit: &'static str) -> Parameter {
        Parameter { name, unit, address, kind: ParameterKind::Single }
    }

    /// The parameter of an address that was read as the lower `n_bits` of `bits`.
    pub(crate) fn receipt(known: &[Parameter], address: u32, bits: u32, n_bits: u32) -> Receipt {
        let mut places = known.iter().enumerate();
        let Some((place, parameter)) = places.find(|(_, known)| known.address == address) else {
            return Receipt::Noted;
        };
        let unused = 32 - n_bits;
        let value = match parameter.kind {
            ParameterKind::Whole => f64::from(bits << unused >> unused),
            ParameterKind::Signed => f64::from((bits << unused) as i32 >> unused),
            ParameterKind::Single => f64::from(f32::from_bits(bits)),
        };
        Receipt::Parameter(place, value)
    }

    /// Whether it is the version of the motor's firmware.
    pub fn is_version(&self) -> bool {
        matches!(self.name, "sw_ver" | "register map version")
    }
}

/// Reply of a motor, for the load of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// Identifier.
    pub id: Id,
    /// Classic, or FD with its bit rate switch.
    pub kind: FrameKind,
    /// Data bytes.
    pub len: usize,
}

impl Reply {
    /// A classic frame.
    pub(crate) fn classic(id: Id, len: usize) -> Reply {
        Reply { id, kind: FrameKind::Classic, len }
    }
}

/// An identifier that several motors of a bus may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shared {
    /// The identifier.
    pub id: Id,
    /// The motor's tag in the data, in the bits of `mask`.
    pub tag: u16,
    /// Bits that the data have room for.
    pub mask: u16,
}

impl Shared {
    /// Whether frames of the two are ambiguous.
    pub fn collides(&self, other: &Shared) -> bool {
        self.id == other.id && (self.tag ^ other.tag) & self.mask & other.mask == 0
    }
}

/// How a motor's measurements go with the frames of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// It measures without being asked.
    Unasked,
    /// It is set up, and its answers are of other kinds: the age of a measurement is unknown.
    SettingUp,
    /// It answers the frames of a cycle with one measurement.
    Paired,
}

impl Pairing {
    /// Of a motor that answers, once it is set up.
    pub(crate) fn once(is_set_up: bool) -> Pairing {
        if is_set_up { Pairing::Paired } else { Pairing::SettingUp }
    }
}

/// The bridge's half of the talk with one motor. Nothing here allocates, panics or reads a clock.
pub trait Drive: State + Send + core::fmt::Debug {
    /// Frames of one cycle at time `now_ns` (monotonic); in every cycle at least one that the motor
    /// answers with a measurement.
    fn cycle(&mut self, now_ns: u64, command: DriveCommand, out: &mut FrameQueue);

    /// The frames of a set-point alone, as [`Drive::cycle`] sends them while the motor is on: for
    /// tables, loads and tests of the codec.
    fn encode(&self, setpoint: &Setpoint, out: &mut FrameQueue);

    /// Frames that take the motor's power away, independent of all earlier commands.
    /// Sent on every way out.
    fn disable(&self, out: &mut FrameQueue);

    /// Frames of a cycle in which the drive stops its motor by itself and then takes the power
    /// away; false where the protocol has no such command.
    fn quick_stop(&mut self, _now_ns: u64, _out: &mut FrameQueue) -> bool {
        false
    }

    /// Reads a frame from the bus.
    fn receive(&mut self, now_ns: u64, frame: &Frame) -> Receipt;

    /// State of the motor.
    fn state(&self) -> DriveState;

    /// Called when an operator arms, and before the motor gets power: the motor's settings are
    /// written and read back anew, since a motor whose supply was away has lost them. Does nothing
    /// if the protocol has no such settings.
    fn prepare(&mut self) {}

    /// Forgets the state of the motor: it may have been off the bus, or without supply.
    fn forget(&mut self);

    /// Identifiers that this drive sends on and its motor answers on; no two motors of a bus may
    /// share one.
    fn identifiers(&self) -> Vec<Id>;

    /// Identifiers that several motors of a bus may use, distinguished by their data; none of them
    /// may be in the [`identifiers`](Drive::identifiers) of a drive.
    fn shared_identifiers(&self) -> Vec<Shared> {
        Vec::new()
    }

    /// One step of each number's codes, of measurements and of gains, on the motor's side; 0 for
    /// numbers that are as good as exact.
    fn steps(&self) -> Setpoint {
        Setpoint::default()
    }

    /// The largest stiffness and damping of its protocol `[N m/rad, N m s/rad]`; larger ones become
    /// these.
    fn largest_gains(&self) -> [f64; 2] {
        [f64::INFINITY; 2]
    }

    /// When the position of the last measurement came, where it comes apart from the rest; `None`
    /// where it came with the measurement `[ns]`.
    fn position_ns(&self) -> Option<u64> {
        None
    }

    /// How its measurements go with the frames of a cycle.
    fn pairing(&self) -> Pairing {
        Pairing::Unasked
    }

    /// How long an answer took that can be paired with its question, where measurements come
    /// without being asked and such questions are asked before power; the largest number while
    /// there was none yet `[ns]`. `None` where it cannot be measured.
    fn round_trip_ns(&self, _now_ns: u64) -> Option<u64> {
        None
    }

    /// Whether measurements carry a counter, without whose step they are none: it separates
    /// a frozen sensor from a joint at rest.
    fn counts(&self) -> bool {
        false
    }

    /// Replies of the motor in one cycle while it is on.
    fn replies(&self) -> Vec<Reply>;

    /// A frame that all motors of a bus wait for at the end of a cycle (SYNC of CANopen); sent
    /// once for all drives.
    fn sync(&self) -> Option<Frame> {
        None
    }

    /// A frame that [`Drive::cycle`] sends now and then besides (heartbeat of CANopen), and the
    /// time between two `[ns]`.
    fn heartbeat(&self) -> Option<(Frame, u64)> {
        None
    }

    /// Asks for an answer without giving power or changing anything; nothing where messages come by
    /// themselves, or where none is known to be answered.
    fn probe(&mut self, _out: &mut FrameQueue) {}

    /// Makes the present position the motor's zero; false where the protocol has no such command.
    fn set_zero(&mut self, _out: &mut FrameQueue) -> bool {
        false
    }

    /// Stores the zero that [`Drive::set_zero`] made, so that it is there after the supply was
    /// away; false where the protocol has no such command.
    fn save_zero(&mut self, _out: &mut FrameQueue) -> bool {
        false
    }

    /// Gives the motor another identifier and stores it; from then on it is another drive's motor.
    /// False where the protocol has no such command, or no such identifier.
    fn set_id(&mut self, _id: u32, _out: &mut FrameQueue) -> bool {
        false
    }

    /// Parameters that can be read.
    fn parameters(&self) -> &'static [Parameter] {
        &[]
    }

    /// Asks for a parameter by its place.
    fn read_parameter(&mut self, _parameter: usize, _out: &mut FrameQueue) {}

    /// Ends of the protocol's ranges of position, velocity and torque `[rad, rad/s, N m]`: it has
    /// no numbers beyond them. Infinite where it has no ranges.
    fn ranges(&self) -> [f64; 3] {
        [f64::INFINITY; 3]
    }
}

state!(DriveState { power, fault, watchdog });
state!(Measurement { position, velocity, torque, temperature });
state_of_enum!(Power { Unknown, Off, Starting, On });
state_of_enum!(Watchdog { Unknown, Off, Set(u32), Unreadable });
