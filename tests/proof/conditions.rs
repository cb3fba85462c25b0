//! Warnings at poses and masses that cost digits, and the continuation of a loop where its branches
//! cross.

use std::f64::consts::FRAC_PI_2;

use sarrus_dynamics::description::{Description, Inertial, Placement, SubmechanismKind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Compiled, DescriptionBuilder, Field::*, LinkId, Method, Model, Plan, Workspace,
};
use sarrus_proto::{FieldSet, Query, Request, Status, Warnings};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::error_by_size;
use sarrus_tests::draft::Draft;
use sarrus_tests::reference::ROBOTS;
use sarrus_tests::run::{Fields, Robot};

/// Relative error from which an answer must carry a warning.
const FEW: f64 = 1e-9;

fn is_reported<T>(of: &Fields<T>) -> bool {
    of.answer.warnings.contains(Warnings::ILL_CONDITIONED)
}

fn compiled(description: &Description) -> Compiled {
    Model::compile(description).unwrap_or_else(|errors| panic!("{errors:?}"))
}

#[test]
fn nobody_is_warned_at_ordinary_poses() {
    for name in ROBOTS {
        let case = Case::bundled(name);
        assert!(
            !case.compiled.warnings.iter().any(|warning| warning.found.contains("unequal")),
            "{name}: {:?}",
            case.compiled.warnings
        );
        let mut robot = Robot::new(case.compiled.model.clone());
        for k in 0..10 {
            let state = case.state::<f64>(k);
            let given = [(Y, state.y.as_slice()), (Yd, &state.yd), (TauY, &state.ydd)];
            let answer = robot.ask(Request::ForwardDynamics, &given, &[Ydd]).ok();
            assert!(!is_reported(&answer), "{name} at {:?}", state.y);
        }
    }
}

/// The lambda driven by its slider, whose travel ends where rocker and rod are in line.
fn lambda_by_slider(kind: SubmechanismKind) -> Compiled {
    let mut description = Case::bundled("lambda").description;
    let slider = description.joints.iter().position(|joint| joint.name == "ElbowAct").unwrap();
    description.submechanisms[0].independent = vec![slider];
    description.submechanisms[0].kind = kind;
    compiled(&description)
}

#[test]
fn whoever_loses_digits_near_a_singular_pose_is_told() {
    for kind in [SubmechanismKind::Rrpr, SubmechanismKind::Numerical] {
        let Compiled { model, exact, .. } = lambda_by_slider(kind);
        let mut robot = Robot::new(model);
        let mut reference = Robot::new(exact);
        // slider length at zero, and where rocker and rod are in line
        let end = 0.11402 + 0.36497 - 0.29739;
        let mut warned = 0;
        let mut answered = 0;
        for k in 0..150 {
            let y = end - 10f64.powf(-0.1 * f64::from(k));
            let given = [(Y, [y]), (Yd, [1.0]), (TauY, [1.0])];
            let exact_given = given.map(|(field, x)| (field, x.map(Dd::from_f64)));
            let want = [Q, Qd, Ydd, Qdd];
            let found = robot.ask(
                Request::ForwardDynamics,
                &given.each_ref().map(|(field, x)| (*field, x.as_slice())),
                &want,
            );
            if found.answer.status != Status::Ok {
                continue;
            }
            let exact = reference.ask(
                Request::ForwardDynamics,
                &exact_given.each_ref().map(|(field, x)| (*field, x.as_slice())),
                &want,
            );
            let exact = exact.ok().map(Dd::hi);
            let error = want
                .iter()
                .map(|of| error_by_size(found.get(*of), exact.get(*of), 1e-9))
                .fold(0.0, f64::max);
            assert!(
                error < FEW || is_reported(&found),
                "{kind:?}: error {error:.1e} at {:.1e} from the end, and nothing is reported",
                end - y
            );
            assert!(
                k > 10 || !is_reported(&found),
                "{kind:?}: reported at {:.1e} from the end",
                end - y
            );
            answered += 1;
            warned += i32::from(is_reported(&found));
        }
        println!("{kind:?}: {answered} of 150 answered, {warned} with a warning");
        assert!(warned > 10, "{kind:?}: {warned}");
    }
}

/// Links in a row that turn about parallel axes, with a weight at the end.
fn chain(n: usize, weight: f64) -> Description {
    let mut draft = Draft::new(1, SubmechanismKind::Serial, true);
    let mut link = 0;
    let mut joints = Vec::new();
    for k in 0..n {
        let (joint, next) = draft.turn(link, [k as f64, 0.0, 0.0], [0.0, 1.0, 0.0]);
        joints.push((joint, 0.5));
        link = next;
    }
    let active: Vec<usize> = joints.iter().map(|x| x.0).collect();
    draft.roles(&joints, &active);
    let mut description = draft.description();
    let last = description.links[link].inertial.as_mut().unwrap();
    last.mass = weight;
    last.inertia = [0.0; 6];
    last.origin = Placement { xyz: [1.0, 0.0, 0.0], rpy: [0.0; 3] };
    description
}

#[test]
fn unequal_masses_are_told_at_load_and_where_accelerations_lose_digits() {
    let mut reported = 0;
    for (weight, unequal) in [(1.0, false), (1e3, false), (1e9, true), (1e12, true)] {
        let Compiled { model, exact, warnings } = compiled(&chain(4, weight));
        assert_eq!(
            warnings.iter().any(|warning| warning.found.contains("unequal")),
            unequal,
            "{weight:e}: {warnings:?}"
        );
        let query = Query::new(
            Request::ForwardDynamics,
            FieldSet::of(&[Y, Yd, TauY]),
            FieldSet::of(&[Ydd]),
        );
        let mut reference = Robot::new(exact);
        let numbers = [0.3, -0.4, 0.5, -0.6, 0.1, 0.2, 0.3, 0.4, 1.0, 2.0, 3.0, 4.0];
        let (y, rest) = numbers.split_at(4);
        let given = [(Y, y), (Yd, &rest[..4]), (TauY, &rest[4..])]
            .map(|(field, x)| (field, x.iter().map(|x| Dd::from_f64(*x)).collect::<Vec<_>>()));
        let exact = reference
            .ask(
                Request::ForwardDynamics,
                &given.each_ref().map(|(field, x)| (*field, x.as_slice())),
                &[Ydd],
            )
            .ok()
            .map(Dd::hi);
        for method in [Method::Recursion, Method::Projection, Method::Kkt] {
            let plan = Plan::with_method(&model, &query, method).unwrap();
            let mut workspace = Workspace::for_plans(&model, [&plan]);
            let mut ydd = [0.0; 4];
            let answer = plan.run(&model, &mut workspace, &numbers, &mut ydd);
            let error = error_by_size(&ydd, exact.get(Ydd), 1e-9);
            println!(
                "weight {weight:e}, {method:?}: {} {:?}, error {error:.1e}",
                answer.status, answer.warnings
            );
            let warned = answer.warnings.contains(Warnings::ILL_CONDITIONED);
            assert!(unequal || !warned && error < FEW, "{weight:e}, {method:?}: {error:.1e}");
            assert!(warned || error < 1e-9, "{weight:e}, {method:?}: {error:.1e}");
            reported += i32::from(warned);
        }
    }
    assert!(reported > 0);
}

#[test]
fn accelerations_of_unlike_inertias_are_right_or_told_whatever_the_weight() {
    let rotors = |inertia: f64| {
        let mut of = Case::bundled("rh5v2_upper_body").description;
        for joint in
            of.submechanisms.iter().flat_map(|part| part.active.clone()).collect::<Vec<_>>()
        {
            of.joints[joint].terms.rotor_inertia = inertia;
        }
        of
    };
    let mut right = 0;
    let mut reported = 0;
    for k in 0..10 {
        for description in [chain(8, 10f64.powi(k)), rotors(10f64.powi(k))] {
            let Compiled { model, exact, .. } = compiled(&description);
            let n = model.sizes().n_vy;
            let scatter = |k: usize, size: f64| {
                (0..n).map(|i| size * (1.0 + (k * n + i) as f64 * 2.4).sin()).collect::<Vec<_>>()
            };
            let numbers = [scatter(0, 0.3), scatter(1, 1.0), scatter(2, 30.0)];
            let exactly =
                numbers.clone().map(|x| x.into_iter().map(Dd::from_f64).collect::<Vec<_>>());
            let given = [(Y, exactly[0].as_slice()), (Yd, &exactly[1]), (TauY, &exactly[2])];
            let reference =
                Robot::new(exact).ask(Request::ForwardDynamics, &given, &[Ydd]).ok().map(Dd::hi);
            let query = Query::new(
                Request::ForwardDynamics,
                FieldSet::of(&[Y, Yd, TauY]),
                FieldSet::of(&[Ydd]),
            );
            for method in Method::ALL {
                let plan = Plan::with_method(&model, &query, method).unwrap();
                let mut ydd = vec![0.0; n];
                let answer = plan.run(
                    &model,
                    &mut Workspace::for_plans(&model, [&plan]),
                    &numbers.concat(),
                    &mut ydd,
                );
                let error = error_by_size(&ydd, reference.get(Ydd), 0.0);
                let warned = answer.warnings.contains(Warnings::ILL_CONDITIONED);
                assert!(
                    answer.status != Status::Ok || warned || error < 1e-9,
                    "1e{k}, {method:?}: {error:.1e} without a word"
                );
                right += i32::from(error < 1e-9 && !warned);
                reported += i32::from(warned);
            }
        }
    }
    assert!(right > 20 && reported > 5, "{right} right without a warning, {reported} reported");
}

#[test]
fn a_parallelogram_goes_through_its_flat_pose_along_the_given_velocity() {
    let mut description = Case::bundled("four_bars_2").description;
    description.submechanisms.iter_mut().for_each(|part| part.kind = SubmechanismKind::Numerical);
    let mut robot = Robot::new(compiled(&description).model);
    let flat = -FRAC_PI_2;
    let ask = |robot: &mut Robot<f64>, y: f64, guess: &Fields<f64>, qd: Option<&[f64]>| {
        let y = [y];
        let mut given = vec![(Y, y.as_slice()), (QGuess, guess.get(Q))];
        given.extend(qd.map(|qd| (QdGuess, qd)));
        robot.ask(Request::Kinematics, &given, &[Q, Qd, Branch])
    };
    for off in [1e-2, 1e-3, 1e-5] {
        let before =
            robot.ask(Request::Kinematics, &[(Y, &[flat + off]), (Yd, &[-1.0])], &[Q, Qd]).ok();
        let y = flat - 0.7 * off;
        // without the velocity the branch is unknown
        let lost = ask(&mut robot, y, &before, None);
        assert!(
            matches!(
                lost.answer.status,
                Status::BranchChanged | Status::SingularClosure | Status::SingularIndependents
            ),
            "{}",
            lost.answer.status
        );

        let after = ask(&mut robot, y, &before, Some(before.get(Qd))).ok();
        // a parallelogram's cranks stay parallel and its couplers keep their direction: each joint
        // turns by plus or minus the first one's angle
        for (q, qd) in after.get(Q).iter().zip(before.get(Qd)) {
            assert!((q + y * qd.signum()).abs() < 1e-9, "{off:e}: {q} for {y} at {qd}");
        }
        // a velocity on neither branch is not followed
        let still: Vec<f64> = before.get(Qd).iter().map(|_| 0.0).collect();
        assert_ne!(ask(&mut robot, y, &before, Some(&still)).answer.status, Status::Ok);
    }
}

#[test]
fn accelerations_without_a_digit_are_refused() {
    let mut description = Case::bundled("four_bars_2").description;
    description.submechanisms.iter_mut().for_each(|part| part.kind = SubmechanismKind::Numerical);
    let Compiled { model, exact, .. } = compiled(&description);
    let mut robot = Robot::new(model);
    let mut reference = Robot::new(exact);
    let mut answered = 0;
    let mut refused = 0;
    for k in 0..60 {
        let y = 10f64.powf(-0.125 * f64::from(k)) - FRAC_PI_2;
        let exact = reference
            .ask(Request::Kinematics, &[(Y, &[Dd::from_f64(y)]), (Yd, &[Dd::ONE])], &[Qd, Qdd])
            .ok()
            .map(Dd::hi);
        let found = robot.ask(Request::Kinematics, &[(Y, &[y]), (Yd, &[1.0])], &[Qd, Qdd]);
        match found.answer.status {
            Status::Ok => {
                // joints turn at unit speed without acceleration
                let of = |field| {
                    (found.get(field).iter().zip(exact.get(field)))
                        .map(|(x, y)| f64::abs(x - y))
                        .fold(0.0, f64::max)
                };
                let error = f64::max(of(Qd), of(Qdd));
                assert!(error < 0.1 && (error < FEW || is_reported(&found)), "{error:.1e} at {k}");
                answered += 1;
            }
            Status::SingularClosure | Status::SingularIndependents => refused += 1,
            other => panic!("{other} at {k}"),
        }
    }
    println!("{answered} answered, {refused} refused");
    assert!(answered > 30 && refused > 10);
}

#[test]
fn actuators_that_nearly_lose_control_are_told() {
    // a Stewart platform a quarter turn about its axis
    let Compiled { model, exact, .. } = Case::bundled("stewart").compiled;
    let mut robot = Robot::new(model);
    let mut reference = Robot::new(exact);
    let mut warned = 0;
    for k in 0..13 {
        let y = [0.01, -0.02, 0.0, 0.0, 0.0, FRAC_PI_2 - 10f64.powi(-k)];
        let found = robot.ask(Request::InverseDynamics, &[(Y, &y)], &[TauU]);
        if found.answer.status != Status::Ok {
            assert_eq!(found.answer.status, Status::SingularActuation);
            continue;
        }
        let exact = reference
            .ask(Request::InverseDynamics, &[(Y, &y.map(Dd::from_f64))], &[TauU])
            .ok()
            .map(Dd::hi);
        let error = error_by_size(found.get(TauU), exact.get(TauU), 1e-9);
        assert!(error < FEW || is_reported(&found), "{error:.1e} at 1e-{k}");
        assert!(k > 3 || !is_reported(&found), "reported at 1e-{k}");
        warned += i32::from(is_reported(&found));
    }
    assert!(warned > 2, "{warned}");
}

#[test]
fn forces_of_actuators_that_nearly_lose_control_are_told_too() {
    let mut description = Case::bundled("lambda").description;
    description.gravity = [0.0; 3];
    let Compiled { model, exact, .. } = compiled(&description);
    let slider = model.tree_names().iter().position(|name| name == "ElbowAct").unwrap();
    let mut robot = Robot::new(model);
    let mut reference = Robot::new(exact);
    // where the slider stands still while the rocker turns
    let mut control =
        |y: f64| robot.ask(Request::Kinematics, &[(Y, &[y])], &[G]).ok().get(G)[slider];
    let ends = (-30..30).map(|k| 0.1 * f64::from(k));
    let mut low = ends.into_iter().find(|y| control(*y) * control(y + 0.1) < 0.0).unwrap();
    let mut high = low + 0.1;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if control(low) * control(middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    for (request, want) in [(Request::ForwardDynamics, Ydd), (Request::Map, TauY)] {
        for space in [TauU, TauQ] {
            let mut warned = 0;
            for k in 0..13 {
                let y = [low + 10f64.powi(-k)];
                let mut tau = vec![0.0; if space == TauU { 1 } else { 3 }];
                tau[if space == TauU { 0 } else { slider }] = 50.0;
                let found = robot.ask(request, &[(Y, &y), (space, &tau)], &[want]).ok();
                let tau: Vec<Dd> = tau.iter().map(|x| Dd::from_f64(*x)).collect();
                let exact = [(Y, y.map(Dd::from_f64).to_vec()), (space, tau)];
                let exact = exact.each_ref().map(|(field, x)| (*field, x.as_slice()));
                let exact = reference.ask(request, &exact, &[want]).ok().map(Dd::hi);
                let error = error_by_size(found.get(want), exact.get(want), 1e-99);
                assert!(error < FEW || is_reported(&found), "{want:?}: {error:.1e} at 1e-{k}");
                assert!(k > 3 || !is_reported(&found), "{want:?}: reported at 1e-{k}");
                warned += i32::from(is_reported(&found));
            }
            assert!(warned > 3, "{want:?} of {space:?}: {warned}");
        }
    }
}

/// A robot of an ordinary arm and one more.
fn beside_an_arm(more: impl FnOnce(&mut DescriptionBuilder)) -> Compiled {
    let mut robot = DescriptionBuilder::new("two arms");
    let bob = Inertial::point(1.0, [0.0, 0.0, -0.5]);
    robot.revolute("arm", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(bob);
    more(&mut robot);
    robot.compile().unwrap_or_else(|errors| panic!("{errors:?}"))
}

#[test]
fn large_forces_that_balance_at_one_joint_do_not_hide_what_another_loses() {
    // a lever held by a force, of any length and mass: what is left of both turns it at once
    for exponent in -9..=0 {
        let length = 10f64.powi(exponent);
        let Compiled { model, exact, .. } = beside_an_arm(|robot| {
            let lever = Inertial::point(0.7, [length, 0.0, 0.0]);
            robot.revolute("lever", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(lever);
        });
        let held = -0.7 * 9.81 * length * 0.3_f64.cos();
        let given = [(Y, [0.2, 0.3]), (TauY, [1.0, held])];
        check(&model, &exact, Request::ForwardDynamics, &given, Ydd, exponent < -2);
    }
    // springs in a loop against each other
    for exponent in 0..=9 {
        let stiffness = 10f64.powi(exponent);
        let Compiled { model, exact, .. } = beside_an_arm(|robot| {
            robot.submechanism("gear", SubmechanismKind::Transmission);
            let small = || Inertial::sphere(0.1, [0.0; 3], 0.1);
            let axis = [0.0, 1.0, 0.0];
            let wheel = robot.revolute("wheel", LinkId::BASE, axis).inertial(small());
            let wheel = wheel.spring(stiffness, 0.3).link();
            let pinion = robot.revolute("pinion", LinkId::BASE, axis).inertial(small());
            let pinion = pinion.spring(stiffness, -0.1).link();
            robot.couple(pinion, [(wheel, 1.0 / 3.0)], 0.0).independent([wheel]);
        });
        // k (y − 0.3) + k (y / 3 + 0.1) / 3
        let given = [(Y, [0.2, 0.24]), (Ydd, [1.0, 0.0])];
        check(&model, &exact, Request::InverseDynamics, &given, TauY, exponent > 4);
    }
}

/// Checks an answer against double-double; a warning only where it may come.
fn check(
    model: &Model<f64>,
    exact: &Model<Dd>,
    request: Request,
    given: &[(sarrus_proto::Field, [f64; 2])],
    want: sarrus_proto::Field,
    may_warn: bool,
) {
    let rounded: Vec<_> = given.iter().map(|(field, x)| (*field, x.as_slice())).collect();
    let found = Robot::new(model.clone()).ask(request, &rounded, &[want]).ok();
    let numbers: Vec<_> = given.iter().map(|(field, x)| (*field, x.map(Dd::from_f64))).collect();
    let numbers: Vec<_> = numbers.iter().map(|(field, x)| (*field, x.as_slice())).collect();
    let exact = Robot::new(exact.clone()).ask(request, &numbers, &[want]).ok().map(Dd::hi);
    let error = error_by_size(found.get(want), exact.get(want), 1e-99);
    println!("{want:?}: {error:.1e}, {:?}", found.answer.warnings);
    assert!(error < FEW || is_reported(&found), "{want:?}: {error:.1e} and nothing is reported");
    assert!(may_warn || !is_reported(&found), "{want:?}: {error:.1e} is reported");
}

#[test]
fn the_whole_system_tells_where_it_does_not_balance() {
    // all bodies but the slider nearly massless: M_y is well conditioned, the KKT system is not
    let mut description = Case::bundled("lambda").description;
    let slider = description.joints.iter().find(|joint| joint.name == "ElbowAct").unwrap().child;
    for (k, link) in description.links.iter_mut().enumerate() {
        if let Some(inertial) = link.inertial.as_mut().filter(|_| k != slider) {
            inertial.mass *= 1e-15;
            inertial.inertia = inertial.inertia.map(|x| x * 1e-15);
        }
    }
    let Compiled { model, exact, .. } = compiled(&description);
    let query =
        Query::new(Request::ForwardDynamics, FieldSet::of(&[Y, Yd, TauY]), FieldSet::of(&[Ydd]));
    let numbers = [0.3, 1.0, 2.0];
    let given = [Y, Yd, TauY]
        .into_iter()
        .zip(numbers)
        .map(|(field, x)| (field, [Dd::from_f64(x)]))
        .collect::<Vec<_>>();
    let given: Vec<_> = given.iter().map(|(field, x)| (*field, x.as_slice())).collect();
    let exact = Robot::new(exact).ask(Request::ForwardDynamics, &given, &[Ydd]).ok().map(Dd::hi);
    for (method, lost) in
        [(Method::Recursion, false), (Method::Projection, false), (Method::Kkt, true)]
    {
        let plan = Plan::with_method(&model, &query, method).unwrap();
        let mut ydd = [0.0];
        let answer =
            plan.run(&model, &mut Workspace::for_plans(&model, [&plan]), &numbers, &mut ydd);
        let error = error_by_size(&ydd, exact.get(Ydd), 1e-9);
        println!("{method:?}: {} {:?}, error {error:.1e}", answer.status, answer.warnings);
        assert_eq!((answer.status, error > FEW), (Status::Ok, lost));
        assert_eq!(answer.warnings.contains(Warnings::ILL_CONDITIONED), lost, "{method:?}");
    }
}

#[test]
fn an_angle_without_sine_is_no_finite_input_whatever_is_asked() {
    for name in ["lambda", "four_bars_2", "torso"] {
        let mut robot = Robot::new(Case::bundled(name).compiled.model);
        let y = vec![1e15; robot.model.sizes().n_qy];
        let zero = vec![0.0; y.len()];
        for (request, want) in [
            (Request::Kinematics, Q),
            (Request::InverseDynamics, TauY),
            (Request::ForwardDynamics, Ydd),
        ] {
            let given = [(Y, y.as_slice()), (TauY, &zero)];
            let given = if request == Request::ForwardDynamics { &given[..] } else { &given[..1] };
            assert_eq!(
                robot.ask(request, given, &[want]).answer.status,
                Status::NonFiniteInput,
                "{name}, {request:?}"
            );
        }
    }
}
