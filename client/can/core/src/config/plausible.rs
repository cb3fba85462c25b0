//! Valid but implausible values: each causes a warning.

use sarrus_models::Diagnostics;
use sarrus_models::yaml::{Span, quoted};

use super::configuration::{Configuration, MotorConfig};
use crate::drive::Mode;
use crate::settings::Settings;

/// A body falls five metres in this time: no watchdog or timeout should be longer `[ms]`.
const LONGEST_MS: f64 = 1000.0;

/// Times of the whole robot.
pub(super) fn timeouts(timeouts: &Settings, diagnostics: &mut Diagnostics) {
    for (key, what) in [
        ("disable_ms", "commands that stay away are believed for so long"),
        ("feedback_ms", "a motor that says nothing is believed for so long"),
    ] {
        let ms = timeouts.number(key);
        if ms > LONGEST_MS {
            let found = format!("`{key}` is {ms} ms: {what}");
            let expected = format!("at most {LONGEST_MS} ms");
            let help = "make it shorter: some ten cycles of the controller are enough";
            diagnostics.warning(timeouts.place(key), found, expected, help);
        }
    }
}

/// The ramp after arming.
pub(super) fn ramp(top: &Settings, diagnostics: &mut Diagnostics) {
    if top.number("ramp_ms") == 0.0 {
        let found =
            "`ramp_ms` is 0: gains and efforts come with a jump when a mechanism gets power";
        let expected = "some hundred milliseconds";
        diagnostics.warning(top.place("ramp_ms"), found, expected, "remove it for 500");
    }
}

/// Watchdog, limits and damping of each motor.
pub(super) fn motors(
    configuration: &Configuration,
    places: &[Span],
    diagnostics: &mut Diagnostics,
) {
    let disable_ms = configuration.timeouts.disable_ns as f64 * 1e-6;
    for (motor, place) in configuration.motors.iter().zip(places) {
        let mut check = |is_odd: bool, found: String, expected: &str, help: &str| {
            if is_odd {
                diagnostics.warning(*place, found, expected, help);
            }
        };
        let name = quoted(configuration.actuators.get(motor.actuator).map_or("", String::as_str));
        let ms = f64::from(motor.common.watchdog_ms);
        check(
            ms > LONGEST_MS,
            format!("the watchdog of {name} is {ms} ms: it follows its last set-point for so long"),
            "at most 1000 ms",
            "make `watchdog_ms` shorter: it is all that is left when the bridge is gone",
        );
        check(
            ms > disable_ms && ms <= LONGEST_MS,
            format!("the watchdog of {name}, {ms} ms, is longer than `disable_ms`, {disable_ms}"),
            "a watchdog no longer than the bridge waits",
            "make `watchdog_ms` shorter",
        );
        for (what, limit, range, unit) in ranges(motor) {
            let found = format!(
                "the limit of {what} of {name} is {} {unit} at its motor, which has numbers up to \
                 {range}",
                (limit * 1e6).round() / 1e6
            );
            // as far as the roundings of gear and limit go
            let is_beyond = limit > range * (1.0 + 1e-6);
            let help = "correct the limit, the gear or the range";
            check(is_beyond, found, "a limit within the motor's range", help);
        }
        check(
            matches!(motor.common.mode, Mode::Impedance | Mode::Torque) && motor.damping == 0.0,
            format!("{name} has a `damping` of 0"),
            "a damping that brakes it",
            "give one: while commands are late and in a stop nothing else slows it down",
        );
    }
}

/// Limits at the motor's side beside the ends of its protocol's numbers, with their units.
fn ranges(motor: &MotorConfig) -> [(&'static str, f64, f64, &'static str); 3] {
    let [position, velocity, torque] = motor.drive.ranges();
    let limits = motor.limits;
    let mapping = motor.mapping;
    let farthest = [limits.lower, limits.upper]
        .map(|limit| ((limit - mapping.offset) * mapping.gear).abs())
        .into_iter()
        .fold(0.0, f64::max);
    [
        ("position", farthest, position, "rad"),
        ("velocity", limits.velocity * mapping.gear, velocity, "rad/s"),
        ("effort", motor.common.torque_limit, torque, "N m"),
    ]
}
