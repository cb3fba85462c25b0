//! Orders on stdin: reports and faults.
//!
//! `report` | `fault MOTOR CODE` (0 removes it) | `reboot MOTOR` | `silence MOTOR on|off` |
//! `wrong_id MOTOR on|off` | `loss PART` | `delay MS` | `warning` | `passive` | `busoff` | `active`
//! (the adapter's state, over slcan). `loss`, `delay` and the adapter's state are for all buses, or
//! for one whose name follows.

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_sim::Simulated;

use super::line::Line;
use super::motors::Motors;
use sarrus_can_run::bus::BusError;

/// A line that was understood.
#[derive(Debug, PartialEq)]
pub(super) enum Order {
    Report,
    Fault(String, u32),
    Reboot(String),
    Silence(String, bool),
    WrongId(String, bool),
    Loss(f64, Option<String>),
    Delay(u64, Option<String>),
    State(BusEvent, Option<String>),
}

/// Reads a line; the error is the expectation.
pub(super) fn read(line: &str) -> Result<Order, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let bus = |bus: &[&str]| bus.first().map(|bus| (*bus).to_owned());
    let state = |event, bus: Option<String>| Ok(Order::State(event, bus));
    match words.as_slice() {
        ["report"] => Ok(Order::Report),
        ["fault", motor, code] => {
            let code = match code.strip_prefix("0x") {
                Some(digits) => u32::from_str_radix(digits, 16).ok(),
                None => code.parse().ok(),
            };
            code.map(|code| Order::Fault((*motor).to_owned(), code))
                .ok_or_else(|| "the code is a whole number".to_owned())
        }
        ["reboot", motor] => Ok(Order::Reboot((*motor).to_owned())),
        ["silence", motor, on @ ("on" | "off")] => {
            Ok(Order::Silence((*motor).to_owned(), *on == "on"))
        }
        ["wrong_id", motor, on @ ("on" | "off")] => {
            Ok(Order::WrongId((*motor).to_owned(), *on == "on"))
        }
        ["loss", part, rest @ ..] if rest.len() < 2 => match part.parse() {
            Ok(part) if (0.0..=1.0).contains(&part) => Ok(Order::Loss(part, bus(rest))),
            _ => Err("the part that is lost is a number from 0 to 1".to_owned()),
        },
        ["delay", ms, rest @ ..] if rest.len() < 2 => match ms.parse::<f64>() {
            Ok(ms) if (0.0..=1e6).contains(&ms) => Ok(Order::Delay((ms * 1e6) as u64, bus(rest))),
            _ => Err("the delay is a number of milliseconds".to_owned()),
        },
        ["active", rest @ ..] if rest.len() < 2 => state(BusEvent::ErrorActive, bus(rest)),
        ["warning", rest @ ..] if rest.len() < 2 => state(BusEvent::ErrorWarning, bus(rest)),
        ["passive", rest @ ..] if rest.len() < 2 => state(BusEvent::ErrorPassive, bus(rest)),
        ["busoff", rest @ ..] if rest.len() < 2 => state(BusEvent::BusOff, bus(rest)),
        _ => {
            Err("expected report, fault MOTOR CODE, reboot MOTOR, silence MOTOR on|off, wrong_id \
            MOTOR on|off, loss PART, delay MS, \
                  active, warning, passive or busoff"
                .to_owned())
        }
    }
}

/// Obeys an order; failures are reported on stderr.
pub(super) fn obey(
    order: &Order,
    now_ns: u64,
    motors: &mut Motors,
    lines: &mut [Line],
) -> Result<(), BusError> {
    let done = match order {
        Order::Report => {
            let _ = crate::tell(motors.report(now_ns, lines.iter().map(Line::report).collect()));
            true
        }
        Order::Fault(motor, code) => motors.with(motor, |motor| motor.fault(*code)),
        Order::Reboot(motor) => motors.with(motor, Simulated::reboot),
        Order::Silence(motor, on) => motors.with(motor, |motor| motor.silence(*on)),
        Order::WrongId(motor, on) => motors.with(motor, |motor| motor.answer_wrongly(*on)),
        Order::Loss(part, bus) => each(lines, bus, |line| {
            line.loss = *part;
            Ok(true)
        })?,
        Order::Delay(delay_ns, bus) => each(lines, bus, |line| {
            line.delay_ns = *delay_ns;
            Ok(true)
        })?,
        Order::State(event, bus) => each(lines, bus, |line| line.bus.pretend(*event))?,
    };
    if !done {
        eprintln!("{order:?}: no such motor or bus, or this bus cannot");
    }
    Ok(())
}

fn each(
    lines: &mut [Line],
    bus: &Option<String>,
    act: impl Fn(&mut Line) -> Result<bool, BusError>,
) -> Result<bool, BusError> {
    let meant = |line: &&mut Line| bus.as_ref().is_none_or(|bus| *bus == line.name);
    lines.iter_mut().filter(meant).try_fold(false, |any, line| Ok(any | act(line)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read() {
        assert_eq!(read("report"), Ok(Order::Report));
        assert_eq!(read(" fault elbow 0x10 "), Ok(Order::Fault("elbow".to_owned(), 16)));
        assert_eq!(read("reboot elbow"), Ok(Order::Reboot("elbow".to_owned())));
        assert_eq!(read("silence elbow on"), Ok(Order::Silence("elbow".to_owned(), true)));
        assert_eq!(read("loss .25"), Ok(Order::Loss(0.25, None)));
        assert_eq!(read("delay 3 arm"), Ok(Order::Delay(3_000_000, Some("arm".to_owned()))));
        assert_eq!(read("busoff"), Ok(Order::State(BusEvent::BusOff, None)));
    }

    #[test]
    fn lines_that_make_no_sense_say_what_is_expected() {
        for line in [
            "",
            "loss 2",
            "loss NaN",
            "fault elbow",
            "fault elbow x",
            "silence elbow maybe",
            "delay -1",
            "busoff a b",
        ] {
            assert!(read(line).is_err(), "{line}");
        }
    }
}
