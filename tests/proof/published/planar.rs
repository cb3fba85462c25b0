//! The table of the lambda, four-bars in a row, a five-bar.

use std::f64::consts::FRAC_PI_2;

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_report::integration::four_bars;
use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

/// y, then q2, q3, G2, G3, g2, g3 at ẏ = 1.
const LAMBDA: [[f64; 7]; 3] = [
    [
        0.3,
        0.43084815391883554,
        0.25825016245922332,
        1.4011611160212772,
        0.047619494691353104,
        -0.33233541130650645,
        0.14516018426959063,
    ],
    [
        FRAC_PI_2,
        1.873598506960771,
        0.38236587360798819,
        0.91107910510309498,
        0.10883261889282429,
        -0.2340105049560769,
        -0.030976977164060605,
    ],
    [
        -1.1,
        -1.4136800210589492,
        0.32932031931445793,
        1.0541745729816897,
        -0.11261557039417324,
        0.37901509244370808,
        0.018807304726899158,
    ],
];

#[test]
fn the_lambda_stands_where_its_table_says() {
    // the table measures angles from the base line, the robot from its zero pose
    let zero = [0.803719823174243, 1.0833785823281756, 0.29739].map(Dd::from_f64);
    let compiled = bundled("lambda");
    for row in LAMBDA {
        let y = Dd::from_f64(row[0]) - zero[0];
        let want = [Q, G, GBias];
        let exact = Robot::new(compiled.exact.clone())
            .ask(Request::Kinematics, &[(Y, &[y]), (Yd, &[Dd::ONE])], &want)
            .ok();
        let double = Robot::new(compiled.model.clone())
            .ask(Request::Kinematics, &[(Y, &[y.hi()]), (Yd, &[1.0])], &want)
            .ok();
        for (what, state) in [("exact", exact.map(Dd::hi)), ("double", double)] {
            let q = [state.get(Q)[1] + zero[1].hi(), state.get(Q)[2] + zero[2].hi()];
            assert_close(&format!("{what} q at {}", row[0]), &q, &row[1..3], 1.0, 1e-15);
            assert_close(
                &format!("{what} G at {}", row[0]),
                &state.get(G)[1..],
                &row[3..5],
                1.0,
                1e-15,
            );
            assert_close(
                &format!("{what} g at {}", row[0]),
                &state.get(GBias)[1..],
                &row[5..7],
                1.0,
                1e-15,
            );
        }
    }
}

#[test]
fn four_bars_in_a_row_fall_as_one_pendulum() {
    // double precision closes longer rows only at larger distances from the flat pose
    for (n, reach, source) in [
        (2, 1.5, Source::Bundled("four_bars_2".into())),
        (2, 1.5, four_bars(2)),
        (7, 1.2, four_bars(7)),
        (40, 0.3, four_bars(40)),
    ] {
        let mut robot = Robot::new(compiled(&source).model);
        assert_eq!((robot.model.sizes().n_v, robot.model.sizes().n_c), (2 * n + 1, 2 * n));
        for (y, yd) in [(0.0, -1.0), (0.3, 1.0), (0.7, 2.0), (-1.2, 0.5), (1.5, -3.0)]
            .into_iter()
            .filter(|(y, _)| f64::abs(*y) <= reach)
        {
            let q = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).ok();
            // every crank turns by the first one's angle, every coupler keeps its direction
            let expected: Vec<f64> =
                (0..2 * n + 1).map(|k| if k % 2 == 0 { y } else { -y }).collect();
            assert_close(&format!("{n} four-bars, q at {y}"), q.get(Q), &expected, 1.0, 1e-14);
            let fall = robot
                .ask(Request::ForwardDynamics, &[(Y, &[y]), (Yd, &[yd]), (TauU, &[0.0])], &[Ydd])
                .ok();
            let count = n as f64;
            let angle = FRAC_PI_2 + y;
            let expected =
                -((count + 1.0) / 2.0 + count) * 9.81 * angle.cos() / ((count + 1.0) / 3.0 + count);
            assert_close(
                &format!("{n} four-bars, ÿ at {y}"),
                fall.get(Ydd),
                &[expected],
                1.0,
                1e-11,
            );
        }
    }
}

#[test]
fn the_five_bar_stands_where_two_circles_meet() {
    let mut robot = Robot::new(bundled("five_bar").model);
    for k in 0..20 {
        let y = Seeded::new(k).numbers(2, 0.4);
        let left = pose(&mut robot, "left_rod", &y);
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok();
        // at zero the cranks point 3 to 4 outwards
        let elbow = |side: f64, y: f64| {
            let (s, c) = y.sin_cos();
            let [x, z] = [side * 0.09, -0.12];
            [side * 0.08 + c * x + s * z, c * z - s * x]
        };
        let a = elbow(-1.0, y[0]);
        let b = elbow(1.0, y[1]);
        assert_close("elbow", &[left[0], left[2]], &a, 1.0, 1e-14);
        let [dx, dz] = [b[0] - a[0], b[1] - a[1]];
        let square = dx * dx + dz * dz;
        let height = (0.0625 / square - 0.25).sqrt();
        let pin = [a[0] + 0.5 * dx + height * dz, a[1] + 0.5 * dz - height * dx];
        // the left rod turns by its crank's angle plus its own
        let turn = state.get(Q)[0]
            + state.get(Q)[1]
            + 0.17_f64.atan2(-(0.25_f64 * 0.25 - 0.17 * 0.17).sqrt());
        let ours = [a[0] + 0.25 * turn.sin(), a[1] + 0.25 * turn.cos()];
        assert_close(&format!("pin at {y:?}"), &ours, &pin, 1.0, 1e-14);
    }
}
