//! The loop of `sarrus-can-run` over buses of Python.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyOSError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sarrus_can_core::frame::Frame;
use sarrus_can_run::bus::{Bus, BusError, Heard, Reconnecting, Sent};
use sarrus_can_run::{Report, Running, Settings, prepare, stderr};
use sarrus_client::now_ns;
use std::os::fd::BorrowedFd;

use crate::bridge::event;
use crate::configuration::PyConfiguration;
use crate::frames::{PyFrame, list};

/// Priority of the loop's threads under SCHED_FIFO.
const PRIORITY: u8 = 50;
/// Time between two calls of `why`.
const LOOK: Duration = Duration::from_millis(20);

/// A bus of Python, an `Adapter` of `sarrus.can.adapters`. Its thread holds the interpreter's lock
/// only while the adapter sends and receives.
struct PythonBus {
    adapter: Py<PyAny>,
    is_mute: bool,
    /// Frames for the next call of `send`.
    collected: Vec<Frame>,
    /// Input of the last call of `receive`, each with when it came `[ns]`.
    heard: VecDeque<(u64, Heard)>,
    heard_ns: Option<u64>,
    /// Whether `heard` held input at the last call of `next`.
    had_input: bool,
    backlog: u32,
    /// The error of a `send`. The bus stays open until `next` returns it, so that all repeats of
    /// the shutdown frames are tried.
    failure: Option<BusError>,
}

impl PythonBus {
    fn open(open: &Py<PyAny>, place: usize, is_mute: bool) -> Result<PythonBus, BusError> {
        Ok(PythonBus {
            adapter: attached(|py| open.call1(py, (place,)))?,
            is_mute,
            collected: Vec::new(),
            heard: VecDeque::new(),
            heard_ns: None,
            had_input: false,
            backlog: 0,
            failure: None,
        })
    }
}

/// Calls a function with the interpreter's lock; an exception becomes an error with its text.
fn attached<T>(f: impl FnOnce(Python<'_>) -> PyResult<T>) -> Result<T, BusError> {
    let done = Python::try_attach(|py| f(py).map_err(|error| error.value(py).to_string()));
    done.unwrap_or_else(|| Err("Python has ended".to_owned())).map_err(BusError::Driver)
}

impl Bus for PythonBus {
    /// Collects a frame for [`PythonBus::flush`].
    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.collected.push(*frame);
        Ok(Sent::Taken)
    }

    fn flush(&mut self) -> u32 {
        if self.collected.is_empty() {
            return 0;
        }
        let sent = attached(|py| {
            let adapter = self.adapter.bind(py);
            let frames = list(&self.collected);
            let dropped = adapter.call_method1(intern!(py, "send"), (frames,))?.extract()?;
            self.backlog = adapter.call_method0(intern!(py, "backlog"))?.extract()?;
            Ok(dropped)
        });
        let all = self.collected.len() as u32;
        self.collected.clear();
        sent.unwrap_or_else(|error| {
            self.failure = Some(error);
            all
        })
    }

    fn next(&mut self) -> Result<Option<Heard>, BusError> {
        if let Some(error) = self.failure.take() {
            return Err(error);
        }
        // `None` after the input of one call, so that a bus that never falls silent is not asked
        // without end
        if self.heard.is_empty() && !std::mem::take(&mut self.had_input) {
            attached(|py| {
                let adapter = self.adapter.bind(py);
                for heard in adapter.call_method0(intern!(py, "receive"))?.try_iter()? {
                    let heard = input(&heard?)?;
                    let age = adapter.getattr_opt(intern!(py, "age"))?;
                    let age: f64 = age.map_or(Ok(0.0), |age| age.extract())?;
                    let age_ns = (age.clamp(0.0, 1.0) * 1e9) as u64;
                    self.heard.push_back((now_ns().saturating_sub(age_ns), heard));
                }
                Ok(())
            })?;
        }
        let next = self.heard.pop_front();
        (self.had_input, self.heard_ns) = (next.is_some(), next.map(|(at_ns, _)| at_ns));
        Ok(next.map(|(_, heard)| heard))
    }

    fn heard_ns(&self) -> Option<u64> {
        self.heard_ns
    }

    fn backlog(&self) -> u32 {
        self.backlog
    }

    /// Not every interface of python-can has a descriptor.
    fn readable(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn is_mute(&self) -> bool {
        self.is_mute
    }
}

impl Drop for PythonBus {
    fn drop(&mut self) {
        // an adapter that is gone needs no closing
        let _ = attached(|py| self.adapter.call_method0(py, intern!(py, "close")));
    }
}

/// A frame, or an event as `(name, count)`.
fn input(heard: &Bound<'_, PyAny>) -> PyResult<Heard> {
    if let Ok(frame) = heard.cast::<PyFrame>() {
        return Ok(Heard::Frame(frame.get().0));
    }
    let (name, count) = heard.extract::<(String, u32)>()?;
    event(&name, count).map(Heard::Event)
}

/// Runs the bridge of a configuration, and gives the reason of its end and its counts and times:
/// `{cycles, missed, wake, work}`, of the last two `{count, p50, p99, p999, max}` in nanoseconds.
///
/// The cycle has a thread that never waits for the interpreter, and each bus has one that calls its
/// adapter. `open(place)` opens the adapter of a bus, at the start and after each loss.
/// `ready()` is called once all buses are open, `why()` fifty times a second until it gives a
/// reason to end. A failure is an `OSError`; the motors are commanded off on every way out.
#[pyfunction]
#[pyo3(signature = (
    configuration, name, open, ready, why, *, seconds = None, dry_run = false, realtime = true,
    log = None, fault_log = None
))]
pub(crate) fn run_bridge<'py>(
    py: Python<'py>,
    configuration: &PyConfiguration,
    name: String,
    open: Py<PyAny>,
    ready: Py<PyAny>,
    why: Py<PyAny>,
    seconds: Option<f64>,
    dry_run: bool,
    realtime: bool,
    log: Option<PathBuf>,
    fault_log: Option<PathBuf>,
) -> PyResult<(String, Bound<'py, PyDict>)> {
    let configuration = configuration.take()?;
    let settings = Settings { name, priority: realtime.then_some(PRIORITY), fault_log, log };
    let open = Arc::new(open);
    let (reason, report) = py.detach(|| {
        stderr::never_wait("sarrus.can");
        let mut places = 0..;
        let prepared =
            prepare(configuration, settings, Arc::new(AtomicBool::new(false)), |config| {
                let open = open.clone();
                let place = places.next().unwrap_or_default();
                let opening = move || -> Result<Box<dyn Bus>, BusError> {
                    Ok(Box::new(PythonBus::open(&open, place, dry_run)?))
                };
                Ok(Box::new(Reconnecting::with(&config.name, Box::new(opening))?))
            })
            .map_err(failed)?;
        Python::attach(|py| ready.call0(py))?;
        let running = prepared.start()?;
        let reason = wait(&running, &why, seconds);
        let report = running.end().map_err(failed);
        stderr::finish();
        PyResult::Ok((reason?, report?))
    })?;
    Ok((reason, counts(py, &report)?))
}

/// Waits for the end of the loop, and gives its reason.
fn wait(running: &Running, why: &Py<PyAny>, seconds: Option<f64>) -> PyResult<String> {
    let begin = Instant::now();
    // a time beyond the clock never comes
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    loop {
        let left = time.map_or(LOOK, |time| time.saturating_sub(begin.elapsed()));
        if left.is_zero() {
            return Ok("the time is over".to_owned());
        }
        if running.is_over() {
            return Ok("a thread of the loop has ended".to_owned());
        }
        let reason: String = Python::attach(|py| why.call0(py)?.extract(py))?;
        if !reason.is_empty() {
            return Ok(reason);
        }
        thread::sleep(left.min(LOOK));
    }
}

fn counts<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("cycles", report.work.count)?;
    dict.set_item("missed", report.missed)?;
    for (name, times) in [("wake", report.wake), ("work", report.work)] {
        dict.set_item(name, fields!(py, times => count, p50, p99, p999, max))?;
    }
    Ok(dict)
}

fn failed(error: Box<dyn std::error::Error>) -> PyErr {
    PyOSError::new_err(error.to_string())
}
