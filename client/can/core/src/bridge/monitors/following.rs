//! An actuator that lags behind its set-point.
//!
//! With stiffness k and effort limit f the spring alone saturates from f / k on: an actuator that
//! lags farther (at least 5 %, at most 25 % of the range between its limits) for `following_ms`
//! does not follow. A spring below 20 % of f is too soft to judge. A motor with its own position
//! loop may lag by 5 % of its range, one with a velocity loop by a quarter of the limit.

use sarrus_proto::actuators::Reason;

use super::Seen;
use crate::drive::Mode;
use crate::state::state;

const LEAST: f64 = 0.05;
const MOST: f64 = 0.25;
const SOFT: f64 = 0.2;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Following {
    /// Duration of the lag `[s]`.
    behind: f64,
}

impl Following {
    pub(super) fn check(&mut self, seen: &Seen<'_>) -> Option<Reason> {
        let [asked, _] = seen.asked;
        let limits = seen.limits;
        let range = limits.upper - limits.lower;
        let least = if range < f64::INFINITY { LEAST * range } else { 0.0 };
        let error = (asked.position - seen.measured.position).abs();
        let is_behind = seen.is_following
            && match seen.mode {
                Mode::Impedance | Mode::Torque => {
                    let pull = seen.stiffness * error;
                    pull > SOFT * limits.effort
                        && error > least
                        && (pull > limits.effort || error > MOST * range)
                }
                Mode::Position => error > LEAST * range,
                Mode::Velocity => {
                    (asked.velocity - seen.measured.velocity).abs() > MOST * limits.velocity
                }
            };
        self.behind = if is_behind { self.behind + seen.elapsed } else { 0.0 };
        (self.behind > seen.bounds.following).then_some(Reason::FollowingError)
    }
}

state!(Following { behind });
