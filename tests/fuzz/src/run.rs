//! A run: one input after the other, with panics caught, time measured and failures reduced.

use std::cell::RefCell;
use std::collections::HashSet;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;
use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};

use crate::Target;
use crate::mutate::Mutator;
use crate::targets::Check;

/// Largest number of seeds: those of the target and inputs with a new outcome.
const MOST_SEEDS: usize = 4000;
/// Largest number of attempts to reduce a failing input.
const MOST_CUTS: usize = 2000;

/// Limits of a run.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Number of the stream of inputs.
    pub seed: u64,
    /// Largest number of inputs.
    pub inputs: u64,
    /// Longest duration.
    pub time: Option<Duration>,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Inputs so far.
    pub inputs: u64,
    /// Kinds of outcomes so far.
    pub kinds: usize,
    /// Time since the start.
    pub elapsed: Duration,
}

/// An input that breaks a law.
#[derive(Clone, Debug)]
pub struct Failure {
    /// The reduced input.
    pub input: Vec<u8>,
    /// The broken law, or the panic's message.
    pub words: String,
}

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Number of inputs tried.
    pub inputs: u64,
    /// Number of kinds of outcomes.
    pub kinds: usize,
    /// The input that took the most processor time, and that time.
    pub slowest: (Duration, Vec<u8>),
    /// The first failure, which ends the run.
    pub failure: Option<Failure>,
}

/// Tries every seed of a target, then mutated ones, and calls `watch` after each input.
///
/// # Errors
/// The reason why the target cannot start.
pub fn run(
    target: &Target,
    limits: Limits,
    watch: &mut dyn FnMut(Progress),
) -> Result<Outcome, String> {
    let mut check = (target.start)()?;
    let mut seeds = (target.seeds)();
    let mut mutator = Mutator::new(limits.seed, target.tokens);
    let start = Instant::now();
    let mut kinds = HashSet::new();
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
/// The reason why the target cannot start, or the broken law.
pub fn replay(target: &Target, input: &[u8]) -> Result<(), String> {
    guarded(&mut (target.start)()?, input).map(|_| ())
}

/// Name of an input (Fowler, Noll, Vo: FNV-1a of 64 bits).
pub fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

/// Removes parts of the input for as long as it still fails.
fn smaller(target: &Target, mut failure: Failure) -> Result<Failure, String> {
    let mut check = (target.start)()?;
    let mut size = failure.input.len() / 2;
    let mut tries = 0;
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
                    // the state after a panic is not used again
                    check = (target.start)()?;
                }
            }
        }
        size /= 2;
    }
    Ok(failure)
}

thread_local! {
    /// Message of a panic while this thread tries an input.
    static PANIC: RefCell<Option<Option<String>>> = const { RefCell::new(None) };
}

/// Turns a panic into a failure with its place.
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

/// Processor time of this thread, which a busy machine changes little.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
