//! Other clients of the measured server: some have an idle lane, some always have a batch under
//! way.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sarrus_client::{ConnectOptions, Robot as Client};
use sarrus_proto::batch::{BatchHead, BatchShape, ClaimedBatch, MAX_BATCH_ROWS};
use sarrus_proto::control::{Call, CallHead, ControlRequest, ControlResponse, Grant, exchange};
use sarrus_proto::socket::ControlSocket;
use sarrus_proto::{Domain, PROTOCOL_VERSION, Query, ServerName};
use sarrus_report::Outcome;

use crate::measure::ROBOT;

/// How many of each.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Numbers {
    pub(crate) idle: usize,
    pub(crate) flooding: usize,
}

/// Between two looks at the batches: shorter than the server takes for one, and long enough that
/// the client that is measured keeps its processor.
const LOOK: Duration = Duration::from_micros(100);

/// The clients; they leave when this is dropped.
pub(crate) struct Crowd {
    _idle: Vec<Client>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Crowd {
    /// They come; batches ask `query` for this state.
    pub(crate) fn start(
        domain: &Domain,
        numbers: Numbers,
        query: &Query,
        state: &[f64],
        n_out: usize,
    ) -> Outcome<Crowd> {
        let connect = |_| Client::connect_in(domain.clone(), ROBOT, ConnectOptions::default());
        let idle = (0..numbers.idle).map(connect).collect::<Result<_, _>>()?;
        let floods = (0..numbers.flooding).map(|_| Flood::start(domain, query, state, n_out));
        let mut floods = floods.collect::<Outcome<Vec<_>>>()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let thread = (!floods.is_empty()).then(|| {
            std::thread::spawn(move || {
                while !stopped.load(Relaxed) {
                    floods.iter_mut().for_each(Flood::ask_again);
                    std::thread::sleep(LOOK);
                }
            })
        });
        Ok(Crowd { _idle: idle, stop, thread })
    }
}

impl Drop for Crowd {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A client that asks for the same batch again and again.
struct Flood {
    area: ClaimedBatch,
    shape: BatchShape,
    head: BatchHead,
    _control: ControlSocket,
}

impl Flood {
    fn start(domain: &Domain, query: &Query, state: &[f64], n_out: usize) -> Outcome<Flood> {
        let name = ServerName::new(ROBOT)?;
        let folder = domain.server_folders(&name).next().ok_or("no folder of the server")?;
        let control = ControlSocket::connect(&folder)?;
        let call = |call| {
            let head = CallHead { version: PROTOCOL_VERSION, nonce: 1 };
            let request = ControlRequest { head, fingerprint: 0, call };
            let deadline = Instant::now() + Duration::from_secs(5);
            exchange(&control, &request, deadline).map_err(|error| format!("{error:?}"))
        };
        let refused = |response: &ControlResponse| format!("a flood: {:?}", response.outcome);
        let (response, _) = call(Call::Plan { query: Box::new(*query) })?;
        let Ok(Grant::Plan { number, .. }) = response.outcome else {
            return Err(refused(&response).into());
        };
        call(Call::Lane { n_in: 1, n_out: 1 })?;
        let (granted, memory) = call(Call::Batch)?;
        let area = ClaimedBatch::open(&memory.ok_or_else(|| refused(&granted))?)?;
        let shape = BatchShape::new(MAX_BATCH_ROWS as u64, state.len(), n_out);
        let shape = shape.ok_or("the batch is too large")?;
        let head = BatchHead {
            version: PROTOCOL_VERSION,
            plan: number.0,
            fingerprint: response.fingerprint,
            sequence: 1,
            rows: MAX_BATCH_ROWS as u64,
        };
        area.send(&head, &shape, &state.repeat(MAX_BATCH_ROWS));
        Ok(Flood { area, shape, head, _control: control })
    }

    /// Asks for the rows that are there, once they are answered.
    fn ask_again(&mut self) {
        if self.area.answer(self.head.sequence).is_some() {
            self.head.sequence += 1;
            self.area.send(&self.head, &self.shape, &[]);
        }
    }
}
