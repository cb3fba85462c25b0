//! Registered plans: made when a client registers a query, retired when no client holds them.
//!
//! A connection holds a plan from [`Plans::register`] until it releases it or ends; equal queries
//! share one plan. The answering thread owns the plans that it runs and never frees one: it returns
//! each, and only then is its slot in the table free for another plan, under another number.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer};
use sarrus_dynamics::{Model, Plan};
use sarrus_proto::control::{Holder, Refusal};
use sarrus_proto::message::{
    MAX_NUMBERS_IN, MAX_NUMBERS_OUT, MAX_PLANS, MAX_PLANS_OF_PROCESS, PlanNumber,
};
use sarrus_proto::{Query, QueryError, QueryOptions};

use crate::answering::engine::{PlanOrder, ServedPlan};
use crate::kernels::Maker;
use crate::upkeep::quota::{Client, Orders, greatest};

/// Longest wait of a registration for a slot that is being returned.
const HAND_BACK: Duration = Duration::from_millis(20);

/// A registered plan, as sent to its client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Registered {
    pub(crate) number: PlanNumber,
    pub(crate) n_in: usize,
    pub(crate) n_out: usize,
}

enum State {
    Free,
    Held {
        query: Box<Query>,
        registered: Registered,
        holders: Vec<Client>,
    },
    /// Being returned by the answering thread.
    Leaving,
}

struct Slot {
    /// Number of uses.
    generation: u32,
    state: State,
}

impl Slot {
    fn holders(&self) -> &[Client] {
        match &self.state {
            State::Held { holders, .. } => holders,
            _ => &[],
        }
    }
}

/// The plans of all clients.
pub(crate) struct Plans {
    slots: Vec<Slot>,
    orders: Producer<PlanOrder>,
    retired: Consumer<Box<ServedPlan>>,
    kernels: Maker,
}

impl Plans {
    pub(crate) fn new(
        orders: Producer<PlanOrder>,
        retired: Consumer<Box<ServedPlan>>,
        kernels: Maker,
    ) -> Plans {
        let slots = (0..MAX_PLANS).map(|_| Slot { generation: 0, state: State::Free }).collect();
        Plans { slots, orders, retired, kernels }
    }

    /// Number of plans.
    pub(crate) fn len(&self) -> usize {
        self.slots.iter().filter(|slot| matches!(slot.state, State::Held { .. })).count()
    }

    /// The plan of a query, held by `holder` from now on.
    pub(crate) fn register(
        &mut self,
        model: &Model<f64>,
        query: &Query,
        holder: Client,
        orders: &mut Orders,
    ) -> Result<Registered, Refusal> {
        let of_process =
            |slot: &&Slot| slot.holders().iter().any(|one| one.process == holder.process);
        let held = self.slots.iter().filter(of_process).count();
        // a plan that others hold
        for slot in &mut self.slots {
            let is_own = of_process(&&*slot);
            if let State::Held { query: known, registered, holders } = &mut slot.state
                && **known == *query
            {
                if !is_own && held >= MAX_PLANS_OF_PROCESS {
                    return Err(Refusal::TooManyPlans);
                }
                if !holders.contains(&holder) {
                    holders.push(holder);
                }
                return Ok(*registered);
            }
        }

        // a new one
        if held >= MAX_PLANS_OF_PROCESS {
            return Err(Refusal::TooManyPlans);
        }
        orders.count(holder.process, Instant::now())?;
        let bad = |error: QueryError| Refusal::BadQuery { reason: error.to_string() };
        let plan = Plan::new(model, query).map_err(bad)?;
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        if n_in > MAX_NUMBERS_IN || n_out > MAX_NUMBERS_OUT {
            return Err(Refusal::TooLarge { n_in, n_out });
        }
        let index = self.free_slot().ok_or(Refusal::TooManyPlans)?;
        let slot = &mut self.slots[index];
        let number = PlanNumber::new(index, slot.generation);
        let checks = query.options.contains(QueryOptions::CHECKSUM);
        let kernel = self.kernels.kernel_of(&plan);
        let order =
            PlanOrder::Serve(Box::new(ServedPlan { number, plan: Arc::new(plan), kernel, checks }));
        // there is room: full means that the answering thread is gone
        self.orders.push(order).map_err(|_| Refusal::TooManyPlans)?;
        slot.generation += 1;
        let registered = Registered { number, n_in, n_out };
        slot.state = State::Held { query: Box::new(*query), registered, holders: vec![holder] };
        Ok(registered)
    }

    /// Releases a plan held by `holder`; false if it held none.
    pub(crate) fn release(&mut self, number: PlanNumber, holder: Client) -> bool {
        let Some(slot) = self.slots.get_mut(number.slot()) else { return false };
        let State::Held { registered, holders, .. } = &mut slot.state else { return false };
        if registered.number != number {
            return false;
        }
        let held = holders.len();
        holders.retain(|one| *one != holder);
        let had = holders.len() < held;
        retire_if_unheld(&mut self.orders, slot);
        had
    }

    /// Releases all plans of the client with this number.
    pub(crate) fn release_all(&mut self, number: u64) {
        for slot in &mut self.slots {
            if let State::Held { holders, .. } = &mut slot.state {
                holders.retain(|one| one.number != number);
                retire_if_unheld(&mut self.orders, slot);
            }
        }
    }

    /// Number of plans that the client with this number has.
    pub(crate) fn held(&self, number: u64) -> usize {
        let holds = |slot: &&Slot| slot.holders().iter().any(|one| one.number == number);
        self.slots.iter().filter(holds).count()
    }

    /// The process that holds most plans; a plan counts once for each of its processes.
    pub(crate) fn greatest_holder(&self) -> Option<Holder> {
        greatest(self.slots.iter().flat_map(|slot| {
            let holders = slot.holders();
            let is_first =
                |k: usize| holders[..k].iter().all(|before| before.process != holders[k].process);
            (0..holders.len()).filter(move |k| is_first(*k)).map(|k| holders[k].process)
        }))
    }

    /// Frees returned plans, retires unheld ones, passes new kernels on; call it often.
    pub(crate) fn upkeep(&mut self) {
        self.collect();
        self.slots.iter_mut().for_each(|slot| retire_if_unheld(&mut self.orders, slot));
        while let Some((is_for, kernel)) = self.kernels.made() {
            for slot in &self.slots {
                if let State::Held { query, registered, .. } = &slot.state
                    && is_for(query)
                {
                    // there is room; otherwise the generic kernel continues
                    let _ = self.orders.push(PlanOrder::Kernel(registered.number, kernel.clone()));
                }
            }
        }
    }

    /// Ends the thread that makes kernels.
    pub(crate) fn stop(&mut self) {
        self.kernels.stop();
    }

    fn collect(&mut self) {
        // dropped here, not on the answering thread
        while let Ok(served) = self.retired.pop() {
            self.slots[served.number.slot()].state = State::Free;
        }
    }

    /// The least used free slot; a slot without further numbers is never free again.
    fn free_slot(&mut self) -> Option<usize> {
        let free = |slots: &[Slot]| {
            let free = slots.iter().enumerate().filter(|(_, slot)| {
                matches!(slot.state, State::Free) && slot.generation < PlanNumber::GENERATIONS
            });
            free.min_by_key(|(_, slot)| slot.generation).map(|(index, _)| index)
        };
        let start = Instant::now();
        loop {
            self.collect();
            let leaving = self.slots.iter().any(|slot| matches!(slot.state, State::Leaving));
            match free(&self.slots) {
                None if leaving && start.elapsed() < HAND_BACK => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                found => return found,
            }
        }
    }
}

fn retire_if_unheld(orders: &mut Producer<PlanOrder>, slot: &mut Slot) {
    if let State::Held { registered, holders, .. } = &slot.state
        && holders.is_empty()
        // otherwise retried at the next upkeep
        && orders.push(PlanOrder::Retire(registered.number)).is_ok()
    {
        slot.state = State::Leaving;
    }
}
