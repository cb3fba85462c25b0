//! A run: inputs one after the other, panics caught, time watched, failures made small.

use std::cell::RefCell;
use std::collections::HashSet;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

use crate::Target;
use crate::mutate::Mutator;
use crate::targets::Check;

/// Seeds that are kept: those of the target, and inputs whose outcome was new.
const MOST_SEEDS: usize = 4000;
/// Tries to make a failing input smaller.
const MOST_CUTS: usize = 2000;

/// How long a run is.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Number of the stream of inputs.
    pub seed: u64,
    /// Inputs at most.
    pub inputs: u64,
    /// Time at most.
    pub time: Option<Duration>,
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Inputs so far.
    pub inputs: u64,
    /// Kinds of outcomes so far.
    pub kinds: usize,
    /// Since the start.
    pub elapsed: Duration,
}

/// An input that breaks a law.
#[derive(Clone, Debug)]
pub struct Failure {
    /// The input, made small.
    pub input: Vec<u8>,
    /// What is wrong.
    pub words: String,
}

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Inputs that were tried.
    pub inputs: u64,
    /// Kinds of outcomes.
    pub kinds: usize,
    /// The input that took the most processor time of this thread.
    pub slowest: (Duration, Vec<u8>),
    /// The first failure; it ends a run.
    pub failure: Option<Failure>,
}

/// Tries every seed of a target, then changed ones; `watch` hears after each input.
///
/// # Errors
/// Why the target cannot start.
pub fn run(
    target: &Target,
    limits: Limits,
    watch: &mut dyn FnMut(Progress),
) -> Result<Outcome, String> {
    let mut check = (target.start)()?;
    let mut seeds = (target.seeds)();
    let mut mutator = Mutator::new(limits.seed, target.tokens);
    let (start, mut kinds) = (Instant::now(), HashSet::new());
    let mut outcome =
        Outcome { inputs: 0, kinds: 0, slowest: (Duration::ZERO, Vec::new()), failure: None };
    let n_given = seeds.len() as u64;
    while outcome.inputs < limits.inputs
        && limits.time.is_none_or(|longest| start.elapsed() < longest)
    {
        let input = match seeds.get(outcome.inputs as usize) {
            Some(seed) if outcome.inputs < n_given => seed.clone(),
            _ => mutator.mutate(&seeds),
        };
        let before = processor_time();
        let result = guarded(&mut check, &input);
        let time = processor_time().saturating_sub(before);
        outcome.inputs += 1;
        if time > outcome.slowest.0 {
            outcome.slowest = (time, input.clone());
        }
        match result {
            Ok(kind) => {
                let is_new = kinds.insert(kind);
                if is_new && outcome.inputs > n_given && seeds.len() < MOST_SEEDS {
                    seeds.push(input);
                }
            }
            Err(words) => {
                outcome.failure = Some(smaller(target, Failure { input, words })?);
                break;
            }
        }
        outcome.kinds = kinds.len();
        watch(Progress { inputs: outcome.inputs, kinds: kinds.len(), elapsed: start.elapsed() });
    }
    Ok(outcome)
}

/// Tries one input.
///
/// # Errors
/// Why the target cannot start, or what is wrong.
pub fn replay(target: &Target, input: &[u8]) -> Result<(), String> {
    guarded(&mut (target.start)()?, input).map(|_| ())
}

/// A name for an input (Fowler, Noll, Vo: FNV-1a of 64 bits).
pub fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

/// Leaves parts out as long as it still fails in some way.
fn smaller(target: &Target, mut failure: Failure) -> Result<Failure, String> {
    let mut check = (target.start)()?;
    let (mut size, mut tries) = (failure.input.len() / 2, 0);
    while size > 0 && tries < MOST_CUTS {
        let mut at = 0;
        while at < failure.input.len() && tries < MOST_CUTS {
            let mut input = failure.input.clone();
            input.drain(at..(at + size).min(failure.input.len()));
            tries += 1;
            match guarded(&mut check, &input) {
                Ok(_) => at += size,
                Err(words) => {
                    failure = Failure { input, words };
                    // a state that a panic left is not used again
                    check = (target.start)()?;
                }
            }
        }
        size /= 2;
    }
    Ok(failure)
}

thread_local! {
    /// Words of a panic while an input is tried on this thread.
    static PANIC: RefCell<Option<Option<String>>> = const { RefCell::new(None) };
}

/// A panic is a failure with its place.
fn guarded(check: &mut Check, input: &[u8]) -> Result<u64, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let is_watched = PANIC.with_borrow_mut(|panic| match panic {
                Some(words) => {
                    *words = Some(info.to_string());
                    true
                }
                None => false,
            });
            if !is_watched {
                before(info);
            }
        }));
    });
    PANIC.set(Some(None));
    let result = panic::catch_unwind(AssertUnwindSafe(|| check(input)));
    let words = PANIC.take().flatten();
    result.unwrap_or_else(|_| Err(words.unwrap_or_else(|| "a panic without words".to_owned())))
}

/// Of this thread: a busy machine changes it little.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
