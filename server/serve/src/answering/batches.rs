//! The batches of one client: one at a time, answered tile by tile, so that other clients wait for
//! one tile at most.

use quanta::Clock;
use sarrus_dynamics::MOST_ROWS;
use sarrus_proto::batch::{BatchHead, ServedBatch};
use sarrus_proto::{Answer, Status, Warnings};

use crate::answering::counters::Counters;
use crate::answering::engine::{Engine, Tile};
use crate::record::Client;

/// A client's area for batches, and the batch in progress.
pub(crate) struct Batches {
    area: ServedBatch,
    /// The client of the rows in a recording.
    client: Client,
    /// The sequence of the last batch seen.
    last: u64,
    under_way: Option<UnderWay>,
    /// A test's fault: the plan panics over the tile that begins here.
    #[cfg(test)]
    pub(crate) panics_at: Option<usize>,
}

/// A batch, answered up to this row.
struct UnderWay {
    head: BatchHead,
    row: usize,
}

impl Batches {
    pub(crate) fn new(area: ServedBatch, client: Client) -> Batches {
        Batches {
            area,
            client,
            last: 0,
            under_way: None,
            #[cfg(test)]
            panics_at: None,
        }
    }

    /// Frees the memory of the area, even if the client keeps its descriptor. Called off the
    /// answering thread.
    pub(crate) fn release(self) {
        self.area.empty();
    }

    /// Answers a tile, or refuses a batch; false if there is nothing to do, or another thread does
    /// it.
    pub(crate) fn turn(
        &mut self,
        place: usize,
        engine: &mut Engine,
        counters: &Counters,
        clock: &Clock,
        stopping: bool,
    ) -> bool {
        let sequence = self.area.sequence();
        let is_new = sequence != self.last;
        self.last = sequence;
        let UnderWay { head, row } = match self.under_way.take() {
            None if is_new => UnderWay { head: self.area.head(sequence), row: 0 },
            None => return false,
            Some(under_way) if !is_new => under_way,
            // requested again before the answer: both batches share the rows
            Some(_) => {
                self.refuse(Status::Overloaded, counters);
                return true;
            }
        };
        if stopping {
            self.refuse(Status::ShuttingDown, counters);
            return true;
        }
        engine.found(clock.raw(), self.client);
        #[cfg(test)]
        assert_ne!(self.panics_at, Some(row), "a plan that panics");
        let mut answers =
            [Answer { status: Status::UnknownRequest, warnings: Warnings::NONE }; MOST_ROWS];
        match engine.answer_tile(&head, (place, row), &self.area, &mut answers) {
            Ok(None) => {
                self.under_way = Some(UnderWay { head, row });
                return false;
            }
            Ok(Some(Tile { answers, is_last })) => {
                counters.record_states(answers);
                counters.set_by_kernel(engine.by_kernel);
                match is_last {
                    true => self.area.publish(sequence, Status::Ok),
                    false => self.under_way = Some(UnderWay { head, row: row + answers.len() }),
                }
            }
            Err(status) => self.refuse(status, counters),
        }
        true
    }

    fn refuse(&self, status: Status, counters: &Counters) {
        counters.count(status as u32);
        self.area.publish(self.last, status);
    }
}
