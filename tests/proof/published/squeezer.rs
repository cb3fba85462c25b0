//! Andrews' squeezing mechanism (IVP test set), with its spring as a wrench.

use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

/// β, Θ, γ, Φ, δ, Ω, ε of the squeezing mechanism at the start.
pub(crate) const SQUEEZER: [f64; 7] = [
    -0.0617138900142764496,
    0.0,
    0.455279819163070380,
    0.222668390165885885,
    0.487364979543842550,
    -0.222668390165885885,
    1.23054744454982119,
];

/// q of the squeezer at 0.03 s, as published.
pub(crate) const SQUEEZER_END: [f64; 7] = [
    15.81077119629904,
    -15.75637105984298,
    0.04082224013073101,
    -0.5347301163226948,
    0.5244099658805304,
    0.5347301163226948,
    1.048080741042263,
];

/// Residuals of the six published equations.
fn squeezer_gaps(q: &[f64]) -> [f64; 6] {
    let a: [f64; 7] = std::array::from_fn(|i| q[i] + SQUEEZER[i]);
    let [beta, theta, gamma, phi, delta, omega, epsilon] = a;
    let [xa, ya, xb, yb] = [-0.06934, -0.00227, -0.03635, 0.03273];
    let [d, e, rr, ss, u, zf, zt] = [0.028, 0.02, 0.007, 0.035, 0.04, 0.02, 0.04];
    let pin =
        [rr * beta.cos() - d * (beta + theta).cos(), rr * beta.sin() - d * (beta + theta).sin()];
    [
        pin[0] - ss * gamma.sin() - xb,
        pin[1] + ss * gamma.cos() - yb,
        pin[0] - e * (phi + delta).sin() - zt * delta.cos() - xa,
        pin[1] + e * (phi + delta).cos() - zt * delta.sin() - ya,
        pin[0] - zf * (omega + epsilon).cos() - u * epsilon.sin() - xa,
        pin[1] - zf * (omega + epsilon).sin() + u * epsilon.cos() - ya,
    ]
}

/// The spring's wrench on K3 at the origin of K3 {world axes}, at q.
fn squeezer_spring(q: &[f64]) -> [f64; 6] {
    let angle = q[2] + SQUEEZER[2];
    let (s, c) = angle.sin_cos();
    let [xb, yb, xc, yc, sc, sd] = [-0.03635, 0.03273, 0.014, 0.072, 0.018, 0.02];
    let arm = [sd * c + sc * s, sd * s - sc * c];
    let out = [xb + arm[0] - xc, yb + arm[1] - yc];
    let length = out[0].hypot(out[1]);
    let force = out.map(|x| -4530.0 * (length - 0.07785) * x / length);
    [0.0, 0.0, arm[0] * force[1] - arm[1] * force[0], force[0], force[1], 0.0]
}

#[test]
fn the_squeezer_closes_and_starts_as_published() {
    let mut robot = Robot::new(bundled("squeezer").model);
    let zero = robot.ask(Request::Kinematics, &[(Y, &[0.0])], &[Q]).ok();
    assert_close("q(0)", zero.get(Q), &[0.0; 7], 1.0, 1e-14);
    for k in 0..20 {
        let y = 0.6 * Seeded::new(k).numbers(1, 1.0)[0];
        let at = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).ok();
        // the mechanism measures a few centimetres
        assert_close(
            &format!("loops at β − β0 = {y}"),
            &squeezer_gaps(at.get(Q)),
            &[0.0; 6],
            0.04,
            1e-14,
        );
    }
    let query = Query::new(Request::ForwardDynamics, FieldSet::EMPTY, FieldSet::of(&[Qdd]))
        .with_wrenches(&[link(&robot, "K3")]);
    let given: [(Field, &[f64]); 4] =
        [(Y, &[0.0]), (Yd, &[0.0]), (TauU, &[0.033]), (Wrenches, &squeezer_spring(&[0.0; 7]))];
    let start = robot.ask_for(query, &given).ok();
    // the loops' rounding, 1e-17 m, is 1e-15 of the shortest crank
    let published = [14222.4439199541387, -10666.8329399655854, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_close("q̈(0)", start.get(Qdd), &published, 1.0, 1e-11);
}

#[test]
fn the_squeezer_arrives_as_published() {
    let mut robot = Robot::new(bundled("squeezer").model);
    let on = [link(&robot, "K3")];
    let mut motion = Motion { q: vec![0.0; 7], ..Motion::default() };
    for _ in 0..3000 {
        motion.step(&mut robot, 0.03 / 3000.0, |robot, y, yd, guess| {
            let q = closed(robot, y, guess);
            let query = Query::new(Request::ForwardDynamics, FieldSet::EMPTY, FieldSet::of(&[Ydd]))
                .with_wrenches(&on);
            let given: [(Field, &[f64]); 5] = [
                (Y, &[y]),
                (Yd, &[yd]),
                (TauU, &[0.033]),
                (QGuess, &q),
                (Wrenches, &squeezer_spring(&q)),
            ];
            robot.ask_for(query, &given).ok().get(Ydd)[0]
        });
    }
    let q: Vec<f64> = motion.q.iter().zip(SQUEEZER).map(|(q, start)| q + start).collect();
    // the published solution has nine digits
    assert_close("q(0.03)", &q, &SQUEEZER_END, 1.0, 1e-9);
    assert_close("v(0.03)", &[motion.yd], &[1139.920302151208], 1.0, 1e-9);
}
