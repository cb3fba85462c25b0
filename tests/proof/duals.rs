//! Derivatives by dual numbers: G and g from γ alone, every rate from its integral, forces from the
//! energies.
//!
//! A numerical closure over duals starts at the closed pose without derivatives; the first Newton
//! step gives the first derivative, the next one the second.

use sarrus_dynamics::scalar::{Dd, Dual, Real};
use sarrus_dynamics::{Axes, Field, FieldSet, Model, PlanScalar, Query, Request};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::dual::{First, Second, model};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{plus, product, times};

use crate::derivatives::{energy, in_joints, later, moved, plus_cross, quaternion_rate, turned};

use Field::*;

/// Rounding allowed at condition 1, in units of the scalar.
const ROUNDING: f64 = 64.0;

/// Closes at y from the closed pose q once per order of derivatives, then asks at that pose.
fn ask_at<S: PlanScalar>(
    robot: &mut Robot<Dual<S>>,
    base: Query,
    given: &[(Field, &[Dual<S>])],
    q: &[Dual<S>],
    orders: usize,
) -> Fields<Dual<S>> {
    let mut q = q.to_vec();
    for _ in 0..orders {
        q = robot.ask(Request::Kinematics, &[given[0], (QGuess, &q)], &[Q]).ok().get(Q).to_vec();
    }
    let given: Vec<(Field, &[Dual<S>])> =
        given.iter().copied().chain([(QGuess, q.as_slice())]).collect();
    robot.ask_for(base, &given).ok()
}

fn constants<S: PlanScalar>(x: &[S]) -> Vec<Dual<S>> {
    x.iter().map(|x| Dual::constant(*x)).collect()
}

fn slopes<S: PlanScalar>(x: &[Dual<S>]) -> Vec<S> {
    x.iter().map(|x| x.du).collect()
}

fn kinematics(want: &[Field]) -> Query {
    Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(want))
}

/// Joint rates as (index in q̇, rate) from the derivative of q: the derivative itself, or 2 q* q̇
/// for a quaternion. Second derivatives likewise.
fn rates<S: PlanScalar>(model: &Model<S>, q: &[S], dq: &[S]) -> Vec<(usize, S)> {
    let q_names = model.tree_q_names();
    let v_names = model.tree_names();
    let place = |name: &str| v_names.iter().position(|x| x == name);
    let mut rates = Vec::new();
    for (k, name) in q_names.iter().enumerate() {
        if let Some(v) = place(name) {
            rates.push((v, dq[k]));
        } else if let Some(joint) = name.strip_suffix("/qx") {
            let q = &q[k..k + 4];
            let d = &dq[k..k + 4];
            let two = S::from_f64(2.0);
            let w = |i: usize, j: usize, l: usize| {
                two * (q[3] * d[i] - d[3] * q[i] - q[j] * d[l] + q[l] * d[j])
            };
            let turn = [w(0, 1, 2), w(1, 2, 0), w(2, 0, 1)];
            let axes = ["rx", "ry", "rz"].map(|axis| place(&format!("{joint}/{axis}")));
            rates.extend(axes.into_iter().zip(turn).filter_map(|(v, w)| v.map(|v| (v, w))));
        }
    }
    rates
}

/// Compares the rates of some joints with a field over all of q̇.
fn compare_rates<S: PlanScalar>(
    ledger: &mut Ledger,
    what: &str,
    case: &Case,
    rates: &[(usize, S)],
    field: &[S],
    size: f64,
    allowed: f64,
) {
    let (a, b): (Vec<S>, Vec<S>) = rates.iter().map(|(v, rate)| (*rate, field[*v])).unzip();
    ledger.compare(what, case, &a, &b, size, allowed);
}

/// ∂γ/∂y = G and ∂u/∂y = G_u, column by column, without any velocity.
fn columns<S: PlanScalar>(case: &Case, plain: &Model<S>, ledger: &mut Ledger, scalar: &str) {
    let mut robot = Robot::new(plain.clone());
    let mut over_duals = Robot::new(model(plain));
    let n = plain.sizes().n_vy;
    let state = case.state::<S>(0);
    let x = robot.ask_for(kinematics(&[Q, G, GU, CondKd]), &[(Y, &state.y)]).ok();
    let allowed = ROUNDING * S::EPSILON * x.get(CondKd)[0].to_f64() + case.contradiction();
    let y = constants(&state.y);
    let q = constants(x.get(Q));
    let size = largest(x.get(G)).max(1.0);
    for k in 0..n {
        let mut e = vec![Dual::ZERO; n];
        e[k] = Dual::ONE;
        let y = moved(case, &y, &e, Dual::new(S::ZERO, S::ONE));
        let at = ask_at(&mut over_duals, kinematics(&[Q, U]), &[(Y, &y)], &q, 0);
        let column =
            |field: Field| -> Vec<S> { x.get(field).chunks_exact(n).map(|row| row[k]).collect() };
        let of_gamma = rates(plain, x.get(Q), &slopes(at.get(Q)));
        compare_rates(
            ledger,
            &format!("∂γ/∂y = G in {scalar}"),
            case,
            &of_gamma,
            &column(G),
            size,
            allowed,
        );
        if plain.active_names().iter().all(|name| !name.contains('/')) {
            ledger.compare(
                &format!("∂u/∂y = G_u in {scalar}"),
                case,
                &slopes(at.get(U)),
                &column(GU),
                size,
                allowed,
            );
        }
    }
}

#[test]
fn the_loop_jacobian_is_the_derivative_of_the_closure() {
    Ledger::over(robots(), |case, ledger| {
        columns(case, &case.compiled.model, ledger, "double");
        columns(case, &case.compiled.exact, ledger, "double-double");
    });
}

/// q̇, q̈ and g from γ along a path in time.
#[test]
fn the_bias_is_the_second_derivative_of_the_closure() {
    Ledger::over(robots(), |case, ledger| {
        let plain = &case.compiled.model;
        let mut robot = Robot::new(plain.clone());
        let mut over_duals = Robot::new(model(&model(plain)));
        for k in 0..2 {
            let now = case.state::<f64>(k);
            let given = [(Y, now.y.as_slice()), (Yd, &now.yd), (Ydd, &now.ydd)];
            let x = robot.ask_for(kinematics(&[Q, Qd, Qdd, Ud, Udd, CondKd]), &given).ok();
            let twice = |x: &[f64]| -> Vec<Second> {
                x.iter().map(|x| Second::path(*x, 0.0, 0.0)).collect()
            };
            let still = State { y: twice(&now.y), yd: twice(&now.yd), ydd: twice(&now.ydd) };
            let y = later(case, &still, Second::path(0.0, 1.0, 0.0)).y;
            let at = ask_at(&mut over_duals, kinematics(&[Q, U]), &[(Y, &y)], &twice(x.get(Q)), 2);
            let speed = largest(x.get(Qd)).max(1.0);
            let cond = x.get(CondKd)[0];
            let allowed = |power: i32| {
                ROUNDING * <f64 as Real>::EPSILON * cond.powi(power) + case.contradiction()
            };
            let part = |field: Field, of: fn(&Second) -> f64| -> Vec<f64> {
                at.get(field).iter().map(of).collect()
            };
            let first = part(Q, |x| x.du.re);
            let second = part(Q, |x| x.du.du);
            compare_rates(
                ledger,
                "γ̇ = q̇",
                case,
                &rates(plain, x.get(Q), &first),
                x.get(Qd),
                speed,
                allowed(1),
            );
            let size = speed.powi(2).max(largest(x.get(Qdd)));
            compare_rates(
                ledger,
                "γ̈ = q̈",
                case,
                &rates(plain, x.get(Q), &second),
                x.get(Qdd),
                size,
                allowed(2),
            );
            if plain.active_names().iter().all(|name| !name.contains('/')) {
                ledger.compare(
                    "u̇ by duals",
                    case,
                    &part(U, |x| x.du.re),
                    x.get(Ud),
                    speed,
                    allowed(1),
                );
                ledger.compare(
                    "ü by duals",
                    case,
                    &part(U, |x| x.du.du),
                    x.get(Udd),
                    size,
                    allowed(2),
                );
            }
        }
    });
}

/// Checks every output that is the rate of another output, by one dual along the motion.
fn along_the_motion<S: PlanScalar>(
    case: &Case,
    plain: &Model<S>,
    ledger: &mut Ledger,
    scalar: &str,
) {
    let mut robot = Robot::new(plain.clone());
    let mut over_duals = Robot::new(model(plain));
    let now = case.state::<S>(1);
    let q = robot.ask_for(kinematics(&[Q]), &[(Y, &now.y)]).ok().get(Q).to_vec();
    let still = State { y: constants(&now.y), yd: constants(&now.yd), ydd: constants(&now.ydd) };
    let moving = later(case, &still, Dual::new(S::ZERO, S::ONE));
    let links: Vec<u16> = (0..plain.link_names().len().min(32) as u16).collect();
    let want = kinematics(&[
        Q,
        Qd,
        Qdd,
        U,
        Ud,
        Udd,
        G,
        GBias,
        K,
        KBias,
        CondKd,
        FramePose,
        FrameTwist,
        FrameAcc,
        JacobianIndependent,
        JdYd,
        Com,
        ComJacobian,
        ComBias,
        Momentum,
        Centroidal,
    ])
    .with_frames(&links);
    let given = [(Y, moving.y.as_slice()), (Yd, &moving.yd), (Ydd, &moving.ydd)];
    let x = ask_at(&mut over_duals, want, &given, &constants(&q), 1);
    let value = |field: Field| -> Vec<S> { x.get(field).iter().map(|x| x.re).collect() };
    let change = |field: Field| slopes(x.get(field));
    let cond = x.get(CondKd)[0].to_f64();
    let allowed = ROUNDING * S::EPSILON * cond * cond + case.contradiction();
    let speed = largest(&value(Qd)).max(1.0);
    let mut check = |what: &str, a: &[S], b: &[S], size: f64| {
        ledger.compare(&format!("{what} in {scalar}"), case, a, b, size, allowed)
    };

    let of_q = rates(plain, &q, &change(Q));
    let (a, b): (Vec<S>, Vec<S>) = of_q.iter().map(|(v, rate)| (*rate, value(Qd)[*v])).unzip();
    check("dq/dt = q̇", &a, &b, speed);
    let size = speed.powi(2).max(largest(&value(Qdd)));
    check("dq̇/dt = q̈", &change(Qd), &value(Qdd), size);
    check("du̇/dt = ü", &change(Ud), &value(Udd), size);
    check(
        "Ġ ẏ = g",
        &product(&change(G), &now.yd),
        &value(GBias),
        speed.powi(2).max(largest(&value(GBias))),
    );
    let k_bias: Vec<S> = product(&change(K), &value(Qd)).into_iter().map(|x| -x).collect();
    check("−K̇ q̇ = k", &k_bias, &value(KBias), largest(&value(K)).max(1.0) * speed.powi(2));

    // frames: positions, quaternions, twists
    let pose = value(FramePose);
    let twist = value(FrameTwist);
    let size = largest(&twist).max(speed);
    for ((rate, pose), twist) in
        change(FramePose).chunks_exact(7).zip(pose.chunks_exact(7)).zip(twist.chunks_exact(6))
    {
        check("frame velocity", &rate[..3], &twist[3..], size);
        let in_body = turned(&[-pose[3], -pose[4], -pose[5], pose[6]], &twist[..3]);
        check("quaternion rate", &rate[3..], &quaternion_rate(&pose[3..], &in_body), size);
    }
    let acceleration = value(FrameAcc);
    check(
        "frame acceleration",
        &change(FrameTwist),
        &acceleration,
        size.powi(2).max(largest(&acceleration)),
    );
    let change_of_rows = |field| product(&change(field), &now.yd);
    let bias = value(JdYd);
    let size = size.powi(2).max(largest(&bias));
    check("J̇ ẏ of frames", &change_of_rows(JacobianIndependent), &bias, size);

    // sums over the links
    let com_velocity = product(&value(ComJacobian), &now.yd);
    check("velocity of the centre of mass", &change(Com), &com_velocity, speed);
    check("J̇ ẏ of the centre of mass", &change_of_rows(ComJacobian), &value(ComBias), size);
    let momentum = value(Momentum);
    let of_matrix = product(&value(Centroidal), &now.yd);
    check("momentum = A ẏ", &of_matrix, &momentum, largest(&momentum).max(1e-3));
}

/// Checks frames in all axes, against the root and against a link: twist, acceleration, Jacobians
/// and J̇ ẏ are those of the pose that the view shows.
fn along_views<S: PlanScalar>(case: &Case, plain: &Model<S>, ledger: &mut Ledger, scalar: &str) {
    let mut robot = Robot::new(plain.clone());
    let mut over_duals = Robot::new(model(plain));
    let now = case.state::<S>(2);
    let q = robot.ask_for(kinematics(&[Q]), &[(Y, &now.y)]).ok().get(Q).to_vec();
    let still = State { y: constants(&now.y), yd: constants(&now.yd), ydd: constants(&now.ydd) };
    let moving = later(case, &still, Dual::new(S::ZERO, S::ONE));
    let given = [(Y, moving.y.as_slice()), (Yd, &moving.yd), (Ydd, &moving.ydd)];
    let n = plain.link_names().len() as u64;
    let mut seeded = Seeded::new(case.seed + 77);
    let mut link = || (seeded.bits() % n) as u16;
    let frames = [link(), link(), link()];
    let reference = link();
    let want = kinematics(&[
        Qd,
        CondKd,
        FramePose,
        FrameTwist,
        FrameAcc,
        JacobianTree,
        JacobianIndependent,
        JdYd,
    ])
    .with_frames(&frames);
    let of_root = ask_at(&mut over_duals, want, &given, &constants(&q), 1);
    let speed = largest(&of_root.get(Qd).iter().map(|x| x.re).collect::<Vec<S>>()).max(1.0);
    let cond = of_root.get(CondKd)[0].re.to_f64();
    let allowed = ROUNDING * S::EPSILON * cond * cond + case.contradiction();
    for (axes, relative) in [
        (Axes::Mixed, true),
        (Axes::World, false),
        (Axes::World, true),
        (Axes::Local, false),
        (Axes::Local, true),
    ] {
        let query = want.with_axes(axes);
        let query = if relative { query.relative_to(reference) } else { query };
        let x = ask_at(&mut over_duals, query, &given, &constants(&q), 1);
        let value = |field: Field| -> Vec<S> { x.get(field).iter().map(|x| x.re).collect() };
        let change = |field: Field| slopes(x.get(field));
        let mut check = |what: &str, a: &[S], b: &[S], size: f64| {
            let what = format!("{what}, {} axes, relative {relative} in {scalar}", axes.name());
            ledger.compare(&what, case, a, b, size, allowed)
        };
        let (twist, acc) = (value(FrameTwist), value(FrameAcc));
        let size = largest(&twist).max(speed);
        let poses = value(FramePose);
        let parts = change(FramePose);
        let parts = parts.chunks_exact(7).zip(poses.chunks_exact(7)).zip(twist.chunks_exact(6));
        for ((rate, pose), twist) in parts.clone() {
            // the twist in root axes at the frame's origin
            let back = |x: &[S]| -> [S; 3] {
                match axes {
                    Axes::Local => turned(&pose[3..], x),
                    _ => [x[0], x[1], x[2]],
                }
            };
            let w = back(&twist[..3]);
            let mut v = back(&twist[3..]);
            if axes == Axes::World {
                // v_frame = v_origin + ω × p
                plus_cross(&mut v, S::ONE, &w, &pose[..3]);
            }
            check("frame velocity", &rate[..3], &v, size);
            let in_body = turned(&[-pose[3], -pose[4], -pose[5], pose[6]], &w);
            check("quaternion rate", &rate[3..], &quaternion_rate(&pose[3..], &in_body), size);
        }
        // classical acceleration of the origin: the second rate of the position
        let size = size.powi(2).max(largest(&acc));
        for (((_, pose), twist), (rate, acc)) in
            parts.zip(change(FrameTwist).chunks_exact(6).zip(acc.chunks_exact(6)))
        {
            let (w, v) = (&twist[..3], &twist[3..]);
            let mut linear = [rate[3], rate[4], rate[5]];
            match axes {
                // d/dt (R ᵀv) = Rᵀ a − ω × v
                Axes::Local => plus_cross(&mut linear, S::ONE, w, v),
                // v = v_O + ω × p
                Axes::World => {
                    plus_cross(&mut linear, S::ONE, &rate[..3], &pose[..3]);
                    let mut at = [v[0], v[1], v[2]];
                    plus_cross(&mut at, S::ONE, w, &pose[..3]);
                    plus_cross(&mut linear, S::ONE, w, &at);
                }
                _ => {}
            }
            check("angular acceleration", &rate[..3], &acc[..3], size);
            check("classical acceleration", &linear, &acc[3..], size);
        }
        check("J ẏ = twist", &product(&value(JacobianIndependent), &now.yd), &twist, speed);
        check("J q̇ = twist", &product(&value(JacobianTree), &value(Qd)), &twist, speed);
        let bias = value(JdYd);
        let rate = product(&change(JacobianIndependent), &now.yd);
        check("J̇ ẏ", &rate, &bias, size.max(largest(&bias)));
    }
}

#[test]
fn frames_in_all_axes_and_against_a_link_are_derivatives_of_the_pose_they_show() {
    Ledger::over(robots(), |case, ledger| {
        along_views(case, &case.compiled.model, ledger, "double");
    });
}

#[test]
fn every_rate_is_a_derivative_by_duals() {
    Ledger::over(robots(), |case, ledger| {
        along_the_motion(case, &case.compiled.model, ledger, "double");
        along_the_motion(case, &case.compiled.exact, ledger, "double-double");
    });
}

/// Kinetic and potential energy with rotors and springs, from q, q̇ and the links' poses and
/// twists.
fn energies<T: PlanScalar>(
    case: &Case,
    robot: &mut Robot<T>,
    y: &[T],
    yd: &[T],
    q: &[T],
) -> (T, T) {
    let links: Vec<u16> = (0..robot.model.link_names().len() as u16).collect();
    let mut pose = Vec::new();
    let mut twist = Vec::new();
    let given = [(Y, y), (Yd, yd), (QGuess, q)];
    for some in links.chunks(32) {
        let x = robot.ask_for(kinematics(&[FramePose, FrameTwist]).with_frames(some), &given).ok();
        pose.extend_from_slice(x.get(FramePose));
        twist.extend_from_slice(x.get(FrameTwist));
    }
    let (mut kinetic, mut potential) = energy(case, &pose, &twist);
    let x = robot.ask_for(kinematics(&[Q, Qd]), &given).ok();
    let [rotors, springs, _] = in_joints(case, &robot.model, x.get(Q), x.get(Qd));
    kinetic += rotors;
    potential += springs;
    (kinetic, potential)
}

/// Lagrange's equation with energies that use no mass matrix, acceleration or force: d/dt ∂T/∂ẏ −
/// ∂T/∂y + ∂V/∂y = τ_y − Gᵀ d q̇.
#[test]
fn forces_are_those_of_lagrange() {
    // Lagrange's equation does not hold for the components of a quaternion
    Ledger::over(robots().iter().filter(|case| !case.floats()), |case, ledger| {
        let plain = &case.compiled.model;
        let mut robot = Robot::new(plain.clone());
        let mut over_duals = Robot::new(model(&model(plain)));
        let n = plain.sizes().n_vy;
        let now = case.state::<f64>(1);
        let given = [(Y, now.y.as_slice()), (Yd, &now.yd), (Ydd, &now.ydd)];
        let x = robot.ask(Request::InverseDynamics, &given, &[TauY, TauQ, Q, Qd, G, CondKd]).ok();
        let q: Vec<Second> = x.get(Q).iter().map(|q| Second::path(*q, 0.0, 0.0)).collect();
        // outer direction: time or none; inner direction: one rate or one coordinate
        let path = |x: &[f64], outer: &[f64], inner: Option<usize>| -> Vec<Second> {
            let one = |k: usize| if inner == Some(k) { 1.0 } else { 0.0 };
            (0..n).map(|k| Dual::new(First::new(x[k], one(k)), First::constant(outer[k]))).collect()
        };
        let nothing = vec![0.0; n];
        let mut tau = Vec::new();
        for k in 0..n {
            // rate of the momentum
            let y = path(&now.y, &now.yd, None);
            let yd = path(&now.yd, &now.ydd, Some(k));
            let momentum = energies(case, &mut over_duals, &y, &yd, &q).0.du.du;
            // derivative by the coordinate
            let y = path(&now.y, &nothing, Some(k));
            let yd = path(&now.yd, &nothing, None);
            let (kinetic, potential) = energies(case, &mut over_duals, &y, &yd, &q);
            // power of the damping
            let mut damping = 0.0;
            for joint in case.description.joints.iter().filter(|joint| joint.terms.damping != 0.0) {
                if let Some(v) = plain.tree_names().iter().position(|name| *name == joint.name) {
                    damping += joint.terms.damping * x.get(Qd)[v] * x.get(G)[v * n + k];
                }
            }
            tau.push(momentum - kinetic.re.du + potential.re.du + damping);
        }
        let cond = x.get(CondKd)[0];
        let size = largest(x.get(TauQ)) * largest(x.get(G)).max(1.0);
        let allowed = ROUNDING * <f64 as Real>::EPSILON * cond * cond + case.contradiction();
        ledger.compare("Lagrange's τ_y", case, &tau, x.get(TauY), size, allowed);
    });
}

/// Forward dynamics after inverse dynamics is the identity, and so is its derivative in any
/// direction.
#[test]
fn derivatives_of_forward_and_inverse_dynamics_undo_each_other() {
    Ledger::over(robots(), |case, ledger| {
        let plain = &case.compiled.exact;
        let mut robot = Robot::new(plain.clone());
        let mut over_duals = Robot::new(model(plain));
        let now = case.state::<Dd>(0);
        let n = plain.sizes().n_vy;
        let q = constants(robot.ask_for(kinematics(&[Q]), &[(Y, &now.y)]).ok().get(Q));
        let mut seeded = Seeded::new(case.seed + 77);
        let mut direction = || -> Vec<Dual<Dd>> {
            seeded.numbers(n, 1.0).into_iter().map(|x| Dual::constant(Dd::from(x))).collect()
        };
        let t = Dual::new(Dd::ZERO, Dd::ONE);
        let y = moved(case, &constants(&now.y), &direction(), t);
        let yd = plus(&constants(&now.yd), &times(t, &direction()));
        let ydd = plus(&constants(&now.ydd), &times(t, &direction()));
        let want =
            |request, fields: &[Field]| Query::new(request, FieldSet::EMPTY, FieldSet::of(fields));
        let given = [(Y, y.as_slice()), (Yd, &yd), (Ydd, &ydd)];
        let id = ask_at(
            &mut over_duals,
            want(Request::InverseDynamics, &[TauY, CondKd, CondMy]),
            &given,
            &q,
            1,
        );
        let given = [(Y, y.as_slice()), (Yd, &yd), (TauY, id.get(TauY))];
        let fd = ask_at(&mut over_duals, want(Request::ForwardDynamics, &[Ydd]), &given, &q, 1);
        let [cond, cond_M] = [CondKd, CondMy].map(|field| id.get(field)[0].to_f64());
        let allowed =
            ROUNDING * <Dd as Real>::EPSILON * cond * cond * cond_M * cond_M + case.contradiction();
        let size = largest(&slopes(fd.get(Ydd))).max(largest(&now.ydd));
        ledger.compare(
            "derivative of FD ∘ ID",
            case,
            &slopes(fd.get(Ydd)),
            &slopes(&ydd),
            size,
            allowed,
        );
    });
}
