//! A client that lies in batches: about rows, plans and sequences, and while they are answered.

use std::fs::File;
use std::os::unix::fs::FileExt;

use clap::Args;
use fastrand::Rng;
use rustix::fs::{FallocateFlags, fallocate};
use sarrus_client::{Domain, Field, FieldSet, Query, Request, Transport};
use sarrus_proto::batch::{BATCH_WORDS, BatchHead, BatchShape, ClaimedBatch, MAX_BATCH_ROWS};
use sarrus_proto::control::Call;
use sarrus_proto::message::PlanNumber;

use super::Target;
use crate::Settings;
use crate::raw::Raw;
use crate::sandbox::NAME;

const STATE: Query =
    Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
/// A plan that is released before anything is asked of it.
const RELEASED: Query =
    Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::G]));

#[derive(Args)]
pub(crate) struct Liar {
    #[command(flatten)]
    target: Target,
    /// Sends correct batches of the most rows without end.
    #[arg(long)]
    flood: bool,
}

/// One connection's worth.
struct Lies<'a> {
    raw: Raw,
    random: &'a mut Rng,
    area: ClaimedBatch,
    /// The area once more, as a file.
    memory: File,
    shape: BatchShape,
    input: Vec<f64>,
    plan: u32,
    released: u32,
    sequence: u64,
}

impl Liar {
    /// Runs until it is killed.
    pub(crate) fn run(self, settings: &Settings) -> Result<(), String> {
        let mut random = Rng::with_seed(settings.seed);
        let domain = self.target.domain()?;
        loop {
            if self.connect(&domain, &mut random).is_err() {
                // the server has hung up, or has no room: again
                std::thread::yield_now();
            }
        }
    }

    fn connect(&self, domain: &Domain, random: &mut Rng) -> Result<(), String> {
        let raw = Raw::greet(domain, NAME)?;
        let (released, _) = raw.plan(&RELEASED)?;
        let (plan, sizes) = raw.plan(&STATE)?;
        raw.call(Call::Release { plan: PlanNumber(released) })?;
        let _client = match self.target.transport() {
            Transport::Lane => {
                raw.lane(sizes)?;
                None
            }
            Transport::Service => Some(raw.take_service()?),
        };
        let (area, memory) = raw.batches()?;
        let [n_in, n_out] = sizes;
        let most = BatchShape::most_rows(n_in, n_out);
        let rows = if self.flood { most } else { random.usize(1..=most) };
        let shape = BatchShape::new(rows as u64, n_in, n_out).ok_or("no room for a row")?;
        let memory = File::from(memory);
        let input = vec![0.1; rows * n_in];
        let mut lies =
            Lies { raw, random, area, memory, shape, input, plan, released, sequence: 0 };
        match self.flood {
            true => lies.flood(),
            false => lies.lie(),
        }
    }
}

impl Lies<'_> {
    fn flood(&mut self) -> Result<(), String> {
        while !self.raw.socket.is_closed() {
            self.sequence += 1;
            self.send(|_, _| ());
            self.wait();
        }
        Ok(())
    }

    fn send(&mut self, lie: impl FnOnce(&mut BatchHead, &mut Rng)) {
        let rows = self.shape.rows() as u64;
        let mut head = self.raw.batch_head(self.plan, self.sequence, rows);
        lie(&mut head, self.random);
        self.sequence = head.sequence;
        self.area.send(&head, &self.shape, &self.input);
    }

    /// Waits for an answer for a bounded time: some lies have none.
    fn wait(&self) {
        for _ in 0..2000 {
            if self.area.answer(self.sequence).is_some() {
                break;
            }
            std::thread::yield_now();
        }
    }

    fn lie(&mut self) -> Result<(), String> {
        for _ in 0..self.random.u32(1..300) {
            self.sequence = self.sequence.wrapping_add(1);
            let released = self.released;
            let last = self.sequence;
            self.send(|head, random| match random.u8(..20) {
                0 => head.rows = 0,
                1 => head.rows = u64::MAX,
                2 => head.rows = MAX_BATCH_ROWS as u64 + random.u64(..2),
                3 => head.rows = random.u64(..) >> random.u32(..64),
                4 => head.plan = released,
                // plans of other clients
                5 => head.plan = random.u32(..4),
                6 => head.plan = random.u32(..),
                7 => head.version = random.u32(..),
                8 => head.fingerprint ^= 1 << random.u32(..64),
                9 => head.sequence = random.u64(..),
                10 => head.sequence = 0,
                11 => head.sequence = u64::MAX,
                12 => head.sequence = last.wrapping_sub(random.u64(..4)),
                _ => {}
            });
            if self.before_the_answer()? {
                break;
            }
        }
        // leaves with a batch under way
        self.sequence = self.sequence.wrapping_add(1);
        self.send(|_, _| ());
        match self.random.u8(..4) {
            0 => {
                self.raw.call(Call::Leave)?;
            }
            // another lane or service replaces the first, and the area is used on
            1 => {
                self.raw.lane([1000, 1000])?;
            }
            2 => {
                self.raw.service()?;
            }
            _ => {}
        }
        self.sequence = self.sequence.wrapping_add(1);
        self.send(|_, _| ());
        Ok(())
    }

    /// Disturbs the answer to its batch; true where it leaves.
    fn before_the_answer(&mut self) -> Result<bool, String> {
        let bytes = 8 * BATCH_WORDS as u64;
        match self.random.u8(..10) {
            // sends the next batch at once
            0 => {}
            // changes the head
            1 => {
                for _ in 0..self.random.u32(..500) {
                    let number = self.random.u64(..) >> self.random.u32(..64);
                    let place = 8 * self.random.u64(..4);
                    self.write(place, &number.to_ne_bytes());
                }
            }
            // overwrites the server's words
            2 => {
                let place = 8 * self.random.u64(8..24);
                let number = self.random.u64(..);
                self.write(place, &number.to_ne_bytes());
            }
            3 => {
                let mut noise = vec![0; self.random.usize(1..65536)];
                self.random.fill(&mut noise);
                let place = self.random.u64(..bytes - noise.len() as u64);
                self.write(place, &noise);
            }
            4 => {
                let place = self.random.u64(..bytes);
                let flags = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
                let _ = fallocate(&self.memory, flags, place, self.random.u64(1..=bytes - place));
            }
            5 => {
                let _ = self.memory.set_len(self.random.u64(..2 * bytes));
            }
            // a second area replaces the first
            6 => {
                let (area, memory) = self.raw.batches()?;
                self.area = area;
                self.memory = File::from(memory);
            }
            7 => return Ok(self.random.u8(..16) == 0),
            _ => self.wait(),
        }
        Ok(false)
    }

    fn write(&self, place: u64, bytes: &[u8]) {
        let _ = self.memory.write_all_at(bytes, place);
    }
}
