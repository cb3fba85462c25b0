//! The rows of cuts: moments of hinges, rows of any length, screws, loops far from the origin.

use std::f64::consts::TAU;

use sarrus_dynamics::description::JointKind::Spherical;
use sarrus_dynamics::description::{Placement, SubmechanismKind::Numerical};
use sarrus_dynamics::{
    CompileError, Compiled, Field, FieldSet, ImplicitForm, LinkId, Query, QueryOptions, Request,
    Status, Warnings,
};
use sarrus_report::robots::small::{LOOSE, Slide, Turn, Z as Z_AXIS, cut, joint, mechanism};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::rigid::{add, cross, dot};
use sarrus_tests::run::Fields;
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{inner, matrix_product, product, transposed};

use super::{BASE, robot, warned};
use Field::*;

/// Six turning joints in space, closed by a hinge along the root's z at zero; its ends.
fn closed_by_a_hinge(seeded: &mut Seeded) -> (Compiled, [LinkId; 2]) {
    let mut of = mechanism(Numerical);
    let mut ends = [BASE; 2];
    let mut crank = BASE;
    for k in 0..6 {
        let end = &mut ends[k % 2];
        *end = joint(&mut of, *end, Turn, seeded.vector(1.0), seeded.direction());
        crank = if k == 0 { *end } else { crank };
    }
    cut(&mut of, ends[0], ends[1], seeded.vector(1.0), "abxyz");
    (of.independent([crank]).active([crank]).compile().unwrap(), ends)
}

/// Axis k of a frame with this quaternion.
fn turned(quaternion: &[f64], k: usize) -> [f64; 3] {
    let v = [quaternion[0], quaternion[1], quaternion[2]];
    let axis = [0, 1, 2].map(|i| f64::from(i == k));
    let across = cross(v, axis);
    add(add(axis, 2.0 * quaternion[3], across), 2.0, cross(v, across))
}

/// The forces of a hinge are a force and a moment on its axes, however far it has turned: its rows
/// are those of the angular velocity between its ends.
#[test]
fn the_moments_of_a_hinge_are_dual_to_its_angular_velocity() {
    let mut seeded = Seeded::new(91);
    let mut largest_turn = 0.0_f64;
    let mut states = 0;
    for _ in 0..20 {
        let (compiled, ends) = closed_by_a_hinge(&mut seeded);
        let n = compiled.model.sizes().n_v;
        let links = ends.map(|link| link.index() as u16);
        let mut robot = robot(&compiled);
        for y in [-1.2, -0.6, 0.5, 1.1] {
            let want = [Q, Qd, Qdd, K, KBias, JacobianTree, FramePose, TauQ, TauU, Lambda];
            let query = Query::new(Request::InverseDynamics, FieldSet::EMPTY, FieldSet::of(&want));
            let x = robot
                .ask_for(query.with_frames(&links), &[(Y, &[y]), (Yd, &[0.8]), (Ydd, &[-0.4])]);
            if x.answer.status != Status::Ok {
                continue;
            }
            states += 1;
            // frames are parallel to the root at zero
            let axis = |link: usize, r: usize| turned(&x.get(FramePose)[7 * link + 3..], r);
            largest_turn = largest_turn.max(dot(axis(0, 0), axis(1, 0)).clamp(-1.0, 1.0).acos());
            let rows = x.get(K);
            let of_link =
                |link: usize, i: usize, j: usize| x.get(JacobianTree)[(6 * link + i) * n + j];
            for (r, row) in rows.chunks(n).take(2).enumerate() {
                let velocity = |j: usize| [0, 1, 2].map(|i| of_link(1, i, j) - of_link(0, i, j));
                let of_velocity: Vec<f64> = (0..n).map(|j| dot(axis(0, r), velocity(j))).collect();
                assert!(error_by_size(row, &of_velocity, 1.0) < 1e-12, "{y}: row {r}");
            }
            let size = largest(rows) * largest(x.get(Qd));
            assert!(largest(&product(rows, x.get(Qd))) < 1e-12 * size, "K q̇ = 0");
            let size = largest(rows) * (largest(x.get(Qd)).powi(2) + largest(x.get(Qdd)));
            let second = product(rows, x.get(Qdd));
            assert!(error_by_size(&second, x.get(KBias), size) < 1e-11, "K q̈ = k at {y}");
            let mut rest = x.get(TauQ).to_vec();
            rest[0] -= x.get(TauU)[0];
            let given = transposed(rows, x.get(Lambda), n);
            assert!(error_by_size(&given, &rest, 1.0) < 1e-9, "M q̈ + C = τ + Kᵀ λ at {y}");

            // and so do those of the implicit form
            let mut form = ImplicitForm::new(&compiled.model);
            let mut tau = vec![0.0; n];
            tau[0] = x.get(TauU)[0];
            let mut qdd = vec![0.0; n];
            let [q, qd] = [Q, Qd].map(|field| x.get(field));
            form.accelerations(&compiled.model, q, qd, &tau, &[], (0.0, 0.0), &mut qdd);
            let size = largest(x.get(Lambda));
            assert!(error_by_size(form.lambda(), x.get(Lambda), size) < 1e-9, "λ at {y}");
        }
    }
    assert!(states > 20 && largest_turn > 1.0, "{states} states, a turn of {largest_turn}");
}

/// A four-bar with an axis that leans, so that its redundant row along z opens; that row is
/// written with a length.
fn leaning(length: f64) -> Compiled {
    let [a, b, c, d] = LOOSE.map(|[x, y]| [x, y, 0.0]);
    let mut of = mechanism(Numerical);
    let crank = joint(&mut of, BASE, Turn, a, [0.0, 8e-5, 1.0]);
    let coupler = joint(&mut of, crank, Turn, b, Z_AXIS);
    let rocker = joint(&mut of, BASE, Turn, d, Z_AXIS);
    let cut = of.cut("cut0", coupler, rocker).at(c);
    let rows = [("x", [1.0, 0.0]), ("y", [0.0, 1.0])];
    let cut =
        rows.iter().fold(cut, |cut, (name, [x, y])| cut.row(*name, [0.0, 0.0, 0.0, *x, *y, 0.0]));
    cut.row("z", [0.0, 0.0, 0.0, 0.0, 0.0, length]);
    of.independent([crank]).active([crank]).compile().unwrap()
}

#[test]
fn a_redundant_row_of_any_length_tells_of_the_same_opening() {
    let of_length = |length: f64| {
        let compiled = leaning(length);
        let mut robot = robot(&compiled);
        let x = robot
            .ask(
                Request::InverseDynamics,
                &[(Y, &[0.2]), (Yd, &[0.7]), (Ydd, &[0.2])],
                &[Residual, Q, K, KBias, Lambda, SigmaMin],
            )
            .ok();
        (warned(&compiled), x)
    };
    let (unit_warning, unit) = of_length(1.0);
    assert!(unit_warning.contains("redundant axes that do not hold"), "{unit_warning}");
    assert!(unit.answer.warnings.contains(Warnings::LOOP_OPEN));
    let n = unit.get(Q).len();
    for length in [1e-6, 1e-3, 1e6] {
        let (warning, x) = of_length(length);
        assert_eq!(warning, unit_warning, "{length}");
        assert!(x.answer.warnings.contains(Warnings::LOOP_OPEN), "{length}");
        for field in [Q, Residual, SigmaMin] {
            assert_eq!(x.get(field), unit.get(field), "{length} {field:?}");
        }
        // K and k of the row are in the declared length, and λ is dual to them
        for (field, columns, power) in [(K, n, 1), (KBias, 1, 1), (Lambda, 1, -1)] {
            let declared = &x.get(field)[2 * columns..];
            let expected: Vec<f64> =
                unit.get(field)[2 * columns..].iter().map(|x| x * length.powi(power)).collect();
            let size = largest(&expected);
            assert!(error_by_size(declared, &expected, size) < 1e-15, "{length} {field:?}");
        }
    }
}

/// A four-bar whose every row has a length.
#[test]
fn rows_of_any_length_close_alike() {
    let of_length = |length: f64| {
        let [a, b, c, d] = LOOSE.map(|[x, y]| [x, y, 0.0]);
        let mut of = mechanism(Numerical);
        let crank = joint(&mut of, BASE, Turn, a, Z_AXIS);
        let coupler = joint(&mut of, crank, Turn, b, Z_AXIS);
        let rocker = joint(&mut of, BASE, Turn, d, Z_AXIS);
        let cut = of.cut("cut0", coupler, rocker).at(c);
        let cut = cut.row("x", [0.0, 0.0, 0.0, length, 0.0, 0.0]);
        cut.row("y", [0.0, 0.0, 0.0, 0.0, length, 0.0]);
        let compiled = of.independent([crank]).active([crank]).compile().unwrap();
        robot(&compiled).ask(Request::Kinematics, &[(Y, &[0.3])], &[Q]).ok()
    };
    let unit = of_length(1.0);
    for length in [1e-9, 1e-6, 1e6] {
        assert_eq!(of_length(length).get(Q), unit.get(Q), "{length}");
    }
}

/// A loop in space closed by all rows of a weld, whose rows lean against those before them by an
/// angle.
fn leaning_rows(seed: u64, sine: f64) -> Result<Compiled, CompileError> {
    let mut seeded = Seeded::new(seed);
    let mut of = mechanism(Numerical);
    let mut end = BASE;
    let mut crank = BASE;
    for k in 0..7 {
        end = joint(&mut of, end, Turn, seeded.vector(1.0), seeded.direction());
        crank = if k == 0 { end } else { crank };
    }
    let mut cut = of.cut("cut0", BASE, end).at(seeded.vector(1.0));
    for k in 0..6 {
        let row = std::array::from_fn(|i| match i {
            _ if i == k => {
                if k % 3 == 0 {
                    1.0
                } else {
                    sine
                }
            }
            _ if i < k && i / 3 == k / 3 => 1.0,
            _ => 0.0,
        });
        cut = cut.row(format!("r{k}"), row);
    }
    of.independent([crank]).active([crank]).compile()
}

#[test]
fn rows_that_lean_against_each_other_keep_their_digits() {
    let given: [(Field, &[f64]); 3] = [(Y, &[0.05]), (Yd, &[0.8]), (Ydd, &[-0.4])];
    let want = [Q, Qd, Qdd, G, GBias, K, KBias, TauQ, TauU, Lambda, LambdaDeterminate, SigmaMin];
    let ask = |compiled: &Compiled| robot(compiled).ask(Request::InverseDynamics, &given, &want);
    let mut compared = 0;
    for seed in 0..12 {
        let upright = ask(&leaning_rows(seed, 1.0).unwrap());
        // some of the loops do not reach this y, or hardly
        if upright.answer.status != Status::Ok || upright.get(SigmaMin)[0] < 0.03 {
            continue;
        }
        compared += 1;
        for sine in [0.1, 1e-2, 1e-3, 3e-4] {
            let compiled = leaning_rows(seed, sine).unwrap();
            compare_leaning(&ask(&compiled).ok(), &upright, &compiled, sine);
        }
        // below that the file's rounding may be what sets them apart
        let words = leaning_rows(seed, 5e-5).unwrap_err().to_string();
        let expected = "cut0/r1 leaves the span of the rows before it by 5.0e-5 rad";
        assert!(words.contains(expected), "{words}");
    }
    assert!(compared > 2, "{compared} robots");
}

/// Answers of rows that lean against those of the same robot with upright rows.
fn compare_leaning(x: &Fields<f64>, upright: &Fields<f64>, compiled: &Compiled, sine: f64) {
    for field in [Q, Qd, Qdd, G, GBias, TauQ, TauU] {
        let size = largest(upright.get(field));
        let error = error_by_size(x.get(field), upright.get(field), size);
        assert!(error < 1e-10, "{sine} {field:?}: {error:.1e}");
    }
    assert!(x.get(SigmaMin)[0] > 0.3 * upright.get(SigmaMin)[0], "{sine}");
    // K, k and λ are those of the declared rows
    let n = x.get(Q).len();
    let rows = x.get(K);
    for r in 0..6 {
        let by = if r % 3 == 0 { 1.0 } else { sine };
        let mut expected: Vec<f64> = axis_row(upright, r, n).iter().map(|x| by * x).collect();
        for k in r / 3 * 3..r {
            expected.iter_mut().zip(axis_row(upright, k, n)).for_each(|(x, y)| *x += y);
        }
        let error = error_by_size(&rows[r * n..][..n], &expected, 1.0);
        assert!(error < 1e-13, "{sine} {r}: {error:.1e}");
    }
    let open = product(rows, x.get(Qd));
    assert!(largest(&open) < 1e-12 * largest(rows) * largest(x.get(Qd)));
    let second = product(rows, x.get(Qdd));
    assert!(error_by_size(&second, x.get(KBias), largest(x.get(Qdd))) < 1e-11, "K q̈ = k");
    let mut rest = x.get(TauQ).to_vec();
    rest[0] -= x.get(TauU)[0];
    let forces = transposed(rows, x.get(Lambda), n);
    let size = largest(rows) * largest(x.get(Lambda));
    assert!(error_by_size(&forces, &rest, size) < 1e-12, "M q̈ + C = τ + Kᵀ λ at {sine}");
    assert!(x.get(LambdaDeterminate).iter().all(|x| *x == 1.0));
    let mut form = ImplicitForm::new(&compiled.model);
    let mut tau = vec![0.0; n];
    tau[0] = x.get(TauU)[0];
    let mut qdd = vec![0.0; n];
    let [q, qd] = [Q, Qd].map(|field| x.get(field));
    form.accelerations(&compiled.model, q, qd, &tau, &[], (0.0, 0.0), &mut qdd);
    let size = largest(x.get(Lambda));
    assert!(error_by_size(form.lambda(), x.get(Lambda), size) < 1e-9, "λ at {sine}");
}

/// The k-th axis's own row, of rows that are sums of axes up to theirs.
fn axis_row(upright: &Fields<f64>, k: usize, n: usize) -> Vec<f64> {
    let row = |k: usize| &upright.get(K)[k * n..][..n];
    match k % 3 {
        0 => row(k).to_vec(),
        _ => row(k).iter().zip(row(k - 1)).map(|(a, b)| a - b).collect(),
    }
}

/// A spindle with a nut that slides on the base; with the rows of a hinge's axis or without.
fn screw(per_radian: f64, which: &str) -> Compiled {
    let mut of = mechanism(Numerical);
    let spindle = joint(&mut of, BASE, Turn, [0.3, 0.0, 0.0], Z_AXIS);
    let nut = joint(&mut of, BASE, Slide, [0.3, 0.0, 0.5], Z_AXIS);
    cut(&mut of, spindle, nut, [0.3, 0.0, 0.5], which);
    let tied = of.cut("screw", spindle, nut).at([0.3, 0.0, 0.5]);
    tied.row("screw", [0.0, 0.0, per_radian, 0.0, 0.0, 1.0]);
    of.independent([spindle]).active([spindle]).compile().unwrap()
}

#[test]
fn the_nut_of_a_screw_follows_every_turn() {
    let per_radian = 0.01;
    for which in ["x", "abxy"] {
        let compiled = screw(per_radian, which);
        let mut robot = robot(&compiled);
        for turns in [0.1, 0.49, 0.51, 1.2, -0.7, -3.3, 11.8] {
            let y = turns * TAU;
            let search = QueryOptions::SEARCH;
            let query =
                Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[Q, G, Residual]));
            let x = robot.ask_for(query.with_options(search), &[(Y, &[y])]).ok();
            // the nut does not turn, so that it turns back on the spindle
            assert!((x.get(Q)[1] - per_radian * y).abs() < 1e-13, "{turns}: {:?}", x.get(Q));
            assert!((x.get(G)[1] - per_radian).abs() < 1e-14 && x.get(Residual)[0] < 1e-13);
        }
    }
}

#[test]
fn a_screw_whose_turns_no_joint_counts_is_warned_of() {
    let mut of = mechanism(Numerical);
    let ball = joint(&mut of, BASE, Spherical, [0.3, 0.0, 0.0], Z_AXIS);
    let nut = joint(&mut of, BASE, Slide, [0.3, 0.0, 0.5], Z_AXIS);
    let tied = of.cut("screw", ball, nut).at([0.3, 0.0, 0.5]);
    tied.row("screw", [0.0, 0.0, 0.01, 0.0, 0.0, 1.0]);
    let compiled = of.independent([ball]).active([nut]).compile().unwrap();
    assert!(warned(&compiled).contains("a screw along whose line no joint turns"));
    assert!(!warned(&screw(0.01, "x")).contains("a screw"));
}

/// A four-bar, on a base that is far from the root.
fn four_bar_at(offset: [f64; 3]) -> Compiled {
    let mut of = mechanism(Numerical);
    let base = of.fixed("far", BASE).origin(offset).link();
    let at = |[x, y]: [f64; 2]| [x / 3.0, y / 3.0, 0.0];
    let [a, b, c, d] = LOOSE.map(at);
    let mut turn = |parent: LinkId, origin: [f64; 3]| {
        let name = format!("j{}", of.n_joints());
        of.joint(name, Turn, parent).origin(origin).axis(Z_AXIS).link()
    };
    let from = |p: [f64; 3], q: [f64; 3]| [q[0] - p[0], q[1] - p[1], 0.0];
    let crank = turn(base, a);
    let coupler = turn(crank, from(a, b));
    let rocker = turn(base, d);
    let place = |p: [f64; 3]| Placement { xyz: from(p, c), rpy: [0.0; 3] };
    let cut = of.cut("cut0", coupler, rocker).placements(place(b), place(d));
    let cut = cut.row("x", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    cut.row("y", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    of.independent([crank]).active([crank]).compile().unwrap()
}

#[test]
fn a_loop_far_from_the_root_keeps_its_digits() {
    let want = [Q, G, GBias, Qd, Qdd, K, KBias];
    let state = |offset: [f64; 3], y: f64| {
        let given: [(Field, &[f64]); 3] = [(Y, &[y]), (Yd, &[0.8]), (Ydd, &[-0.3])];
        robot(&four_bar_at(offset)).ask(Request::Kinematics, &given, &want).ok()
    };
    for y in [-0.2, 0.25] {
        let near = state([0.0; 3], y);
        let far = state([4.5e6, -3.1e6, 2.2e6], y);
        for field in want {
            let error = error_by_size(far.get(field), near.get(field), 1.0);
            assert!(error < 1e-13, "{field:?} at {y}: {error:.1e}");
        }
        let open = matrix_product(far.get(K), far.get(G), 3, 1);
        assert!(inner(&open, &open) < 1e-26);
    }
}
