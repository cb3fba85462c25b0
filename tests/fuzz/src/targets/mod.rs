//! The readers under test and the laws that hold for every input of each.

mod ask;
mod can;
mod diagnostics;
mod robot;
mod slcan;
mod wire;

/// Tries an input and returns the number of its kind of outcome, or the broken law.
pub type Check = Box<dyn FnMut(&[u8]) -> Result<u64, String>>;

/// A reader under test.
pub struct Target {
    /// Its name on the command line.
    pub name: &'static str,
    /// Valid inputs, and faulty ones that once found a bug.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Words of its language.
    pub tokens: &'static [&'static str],
    /// Prepares the target.
    pub start: fn() -> Result<Check, String>,
}

/// All targets.
pub const TARGETS: &[Target] = &[
    robot::URDF,
    robot::SUBMECHANISMS,
    robot::MJCF,
    robot::SDF,
    robot::GEPETTO,
    can::CONFIGURATION,
    can::DBC,
    can::LOG,
    slcan::SLCAN,
    ask::ASK,
    wire::QUERY,
    wire::SERVER,
];

/// Line between the parts of an input.
const BETWEEN: &str = "\n=====\n";

/// The first N parts of an input; missing parts are empty.
fn parts<const N: usize>(input: &[u8]) -> [&[u8]; N] {
    let mut rest = Some(input);
    std::array::from_fn(|_| {
        let all = rest.take().unwrap_or_default();
        let between = BETWEEN.as_bytes();
        match all.windows(between.len()).position(|window| window == between) {
            Some(at) => {
                rest = all.get(at + between.len()..);
                all.get(..at).unwrap_or_default()
            }
            None => all,
        }
    })
}

/// Returns the message where a law does not hold.
fn law(holds: bool, words: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(words()) }
}

/// Number of a kind of outcome: hash of a message without names and digits.
fn kind(words: &str) -> u64 {
    let mut is_name = false;
    let plain: Vec<u8> = words
        .bytes()
        .filter(|byte| {
            is_name ^= *byte == b'`';
            !is_name && !byte.is_ascii_digit()
        })
        .collect();
    crate::hash(&plain)
}

/// The files of a folder of `corpus/`, sorted by name.
macro_rules! corpus {
    ($($file:literal),* $(,)?) => {
        || vec![$(include_bytes!(concat!("../../corpus/", $file)).to_vec()),*]
    };
}
use corpus;
