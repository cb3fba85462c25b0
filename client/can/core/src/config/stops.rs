//! How mechanisms are stopped.

use sarrus_models::yaml::{self, Node, quoted};

use super::keys::MECHANISM;
use super::reader::{Read, Reader, nanoseconds};
use super::values::{MechanismStop, StopFunction};
use crate::frame::FrameQueue;
use crate::settings::Settings;

/// Default speed of lowering, as part of the velocity's limit.
const LOWER: f64 = 0.1;

impl Reader<'_, '_> {
    /// The stop of each mechanism: its entry under `mechanisms`, else the top level's. `mechanisms`
    /// has the mechanism of each of the `actuators`.
    pub(super) fn stops(
        &mut self,
        root: &Node,
        top: &Settings,
        actuators: &[String],
        mechanisms: &[usize],
        motors: &mut [Read],
        has_model: bool,
    ) -> Vec<MechanismStop> {
        let n = mechanisms.iter().max().map_or(0, |last| last + 1);
        let mut entries: Vec<Option<Settings>> = vec![None; n];
        for node in yaml::list(root, "mechanisms", self.diagnostics) {
            let Some(read) = self.settings(node, "the mechanism", MECHANISM, &[]) else { continue };
            let name = read.text("actuator");
            let found = format!("there is no actuator {}", quoted(name));
            let name_and_place = (name, read.place("actuator"));
            let place = self.place(name_and_place, actuators, found, "correct the name");
            let number = place.and_then(|place| mechanisms.get(place));
            let Some(entry) = number.and_then(|number| entries.get_mut(*number)) else { continue };
            if entry.is_some() {
                let found = format!("a second entry for the mechanism of {}", quoted(name));
                self.diagnostics.error(node.span, found, "one", "remove one of them");
            }
            *entry = Some(read);
        }
        let stop = |(number, entry): (usize, Option<Settings>)| {
            let mut members: Vec<&mut Read> = motors
                .iter_mut()
                .filter(|read| mechanisms.get(read.motor.actuator) == Some(&number))
                .collect();
            self.mechanism_stop(top, entry.as_ref(), &mut members, has_model)
        };
        entries.into_iter().enumerate().map(stop).collect()
    }

    fn mechanism_stop(
        &mut self,
        top: &Settings,
        entry: Option<&Settings>,
        members: &mut [&mut Read],
        has_model: bool,
    ) -> MechanismStop {
        let of = |key: &str| entry.filter(|entry| entry.has(key)).unwrap_or(top);
        let number = |key: &str, otherwise: f64| {
            entry.map_or(otherwise, |entry| entry.number_or(key, otherwise))
        };
        let ms = |key: &str, otherwise: f64| nanoseconds(number(key, otherwise));
        let function = StopFunction::named(of("stop_function").text("stop_function"));
        let place = of("stop_function").place("stop_function");
        let slowest = members.iter().map(|read| read.motor.limits.velocity);
        let slowest = LOWER * slowest.fold(f64::INFINITY, f64::min);
        let lower_velocity = number("lower_velocity", slowest);
        let fault = match function {
            StopFunction::QuickStop => {
                let mut frames = FrameQueue::new(16);
                let unable = members.iter_mut().find_map(|read| {
                    let is_able = read.motor.drive.quick_stop(0, &mut frames);
                    (!is_able).then_some(read.motor.protocol.name)
                });
                let help = "use `ss1`, by which the bridge brakes";
                let found = |name| format!("`quick_stop`, and {name} has no command for one");
                unable.map(|name| (found(name), "drives of CiA 402", help))
            }
            StopFunction::Lower if !has_model => Some((
                "`lower` without a model".to_owned(),
                "a robot, whose model knows what gravity needs",
                "add `robot` or `urdf`, or use `ss1`",
            )),
            _ => None,
        };
        if let Some((found, expected, help)) = fault {
            self.diagnostics.error(place, found, expected, help);
        }
        let holds = matches!(function, StopFunction::Ss2 | StopFunction::Lower);
        MechanismStop {
            function,
            stop_ns: ms("stop_ms", top.number("stop_ms")),
            hold_ns: if holds { ms("hold_ms", HOLD_MS) } else { 0 },
            lower_velocity,
        }
    }
}

/// Default of the longest time of holding and lowering `[ms]`.
const HOLD_MS: f64 = 5000.0;
