//! The bridge between commands and motors.

use std::sync::{Mutex, MutexGuard};

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_can_core::bridge::{Bridge, BusEvent, CommandVerdict};
use sarrus_can_core::log::{self, Line, What};
use sarrus_proto::actuators::{
    ActuatorCommand, ActuatorState, MAX_ACTUATORS, MechanismState, Operation, Reason, flag,
};

use crate::configuration::PyConfiguration;
use crate::frames::{PyFrame, list};
use crate::locked;

/// The safety rules of one robot, which make the frames for its motors in each cycle. Times are
/// nanoseconds of the monotonic clock.
#[pyclass(name = "Bridge", module = "sarrus.can", frozen)]
pub(crate) struct PyBridge {
    bridge: Mutex<Bridge>,
}

#[pymethods]
impl PyBridge {
    #[new]
    fn new(configuration: &PyConfiguration) -> PyResult<PyBridge> {
        Ok(PyBridge { bridge: Mutex::new(Bridge::new(configuration.take()?)) })
    }

    /// Takes a frame that came on a bus.
    fn receive(&self, now_ns: u64, bus: usize, frame: &PyFrame) {
        self.lock().receive(now_ns, bus, &frame.0);
    }

    /// Takes an event of a bus: one of `error_active`, `error_warning`, `error_passive`, `bus_off`,
    /// `restarted`, `dropped`, `backlog`, `overrun`, these three with a number of frames, `late`.
    fn bus_event(&self, now_ns: u64, bus: usize, event: &str, count: u32) -> PyResult<()> {
        let event = self::event(event, count)?;
        self.lock().bus_event(now_ns, bus, event);
        Ok(())
    }

    /// Takes a command for all actuators; the verdict is `accepted`, `not_finite`, `negative`,
    /// `old`, `ahead`, `wrong_model` or `wrong_size`. Lists that are not given are zeros. Without a
    /// fingerprint it is that of the configuration's model.
    #[pyo3(signature = (
        now_ns, sequence, stamp_ns, position = None, velocity = None, effort = None,
        stiffness = None, damping = None, fingerprint = None
    ))]
    fn command(
        &self,
        now_ns: u64,
        sequence: u64,
        stamp_ns: u64,
        position: Option<Vec<f64>>,
        velocity: Option<Vec<f64>>,
        effort: Option<Vec<f64>>,
        stiffness: Option<Vec<f64>>,
        damping: Option<Vec<f64>>,
        fingerprint: Option<u64>,
    ) -> PyResult<&'static str> {
        let (of_model, n_u) = {
            let bridge = self.lock();
            (bridge.configuration().fingerprint, bridge.configuration().actuators.len())
        };
        let numbers = [position, velocity, effort, stiffness, damping]
            .map(|numbers| numbers.unwrap_or_else(|| vec![0.0; n_u]));
        let numbers = numbers.each_ref().map(Vec::as_slice);
        let fingerprint = fingerprint.unwrap_or(of_model);
        let command = self::command(sequence, stamp_ns, fingerprint, numbers)?;
        Ok(self.lock().command(now_ns, &command).name())
    }

    /// Performs an operation, `arm`, `disarm` or `reset`, of all mechanisms or of the one that an
    /// actuator acts on, by its name. An actuator that is not there is a `ValueError`.
    #[pyo3(signature = (now_ns, operation, actuator = None))]
    fn operate(&self, now_ns: u64, operation: &str, actuator: Option<&str>) -> PyResult<()> {
        let operation = operation_of(operation)?;
        let mut bridge = self.lock();
        let place = |name: &str| {
            let known = &bridge.configuration().actuators;
            known.iter().position(|known| known == name).ok_or_else(|| {
                let known = known.join(", ");
                PyValueError::new_err(format!("there is no actuator {name}, expected {known}"))
            })
        };
        let actuator = actuator.map(place).transpose()?;
        bridge.operate_mechanism(now_ns, operation, actuator);
        Ok(())
    }

    /// One cycle: the frames of all buses are new after it.
    fn cycle(&self, now_ns: u64) {
        self.lock().cycle(now_ns);
    }

    /// Applies a line of a log; the frames that the bridge then sends, as `candump -L` writes them,
    /// and the time, actuators and reason of a new fault. A malformed line is a `ValueError`.
    fn replay(&self, line: &str) -> PyResult<(Vec<String>, Option<String>)> {
        let mut bridge = self.lock();
        let line = Line::read(line, bridge.configuration()).map_err(PyValueError::new_err)?;
        let (faults, _) = bridge.faults();
        if !line.apply(&mut bridge) {
            let found = "the state is of another configuration or version";
            return Err(PyValueError::new_err(found));
        }
        let frames = match line.what {
            What::Cycle => log::sent(&bridge, line.t).collect(),
            _ => Vec::new(),
        };
        let fault = log::fault(&bridge).filter(|_| bridge.faults().0 != faults);
        Ok((frames, fault.map(|fault| format!("at {} ns {fault}", line.t))))
    }

    /// How many faults there were since the start, and the actuators and reason of the last one.
    #[getter]
    fn faults(&self) -> (u64, Option<String>) {
        let bridge = self.lock();
        (bridge.faults().0, log::fault(&bridge))
    }

    /// The frames of the last cycle for a bus, in the order in which they are to be sent.
    fn frames(&self, bus: usize) -> Vec<PyFrame> {
        list(self.lock().frames(bus))
    }

    /// The frames of every bus become those that take the power from its motors.
    fn shutdown(&self) {
        self.lock().shutdown();
    }

    /// How the first mechanism that has motors is, `disabled`, `arming`, `enabled`, `stopping` or
    /// `fault`, and why; the worst of all is in [`PyBridge::state`].
    #[getter]
    fn mechanism_state(&self) -> (&'static str, &'static str) {
        let bridge = self.lock();
        let state = bridge.state();
        let places = state.flags.iter().zip(state.states.iter().zip(&state.reasons));
        let first = places.take(state.n_u as usize).find(|(flags, _)| *flags & flag::NO_MOTOR == 0);
        let (code, why) =
            first.map_or((state.state, state.reason), |(_, (code, why))| (*code, *why));
        (MechanismState::name_of(code), Reason::name_of(why))
    }

    /// The state of all actuators after the last cycle, by field; lists are in the order of
    /// commands.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let state = *self.lock().state();
        state_fields(py, &state)
    }

    /// The counters since the start: of commands and answers, and in `buses` of each bus.
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let bridge = self.lock();
        let counters = bridge.counters();
        let dict = PyDict::new(py);
        dict.set_item("cycles", counters.cycles)?;
        for verdict in CommandVerdict::ALL {
            dict.set_item(verdict.name(), counters.commands.of(*verdict))?;
        }
        dict.set_item("replies", counters.replies)?;
        let mut buses = Vec::new();
        while let Some((state, counters)) = bridge.bus_counters(buses.len()) {
            let bus = PyDict::new(py);
            bus.set_item("state", state.name())?;
            for (name, count) in counters.counts.each() {
                bus.set_item(name, count)?;
            }
            bus.set_item("restarted", counters.restarted)?;
            buses.push(bus);
        }
        dict.set_item("buses", buses)?;
        Ok(dict)
    }
}

impl PyBridge {
    /// The bridge itself; it never leaves half a cycle behind.
    pub(crate) fn lock(&self) -> MutexGuard<'_, Bridge> {
        locked(&self.bridge)
    }
}

/// The fields of a state, by name.
pub(crate) fn state_fields<'py>(
    py: Python<'py>,
    state: &ActuatorState,
) -> PyResult<Bound<'py, PyDict>> {
    let n = usize::try_from(state.n_u).unwrap_or(0).min(MAX_ACTUATORS);
    let dict = fields!(py, state => sequence, stamp_ns, fingerprint, command);
    dict.set_item("state", MechanismState::name_of(state.state))?;
    dict.set_item("reason", Reason::name_of(state.reason))?;
    let states: Vec<_> =
        state.states.iter().take(n).map(|code| MechanismState::name_of(*code)).collect();
    dict.set_item("states", states)?;
    let reasons: Vec<_> = state.reasons.iter().take(n).map(|code| Reason::name_of(*code)).collect();
    dict.set_item("reasons", reasons)?;
    let flags: Vec<_> = state.flags.iter().take(n).map(|bits| flag::names(*bits)).collect();
    dict.set_item("flags", flags)?;
    dict.set_item("faults", state.faults.get(..n).unwrap_or_default())?;
    dict.set_item("measured_ns", state.measured_ns.get(..n).unwrap_or_default())?;
    for (name, numbers) in [
        ("position", &state.position),
        ("velocity", &state.velocity),
        ("effort", &state.effort),
        ("temperature", &state.temperature),
    ] {
        dict.set_item(name, numbers.get(..n).unwrap_or_default())?;
    }
    Ok(dict)
}

/// The numbers of a command, by name.
pub(crate) fn command_fields<'py>(
    py: Python<'py>,
    mut command: ActuatorCommand,
) -> PyResult<Bound<'py, PyDict>> {
    let n = usize::try_from(command.n_u).unwrap_or(0).min(MAX_ACTUATORS);
    let dict = fields!(py, command => sequence, stamp_ns, fingerprint);
    for (name, numbers) in command.lists() {
        dict.set_item(name, numbers.get(..n).unwrap_or_default())?;
    }
    Ok(dict)
}

/// A command of its parts; numbers of different counts, or too many, are a `ValueError`.
pub(crate) fn command(
    sequence: u64,
    stamp_ns: u64,
    fingerprint: u64,
    numbers: [&[f64]; 5],
) -> PyResult<ActuatorCommand> {
    let n = numbers[0].len();
    let mut command = ActuatorCommand {
        sequence,
        stamp_ns,
        fingerprint,
        n_u: n as u64,
        ..ActuatorCommand::default()
    };
    for (numbers, (_, into)) in numbers.into_iter().zip(command.lists()) {
        let slots = into.get_mut(..n).filter(|_| numbers.len() == n);
        let slots = slots.ok_or_else(|| {
            PyValueError::new_err(format!(
                "{} number(s) beside {n}: a command has equally many of each, at most \
                 {MAX_ACTUATORS}",
                numbers.len()
            ))
        })?;
        slots.copy_from_slice(numbers);
    }
    Ok(command)
}

/// The operation of a name.
pub(crate) fn operation_of(name: &str) -> PyResult<Operation> {
    let known = Operation::ALL.iter().find(|known| known.name() == name);
    known.copied().ok_or_else(|| {
        PyValueError::new_err(format!(
            "no operation `{name}`, expected arm, disarm, reset, return or confirm"
        ))
    })
}

pub(crate) fn event(name: &str, count: u32) -> PyResult<BusEvent> {
    BusEvent::named(name, count).ok_or_else(|| PyValueError::new_err(format!("no event `{name}`")))
}
