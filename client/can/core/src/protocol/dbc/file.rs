//! DBC files: the messages and signals in them.
//!
//! Source: Vector, "DBC File Format Documentation" 1.0.5: `BO_` messages, `SG_` signals,
//! `SIG_VALTYPE_` floats. The rest of a file is ignored.

/// A message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    pub(super) name: String,
    /// Identifier; bit 31 marks an extended one.
    pub(super) id: u32,
    pub(super) len: usize,
    pub(super) signals: Vec<Signal>,
}

/// The encoding of a signal's bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Unsigned,
    Signed,
    Single,
    Double,
}

/// When a signal is present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Multiplexing {
    Always,
    /// It is the switch.
    Switch,
    /// While the switch has this value.
    While(u64),
}

/// A signal: physical value = raw × factor + offset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Signal {
    pub(super) name: String,
    pub(super) multiplexing: Multiplexing,
    pub(super) start: u32,
    pub(super) bits: u32,
    pub(super) is_intel: bool,
    pub(super) kind: Kind,
    pub(super) factor: f64,
    pub(super) offset: f64,
}

/// The message under which tools keep signals of no message: it has no bytes, and an identifier
/// that is none.
const NO_MESSAGE: (&str, &str) = ("VECTOR__INDEPENDENT_SIG_MSG", "3221225472");

/// A fault and its line.
pub(super) type Fault = (usize, String);

/// Reads the messages of a file.
pub(super) fn parse(text: &str) -> Result<Vec<Message>, Fault> {
    let mut messages: Vec<Message> = Vec::new();
    let mut is_message = true;
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        let error = |what: &str| (i + 1, what.to_owned());
        if let Some(rest) = line.strip_prefix("BO_ ") {
            is_message = !rest.split([' ', ':']).any(|word| word == NO_MESSAGE.0);
            if !is_message {
                continue;
            }
            messages.push(
                message(rest).ok_or_else(|| {
                    error("`BO_` is not followed by identifier, name: and length")
                })?,
            );
        } else if let Some(rest) = line.strip_prefix("SG_ ") {
            if !is_message {
                continue;
            }
            let signal = signal(rest).ok_or_else(|| {
                error("`SG_` is not followed by name : start|length@order (factor,offset)")
            })?;
            let message =
                messages.last_mut().ok_or_else(|| error("a signal stands before all messages"))?;
            if !signal.fits(message.len) {
                return Err(error("a signal does not fit into its message"));
            }
            message.signals.push(signal);
        } else if let Some(rest) = line.strip_prefix("SIG_VALTYPE_ ") {
            if rest.split_whitespace().next() == Some(NO_MESSAGE.1) {
                continue;
            }
            float(rest, &mut messages)
                .ok_or_else(|| error("`SIG_VALTYPE_` names no signal of 32 or 64 bits"))?;
        } else if line.starts_with("SG_MUL_VAL_ ") {
            return Err(error("switches of switches (`SG_MUL_VAL_`) are not known"));
        }
    }
    Ok(messages)
}

fn message(rest: &str) -> Option<Message> {
    let (head, tail) = rest.split_once(':')?;
    let mut words = head.split_whitespace();
    let id: u32 = words.next()?.parse().ok()?;
    let name: String = words.next()?.to_owned();
    let len = tail.split_whitespace().next()?.parse().ok()?;
    let is_good = len <= 64 && ((id >> 31 == 1 && id & 0x7FFF_FFFF < 1 << 29) || id < 1 << 11);
    is_good.then_some(Message { name, id, len, signals: Vec::new() })
}

fn signal(rest: &str) -> Option<Signal> {
    let (head, tail) = rest.split_once(':')?;
    let mut words = head.split_whitespace();
    let name = words.next()?.to_owned();
    let multiplexing = match words.next() {
        None => Multiplexing::Always,
        Some("M") => Multiplexing::Switch,
        Some(word) => Multiplexing::While(word.strip_prefix('m')?.parse().ok()?),
    };
    let (place, scale) = tail.trim().split_once('(')?;
    let (start, place) = place.trim().split_once('|')?;
    let (bits, order) = place.split_once('@')?;
    let (is_intel, kind) = match order.trim() {
        "1+" => (true, Kind::Unsigned),
        "1-" => (true, Kind::Signed),
        "0+" => (false, Kind::Unsigned),
        "0-" => (false, Kind::Signed),
        _ => return None,
    };
    let (factor, offset) = scale.split_once(')')?.0.split_once(',')?;
    let factor: f64 = factor.trim().parse().ok()?;
    let offset: f64 = offset.trim().parse().ok()?;
    let start = start.trim().parse().ok()?;
    let bits = bits.trim().parse().ok()?;
    let is_good = factor.is_finite()
        && factor != 0.0
        && offset.is_finite()
        && (1..=64).contains(&bits)
        && start < 512;
    is_good.then_some(Signal { name, multiplexing, start, bits, is_intel, kind, factor, offset })
}

fn float(rest: &str, messages: &mut [Message]) -> Option<()> {
    let (head, tail) = rest.split_once(':')?;
    let mut words = head.split_whitespace();
    let id: u32 = words.next()?.parse().ok()?;
    let name: &str = words.next()?;
    let message = messages.iter_mut().find(|message| message.id == id)?;
    let signal = message.signals.iter_mut().find(|signal| signal.name == name)?;
    signal.kind = match (tail.trim().trim_end_matches(';').trim(), signal.bits) {
        ("0", _) => return Some(()),
        ("1", 32) => Kind::Single,
        ("2", 64) => Kind::Double,
        _ => return None,
    };
    Some(())
}

impl Signal {
    /// Place of bit `i`, from the lowest: byte, and bit in it.
    ///
    /// Intel counts on from the start bit, which is the lowest. With Motorola the start bit is the
    /// highest; the next lower ones follow down in its byte and then from bit 7 of the next byte.
    fn place(&self, i: u32) -> (usize, u32) {
        if self.is_intel {
            let bit = self.start + i;
            return ((bit / 8) as usize, bit % 8);
        }
        let from_top = (self.start / 8) * 8 + (7 - self.start % 8) + (self.bits - 1 - i);
        ((from_top / 8) as usize, 7 - from_top % 8)
    }

    /// Whether all of it is within `len` bytes.
    fn fits(&self, len: usize) -> bool {
        (0..self.bits).all(|i| self.place(i).0 < len)
    }

    /// The bits of a message.
    pub(super) fn raw(&self, bytes: &[u8]) -> u64 {
        (0..self.bits).fold(0, |raw, i| {
            let (byte, bit) = self.place(i);
            raw | u64::from(bytes.get(byte).copied().unwrap_or_default() >> bit & 1) << i
        })
    }

    /// Sets the bits of a message.
    pub(super) fn set_raw(&self, raw: u64, bytes: &mut [u8]) {
        for i in 0..self.bits {
            let (byte, bit) = self.place(i);
            if let Some(byte) = bytes.get_mut(byte) {
                *byte = (*byte & !(1 << bit)) | ((raw >> i & 1) as u8) << bit;
            }
        }
    }

    /// The physical value in a message.
    pub(super) fn value(&self, bytes: &[u8]) -> f64 {
        let raw = self.raw(bytes);
        let unused = 64 - self.bits;
        let number = match self.kind {
            Kind::Unsigned => raw as f64,
            Kind::Signed => ((raw << unused) as i64 >> unused) as f64,
            Kind::Single => f64::from(f32::from_bits(raw as u32)),
            Kind::Double => f64::from_bits(raw),
        };
        number * self.factor + self.offset
    }

    /// Sets the physical value: the nearest one, or the end that it is beyond; NaN is the value of
    /// raw 0.
    pub(super) fn set_value(&self, value: f64, bytes: &mut [u8]) {
        self.set_number((value - self.offset) / self.factor, bytes);
    }

    /// As [`Signal::set_value`], and between two raw values that of the smaller size, to a
    /// millionth of a step.
    pub(super) fn set_toward_zero(&self, value: f64, bytes: &mut [u8]) {
        let number = (value - self.offset) / self.factor;
        let is_down = (value >= 0.0) == (self.factor > 0.0);
        let whole = match self.kind {
            Kind::Single | Kind::Double => number,
            _ if is_down => (number + 1e-6).floor(),
            _ => (number - 1e-6).ceil(),
        };
        self.set_number(whole, bytes);
    }

    fn set_number(&self, number: f64, bytes: &mut [u8]) {
        let number = if number.is_nan() { 0.0 } else { number };
        let half = 2_f64.powi(self.bits as i32 - 1);
        let unused = 64 - self.bits;
        let raw = match self.kind {
            // casts saturate; ends of 64 bits are no singles of their own
            Kind::Unsigned => {
                (number.round().clamp(0.0, 2.0 * half) as u64).min(u64::MAX >> unused)
            }
            Kind::Signed => (number.round().clamp(-half, half) as i64)
                .min((u64::MAX >> unused >> 1) as i64) as u64,
            Kind::Single => {
                u64::from((number.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32).to_bits())
            }
            Kind::Double => number.clamp(f64::MIN, f64::MAX).to_bits(),
        };
        self.set_raw(raw, bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"VERSION ""
BU_: Host Motor

BO_ 496 Example: 8 Host
 SG_ Temperature : 0|12@0- (0.01,250) [229.53|270.47] "degK" Motor,Host
 SG_ AverageRadius : 6|6@0+ (0.1,0) [0|5] "m" Motor
 SG_ Enable : 7|1@0+ (1,0) [0|0] "-" Motor
BO_ 2147484672 Long: 8 Motor
 SG_ Switch M : 0|8@1+ (1,0) [0|255] "" Host
 SG_ Angle m3 : 8|32@1- (1,0) [0|0] "rad" Host
SIG_VALTYPE_ 2147484672 Angle : 1;
"#;

    #[test]
    fn the_example_of_motohawk_is_read() {
        let messages = parse(FILE).unwrap();
        let [example, long] = messages.as_slice() else { panic!("two messages") };
        // Enable 1, AverageRadius 3.2, Temperature 250.55 are C0 06 E0
        let mut bytes = [0; 8];
        for (signal, value) in example.signals.iter().zip([250.55, 3.2, 1.0]) {
            signal.set_value(value, &mut bytes);
        }
        assert_eq!(bytes[..3], [0xC0, 0x06, 0xE0]);
        assert!((example.signals[0].value(&bytes) - 250.55).abs() < 1e-9);
        assert_eq!((long.id, long.signals[1].kind), (0x8000_0400, Kind::Single));
        assert_eq!(long.signals[1].multiplexing, Multiplexing::While(3));
    }

    #[test]
    fn signals_of_no_message_are_passed_over() {
        let none = "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ Old : 0|32@1- \
            (1,0) [0|0] \"\" Vector__XXX\n\n";
        let text = FILE.replace("BO_ 2147484672", &format!("{none}BO_ 2147484672"));
        let text = format!("{text}SIG_VALTYPE_ 3221225472 Old : 1;\n");
        assert_eq!(parse(&text), parse(FILE));
        // a message of that kind after the last signal of another takes none of its signals away
        assert_eq!(parse(&format!("{FILE}{none}")), parse(FILE));
    }

    #[test]
    fn faults_are_told_with_their_line() {
        for (text, line) in [
            ("BO_ x Name: 8 A", 1),
            ("BO_ 4096 Name: 8 A", 1),
            (" SG_ A : 0|8@1+ (1,0) [0|0] \"\" X", 1),
            ("BO_ 1 N: 1 A\n SG_ A : 4|8@1+ (1,0) [0|0] \"\" X", 2),
            ("BO_ 1 N: 1 A\n SG_ A : 0|0@1+ (1,0) [0|0] \"\" X", 2),
            ("BO_ 1 N: 1 A\n\n SG_ A : 0|8@1+ (0,0) [0|0] \"\" X", 3),
            ("SG_MUL_VAL_ 1 A B 1-2;", 1),
        ] {
            assert_eq!(parse(text).unwrap_err().0, line, "{text}");
        }
    }

    #[test]
    fn towards_zero_no_value_grows() {
        let messages = parse(FILE).unwrap();
        let temperature = &messages[0].signals[0];
        let set = |value: f64| {
            let mut bytes = [0; 8];
            temperature.set_toward_zero(value, &mut bytes);
            temperature.value(&bytes)
        };
        for (value, sent) in [(250.558, 250.55), (249.998, 249.99), (250.55, 250.55)] {
            assert!((set(value) - sent).abs() < 1e-9, "{value} {}", set(value));
        }
    }

    #[test]
    fn values_saturate() {
        let signal = |bits, kind| Signal {
            name: String::new(),
            multiplexing: Multiplexing::Always,
            start: 0,
            bits,
            is_intel: true,
            kind,
            factor: 1.0,
            offset: 0.0,
        };
        for bits in [1, 7, 31, 63, 64] {
            let mut bytes = [0; 8];
            signal(bits, Kind::Unsigned).set_value(1e300, &mut bytes);
            assert_eq!(u64::from_le_bytes(bytes), u64::MAX >> (64 - bits));
            let mut bytes = [0; 8];
            signal(bits, Kind::Signed).set_value(-1e300, &mut bytes);
            assert_eq!(u64::from_le_bytes(bytes), 1 << (bits - 1));
            signal(bits, Kind::Signed).set_value(1e300, &mut bytes);
            assert_eq!(u64::from_le_bytes(bytes), (1 << (bits - 1)) - 1);
        }
    }
}
