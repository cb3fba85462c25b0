//! Published motions and closed forms.

#![allow(clippy::excessive_precision, reason = "published numbers stand as they were published")]

use std::f64::consts::{FRAC_PI_2, PI};

use sarrus_report::integration::{four_bars, pendulum};
use sarrus_simulation::{Source, Space};
use sarrus_tests::compare::assert_close;

use super::*;
use crate::published::{SQUEEZER, SQUEEZER_END};

fn squeezer() -> Robot {
    let mut robot = Robot::bundled("squeezer");
    robot.spring(
        ("ground", [0.014, 0.072, 0.0]),
        ("K3", [0.02, -0.018, 0.0]),
        [4530.0, 0.0, 0.07785],
    );
    robot.inputs.push(Input { space: Space::Actuator, source: Source::Constant(vec![0.033]) });
    robot
}

#[test]
fn the_squeezer_arrives_as_published_by_an_implicit_and_an_explicit_method() {
    let q = SQUEEZER_END;
    let v = [
        1139.920302151208,
        -1424.379294994111,
        11.03291221937134,
        19.29337464421385,
        0.5735699284790808,
        -19.29337464421385,
        0.3231791658026955,
    ];
    let robot = squeezer();
    for (method, tolerance) in [(Method::Radau5, 1e-11), (Method::Dop853, 1e-12)] {
        let run = robot.run(&from(&[0.0], &[0.0]), &adaptive(method, tolerance, 0.03));
        let end = arrived(&run);
        let at: Vec<f64> = end.q.iter().zip(SQUEEZER).map(|(q, start)| q + start).collect();
        println!("{} {:?} drift {:e}", method.name(), run.counts, run.drift());
        // to the published digits; E − E₀ − mom (β − β₀) = 0
        assert_close(&format!("q by {}", method.name()), &at, &q, 1.0, 1e-9);
        assert_close(&format!("v by {}", method.name()), &end.qd, &v, 1.0, 1e-8);
        assert!(run.drift() < 1e-9, "drift {:e}", run.drift());
        assert_close("work", &[end.work], &[0.033 * end.q[0]], 1e-3, 1e-9);
    }
}

#[test]
fn four_bars_in_a_row_pass_the_flat_pose_as_one_pendulum() {
    // published for N = 2
    let [angle, rate] = pendulum(2.0, [FRAC_PI_2, -1.0], 10.0);
    let pin = [angle.cos(), angle.sin(), -rate * angle.sin(), rate * angle.cos()];
    assert_close(
        "B0",
        &pin,
        &[0.3284581115408154, 0.944518538178601, 1.423051470206944, -0.494868845487043],
        1.0,
        1e-11,
    );

    let robot = Robot::bundled("four_bars_2");
    for (settings, allowed) in [
        (fixed(Method::RungeKutta, 1e-3, 10.0), 1e-9),
        (adaptive(Method::Dop853, 1e-11, 10.0), 2e-8),
        (adaptive(Method::Radau5, 1e-10, 10.0), 1e-7),
    ] {
        let run = robot.run(&from(&[0.0], &[-1.0]), &settings);
        let end = arrived(&run);
        println!("{} {:?} {:?}", settings.method.name(), run.counts, run.events);
        assert_close(
            settings.method.name(),
            &[end.y[0] + FRAC_PI_2, end.yd[0]],
            &[angle, rate],
            1.0,
            allowed,
        );
    }
}

#[test]
fn forty_four_bars_pass_it_too() {
    let [angle, rate] = pendulum(40.0, [FRAC_PI_2, -1.0], 10.0);
    let robot = Robot::of(&four_bars(40), [0.0, 0.0, -9.81]);
    let run = robot.run(
        &from(&[0.0], &[-1.0]),
        &Settings { precise: false, ..fixed(Method::RungeKutta, 5e-3, 10.0) },
    );
    let end = arrived(&run);
    println!("{:?} {:?}", run.counts, run.events);
    assert_close("40 four-bars", &[end.y[0] + FRAC_PI_2, end.yd[0]], &[angle, rate], 1.0, 1e-6);
}

#[test]
fn bricards_mechanism_falls_as_published() {
    let robot = Robot::bundled("bricard");
    let p3 =
        robot.loaded.compiled.model.link_names().iter().position(|link| link == "rod3").unwrap()
            as u16;
    for (seconds, published) in [
        (0.5, [0.968283679107, -1.224625159436, 0.750146609438]),
        (1.0, [0.510501461187, -1.649167599395, 0.140123114553]),
    ] {
        for method in [Method::Dop853, Method::Radau5] {
            let run = robot.run(&from(&[0.0], &[0.0]), &adaptive(method, 1e-11, seconds));
            let end = arrived(&run);
            let mut asked = sarrus_tests::run::Robot::new(robot.loaded.compiled.model.clone());
            use sarrus_dynamics::{Field, FieldSet, Query, Request};
            let query =
                Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[Field::FramePose]))
                    .with_frames(&[p3]);
            let pose = asked.ask_for(query, &[(Field::Y, &end.y), (Field::QGuess, &end.q)]).ok();
            // published with y upwards
            let [x, north, up] = [0, 1, 2].map(|i| pose.get(Field::FramePose)[i]);
            assert_close(
                &format!("P3({seconds}) by {}", method.name()),
                &[x, up, -north],
                &published,
                1.0,
                2e-11,
            );
        }
    }
}

/// Flyball governor (IFToMM A05), which is stiff.
fn governor() -> Robot {
    let mut robot =
        Robot::text(include_str!("../../../server/report/src/integration/governor.urdf"), None);
    for rod in ["right_rod", "left_rod"] {
        robot.spring((rod, [0.5, 0.0, 0.0]), ("slider", [0.0; 3]), [8e5, 4e4, 0.5]);
    }
    robot
}

#[test]
fn the_flyball_governor_is_stiff_and_an_implicit_method_takes_long_steps() {
    let robot = governor();
    let start = from(&[0.0; 4], &[2.0 * PI, 0.0, 0.0, 0.0]);
    let implicit = robot.run(&start, &adaptive(Method::Radau5, 1e-9, 0.5));
    let explicit = robot.run(&start, &adaptive(Method::Dop853, 1e-11, 0.5));
    let a = arrived(&implicit);
    let b = arrived(&explicit);
    println!(
        "radau5 {:?} drift {:e}\ndop853 {:?} drift {:e}",
        implicit.counts,
        implicit.drift(),
        explicit.counts,
        explicit.drift()
    );
    assert_close("y", &a.y, &b.y, 1.0, 1e-8);
    assert_close("yd", &a.yd, &b.yd, 1.0, 1e-8);
    assert!(
        implicit.counts.steps * 10 < explicit.counts.steps,
        "{} against {} steps",
        implicit.counts.steps,
        explicit.counts.steps
    );
    // the work of the dampers is accounted for
    assert!(
        a.work < -1e-3 && implicit.drift() < 1e-8 && explicit.drift() < 1e-8,
        "work {:e}",
        a.work
    );
}
