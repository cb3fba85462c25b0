//! Mechanisms with known answers: parallelograms, couplings, the lambda's table, poses that are
//! unreachable or indeterminate.

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{ClosureKind, Compiled, Field, Model, Request, Status};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add};
use sarrus_tests::run::Robot;

use super::{X, Y_AXIS, Z, answers, compile, numerical, robots};
use Field::*;

/// One parallelogram or two on each other; `off` is the error of the first one's shape.
fn parallelograms(seed: u64, straight: bool, off: f64) -> Draft {
    let mut draft = Draft::new(seed, Kind::ParallelogramChain, straight);
    let mut base = 0;
    let mut at = [0.0; 3];
    let mut independent = Vec::new();
    for k in 0..2 {
        let side = if straight {
            [0.25, 1.0, 0.0]
        } else {
            [draft.seeded.within(-0.3, 0.3), draft.seeded.within(0.6, 1.0), 0.0]
        };
        let rail = if straight {
            [0.5, 0.0, 0.0]
        } else {
            [draft.seeded.within(0.3, 0.6), draft.seeded.within(-0.1, 0.1), 0.0]
        };
        let spoilt = if k == 0 { off } else { 0.0 };
        let (crank, crank_link) = draft.turn(base, at, Z);
        let (_, coupler) = draft.turn(crank_link, add(at, 1.0, side), Z);
        let (follower, follower_link) = draft.turn(base, add(at, 1.0 + spoilt, rail), Z);
        let pin = add(add(at, 1.0, side), 1.0, rail);
        let (p, s) = if draft.seeded.chance(0.5) {
            (coupler, follower_link)
        } else {
            (follower_link, coupler)
        };
        let five = !straight && draft.seeded.chance(0.3);
        draft.cut(
            p,
            s,
            pin,
            if five { &[X, Y_AXIS] } else { &[] },
            if five { &[X, Y_AXIS, Z] } else { &[X, Y_AXIS] },
        );
        independent.push((if draft.seeded.chance(0.5) { crank } else { follower }, 0.4));
        (base, at) = (coupler, add(at, 1.0, side));
    }
    let active: Vec<usize> = independent.iter().map(|x| x.0).collect();
    draft.roles(&independent, &active);
    draft
}

#[test]
fn parallelograms_are_linear_and_only_parallelograms_are() {
    for seed in 0..20 {
        let draft = parallelograms(seed, seed % 4 == 0, 0.0);
        let form = compile(&draft.description());
        let newton = numerical(&draft.description());
        assert_eq!(form.model.closures()[0].kind, ClosureKind::Analytic);
        let y = [0.4, -0.3];
        let yd = [1.0, -2.0];
        let mine = answers(&mut robots(&form).0, &y, &yd).unwrap();
        let reference = answers(&mut robots(&newton).0, &y, &yd).unwrap();
        assert!(mine.0.get(GBias).iter().all(|x| *x == 0.0));
        assert!(
            mine.0.get(G).iter().all(|x| x.abs() < 1e-15 || (x.abs() - 1.0).abs() < 1e-15),
            "{:?}",
            mine.0.get(G)
        );
        // a cut of five rows has redundant ones, whose forces are arbitrary
        for field in [Q, G, GBias, K] {
            let error = error_by_size(mine.0.get(field), reference.0.get(field), 1.0);
            assert!(
                error < 1e-13 * reference.0.get(CondKd)[0],
                "seed {seed} {field:?}: {error:.1e}"
            );
        }
        // a small error is corrected by Newton's method, a larger one also reported
        let polished = compile(&parallelograms(seed, seed % 4 == 0, 1e-5).description());
        assert_eq!(polished.model.closures()[0].kind, ClosureKind::Analytic);
        let state = answers(&mut robots(&polished).0, &y, &yd).unwrap();
        assert!(
            state.0.get(Residual)[0] < 1e-12 && largest(state.0.get(GBias)) > 0.0,
            "{:?}",
            state.0.get(Residual)
        );
        let spoilt = compile(&parallelograms(seed, seed % 4 == 0, 0.2).description());
        assert_eq!(spoilt.model.closures()[0].kind, ClosureKind::Numerical);
        assert!(
            spoilt.warnings.iter().any(|x| x.to_string().contains("no parallelogram")),
            "{:?}",
            spoilt.warnings
        );
    }
}

/// Joints in a row with couplings (joint, masters and multipliers, offset).
fn geared(
    joints: usize,
    couplings: &[(usize, &[(usize, f64)], f64)],
    independent: &[usize],
    active: &[usize],
) -> Description {
    let mut draft = Draft::new(5, Kind::Differential, true);
    (0..joints).for_each(|k| {
        draft.turn(0, [k as f64, 0.0, 0.0], Z);
    });
    for (j, terms, offset) in couplings {
        let masters: Vec<_> = terms.iter().map(|term| (draft.moved_by(term.0), term.1)).collect();
        draft.robot.couple(draft.moved_by(*j), masters, *offset);
    }
    let links = |joints: &[usize]| joints.iter().map(|j| draft.moved_by(*j)).collect::<Vec<_>>();
    let independent = links(independent);
    let active = links(active);
    draft.robot.independent(independent).active(active);
    draft.description()
}

#[test]
fn couplings_hold_in_any_order_and_all_at_once() {
    let ask = |description: &Description, y: [f64; 2]| {
        let model = compile(description).model;
        assert_eq!(model.closures()[0].kind, ClosureKind::Analytic);
        let mut robot = Robot::new(model);
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, G, U]).ok();
        // the actuators alone give the same pose
        let back = robot.ask(Request::Kinematics, &[(U, x.get(U))], &[Y]).ok();
        assert!(error_by_size(back.get(Y), &y, 1.0) < 1e-15);
        (x.get(Q).to_vec(), x.get(G).to_vec())
    };
    // a differential head: left = roll + pitch, right = roll − pitch; and the same one with its
    // wheels as independents, where no row has a single unknown
    let head = geared(
        4,
        &[(2, &[(0, 1.0), (1, 1.0)], 0.0), (3, &[(0, 1.0), (1, -1.0)], 0.0)],
        &[0, 1],
        &[2, 3],
    );
    let wheels = geared(
        4,
        &[(0, &[(2, 0.5), (3, 0.5)], 0.0), (1, &[(2, 0.5), (3, -0.5)], 0.0)],
        &[0, 1],
        &[2, 3],
    );
    for description in [&head, &wheels] {
        let (q, jacobian) = ask(description, [0.5, 0.125]);
        assert_eq!(q, [0.5, 0.125, 0.625, 0.375]);
        assert_eq!(jacobian, [1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, -1.0]);
    }
    // both sets of couplings at once are redundant: cage and wheels
    let mut both = head.clone();
    both.joints[1].coupling = wheels.joints[1].coupling.clone();
    assert_eq!(ask(&both, [0.5, 0.125]).0, [0.5, 0.125, 0.625, 0.375]);
    // a chain with offsets, in reverse order
    let chain = geared(4, &[(0, &[(1, 2.0)], 0.5), (1, &[(2, -0.5)], 0.25)], &[2, 3], &[0, 3]);
    assert_eq!(ask(&chain, [1.0, 0.0]).0, [0.0, -0.25, 1.0, 0.0]);
}

#[test]
fn couplings_that_determine_nothing_or_contradict_each_other_are_faults() {
    // two joints that follow only each other are indeterminate
    let idle = geared(3, &[(1, &[(2, 1.0)], 0.0), (2, &[(1, 1.0)], 0.0)], &[0], &[0]);
    assert!(Model::compile(&idle).is_err());
    let contradicting = geared(
        3,
        &[(1, &[(0, 1.0)], 0.0), (2, &[(1, 1.0)], 0.0), (0, &[(2, 1.0)], 0.1)],
        &[0],
        &[0],
    );
    let error = Model::compile(&contradicting).unwrap_err();
    assert!(
        error.errors.iter().any(|x| x.to_string().contains("correct the offsets of the couplings")),
        "{error:?}"
    );
}

/// A lambda in the plane x, y with the slider turning about the arm's pin, cut at the base; at zero
/// the arm is perpendicular to the base line.
fn table_lambda(arm: f64, base: f64, out_of_plane: f64) -> Compiled {
    let mut draft = Draft::new(1, Kind::Rrpr, true);
    let pin = [0.0, arm, 0.0];
    let pivot = [base, 0.0, out_of_plane];
    let along = [base, -arm, 0.0];
    let (rocker, rocker_link) = draft.turn(0, [0.0; 3], Z);
    let (_, stator_link) = draft.turn(rocker_link, pin, Z);
    let (slider, slider_link) = draft.slide(stator_link, pin, along);
    draft.cut(0, slider_link, pivot, &[], &[X, Y_AXIS]);
    draft.roles(&[(rocker, 1.0)], &[slider]);
    let mut description = draft.description();
    for (j, axis) in [(0, Z), (1, [0.0, 0.0, -1.0]), (2, along)] {
        description.joints[j].axis = axis;
    }
    compile(&description)
}

#[allow(clippy::excessive_precision, reason = "published numbers stand as they were published")]
#[test]
fn the_lambda_has_the_lengths_and_rates_of_its_closed_form() {
    const TABLE: [[f64; 7]; 3] = [
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
            std::f64::consts::FRAC_PI_2,
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
    let arm = 0.11402f64;
    let base = 0.36497f64;
    let mut robot = Robot::new(table_lambda(arm, base, 0.0).model);
    let length0 = arm.hypot(base);
    let q20 = TABLE[1][1];
    // on both sides of the slider's length at the URDF's zero of RH5's elbow, where another program
    // flips the sign
    for [y, q2, q3, G2, G3, g2, g3] in TABLE {
        // at zero the arm is perpendicular to the base line
        let at = y - std::f64::consts::FRAC_PI_2;
        let x = robot.ask(Request::Kinematics, &[(Y, &[at]), (Yd, &[1.0])], &[Q, G, GBias]).ok();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "y {y}: {a} instead of {b}");
        near(x.get(Q)[1], q2 - q20);
        near(x.get(Q)[2], q3 - length0);
        near(x.get(G)[1], G2);
        near(x.get(G)[2], G3);
        near(x.get(GBias)[1], g2);
        near(x.get(GBias)[2], g3);
    }
}

#[test]
fn a_slider_keeps_its_sign_through_every_length() {
    // another program flips the sign of q2 at 0.2974 m
    let mut robot = Robot::new(table_lambda(0.11402, 0.36497, 0.0).model);
    let mut last: Option<Vec<f64>> = None;
    for k in 0..2000 {
        let y = -1.4 + 2.8 * f64::from(k) / 2000.0;
        let x = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q, Residual]).ok();
        assert!(x.get(Residual)[0] < 1e-15);
        if let Some(last) = &last {
            assert!(x.get(Q).iter().zip(last).all(|(a, b)| (a - b).abs() < 3e-3), "jump at {y}");
        }
        last = Some(x.get(Q).to_vec());
    }
}

#[test]
fn a_pin_out_of_the_plane_changes_no_length() {
    let [flat, lifted] = [0.0, 0.0015].map(|out| table_lambda(0.11402, 0.36497, out).model);
    for y in [-1.0, 0.3, 1.2] {
        let q = |model: &Model<f64>| {
            Robot::new(model.clone())
                .ask(Request::Kinematics, &[(Y, &[y])], &[Q])
                .ok()
                .get(Q)
                .to_vec()
        };
        // with the spatial distance, as in another program, the error would be 4.5e-6 m
        assert!(error_by_size(&q(&lifted), &q(&flat), 1.0) < 1e-15);
    }
}

/// A four-bar by its points, with crank, coupler and rocker; the crank is independent.
fn four_bar(points: [Vector; 4]) -> Draft {
    let mut draft = Draft::new(3, Kind::FourBar, true);
    let (crank, crank_link) = draft.turn(0, points[0], Z);
    let (_, coupler) = draft.turn(crank_link, points[1], Z);
    let (rocker, rocker_link) = draft.turn(0, points[3], Z);
    draft.cut(coupler, rocker_link, points[2], &[], &[X, Y_AXIS]);
    draft.roles(&[(crank, 1.0)], &[rocker]);
    draft
}

#[test]
fn what_a_plane_loop_cannot_reach_or_determine_is_told() {
    let status = |compiled: &Compiled, y: f64| {
        let x = Robot::new(compiled.model.clone()).ask(
            Request::Kinematics,
            &[(Y, &[y]), (Yd, &[1.0])],
            &[Q, G, GBias],
        );
        assert_eq!(
            x.answer.status == Status::Ok,
            x.get(Q).iter().chain(x.get(G)).all(|x| x.is_finite())
        );
        x.answer.status
    };
    // a crank of 2 on a base of 1 with short links, which cannot reach a distance of 3
    let bar = compile(
        &four_bar([[0.0; 3], [1.5, 1.0, 0.0], [1.75, 0.0, 0.0], [1.0, 0.0, 0.0]]).description(),
    );
    assert_eq!(status(&bar, 0.0), Status::Ok);
    assert_eq!(status(&bar, 2.0), Status::Unreachable);
    // a slider moves J1 onto the line of both links exactly: 0.6 + 0.8 in quarter steps
    let mut draft = Draft::new(4, Kind::SliderCrank, true);
    let (slider, block) = draft.slide(0, [0.0; 3], X);
    let (_, first) = draft.turn(block, [0.0; 3], Z);
    let (_, second) = draft.turn(0, [1.0, 0.0, 0.0], Z);
    draft.cut(first, second, [0.5, 1.0, 0.0], &[], &[X, Y_AXIS]);
    draft.roles(&[(slider, 1.0)], &[slider]);
    let mut description = draft.description();
    description.joints[0].axis = X;
    let toggle = compile(&description);
    assert_eq!(status(&toggle, 0.25), Status::Ok);
    assert_eq!(status(&toggle, -2.0), Status::Unreachable);
    // the aligned links coincide: the first joint meets the second one's, and the links may turn
    // freely
    assert_eq!(status(&toggle, 1.0), Status::SingularClosure);
    // a slider-crank whose rod is perpendicular to its line, where the slider cannot follow
    let mut draft = Draft::new(4, Kind::SliderCrank, true);
    let (crank, crank_link) = draft.turn(0, [0.0; 3], Z);
    let (_, rod) = draft.turn(crank_link, [3.0, 0.0, 0.0], Z);
    let (slider, block) = draft.slide(0, [0.0; 3], Y_AXIS);
    draft.cut(rod, block, [0.0, 4.0, 0.0], &[], &[X, Y_AXIS]);
    draft.roles(&[(crank, 1.0)], &[slider]);
    let slider_crank = compile(&draft.description());
    assert_eq!(status(&slider_crank, 1.0), Status::Ok);
}
