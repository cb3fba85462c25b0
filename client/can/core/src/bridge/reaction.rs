//! The reaction to each reason, by whether the motors can still stop.

use sarrus_proto::actuators::Reason;

/// How a mechanism loses its power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reaction {
    /// A stop along a ramp: the robot itself is sound.
    Ramp,
    /// A stop with the strongest braking from the beginning.
    Brake,
    /// No torque from now on: the brake or its measurement cannot be trusted.
    TorqueOff,
}

impl Reaction {
    /// The reaction to a reason.
    pub(super) fn to(reason: Reason) -> Reaction {
        match reason {
            // a sound robot needs no more
            Reason::Disarmed | Reason::OtherMechanism => Reaction::Ramp,
            // it was damped for T2 - T1; the remaining speed may be that of a falling load
            Reason::CommandLost => Reaction::Brake,
            // position, speed or following error is beyond its limit, and the motors measure and
            // follow
            Reason::PositionLimit
            | Reason::VelocityLimit
            | Reason::FollowingError
            | Reason::MechanismLimit
            | Reason::NearSingular
            | Reason::ModelEffort
            | Reason::ExternalForce => Reaction::Brake,
            // the motor is hot or the bus loses frames, but both still work for the time of a stop
            Reason::OverTemperature | Reason::BusPassive => Reaction::Brake,
            // `feedback_…`, `second_answer`, `loop_residual`, `unreachable`: the measurement is
            // missing, old or wrong, and a brake would push anywhere. If no pose of the mechanism
            // has the positions, at least one of them is wrong.
            // `motor_fault`, `power_lost`, `effort_mismatch`, `second_master`, `bus_off`: the motor
            // does not follow, or follows others too; braking with the other motors of its
            // mechanism would load the loop on one side. A second master can bring no torque back
            // but by giving power.
            // `watchdog_…`: nothing would end the torque if this side failed while it stops.
            // The others are of bridges that stood still, and of mechanisms that do not follow yet
            _ => Reaction::TorqueOff,
        }
    }
}
