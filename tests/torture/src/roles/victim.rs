//! A client that is killed while it attaches or asks.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use clap::{Args, ValueEnum};
use rustix::process::Signal;
use sarrus_client::{Field, FieldSet, Query, Request, Transport};
use sarrus_proto::batch::BatchShape;
use sarrus_proto::control::Call;
use sarrus_proto::message::store_numbers;

use super::Target;
use crate::process::send_signal;
use crate::raw::Raw;
use crate::sandbox::NAME;

const STATE: Query = Query::new(
    Request::Kinematics,
    FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
    FieldSet::of(&[Field::Q, Field::Qd, Field::Qdd, Field::U]),
);

/// The stage after which a client is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum Stage {
    /// The process runs.
    Start,
    /// It is connected.
    Connected,
    /// The server has answered its greeting.
    Greeted,
    /// It has a plan.
    Planned,
    /// It was granted a lane or a service.
    Granted,
    /// It has claimed the lane, opened the service.
    Opened,
    /// The server polls its end.
    Served,
    /// A request is under way.
    Asked,
    /// It was answered, and goes on asking.
    Answered,
    /// A batch is under way, and the next one after it.
    Batched,
    /// Never.
    Never,
}

impl Stage {
    /// Every stage as often as it is worth: attaching is where servers died.
    pub(crate) const WEIGHTED: [Stage; 26] = [
        Stage::Start,
        Stage::Connected,
        Stage::Connected,
        Stage::Greeted,
        Stage::Greeted,
        Stage::Planned,
        Stage::Granted,
        Stage::Granted,
        Stage::Granted,
        Stage::Granted,
        Stage::Granted,
        Stage::Opened,
        Stage::Opened,
        Stage::Opened,
        Stage::Served,
        Stage::Served,
        Stage::Asked,
        Stage::Asked,
        Stage::Asked,
        Stage::Asked,
        Stage::Answered,
        Stage::Answered,
        Stage::Batched,
        Stage::Batched,
        Stage::Batched,
        Stage::Batched,
    ];

    pub(crate) fn flag(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

#[derive(Args)]
pub(crate) struct Victim {
    #[command(flatten)]
    target: Target,
    /// Killed after this.
    #[arg(long)]
    stage: Stage,
    /// So long after it `[µs]`; 0 is at once.
    #[arg(long, default_value_t = 0)]
    delay: u64,
    /// Prints a line when it was answered.
    #[arg(long)]
    tell: bool,
}

impl Victim {
    pub(crate) fn run(self) -> Result<(), String> {
        // a thread that kills the process while this one goes on
        let (reached, wait) = sync_channel::<()>(1);
        let delay = Duration::from_micros(self.delay);
        std::thread::spawn(move || {
            if wait.recv().is_ok() {
                std::thread::sleep(delay);
                send_signal(std::process::id(), Signal::KILL);
            }
        });
        let at = |stage: Stage| reach(&self, stage, &reached);

        at(Stage::Start);
        let mut raw = Raw::connect(&self.target.domain()?, NAME)?;
        at(Stage::Connected);
        raw.hello()?;
        at(Stage::Greeted);
        let (plan, sizes) = raw.plan(&STATE)?;
        let numbers = vec![0.0; sizes[0]];
        at(Stage::Planned);
        match self.target.transport() {
            Transport::Lane => {
                let (link, classes) = raw.lane(sizes)?;
                at(Stage::Granted);
                let (mut lane, _node) = raw.claim(link, classes)?;
                at(Stage::Opened);
                at(Stage::Served);
                if self.stage == Stage::Batched {
                    return ask_rows(&mut raw, plan, sizes, at);
                }
                for sequence in 1.. {
                    store_numbers(lane.outbox.numbers(), &numbers);
                    lane.outbox.publish(raw.head(plan, sequence));
                    at(Stage::Asked);
                    while lane.inbox.poll().is_none() {
                        std::thread::yield_now();
                    }
                    self.answered(sequence);
                    at(Stage::Answered);
                }
            }
            Transport::Service => {
                let link = raw.service()?;
                at(Stage::Granted);
                let (mut client, _node) = raw.open(link)?;
                at(Stage::Opened);
                raw.call(Call::Serve)?;
                at(Stage::Served);
                if self.stage == Stage::Batched {
                    return ask_rows(&mut raw, plan, sizes, at);
                }
                for sequence in 1.. {
                    client.cancel();
                    client.send(&raw.head(plan, sequence), &numbers);
                    at(Stage::Asked);
                    while matches!(client.poll(), Ok(None)) {
                        std::thread::yield_now();
                    }
                    self.answered(sequence);
                    at(Stage::Answered);
                }
            }
        }
        Ok(())
    }

    fn answered(&self, sequence: u64) {
        if self.tell && sequence == 1 {
            println!("answered");
        }
        if self.stage == Stage::Never {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Asks for as many rows as there is room for, again and again.
fn ask_rows(
    raw: &mut Raw,
    plan: u32,
    [n_in, n_out]: [usize; 2],
    at: impl Fn(Stage),
) -> Result<(), String> {
    let (area, _memory) = raw.batches()?;
    let rows = BatchShape::most_rows(n_in, n_out) as u64;
    let shape = BatchShape::new(rows, n_in, n_out).ok_or("no room for a row")?;
    let input = vec![0.0; shape.rows() * n_in];
    for sequence in 1.. {
        area.send(&raw.batch_head(plan, sequence, rows), &shape, &input);
        at(Stage::Batched);
        while area.answer(sequence).is_none() {
            std::thread::yield_now();
        }
    }
    Ok(())
}

fn reach(victim: &Victim, stage: Stage, reached: &SyncSender<()>) {
    if victim.stage == stage {
        if victim.delay == 0 {
            send_signal(std::process::id(), Signal::KILL);
        }
        let _ = reached.try_send(());
    }
}
