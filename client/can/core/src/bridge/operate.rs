//! Requests of operators for one mechanism or all: arm, disarm, return inside the limits, reset
//! after a fault.

use sarrus_proto::actuators::{Operation, OperatorRequest, Reason};

use super::Bridge;
use super::motor::Motor;
use crate::config::Commissioning;

/// Requests for power that are older than this have expired `[ns]`.
const OPERATION_NS: u64 = 1_000_000_000;
/// Requests to disarm within this time count as one `[ns]`.
const REPEATED_NS: u64 = 100_000_000;

impl Bridge {
    /// Takes a request of an operator. Only a recent request gives power, and only if it was made
    /// after the last request to disarm, in any order of arrival. Clients repeat a request to
    /// disarm until they see its effect; immediate repetitions count once.
    pub fn request(&mut self, now_ns: u64, request: &OperatorRequest) -> Option<Operation> {
        let operation = Operation::from_code(request.operation)?;
        let actuator = request.actuator.checked_sub(1).map(|actuator| actuator as usize);
        let meant = self.meant(actuator)?;
        if operation == Operation::Disarm {
            let is_repeated = request.stamp_ns.abs_diff(self.disarmed_at) <= REPEATED_NS
                && request.actuator == self.disarmed;
            self.disarmed_at = self.disarmed_at.max(request.stamp_ns);
            self.disarmed = request.actuator;
            let is_meant = |number: usize| meant.is_none_or(|meant| meant == number);
            let mut mechanisms = self.mechanisms.iter().enumerate();
            if is_repeated
                && mechanisms.any(|(number, mechanism)| is_meant(number) && mechanism.is_stopping())
            {
                return None;
            }
        } else if now_ns.abs_diff(request.stamp_ns) > OPERATION_NS
            || request.stamp_ns <= self.disarmed_at
        {
            return None;
        }
        self.operate_mechanism(now_ns, operation, actuator);
        Some(operation)
    }

    /// Executes an operation on the whole robot.
    pub fn operate(&mut self, now_ns: u64, operation: Operation) {
        self.operate_mechanism(now_ns, operation, None);
    }

    /// Executes an operation on the mechanism that an actuator acts on, by its place in u, or on
    /// all of them; does nothing where there is no such actuator.
    pub fn operate_mechanism(
        &mut self,
        now_ns: u64,
        operation: Operation,
        actuator: Option<usize>,
    ) {
        let Some(meant) = self.meant(actuator) else { return };
        if operation == Operation::Arm {
            self.armed_at = self.command.stamp_ns;
        }
        let is_missing = matches!(self.configuration.commissioning, Commissioning::Missing(_));
        let uncommissioned = is_missing.then_some(Reason::NotCommissioned);
        let Bridge { motors, mechanisms, reset_ns, .. } = self;
        for (number, mechanism) in mechanisms.iter_mut().enumerate() {
            if meant.is_some_and(|meant| meant != number) {
                continue;
            }
            match operation {
                // for the way back, those that are outside their limits
                Operation::Arm | Operation::Return => {
                    let returns = operation == Operation::Return;
                    let never_ready = |motor: &Motor| motor.never_ready(returns);
                    let unready =
                        uncommissioned.or_else(|| mechanism.motors(motors).find_map(never_ready));
                    let is_outside = mechanism.motors(motors).any(Motor::is_outside);
                    let begins = match returns {
                        true => is_outside && mechanism.come_back(now_ns, unready),
                        false => mechanism.arm(now_ns, unready),
                    };
                    if begins {
                        mechanism.each_motor(motors, |motor| motor.config.drive.prepare());
                    }
                }
                Operation::Confirm if !mechanism.is_live() => {
                    mechanism.each_motor(motors, Motor::confirm);
                }
                // a second time takes the power away at once
                Operation::Disarm => mechanism.disarm(),
                Operation::Reset => {
                    mechanism.reset();
                    if let Some(since) = reset_ns.get_mut(number) {
                        *since = Some(now_ns);
                    }
                }
                _ => {}
            }
        }
    }

    /// The mechanism of an actuator, if one is named; `None` for an actuator that is not there.
    fn meant(&self, actuator: Option<usize>) -> Option<Option<usize>> {
        match actuator {
            None => Some(None),
            Some(actuator) => self.configuration.mechanisms.get(actuator).copied().map(Some),
        }
    }
}
