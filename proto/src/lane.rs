//! The one module that touches shared memory directly: hand-over of numbers between client and
//! server.
//!
//! A lane is a pair of boards, each with one writer and one reader: the client writes a request and
//! polls for the answer, the server the other way round. Both write in place and neither allocates.
//! The service is here for the same reason: its payloads are filled in place.
//!
//! # Shared words
//!
//! Memory that another process can write holds [`AtomicU64`] words here: each is read or written
//! whole, once, and no `&[f64]` or `&mut [f64]` lies over it. Requests are copied into private
//! memory before they are looked at, and answers are computed there and copied out; a process that
//! writes meanwhile changes the numbers of an answer, and nothing that the compiler relies on. The
//! same holds for the words of `mapping.rs`: batches and the heartbeat.
//!
//! # Memory ordering
//!
//! An entry is iceoryx2's cell (0.10.0, `iceoryx2-bb-lock-free`, `spmc/unrestricted_atomic.rs`):
//! two places and a counter. At counter w the value w − 1 is published and the writer fills the
//! other place with the value w; publishing that is `fetch_add(1, Release)`. The reader loads w
//! (`Acquire`), copies the value w − 1, then does `compare_exchange(w, w, AcqRel, SeqCst)`, and
//! copies again where that fails.
//!
//! *A published value is complete.* The stores of a value come before its `fetch_add` (`Release`),
//! and the reader's load of the counter (`Acquire`, or the failed exchange's `SeqCst`) before its
//! copy. The load in `is_up_to_date` is `Relaxed`, but `get` loads the counter again, and a
//! thread's loads of one atomic never go back. This holds on x86-64 and on ARM.
//!
//! *A value is not written while it is copied* if the writer waits for the other side: the place of
//! w − 1 is filled again with w + 1, after an answer to w; that answer was published (`Release`) by
//! the thread that had copied w and all before it, and was seen (`Acquire`) by the writer. So a
//! client waits for the server, and the server for the client's next request.
//!
//! *If the writer does not wait* (a client cancelled its request and asks again), it may fill the
//! place while the reader copies it, and the reader must then find the counter at w + 1. So no
//! store of the value w + 1 may be seen before that counter. x86-64 keeps the order: a locked
//! instruction is a fence, and stores are seen in their order. ARM does not: `Release` on a
//! read-modify-write (`ldaddl`, or `ldxr` with `stlxr`) orders the operations before it, not the
//! stores after it. Hence the `fence(Acquire)` between a publication and the next store: `dmb
//! ishld` on ARM, no instruction on x86-64. A reader's exchange that succeeds at w precedes the
//! `fetch_add` to w + 1 in the counter's order, which reads the value that this or a later exchange
//! wrote: the exchange (`Release`) synchronises with the fence, and the reader's copy happens
//! before every store behind the fence. A copy that saw such a store belongs to an exchange that
//! fails.
//!
//! *Left to iceoryx2*: a copy whose exchange fails has read bytes while they were written. The copy
//! is discarded and harmless on every processor, but the language requires these bytes to be
//! atomic. Entries that are written by `update_with_copy` have no such fence. Payloads of the
//! service pass through iceoryx2's queues, and are words, each of them atomic. Those of the CAN
//! bridge are plain values that are copied at once.
// lint: safe Rust cannot write in place into shared memory; all code that needs it is in this file
#![allow(unsafe_code)]

use core::ptr::addr_of_mut;
use core::slice;
use core::sync::atomic::{AtomicU64, Ordering::Acquire, fence};

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::reader::{BlackboardValue, EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, EntryValueUninit, Writer};
use iceoryx2::prelude::{ZeroCopySend, ipc_threadsafe};

use crate::actuators::{ActuatorCommand, ActuatorState, OperatorRequest};
use crate::message::{ComputeRequest, ComputeResponse, Entry, RequestHead, ResponseHead};
use crate::watch::BridgeStatistics;

/// The service variant of all ports: they move between threads.
pub(crate) type Threadsafe = ipc_threadsafe::Service;
/// The key of a lane's only entry.
pub(crate) const KEY: u64 = 0;

macro_rules! plain {
    ($($type:ty = $name:literal $(, const $n:ident)?;)*) => { $(
        // SAFETY: `repr(C)`, holds plain numbers only, no pointer, handle or index into anything
        // outside itself; the name changes with the layout.
        unsafe impl $(<const $n: usize>)? ZeroCopySend for $type {
            unsafe fn type_name() -> &'static str {
                $name
            }
        }
    )* };
}

plain! {
    Entry<RequestHead, N> = "sarrus.LaneRequest.v4", const N;
    Entry<ResponseHead, N> = "sarrus.LaneResponse.v4", const N;
    ActuatorCommand = "sarrus.ActuatorCommand.v1";
    ActuatorState = "sarrus.ActuatorState.v1";
    BridgeStatistics = "sarrus.BridgeStatistics.v1";
    OperatorRequest = "sarrus.OperatorRequest.v1";
    ComputeRequest = "sarrus.ComputeRequest.v4";
    // its bytes are those of the largest entry
    ComputeResponse = "sarrus.LaneResponse.v4";
}

/// The reading end of a board.
pub trait Inbox<H>: Send {
    /// The entry when it was written since the last call. It is copied before it is read, so that a
    /// concurrent write changes nothing. Makes no system call, takes no lock, never
    /// allocates.
    fn poll(&mut self) -> Option<(H, &[f64])>;
    /// The copy of the entry that the last successful call of [`Inbox::poll`] made.
    fn last(&self) -> (H, &[f64]);
}

/// The writing end of a board.
pub trait Outbox<H>: Send {
    /// The words of the numbers of the entry being written, with arbitrary contents; the reader
    /// does not see them yet.
    fn numbers(&mut self) -> &[AtomicU64];
    /// Gives head and numbers to the reader. Makes no system call, takes no lock, never allocates.
    fn publish(&mut self, head: H);
}

struct Reading<H: Copy + 'static, const N: usize> {
    entry: EntryHandle<Threadsafe, u64, Entry<H, N>>,
    last: BlackboardValue<Entry<H, N>>,
}

/// The reading end of the entry of a board; an entry written before counts as read.
pub(crate) fn inbox<H: Copy + Send + 'static, const N: usize>(
    reader: &Reader<Threadsafe, u64>,
) -> Option<Box<dyn Inbox<H>>>
where
    Entry<H, N>: ZeroCopySend,
{
    let entry = reader.entry::<Entry<H, N>>(&KEY).ok()?;
    let last = entry.get();
    Some(Box::new(Reading { entry, last }))
}

impl<H: Copy + Send + 'static, const N: usize> Inbox<H> for Reading<H, N> {
    #[inline]
    fn poll(&mut self) -> Option<(H, &[f64])> {
        if self.entry.is_up_to_date(&self.last) {
            return None;
        }
        // SYNC POINT: lane entry (the other end is `publish`)
        self.last = self.entry.get();
        Some(self.last())
    }

    #[inline]
    fn last(&self) -> (H, &[f64]) {
        (self.last.head, &self.last.numbers)
    }
}

struct Writing<H: Copy + 'static, const N: usize> {
    // `None` only inside `publish`
    value: Option<EntryValueUninit<Threadsafe, u64, Entry<H, N>>>,
    // an entry without its port is never recognised as a dead client's
    _port: Writer<Threadsafe, u64>,
}

/// The writing end of the entry of a board; `None` when another handle exists or died without
/// giving it back.
pub(crate) fn outbox<H: Copy + Default + Send + 'static, const N: usize>(
    port: Writer<Threadsafe, u64>,
) -> Option<Box<dyn Outbox<H>>>
where
    Entry<H, N>: ZeroCopySend,
{
    let entry: EntryHandleMut<_, _, Entry<H, N>> = port.entry(&KEY).ok()?;
    Some(Box::new(Writing { value: Some(entry.loan_uninit()), _port: port }))
}

impl<H: Copy + Send + 'static, const N: usize> Outbox<H> for Writing<H, N> {
    #[inline]
    fn numbers(&mut self) -> &[AtomicU64] {
        let Some(value) = &mut self.value else { return &[] };
        // SAFETY: the value is a cell of a shared mapping that lives as long as the handle: `N`
        // doubles are mapped at this field, aligned as words, and any bits are an atomic integer.
        // While the slice lives this process touches them through it alone.
        unsafe {
            let numbers = addr_of_mut!((*value.value_mut().as_mut_ptr()).numbers);
            slice::from_raw_parts(numbers.cast(), N)
        }
    }

    #[inline]
    fn publish(&mut self, head: H) {
        if let Some(mut value) = self.value.take() {
            // SAFETY: the field lies in the cell of `numbers`; the head is plain data.
            unsafe { addr_of_mut!((*value.value_mut().as_mut_ptr()).head).write(head) };
            // SYNC POINT: lane entry (the other end is `poll`) SAFETY: the head was just written,
            // and unwritten numbers hold earlier bytes of the mapping: any bits are a double.
            let entry = unsafe { value.assume_init_and_update() };
            // SYNC POINT: next entry (the other end is the second look of iceoryx2's `load`): no
            // store into the next value comes before this, see the head of this file
            fence(Acquire);
            self.value = Some(entry.loan_uninit());
        }
    }
}

pub(crate) type ComputeClient = Client<Threadsafe, ComputeRequest, (), ComputeResponse, ()>;
/// A request that a client waits for.
pub(crate) type ComputePending =
    PendingResponse<Threadsafe, ComputeRequest, (), ComputeResponse, ()>;
/// A request that the server has taken.
pub(crate) type ComputeActive = ActiveRequest<Threadsafe, ComputeRequest, (), ComputeResponse, ()>;

/// Writes a request in place and sends it; `None` when no server took it: it is busy with an older
/// one, or gone.
pub(crate) fn send_request(
    client: &ComputeClient,
    head: &RequestHead,
    numbers: &[f64],
) -> Option<ComputePending> {
    let request = client.loan_uninit().ok()?;
    // SAFETY: the payload lies in a shared mapping: every byte has some value, and any bits are an
    // atomic integer. Only the head and the numbers in use are touched.
    let request = unsafe { request.assume_init() };
    request.payload().write(head, numbers);
    request.send().ok().filter(|pending| pending.number_of_server_connections() > 0)
}

/// Lets `fill` write an answer in place and sends it, if it can be sent; false where `fill` has no
/// answer yet. It may not have run.
pub(crate) fn send_response(
    request: &ComputeActive,
    fill: impl FnOnce(&[AtomicU64]) -> Option<ResponseHead>,
) -> bool {
    // without memory there is no answer
    let Ok(response) = request.loan_uninit() else { return true };
    // SAFETY: the payload lies in a shared mapping: every byte has some value, and any bits are an
    // atomic integer.
    let response = unsafe { response.assume_init() };
    let payload: &ComputeResponse = response.payload();
    let Some(head) = fill(payload.numbers()) else { return false };
    payload.write_head(&head);
    // the client may have gone meanwhile
    let _ = response.send();
    true
}
