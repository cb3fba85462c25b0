//! The processor and the priority of the answering thread, and the locking of memory.
//!
//! The flags apply to the answering thread alone. All other threads, which clients need to attach,
//! leave its processor and keep the system's default policy.

mod choice;
mod error;

use std::io;
use std::sync::Arc;

use rustix::mm::{MlockAllFlags, mlockall, munlockall};
use rustix::process::{Resource, getpriority_process, getrlimit, setpriority_process};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_getaffinity, sched_setaffinity};
use thread_priority::{
    Error, NormalThreadSchedulePolicy, RealtimeThreadSchedulePolicy, ThreadPriority,
    ThreadPriorityValue, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

use choice::{Choice, Policy, choose};

pub(crate) use choice::Flags;
pub use error::PlacementError;

/// The placement of the threads of one run.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    choice: Choice,
    allowed: Arc<[usize]>,
    lock_memory: bool,
}

impl Placement {
    /// The placement by the flags, from the inherited processors and policy. Refuses flags that
    /// cannot work or are not permitted; changes nothing.
    pub(crate) fn new(flags: Flags) -> Result<Placement, PlacementError> {
        let allowed = allowed();
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap_or_default();
        let policy = Policy::of_stat(&stat).unwrap_or(Policy::Shared);
        let choice = choose(&allowed, policy, flags)?;

        let limit = limit_of(Resource::Rtprio, CapabilitySet::SYS_NICE);
        if let (Some(priority), Some(limit)) = (flags.priority, limit)
            && limit < priority.into()
        {
            return Err(PlacementError::PriorityNotPermitted(priority, limit));
        }
        let limit = limit_of(Resource::Memlock, CapabilitySet::IPC_LOCK);
        if let Some(limit) = limit.filter(|_| flags.lock_memory) {
            return Err(PlacementError::MemoryNotPermitted(limit));
        }
        Ok(Placement { choice, allowed: allowed.into(), lock_memory: flags.lock_memory })
    }

    /// Locks present and future mappings until the value is dropped. Pages are made when they are
    /// mapped (no `MCL_ONFAULT`), by the thread that maps them: later lanes and plans are in memory
    /// before the answering thread uses them.
    pub(crate) fn lock_memory(&self) -> Result<LockedMemory, PlacementError> {
        if self.lock_memory {
            mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
                .map_err(|error| PlacementError::Memory(error.to_string()))?;
        }
        Ok(LockedMemory(self.lock_memory))
    }

    /// Makes the calling thread the answering one.
    pub(crate) fn place_answering(&self) -> Result<(), PlacementError> {
        if let Some(cpu) = self.choice.cpu {
            move_to(&[cpu]).map_err(|error| PlacementError::Processor {
                cpu,
                reason: error.to_string(),
                allowed: list(&self.allowed),
            })?;
        }
        self.choice.priority.map_or(Ok(()), be_first)
    }

    /// Makes the calling thread one of the others. Drops an inherited real-time policy after the
    /// answering thread has taken it over.
    pub(crate) fn place_other(&self) -> Result<(), PlacementError> {
        let failed = |reason| PlacementError::Others(reason);
        if let Some(others) = &self.choice.others {
            move_to(others).map_err(|error| failed(error.to_string()))?;
        }
        if self.choice.others_shared {
            share().map_err(|error| failed(error.to_string()))?;
        }
        Ok(())
    }
}

/// Keeps memory locked until dropped.
pub(crate) struct LockedMemory(bool);

impl Drop for LockedMemory {
    fn drop(&mut self) {
        if self.0 {
            let _ = munlockall();
        }
    }
}

/// A soft limit of this process; `None` if there is none, or if this capability overrides it.
fn limit_of(resource: Resource, capability: CapabilitySet) -> Option<u64> {
    let is_capable = capabilities(None).is_ok_and(|sets| sets.effective.contains(capability));
    getrlimit(resource).current.filter(|_| !is_capable)
}

/// The processors of the calling thread.
fn allowed() -> Vec<usize> {
    let set = sched_getaffinity(None).unwrap_or_default();
    (0..CpuSet::MAX_CPU).filter(|cpu| set.is_set(*cpu)).collect()
}

fn move_to(processors: &[usize]) -> io::Result<()> {
    let mut set = CpuSet::new();
    for &cpu in processors {
        if cpu >= CpuSet::MAX_CPU {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        set.set(cpu);
    }
    Ok(sched_setaffinity(None, &set)?)
}

/// SCHED_FIFO for the calling thread.
fn be_first(priority: u8) -> Result<(), PlacementError> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let value = ThreadPriorityValue::try_from(priority)
        .map_err(|_| PlacementError::PriorityRange(priority))?;
    let value = ThreadPriority::Crossplatform(value);
    set_thread_priority_and_policy(thread_native_id(), value, policy).map_err(|error| {
        let reason = match error {
            Error::OS(code) => io::Error::from_raw_os_error(code).to_string(),
            error => error.to_string(),
        };
        PlacementError::Priority(priority, reason)
    })
}

/// SCHED_OTHER for the calling thread, as nice as it was.
fn share() -> Result<(), Error> {
    // 47 of 0 to 99 is the nice value 0, which needs no right
    const MIDDLE: u8 = 47;
    let nice = getpriority_process(None).unwrap_or(0);
    let value =
        ThreadPriorityValue::try_from(MIDDLE).map_err(|_| Error::Priority("no nice value of 0"))?;
    let policy = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Other);
    let value = ThreadPriority::Crossplatform(value);
    set_thread_priority_and_policy(thread_native_id(), value, policy)?;
    let _ = setpriority_process(None, nice);
    Ok(())
}

/// `0, 2 and 3`.
fn list(processors: &[usize]) -> String {
    let words: Vec<String> = processors.iter().map(usize::to_string).collect();
    match words.as_slice() {
        [] => "none".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_processor_that_is_not_there_is_refused_with_those_that_are() {
        let flags = Flags { cpu: Some(1000), ..Flags::default() };
        let placement = Placement::new(flags).unwrap();
        // in a separate thread, which may be moved
        let outcome = std::thread::spawn(move || placement.place_answering()).join().unwrap();
        let error = outcome.unwrap_err().to_string();
        assert!(error.contains("processor 1000 cannot be had"), "{error}");
        let flags = Flags { cpu: Some(usize::MAX), ..Flags::default() };
        assert!(Placement::new(flags).unwrap().place_answering().is_err());
    }

    #[test]
    fn the_answering_thread_runs_where_it_is_asked_to() {
        let cpu = allowed()[0];
        let placement = Placement::new(Flags { cpu: Some(cpu), ..Flags::default() }).unwrap();
        let body = move || placement.place_answering().map(|()| allowed());
        assert_eq!(std::thread::spawn(body).join().unwrap(), Ok(vec![cpu]));
    }

    #[test]
    fn processors_are_listed_as_one_speaks() {
        assert_eq!(list(&[]), "none");
        assert_eq!(list(&[4]), "4");
        assert_eq!(list(&[0, 1, 3]), "0, 1 and 3");
    }
}
