//! Paths in time: as fast as actuators allow, and never beyond their limits.

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::{DescriptionBuilder, Field, FieldSet, LinkId, Model, Query, Request};
use sarrus_models::{Options, Source, load};
use sarrus_simulation::{Stop, Timed, time_path};
use sarrus_tests::cases::Case;
use sarrus_tests::run::Robot;

use Field::*;

fn timed(model: &Model<f64>, rows: &[Vec<f64>]) -> Timed {
    time_path(model, rows, &mut |_| ()).unwrap().unwrap_or_else(|stop| panic!("{stop:?}"))
}

/// A mass of 2 kg on a rail, pushed with 8 N at most.
fn cart(velocity: f64) -> Model<f64> {
    let mut robot = DescriptionBuilder::new("cart");
    let rail = robot.prismatic("rail", LinkId::BASE, [1.0, 0.0, 0.0]);
    let rail = rail.limits(-2.0, 2.0).effort_limit(8.0).velocity_limit(velocity);
    rail.inertial(Inertial::sphere(2.0, [0.0; 3], 0.1));
    robot.compile().unwrap().model
}

#[test]
fn a_mass_takes_the_time_of_full_force_and_full_speed() {
    let rows = [vec![0.0], vec![0.3], vec![1.0]];
    // half the way with 4 m/s², half with −4 m/s²
    let fast = timed(&cart(50.0), &rows);
    let expected = 2.0 * (1.0_f64 / 4.0).sqrt();
    assert!((fast.times.last().unwrap() - expected).abs() < 5e-3, "{:?}", fast.times.last());
    let slow = timed(&cart(1.0), &rows);
    let expected = 1.0 / 4.0 + 1.0;
    assert!((slow.times.last().unwrap() - expected).abs() < 5e-3, "{:?}", slow.times.last());
    for run in [&fast, &slow] {
        let [y, yd, ..] = run.rows.last().unwrap();
        assert!((y[0] - 1.0).abs() < 1e-12 && yd[0].abs() < 1e-6, "{y:?} {yd:?}");
        assert!(run.excess <= sarrus_simulation::ALLOWED);
    }
}

/// A loop through the range of the joints, of so many rows.
fn loop_of(model: &Model<f64>, rows: usize, part: f64) -> Vec<Vec<f64>> {
    let info = model.info();
    let row = |k: usize| {
        let turn = std::f64::consts::TAU * k as f64 / (rows - 1) as f64;
        let of = |(j, name): (usize, &String)| {
            let limits = info.tree.iter().position(|of| of == name).and_then(|v| info.limits[v]);
            let bound = |x: Option<f64>, none: f64| x.unwrap_or(none).clamp(-1.5, 1.5);
            let lower = bound(limits.and_then(|of| of.lower), -0.5);
            let upper = bound(limits.and_then(|of| of.upper), 0.5);
            let phase = turn + 0.7 * j as f64;
            0.5 * (lower + upper) + 0.5 * part * (upper - lower) * phase.sin()
        };
        info.independent.iter().enumerate().map(of).collect()
    };
    (0..rows).map(row).collect()
}

#[test]
fn motions_along_paths_keep_all_limits_between_their_rows_and_meet_some() {
    for (name, rows) in [("lambda", 20), ("torso", 60), ("wrist", 40), ("rh5v2_upper_body", 120)] {
        let case = Case::bundled(name);
        let model = &case.compiled.model;
        // the largest loop that stays inside all positions and that the actuators hold
        let drivable = [0.3, 0.15, 0.07, 0.03].into_iter().find_map(|part| {
            let path = loop_of(model, rows, part);
            time_path(model, &path, &mut |_| ()).unwrap().ok()
        });
        let run = drivable.unwrap_or_else(|| panic!("{name} cannot be driven"));
        let allowed = sarrus_simulation::ALLOWED;
        assert!(run.excess <= allowed, "{name}: {}", run.excess);
        let info = model.info();
        let mut robot = Robot::new(model.clone());
        let base =
            Query::new(Request::InverseDynamics, FieldSet::EMPTY, FieldSet::of(&[Q, Qd, Ud, TauU]));
        let mut driven = 0;
        for k in 1..run.times.len() {
            let h = run.times[k] - run.times[k - 1];
            assert!(h > 0.0 && h.is_finite(), "{name}: {h}");
            let [[y, yd, ..], [y1, yd1, ..]] = [&run.rows[k - 1], &run.rows[k]];
            for j in 0..y.len() {
                // the rows belong to one motion
                let mean = 0.5 * (yd[j] + yd1[j]);
                let size = yd[j].abs().max(yd1[j].abs()) + 0.1;
                assert!((y1[j] - y[j] - h * mean).abs() < 0.05 * h * size + 1e-5, "{name}");
            }
            let mut most: f64 = 0.0;
            // the cubic through y and ẏ of both rows
            let mut look = |at: f64| {
                let mut along = [const { Vec::new() }; 3];
                for j in 0..y.len() {
                    let rest = (y1[j] - y[j]) / h;
                    let [turn, bend] =
                        [3.0 * rest - 2.0 * yd[j] - yd1[j], yd[j] + yd1[j] - 2.0 * rest];
                    along[0].push(y[j] + at * h * (yd[j] + at * (turn + at * bend)));
                    along[1].push(yd[j] + at * (2.0 * turn + 3.0 * at * bend));
                    along[2].push((2.0 * turn + 6.0 * at * bend) / h);
                }
                let [along, speed, ydd] = &along;
                let x = robot.ask_for(base, &[(Y, along), (Yd, speed), (Ydd, ydd)]).ok();
                for (u, tau) in x.get(TauU).iter().enumerate() {
                    if let Some([lower, upper]) = model.actuator_forces(u, x.get(Ud)[u]) {
                        let size = lower.abs().max(upper.abs());
                        let over = (tau - upper).max(lower - tau) / size;
                        assert!(over <= allowed, "{name}: {} {tau}", info.active[u]);
                        most = most.max(1.0 + over);
                    }
                }
                for (v, rate) in x.get(Qd).iter().enumerate() {
                    if let Some(limit) = info.limits[v].and_then(|of| of.velocity) {
                        assert!(rate.abs() <= limit * (1.0 + allowed), "{name}: {}", info.tree[v]);
                        most = most.max(rate.abs() / limit);
                    }
                }
            };
            [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().for_each(&mut look);
            driven += usize::from(most > 0.95);
        }
        assert!(driven > run.times.len() / 2, "{name}: {driven} of {}", run.times.len());
    }
}

#[test]
fn a_path_that_cannot_be_held_or_leaves_its_range_names_place_and_joint() {
    let mut robot = DescriptionBuilder::new("arm");
    let arm = robot.revolute("arm", LinkId::BASE, [0.0, 1.0, 0.0]).limits(-2.0, 2.0);
    // 9.81 N m where it is level, and 5 N m at most
    arm.effort_limit(5.0).velocity_limit(9.0).inertial(Inertial::point(1.0, [0.0, 0.0, -1.0]));
    let model = robot.compile().unwrap().model;
    let stop = |rows: &[Vec<f64>]| time_path(&model, rows, &mut |_| ()).unwrap().unwrap_err();
    let rows: Vec<Vec<f64>> = (0..=10).map(|k| vec![0.1 * f64::from(k)]).collect();
    match stop(&rows) {
        Stop::Limit { row, what: "effort", name, value, limits } => {
            assert_eq!((name.as_str(), limits), ("arm", [-5.0, 5.0]));
            // asin(5 / 9.81) = 0.535
            assert!((5.3..5.5).contains(&row) && value.abs() > 5.0, "{row} {value}");
        }
        other => panic!("{other:?}"),
    }
    match stop(&[vec![0.0], vec![-0.2], vec![-2.5]]) {
        Stop::Limit { what: "position" | "effort", name, .. } => assert_eq!(name, "arm"),
        other => panic!("{other:?}"),
    }
    let run = timed(&model, &rows[..5]);
    assert!(*run.times.last().unwrap() > 0.1);
}

/// A mass on an arm that turns about a vertical axis, with this motor.
fn turntable(actuator: &str) -> Model<f64> {
    let urdf = r#"<robot name="table"><link name="base"/><link name="arm"><inertial>
        <origin xyz="0.4 0 0"/><mass value="3"/>
        <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
        <joint name="pivot" type="continuous"><parent link="base"/><child link="arm"/>
        <axis xyz="0 0 1"/></joint></robot>"#;
    let yml = format!(
        "submechanisms:\n- {{type: 1R, contextual_name: arm, jointnames_spanningtree: [pivot], \
         jointnames_independent: [pivot], jointnames_active: [pivot]}}\nactuators:\n\
         - joint: pivot\n{actuator}"
    );
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(yml.into_bytes()) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}")).compiled.model
}

#[test]
fn a_motor_whose_force_falls_with_its_speed_keeps_to_the_limit_of_that_speed() {
    let inertia = 3.0 * 0.4 * 0.4 + 0.02;
    for actuator in [
        "  model: XM430\n",
        "  torque_speed: [[1, 4], [3, 1], [8, 0]]\n  braking_torque_speed: [[1, 6], [8, 5]]\n",
        "  peak_torque: 5\n  power: 3\n  efficiency: [0.7, 0.6]\n  max_speed: 9\n",
    ] {
        let model = turntable(actuator);
        let rows: Vec<Vec<f64>> = (0..=40).map(|k| vec![0.5 * f64::from(k)]).collect();
        let run = timed(&model, &rows);
        let allowed = sarrus_simulation::ALLOWED;
        assert!(run.excess <= allowed, "{}", run.excess);
        let mut near = 0;
        let mut most: f64 = 0.0;
        for k in 1..run.times.len() {
            let h = run.times[k] - run.times[k - 1];
            let [[y, yd, ..], [y1, yd1, ..]] = [&run.rows[k - 1], &run.rows[k]];
            let rest = (y1[0] - y[0]) / h;
            let [turn, bend] = [3.0 * rest - 2.0 * yd[0] - yd1[0], yd[0] + yd1[0] - 2.0 * rest];
            let mut reached: f64 = 0.0;
            for part in 0..=20 {
                let at = f64::from(part) / 20.0;
                let speed = yd[0] + at * (2.0 * turn + 3.0 * at * bend);
                // nothing but inertia acts
                let tau = inertia * (2.0 * turn + 6.0 * at * bend) / h;
                let [lower, upper] = model.actuator_forces(0, speed).unwrap();
                let least = 1e-6 * model.actuator_forces(0, 0.0).unwrap()[1];
                let of = |tau: f64, limit: f64| tau / limit.abs().max(least);
                let part = of(tau, upper).max(of(-tau, lower));
                assert!(part <= 1.0 + 1.01 * allowed, "{actuator} {k} {speed}: {part}");
                reached = reached.max(part);
            }
            most = most.max(reached);
            near += usize::from(reached > 0.9);
        }
        let n = run.times.len();
        println!("{actuator} {} s, at the limit in {near} of {n}, {most}", run.times[n - 1]);
        assert!(near > n / 3, "{actuator}: {near} of {n}");
    }
}
