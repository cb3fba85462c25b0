//! A CANopen drive of the profile CiA 402 as it sees itself.
//!
//! | identifier | object |
//! |---|---|
//! | 000 | NMT: command (1 start, 2 stop, 80 pre-operational, 81 and 82 reset), node or 0 for all |
//! | 080 | SYNC |
//! | 080 + node | EMCY: code u16, register u8, five bytes |
//! | 200, 300, 400, 500 + node | its four receive PDOs; by their mapping, at once or at the next SYNC |
//! | 180, 280, 380, 480 + node | its four transmit PDOs, after each nth SYNC or, asynchronous ones, when the status word changes |
//! | 600 + node, 580 + node | SDO, expedited |
//! | 700 + node | heartbeat: 0 at start, 4 stopped, 5 operational, 7F pre-operational |
//!
//! The state machine of CiA 402 is in [`states`], the objects and the mappings of the PDOs in
//! [`objects`]. A PDO works in the state operational only. When the master's heartbeat (object
//! 1016) is late, EMCY 8130 comes, the drive reacts by object 6007 and goes to pre-operational, the
//! default of object 1029; it stays there, and the next heartbeat brings EMCY 0000.
//!
//! Sources: CiA 301, *CANopen application layer*; CiA 402-2 and -3, *CANopen device profile for
//! drives and motion control*.

mod objects;
mod sdo;
mod states;

use core::f64::consts::TAU;

use self::objects::{Object, Objects, Pdo};
use self::states::{Drive, State};
use super::{Firmware, Plant, standard};
use sarrus_can_core::drive::{Mode, Setpoint};
use sarrus_can_core::frame::{Frame, FrameQueue, Id};
use sarrus_can_core::protocol::{Common, Settings};

/// Slower than this it stands still `[rad/s]`.
const STILL: f64 = 0.05;
/// Gains of its own loops: torque for position `[N m/rad]`, for velocity `[N m s/rad]`.
const OWN_GAINS: [f64; 2] = [60.0, 2.0];
const HEARTBEAT_LOST: u16 = 0x8130;

/// Network states of CiA 301.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Network {
    Boot,
    PreOperational,
    Operational,
    Stopped,
}

#[derive(Debug)]
pub(super) struct Cia402 {
    node: u16,
    counts_per_turn: f64,
    velocity_counts_per_turn: f64,
    rated_torque: f64,
    network: Network,
    drive: Drive,
    objects: Objects,
    /// Frames of receive PDOs that wait for SYNC.
    waiting: [Option<Frame>; 4],
    syncs: u32,
    heartbeat_ns: u64,
    master_ns: Option<u64>,
    /// The master's heartbeat was lost and has not come back.
    alone: bool,
    reported_fault: u32,
}

impl Cia402 {
    pub(super) fn new(settings: &Settings, _common: Common) -> Cia402 {
        let node = settings.integer("node") as u16;
        let rated_torque = settings.number("rated_torque");
        let counts_per_turn = settings.number("counts_per_turn");
        let mut objects = Objects::new(node);
        objects.rated_torque = (rated_torque * 1000.0) as u32;
        Cia402 {
            node,
            counts_per_turn,
            velocity_counts_per_turn: settings
                .number_or("velocity_counts_per_turn", counts_per_turn),
            rated_torque,
            network: Network::Boot,
            drive: Drive::default(),
            objects,
            waiting: [None; 4],
            syncs: 0,
            heartbeat_ns: 0,
            master_ns: None,
            alone: false,
            reported_fault: 0,
        }
    }

    /// All objects that show how the motor is.
    fn measure(&mut self, plant: &Plant) {
        let per_rad = self.counts_per_turn / TAU;
        let velocity = (plant.velocity * self.velocity_counts_per_turn / TAU).round() as i32;
        let torque = (plant.torque / self.rated_torque * 1000.0).round() as i16;
        self.objects.set(Object::Position, (plant.measured() * per_rad).round() as i32);
        self.objects.set(Object::Velocity, velocity);
        self.objects.set(Object::Torque, i32::from(torque));
        self.objects.set(Object::Status, i32::from(self.drive.status_word()));
        self.objects.set(Object::ErrorCode, plant.fault as i32);
    }

    /// Follows the control word, the mode and the targets.
    fn control(&mut self, plant: &mut Plant) {
        if self.drive.control(self.objects.get(Object::Control) as u16) {
            plant.fault = 0;
        }
        match self.drive.state {
            State::OperationEnabled => plant.start(),
            // 605A is 2: the speed goes to zero, then the power
            State::QuickStop if plant.power && plant.velocity.abs() > STILL => {
                let [_, damping] = OWN_GAINS;
                plant.follow(Setpoint { damping, ..Setpoint::default() });
                return;
            }
            State::QuickStop => {
                self.drive.disable();
                plant.stop();
            }
            _ => plant.stop(),
        }
        let rad = TAU / self.counts_per_turn;
        let rad_per_second = TAU / self.velocity_counts_per_turn;
        plant.physics.torque_limit =
            f64::from(self.objects.max_torque) / 1000.0 * self.rated_torque;
        let per_mille = self.rated_torque / 1000.0;
        let [stiffness, damping] = OWN_GAINS;
        let number = |object| f64::from(self.objects.get(object));
        let torque = number(Object::TorqueOffset) * per_mille;
        let velocity = number(Object::VelocityOffset) * rad_per_second;
        let law = match self.objects.mode() {
            Some(Mode::Position) => {
                let position = number(Object::TargetPosition) * rad;
                Setpoint { position, velocity, torque, stiffness, damping }
            }
            Some(Mode::Velocity) => {
                let velocity = number(Object::TargetVelocity) * rad_per_second + velocity;
                Setpoint { velocity, torque, damping, ..Setpoint::default() }
            }
            Some(Mode::Torque) => Setpoint {
                torque: number(Object::TargetTorque) * per_mille + torque,
                ..Setpoint::default()
            },
            _ => Setpoint::default(),
        };
        plant.follow(law);
    }

    fn network(&mut self, command: u8, plant: &mut Plant, out: &mut FrameQueue) {
        match command {
            0x01 => self.network = Network::Operational,
            0x02 => self.network = Network::Stopped,
            0x80 => self.network = Network::PreOperational,
            0x81 | 0x82 => {
                self.network = Network::Boot;
                let rated_torque = self.objects.rated_torque;
                self.objects = Objects::new(self.node);
                self.objects.rated_torque = rated_torque;
                (self.master_ns, self.alone) = (None, false);
                self.drive = Drive::default();
                plant.stop();
                self.boot(out);
            }
            _ => {}
        }
        if self.network != Network::Operational {
            self.waiting = [None; 4];
        }
        if self.network == Network::Stopped {
            // a state without PDOs stops the motor
            self.drive.disable();
            plant.stop();
        }
    }

    fn tell(&self, base: u16, bytes: &[u8], out: &mut FrameQueue) {
        out.push_some(standard(u32::from(base + self.node), bytes));
    }

    fn boot(&mut self, out: &mut FrameQueue) {
        if self.network == Network::Boot {
            self.tell(0x700, &[0], out);
            self.network = Network::PreOperational;
        }
    }

    fn heartbeat(&self, out: &mut FrameQueue) {
        let state = match self.network {
            Network::Boot => 0x00,
            Network::Stopped => 0x04,
            Network::Operational => 0x05,
            Network::PreOperational => 0x7F,
        };
        self.tell(0x700, &[state], out);
    }

    /// Takes the content of a receive PDO.
    fn take(&mut self, place: usize, frame: &Frame, plant: &mut Plant) {
        let Some(pdo) = self.objects.receive.get(place).copied() else { return };
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(frame.data()).for_each(|(byte, given)| *byte = *given);
        let mut bits = u64::from_le_bytes(bytes);
        if pdo.length_bits() > 8 * frame.data().len() as u32 {
            return;
        }
        for object in pdo.mapped() {
            let value = bits & object.mask();
            self.objects.set(object, value as i32);
            bits = bits.checked_shr(object.bits()).unwrap_or(0);
        }
        self.control(plant);
    }

    fn give(&self, pdo: &Pdo, out: &mut FrameQueue) {
        let mut content = 0u64;
        let mut used = 0;
        for object in pdo.mapped() {
            content |=
                (self.objects.get(object) as u64 & object.mask()).checked_shl(used).unwrap_or(0);
            used += object.bits();
        }
        let bytes = content.to_le_bytes();
        out.push_some(standard(
            pdo.id & 0x7FF,
            bytes.get(..used.div_ceil(8) as usize).unwrap_or_default(),
        ));
    }

    fn sync(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        if self.network != Network::Operational {
            return;
        }
        self.syncs += 1;
        for place in 0..self.waiting.len() {
            if let Some(frame) = self.waiting.get_mut(place).and_then(Option::take) {
                self.take(place, &frame, plant);
            }
        }
        self.measure(plant);
        for pdo in self.objects.transmit {
            let each = u32::from(pdo.kind).max(1);
            if pdo.is_valid() && pdo.kind <= 240 && self.syncs.is_multiple_of(each) {
                self.give(&pdo, out);
            }
        }
    }

    /// The master is silent.
    fn lose_heartbeat(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        (self.master_ns, self.alone) = (None, true);
        if self.network == Network::Operational {
            self.network = Network::PreOperational;
            self.waiting = [None; 4];
        }
        self.tell(0x80, &emergency(HEARTBEAT_LOST, 0x10), out);
        if plant.power {
            plant.tripped_ns = Some(plant.now_ns);
        }
        match self.objects.abort_option {
            1 => {
                plant.fault = u32::from(HEARTBEAT_LOST);
                self.reported_fault = plant.fault;
                self.drive.fault();
            }
            2 => self.drive.disable(),
            3 => self.drive.quick_stop(),
            _ => return,
        }
        if self.drive.state != State::OperationEnabled {
            plant.stop();
        }
    }
}

impl Firmware for Cia402 {
    fn receive(&mut self, frame: &Frame, plant: &mut Plant, out: &mut FrameQueue) -> bool {
        let Id::Standard(id) = frame.id else { return false };
        let (master, master_ms) = self.objects.consumer();
        if id == 0x700 + master && master_ms > 0 {
            self.master_ns = Some(plant.now_ns);
            if core::mem::take(&mut self.alone) && plant.fault == 0 {
                self.tell(0x80, &emergency(0, 0), out);
            }
            return true;
        }
        if id == 0x000 {
            let &[command, node, ..] = frame.data() else { return false };
            let mine = node == 0 || u16::from(node) == self.node;
            if mine {
                self.network(command, plant, out);
            }
            return mine;
        }
        if id == 0x080 {
            self.sync(plant, out);
            // not for this motor alone, and no command
            return false;
        }
        if id == 0x600 + self.node {
            if self.network != Network::Stopped {
                self.measure(plant);
                sdo::answer(&mut self.objects, 0x580 + u32::from(self.node), frame, out);
                // control words work over SDO too, which is how commissioning tools use them
                if core::mem::take(&mut self.objects.written) == Some(Object::Control) {
                    self.control(plant);
                }
            }
            return true;
        }
        let place = self
            .objects
            .receive
            .iter()
            .position(|pdo| pdo.is_valid() && pdo.id & 0x7FF == u32::from(id));
        let Some(place) = place else { return false };
        if self.network == Network::Operational {
            let is_synchronous = self.objects.receive.get(place).is_some_and(|pdo| pdo.kind <= 240);
            match self.waiting.get_mut(place) {
                Some(waiting) if is_synchronous => *waiting = Some(*frame),
                _ => self.take(place, frame, plant),
            }
        }
        true
    }

    fn step(&mut self, plant: &mut Plant, out: &mut FrameQueue) {
        self.boot(out);
        let period_ns = u64::from(self.objects.producer_ms) * 1_000_000;
        if period_ns > 0 && plant.now_ns >= self.heartbeat_ns {
            self.heartbeat_ns = plant.now_ns + period_ns;
            self.heartbeat(out);
        }
        let (_, master_ms) = self.objects.consumer();
        plant.watchdog_ns = u64::from(master_ms) * 1_000_000;
        // it is watched from its first heartbeat on
        if self
            .master_ns
            .is_some_and(|master_ns| plant.now_ns.saturating_sub(master_ns) > plant.watchdog_ns)
            && master_ms > 0
        {
            self.lose_heartbeat(plant, out);
        }
        if plant.fault != self.reported_fault {
            self.reported_fault = plant.fault;
            if plant.fault != 0 {
                self.drive.fault();
                plant.stop();
            }
            let code = plant.fault as u16;
            self.tell(0x80, &emergency(code, u8::from(code != 0)), out);
        }
        let status = self.objects.get(Object::Status);
        self.measure(plant);
        if self.network == Network::Operational && status != self.objects.get(Object::Status) {
            let asynchronous =
                self.objects.transmit.into_iter().filter(|pdo| pdo.is_valid() && pdo.kind >= 254);
            asynchronous.for_each(|pdo| self.give(&pdo, out));
        }
    }
}

/// Data of an EMCY.
fn emergency(code: u16, register: u8) -> [u8; 8] {
    let [low, high] = code.to_le_bytes();
    [low, high, register, 0, 0, 0, 0, 0]
}
