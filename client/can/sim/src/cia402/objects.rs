//! The object dictionary of the simulated drive, and the mappings of its PDOs.

use sarrus_can_core::drive::Mode;

/// Objects that PDOs can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Object {
    Control,
    Status,
    Modes,
    ModesDisplay,
    TargetPosition,
    TargetVelocity,
    TargetTorque,
    VelocityOffset,
    TorqueOffset,
    Position,
    Velocity,
    Torque,
    ErrorCode,
}

/// Index, bits, and whether a receive PDO may hold it; in the order of [`Object`].
const MAPPABLE: [(Object, u16, u32, bool); 13] = [
    (Object::Control, 0x6040, 16, true),
    (Object::Status, 0x6041, 16, false),
    (Object::Modes, 0x6060, 8, true),
    (Object::ModesDisplay, 0x6061, 8, false),
    (Object::TargetPosition, 0x607A, 32, true),
    (Object::TargetVelocity, 0x60FF, 32, true),
    (Object::TargetTorque, 0x6071, 16, true),
    (Object::VelocityOffset, 0x60B1, 32, true),
    (Object::TorqueOffset, 0x60B2, 16, true),
    (Object::Position, 0x6064, 32, false),
    (Object::Velocity, 0x606C, 32, false),
    (Object::Torque, 0x6077, 16, false),
    (Object::ErrorCode, 0x603F, 16, false),
];

impl Object {
    /// The object of an index.
    pub(super) fn at(index: u16) -> Option<(Object, bool)> {
        let (object, _, _, is_writable) = MAPPABLE.iter().find(|(_, at, ..)| *at == index)?;
        Some((*object, *is_writable))
    }

    pub(super) fn bits(self) -> u32 {
        MAPPABLE[self as usize].2
    }

    pub(super) fn mask(self) -> u64 {
        (1 << self.bits()) - 1
    }

    fn index(self) -> u16 {
        MAPPABLE[self as usize].1
    }
}

/// A process data object: its communication (14xx, 18xx) and mapping (16xx, 1Axx).
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo {
    /// COB-ID; bit 31 switches it off.
    pub(super) id: u32,
    /// Transmission type: 0 to 240 with SYNC, 254 and 255 asynchronous.
    pub(super) kind: u8,
    entries: [Option<Object>; 8],
    count: u8,
}

impl Pdo {
    fn new(id: u32, kind: u8, objects: &[Object]) -> Pdo {
        let mut entries = [None; 8];
        entries.iter_mut().zip(objects).for_each(|(entry, object)| *entry = Some(*object));
        Pdo { id, kind, entries, count: objects.len() as u8 }
    }

    pub(super) fn is_valid(&self) -> bool {
        self.id >> 31 == 0 && self.count > 0
    }

    pub(super) fn mapped(&self) -> impl Iterator<Item = Object> {
        self.entries.into_iter().take(usize::from(self.count)).flatten()
    }

    /// Its value and the bytes of it at an index: 14xx and 18xx, 16xx and 1Axx.
    fn read(&self, index: u16, sub: u8) -> Result<(u32, usize), Abort> {
        let is_mapping = index & 0x0200 != 0;
        match sub {
            0 if is_mapping => Ok((u32::from(self.count), 1)),
            _ if is_mapping => {
                let entry = self.entries.get(usize::from(sub) - 1).ok_or(NO_SUBINDEX)?;
                Ok((entry.map_or(0, |object| u32::from(object.index()) << 16 | object.bits()), 4))
            }
            0 => Ok((2, 1)),
            1 => Ok((self.id, 4)),
            2 => Ok((u32::from(self.kind), 1)),
            3 | 5 => Ok((0, 2)),
            _ => Err(NO_SUBINDEX),
        }
    }

    pub(super) fn length_bits(&self) -> u32 {
        self.mapped().map(Object::bits).sum()
    }
}

/// Why a SDO is refused.
pub(super) type Abort = u32;
pub(super) const NO_OBJECT: Abort = 0x0602_0000;
pub(super) const NO_SUBINDEX: Abort = 0x0609_0011;
pub(super) const READ_ONLY: Abort = 0x0601_0002;
pub(super) const NOT_MAPPABLE: Abort = 0x0604_0041;
pub(super) const TOO_LONG: Abort = 0x0604_0042;
pub(super) const WRONG_LENGTH: Abort = 0x0607_0010;
pub(super) const NOT_NOW: Abort = 0x0800_0022;

/// All objects.
#[derive(Debug)]
pub(super) struct Objects {
    /// Values of [`MAPPABLE`], in its order.
    values: [i32; MAPPABLE.len()],
    /// 6076 in mN m.
    pub(super) rated_torque: u32,
    /// 6007: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop.
    pub(super) abort_option: i16,
    /// 1016:1.
    consumer: u32,
    /// 1017.
    pub(super) producer_ms: u16,
    interpolation: u8,
    /// 6072 in thousandths of the rated torque.
    pub(super) max_torque: u16,
    pub(super) receive: [Pdo; 4],
    pub(super) transmit: [Pdo; 4],
    /// Object that the last SDO wrote.
    pub(super) written: Option<Object>,
}

impl Objects {
    /// As a new drive has them; the PDOs as CiA 402 predefines them.
    pub(super) fn new(node: u16) -> Objects {
        let at = |base: u32| base + u32::from(node);
        let receive = [
            Pdo::new(at(0x200), 255, &[Object::Control]),
            Pdo::new(at(0x300), 255, &[Object::Control, Object::Modes]),
            Pdo::new(at(0x400), 255, &[Object::Control, Object::TargetPosition]),
            Pdo::new(at(0x500), 255, &[Object::Control, Object::TargetVelocity]),
        ];
        let transmit = [
            Pdo::new(at(0x180), 255, &[Object::Status]),
            Pdo::new(at(0x8000_0280), 255, &[Object::Status, Object::ModesDisplay]),
            Pdo::new(at(0x8000_0380), 255, &[Object::Status, Object::Position]),
            Pdo::new(at(0x8000_0480), 255, &[Object::Status, Object::Velocity]),
        ];
        Objects {
            values: [0; MAPPABLE.len()],
            rated_torque: 0,
            abort_option: 1,
            consumer: 0,
            producer_ms: 0,
            interpolation: 1,
            max_torque: 3000,
            receive,
            transmit,
            written: None,
        }
    }

    /// The mode that 6060 says, if the drive has it.
    pub(super) fn mode(&self) -> Option<Mode> {
        match self.get(Object::Modes) {
            8 => Some(Mode::Position),
            9 => Some(Mode::Velocity),
            10 => Some(Mode::Torque),
            _ => None,
        }
    }

    /// The node whose heartbeat is watched, and the time `[ms]`.
    pub(super) fn consumer(&self) -> (u16, u32) {
        ((self.consumer >> 16 & 0x7F) as u16, self.consumer & 0xFFFF)
    }

    /// A mappable object; its sign is extended beyond its own bits.
    pub(super) fn get(&self, object: Object) -> i32 {
        match object {
            Object::ModesDisplay if self.mode().is_none() => 0,
            Object::ModesDisplay => self.get(Object::Modes),
            _ => self.values.get(object as usize).copied().unwrap_or_default(),
        }
    }

    /// Sets a mappable object to the lower bits of a number, as many as the object has.
    pub(super) fn set(&mut self, object: Object, value: i32) {
        let unused = 32 - object.bits();
        if let Some(place) = self.values.get_mut(object as usize) {
            *place = value << unused >> unused;
        }
    }

    /// Reads by SDO: the value and its bytes.
    pub(super) fn upload(&self, index: u16, sub: u8) -> Result<(u32, usize), Abort> {
        if let (Some((object, _)), 0) = (Object::at(index), sub) {
            return Ok((self.get(object) as u32, object.bits() as usize / 8));
        }
        let pdo = |pdos: &[Pdo; 4]| pdos.get(usize::from(index & 0xFF)).copied().ok_or(NO_OBJECT);
        match (index, sub) {
            (0x1000, 0) => Ok((0x0002_0192, 4)),
            (0x1001, 0) => Ok((u32::from(self.get(Object::ErrorCode) != 0), 1)),
            (0x1016, 0) => Ok((1, 1)),
            (0x1016, 1) => Ok((self.consumer, 4)),
            (0x1017, 0) => Ok((u32::from(self.producer_ms), 2)),
            (0x1018, 0) => Ok((1, 1)),
            (0x1018, 1) => Ok((0, 4)),
            (0x6007, 0) => Ok((self.abort_option as u32, 2)),
            (0x6072, 0) => Ok((u32::from(self.max_torque), 2)),
            (0x6075 | 0x6079, 0) => Ok((24_000, 4)),
            (0x6076, 0) => Ok((self.rated_torque, 4)),
            (0x6502, 0) => Ok((1 << 7 | 1 << 8 | 1 << 9, 4)),
            (0x60C2, 1) => Ok((u32::from(self.interpolation), 1)),
            (0x1400..=0x1403 | 0x1600..=0x1603, _) => pdo(&self.receive)?.read(index, sub),
            (0x1800..=0x1803 | 0x1A00..=0x1A03, _) => pdo(&self.transmit)?.read(index, sub),
            (0x1016 | 0x1018 | 0x6007 | 0x6072 | 0x6076 | 0x60C2, _) => Err(NO_SUBINDEX),
            _ => Err(NO_OBJECT),
        }
    }

    /// Writes by SDO.
    pub(super) fn download(
        &mut self,
        index: u16,
        sub: u8,
        value: u32,
        bytes: usize,
    ) -> Result<(), Abort> {
        let (_, desired) = self.upload(index, sub)?;
        if bytes != desired {
            return Err(WRONG_LENGTH);
        }
        match (index, sub, Object::at(index)) {
            (_, 0, Some((object, true))) => {
                self.set(object, value as i32);
                self.written = Some(object);
                return Ok(());
            }
            (0x1016, 1, _) => self.consumer = value,
            (0x1017, 0, _) => self.producer_ms = value as u16,
            (0x6007, 0, _) => self.abort_option = value as i16,
            (0x6072, 0, _) => self.max_torque = value as u16,
            (0x6076, 0, _) => self.rated_torque = value,
            (0x60C2, 1, _) => self.interpolation = value as u8,
            (0x1400..=0x1403 | 0x1600..=0x1603, _, _) => {
                return change(&mut self.receive, index, sub, value, true);
            }
            (0x1800..=0x1803 | 0x1A00..=0x1A03, _, _) => {
                return change(&mut self.transmit, index, sub, value, false);
            }
            _ => return Err(READ_ONLY),
        }
        Ok(())
    }
}

/// A PDO is switched off before its identifier or its mapping may change, and its mapping is empty
/// while it changes.
fn change(
    pdos: &mut [Pdo; 4],
    index: u16,
    sub: u8,
    value: u32,
    is_received: bool,
) -> Result<(), Abort> {
    let pdo = pdos.get_mut(usize::from(index & 0xFF)).ok_or(NO_OBJECT)?;
    let is_off = pdo.id >> 31 == 1;
    if index & 0x0200 == 0 {
        return match sub {
            1 if is_off || value >> 31 == 1 => {
                pdo.id = value;
                Ok(())
            }
            2 => {
                pdo.kind = value as u8;
                Ok(())
            }
            1 => Err(NOT_NOW),
            3 | 5 => Ok(()),
            _ => Err(READ_ONLY),
        };
    }
    match sub {
        _ if !is_off => Err(NOT_NOW),
        0 => {
            pdo.count = value as u8;
            if value > 8 || pdo.mapped().count() != value as usize || pdo.length_bits() > 64 {
                Err(TOO_LONG)
            } else {
                Ok(())
            }
        }
        _ if pdo.count != 0 => Err(NOT_NOW),
        _ => {
            let (object, writable) = Object::at((value >> 16) as u16).ok_or(NO_OBJECT)?;
            if value & 0xFFFF != object.bits() || is_received && !writable {
                return Err(NOT_MAPPABLE);
            }
            *pdo.entries.get_mut(usize::from(sub) - 1).ok_or(NO_SUBINDEX)? = Some(object);
            Ok(())
        }
    }
}
