//! The hand-over of a lane, as a model on atomics of loom.
//!
//! The atomics are inside iceoryx2, so they are written out again in `board.rs`, with the orderings
//! of version 0.10.0 (a test compares that number with the lock file: another version asks for
//! another look). The uses of them are those of `proto/src/lane.rs` and
//! `server/serve/src/answering/thread.rs`: the client publishes a request and polls for its answer,
//! the server polls and publishes; each side writes in place into the cell that is not published.
//!
//! The model shows that values are whole and in order, that none is lost, and that no cell is
//! written while a client that waits for its answers reads it. It has a limit: loom does not move a
//! store before an earlier read-modify-write, which `Release` alone allows and ARM does. When a
//! client gives up a request and writes again, the reader's check relies on the fence between them
//! (x86-64 needs none); a variant that moves the store by hand shows that the fence is needed.

#![allow(clippy::unwrap_used, reason = "a test that fails panics")]

mod board;

use board::{Board, Orderings, Reader, Whole, Words, Writer};
use loom::model::Builder;
use loom::sync::Arc;
use loom::thread;

/// Every interleaving with up to four preemptions.
fn every_interleaving(check: impl Fn() + Sync + Send + 'static) {
    let mut builder = Builder::new();
    builder.preemption_bound = Some(4);
    builder.check(check);
}

/// A writer that does not wait for the reader, as when a client gives up and asks again.
fn overwritten(orderings: Orderings) {
    every_interleaving(move || {
        let board = Arc::new(Board::<Words>::new(orderings));
        let writer = {
            let board = Arc::clone(&board);
            thread::spawn(move || {
                let mut writer = Writer::default();
                (1..=3).for_each(|value| writer.publish(&board, value));
            })
        };
        let mut reader = Reader::default();
        let mut last = 0;
        for _ in 0..2 {
            if let Some(value) = reader.poll(&board) {
                assert!(value >= last, "an older value after a newer one");
                last = value;
            }
        }
        writer.join().unwrap();
        last = reader.poll(&board).unwrap_or(last);
        assert_eq!(last, 3, "the newest value is lost");
        assert_eq!(reader.poll(&board), None, "nothing is new");
    });
}

/// A client that waits for each answer before it asks again.
fn asked_and_answered(orderings: Orderings) {
    every_interleaving(move || {
        let requests = Arc::new(Board::<Whole>::new(orderings));
        let answers = Arc::new(Board::<Whole>::new(orderings));
        let wait = |reader: &mut Reader, board: &Board<Whole>| loop {
            match reader.poll(board) {
                Some(value) => return value,
                None => thread::yield_now(),
            }
        };
        const ROUNDS: u64 = 3;
        let server = {
            let requests = Arc::clone(&requests);
            let answers = Arc::clone(&answers);
            thread::spawn(move || {
                let mut reader = Reader::default();
                let mut writer = Writer::default();
                for _ in 0..ROUNDS {
                    let sequence = wait(&mut reader, &requests);
                    writer.publish(&answers, sequence);
                }
            })
        };
        let mut reader = Reader::default();
        let mut writer = Writer::default();
        for sequence in 1..=ROUNDS {
            writer.publish(&requests, sequence);
            assert_eq!(wait(&mut reader, &answers), sequence, "the answer of another request");
        }
        server.join().unwrap();
    });
}

#[test]
fn values_are_whole_and_in_order_and_the_newest_is_seen() {
    overwritten(Orderings::ICEORYX2);
}

#[test]
fn no_cell_is_written_while_a_client_that_waits_reads_it() {
    asked_and_answered(Orderings::ICEORYX2);
}

#[test]
#[should_panic(expected = "a value of two halves")]
fn a_relaxed_publication_is_caught() {
    use loom::sync::atomic::Ordering::Relaxed;
    overwritten(Orderings { publish: Relaxed, ..Orderings::ICEORYX2 });
}

#[test]
#[should_panic(expected = "a value of two halves")]
fn a_relaxed_reader_is_caught() {
    use loom::sync::atomic::Ordering::Relaxed;
    overwritten(Orderings { read: Relaxed, confirm: [Relaxed; 2], ..Orderings::ICEORYX2 });
}

#[test]
#[should_panic(expected = "a value of two halves")]
fn a_reader_that_does_not_look_again_is_caught() {
    overwritten(Orderings { confirms: false, ..Orderings::ICEORYX2 });
}

#[test]
#[should_panic(expected = "a value of two halves")]
fn a_next_value_that_overtakes_the_publication_is_caught() {
    overwritten(Orderings { holds_back: false, ..Orderings::ICEORYX2 });
}

#[test]
#[should_panic(expected = "Causality violation")]
fn a_relaxed_answer_is_caught() {
    use loom::sync::atomic::Ordering::Relaxed;
    asked_and_answered(Orderings { publish: Relaxed, ..Orderings::ICEORYX2 });
}

#[test]
fn the_model_is_of_the_version_that_is_used() {
    let lock = include_str!("../../../Cargo.lock");
    let version = lock
        .split("name = \"iceoryx2-bb-lock-free\"")
        .nth(1)
        .and_then(|rest| rest.split("version = ").nth(1))
        .and_then(|rest| rest.lines().next());
    assert_eq!(version, Some("\"0.10.0\""), "compare board.rs with unrestricted_atomic.rs");
}
