//! The share of one process of clients, so that it cannot take everything from the others.
//!
//! All connections of a process count together; the kernel gives its number. It may hold three
//! quarters of the plans, all but an eighth of the lanes, and all but a few connections, and makes
//! plans, lanes and services at a limited rate. More than that is refused, with the number of the
//! process that holds most.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use sarrus_proto::control::{Holder, Refusal};

/// A client: the number of its connection, and its process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Client {
    pub(crate) number: u64,
    pub(crate) process: u32,
}

/// Connections beyond the limit of one process.
pub(crate) const RESERVED_CONNECTIONS: usize = 16;

/// Lanes that one process may hold.
pub(crate) fn most_lanes(n_lanes: usize) -> usize {
    n_lanes - n_lanes / 8
}

/// The process that holds most, by the process of each plan, lane or connection.
pub(crate) fn greatest(processes: impl Iterator<Item = u32>) -> Option<Holder> {
    let mut held = BTreeMap::<u32, usize>::new();
    processes.for_each(|process| *held.entry(process).or_default() += 1);
    let most = held.into_iter().max_by_key(|(_, held)| *held);
    most.map(|(process, held)| Holder { process, held })
}

/// Orders of one process in a second: about a fifth of the upkeep thread's time.
const PER_SECOND: u32 = 500;
/// Orders at once, such as those of a program that prepares thousands of queries.
const AT_ONCE: u32 = 4096;

/// The orders of each process, as the time at which its rate will have made up for them.
#[derive(Default)]
pub(crate) struct Orders(BTreeMap<u32, Instant>);

impl Orders {
    /// Counts an order, or refuses it.
    pub(crate) fn count(&mut self, process: u32, now: Instant) -> Result<(), Refusal> {
        let each = Duration::from_secs(1) / PER_SECOND;
        self.0.retain(|_, until| *until > now);
        let until = self.0.entry(process).or_insert(now);
        if *until >= now + each * AT_ONCE {
            return Err(Refusal::TooManyOrders { process, per_second: PER_SECOND });
        }
        *until += each;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_refused_at_its_rate_and_no_other() {
        let mut orders = Orders::default();
        let start = Instant::now();
        let served = |orders: &mut Orders, process, at: Duration| {
            (0..).take_while(|_| orders.count(process, start + at).is_ok()).count()
        };
        assert_eq!(served(&mut orders, 7, Duration::ZERO), AT_ONCE as usize);
        let refused = orders.count(7, start);
        assert_eq!(refused, Err(Refusal::TooManyOrders { process: 7, per_second: PER_SECOND }));
        assert_eq!(served(&mut orders, 7, Duration::from_secs(1)), PER_SECOND as usize);
        assert_eq!(served(&mut orders, 8, Duration::from_secs(1)), AT_ONCE as usize);
        assert_eq!(served(&mut orders, 7, Duration::from_secs(3600)), AT_ONCE as usize);
    }

    #[test]
    fn the_process_that_holds_most_is_named() {
        assert_eq!(greatest([3, 5, 3].into_iter()), Some(Holder { process: 3, held: 2 }));
        assert_eq!(greatest([].into_iter()), None);
        assert_eq!([0, 1, 2, 7, 8, 16].map(most_lanes), [0, 1, 2, 7, 7, 14]);
    }
}
