//! Failed requests have the status of their cause, and NaN in place of every invalid number.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Field, FieldSet, Model, Plan, PlanScalar, Query, QueryOptions, Request, Status, Workspace,
};
use sarrus_models::{Options, Source, load};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::error_by_size;
use sarrus_tests::plans::{every_plan, input, motion, some_plans};
use sarrus_tests::random::Text;
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use Field::*;

/// Checks that an answer has only the numbers that its status allows.
fn assert_honest<T: PlanScalar>(plan: &Plan, status: Status, output: &[T]) {
    for slot in plan.want().slots() {
        let numbers = &output[slot.range()];
        let query = plan.query();
        let is_negative_zero = |x: &T| x.to_f64().to_bits() == (-0.0_f64).to_bits();
        assert!(
            !numbers.iter().any(is_negative_zero),
            "{status} with {numbers:?} in {:?} of {query:?}",
            slot.field
        );
        if status == Status::Ok {
            // without a limit, a force or another vertex there is no number
            let has_gaps = slot.field.is_of_motors() || slot.field == BaseParameters;
            let may_miss = |x: f64| has_gaps && x.is_nan();
            assert!(
                numbers.iter().map(|x| x.to_f64()).all(|x| x.is_finite() || may_miss(x)),
                "ok with {numbers:?} in {:?} of {query:?}",
                slot.field
            );
        } else if !slot.field.survives_failure()
            || status == Status::NonFiniteInput
            || status == Status::WrongSize
        {
            let empty = slot.field == Iterations || numbers.iter().all(|x| x.to_f64().is_nan());
            assert!(empty, "{status} with {numbers:?} in {:?} of {query:?}", slot.field);
        }
    }
}

#[test]
fn a_number_that_is_not_finite_is_refused_wherever_it_stands() {
    Ledger::over(robots().iter().take(9).chain(robots().iter().skip(9).step_by(16)), |case, _| {
        let model = &case.compiled.model;
        let mut seeded = Seeded::new(case.seed);
        let mut robot = Robot::new(model.clone());
        let mut workspace = Workspace::new(model);
        let motion = motion(&mut robot, &case.state(0));
        for plan in every_plan(model, &mut seeded) {
            let good = input(case, &plan, &motion, &mut seeded);
            let mut output = vec![0.0; plan.want().len()];
            for slot in plan.given().slots().iter().filter(|slot| !slot.range().is_empty()) {
                for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let mut broken = good.clone();
                    broken[slot.offset + seeded.below(slot.range().len())] = bad;
                    let answer = plan.run(model, &mut workspace, &broken, &mut output);
                    assert_eq!(answer.status, Status::NonFiniteInput);
                    assert_honest(&plan, answer.status, &output);
                }
            }
        }
    });
}

#[test]
fn a_failed_answer_holds_no_number_and_a_good_one_no_nan() {
    Ledger::over(robots(), |case, _| {
        let model = &case.compiled.model;
        let mut seeded = Seeded::new(case.seed + 1);
        let mut robot = Robot::new(model.clone());
        let mut workspace = Workspace::new(model);
        let plans = some_plans(model, &mut seeded, 5);
        let motion = motion(&mut robot, &case.state(1));
        for _ in 0..60 {
            let plan = &plans[seeded.below(plans.len())];
            let mut numbers = input(case, plan, &motion, &mut seeded);
            // from near by to very far and huge
            let size = [1.0, 3.0, 30.0, 1e3, 1e9, 1e150][seeded.below(6)];
            numbers.iter_mut().for_each(|x| *x *= size * seeded.within(0.5, 1.0));
            let mut output = vec![7.0; plan.want().len()];
            let answer = plan.run(model, &mut workspace, &numbers, &mut output);
            if answer.status != Status::Ok || size < 1e3 {
                assert_honest(plan, answer.status, &output);
            }
        }
    });
}

#[test]
fn wrong_sizes_and_another_robots_plan_are_refused() {
    let [a, b] = [&robots()[0], &robots()[2]].map(|case| &case.compiled.model);
    for plan in every_plan(a, &mut Seeded::new(1)) {
        let given = plan.given().len();
        let want = plan.want().len();
        for (n, m) in [(given + 1, want), (given, want + 1), (0, want), (given, 0)] {
            if (n, m) != (given, want) {
                let mut output = vec![1.0; m];
                let answer = plan.run(a, &mut Workspace::new(a), &vec![0.0; n], &mut output);
                assert_eq!(answer.status, Status::WrongSize);
                assert!(output.iter().all(|x| x.is_nan()));
            }
        }
        let mut output = vec![1.0; want];
        assert_eq!(
            plan.run(b, &mut Workspace::new(b), &vec![0.0; given], &mut output).status,
            Status::WrongModel
        );
        assert!(output.iter().all(|x| x.is_nan()));
        let mut output = vec![1.0; want];
        assert_eq!(
            plan.run(a, &mut Workspace::new(b), &vec![0.0; given], &mut output).status,
            Status::WrongModel
        );
        assert!(output.iter().all(|x| x.is_nan()));
    }
}

#[test]
fn a_plan_of_another_model_of_the_same_sizes_is_refused() {
    // one mechanism on two planets: equal sizes, other forces
    let [earth, moon] = [[0.0, 0.0, -9.81], [0.0, 0.0, -1.62]].map(|gravity| {
        load(&Source::Bundled("lambda".into()), &Options { gravity, ..Options::default() })
            .unwrap()
            .compiled
    });
    assert_eq!(earth.model.sizes(), moon.model.sizes());
    for plan in every_plan(&earth.model, &mut Seeded::new(2)) {
        let input = vec![0.1; plan.given().len()];
        for (model, mut workspace) in [
            (&moon.model, Workspace::new(&moon.model)),
            (&earth.model, Workspace::new(&moon.model)),
            (&moon.model, Workspace::new(&earth.model)),
        ] {
            let mut output = vec![1.0; plan.want().len()];
            let answer = plan.run(model, &mut workspace, &input, &mut output);
            assert_eq!(answer.ok().unwrap_err().status, Status::WrongModel);
            assert!(output.iter().all(|x| x.is_nan()));
        }
        // a model in another scalar counts as the same model
        let input: Vec<Dd> = input.iter().map(|x| Dd::from(*x)).collect();
        let mut output = vec![Dd::from(0.0); plan.want().len()];
        let answer = plan.run(&earth.exact, &mut Workspace::new(&earth.exact), &input, &mut output);
        assert_ne!(answer.status, Status::WrongModel);
    }
}

#[test]
fn a_quaternion_that_is_not_of_unit_length_is_a_bad_request() {
    let case = robots().iter().find(|case| case.floats()).unwrap();
    let mut robot = Robot::new(case.compiled.model.clone());
    let at = case
        .compiled
        .model
        .independent_q_names()
        .iter()
        .position(|name| name.ends_with("/qx"))
        .unwrap();
    let good = case.state::<f64>(0).y;
    let mut ask = |factor: f64| {
        let mut y = good.clone();
        y[at..at + 4].iter_mut().for_each(|x| *x *= factor);
        robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, FramePose])
    };
    for factor in [0.0, 0.5, 1.0 + 2e-6, 1e200] {
        assert_eq!(ask(factor).answer.status, Status::BadRequest, "{factor}");
    }
    let near = ask(1.0 + 5e-7).ok();
    let exact = ask(1.0).ok();
    assert!(error_by_size(near.get(Q), exact.get(Q), 1.0) < 1e-15, "normalised");
}

/// A lambda in the plane x, y: ground 1, arm, pin at an angle, pin `offset` from the slider's line.
fn lambda(type_name: &str, arm: f64, offset: f64) -> Case {
    let pin = [0.0, arm];
    let heading = arm.atan2(-1.0) - (offset / 1f64.hypot(arm)).asin();
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" \
             ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, xyz: [f64; 2], axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child \
             link=\"{name}_link\"/><origin xyz=\"{:?} {:?} 0\"/><axis xyz=\"{axis}\"/><limit \
             lower=\"-9\" upper=\"9\" effort=\"9\" velocity=\"9\"/></joint>",
            xyz[0], xyz[1]
        )
    };
    let along = format!("{:?} {:?} 0", heading.cos(), heading.sin());
    let urdf = format!(
        "<robot name=\"lambda\">{}{}{}{}{}{}{}<joint name=\"pin\" type=\"fixed\"><parent \
         link=\"rocker_link\"/><child link=\"pin_link\"/><origin xyz=\"{:?} {:?} 0\"/></joint>\
         <link name=\"pin_link\"/></robot>",
        "<link name=\"base\"/>",
        link("rocker_link"),
        link("stator_link"),
        link("slider_link"),
        joint("rocker", "revolute", "base", [0.0, 0.0], "0 0 1"),
        joint("stator", "revolute", "base", [1.0, 0.0], "0 0 1"),
        joint("slider", "prismatic", "stator_link", [-0.2, 0.1], &along),
        pin[0],
        pin[1],
    );
    let yaml = format!(
        "submechanisms:\n- type: {type_name}\n  contextual_name: elbow\n  jointnames_spanningtree: \
         [rocker, stator, slider]\n  jointnames_independent: [rocker]\n  jointnames_active: \
         [slider]\n  loop_constraints:\n  - cut_joint: pin\n    predecessor_body: rocker_link\n    \
         successor_body: slider_link\n    constraint_axes:\n    - \
         {{name: x, axis: [0, 0, 0, 1, 0, 0]}}\n    - {{name: y, axis: [0, 0, 0, 0, 1, 0]}}\n"
    );
    let text = Text { reach: vec![("rocker".into(), 1.0)], ..Text::of(&urdf, &yaml) };
    Case::of_text(&text, 0, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Follows a path in short steps, each from the pose before; returns the last pose if every step
/// succeeds.
fn followed<T: PlanScalar>(model: &Model<T>, y: &[T], steps: u32) -> Option<Vec<T>> {
    let mut robot = Robot::new(model.clone());
    let mut guess: Option<Vec<T>> = None;
    for k in 0..=steps {
        let at: Vec<T> =
            y.iter().map(|y| *y * T::from_f64(f64::from(k) / f64::from(steps))).collect();
        let mut given = vec![(Y, at.as_slice())];
        given.extend(guess.as_deref().map(|guess| (QGuess, guess)));
        let x = robot.ask(Request::Kinematics, &given, &[Q]);
        if x.answer.status != Status::Ok {
            return None;
        }
        guess = Some(x.get(Q).to_vec());
    }
    guess
}

#[test]
fn a_lambda_that_cannot_reach_says_so() {
    // the pin comes nearer to the stator's pivot than the slider's line may pass it, for y within a
    // small distance of −π/2
    for kind in ["RRPR", "NUMERICAL"] {
        let case = lambda(kind, 0.9, 0.3);
        let mut robot = Robot::new(case.compiled.model.clone());
        let mut seen = Vec::new();
        for k in -200..=200 {
            let y = f64::from(k) * 0.015;
            let d = ((0.9 * (y + std::f64::consts::FRAC_PI_2).cos() - 1.0).powi(2)
                + (0.9 * (y + std::f64::consts::FRAC_PI_2).sin()).powi(2))
            .sqrt();
            let x = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q, Qd, Residual]);
            if d < 0.3 - 1e-6 {
                // Newton's method cannot always detect that there is no solution
                let reported = [
                    Status::Unreachable,
                    if kind == "RRPR" { Status::Unreachable } else { Status::NotConverged },
                ];
                assert!(reported.contains(&x.answer.status), "{kind} y = {y}: {}", x.answer.status);
                assert!(x.get(Q).iter().all(|x| x.is_nan()));
            } else if x.answer.status == Status::Ok {
                assert!(
                    x.get(Residual)[0] < 1e-12,
                    "{kind} y = {y}: ok but open by {}",
                    x.get(Residual)[0]
                );
            } else {
                // beyond the gap only another branch may exist
                assert!(y < -1.2, "{kind} y = {y}: {} at a distance of {d}", x.answer.status);
            }
            seen.push(x.answer.status);
        }
        assert!(seen.contains(&Status::Ok) && seen.contains(&Status::Unreachable), "{kind}");
    }
}

#[test]
fn what_is_answered_far_from_zero_is_where_the_path_leads() {
    let far: Vec<Case> = robots()
        .iter()
        .filter(|case| !case.is_open() && !case.floats() && case.seed % 3 == 0)
        .map(Case::clone)
        .collect();
    let mut ok = 0;
    let mut failed = 0;
    let mut lost = 0;
    Ledger::over(&far, |case, ledger| {
        let exact = &case.compiled.exact;
        let mut robot = Robot::new(case.compiled.model.clone());
        let mut seeded = Seeded::new(case.seed + 9);
        for k in 0..4 {
            let near = case.state::<Dd>(k).y;
            let size = Dd::from(seeded.within(1.0, 6.0));
            let y: Vec<Dd> = near.iter().map(|y| *y * size).collect();
            let given: Vec<f64> = y.iter().map(|y| y.to_f64()).collect();
            let x = robot.ask(Request::Kinematics, &[(Y, &given)], &[Q, CondKd]);
            if x.answer.status != Status::Ok {
                failed += 1;
                continue;
            }
            ok += 1;
            let y: Vec<Dd> = given.iter().map(|y| Dd::from(*y)).collect();
            let Some(path) = followed(exact, &y, 100) else {
                // closed forms keep the sign of their root on any path
                if case
                    .compiled
                    .model
                    .closures()
                    .iter()
                    .all(|x| x.kind != sarrus_dynamics::ClosureKind::Numerical)
                {
                    continue;
                }
                lost += 1;
                ledger.note("ok where the path cannot be followed", case, 1.0, 0.5);
                continue;
            };
            let mine: Vec<Dd> = x.get(Q).iter().map(|q| Dd::from(*q)).collect();
            // the angle may differ by whole turns
            let turn = std::f64::consts::TAU;
            let difference = mine
                .iter()
                .zip(&path)
                .map(|(a, b)| (*a - *b).to_f64())
                .fold(0.0, |worst: f64, d| {
                    worst.max((d - turn * (d / turn).round()).abs().min(d.abs()))
                });
            let cond = x.get(CondKd)[0];
            ledger.note(
                "the branch of the path",
                case,
                difference,
                1e3 * <f64 as Real>::EPSILON * cond + case.contradiction(),
            );
        }
    });
    println!("{ok} ok, {failed} without an answer, {lost} beyond their path");
}

#[test]
fn actuators_that_cannot_tell_the_pose_do_not_pretend_to() {
    // a mechanism whose actuators and degrees of freedom differ in number has no solution from u
    // without a guess
    Ledger::over(
        robots().iter().filter(|case| case.name.contains("four-bar w")),
        |case, ledger| {
            let mut robot = Robot::new(case.compiled.model.clone());
            let y = case.state::<f64>(0).y;
            let u = robot.ask(Request::Kinematics, &[(Y, &y)], &[U]).ok().get(U).to_vec();
            let x = robot.ask(Request::Kinematics, &[(U, &u)], &[Y]);
            if x.answer.status == Status::Ok {
                ledger.compare(
                    "y from the actuators that there are",
                    case,
                    x.get(Y),
                    &y,
                    1.0,
                    1e-9,
                );
            }
        },
    );
}

#[test]
fn the_nearest_y_off_the_straight_ways_is_nearer_than_their_last_pose() {
    let loaded = load(&Source::Bundled("wrist".to_owned()), &Options::default()).unwrap();
    let mut robot = Robot::new(loaded.compiled.model);
    let base = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[NearestY]))
        .with_options(QueryOptions::SEARCH);
    let far = |from: &[f64], to: [f64; 2]| (from[0] - to[0]).hypot(from[1] - to[1]);
    for target in [[1.0, 1.0], [1.2, 1.2], [2.0, 2.0], [2.0, -2.0], [3.0, 3.0]] {
        let failed = robot.ask_for(base, &[(Y, &target)]);
        assert_eq!(failed.answer.status, Status::Unreachable);
        let nearest = failed.get(NearestY).to_vec();
        let there = robot.ask(Request::Kinematics, &[(Y, &nearest)], &[Q]).answer;
        assert_eq!(there.status, Status::Ok, "{target:?}: {nearest:?}");
        // the straight way ends at 0.507
        let last = [0.507 * target[0].signum(), 0.507 * target[1].signum()];
        assert!(far(&nearest, target) < far(&last, target), "{target:?}: {nearest:?}");
    }
}

#[test]
fn a_failure_tells_how_open_the_loop_stayed_where_that_is_asked() {
    let case = lambda("NUMERICAL", 0.9, 0.3);
    let mut robot = Robot::new(case.compiled.model.clone());
    let want = FieldSet::of(&[Q, Residual, NearestY]);
    let query = Query::new(Request::Kinematics, FieldSet::EMPTY, want);
    // without a search the nearest y is not sought
    let bounded = robot.ask_for(query, &[(Y, &[-1.5])]);
    assert!(bounded.answer.status != Status::Ok && bounded.get(NearestY)[0].is_nan());
    let x = robot.ask_for(query.with_options(QueryOptions::SEARCH), &[(Y, &[-1.5])]);
    assert_ne!(x.answer.status, Status::Ok);
    assert!(x.get(Residual)[0] > 1e-6, "residual {:?}", x.get(Residual));
    let nearest = x.get(NearestY)[0];
    // at that point the independents fail; slightly nearer to the guess they do not
    let before = nearest * (1.0 - 1e-6);
    assert!(
        robot.ask(Request::Kinematics, &[(Y, &[before])], &[Q]).answer.status == Status::Ok,
        "nearest y {nearest}"
    );
}
