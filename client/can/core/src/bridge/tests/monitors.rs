//! Each rule of the monitors: when it fires, and when it does not.

use super::bench::{AT_REST, Bench, OFF};
use super::*;
use crate::bridge::monitors::{Monitors, Punctual, Seen, effort_of, lag};
use crate::config::MonitorBounds;
use crate::mapping::{ActuatorMeasurement, ActuatorSetpoint};

/// One motor at 250 Hz, ± 1 rad, 5 rad/s, 2 N m, with gains of its own.
struct Line {
    bench: Bench,
    limits: Limits,
    mode: Mode,
    asked: [ActuatorSetpoint; 2],
    stiffness: f64,
    braking: [f64; 2],
    dwell: f64,
    before: ActuatorMeasurement,
    elapsed: f64,
    late: [f64; 2],
    has_seen: bool,
}

const PERIOD: f64 = 4e-3;
const STILL: ActuatorMeasurement =
    ActuatorMeasurement { position: 0.0, velocity: 0.0, effort: 0.0, temperature: 30.0 };
const NOTHING: ActuatorSetpoint =
    ActuatorSetpoint { position: 0.0, velocity: 0.0, effort: 0.0, stiffness: 0.0, damping: 0.0 };

impl Line {
    fn new() -> Line {
        Line::beside(0, Mode::Impedance)
    }

    /// Where one of the motors has another mode: the second one is of the same mechanism.
    fn beside(place: usize, mode: Mode) -> Line {
        let limits = Limits {
            lower: -1.0,
            upper: 1.0,
            velocity: 5.0,
            effort: 2.0,
            effort_rate: f64::INFINITY,
        };
        let bench = Bench::new(|configuration| {
            for motor in &mut configuration.motors {
                (motor.limits, motor.monitors) = (limits, MonitorBounds::USUAL);
            }
            configuration.motors[place].common.mode = mode;
        });
        Line {
            bench,
            limits,
            mode: if place == 0 { mode } else { Mode::Impedance },
            asked: [NOTHING; 2],
            stiffness: 0.0,
            braking: [50.0, 0.05],
            dwell: f64::INFINITY,
            before: STILL,
            elapsed: PERIOD,
            late: [0.0; 2],
            has_seen: false,
        }
    }

    fn ask(&mut self, asked: ActuatorSetpoint) {
        (self.asked, self.stiffness) = ([asked; 2], asked.stiffness);
    }

    fn see(&mut self, measured: ActuatorMeasurement) -> Option<Reason> {
        let motor = &mut self.bench.bridge.motors[0];
        let Monitors { bounds, steps, rules, .. } = &mut motor.monitors;
        let found = rules.check(&Seen {
            bounds,
            steps,
            period: PERIOD,
            clocks: super::super::monitors::clocks(PERIOD, 0.0),
            lag: lag(PERIOD, super::super::monitors::clocks(PERIOD, 0.0)),
            measured: &measured,
            before: &self.before,
            elapsed: self.elapsed,
            late: self.late,
            asked: &self.asked,
            efforts: self.asked.map(|asked| effort_of(&asked, &measured)),
            stiffness: self.stiffness,
            limits: &self.limits,
            braking: &self.braking,
            free: &[1.0, -1.0],
            dwell: self.dwell,
            mode: self.mode,
            ripple: motor.ripple,
            is_following: true,
        });
        self.before = measured;
        found
    }

    /// Feeds measurements, a function of their number, until a reason is found: after how many,
    /// which one.
    fn run(
        &mut self,
        n: usize,
        measured: impl Fn(f64) -> ActuatorMeasurement,
    ) -> Option<(usize, Reason)> {
        if !self.has_seen {
            (self.before, self.has_seen) = (measured(0.0), true);
        }
        (0..n).find_map(|i| Some((i, self.see(measured(i as f64))?)))
    }
}

fn reason(found: Option<(usize, Reason)>) -> Option<Reason> {
    found.map(|(_, reason)| reason)
}

#[test]
fn a_position_beyond_its_limit_is_a_fault_where_it_moves_outwards() {
    let moving = |velocity: f64| {
        move |i: f64| ActuatorMeasurement {
            position: 0.98 + velocity * PERIOD * i,
            velocity,
            ..STILL
        }
    };
    assert_eq!(reason(Line::new().run(50, moving(0.5))), Some(Reason::PositionLimit));
    assert_eq!(Line::new().run(50, moving(-0.5)), None);
    // slower than a velocity is reported, and without one
    let slow = |i: f64| ActuatorMeasurement { position: 0.98 + 1e-4 * i, ..STILL };
    assert_eq!(reason(Line::new().run(2000, slow)), Some(Reason::PositionLimit));
    let silent = |i: f64| ActuatorMeasurement { velocity: f64::NAN, ..moving(0.5)(i) };
    assert_eq!(reason(Line::new().run(50, silent)), Some(Reason::PositionLimit));
    // beyond it stands, or comes back
    let mut line = Line::new();
    line.before = ActuatorMeasurement { position: 1.5, ..STILL };
    assert_eq!(line.run(500, |_| ActuatorMeasurement { position: 1.5, ..STILL }), None);
    let back =
        |i: f64| ActuatorMeasurement { position: 1.5 - 0.1 * PERIOD * i, velocity: -0.1, ..STILL };
    assert_eq!(line.run(500, back), None);
}

#[test]
fn a_speed_beyond_its_limit_is_found_by_what_is_told_and_by_the_positions() {
    let at = |velocity: f64, reported: f64| {
        move |i: f64| ActuatorMeasurement {
            position: velocity * PERIOD * i,
            velocity: reported,
            ..STILL
        }
    };
    let free = || {
        let mut line = Line::new();
        (line.limits.lower, line.limits.upper) = (-1e9, 1e9);
        line
    };
    assert_eq!(free().run(9, at(5.5, 5.5)), Some((2, Reason::VelocityLimit)));
    assert_eq!(free().run(2000, at(5.2, 5.2)), None);
    assert_eq!(reason(free().run(9, at(8.0, f64::NAN))), Some(Reason::VelocityLimit));
    assert_eq!(reason(free().run(200, at(-5.5, f64::NAN))), Some(Reason::VelocityLimit));
    assert_eq!(free().run(2000, at(5.2, f64::NAN)), None);
}

#[test]
fn a_jump_is_what_neither_speed_explains() {
    let jump = |by: f64, velocity: f64| {
        move |i: f64| ActuatorMeasurement {
            position: -0.5 + if i < 5.0 { 0.0 } else { by },
            velocity,
            ..STILL
        }
    };
    for by in [0.2, -0.2, 1.2, 12.0] {
        assert_eq!(Line::new().run(9, jump(by, 0.0)), Some((5, Reason::FeedbackJump)), "{by}");
        assert_eq!(Line::new().run(9, jump(by, f64::NAN)), Some((5, Reason::FeedbackJump)), "{by}");
    }
    // twice as far as usual at 4 rad/s, after a frame that was late
    let late = |i: f64| ActuatorMeasurement {
        position: -0.5 + 0.016 * (i + if i < 5.0 { 0.0 } else { 1.0 }),
        velocity: 4.0,
        ..STILL
    };
    assert_eq!(Line::new().run(9, late), None);
}

#[test]
fn an_effort_is_compared_with_what_was_asked_of_late() {
    let reported = |effort: f64| {
        move |i: f64| ActuatorMeasurement { position: 1e-3 * i, velocity: 0.25, effort, ..STILL }
    };
    let pushes = ActuatorSetpoint { effort: 1.5, ..NOTHING };
    let found = |effort: f64, asked: ActuatorSetpoint, mode: Mode| {
        let mut line = Line::new();
        line.mode = mode;
        line.ask(asked);
        reason(line.run(100, reported(effort)))
    };
    for mode in [Mode::Impedance, Mode::Torque] {
        assert_eq!(found(1.5, pushes, mode), None);
        assert_eq!(found(1.1, pushes, mode), None);
        assert_eq!(found(0.0, pushes, mode), Some(Reason::EffortMismatch), "limp");
        assert_eq!(found(10.0, pushes, mode), Some(Reason::EffortMismatch), "a second master");
        assert_eq!(found(-1.5, pushes, mode), Some(Reason::EffortMismatch), "the wrong way");
        assert_eq!(found(f64::NAN, pushes, mode), None, "not reported");
        // far less than the tolerance, and limp
        let little = ActuatorSetpoint { effort: 0.2, ..NOTHING };
        assert_eq!(found(0.0, little, mode), Some(Reason::EffortMismatch));
        assert_eq!(found(0.15, little, mode), None);
    }
    for mode in [Mode::Position, Mode::Velocity] {
        assert_eq!(found(-1.9, pushes, mode), None, "its own controller");
        assert_eq!(found(2.9, pushes, mode), Some(Reason::EffortMismatch));
    }
    // a step is seen later
    let mut line = Line::new();
    assert_eq!(line.run(20, reported(0.0)), None);
    line.ask(pushes);
    assert_eq!(line.run(2, |i| reported(0.0)(20.0 + i)), None);
    assert_eq!(line.run(20, |i| reported(1.5)(22.0 + i)), None);
    // and so are quick changes, where the measurement is as old as that
    for (late, found) in [(6e-3, None), (0.0, Some(Reason::EffortMismatch))] {
        let mut line = Line::new();
        line.late = [late; 2];
        let effort = |i: f64| 1.5 * (0.4 * i).cos();
        let seen = (0..60).find_map(|i| {
            let i = f64::from(i);
            line.asked = [i, i - 1.0].map(|i| ActuatorSetpoint { effort: effort(i), ..NOTHING });
            line.see(reported(effort(i - 3.0))(i))
        });
        assert_eq!(seen, found, "{late}");
    }
}

#[test]
fn an_actuator_that_stays_far_behind_does_not_follow() {
    let line = |stiffness: f64, position: f64, mode: Mode| {
        let mut line = Line::new();
        line.mode = mode;
        line.ask(ActuatorSetpoint { position, stiffness, ..NOTHING });
        let effort = (stiffness * position).min(2.0);
        let there = |i: f64| ActuatorMeasurement { position: 1e-3 * (i % 2.0), effort, ..STILL };
        line.asked.iter_mut().for_each(|asked| asked.stiffness = effort / position);
        reason(line.run(250, there))
    };
    assert_eq!(line(3.0, 0.9, Mode::Impedance), Some(Reason::FollowingError));
    assert_eq!(line(3.0, 0.3, Mode::Impedance), None, "a spring with less than the limit");
    assert_eq!(line(100.0, 0.05, Mode::Impedance), None, "saturated, and near");
    assert_eq!(line(0.1, 0.9, Mode::Impedance), None, "too soft to follow anybody");
    let mut position = Line::new();
    position.mode = Mode::Position;
    position.ask(ActuatorSetpoint { position: 0.5, ..NOTHING });
    assert_eq!(reason(position.run(250, |_| STILL)), Some(Reason::FollowingError));
    assert_eq!(Line::new().run(250, |_| STILL), None);
}

#[test]
fn a_code_that_stands_still_is_frozen_where_something_else_moves() {
    let with = |effort: f64, velocity: f64| ActuatorMeasurement { effort, velocity, ..STILL };
    // a velocity that goes on
    assert_eq!(Line::new().run(99, |_| with(0.0, 0.5)), Some((2, Reason::FeedbackFrozen)));
    // one that is half a code off
    assert_eq!(Line::new().run(5000, |_| with(0.0, 0.05)), None);
    // an effort that changes under it
    let mut line = Line::new();
    assert_eq!(line.run(99, |_| with(0.0, 0.0)), None);
    line.ask(ActuatorSetpoint { effort: 1.5, ..NOTHING });
    assert_eq!(line.run(99, |_| with(1.5, 0.0)), Some((3, Reason::FeedbackFrozen)));
    // and one that stays as it was for an hour, held by a load
    let mut line = Line::new();
    line.ask(ActuatorSetpoint { effort: 1.5, ..NOTHING });
    let settles = |i: f64| ActuatorMeasurement { position: 1e-3 * i.min(9.0), ..with(1.5, 0.0) };
    assert_eq!(line.run(900_000, settles), None);
    // a standstill from one measurement to the next while the set-point goes on
    let stops = |i: f64| ActuatorMeasurement { position: 0.005 * i.min(5.0), ..STILL };
    let [last, before] = [0.02, 0.015].map(|position| ActuatorSetpoint { position, ..NOTHING });
    let mut line = Line::new();
    (line.asked, line.stiffness) = ([last, before], 1.0);
    assert_eq!(reason(line.run(99, stops)), Some(Reason::FeedbackFrozen));
}

#[test]
fn a_stroke_of_a_motor_with_its_own_loop_is_no_motion_of_its_mechanism() {
    for (place, mode, part, found) in [
        (0, Mode::Position, 0.9, None),
        (0, Mode::Velocity, -0.9, None),
        (1, Mode::Position, 0.9, None),
        (0, Mode::Impedance, 0.9, Some(Reason::FeedbackFrozen)),
        (0, Mode::Position, 1.1, Some(Reason::FeedbackFrozen)),
        (1, Mode::Position, 1.1, Some(Reason::FeedbackFrozen)),
        (2, Mode::Position, 0.9, Some(Reason::FeedbackFrozen)),
    ] {
        let mut line = Line::beside(place, mode);
        let speed = rest::STILL * line.limits.velocity * part;
        line.bench.bridge.motors[0].monitors.steps.velocity = 1e-3;
        let moving = |_| ActuatorMeasurement { velocity: speed, ..STILL };
        assert_eq!(reason(line.run(999, moving)), found, "{place} {mode:?} {part}");
    }
}

#[test]
fn a_quick_move_that_ends_at_rest_is_not_frozen() {
    // at a constant speed, then at rest, with an effort that brakes until then
    for braking in [-2.0, -1.0, 1.0, 2.0] {
        let mut line = Line::new();
        let there = |i: f64| ActuatorMeasurement {
            position: 0.005 * i.min(5.0),
            effort: if i < 6.0 { braking } else { 0.0 },
            ..STILL
        };
        line.ask(ActuatorSetpoint { effort: braking, position: 0.025, ..NOTHING });
        assert_eq!(line.run(6, there), None, "{braking}");
        line.ask(ActuatorSetpoint { position: 0.025, ..NOTHING });
        assert_eq!(line.run(99, |i| there(6.0 + i)), None, "{braking}");
    }
    // a heavy joint does not move at once
    let mut line = Line::new();
    let at = |position: f64| ActuatorMeasurement { position, ..STILL };
    assert_eq!(line.run(99, |_| at(0.0)), None);
    line.ask(ActuatorSetpoint { effort: 0.6, ..NOTHING });
    let code = 3.8e-4;
    let at = |position: f64| ActuatorMeasurement { effort: 0.6, ..at(position) };
    let moves = |i: f64| at(code * (0.5 * 2.0 * (PERIOD * i).powi(2) / code).floor());
    assert_eq!(line.run(25, moves), None);
}

#[test]
fn frames_that_are_late_once_are_neither_a_jump_nor_a_speed() {
    // at 60 % of the limit, with answers that wait for up to three cycles, in order
    let mut punctual = Punctual::default();
    let mut line = Line::new();
    (line.limits.lower, line.limits.upper) = (-1e9, 1e9);
    let mut came = 0.0;
    let mut late_before = 0.0;
    for i in 1..2000 {
        let taken = PERIOD * f64::from(i);
        let late = if i > 100 && i % 100 < 3 { 3.0 - f64::from(i % 100) } else { 0.0 };
        let arrives = taken + PERIOD * late;
        punctual.take(arrives - came);
        (line.elapsed, line.late) = (arrives - came, [late_before, punctual.late]);
        (came, late_before) = (arrives, punctual.late);
        let measured = ActuatorMeasurement { position: 3.0 * taken, velocity: 3.0, ..STILL };
        assert_eq!(line.see(measured), None, "{i}");
    }
    // one that waited while this program did not run, and the next
    for (taken, arrives) in [(8.0, 8.3), (8.301, 8.302)] {
        punctual.take(arrives - came);
        (line.elapsed, line.late) = (arrives - came, [late_before, punctual.late]);
        (came, late_before) = (arrives, punctual.late);
        let measured = ActuatorMeasurement { position: 3.0 * taken, velocity: 3.0, ..STILL };
        assert_eq!(line.see(measured), None, "{taken}");
    }
    // and a real excess is found soon after
    let mut position = line.before.position;
    let found = (0..10).find(|_| {
        position += 8.0 * PERIOD;
        (line.elapsed, line.late) = (PERIOD, [0.0; 2]);
        line.see(ActuatorMeasurement { position, velocity: f64::NAN, ..STILL }).is_some()
    });
    assert!(found.is_some(), "{found:?}");
}

#[test]
fn a_joint_that_cannot_stop_before_its_limit_is_stopped_in_time() {
    let at = |position: f64, velocity: f64| {
        move |i: f64| ActuatorMeasurement {
            position: position + velocity * PERIOD * i,
            velocity,
            ..STILL
        }
    };
    let first = |position: f64, velocity: f64| Line::new().run(9, at(position, velocity));
    // 4.5 rad/s need 0.203 rad at 50 rad/s² and 0.225 rad for the delay; nine cycles are 0.162 rad
    assert_eq!(first(0.35, 4.5), None);
    assert_eq!(reason(first(0.7, 4.5)), Some(Reason::PositionLimit));
    assert_eq!(reason(first(-0.7, -4.5)), Some(Reason::PositionLimit));
    assert_eq!(first(-0.9, 4.5), None, "away from the near limit");
    // a speed that is hidden
    let hidden = |i: f64| ActuatorMeasurement { velocity: 0.0, ..at(0.7, 4.5)(i) };
    let mut line = Line::new();
    assert!(line.run(9, hidden).is_some());
    // 2 rad/s, which five measurements in two cycles do not double where one waited for three
    let mut line = Line::new();
    line.before = at(0.66, 2.0)(0.0);
    (line.elapsed, line.late) = (4.0 * PERIOD, [0.0, 3.0 * PERIOD]);
    assert_eq!(line.see(at(0.66, 2.0)(1.0)), None);
    (line.elapsed, line.late) = (PERIOD, [3.0 * PERIOD, 0.0]);
    assert_eq!(line.see(at(0.66, 2.0)(5.0)), None);
    // slowly to the limit itself
    assert_eq!(first(0.99, 0.1), None);
}

#[test]
fn a_held_code_is_frozen_where_noise_or_a_dither_would_change_it() {
    let held = |dwell: f64, n: usize| {
        let mut line = Line { dwell, ..Line::new() };
        line.ask(ActuatorSetpoint { effort: 1.5, ..NOTHING });
        let at = |i: f64| ActuatorMeasurement { position: 1e-3 * i.min(9.0), effort: 1.5, ..STILL };
        line.run(n, at)
    };
    assert_eq!(reason(held(0.1, 99)), Some(Reason::FeedbackFrozen));
    assert_eq!(held(f64::INFINITY, 9999), None);
}

#[test]
fn a_hot_motor_is_slow_and_keeps_its_effort() {
    let hot = |temperature: f64| move |_: f64| ActuatorMeasurement { temperature, ..STILL };
    assert_eq!(Line::new().run(9, hot(150.0)), Some((2, Reason::OverTemperature)));
    assert_eq!(Line::new().run(900, hot(f64::NAN)), None);
    for (temperature, part) in [(89.0, 1.0), (100.0, 0.5), (105.0, 0.25), (f64::NAN, 1.0)] {
        let mut line = Line::new();
        assert_eq!(line.run(5, hot(temperature)), None);
        assert!((line.bench.bridge.motors[0].monitors.derated() - part).abs() < 1e-12);
    }
    let mut bench = Bench::armed();
    bench.steps(200);
    // it reports 30 °C
    bench.bridge.motors[0].monitors.bounds =
        MonitorBounds { derate: 10.0, temperature: 50.0, ..OFF };
    bench.target = Setpoint { torque: -20.0, velocity: 90.0, ..Setpoint::default() };
    bench.step();
    assert_eq!((bench.setpoint(0).torque, bench.setpoint(0).velocity), (-10.0, 50.0));
    assert_ne!(bench.bridge.state().flags[0] & flag::DERATED, 0);
    // one measurement alone
    let mut line = Line::new();
    let once = |i: f64| hot(if i == 3.0 { 215.0 } else { 40.0 })(i);
    assert_eq!(line.run(9, once), None);
}

#[test]
fn answers_are_counted_against_requests() {
    let mut line = Line::new();
    let monitors = &mut line.bench.bridge.motors[0].monitors;
    let mut run = |n: usize, answers: fn(usize) -> usize| {
        for i in 0..n {
            monitors.answers.ask(1, false);
            (0..answers(i)).for_each(|_| monitors.answers.take());
        }
        monitors.check_bus(0, BusState::Active)
    };
    assert_eq!(run(1000, |_| 1), None);
    // one late, together with the next
    assert_eq!(run(1000, |i| if i % 10 == 4 { 0 } else { 1 + usize::from(i % 10 == 5) }), None);
    assert_eq!(run(4, |_| 2), Some(Reason::SecondAnswer));
    // forgotten once it is gone
    assert_eq!(run(100, |_| 1), None);
}

#[test]
fn a_second_master_is_heard_and_an_echo_is_none() {
    let mut bench = Bench::new(|configuration| {
        configuration.motors.iter_mut().for_each(|motor| {
            motor.monitors = MonitorBounds { second_master: true, ..OFF };
        });
    });
    bench.arm();
    let echo = bench.bridge.frames(0)[0];
    bench.bridge.receive(bench.now_ns, 0, &echo);
    bench.steps(3);
    assert_eq!(bench.states(), [MechanismState::Enabled; 3]);
    let other = Frame::classic(Id::Standard(0), &[7]).unwrap();
    bench.bridge.receive(bench.now_ns, 0, &other);
    bench.step();
    assert_eq!((bench.states()[0], bench.reason(0)), (MechanismState::Fault, Reason::SecondMaster));
    assert_eq!(bench.states()[2], MechanismState::Enabled);
    assert_eq!(bench.bridge.bus_counters(0).unwrap().1.foreign, 2);
    // nothing is armed while it is there
    bench.bridge.operate(bench.now_ns, Operation::Reset);
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(3);
    assert_eq!(bench.reason(0), Reason::SecondMaster);
}

#[test]
fn an_error_passive_bus_stops_what_is_on_it() {
    let mut bench = Bench::new(|configuration| {
        configuration.motors.iter_mut().for_each(|motor| {
            motor.monitors = MonitorBounds { bus_passive: true, ..OFF };
        });
    });
    bench.arm();
    bench.bridge.bus_event(bench.now_ns, 0, BusEvent::ErrorPassive);
    bench.step();
    assert_ne!(bench.states()[0], MechanismState::Enabled);
    assert_eq!((bench.reason(0), bench.states()[2]), (Reason::BusPassive, MechanismState::Enabled));
}

#[test]
fn beyond_a_limit_nothing_pushes_outwards() {
    let mut bench = Bench::armed();
    bench.steps(150);
    bench.position = 120;
    bench.step();
    bench.send(|command| {
        command.effort[0] = 5.0;
        command.stiffness[0] = 0.0;
        (command.effort[1], command.stiffness[1]) = (-5.0, 0.0);
    });
    bench.step();
    let setpoint = bench.setpoint(0);
    assert_eq!((setpoint.torque, setpoint.stiffness, setpoint.velocity), (0.0, 0.0, 0.0));
    assert_eq!(bench.setpoint(1).torque, -5.0, "inwards");
    let flags = bench.bridge.state().flags;
    assert_ne!(flags[0] & flag::OUTWARD_LIMITED, 0);
    assert_eq!(flags[1] & flag::OUTWARD_LIMITED, 0);
}

#[test]
fn outside_the_limits_nothing_is_armed_but_for_the_way_back() {
    let mut bench = Bench::new(|_| {});
    bench.position = 150;
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.step();
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Disabled, Reason::OutsideLimits)
    );
    // without a controller
    bench.commands = false;
    bench.bridge.operate(bench.now_ns, Operation::Return);
    bench.steps(10);
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Arming, Reason::OutsideLimits)
    );
    let first = bench.setpoint(0);
    bench.steps(3);
    let second = bench.setpoint(0);
    // inwards, slowly, with half of the effort
    let effort = second.stiffness * (second.position - 1.5) - second.damping * 0.0;
    assert!(second.position < first.position && effort.abs() <= 5.0 + 1e-9, "{second:?}");
    assert!(second.velocity < 0.0 && second.velocity >= -5.0);
    bench.position = 97;
    bench.steps(520);
    assert_eq!((bench.states()[0], bench.reason(0)), (MechanismState::Disabled, Reason::Disarmed));
}
