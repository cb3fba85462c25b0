//! Numerical closures never fail silently: ranks, idle degrees of freedom, reactions, singular
//! poses, unreachable targets.

mod mechanisms;
mod rows;
mod turns;

use std::f64::consts::FRAC_PI_6;

use faer::Mat;
use sarrus_dynamics::description::SubmechanismKind::Numerical;
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{
    Compiled, Field, FieldSet, LinkId, Model, Plan, Query, QueryOptions, Request, Status, Workspace,
};
use sarrus_report::robots::small::{
    LOOSE, RHOMBUS, Slide, Turn, X as X_AXIS, Y as Y_AXIS, Z as Z_AXIS, cut, joint, mechanism,
    reach_of_lambda, toggle,
};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{matrix_product, product, transposed};

use Field::*;
use mechanisms::{bricard, door, four_bar, lambda, lambda_of_size, loop_in_space};

const BASE: LinkId = LinkId::BASE;

fn robot(compiled: &Compiled) -> Robot<f64> {
    Robot::new(compiled.model.clone())
}

fn warned(compiled: &Compiled) -> String {
    compiled.warnings.iter().map(|fault| format!("{fault:?}\n")).collect()
}

fn at(robot: &mut Robot<f64>, y: &[f64], want: &[Field]) -> Fields<f64> {
    let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(want));
    robot.ask_for(query.with_options(QueryOptions::SEARCH), &[(Y, y)])
}

#[test]
fn a_planar_four_bar_closes_alike_with_two_three_and_six_rows() {
    let [two, three, six] = ["xy", "xyz", "xyzabc"].map(|which| four_bar(LOOSE, which));
    assert_eq!(warned(&two), "");
    for (of, rank, rows) in [(&three, 2, 3), (&six, 3, 6)] {
        assert!(warned(of).contains("redundant constraint axes"), "{}", warned(of));
        assert_eq!((of.model.closures()[0].rank, of.model.closures()[0].rows), (rank, rows));
    }
    let mut robots = [robot(&two), robot(&three), robot(&six)];
    for k in 0..20 {
        let y = 0.03 * f64::from(k) - 0.3;
        let [a, b, c] = [0, 1, 2].map(|i| {
            let x = robots[i].ask(
                Request::InverseDynamics,
                &[(Y, &[y]), (Yd, &[0.7]), (Ydd, &[0.2])],
                &[Q, Qd, Qdd, TauY, MY, Branch],
            );
            x.ok()
        });
        // both ends of the chain turn like the crank and the coupler
        for field in [Q, Qd, Qdd] {
            assert!(
                error_by_size(&b.get(field)[..3], &a.get(field)[..3], 1.0) < 1e-13,
                "{field:?}"
            );
            assert!(
                error_by_size(&c.get(field)[..2], &a.get(field)[..2], 1.0) < 1e-13,
                "{field:?}"
            );
        }
        assert!(error_by_size(b.get(TauY), a.get(TauY), 1.0) < 1e-12);
        assert_eq!(b.get(Branch), a.get(Branch));
    }
}

#[test]
fn bricards_linkage_moves_with_its_redundant_row_whole_or_cut() {
    for open in [false, true] {
        let compiled = bricard(open);
        let closure = &compiled.model.closures()[0];
        assert_eq!((closure.rows, closure.rank), if open { (5, 4) } else { (6, 5) });
        assert!(warned(&compiled).contains("redundant constraint axes"));
        let mut robot = robot(&compiled);
        for k in 0..30 {
            let y = 0.034 * f64::from(k) - 0.5;
            let x = at(&mut robot, &[y], &[Residual, K, G]).ok();
            assert!(
                x.get(Residual)[0] < 1e-13,
                "all rows hold, also the one that is left out: {:?}",
                x.get(Residual)
            );
            assert!(largest(&product(x.get(K), x.get(G))) < 1e-12, "K G = 0");
        }
    }
}

/// K_d with scaled rows, its left null space (columns) and the row units, for a robot in which
/// every joint but the first depends.
fn scaled_rows(compiled: &Compiled, rows_K: &[f64], units: &[f64]) -> (Mat<f64>, Mat<f64>) {
    let n = compiled.model.sizes().n_v;
    let rows = units.len();
    let K_d = Mat::from_fn(rows, n - 1, |r, a| rows_K[r * n + a + 1] * units[r]);
    let svd = K_d.svd().unwrap();
    let S = svd.S().column_vector();
    let left = svd.U();
    let rank = (0..S.nrows()).filter(|i| S[*i] > 1e-9 * S[0]).count();
    let null = Mat::from_fn(rows, rows - rank, |r, a| left[(r, rank + a)]);
    (K_d, null)
}

#[test]
fn reactions_have_the_least_norm_and_the_determinate_ones_are_told() {
    let planar = four_bar(LOOSE, "xyz");
    let whole = four_bar(LOOSE, "xyzabc");
    let mut counts = (0, 0);
    for (compiled, angular) in [(planar, 0), (whole, 3), (bricard(false), 3), (bricard(true), 2)] {
        let n = compiled.model.sizes().n_v;
        let rows = compiled.model.sizes().n_c;
        let length = compiled.model.closures()[0].length;
        let units: Vec<f64> =
            (0..rows).map(|r| if r < rows - angular { 1.0 / length } else { 1.0 }).collect();
        let mut robot = robot(&compiled);
        for k in 0..10 {
            let y = [0.05 * f64::from(k) - 0.31];
            let yd = [0.8];
            let ydd = [-0.4];
            let x = robot
                .ask(
                    Request::InverseDynamics,
                    &[(Y, &y), (Yd, &yd), (Ydd, &ydd)],
                    &[K, Lambda, LambdaDeterminate, TauQ, TauU],
                )
                .ok();
            let lambda = x.get(Lambda);
            let reported = x.get(LambdaDeterminate);
            // the loops supply the part of the force that the actuator does not
            let mut rest = x.get(TauQ).to_vec();
            rest[0] -= x.get(TauU)[0];
            let given = transposed(x.get(K), lambda, n);
            assert!(error_by_size(&given, &rest, 0.0) < 1e-11, "Kᵀ λ = τ: {given:?} {rest:?}");
            // least norm: no component in the null space, by another decomposition
            let (K_d, null) = scaled_rows(&compiled, x.get(K), &units);
            let scaled: Vec<f64> = lambda.iter().zip(&units).map(|(x, unit)| x / unit).collect();
            for a in 0..null.ncols() {
                let along: f64 = (0..rows).map(|r| null[(r, a)] * scaled[r]).sum();
                assert!(
                    along.abs() < 1e-11 * largest(&scaled),
                    "{along} along a null vector of {scaled:?}"
                );
                // a null vector changes exactly the reactions reported as indeterminate
                let unseen: f64 = (0..n - 1)
                    .map(|j| (0..rows).map(|r| K_d[(r, j)] * null[(r, a)]).sum::<f64>().abs())
                    .sum();
                assert!(unseen < 1e-10);
            }
            for r in 0..rows {
                let share = (0..null.ncols()).map(|a| null[(r, a)].powi(2)).sum::<f64>().sqrt();
                assert_eq!(
                    reported[r] == 1.0,
                    share < 1e-6,
                    "row {r} shares {share:.1e}, reported {}",
                    reported[r]
                );
                counts = if reported[r] == 1.0 {
                    (counts.0 + 1, counts.1)
                } else {
                    (counts.0, counts.1 + 1)
                };
            }
        }
    }
    println!("{} reactions determinate, {} shared", counts.0, counts.1);
    assert!(counts.0 > 0 && counts.1 > 0);
}

#[test]
fn a_rod_that_may_spin_is_locked_by_name_and_changes_nothing_else() {
    let spinning = door(true);
    let plain = door(false);
    assert!(warned(&spinning).contains("idle joints"), "{}", warned(&spinning));
    assert_eq!(spinning.model.closures()[0].idle.len(), 1);
    let locked = spinning
        .model
        .tree_names()
        .iter()
        .position(|name| *name == spinning.model.closures()[0].idle[0])
        .unwrap();
    assert!((1..=3).contains(&locked), "one of the three turns of the ball");
    assert_eq!(warned(&plain), "");
    let mut a = robot(&spinning);
    let mut b = robot(&plain);
    for k in 0..20 {
        let y = [0.05 * f64::from(k) - 0.5];
        let [x, z] = [&mut a, &mut b].map(|robot| {
            robot
                .ask(
                    Request::Kinematics,
                    &[(Y, &y), (Yd, &[0.9]), (Ydd, &[0.3])],
                    &[Q, Qd, Qdd, U, Ud, Udd, G, Residual],
                )
                .ok()
        });
        for field in [U, Ud, Udd] {
            assert!(
                error_by_size(x.get(field), z.get(field), 1.0) < 1e-12,
                "{field:?}: the slider knows nothing of the spin"
            );
        }
        assert_eq!(
            (x.get(Q)[locked], x.get(Qd)[locked], x.get(Qdd)[locked], x.get(G)[locked]),
            (0.0, 0.0, 0.0, 0.0)
        );
    }
    // the answer keeps the guess
    let mut guess = at(&mut a, &[0.1], &[Q]).ok().get(Q).to_vec();
    let slider = at(&mut a, &[0.12], &[U]).ok().get(U)[0];
    guess[locked] += 0.2;
    let x = a.ask(Request::Kinematics, &[(Y, &[0.12]), (QGuess, &guess)], &[Q, U, Residual]).ok();
    assert_eq!(x.get(Q)[locked], guess[locked]);
    assert!((x.get(U)[0] - slider).abs() < 1e-12 && x.get(Residual)[0] < 1e-13);
}

#[test]
fn a_freedom_that_does_something_is_an_error_of_mobility() {
    // a planar five-bar, and a spherical one
    let flat = {
        let mut of = mechanism(Numerical);
        let a = joint(&mut of, BASE, Turn, [0.0, 0.0, 0.0], Z_AXIS);
        let b = joint(&mut of, a, Turn, [-0.3, 0.8, 0.0], Z_AXIS);
        let c = joint(&mut of, BASE, Turn, [1.0, 0.0, 0.0], Z_AXIS);
        let d = joint(&mut of, c, Turn, [1.2, 0.9, 0.0], Z_AXIS);
        cut(&mut of, b, d, [0.6, 1.5, 0.0], "xy");
        of.independent([a]).active([a]).compile()
    };
    let round = {
        let mut of = mechanism(Numerical);
        let centre = [0.0; 3];
        let a = joint(&mut of, BASE, Turn, centre, Z_AXIS);
        let b = joint(&mut of, a, Turn, centre, [0.3, 0.1, 1.0]);
        let c = joint(&mut of, BASE, Turn, centre, X_AXIS);
        let d = joint(&mut of, c, Turn, centre, [1.0, 0.4, 0.2]);
        cut(&mut of, b, d, centre, "bc");
        of.independent([a]).active([a]).compile()
    };
    // a sleeve that slides loose along its rod
    let sleeve = {
        let mut of = mechanism(Numerical);
        let door = joint(&mut of, BASE, Turn, [1.0, 0.0, 0.0], Z_AXIS);
        let foot = [-0.6, 0.3, 0.2];
        let along = [1.7, 0.7, 0.3];
        let mut rod = joint(&mut of, BASE, Turn, foot, X_AXIS);
        rod = joint(&mut of, rod, Turn, foot, Y_AXIS);
        rod = joint(&mut of, rod, Slide, foot, along);
        rod = joint(&mut of, rod, Slide, [-0.2, 0.3, 0.2], along);
        cut(&mut of, door, rod, [1.1, 1.0, 0.5], "xyz");
        of.independent([door]).compile()
    };
    for (what, found) in
        [("a five-bar", flat), ("a spherical five-bar", round), ("a loose sleeve", sleeve)]
    {
        let error = found.err().unwrap_or_else(|| panic!("{what} was taken"));
        assert!(format!("{error:?}").contains("mobility 2"), "{what}: {error:?}");
    }
}

#[test]
fn every_kind_of_cut_is_found_independent_at_every_scale() {
    let mut seeded = Seeded::new(71);
    for (which, joints) in [
        ("xyz", 4),
        ("xyzc", 5),
        ("xyzbc", 6),
        ("yzabc", 6),
        ("yzbc", 5),
        ("xyzabc", 7),
        ("abc", 4),
        ("x", 2),
    ] {
        for scale in [1e-3, 1.0, 1e3] {
            for _ in 0..4 {
                let compiled = loop_in_space(&mut seeded, joints, which, scale)
                    .unwrap_or_else(|error| panic!("{which} {scale}: {error}"));
                let info = &compiled.model.closures()[0];
                assert_eq!(
                    (info.rank, info.rows, warned(&compiled).as_str()),
                    (which.len(), which.len(), ""),
                    "{which} {scale}"
                );
                let mut robot = robot(&compiled);
                let y = vec![0.02; compiled.model.sizes().n_qy];
                let x = at(&mut robot, &y, &[Residual, K, G, SigmaMin, Branch]);
                if x.answer.status == Status::Ok {
                    assert!(x.get(Residual)[0] < 1e-13);
                    let open = largest(&matrix_product(
                        x.get(K),
                        x.get(G),
                        compiled.model.sizes().n_v,
                        y.len(),
                    ));
                    assert!(
                        open < 1e-10 * largest(x.get(K)) * largest(x.get(G)).max(1.0),
                        "{which} {scale}: {open:.1e} {:?}",
                        x.get(SigmaMin)
                    );
                }
            }
        }
    }
}

#[test]
fn beyond_its_reach_a_loop_says_so_with_the_nearest_y() {
    let mut counts = [0; Status::ALL.len()];
    let mut check = |robot: &mut Robot<f64>, reach: f64, beyond: f64, name: &str| {
        let x = at(robot, &[reach + beyond], &[Q, NearestY, Residual, SigmaMin, GoodIndependents]);
        counts[x.answer.status as usize] += 1;
        assert_ne!(x.answer.status, Status::Ok, "{name} {beyond:.1e} beyond");
        let reported = x.get(NearestY)[0];
        assert!(
            (reported - reach).abs() < 1e-9,
            "{name} {beyond:.1e} beyond: nearest {reported}, truly {reach}, off by {:.1e}",
            reported - reach
        );
        assert!(x.get(SigmaMin)[0] < 1e-2, "{name}: {:?}", x.get(SigmaMin));
        // the crank is a bad independent there, some dependent a good one
        assert_eq!(x.get(GoodIndependents)[0], 0.0, "{name} {beyond:.1e} beyond");
        assert_eq!(x.get(GoodIndependents).iter().sum::<f64>(), 1.0);
        x.answer.status
    };
    let out = toggle();
    let mut bar = robot(&four_bar(LOOSE, "xy"));
    let mut whole = robot(&four_bar(LOOSE, "xyzabc"));
    let meet = reach_of_lambda();
    let mut lambdas = [1e-3, 1.0, 1e3].map(|scale| robot(&lambda_of_size(scale)));
    let mut unnamed = 0;
    for beyond in [0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
        let mut seen = vec![
            check(&mut bar, out, beyond, "four-bar"),
            check(&mut whole, out, beyond, "four-bar of six rows"),
        ];
        seen.extend(lambdas.iter_mut().map(|lambda| check(lambda, meet, -beyond, "lambda")));
        unnamed += seen.iter().filter(|status| **status != Status::Unreachable).count();
    }
    for (status, count) in
        Status::ALL.iter().map(|status| (status, counts[*status as usize])).filter(|x| x.1 > 0)
    {
        println!("{status}: {count}");
    }
    assert_eq!(unnamed, 0, "beyond the reach is unreachable");
}

#[test]
fn at_a_toggle_the_independents_are_singular_and_a_good_one_is_named() {
    let out = toggle();
    let mut bar = robot(&four_bar(LOOSE, "xy"));
    for beyond in [0.0, 1e-13, -1e-13] {
        let x = at(&mut bar, &[out + beyond], &[Q, Qd, G, SigmaMin, GoodIndependents]);
        println!("{beyond:.0e}: {}", x.answer.status);
        assert!(
            [Status::SingularIndependents, Status::Unreachable].contains(&x.answer.status),
            "{}",
            x.answer.status
        );
        assert_eq!(x.get(GoodIndependents)[0], 0.0);
        assert!(x.get(SigmaMin)[0] < 1e-4, "{:?}", x.get(SigmaMin));
    }
    // a rhombus folded flat has a K of lower rank
    let flat = four_bar(RHOMBUS, "xy");
    let x = at(
        &mut robot(&flat),
        &[std::f64::consts::FRAC_PI_2],
        &[Q, Qd, G, SigmaMin, GoodIndependents],
    );
    assert_eq!(x.answer.status, Status::SingularClosure);
    assert!(
        x.get(GoodIndependents)[..3].iter().all(|x| x.is_nan()),
        "no set is good: {:?}",
        x.get(GoodIndependents)
    );
}

#[test]
fn a_platform_that_its_legs_cannot_hold_names_the_motion_that_none_controls() {
    let case = Case::bundled("stewart");
    let model: &Model<f64> = &case.compiled.model;
    let n = model.sizes().n_vy;
    let mut robot = Robot::new(model.clone());
    let matrix = |robot: &mut Robot<f64>, y: &[f64]| at(robot, y, &[GU]).ok().get(GU).to_vec();
    let det = |of: &[f64]| Mat::from_fn(n, n, |i, j| of[i * n + j]).determinant();
    // turns about each axis until the determinant changes its sign
    let mut found = 0;
    for axis in 3..6 {
        let pose = |turn: f64| {
            let mut y = vec![0.0; n];
            (y[0], y[1], y[axis]) = (0.01, -0.02, turn);
            y
        };
        let first = det(&matrix(&mut robot, &pose(0.0)));
        let Some(k) = (1..60).find(|k| {
            let x = at(&mut robot, &pose(0.03 * f64::from(*k)), &[GU]);
            x.answer.status == Status::Ok && det(x.get(GU)) * first < 0.0
        }) else {
            continue;
        };
        let mut low = 0.03 * f64::from(k - 1);
        let mut high = 0.03 * f64::from(k);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if det(&matrix(&mut robot, &pose(middle))) * first < 0.0 {
                high = middle
            } else {
                low = middle
            }
        }
        let y = pose(low);
        let x = robot.ask(Request::InverseDynamics, &[(Y, &y)], &[TauU, Uncontrolled, SigmaMin]);
        assert_eq!(x.answer.status, Status::SingularActuation, "at {low} about axis {axis}");
        assert!(x.get(TauU).iter().all(|x| x.is_nan()));
        let twist = x.get(Uncontrolled);
        let norm: f64 = twist.iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-12, "unit length: {twist:?}");
        let moved = product(&matrix(&mut robot, &y), twist);
        assert!(largest(&moved) < 1e-10, "no leg moves along {twist:?}: {moved:?}");
        assert!(x.get(SigmaMin)[0] > 1e-3, "the closure itself is sound");
        found += 1;
    }
    assert!(found > 0, "no singular pose met");
}

#[test]
fn near_singular_poses_every_answer_is_right_or_has_a_name() {
    let out = toggle();
    let meet = f64::acos((0.81 + 1.0 - 0.09) / 1.8) - std::f64::consts::FRAC_PI_2;
    let mut silent = 0;
    for (name, compiled, reach) in [
        ("four-bar", four_bar(LOOSE, "xy"), out),
        ("six rows", four_bar(LOOSE, "xyzabc"), out),
        ("lambda", lambda(), meet),
        ("Bricard", bricard(false), -FRAC_PI_6),
        ("Bricard, open", bricard(true), -FRAC_PI_6),
    ] {
        let mut seeded = Seeded::new(5);
        let mut robot = robot(&compiled);
        let mut exact = Robot::new(compiled.exact.clone());
        let branch = at(&mut robot, &[0.0], &[Branch]).ok().get(Branch).to_vec();
        let mut counts = [0; Status::ALL.len()];
        let mut closest = f64::INFINITY;
        for _ in 0..400 {
            // within rounding on either side
            let y = reach + seeded.sign() * 10f64.powf(seeded.within(-15.0, 0.0));
            let x = at(&mut robot, &[y], &[Q, G, Branch, Residual, CondKd]);
            counts[x.answer.status as usize] += 1;
            if x.answer.status == Status::Ok {
                closest = f64::min(closest, (y - reach).abs());
            }
            if x.answer.status != Status::Ok {
                silent += usize::from(!x.get(Q).iter().chain(x.get(G)).all(|x| x.is_nan()));
                continue;
            }
            let finite = x.get(Q).iter().chain(x.get(G)).all(|x| x.is_finite());
            let reference = exact.ask(Request::Kinematics, &[(Y, &[Dd::from(y)])], &[Q]);
            let near = reference.answer.status == Status::Ok && {
                let reference: Vec<f64> = reference.get(Q).iter().map(|q| q.hi()).collect();
                error_by_size(x.get(Q), &reference, 1.0)
                    < 1e-15 * x.get(CondKd)[0].powi(2).max(10.0)
            };
            if !finite || x.get(Branch) != branch || x.get(Residual)[0] > 1e-12 || !near {
                println!("{name} at {y}, {:.1e} from its reach: ok but wrong", y - reach);
                silent += 1;
            }
        }
        let reported =
            Status::ALL.iter().map(|status| (status, counts[*status as usize])).filter(|x| x.1 > 0);
        println!(
            "{name}, answered up to {closest:.1e} from its reach: {}",
            reported
                .map(|(status, count)| format!("{count} {status}"))
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
    println!("silent failures: {silent}");
    assert_eq!(silent, 0);
}

#[test]
fn nothing_allocates_whatever_fails() {
    let want = [Q, Residual, SigmaMin, NearestY, GoodIndependents, Uncontrolled, Branch];
    let mut seen = Vec::new();
    for compiled in
        [four_bar(LOOSE, "xyz"), four_bar(LOOSE, "xyzabc"), bricard(false), door(true), lambda()]
    {
        let model = &compiled.model;
        let state = Query::new(Request::Kinematics, FieldSet::of(&[Y]), FieldSet::of(&want));
        let forces = Query::new(
            Request::InverseDynamics,
            FieldSet::of(&[Y]),
            FieldSet::of(&[Lambda, LambdaDeterminate, Uncontrolled]),
        );
        let mut workspace = Workspace::new(model);
        for query in [state, forces] {
            let plan = Plan::new(model, &query).unwrap();
            let mut output = vec![0.0; plan.want().len()];
            for k in -8..=8 {
                let before = crate::allocation::calls();
                let answer = plan.run(model, &mut workspace, &[0.4 * f64::from(k)], &mut output);
                assert_eq!(crate::allocation::calls(), before, "{}", answer.status);
                seen.push(answer.status);
            }
        }
    }
    assert!(seen.contains(&Status::Ok) && seen.contains(&Status::Unreachable), "{seen:?}");
}
