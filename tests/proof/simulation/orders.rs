//! Orders of convergence, and the drift of energy over time.

use sarrus_simulation::{Source, Space};
use sarrus_tests::compare::largest;
use sarrus_tests::small::minus;

use super::floating::satellite;
use super::switching::slider_crank;
use super::*;

/// Order of a fixed-step method between two steps, against the finest one.
pub(super) fn order(
    robot: &Robot,
    start: &Start,
    method: Method,
    steps: [f64; 3],
    duration: f64,
) -> f64 {
    let states = steps.map(|step| {
        let run = robot.run(start, &fixed(method, step, duration));
        let end = arrived(&run);
        [end.y.clone(), end.yd.clone()].concat()
    });
    let error = |k: usize| largest(&minus(&states[k], &states[2]));
    (error(0) / error(1)).log2() / (steps[0] / steps[1]).log2()
}

#[test]
fn methods_of_fixed_step_converge_with_their_order() {
    let mut robot = Robot::bundled("lambda");
    robot.inputs.push(Input { space: Space::Actuator, source: Source::Constant(vec![3.0]) });
    let start = from(&[0.1], &[0.5]);
    for (method, expected, steps) in [
        (Method::Euler, 1.0, [4e-3, 2e-3, 1.25e-4]),
        (Method::RungeKutta, 4.0, [2e-2, 1e-2, 1.25e-3]),
    ] {
        let found = order(&robot, &start, method, steps, 0.2);
        println!("{} {found}", method.name());
        assert!((found - expected).abs() < 0.25, "{} converges with order {found}", method.name());
    }
}

#[test]
fn adaptive_methods_come_nearer_the_truth_with_their_tolerance() {
    let mut robot = Robot::bundled("torso");
    robot
        .inputs
        .push(Input { space: Space::Independent, source: Source::Constant(vec![2.0, -1.0]) });
    let start = from(&[0.05, -0.04], &[0.3, 0.2]);
    let reference = robot.run(&start, &fixed(Method::RungeKutta, 1e-4, 0.2));
    for method in [Method::Dop853, Method::Radau5] {
        let errors = [1e-4, 1e-7, 1e-10].map(|tolerance| {
            let run = robot.run(&start, &adaptive(method, tolerance, 0.2));
            largest(&minus(&arrived(&run).yd, &arrived(&reference).yd))
        });
        println!("{} {errors:?}", method.name());
        assert!(
            errors[1] < 0.1 * errors[0] && errors[2] < 0.1 * errors[1] && errors[2] < 1e-9,
            "{errors:?}"
        );
    }
}

#[test]
fn the_estimate_of_the_error_is_of_its_size() {
    let robot = Robot::bundled("lambda");
    let start = from(&[0.1], &[0.5]);
    let reference = robot.run(&start, &fixed(Method::RungeKutta, 1e-4, 0.2));
    for settings in [
        fixed(Method::Euler, 1e-3, 0.2),
        fixed(Method::RungeKutta, 1e-2, 0.2),
        adaptive(Method::Dop853, 1e-6, 0.2),
    ] {
        let run = robot.run(&start, &Settings { estimate: true, ..settings });
        let error = (arrived(&run).yd[0] - arrived(&reference).yd[0]).abs();
        let [_, estimate] = run.error_estimate.unwrap();
        println!("{} error {error:e} estimate {estimate:e}", settings.method.name());
        assert!(
            estimate < 30.0 * error && error < 30.0 * estimate,
            "{}: {error:e} against {estimate:e}",
            settings.method.name()
        );
    }
}

#[test]
fn energy_less_work_stays_where_it_was() {
    // forces, springs, dampers and joint springs together
    let mut robot = Robot::bundled("torso");
    let links = robot.loaded.compiled.model.link_names().to_vec();
    let base = links[0].as_str();
    let last = links[links.len() - 1].as_str();
    robot.spring((base, [0.1, 0.0, 0.3]), (last, [0.0, 0.05, 0.1]), [500.0, 5.0, 0.2]);
    let actuators = robot.loaded.compiled.model.sizes().n_u;
    let gains =
        Source::Gains { stiffness: vec![400.0; 2], damping: vec![4.0; 2], target: vec![0.1, -0.1] };
    robot.inputs.push(Input { space: Space::Independent, source: gains });
    let times = vec![0.0, 0.1, 0.25];
    let forces = times.iter().map(|t| vec![20.0 * t; actuators]).collect();
    robot.inputs.push(Input { space: Space::Actuator, source: Source::Table { times, forces } });
    for settings in [
        fixed(Method::RungeKutta, 1e-3, 0.5),
        adaptive(Method::Dop853, 1e-10, 0.5),
        adaptive(Method::Radau5, 1e-9, 0.5),
    ] {
        let run = robot.run(&from(&[0.05, -0.04], &[0.3, 0.2]), &settings);
        arrived(&run);
        println!(
            "{} drift {:e} work {:e} {:?}",
            settings.method.name(),
            run.drift(),
            run.last().unwrap().work,
            run.counts
        );
        assert!(
            run.drift() < 1e-6 && run.last().unwrap().work.abs() > 1e-3,
            "{} drifts by {:e}",
            settings.method.name(),
            run.drift()
        );
    }
}

#[test]
fn the_semi_implicit_method_neither_gains_nor_loses_energy_over_ten_thousand_swings_of_a_step() {
    // a drift would grow tenfold over ten times the steps
    let robot = Robot::bundled("lambda");
    let drift = [2_000.0, 20_000.0].map(|steps| {
        let run = robot.run(
            &from(&[0.1], &[0.0]),
            &Settings { every: Some(0.05), ..fixed(Method::Euler, 1e-3, 1e-3 * steps) },
        );
        arrived(&run);
        run.drift()
    });
    println!("{drift:?}");
    assert!(drift[1] < 2.0 * drift[0] && drift[1] < 0.05, "{drift:?}");
}

#[test]
fn a_step_as_long_as_the_samples_or_the_motion_is_estimated_too() {
    let robot = Robot::bundled("lambda");
    let start = from(&[0.3], &[0.0]);
    let reference = robot.run(&start, &adaptive(Method::Dop853, 1e-12, 1.0));
    for (step, every) in [(0.1, Some(0.05)), (1.0, None), (0.25, Some(0.25))] {
        let settings = Settings {
            step: Some(step),
            every,
            estimate: true,
            ..Settings::new(Method::RungeKutta, 1.0)
        };
        let run = robot.run(&start, &settings);
        let error = (arrived(&run).y[0] - arrived(&reference).y[0]).abs();
        let [estimate, _] = run.error_estimate.unwrap();
        assert!(estimate > 0.03 * error, "step {step}: error {error:e}, estimate {estimate:e}");
    }
}

#[test]
fn samples_and_kinks_that_force_the_steps_do_not_hide_the_error() {
    let mut robot = Robot::bundled("lambda");
    let times: Vec<f64> = (0..11).map(|k| 0.1 * f64::from(k)).collect();
    let forces = times.iter().map(|_| vec![0.0]).collect();
    let start = from(&[0.3], &[0.0]);
    let reference = robot.run(&start, &adaptive(Method::Dop853, 1e-12, 1.0));
    let check = |robot: &Robot, settings: Settings| {
        let run = robot.run(&start, &Settings { estimate: true, ..settings });
        let error = (arrived(&run).y[0] - arrived(&reference).y[0]).abs();
        let [estimate, _] = run.error_estimate.unwrap();
        let name = settings.method.name();
        println!("{name} error {error:e} estimate {estimate:e} {:?}", run.counts);
        assert!(
            estimate > 0.3 * error && estimate < 3.0 * error,
            "{name}: error {error:e}, estimate {estimate:e}"
        );
    };
    for method in [Method::Dop853, Method::Radau5] {
        check(&robot, Settings { every: Some(0.1), ..adaptive(method, 0.5, 1.0) });
    }
    robot.inputs.push(Input { space: Space::Actuator, source: Source::Table { times, forces } });
    check(&robot, fixed(Method::RungeKutta, 0.4, 1.0));
}

#[test]
fn rows_within_a_step_cost_no_steps_and_keep_the_error_of_the_steps() {
    let flying = (satellite(-9.81), {
        let y = [0.1, -0.2, 0.3, 0.0, 0.6, 0.0, 0.8, 0.4, -0.3, 0.36, 0.48, 0.0, 0.8];
        from(&y, &[0.5, -2.0, 1.5, 0.3, 0.1, -0.4, 2.0, -1.0, 0.7, 1.5, -1.0])
    });
    // its independents change on the way
    let turning = (slider_crank("NUMERICAL", "slide"), from(&[0.0], &[-0.5]));
    let torso = (Robot::bundled("torso"), from(&[0.05, -0.04], &[0.3, 0.2]));
    for (robot, start) in [torso, flying, turning] {
        for tolerance in [1e-5, 1e-10] {
            let settings = adaptive(Method::Dop853, tolerance, 0.5);
            let whole = robot.run(&start, &settings);
            let rows = robot.run(&start, &Settings { every: Some(1e-3), ..settings });
            let exact = Settings { rtol: 1e-13, atol: 1e-13, every: Some(1e-3), ..settings };
            let exact = robot.run(&start, &Settings { method: Method::Radau5, ..exact });
            arrived(&rows);
            assert_eq!(rows.samples.len(), 501);
            assert_eq!(rows.counts.steps, whole.counts.steps);
            assert_eq!(rows.counts.evaluations, whole.counts.evaluations + 499);
            let error = |k: usize| {
                let [a, b] = [&rows.samples[k], &exact.samples[k]];
                assert!((a.time - b.time).abs() < 1e-15);
                largest(&minus(&a.q, &b.q)).max(largest(&minus(&a.qd, &b.qd)))
            };
            let most = (0..501).map(error).fold(0.0, f64::max);
            println!("{tolerance:e} {most:e} {:e} {:?}", error(500), rows.counts);
            assert!(most < 300.0 * tolerance, "{tolerance:e}: {most:e}");
        }
    }
}
