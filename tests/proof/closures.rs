//! Each closed form against Newton's method on the same mechanism, in both scalars, on geometries anyhow.

use sarrus_dynamics::description::{Coupling, Description, JointKind, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::{Dd, Real, Scalar};
use sarrus_dynamics::{ClosureKind, Compiled, Field, Model, Request, Status};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::draft::Draft;
use sarrus_tests::rigid::{Vector, add, cross, dot, norm, unit};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;

use Field::*;

const X: Vector = [1.0, 0.0, 0.0];
const Y_AXIS: Vector = [0.0, 1.0, 0.0];
const Z: Vector = [0.0, 0.0, 1.0];

fn compile(description: &Description) -> Compiled {
    Model::compile(description).unwrap_or_else(|error| panic!("{}: {error:?}", description.name))
}

/// The same robot by Newton's method.
fn numerical(description: &Description) -> Compiled {
    let mut description = description.clone();
    description.submechanisms[0].kind = Kind::Numerical;
    compile(&description)
}

const STATE: [Field; 9] = [Q, Qd, Qdd, G, GBias, K, KBias, Residual, CondKd];

fn answers<T: Scalar>(model: &Model<T>, y: &[f64], yd: &[f64]) -> Option<(Fields<T>, Fields<T>)> {
    let of = |x: &[f64]| x.iter().map(|x| T::from_f64(*x)).collect::<Vec<T>>();
    let (y, yd) = (of(y), of(yd));
    let ydd = yd.clone();
    let motion: [(Field, &[T]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
    let mut robot = Robot::new(model.clone());
    let state = robot.ask(Request::Kinematics, &motion, &STATE);
    let forces = robot.ask(Request::InverseDynamics, &motion, &[TauQ, TauY, Lambda]);
    (state.answer.status == Status::Ok).then(|| (state, forces.ok()))
}

/// Largest share of what is allowed: 64 ε cond × size, the square of cond at the acceleration level, and what the misfit leaves.
fn share<T: Scalar>(mine: &(Fields<T>, Fields<T>), truth: &(Fields<T>, Fields<T>), misfit: f64, length: f64) -> f64 {
    let cond = truth.0.get(CondKd)[0].to_f64();
    let (velocity, K_size) = (largest(truth.0.get(Qd)), largest(truth.0.get(K)));
    let square = velocity * velocity;
    let force = largest(truth.1.get(TauQ));
    let allowed = 64.0 * T::EPSILON + 100.0 * misfit;
    let mut worst: f64 = 0.0;
    for (field, least, power) in
        [(Q, 1.0, 1), (Qd, velocity, 1), (G, 1.0, 1), (K, 1.0, 1), (GBias, square, 2), (KBias, K_size * square, 1), (Qdd, square, 2)]
    {
        let share = error_by_size(mine.0.get(field), truth.0.get(field), least) / (allowed * cond.powi(power));
        if share > 1.0 {
            println!("{field:?}: {share:.1e} of {allowed:.1e}, cond {cond:.1e}");
        }
        worst = worst.max(share);
    }
    // moments make forces over the mechanism's length
    for (field, least) in [(TauQ, force), (TauY, force), (Lambda, force / length.min(1.0))] {
        let share = error_by_size(mine.1.get(field), truth.1.get(field), least) / (allowed * cond * cond);
        if share > 1.0 {
            println!("{field:?}: {share:.1e} of {allowed:.1e}, cond {cond:.1e}, forces of {force:.1e}");
        }
        worst = worst.max(share);
    }
    worst
}

/// A closed form on many drafts against Newton's method, double and double-double, and double against double-double.
fn agrees(draft: impl Fn(u64, bool) -> Draft) {
    let (mut worst, mut count) = ([0.0f64; 3], 0);
    for seed in 0..40 {
        let straight = seed % 4 == 0;
        let draft = draft(seed, straight);
        let description = &draft.description;
        let (form, newton) = (compile(description), numerical(description));
        let info = &form.model.closures()[0];
        assert!(form.warnings.is_empty(), "seed {seed}: {:?}", form.warnings);
        assert_eq!((info.kind, newton.model.closures()[0].kind), (ClosureKind::Analytic, ClosureKind::Numerical), "seed {seed}");
        assert!(info.misfit < 1e-13, "seed {seed}: misfit {}", info.misfit);
        if straight {
            assert!(info.misfit < 1e-30, "seed {seed}: misfit {} of exact numbers", info.misfit);
        }
        let mut seeded = Seeded::new(seed + 500);
        for _ in 0..4 {
            let y: Vec<f64> = draft.reach.iter().map(|reach| reach * seeded.within(-1.0, 1.0)).collect();
            let yd: Vec<f64> = draft.reach.iter().map(|reach| 3.0 * reach * seeded.within(-1.0, 1.0)).collect();
            // what one cannot reach, the other cannot
            let (mine, newtons) = match (answers(&form.model, &y, &yd), answers(&newton.model, &y, &yd)) {
                (Some(mine), Some(newtons)) => (mine, newtons),
                (mine, newtons) => {
                    assert!(mine.is_none() && newtons.is_none(), "seed {seed} at {y:?}: only one of both closes");
                    continue;
                }
            };
            let exact = answers::<Dd>(&form.exact, &y, &yd).unwrap();
            let newtons_exact = answers::<Dd>(&newton.exact, &y, &yd).unwrap();
            let rounded = (mine.0.map(Dd::from), mine.1.map(Dd::from));
            let newtons = (newtons.0.map(Dd::from), newtons.1.map(Dd::from));
            let double = |a: &(Fields<Dd>, Fields<Dd>), b: &(Fields<Dd>, Fields<Dd>)| {
                share(a, b, 64.0 / 100.0 * <f64 as Real>::EPSILON + info.misfit, draft.scale)
            };
            let shares = [double(&rounded, &newtons), double(&rounded, &exact), share(&exact, &newtons_exact, info.misfit, draft.scale)];
            assert!(shares.iter().all(|x| *x <= 1.0), "seed {seed} at {y:?}: {shares:?} of what is allowed");
            (0..3).for_each(|k| worst[k] = worst[k].max(shares[k]));
            count += 1;
        }
    }
    assert!(count > 100, "{count} states of 160");
    println!(
        "{count} states: to Newton {:.1e}, to double-double {:.1e}, there to Newton {:.1e} of what is allowed",
        worst[0], worst[1], worst[2]
    );
}

/// Points of a crank-rocker: crank pivot, crank pin, coupler pin, rocker pivot, out of the plane by up to `lift` where that does not matter.
fn crank_rocker(seeded: &mut Seeded, straight: bool) -> [Vector; 4] {
    if straight {
        return [[0.0; 3], [0.25, 0.5, 0.0], [1.25, 1.0 + 0.125 * seeded.sign(), 0.0], [1.0, 0.0, 0.0]];
    }
    let angle = seeded.sign() * seeded.within(0.8, 2.2);
    let lengths = [seeded.within(0.3, 0.5), seeded.within(0.8, 1.0), seeded.within(0.7, 0.9)];
    let (a, o) = ([lengths[0] * angle.cos(), lengths[0] * angle.sin(), 0.0], [1.0, 0.0, 0.0]);
    let span = add(o, -1.0, a);
    let d = norm(span);
    let along = (d * d + lengths[1].powi(2) - lengths[2].powi(2)) / (2.0 * d);
    let aside = (lengths[1].powi(2) - along * along).sqrt() * seeded.sign();
    let b = add(add(a, along / d, span), aside / d, [-span[1], span[0], 0.0]);
    [[0.0; 3], a, b, o]
}

/// A ring of four joints: three of the tree in three shapes, the last cut; any of the three independent.
fn ring(seed: u64, kind: Kind, straight: bool, points: [Vector; 4], slider: Option<(usize, Vector)>) -> Draft {
    let mut draft = Draft::new(seed, kind, straight);
    let lifts: Vec<Vector> = (0..4).map(|_| if straight { [0.0; 3] } else { [0.0, 0.0, draft.seeded.within(-0.3, 0.3)] }).collect();
    let at = |k: usize| add(points[k], 1.0, lifts[k]);
    let joint = |draft: &mut Draft, k: usize, link: usize| match slider {
        Some((place, along)) if place == k => draft.slide(link, at(k), along),
        _ => draft.turn(link, at(k), Z),
    };
    // from the base along one end, then along the other, the cut between them
    let on_first = 1 + draft.seeded.below(3);
    let (mut link, mut other) = (0, 0);
    let mut joints = Vec::new();
    for k in 0..on_first {
        let made = joint(&mut draft, k, link);
        joints.push(made.0);
        link = made.1;
    }
    for k in (on_first + 1..4).rev() {
        let made = joint(&mut draft, k, other);
        joints.push(made.0);
        other = made.1;
    }
    if slider.is_some_and(|(place, _)| place == on_first) {
        // a slider is no pin: another seed
        return ring(seed + 1000, kind, straight, points, slider);
    }
    let (predecessor, successor) = if draft.seeded.chance(0.5) { (link, other) } else { (other, link) };
    let (angular, linear): (&[Vector], &[Vector]) =
        if draft.seeded.chance(0.7) { (&[], &[X, Y_AXIS]) } else { (&[], &[Y_AXIS, [1.0, 1.0, 0.0]]) };
    draft.cut(predecessor, successor, points[on_first], angular, linear);
    let independent = draft.seeded.below(3);
    let slides = draft.description.joints[joints[independent]].kind == JointKind::Prismatic;
    let reach = if slides { 0.1 * draft.scale } else { 0.2 };
    let active = joints[(independent + 1) % 3];
    draft.roles(&[(joints[independent], reach)], &[active]);
    draft.shuffled()
}

#[test]
fn four_bars_of_any_lengths_close_from_any_of_their_joints() {
    agrees(|seed, straight| {
        let points = crank_rocker(&mut Seeded::new(seed + 77), straight);
        ring(seed, Kind::FourBar, straight, points, None)
    });
}

#[test]
fn slider_cranks_close_from_crank_coupler_and_slider() {
    agrees(|seed, straight| {
        let mut seeded = Seeded::new(seed + 78);
        let crank =
            if straight { [0.25, 0.5, 0.0] } else { add([0.0, 0.5 * seeded.sign(), 0.0], 0.2, [seeded.within(-1.0, 1.0), 0.0, 0.0]) };
        let wrist = if straight { [1.25, -0.125, 0.0] } else { [seeded.within(0.8, 1.2) * seeded.sign(), seeded.within(-0.2, 0.2), 0.0] };
        let along = if straight { X } else { unit([1.0, seeded.within(-0.2, 0.2), 0.0]) };
        // crank pivot, crank pin, wrist, slider
        ring(seed, Kind::SliderCrank, straight, [[0.0; 3], crank, wrist, [0.75, 0.0, 0.0]], Some((3, along)))
    });
}

#[test]
fn lambdas_close_whichever_joint_is_independent() {
    agrees(|seed, straight| {
        let mut seeded = Seeded::new(seed + 79);
        let pin = if straight { [0.25, 0.5, 0.0] } else { [seeded.within(-0.3, 0.3), seeded.within(0.4, 0.6) * seeded.sign(), 0.0] };
        let stator = [1.0, 0.0, 0.0];
        let span = unit(add(pin, -1.0, stator));
        let along = if straight { [-0.75, 0.625, 0.0] } else { unit(add(span, seeded.within(-0.2, 0.2), [-span[1], span[0], 0.0])) };
        // rocker, pin, slider, stator
        ring(seed, Kind::Rrpr, straight, [[0.0; 3], pin, [0.625, 0.25, 0.0], stator], Some((2, along)))
    });
}

/// The 2SPRR+1U with offset joints at the base, or with arms on the foot.
fn ankle(seed: u64, straight: bool, arms: bool) -> Draft {
    let mut draft = Draft::new(seed, Kind::Sprr2U1, straight);
    let seeded = &mut draft.seeded;
    let tilt = |seeded: &mut Seeded, v: Vector| if straight { v } else { unit(add(v, 0.3, seeded.direction())) };
    let (first, second) = (tilt(seeded, X), tilt(seeded, Y_AXIS));
    let offset = if straight || seeded.chance(0.5) { [0.0; 3] } else { seeded.vector(0.05) };
    let (roll, roll_link) = draft.turn(0, [0.0; 3], first);
    let (pitch, foot) = draft.turn(roll_link, offset, second);
    let mirrored = draft.seeded.chance(0.5);
    let mut shape = [0.0; 8];
    let mut feet = Vec::new();
    let mut active = Vec::new();
    for side in [1.0, -1.0] {
        if side > 0.0 || !mirrored {
            shape = std::array::from_fn(|_| if straight { 0.25 * draft.seeded.below(4) as f64 } else { draft.seeded.within(-1.0, 1.0) });
        }
        let mirror = |v: Vector| [v[0], side * v[1], v[2]];
        let far = |x: f64, k: usize| x + 0.125 * shape[k];
        let base = mirror([far(-0.25, 0), far(0.375, 1), far(1.25, 2)]);
        let pivot = mirror([far(-0.625, 3), far(0.5, 4), 0.0]);
        // the arm's axis, and the arm towards the base's point and perpendicular to the axis
        let n = if straight { X } else { unit(mirror([1.0, 0.2 * shape[5], 0.2 * shape[6]])) };
        let to_base = add(base, -1.0, pivot);
        let radial = add(to_base, -dot(n, to_base), n);
        let arm = if straight {
            [0.0, 0.25, 0.125]
        } else {
            add(add([0.0; 3], (0.15 + 0.05 * shape[7]) / norm(radial), radial), 0.05 * shape[0], n)
        };
        let pin = if arms { add(pivot, 1.0, arm) } else { pivot };
        let leg = unit(add(pin, -1.0, base));
        // second axis of the leg perpendicular to the rod, the first to the second
        let y = if straight { Y_AXIS } else { unit(cross(leg, tilt(&mut draft.seeded, X))) };
        let x = if straight { X } else { unit(cross(y, tilt(&mut draft.seeded, Z))) };
        let common = cross(x, y);
        let gap = if arms { 0.0 } else { 0.125 * side };
        let (along, y) = match (straight, arms) {
            (true, _) => ([0.25, 0.0, 1.0], y),
            (false, true) if draft.seeded.chance(0.5) => (unit(add(leg, 0.2, draft.seeded.direction())), y),
            _ => (unit(add(leg, 0.2 * shape[1], cross(leg, y))), y),
        };
        let on_second = add(base, gap, common);
        let (_, first_link) = draft.turn(0, add(base, 0.125 * shape[2], x), x);
        let (_, second_link) = draft.turn(first_link, add(on_second, 0.125 * shape[3], y), y);
        let (slider, rod) = draft.slide(second_link, add(pin, 0.25, if straight { Z } else { leg }), along);
        active.push(slider);
        if arms {
            let (_, arm_link) = draft.turn(foot, add(pivot, 0.125 * shape[6], n), n);
            feet.push((arm_link, base, if straight { cross(n, arm) } else { unit(cross(n, radial)) }, pin, rod));
        } else if draft.seeded.chance(0.5) {
            draft.cut(foot, rod, pin, &[], &[X, Y_AXIS, Z]);
        } else {
            draft.cut(rod, foot, pin, &[], &[X, Y_AXIS, Z]);
        }
    }
    for (arm, base, normal, pin, rod) in feet {
        draft.cut(rod, arm, pin, &[], &[X, Y_AXIS, Z]);
        draft.cut(arm, 0, base, &[], &[normal]);
    }
    draft.roles(&[(roll, 0.15), (pitch, 0.15)], &active);
    draft.shuffled()
}

#[test]
fn ankles_with_offset_joints_at_the_base_close_in_closed_form() {
    agrees(|seed, straight| ankle(seed, straight, false));
}

#[test]
fn ankles_with_arms_on_the_foot_close_in_closed_form() {
    agrees(|seed, straight| ankle(seed, straight, true));
}

#[test]
fn an_ankle_with_arms_defines_its_loops_by_its_type() {
    for seed in 0..20 {
        // slider's origin for pin, listed as roll, pitch, arms, then leg by leg
        let mut draft = ankle(seed, false, true);
        draft.description.submechanisms[0].loops.clear();
        let part = &mut draft.description.submechanisms[0];
        part.spanning_tree = vec![0, 1, 5, 9, 2, 3, 4, 6, 7, 8];
        let form = compile(&draft.description);
        let sizes = form.model.sizes();
        assert_eq!((sizes.n_c, sizes.n_vy, form.model.closures()[0].kind), (8, 2, ClosureKind::Analytic));
        let mut robot = Robot::new(form.model.clone());
        let mut seeded = Seeded::new(seed);
        let y = [seeded.within(-0.1, 0.1), seeded.within(-0.1, 0.1)];
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, G, Residual]).ok();
        assert!(x.get(Residual)[0] < 1e-12, "{:?}", x.get(Residual));
        // every row of G is filled
        for row in x.get(G).chunks(2) {
            assert!(row.iter().any(|x| x.abs() > 1e-6), "{row:?}");
        }
    }
}

/// One or two parallelograms one on the other; `off` spoils the first.
fn parallelograms(seed: u64, straight: bool, off: f64) -> Draft {
    let mut draft = Draft::new(seed, Kind::ParallelogramChain, straight);
    let (mut base, mut at, mut independent) = (0, [0.0; 3], Vec::new());
    for k in 0..2 {
        let side = if straight { [0.25, 1.0, 0.0] } else { [draft.seeded.within(-0.3, 0.3), draft.seeded.within(0.6, 1.0), 0.0] };
        let rail = if straight { [0.5, 0.0, 0.0] } else { [draft.seeded.within(0.3, 0.6), draft.seeded.within(-0.1, 0.1), 0.0] };
        let spoilt = if k == 0 { off } else { 0.0 };
        let (crank, crank_link) = draft.turn(base, at, Z);
        let (_, coupler) = draft.turn(crank_link, add(at, 1.0, side), Z);
        let (follower, follower_link) = draft.turn(base, add(at, 1.0 + spoilt, rail), Z);
        let pin = add(add(at, 1.0, side), 1.0, rail);
        let (p, s) = if draft.seeded.chance(0.5) { (coupler, follower_link) } else { (follower_link, coupler) };
        let five = !straight && draft.seeded.chance(0.3);
        draft.cut(p, s, pin, if five { &[X, Y_AXIS] } else { &[] }, if five { &[X, Y_AXIS, Z] } else { &[X, Y_AXIS] });
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
        let (form, newton) = (compile(&draft.description), numerical(&draft.description));
        assert_eq!(form.model.closures()[0].kind, ClosureKind::Analytic);
        let (y, yd) = ([0.4, -0.3], [1.0, -2.0]);
        let (mine, truth) = (answers(&form.model, &y, &yd).unwrap(), answers(&newton.model, &y, &yd).unwrap());
        assert!(mine.0.get(GBias).iter().all(|x| *x == 0.0));
        assert!(mine.0.get(G).iter().all(|x| x.abs() < 1e-15 || (x.abs() - 1.0).abs() < 1e-15), "{:?}", mine.0.get(G));
        // a cut of five rows has redundant ones, whose forces are a choice
        for field in [Q, G, GBias, K] {
            let error = error_by_size(mine.0.get(field), truth.0.get(field), 1.0);
            assert!(error < 1e-13 * truth.0.get(CondKd)[0], "seed {seed} {field:?}: {error:.1e}");
        }
        // a little off starts Newton's method, more is closed by it and told
        let polished = compile(&parallelograms(seed, seed % 4 == 0, 1e-5).description);
        assert_eq!(polished.model.closures()[0].kind, ClosureKind::Analytic);
        let state = answers(&polished.model, &y, &yd).unwrap();
        assert!(state.0.get(Residual)[0] < 1e-12 && largest(state.0.get(GBias)) > 0.0, "{:?}", state.0.get(Residual));
        let spoilt = compile(&parallelograms(seed, seed % 4 == 0, 0.2).description);
        assert_eq!(spoilt.model.closures()[0].kind, ClosureKind::Numerical);
        assert!(spoilt.warnings.iter().any(|x| x.to_string().contains("no parallelogram")), "{:?}", spoilt.warnings);
    }
}

/// Joints in a row with couplings (joint, masters and multipliers, offset).
fn geared(joints: usize, couplings: &[(usize, &[(usize, f64)], f64)], independent: &[usize], active: &[usize]) -> Description {
    let mut draft = Draft::new(5, Kind::Differential, true);
    (0..joints).for_each(|k| {
        draft.turn(0, [k as f64, 0.0, 0.0], Z);
    });
    for (j, terms, offset) in couplings {
        draft.description.joints[*j].coupling = Some(Coupling { terms: terms.to_vec(), offset: *offset });
    }
    let part = &mut draft.description.submechanisms[0];
    (part.independent, part.active) = (independent.to_vec(), active.to_vec());
    draft.description
}

#[test]
fn couplings_hold_in_any_order_and_all_at_once() {
    let ask = |description: &Description, y: [f64; 2]| {
        let model = compile(description).model;
        assert_eq!(model.closures()[0].kind, ClosureKind::Analytic);
        let mut robot = Robot::new(model);
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, G, U]).ok();
        // the actuators alone tell the same pose
        let back = robot.ask(Request::Kinematics, &[(U, x.get(U))], &[Y]).ok();
        assert!(error_by_size(back.get(Y), &y, 1.0) < 1e-15);
        (x.get(Q).to_vec(), x.get(G).to_vec())
    };
    // a head: left = roll + pitch, right = roll − pitch; and the same differential written from its wheels, where no row has one unknown
    let head = geared(4, &[(2, &[(0, 1.0), (1, 1.0)], 0.0), (3, &[(0, 1.0), (1, -1.0)], 0.0)], &[0, 1], &[2, 3]);
    let wheels = geared(4, &[(0, &[(2, 0.5), (3, 0.5)], 0.0), (1, &[(2, 0.5), (3, -0.5)], 0.0)], &[0, 1], &[2, 3]);
    for description in [&head, &wheels] {
        let (q, jacobian) = ask(description, [0.5, 0.125]);
        assert_eq!(q, [0.5, 0.125, 0.625, 0.375]);
        assert_eq!(jacobian, [1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, -1.0]);
    }
    // both descriptions at once say the same twice: cage and wheels
    let mut both = head.clone();
    both.joints[1].coupling = wheels.joints[1].coupling.clone();
    assert_eq!(ask(&both, [0.5, 0.125]).0, [0.5, 0.125, 0.625, 0.375]);
    // a chain with offsets, backwards
    let chain = geared(4, &[(0, &[(1, 2.0)], 0.5), (1, &[(2, -0.5)], 0.25)], &[2, 3], &[0, 3]);
    assert_eq!(ask(&chain, [1.0, 0.0]).0, [0.0, -0.25, 1.0, 0.0]);
}

#[test]
fn couplings_that_determine_nothing_or_contradict_each_other_are_faults() {
    // two joints that follow each other stand anywhere
    let idle = geared(3, &[(1, &[(2, 1.0)], 0.0), (2, &[(1, 1.0)], 0.0)], &[0], &[0]);
    assert!(Model::compile(&idle).is_err());
    let contradicting = geared(3, &[(1, &[(0, 1.0)], 0.0), (2, &[(1, 1.0)], 0.0), (0, &[(2, 1.0)], 0.1)], &[0], &[0]);
    let error = Model::compile(&contradicting).unwrap_err();
    assert!(error.errors.iter().any(|x| x.to_string().contains("contradict")), "{error:?}");
}

/// A lambda in the plane x, y whose slider turns about the pin on the arm and is cut at the base; the arm stands at a right angle to the
/// base line at zero.
fn table_lambda(arm: f64, base: f64, out_of_plane: f64) -> Compiled {
    let mut draft = Draft::new(1, Kind::Rrpr, true);
    let (pin, pivot) = ([0.0, arm, 0.0], [base, 0.0, out_of_plane]);
    let along = [base, -arm, 0.0];
    let (rocker, rocker_link) = draft.turn(0, [0.0; 3], Z);
    let (_, stator_link) = draft.turn(rocker_link, pin, Z);
    let (slider, slider_link) = draft.slide(stator_link, pin, along);
    draft.cut(0, slider_link, pivot, &[], &[X, Y_AXIS]);
    draft.roles(&[(rocker, 1.0)], &[slider]);
    for (j, axis) in [(0, Z), (1, [0.0, 0.0, -1.0]), (2, along)] {
        draft.description.joints[j].axis = axis;
    }
    compile(&draft.description)
}

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
    let (arm, base) = (0.11402f64, 0.36497f64);
    let mut robot = Robot::new(table_lambda(arm, base, 0.0).model);
    let length0 = arm.hypot(base);
    let q20 = TABLE[1][1];
    // both sides of the slider's length at the URDF's zero of RH5's elbow, where another program turns the sign
    for [y, q2, q3, G2, G3, g2, g3] in TABLE {
        // at zero the arm stands at a right angle to the base line
        let at = y - std::f64::consts::FRAC_PI_2;
        let x = robot.ask(Request::Kinematics, &[(Y, &[at]), (Yd, &[1.0])], &[Q, G, GBias]).ok();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "y {y}: {a} instead of {b}");
        // a coordinate of a turning dependent lies in (−π, π]
        let turned = q2 - q20;
        near(x.get(Q)[1], if turned < -std::f64::consts::PI { turned + std::f64::consts::TAU } else { turned });
        near(x.get(Q)[2], q3 - length0);
        near(x.get(G)[1], G2);
        near(x.get(G)[2], G3);
        near(x.get(GBias)[1], g2);
        near(x.get(GBias)[2], g3);
    }
}

#[test]
fn a_slider_keeps_its_sign_through_every_length() {
    // 0.2974 m is where another program changes the sign of q2
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
        let q = |model: &Model<f64>| Robot::new(model.clone()).ask(Request::Kinematics, &[(Y, &[y])], &[Q]).ok().get(Q).to_vec();
        // the distance in space, which another program takes, would be wrong by 4.5e-6 m
        assert!(error_by_size(&q(&lifted), &q(&flat), 1.0) < 1e-15);
    }
}

/// A four-bar by its points, crank, coupler and rocker, the crank independent.
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
        let x = Robot::new(compiled.model.clone()).ask(Request::Kinematics, &[(Y, &[y]), (Yd, &[1.0])], &[Q, G, GBias]);
        assert_eq!(x.answer.status == Status::Ok, x.get(Q).iter().chain(x.get(G)).all(|x| x.is_finite()));
        x.answer.status
    };
    // a crank of 2 on a base of 1 with short links: 3 is farther than they reach
    let bar = compile(&four_bar([[0.0; 3], [1.5, 1.0, 0.0], [1.75, 0.0, 0.0], [1.0, 0.0, 0.0]]).description);
    assert_eq!(status(&bar, 0.0), Status::Ok);
    assert_eq!(status(&bar, 2.0), Status::Unreachable);
    // a slider moves J1 onto the line of both links, exactly: 0.6 + 0.8 in quarter steps
    let mut draft = Draft::new(4, Kind::SliderCrank, true);
    let (slider, block) = draft.slide(0, [0.0; 3], X);
    let (_, first) = draft.turn(block, [0.0; 3], Z);
    let (_, second) = draft.turn(0, [1.0, 0.0, 0.0], Z);
    draft.cut(first, second, [0.5, 1.0, 0.0], &[], &[X, Y_AXIS]);
    draft.roles(&[(slider, 1.0)], &[slider]);
    draft.description.joints[0].axis = X;
    let toggle = compile(&draft.description);
    assert_eq!(status(&toggle, 0.25), Status::Ok);
    assert_eq!(status(&toggle, -2.0), Status::Unreachable);
    // both links along each other: the first joint meets the second's, and the links may turn freely
    assert_eq!(status(&toggle, 1.0), Status::SingularClosure);
    // a slider-crank whose rod stands across its line: the slider does not follow
    let mut draft = Draft::new(4, Kind::SliderCrank, true);
    let (crank, crank_link) = draft.turn(0, [0.0; 3], Z);
    let (_, rod) = draft.turn(crank_link, [3.0, 0.0, 0.0], Z);
    let (slider, block) = draft.slide(0, [0.0; 3], Y_AXIS);
    draft.cut(rod, block, [0.0, 4.0, 0.0], &[], &[X, Y_AXIS]);
    draft.roles(&[(crank, 1.0)], &[slider]);
    let slider_crank = compile(&draft.description);
    assert_eq!(status(&slider_crank, 1.0), Status::Ok);
}
