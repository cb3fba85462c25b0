//! What reads, and what holds for every input of it.

mod ask;
mod can;
mod diagnostics;
mod robot;
mod slcan;
mod wire;

/// Tries an input: a number for the kind of outcome, or what is wrong.
pub type Check = Box<dyn FnMut(&[u8]) -> Result<u64, String>>;

/// Something that reads.
pub struct Target {
    /// Its name on the command line.
    pub name: &'static str,
    /// Good inputs, and bad ones that once mattered.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Words of its language.
    pub tokens: &'static [&'static str],
    /// Makes ready to try inputs.
    pub start: fn() -> Result<Check, String>,
}

/// All of them.
pub const TARGETS: &[Target] = &[
    robot::URDF,
    robot::SUBMECHANISMS,
    can::CONFIGURATION,
    can::DBC,
    can::LOG,
    slcan::SLCAN,
    ask::ASK,
    wire::QUERY,
    wire::SERVER,
];

/// Parts of an input stand one after the other with this line between them.
const BETWEEN: &str = "\n=====\n";

/// The parts of an input, as many as asked; those that are missing are empty.
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

/// A law: what is wrong where it does not hold.
fn law(holds: bool, words: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(words()) }
}

/// A number for a kind of outcome: the words of a message without names and digits.
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

/// The files of a folder of `corpus/`, in order of their names.
macro_rules! corpus {
    ($($file:literal),* $(,)?) => {
        || vec![$(include_bytes!(concat!("../../corpus/", $file)).to_vec()),*]
    };
}
use corpus;
