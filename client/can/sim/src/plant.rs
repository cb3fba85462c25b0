//! The motor without its protocol: rotor, power, watchdog.

use sarrus_can_core::drive::Setpoint;

/// Longest step of the integration `[s]`.
const STEP: f64 = 0.5e-3;
/// Longest gap that is integrated; during a longer one the program was stopped, and with it the
/// world `[s]`.
const LONGEST: f64 = 0.1;

/// Mechanics at the motor's output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Physics {
    /// Inertia of rotor and load `[kg m²]`.
    pub inertia: f64,
    /// Viscous friction `[N m s/rad]`.
    pub friction: f64,
    /// Greatest torque `[N m]`.
    pub torque_limit: f64,
}

/// Shaft, power and watchdog of a motor: J p̈ = τ − b ṗ with τ = τ* + k (p* − p) + d (v* − ṗ) while
/// it has power.
#[derive(Clone, Debug, Default)]
pub struct Plant {
    /// Inertia, friction and limit of the torque.
    pub physics: Physics,
    /// Position of the shaft `[rad]`.
    pub position: f64,
    /// Velocity of the shaft `[rad/s]`.
    pub velocity: f64,
    /// Torque of the motor `[N m]`.
    pub torque: f64,
    /// Temperature `[°C]`.
    pub temperature: f64,
    /// Position where the motor reports 0 `[rad]`.
    pub zero: f64,
    /// It follows `law`.
    pub power: bool,
    /// The law that it follows, in its own coordinate, with the gains of its own loops.
    pub law: Setpoint,
    /// Its fault in its own code; 0 without one.
    pub fault: u32,
    /// Set-points that it has taken since it has power.
    pub n_setpoints: u64,
    /// Time without commands after which it turns its torque off `[ns]`; 0 never.
    pub watchdog_ns: u64,
    /// When its watchdog last turned the torque off `[ns]`, until it gets power again.
    pub tripped_ns: Option<u64>,
    /// The time of the present frame or step `[ns]`.
    pub(super) now_ns: u64,
    fed_ns: u64,
}

impl Plant {
    /// At rest, without power and watchdog.
    pub fn new(physics: Physics) -> Plant {
        Plant { physics, temperature: 25.0, ..Plant::default() }
    }

    /// Position as the motor reports it `[rad]`.
    pub fn measured(&self) -> f64 {
        self.position - self.zero
    }

    /// Gets power, holding nothing until a set-point comes; not with a fault.
    pub(super) fn start(&mut self) {
        if self.fault == 0 && !self.power {
            self.power = true;
            self.n_setpoints = 0;
            self.law = Setpoint::default();
            self.tripped_ns = None;
            self.feed();
        }
    }

    /// Has no power any more.
    pub(super) fn stop(&mut self) {
        self.power = false;
        self.torque = 0.0;
    }

    /// Takes a set-point, which feeds the watchdog. Without power it changes nothing.
    pub(super) fn follow(&mut self, law: Setpoint) {
        self.feed();
        if self.power {
            self.law = law;
            self.n_setpoints += 1;
        }
    }

    /// Feeds the watchdog.
    pub(super) fn feed(&mut self) {
        self.fed_ns = self.now_ns;
    }

    /// Whether the watchdog expires now; the reaction is the firmware's.
    pub(super) fn trips(&mut self) -> bool {
        let late = self.now_ns.saturating_sub(self.fed_ns) > self.watchdog_ns;
        let again = self.tripped_ns.is_none_or(|tripped_ns| self.fed_ns > tripped_ns);
        let trips = self.power && self.watchdog_ns > 0 && late && again;
        if trips {
            self.tripped_ns = Some(self.now_ns);
        }
        trips
    }

    /// Torque of the motor in its present state `[N m]`.
    pub fn drive_torque(&self) -> f64 {
        if !self.power {
            return 0.0;
        }
        let Setpoint { position, velocity, torque, stiffness, damping } = self.law;
        let torque = torque
            + stiffness * (position - self.measured())
            + damping * (velocity - self.velocity);
        torque.clamp(-self.physics.torque_limit, self.physics.torque_limit)
    }

    /// Sets position and velocity of the shaft, integrated elsewhere.
    pub fn carry(&mut self, position: f64, velocity: f64) {
        (self.position, self.velocity) = (position, velocity);
        self.torque = self.drive_torque();
    }

    /// Turns for a time `[s]`.
    pub(super) fn turn(&mut self, elapsed: f64) {
        let elapsed = elapsed.min(LONGEST);
        let n_steps = (elapsed / STEP).ceil();
        for _ in 0..n_steps as u32 {
            self.turn_once(elapsed / n_steps);
        }
    }

    /// One step of the implicit Euler method, which stiff gains do not upset: (J + h (d + b) + h²
    /// k) v⁺ = J v + h (τ* + k (p* − p) + d v*).
    fn turn_once(&mut self, h: f64) {
        let Physics { inertia, friction, torque_limit } = self.physics;
        let law = if self.power { self.law } else { Setpoint::default() };
        let free = |torque: f64| (inertia * self.velocity + h * torque) / (inertia + h * friction);
        let lead = law.torque
            + law.stiffness * (law.position - self.measured())
            + law.damping * law.velocity;
        let followed = (inertia * self.velocity + h * lead)
            / (inertia + h * (law.damping + friction) + h * h * law.stiffness);
        let torque = lead - (law.damping + h * law.stiffness) * followed;
        // beyond its limit the torque does not depend on the state any more
        let held = torque.clamp(-torque_limit, torque_limit);
        self.velocity = if held == torque { followed } else { free(held) };
        self.position += h * self.velocity;
        self.torque = held;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PHYSICS: Physics = Physics { inertia: 0.01, friction: 0.0, torque_limit: 10.0 };

    fn powered(law: Setpoint) -> Plant {
        let mut plant = Plant::new(PHYSICS);
        plant.start();
        plant.follow(law);
        plant
    }

    #[test]
    fn a_constant_torque_gives_the_parabola() {
        let mut plant = powered(Setpoint { torque: 0.2, ..Setpoint::default() });
        (0..1000).for_each(|_| plant.turn(1e-3));
        assert!((plant.velocity - 20.0).abs() < 1e-9, "{}", plant.velocity);
        assert!((plant.position - 10.0).abs() < 0.02, "{}", plant.position);
    }

    #[test]
    fn stiff_gains_settle_on_the_set_point() {
        let mut plant = powered(Setpoint {
            position: 1.0,
            stiffness: 500.0,
            damping: 5.0,
            ..Setpoint::default()
        });
        plant.physics.inertia = 1e-5;
        (0..1000).for_each(|_| plant.turn(1e-3));
        assert!((plant.position - 1.0).abs() < 1e-6, "{}", plant.position);
        assert!(plant.torque.abs() < 1e-3, "{}", plant.torque);
    }

    #[test]
    fn the_torque_never_exceeds_its_limit() {
        let mut plant =
            powered(Setpoint { position: 100.0, stiffness: 500.0, ..Setpoint::default() });
        plant.turn(1e-3);
        assert_eq!(plant.torque, 10.0);
        assert!((plant.velocity - 1.0).abs() < 1e-12, "{}", plant.velocity);
    }

    #[test]
    fn without_power_nothing_drives() {
        let mut plant = powered(Setpoint { torque: 1.0, ..Setpoint::default() });
        plant.stop();
        plant.turn(1e-3);
        assert_eq!((plant.velocity, plant.torque, plant.drive_torque()), (0.0, 0.0, 0.0));
    }

    #[test]
    fn the_watchdog_trips_once_until_it_is_fed_and_only_with_power() {
        let mut plant = powered(Setpoint::default());
        plant.watchdog_ns = 100;
        let trips = |plant: &mut Plant, now_ns: u64| {
            plant.now_ns = now_ns;
            plant.trips()
        };
        assert!(!trips(&mut plant, 100));
        assert!(trips(&mut plant, 101));
        assert!(!trips(&mut plant, 500));
        assert_eq!(plant.tripped_ns, Some(101));
        plant.now_ns = 600;
        plant.follow(Setpoint::default());
        assert!(trips(&mut plant, 701));
        plant.stop();
        plant.now_ns = 800;
        plant.feed();
        assert!(!trips(&mut plant, 2000));
    }
}
