//! Lanes beside the answering thread: made for clients that attach, retired when these leave, die
//! or never come.

use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

use sarrus_proto::board::ServedLane;
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::service::ServiceError;
use sarrus_proto::{LaneId, ServerName};

use crate::hot::{HotLane, Order, Retired};

/// A lane that nobody claims for this long is retired.
const UNCLAIMED: Duration = Duration::from_secs(5);
/// How long an attach waits for a lane that is just being given back.
const HAND_BACK: Duration = Duration::from_millis(20);

enum Lane {
    Free,
    Offered {
        boards: ServedLane,
        since: Instant,
    },
    Claimed {
        boards: ServedLane,
    },
    /// Ordered back from the answering thread.
    Leaving {
        _boards: ServedLane,
    },
}

struct Slot {
    generation: u32,
    lane: Lane,
}

/// All lanes of a run of the server.
pub(crate) struct Lanes {
    name: ServerName,
    instance: u64,
    slots: Vec<Slot>,
    orders: SyncSender<Order>,
    retired: Receiver<Retired>,
    made: u64,
}

/// Why there is no lane for a client.
#[derive(Debug)]
pub(crate) enum NoLane {
    Full,
    Failed(ServiceError),
}

type Node = iceoryx2::node::Node<Threadsafe>;

impl Lanes {
    pub(crate) fn new(
        name: ServerName,
        instance: u64,
        n: usize,
        orders: SyncSender<Order>,
        retired: Receiver<Retired>,
    ) -> Lanes {
        let slots = (0..n).map(|_| Slot { generation: 0, lane: Lane::Free }).collect();
        Lanes { name, instance, slots, orders, retired, made: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn made(&self) -> u64 {
        self.made
    }

    pub(crate) fn taken(&self) -> usize {
        self.slots.iter().filter(|slot| !matches!(slot.lane, Lane::Free)).count()
    }

    /// Makes a lane for a client that attaches.
    pub(crate) fn make(&mut self, node: &Node, classes: [usize; 2]) -> Result<LaneId, NoLane> {
        let index = self.free_slot(node).ok_or(NoLane::Full)?;
        let slot = &mut self.slots[index];
        slot.generation += 1;
        let id = LaneId { slot: index as u32, generation: slot.generation };
        let (boards, inbox, outbox) =
            ServedLane::create(node, &self.name, self.instance, id, classes)
                .map_err(NoLane::Failed)?;
        let order = Order::Serve { slot: index, lane: HotLane { inbox, outbox } };
        // room for two orders of each lane: full means that the answering thread is gone
        self.orders.try_send(order).map_err(|_| NoLane::Full)?;
        slot.lane = Lane::Offered { boards, since: Instant::now() };
        self.made += 1;
        Ok(id)
    }

    /// Sees who came, who left and who never came; call it often.
    pub(crate) fn upkeep(&mut self) {
        while let Ok((index, lane)) = self.retired.try_recv() {
            // here, not on the answering thread: unmapping is a system call
            drop(lane);
            self.slots[index].lane = Lane::Free;
        }
        for (index, slot) in self.slots.iter_mut().enumerate() {
            slot.lane = match std::mem::replace(&mut slot.lane, Lane::Free) {
                Lane::Offered { boards, .. } | Lane::Claimed { boards } if boards.is_claimed() => {
                    Lane::Claimed { boards }
                }
                Lane::Offered { boards, since }
                    if !boards.was_claimed() && since.elapsed() < UNCLAIMED =>
                {
                    Lane::Offered { boards, since }
                }
                Lane::Offered { boards, .. } | Lane::Claimed { boards } => {
                    leave(&self.orders, index, boards)
                }
                lane => lane,
            };
        }
    }

    fn free_slot(&mut self, node: &Node) -> Option<usize> {
        let free = |slots: &[Slot]| slots.iter().position(|slot| matches!(slot.lane, Lane::Free));
        if let Some(index) = free(&self.slots) {
            return Some(index);
        }
        // perhaps somebody just died or left
        node.try_cleanup_dead_nodes();
        let start = Instant::now();
        loop {
            self.upkeep();
            let leaving = self.slots.iter().any(|slot| matches!(slot.lane, Lane::Leaving { .. }));
            match free(&self.slots) {
                None if leaving && start.elapsed() < HAND_BACK => {
                    std::thread::sleep(Duration::from_millis(1))
                }
                found => return found,
            }
        }
    }
}

fn leave(orders: &SyncSender<Order>, slot: usize, boards: ServedLane) -> Lane {
    match orders.try_send(Order::Retire { slot }) {
        Ok(()) => Lane::Leaving { _boards: boards },
        // tried again at the next upkeep
        Err(_) => Lane::Claimed { boards },
    }
}
