//! Checksums of requests and answers, for queries that ask for them.
//!
//! Words form pairs: Σᵢ (aᵢ ⊕ kᵢ)(bᵢ ⊕ kᵢ′) mod 2¹²⁸, both halves of the sum folded into one word.
//! Each pair has its own keys, so that the position of a word counts: swapped words, or sign
//! changes in two words, do not cancel. The checksum detects accidental changes of memory. It is no
//! signature: a process that can write the numbers can write the checksum too.
//!
//! Head and count of the numbers are words like the numbers. An answer's checksum also covers that
//! of its request and with it the plan, the model and the numbers of the request: the answer to
//! another request fails.

use crate::message::{HEAD, RequestHead, ResponseHead, pair};

/// The first key and the step between the keys of two pairs: digits of π and the golden ratio.
const KEY: u64 = 0x243f_6a88_85a3_08d3;
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
/// Sums that the processor forms in parallel.
const CHAINS: usize = 4;
/// Replaces a request's last word, so that an answer never passes for a request.
const ANSWER: u64 = u64::MAX;

/// The checksum of a request with these numbers. Never allocates.
#[inline]
pub fn of_request(head: &RequestHead, numbers: &[f64]) -> u64 {
    // the count in the place of the checksum
    sum(RequestHead { checksum: numbers.len() as u64, ..*head }.words(), numbers)
}

/// The checksum of an answer with these numbers to the request that has the checksum `request`.
/// Never allocates.
#[inline]
pub fn of_answer(head: &ResponseHead, request: u64, numbers: &[f64]) -> u64 {
    let ResponseHead { status, warnings, sequence, age_ns, took_ns, checksum: _ } = *head;
    let outcome = pair(status, warnings);
    let times = pair(age_ns, took_ns);
    sum([outcome, sequence, times, request, numbers.len() as u64, ANSWER], numbers)
}

impl ResponseHead {
    /// This head with the checksum of an answer to `request` with these numbers; no checksum if the
    /// request has none.
    #[must_use]
    #[inline]
    pub fn checked(mut self, request: &RequestHead, numbers: &[f64]) -> ResponseHead {
        if request.checksum != 0 {
            self.checksum = of_answer(&self, request.checksum, numbers);
        }
        self
    }

    /// True if the checksum of this answer to `request` holds; the request has a checksum.
    #[inline]
    pub fn is_intact(&self, request: &RequestHead, numbers: &[f64]) -> bool {
        self.sequence == request.sequence
            && self.checksum == of_answer(self, request.checksum, numbers)
    }
}

fn sum(head: [u64; HEAD], numbers: &[f64]) -> u64 {
    // the head
    let [a, b, c, d, e, f] = head;
    let mut sums = [product(a, b, KEY), product(c, d, key(KEY, 1)), product(e, f, key(KEY, 2)), 0];

    // the numbers, one pair per sum: the sums are independent
    let mut first = key(KEY, 3);
    let (blocks, rest) = numbers.as_chunks::<{ 2 * CHAINS }>();
    for block in blocks {
        for k in 0..CHAINS {
            let a = block[2 * k].to_bits();
            let b = block[2 * k + 1].to_bits();
            sums[k] = sums[k].wrapping_add(product(a, b, key(first, k)));
        }
        first = key(first, CHAINS);
    }

    // the rest; the count distinguishes a missing number from a zero
    let word = |k: usize| rest.get(k).map_or(0, |number| number.to_bits());
    for k in 0..CHAINS {
        if 2 * k < rest.len() {
            let pair = product(word(2 * k), word(2 * k + 1), key(first, k));
            sums[k] = sums[k].wrapping_add(pair);
        }
    }

    let sum = sums.into_iter().fold(0, u128::wrapping_add);
    (sum >> 64) as u64 ^ sum as u64
}

/// The key of the pair `k` positions later.
#[inline]
fn key(first: u64, k: usize) -> u64 {
    first.wrapping_add(STEP.wrapping_mul(k as u64))
}

#[inline]
fn product(a: u64, b: u64, key: u64) -> u128 {
    u128::from(a ^ key) * u128::from(b ^ key.rotate_left(32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Status, Warnings};

    /// Sizes of entries: none, one, odd and even rests, whole blocks.
    const COUNTS: [usize; 9] = [0, 1, 2, 3, 8, 13, 16, 39, 200];

    fn numbers(n: usize) -> Vec<f64> {
        (0..n).map(|k| (0.7 * k as f64 + 0.3).sin() * 1.5).collect()
    }

    fn request() -> RequestHead {
        RequestHead {
            version: 4,
            plan: 1025,
            fingerprint: 0x0123_4567_89ab_cdef,
            sequence: 77,
            stamp_ns: 123_456_789_012,
            deadline_ns: 1_000_000,
            checksum: 0,
        }
    }

    fn answer() -> ResponseHead {
        let head = ResponseHead::new(Status::Ok, Warnings::LIMITS_EXCEEDED, 77);
        ResponseHead { age_ns: 812, took_ns: 1304, ..head }
    }

    /// Heads that differ from this one in one bit.
    fn requests_beside(head: &RequestHead) -> Vec<RequestHead> {
        let mut found = Vec::new();
        for bit in 0..64 {
            let flip = 1_u64 << bit;
            if bit < 32 {
                found.push(RequestHead { version: head.version ^ flip as u32, ..*head });
                found.push(RequestHead { plan: head.plan ^ flip as u32, ..*head });
            }
            found.push(RequestHead { fingerprint: head.fingerprint ^ flip, ..*head });
            found.push(RequestHead { sequence: head.sequence ^ flip, ..*head });
            found.push(RequestHead { stamp_ns: head.stamp_ns ^ flip, ..*head });
            found.push(RequestHead { deadline_ns: head.deadline_ns ^ flip, ..*head });
        }
        found
    }

    fn answers_beside(head: &ResponseHead) -> Vec<ResponseHead> {
        let mut found = Vec::new();
        for bit in 0..64 {
            let flip = 1_u64 << bit;
            if bit < 32 {
                let flip = flip as u32;
                found.push(ResponseHead { status: head.status ^ flip, ..*head });
                found.push(ResponseHead { warnings: head.warnings ^ flip, ..*head });
                found.push(ResponseHead { age_ns: head.age_ns ^ flip, ..*head });
                found.push(ResponseHead { took_ns: head.took_ns ^ flip, ..*head });
            }
            found.push(ResponseHead { sequence: head.sequence ^ flip, ..*head });
        }
        found
    }

    #[test]
    fn every_bit_of_a_head_counts() {
        for n in COUNTS {
            let numbers = numbers(n);
            let right = of_request(&request(), &numbers);
            for head in requests_beside(&request()) {
                assert_ne!(of_request(&head, &numbers), right, "{n} numbers, {head:?}");
            }
            let asked = right;
            let right = of_answer(&answer(), asked, &numbers);
            for head in answers_beside(&answer()) {
                assert_ne!(of_answer(&head, asked, &numbers), right, "{n} numbers, {head:?}");
            }
            for bit in 0..64 {
                assert_ne!(of_answer(&answer(), asked ^ 1 << bit, &numbers), right, "bit {bit}");
            }
        }
    }

    #[test]
    fn every_bit_of_every_number_counts() {
        for n in COUNTS {
            let mut numbers = numbers(n);
            let right = of_request(&request(), &numbers);
            for k in 0..n {
                let number = numbers[k];
                for bit in 0..64 {
                    numbers[k] = f64::from_bits(number.to_bits() ^ 1 << bit);
                    assert_ne!(of_request(&request(), &numbers), right, "bit {bit} of {k} of {n}");
                }
                numbers[k] = number;
            }
        }
    }

    #[test]
    fn words_that_change_places_and_signs_that_change_in_two_of_them_count() {
        for n in COUNTS {
            let mut numbers = numbers(n);
            let right = of_request(&request(), &numbers);
            for i in 0..n {
                for j in 0..i {
                    numbers.swap(i, j);
                    assert_ne!(of_request(&request(), &numbers), right, "{i} and {j} of {n}");
                    numbers.swap(i, j);
                    (numbers[i], numbers[j]) = (-numbers[i], -numbers[j]);
                    assert_ne!(of_request(&request(), &numbers), right, "{i} and {j} of {n}");
                    (numbers[i], numbers[j]) = (-numbers[i], -numbers[j]);
                }
            }
            // all of them at once
            numbers.iter_mut().for_each(|number| *number = -*number);
            assert!(n == 0 || of_request(&request(), &numbers) != right);
        }
    }

    #[test]
    fn zeros_are_not_right_and_their_count_matters() {
        let request = RequestHead::default();
        let answer = ResponseHead::default();
        let zeros = [0.0; 200];
        for n in 0..zeros.len() {
            assert_ne!(of_request(&request, &zeros[..n]), 0, "{n} zeros");
            assert_ne!(of_answer(&answer, 0, &zeros[..n]), 0, "{n} zeros");
            assert_ne!(of_request(&request, &zeros[..n]), of_request(&request, &zeros[..n + 1]));
            assert_ne!(of_request(&request, &zeros[..n]), of_answer(&answer, 0, &zeros[..n]));
        }
    }

    #[test]
    fn a_million_random_scribbles_are_found() {
        // xorshift64*, from a fixed seed
        let mut state = 0x5eed_0000_0000_0013_u64;
        let mut random = move || {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            state.wrapping_mul(0x2545_f491_4f6c_dd1d)
        };
        let right = numbers(39);
        let mut scribbled = right.clone();
        let checksum = of_request(&request(), &right);
        for round in 0..1_000_000 {
            // one to eight bytes over one to four words
            for _ in 0..=random() % 4 {
                let at = (random() % 39) as usize;
                let mask = u64::MAX >> (8 * (random() % 8));
                let word = scribbled[at].to_bits();
                scribbled[at] = f64::from_bits(word & !mask | random() & mask);
            }
            let same = scribbled.iter().zip(&right).all(|(a, b)| a.to_bits() == b.to_bits());
            assert_eq!(of_request(&request(), &scribbled) == checksum, same, "round {round}");
            scribbled.copy_from_slice(&right);
        }
    }
}
