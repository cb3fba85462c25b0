//! The implicit form in all tree coordinates, which serves as a comparison.

use sarrus_simulation::{Source, Space};
use sarrus_tests::compare::{assert_close, largest};
use sarrus_tests::small::minus;

use super::orders::order;
use super::*;

fn pushed(name: &str, force: f64) -> Robot {
    let mut robot = Robot::bundled(name);
    let actuators = robot.loaded.compiled.model.sizes().n_u;
    robot
        .inputs
        .push(Input { space: Space::Actuator, source: Source::Constant(vec![force; actuators]) });
    robot
}

#[test]
fn implicit_forms_arrive_where_the_independents_do() {
    for (name, force) in [("lambda", 2.0), ("torso", 2.0), ("five_bar", 0.02)] {
        let robot = pushed(name, force);
        let n = robot.loaded.compiled.model.sizes().n_vy;
        let start = from(&vec![0.05; n], &vec![0.3; n]);
        let reference = robot.run(&start, &adaptive(Method::Dop853, 1e-12, 0.3));
        for (method, allowed) in [(Method::Projection, 1e-7), (Method::Baumgarte, 1e-6)] {
            let run = robot.run(&start, &fixed(method, 1e-3, 0.3));
            println!(
                "{name} {} residual {:e} drift {:e}",
                method.name(),
                run.residual(),
                run.drift()
            );
            assert_close(
                &format!("{name} by {}", method.name()),
                &arrived(&run).y,
                &arrived(&reference).y,
                1.0,
                allowed,
            );
            assert_close(
                &format!("{name} by {}", method.name()),
                &arrived(&run).yd,
                &arrived(&reference).yd,
                1.0,
                100.0 * allowed,
            );
        }
    }
}

#[test]
fn loops_drift_apart_without_care_less_with_stabilisation_and_not_with_projection() {
    let robot = Robot::bundled("five_bar");
    let start = from(&[0.1, -0.1], &[1.0, 2.0]);
    let open = |method, stabilisation| {
        let run = robot
            .run(&start, &Settings { stabilisation, every: Some(0.1), ..fixed(method, 5e-3, 1.0) });
        arrived(&run);
        run.residual()
    };
    let nothing = open(Method::Baumgarte, Some(0.0));
    let stabilised = open(Method::Baumgarte, Some(20.0));
    let projected = open(Method::Projection, None);
    println!("{nothing:e} {stabilised:e} {projected:e}");
    assert!(
        stabilised < 0.3 * nothing && projected < 1e-13 && nothing > 1e-9,
        "{nothing:e} {stabilised:e} {projected:e}"
    );
}

#[test]
fn projection_keeps_the_order() {
    let robot = pushed("torso", 2.0);
    let found = order(
        &robot,
        &from(&[0.05, -0.04], &[0.3, 0.2]),
        Method::Projection,
        [1e-2, 5e-3, 6.25e-4],
        0.2,
    );
    println!("{found}");
    assert!((found - 4.0).abs() < 0.3, "projection converges with order {found}");
}

#[test]
fn springs_and_floating_bases_are_the_same_in_both_forms() {
    let mut robot = Robot::bundled("stewart_floating");
    let links = robot.loaded.compiled.model.link_names().to_vec();
    let sizes = robot.loaded.compiled.model.sizes();
    robot.spring(
        (links[0].as_str(), [0.0, 0.0, 0.1]),
        (links[links.len() - 1].as_str(), [0.0; 3]),
        [200.0, 2.0, 0.3],
    );
    let rest: Vec<f64> = robot
        .loaded
        .compiled
        .model
        .independent_q_names()
        .iter()
        .map(|name| f64::from(u8::from(name.ends_with("/qw"))))
        .collect();
    let start = from(&rest, &vec![0.05; sizes.n_vy]);
    let reference = robot.run(&start, &adaptive(Method::Dop853, 1e-11, 0.05));
    for method in [Method::Projection, Method::Baumgarte] {
        let run = robot.run(&start, &fixed(method, 2.5e-4, 0.05));
        let gap = largest(&minus(&arrived(&run).y, &arrived(&reference).y));
        println!("{} {gap:e} drift {:e}", method.name(), run.drift());
        assert!(gap < 1e-8, "{} is {gap:e} away", method.name());
    }
}
