//! Loops that turn all the way round: redundant rows, gears, several linkages in a row.

use std::f64::consts::{PI, TAU};

use sarrus_dynamics::description::SubmechanismKind::Numerical;
use sarrus_dynamics::{
    Compiled, CutJoint, FieldSet, ImplicitForm, Method, Plan, Query, Request, Status, Warnings,
    Workspace,
};
use sarrus_report::robots::small::{LOOSE, Turn, Z as Z_AXIS, cut, joint, mechanism};
use sarrus_tests::compare::error_by_size;
use sarrus_tests::rigid::Pose;

use super::{BASE, robot, warned};
use sarrus_dynamics::Field::*;

/// Bennett's mechanism at an angle of its crank, with all rows of a weld or of a hinge.
fn bennett(theta: f64, welded: bool) -> Compiled {
    let [alpha, beta]: [f64; 2] = [0.7, 1.6];
    // tan ½θ tan ½ψ = sin ½(β + α) / sin ½(β − α)
    let ratio = (0.5 * (beta + alpha)).sin() / (0.5 * (beta - alpha)).sin();
    let psi = 2.0 * (ratio / (0.5 * theta).tan()).atan();
    let link = |twist: f64| Pose::from_rpy([twist, 0.0, 0.0], [twist.sin(), 0.0, 0.0]);
    let start = Pose::from_rpy([0.4, -0.3, 1.1], [0.1, 0.2, 0.3]);
    let mut frame = start;
    let mut of = mechanism(Numerical);
    let mut links = vec![BASE];
    let parts = [(theta, alpha), (psi, beta), (-theta, alpha), (-psi, beta)];
    for (angle, twist) in parts.into_iter().take(if welded { 4 } else { 3 }) {
        links.push(joint(&mut of, links[links.len() - 1], Turn, frame.p, frame.direction(Z_AXIS)));
        frame = frame.then(&Pose::from_rpy([0.0, 0.0, angle], [0.0; 3])).then(&link(twist));
    }
    let last = links[links.len() - 1];
    if welded {
        cut(&mut of, BASE, last, start.p, "abcxyz");
    } else {
        let hinge = CutJoint::Revolute { axis: frame.direction(Z_AXIS) };
        of.cut("cut0", BASE, last).at(frame.p).joint(hinge);
    }
    of.independent([links[1]]).active([links[1]]).compile().unwrap()
}

/// No three rows of six, or of five, are independent all the way round.
#[test]
fn redundant_rows_are_chosen_where_the_loop_is() {
    for (theta, welded) in [(0.5, true), (0.5, false), (1.4, true), (1.4, false), (2.2, true)] {
        let compiled = bennett(theta, welded);
        assert!(warned(&compiled).contains("redundant constraint axes"));
        let mut robot = robot(&compiled);
        for k in 0..29 {
            let y = PI * (f64::from(k) / 14.0 - 1.0);
            let x = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q, Residual, Iterations]).ok();
            assert!(x.get(Residual)[0] < 1e-13, "{y}: {:?}", x.get(Residual));
            // tan ½θ tan ½ψ is constant, and opposite angles are equal
            let angle = theta + y;
            let of_zero = (0.5 * theta).tan();
            let [alpha, beta]: [f64; 2] = [0.7, 1.6];
            let ratio = (0.5 * (beta + alpha)).sin() / (0.5 * (beta - alpha)).sin();
            let psi = 2.0 * (ratio / (0.5 * angle).tan()).atan() - 2.0 * (ratio / of_zero).atan();
            let off = (x.get(Q)[1] - psi) / TAU;
            assert!((off - off.round()).abs() < 1e-12, "{y}: {:?} {psi}", x.get(Q));
        }
    }
}

/// Conditions and the constrained tree's accelerations use the rows that serve at the pose: those
/// kept at load lose rank on the way round.
#[test]
fn conditions_and_constraints_are_those_of_the_rows_at_the_pose() {
    for (theta, welded) in [(0.5, true), (1.4, false)] {
        let compiled = bennett(theta, welded);
        let model = &compiled.model;
        let n = model.sizes().n_v;
        let mut robot = robot(&compiled);
        let mut least = f64::INFINITY;
        for k in 0..300 {
            let y = PI * (f64::from(k) / 150.0 - 0.997);
            let given: [(_, &[f64]); 3] = [(Y, &[y]), (Yd, &[0.7]), (TauY, &[0.3])];
            let x = robot.ask(Request::ForwardDynamics, &given, &[Ydd, Q, Qd, Qdd, SigmaMin]).ok();
            least = least.min(x.get(SigmaMin)[0]);
            let query = Query::new(
                Request::ForwardDynamics,
                FieldSet::of(&[Y, Yd, TauY]),
                FieldSet::of(&[Ydd]),
            );
            let plan = Plan::with_method(model, &query, Method::Kkt).unwrap();
            let mut workspace = Workspace::for_plans(model, [&plan]);
            let mut ydd = [0.0];
            let answer = plan.run(model, &mut workspace, &[y, 0.7, 0.3], &mut ydd);
            assert_eq!((answer.status, answer.warnings), (Status::Ok, Warnings::NONE), "{y}");
            let size = x.get(Ydd)[0].abs().max(1.0);
            assert!((ydd[0] - x.get(Ydd)[0]).abs() < 1e-9 * size, "{y}: {ydd:?} {:?}", x.get(Ydd));
            let mut tau = vec![0.0; n];
            tau[0] = 0.3;
            let mut qdd = vec![0.0; n];
            let status = ImplicitForm::new(model).accelerations(
                model,
                x.get(Q),
                x.get(Qd),
                &tau,
                &[],
                (0.0, 0.0),
                &mut qdd,
            );
            assert_eq!(status, Status::Ok, "{y}");
            assert!(error_by_size(&qdd, x.get(Qdd), 1.0) < 1e-8, "{y}: {qdd:?}");
        }
        assert!(least > 0.02, "{theta}: {least}");
    }
}

/// A four-bar whose motor moves with the rocker by a gear alone, on the base or on the crank.
fn geared(ratio: f64, leads: bool, on_crank: bool) -> Compiled {
    let [a, b, c, d] = LOOSE.map(|[x, y]| [x, y, 0.0]);
    let mut of = mechanism(Numerical);
    let crank = joint(&mut of, BASE, Turn, a, Z_AXIS);
    let coupler = joint(&mut of, crank, Turn, b, Z_AXIS);
    let rocker = joint(&mut of, BASE, Turn, d, Z_AXIS);
    cut(&mut of, coupler, rocker, c, "xy");
    let motor = joint(&mut of, if on_crank { crank } else { BASE }, Turn, [0.0, 0.1, 0.0], Z_AXIS);
    if leads {
        of.couple(rocker, [(motor, 1.0 / ratio)], 0.0).independent([motor]);
    } else {
        of.couple(motor, [(rocker, ratio)], 0.0).independent([crank]);
    }
    of.active([motor]).compile().unwrap()
}

#[test]
fn a_gear_of_any_ratio_turns_with_its_loop() {
    for (leads, on_crank) in [(false, false), (false, true), (true, false), (true, true)] {
        let state = |ratio: f64, y: f64| {
            let y = if leads { y * ratio } else { y };
            let given: [(_, &[f64]); 3] = [(Y, &[y]), (Yd, &[0.0]), (Ydd, &[0.0])];
            let compiled = geared(ratio, leads, on_crank);
            assert_eq!(warned(&compiled), "", "{ratio}");
            robot(&compiled).ask(Request::InverseDynamics, &given, &[Q, TauU]).ok()
        };
        for y in [-0.2, 0.15] {
            let direct = state(1.0, y);
            for ratio in [9e3, 1e5, 1e6] {
                let x = state(ratio, y);
                let q = [x.get(Q)[0], x.get(Q)[1], x.get(Q)[2]];
                assert!(error_by_size(&q, &direct.get(Q)[..3], 1.0) < 1e-13, "{ratio} {y}");
                assert!((x.get(Q)[3] / (ratio * q[2]) - 1.0).abs() < 1e-14, "{ratio} {y}");
            }
        }
    }
}

/// Double cranks in a row: the follower of each is the crank of the next, and all turn round.
fn double_cranks(n: usize) -> Compiled {
    let mut of = mechanism(Numerical);
    let mut crank = joint(&mut of, BASE, Turn, [0.0; 3], Z_AXIS);
    let first = crank;
    for k in 0..n {
        let k = k as f64;
        let rod = 0.9 + 0.05 * (0.51 * (k + 1.0)).cos();
        let follower = 1.05 + 0.05 * (0.3 * (k + 1.0)).sin();
        let angle = 1.3 + 0.4 * k;
        let pin = [0.35 * k + angle.cos(), angle.sin()];
        let pivot = [0.35 * (k + 1.0), 0.0];
        // where the circles about pin and pivot meet
        let [x, y] = [pivot[0] - pin[0], pivot[1] - pin[1]];
        let far = x.hypot(y);
        let along = (rod * rod - follower * follower + far * far) / (2.0 * far);
        let aside = (rod * rod - along * along).sqrt();
        let meeting =
            [pin[0] + (along * x + aside * y) / far, pin[1] + (along * y - aside * x) / far, 0.0];
        let coupler = joint(&mut of, crank, Turn, [pin[0], pin[1], 0.0], Z_AXIS);
        crank = joint(&mut of, BASE, Turn, [pivot[0], pivot[1], 0.0], Z_AXIS);
        let hinge = CutJoint::PlanarRevolute { axis: Z_AXIS };
        of.cut(format!("cut{k}"), coupler, crank).at(meeting).joint(hinge);
    }
    of.independent([first]).active([first]).compile().unwrap()
}

#[test]
fn linkages_in_a_row_make_any_number_of_turns() {
    for n in [4, 6, 8] {
        let mut robot = robot(&double_cranks(n));
        for k in 0..24 {
            let y = -20.0 + 40.0 * f64::from(k) / 23.0;
            let mut at = |y: f64| robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q, Residual]).ok();
            let turns = (y / TAU).round();
            let x = at(y);
            let within = at(y - turns * TAU);
            assert!(x.get(Residual)[0] < 1e-13, "{n} {y}");
            let size = 20.0;
            let back: Vec<f64> = within.get(Q).iter().map(|q| q / TAU).collect();
            for (q, back) in x.get(Q).iter().zip(&back) {
                let off = q / TAU - back;
                assert!((off - off.round()).abs() < 1e-12 * size, "{n} {y}: {q}");
            }
        }
    }
}
