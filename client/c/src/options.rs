//! How robots are loaded and connected: plain structures.
#![allow(unsafe_code, reason = "functions have names that C can link, and options hold texts")]

use core::ffi::c_char;
use core::ptr::null;
use std::time::Duration;

use sarrus_client::{ConnectOptions, Lock, Options};
use sarrus_models::Base;

use crate::border::texts;
use crate::failure::Failure;

/// Options for loading a robot. Begin with sarrus_load_defaults() and change single members.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LoadOptions {
    /// Gravity in root axes [m/s^2].
    pub gravity: [f64; 3],
    /// Faults of mass and inertia, and effects that are not modelled, are warnings.
    pub lenient: bool,
    /// The root link is on a free joint, the first of all: q = [p; x y z w], qd = [w; v] in the
    /// root link.
    pub floating_base: bool,
    /// Joints that are held still, each "JOINT" or "JOINT=VALUE" [m, rad].
    pub lock: *const *const c_char,
    /// How many.
    pub n_lock: usize,
    /// Links to which the robot is reduced, by names or patterns; none stands for all.
    pub only: *const *const c_char,
    /// How many.
    pub n_only: usize,
}

/// Which way requests go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Transport {
    /// A lane of one's own: the fastest way; a server has a bounded number of them.
    Lane = 0,
    /// The service, shared by all clients; each request makes one small block of memory.
    Service = 1,
}

/// How a client waits for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum WaitStrategy {
    /// Busy where at least three processors are there, else polite.
    Auto = 0,
    /// Polls without pause: the lowest latency for a whole processor while waiting.
    Busy = 1,
    /// Polls for some microseconds, then lets others run.
    Polite = 2,
}

/// Options for connecting. Begin with sarrus_connect_defaults() and change single members.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Connecting {
    /// A sarrus_transport.
    pub transport: u32,
    /// A sarrus_wait_strategy.
    pub wait_strategy: u32,
    /// How long one call waits at most, for a server that is gone to come back included [ns].
    pub timeout_ns: u64,
    /// How long an answer may take before it is late, without numbers [ns]; 0 for any time.
    pub deadline_ns: u64,
    /// The model that must be served; 0 for any.
    pub fingerprint: u64,
}

/// Standard gravity downwards, strict, on the ground, the whole robot.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_load_defaults() -> LoadOptions {
    let Options { gravity, lenient, .. } = Options::default();
    LoadOptions {
        gravity,
        lenient,
        floating_base: false,
        lock: null(),
        n_lock: 0,
        only: null(),
        n_only: 0,
    }
}

/// A lane, one second, waiting as fits the number of processors, no deadline, any model.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_connect_defaults() -> Connecting {
    Connecting {
        transport: Transport::Lane as u32,
        wait_strategy: WaitStrategy::Auto as u32,
        timeout_ns: nanoseconds(ConnectOptions::default().timeout),
        deadline_ns: 0,
        fingerprint: 0,
    }
}

fn nanoseconds(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).unwrap_or(u64::MAX)
}

/// The options as the client has them; the usual ones where there are none.
///
/// # Safety
/// Their texts are as [`texts`] needs them.
pub(crate) unsafe fn loading(options: Option<&LoadOptions>) -> Result<Options, Failure> {
    let Some(options) = options else { return Ok(Options::default()) };
    // SAFETY: this function's own condition.
    let (lock, only) = unsafe {
        (texts("lock", options.lock, options.n_lock)?, texts("only", options.only, options.n_only)?)
    };
    if !options.gravity.iter().all(|x| x.is_finite()) {
        return Err(Failure::Text("gravity", "it is not finite".to_owned()));
    }
    let one = |text: &str| text.parse::<Lock>().map_err(|why| Failure::Text("lock", why));
    Ok(Options {
        gravity: options.gravity,
        lenient: options.lenient,
        base: Base::of_flag(options.floating_base.then_some("")),
        lock: lock.into_iter().map(one).collect::<Result<_, _>>()?,
        only: only.into_iter().map(str::to_owned).collect(),
    })
}

/// The options as the client has them.
pub(crate) fn connecting(options: Option<&Connecting>) -> Result<ConnectOptions, Failure> {
    let usual = ConnectOptions::default();
    let Some(options) = options else { return Ok(usual) };
    let transport = match options.transport {
        code if code == Transport::Lane as u32 => sarrus_client::Transport::Lane,
        code if code == Transport::Service as u32 => sarrus_client::Transport::Service,
        code => return Err(Failure::Number("transport", code)),
    };
    let wait_strategy = match options.wait_strategy {
        code if code == WaitStrategy::Auto as u32 => usual.wait_strategy,
        code if code == WaitStrategy::Busy as u32 => sarrus_client::WaitStrategy::Busy,
        code if code == WaitStrategy::Polite as u32 => sarrus_client::WaitStrategy::Polite,
        code => return Err(Failure::Number("wait strategy", code)),
    };
    Ok(ConnectOptions {
        transport,
        wait_strategy,
        timeout: Duration::from_nanos(options.timeout_ns),
        deadline: (options.deadline_ns > 0).then(|| Duration::from_nanos(options.deadline_ns)),
        fingerprint: (options.fingerprint != 0).then_some(options.fingerprint),
    })
}
