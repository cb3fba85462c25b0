//! A robot that Python's threads share.
//!
//! A robot in this process is asked with Python's lock held, one state at a time, and its batches
//! have scratch of their own: no thread waits for another. A connected one is asked without
//! Python's lock; all of Python that runs while the robot is locked are handlers of signals, and
//! they are refused it.

use std::num::NonZero;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use sarrus_client::{Answer, Error, FailedState, Model, PlanId, Robot, Status, Warnings};
use sarrus_proto::process_number;

use super::errors::{ConnectError, robot_error};
use super::signals::{hold, is_main, waiting};
use crate::locked;

/// The words of all statuses, by number.
#[pyfunction]
pub(crate) fn statuses() -> Vec<&'static str> {
    Status::ALL.iter().map(|status| status.name()).collect()
}

/// The meaning of a status and its remedy.
#[pyfunction]
pub(crate) fn status_help(code: u32) -> String {
    FailedState { status: Status::of_answer(code) }.to_string()
}

/// The words of all warnings, by bit.
#[pyfunction]
pub(crate) fn warning_bits() -> Vec<&'static str> {
    Warnings(u32::MAX).names().collect()
}

/// The robot behind a lock.
pub(super) struct Shared {
    /// `None` only while this is dropped.
    robot: Mutex<Option<Robot>>,
    /// The model, in this process.
    pub(super) model: Option<Arc<Model<f64>>>,
    /// Plans of a connected robot that are held no more, and of which its server does not know yet.
    released: Mutex<Vec<PlanId>>,
    /// [`process_number`] of the owner.
    process: u64,
}

impl Shared {
    pub(super) fn new(robot: Robot) -> Shared {
        Shared {
            model: robot.shared_model(),
            robot: Mutex::new(Some(robot)),
            released: Mutex::new(Vec::new()),
            process: process_number(),
        }
    }

    /// True in a child of a fork: the connection belongs to the parent, and no other process may
    /// use it.
    fn is_inherited(&self) -> bool {
        self.model.is_none() && process_number() != self.process
    }

    /// Does something with the robot, which must call nothing of Python; Ctrl-C ends the wait for a
    /// server, and the next call connects again.
    pub(super) fn with<T: Send>(
        &self,
        py: Python<'_>,
        f: impl FnOnce(&mut Robot) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        if self.is_inherited() {
            return Err(ConnectError::new_err(
                "this robot was connected by the parent of this process; connect again after a \
                 fork, by `Robot.connect`",
            ));
        }
        let of = |robot: &mut Option<Robot>| match robot.as_mut() {
            Some(robot) => f(robot),
            None => Err(Error::UnknownPlan),
        };
        if self.model.is_some() {
            return of(&mut locked(&self.robot)).map_err(robot_error);
        }
        let is_main = is_main(py)?;
        let detached = || {
            let mut held = hold(is_main, &self.robot)?;
            waiting(is_main, || of(&mut held.inner))
        };
        py.detach(detached)?.map_err(robot_error)
    }

    /// Prepares a plan, after releasing those that are dropped.
    pub(super) fn prepare<T: Send>(
        &self,
        py: Python<'_>,
        f: impl FnOnce(&mut Robot) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        self.with(py, |robot| {
            // taken in a statement of its own: a thread that drops a plan meanwhile must not wait
            let released = std::mem::take(&mut *locked(&self.released));
            for plan in released {
                // a server that is gone took the plan with it
                let _ = robot.release(plan);
            }
            f(robot)
        })
    }

    /// Asks for states of a batch, which holds no lock of Python, on the thread that called.
    pub(super) fn batch_detached(
        &self,
        is_main: bool,
        plan: PlanId,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> PyResult<()> {
        let threads = NonZero::<usize>::MIN;
        let mut held = hold(is_main, &self.robot)?;
        let asked = waiting(is_main, || match held.inner.as_mut() {
            Some(robot) => robot.batch(plan, threads, input, output, answers),
            None => Err(Error::UnknownPlan),
        });
        asked?.map_err(robot_error)
    }

    /// Releases a plan. The caller holds Python's lock and must wait neither for a server nor for a
    /// thread that asks it: a connected robot releases it when the next one is prepared.
    pub(super) fn release(&self, plan: PlanId) {
        if self.is_inherited() {
            return;
        }
        if self.model.is_none() {
            locked(&self.released).push(plan);
        } else if let Some(robot) = locked(&self.robot).as_mut() {
            let _ = robot.release(plan);
        }
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // only the parent may remove the memory that it shares with its server
        if self.is_inherited() {
            let robot = self.robot.get_mut().unwrap_or_else(PoisonError::into_inner);
            std::mem::forget(robot.take());
        }
    }
}
