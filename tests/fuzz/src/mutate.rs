//! Random changes of inputs: bits, bytes, words, lines, nesting.

use std::ops::Range;

use fastrand::Rng;

/// The longest input `[byte]`.
pub const LONGEST: usize = 1 << 16;

/// Numbers at the limits of number parsers.
const NUMBERS: [&str; 34] = [
    "",
    "0",
    "-0",
    "1",
    "-1",
    "+1",
    "--1",
    "1e",
    ".5",
    "1.",
    "00",
    "0x10",
    "1_0",
    "1e-9",
    "1e-400",
    "4.9e-324",
    "1.0000000000000002",
    "6.283185307179586",
    "1e17",
    "1e308",
    "-1e308",
    "1e999",
    "-1e999",
    "NaN",
    "nan",
    "inf",
    "-inf",
    ".inf",
    "255",
    "256",
    "65536",
    "2147483648",
    "4294967296",
    "18446744073709551616",
];

/// Opening brackets and tags of the file formats.
const OPENERS: [&str; 10] = ["[", "{", "(", "<", "\"", "- ", "{a: ", "<link>", "[[", "{\"a\":"];

/// A stream of mutated inputs.
pub struct Mutator {
    random: Rng,
    tokens: &'static [&'static str],
}

impl Mutator {
    /// The stream of a seed number; `tokens` are words of the target's language.
    pub fn new(seed: u64, tokens: &'static [&'static str]) -> Mutator {
        Mutator { random: Rng::with_seed(seed), tokens }
    }

    /// One of `seeds` with one to eight changes.
    pub fn mutate(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut input = self.one_of(seeds).cloned().unwrap_or_default();
        let mut changes = 1;
        while changes < 8 && self.random.bool() {
            changes += 1;
        }
        for _ in 0..changes {
            self.change(&mut input, seeds);
        }
        input.truncate(LONGEST);
        input
    }

    fn change(&mut self, input: &mut Vec<u8>, seeds: &[Vec<u8>]) {
        let at = self.random.usize(..=input.len());
        match self.random.u8(..16) {
            // bits and bytes
            0 => {
                if let Some(byte) = input.get_mut(at) {
                    *byte ^= 1 << self.random.u8(..8);
                }
            }
            1 => {
                if let Some(byte) = input.get_mut(at) {
                    *byte = self.random.u8(..);
                }
            }
            2 => input.insert(at, self.random.u8(..)),
            3 => input.truncate(at),
            // parts
            4 => drop(input.drain(self.part(input.len()))),
            5 => {
                let part = input[self.part(input.len())].to_vec();
                let times = 1 << self.random.usize(..8);
                let times = (LONGEST / 8 / part.len().max(1)).min(times);
                input.splice(at..at, part.repeat(times));
            }
            6 => {
                let other = self.one_of(seeds).map(Vec::as_slice).unwrap_or_default();
                let from = other[self.part(other.len())].to_vec();
                let part = self.part(input.len());
                input.splice(part, from);
            }
            // words of the language
            7 | 8 => {
                let token = self.one_of(self.tokens).copied().unwrap_or_default();
                let to = if self.random.bool() { at } else { word(input, at).end };
                input.splice(at..to, token.bytes());
            }
            9 | 10 => {
                let number = self.one_of(&NUMBERS).copied().unwrap_or_default();
                let place = number_after(input, at);
                input.splice(place, number.bytes());
            }
            // another word of this text
            11 | 12 => {
                let from = self.random.usize(..=input.len());
                let other = input[word(input, from)].to_vec();
                let place = word(input, at);
                input.splice(place, other);
            }
            // lines
            13 => drop(input.drain(line(input, at))),
            14 => {
                let from = self.random.usize(..=input.len());
                let copied = input[line(input, from)].to_vec();
                let start = line(input, at).start;
                input.splice(start..start, copied);
            }
            // depth
            _ => {
                let opener = self.one_of(&OPENERS).copied().unwrap_or_default();
                let depth = 1 << self.random.usize(..12);
                input.splice(at..at, opener.repeat(depth).into_bytes());
            }
        }
    }

    fn one_of<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        if all.is_empty() { None } else { all.get(self.random.usize(..all.len())) }
    }

    /// A random range of bytes, more often short than long.
    fn part(&mut self, len: usize) -> Range<usize> {
        let start = self.random.usize(..=len);
        let longest = 1 << self.random.usize(..10);
        start..len.min(start + self.random.usize(..=longest))
    }
}

/// The word at or after a byte.
fn word(text: &[u8], at: usize) -> Range<usize> {
    span(text, at, |byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

/// The number at or after a byte.
fn number_after(text: &[u8], at: usize) -> Range<usize> {
    let first = (at..text.len()).find(|i| text[*i].is_ascii_digit()).unwrap_or(text.len());
    span(text, first, |byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte))
}

fn span(text: &[u8], at: usize, is_part: impl Fn(u8) -> bool) -> Range<usize> {
    let start = (at..text.len()).find(|i| is_part(text[*i])).unwrap_or(text.len());
    let end = (start..text.len()).find(|i| !is_part(text[*i])).unwrap_or(text.len());
    let start = (0..start).rev().find(|i| !is_part(text[*i])).map_or(0, |before| before + 1);
    start..end
}

/// The line around a byte, with its end.
fn line(text: &[u8], at: usize) -> Range<usize> {
    let start = text[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let end = text[at..].iter().position(|byte| *byte == b'\n').map_or(text.len(), |i| at + i + 1);
    start..end
}
