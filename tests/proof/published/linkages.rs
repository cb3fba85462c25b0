//! Linkages with equations of their own: Jansen's leg, Bennett's linkage, the agile eye, and the
//! delta robot whose rods may spin.

use sarrus_tests::compare::assert_close;

use super::*;

/// Where circles about a and b of radii r and s meet, on the left of the way from a to b or on the
/// right.
pub(super) fn meet((a, r): ([f64; 2], f64), (b, s): ([f64; 2], f64), side: f64) -> [f64; 2] {
    let u = [b[0] - a[0], b[1] - a[1]];
    let square = u[0] * u[0] + u[1] * u[1];
    let along = (square + r * r - s * s) / 2.0;
    let across = side * (square * r * r - along * along).sqrt();
    let at = |k: usize, turned: f64| a[k] + (along * u[k] + across * turned) / square;
    [at(0, -u[1]), at(1, u[0])]
}

/// The foot of Jansen's leg at a crank's angle, by five circles.
fn foot(angle: f64) -> [f64; 2] {
    let about = |point: [f64; 2], radius: f64| (point, 0.01 * radius);
    let crank = [0.15 * angle.cos(), 0.15 * angle.sin()];
    let pin = [-0.38, -0.078];
    let top = meet(about(crank, 50.0), about(pin, 41.5), -1.0);
    let low = meet(about(crank, 61.9), about(pin, 39.3), 1.0);
    let back = meet(about(pin, 40.1), about(top, 55.8), 1.0);
    let heel = meet(about(back, 39.4), about(low, 36.7), -1.0);
    meet(about(heel, 65.7), about(low, 49.0), -1.0)
}

#[test]
fn the_crank_of_jansens_leg_turns_without_end_and_its_foot_walks() {
    let mut robot = Robot::new(bundled("jansen").model);
    let tip = foot(0.5);
    let zero = pose(&mut robot, "foot", &[0.0]);
    // the foot in its link's frame, from the zero pose
    let arm = [tip[0] - zero[0], 0.0, tip[1] - zero[2]];
    let turned = [-zero[3], -zero[4], -zero[5], zero[6]];
    let own = point_of(&[0.0, 0.0, 0.0, turned[0], turned[1], turned[2], turned[3]], arm);
    let mut path = Vec::new();
    for k in 0..=300 {
        let y = 0.05 * f64::from(k);
        let at = pose(&mut robot, "foot", &[y]);
        let [x, _, z] = point_of(&at, own);
        let expected = foot(0.5 + y);
        assert_close(&format!("the foot at {y}"), &[x, z], &expected, 1.0, 1e-13);
        path.push([x, z]);
    }
    // two turns and more; half of the way is flat within a fortieth of its length
    let lowest = path.iter().fold(f64::INFINITY, |low, at| low.min(at[1]));
    let flat: Vec<&[f64; 2]> = path.iter().filter(|at| at[1] < lowest + 0.02).collect();
    let reach = |of: fn(f64, f64) -> f64, from: f64| flat.iter().fold(from, |x, at| of(x, at[0]));
    let step = reach(f64::max, f64::NEG_INFINITY) - reach(f64::min, f64::INFINITY);
    println!("{} of {} points on the ground, a step of {step:.3} m", flat.len(), path.len());
    assert!(3 * flat.len() > path.len() && step > 0.5, "{} {step}", flat.len());
}

#[test]
fn bennetts_linkage_moves_by_its_own_equation() {
    let compiled = bundled("bennett");
    let closure = &compiled.model.closures()[0];
    assert_eq!((closure.rows, closure.rank, compiled.model.sizes().n_vy), (5, 2, 1));
    let mut robot = Robot::new(compiled.model);
    let quarter = core::f64::consts::FRAC_PI_2;
    let mut q = vec![0.0; 3];
    for k in 1..=14 {
        let y = 0.1 * f64::from(k);
        q = closed(&mut robot, y, &q);
        // θ₁ and θ₂ from π / 2 and 2π / 3; sin((β + α) / 2) / sin((β − α) / 2) = √3
        let half = (quarter + y) / 2.0;
        let second = 2.0 * (3.0_f64.sqrt() / half.tan()).atan();
        let expected = [y, second - 4.0 * quarter / 3.0, -y];
        assert_close(&format!("the hinges at {y}"), &q, &expected, 1.0, 1e-13);
    }
}

#[test]
fn the_axes_of_the_agile_eye_stay_orthogonal() {
    let mut robot = Robot::new(bundled("agile_eye").model);
    // the axes of motors, elbows and eye of each leg at zero
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let legs = [[x, y, z], [y, z, x], [z, x, y]];
    let inner = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for k in 0..40 {
        let k = f64::from(k);
        let motors = [0.9 * k.sin(), 0.7 * (1.3 * k).cos(), 0.8 * (0.7 * k + 1.0).sin()];
        let eye = pose(&mut robot, "eye", &motors);
        assert_close("the centre", &eye[..3], &[0.0; 3], 1.0, 1e-13);
        for ([motor, elbow, own], angle) in legs.into_iter().zip(motors) {
            let across = cross(motor, elbow);
            let turned: [f64; 3] =
                core::array::from_fn(|i| angle.cos() * elbow[i] + angle.sin() * across[i]);
            let held = inner(turned, point_of(&eye, own));
            assert!(held.abs() < 1e-13, "{motors:?}: {held:.1e}");
        }
    }
}

#[test]
fn rods_that_may_spin_move_the_delta_robot_as_others_do() {
    let [mut spinning, mut plain] =
        ["delta_balls", "delta"].map(|name| Robot::new(bundled(name).model));
    assert_eq!(spinning.model.closures()[0].idle.len(), 6);
    for y in [[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [-0.5, 0.4, 0.6]] {
        let rates: [(Field, &[f64]); 3] =
            [(Y, &y), (Yd, &[0.5, -1.0, 2.0]), (Ydd, &[3.0, 1.0, 0.2])];
        for field in [Q, Qd, Qdd] {
            let [found, expected] = [&mut spinning, &mut plain].map(|robot| {
                let x = robot.ask(Request::Kinematics, &rates, &[field]).ok();
                let names = robot.model.tree_names().iter().zip(x.get(field));
                names.map(|(name, x)| (name.clone(), *x)).collect::<Vec<_>>()
            });
            let idle = |name: &str| name.ends_with("_spin");
            assert!(found.iter().all(|(name, x)| !idle(name) || *x == 0.0), "{found:?}");
            let moving: Vec<f64> = found.iter().filter(|of| !idle(&of.0)).map(|of| of.1).collect();
            let expected: Vec<f64> = expected.iter().map(|of| of.1).collect();
            assert_close(field.name(), &moving, &expected, 1.0, 1e-12);
        }
    }
}
