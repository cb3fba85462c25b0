//! Derivatives against central differences in double-double; a step of 1e-8 leaves sixteen digits.

use sarrus_dynamics::description::Terms;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Model, PlanScalar, Query, Request};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::rigid::Pose;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::small::{inner, plus, product, times};

use Field::*;

const STEP: f64 = 1e-8;
/// Error of the differences at condition 1: third derivatives at that step, and rounding.
const ALLOWED: f64 = 1e-12;

/// The state after time t with constant ÿ, to second order in t; a quaternion to first order, with
/// an even error that central differences cancel.
pub(crate) fn later<T: PlanScalar>(case: &Case, state: &State<T>, t: T) -> State<T> {
    let yd = plus(&state.yd, &times(t, &state.ydd));
    let half = T::from_f64(0.5);
    let mean = plus(&state.yd, &times(half * t, &state.ydd));
    let y = moved(case, &state.y, &mean, t);
    State { y, yd, ydd: state.ydd.clone() }
}

/// y + t ẏ; for a floating joint p + t R v, for a quaternion q + t/2 q ω normalised, which is exact
/// to second order.
pub(crate) fn moved<T: PlanScalar>(case: &Case, y: &[T], yd: &[T], t: T) -> Vec<T> {
    let mut y = y.to_vec();
    let mut v = 0;
    let names = case.compiled.model.independent_q_names();
    let mut i = 0;
    while i < y.len() {
        if !names[i].ends_with("/x") && !names[i].ends_with("/qx") {
            y[i] += t * yd[v];
            (i, v) = (i + 1, v + 1);
            continue;
        }
        let floats = names[i].ends_with("/x");
        if floats {
            let linear = turned(&y[i + 3..i + 7], &yd[v + 3..v + 6]);
            (0..3).for_each(|k| y[i + k] += t * linear[k]);
            i += 3;
        }
        let rate = quaternion_rate(&y[i..i + 4], &yd[v..v + 3]);
        (0..4).for_each(|k| y[i + k] += t * rate[k]);
        let length = inner(&y[i..i + 4], &y[i..i + 4]).sqrt();
        (i..i + 4).for_each(|k| y[k] = y[k] / length);
        (i, v) = (i + 4, v + if floats { 6 } else { 3 });
    }
    y
}

/// ½ q ω with ω in the body.
pub(crate) fn quaternion_rate<T: PlanScalar>(q: &[T], w: &[T]) -> [T; 4] {
    let half = T::from_f64(0.5);
    [
        half * (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]),
        half * (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]),
        half * (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]),
        -half * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2]),
    ]
}

/// R(q) v.
pub(crate) fn turned<T: PlanScalar>(q: &[T], v: &[T]) -> [T; 3] {
    let cross = |a: [T; 3], b: [T; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let axis = [q[0], q[1], q[2]];
    let v = [v[0], v[1], v[2]];
    let inner = cross(axis, v);
    let twice =
        cross(axis, [inner[0] + q[3] * v[0], inner[1] + q[3] * v[1], inner[2] + q[3] * v[2]]);
    std::array::from_fn(|k| v[k] + twice[k] + twice[k])
}

/// Sums over the links, without a mass matrix.
pub(crate) struct Sums<T> {
    pub(crate) kinetic: T,
    /// Of gravity, with links that stand still.
    pub(crate) potential: T,
    /// Mass and first moment of the links that move.
    pub(crate) mass: T,
    pub(crate) moment: [T; 3],
    /// Momentum: linear, and angular about the root's origin.
    pub(crate) linear: [T; 3],
    pub(crate) angular: [T; 3],
}

/// a + s b × c.
pub(crate) fn plus_cross<T: PlanScalar>(a: &mut [T; 3], s: T, b: &[T], c: &[T]) {
    for k in 0..3 {
        let i = (k + 1) % 3;
        let j = (k + 2) % 3;
        a[k] += s * (b[i] * c[j] - b[j] * c[i]);
    }
}

/// The sums from masses, poses and twists of the links.
pub(crate) fn sums<T: PlanScalar>(case: &Case, pose: &[T], twist: &[T]) -> Sums<T> {
    let none = [T::ZERO; 3];
    let mut sums = Sums {
        kinetic: T::ZERO,
        potential: T::ZERO,
        mass: T::ZERO,
        moment: none,
        linear: none,
        angular: none,
    };
    let links = case.description.links.iter().zip(pose.chunks_exact(7)).zip(twist.chunks_exact(6));
    for ((link, pose), twist) in links {
        let Some(inertial) = &link.inertial else { continue };
        let mass = T::from_f64(inertial.mass);
        let arm = turned(&pose[3..], &inertial.origin.xyz.map(T::from_f64));
        let w = &twist[..3];
        let mut v = [twist[3], twist[4], twist[5]];
        plus_cross(&mut v, T::ONE, w, &arm);
        let centre: [T; 3] = std::array::from_fn(|k| pose[k] + arm[k]);
        // ω in the axes of the inertia
        let back = [-pose[3], -pose[4], -pose[5], pose[6]];
        let in_link = turned(&back, w);
        let R = Pose::from_rpy(inertial.origin.rpy, [0.0; 3]).R;
        let w: [T; 3] = std::array::from_fn(|k| {
            (0..3).fold(T::ZERO, |sum, i| sum + T::from_f64(R[i][k]) * in_link[i])
        });
        let [xx, xy, xz, yy, yz, zz] = inertial.inertia.map(T::from_f64);
        let turning = [
            xx * w[0] + xy * w[1] + xz * w[2],
            xy * w[0] + yy * w[1] + yz * w[2],
            xz * w[0] + yz * w[1] + zz * w[2],
        ];
        let in_link: [T; 3] = std::array::from_fn(|i| {
            (0..3).fold(T::ZERO, |sum, k| sum + T::from_f64(R[i][k]) * turning[k])
        });
        let turning_in_root = turned(&pose[3..], &in_link);
        sums.kinetic += T::from_f64(0.5) * (mass * inner(&v, &v) + inner(&w, &turning));
        plus_cross(&mut sums.angular, mass, &centre, &v);
        let moves = twist.iter().any(|x| *x != T::ZERO);
        if moves {
            sums.mass += mass;
        }
        for k in 0..3 {
            sums.potential += -mass * T::from_f64(case.description.gravity[k]) * centre[k];
            sums.linear[k] += mass * v[k];
            sums.angular[k] += turning_in_root[k];
            if moves {
                sums.moment[k] += mass * centre[k];
            }
        }
    }
    sums
}

/// Kinetic and potential energy of the links.
pub(crate) fn energy<T: PlanScalar>(case: &Case, pose: &[T], twist: &[T]) -> (T, T) {
    let Sums { kinetic, potential, .. } = sums(case, pose, twist);
    (kinetic, potential)
}

/// Poses and twists of all links.
pub(crate) fn frames<T: PlanScalar>(robot: &mut Robot<T>, state: &State<T>) -> (Vec<T>, Vec<T>) {
    let links: Vec<u16> = (0..robot.model.link_names().len() as u16).collect();
    let mut pose = Vec::new();
    let mut twist = Vec::new();
    for some in links.chunks(32) {
        let query = Query::new(
            Request::Kinematics,
            FieldSet::EMPTY,
            FieldSet::of(&[FramePose, FrameTwist]),
        )
        .with_frames(some);
        let x = robot.ask_for(query, &[(Y, &state.y), (Yd, &state.yd)]).ok();
        pose.extend_from_slice(x.get(FramePose));
        twist.extend_from_slice(x.get(FrameTwist));
    }
    (pose, twist)
}

/// Kinetic energy of the rotors, potential energy of the springs, and power of the damping.
pub(crate) fn in_joints<T: PlanScalar>(case: &Case, model: &Model<T>, q: &[T], qd: &[T]) -> [T; 3] {
    let half = T::from_f64(0.5);
    let mut kinetic = T::ZERO;
    let mut potential = T::ZERO;
    let mut loss = T::ZERO;
    for joint in case.description.joints.iter().filter(|joint| joint.terms != Terms::default()) {
        let Some(v) = model.tree_names().iter().position(|name| *name == joint.name) else {
            continue;
        };
        let Some(k) = model.tree_q_names().iter().position(|name| *name == joint.name) else {
            continue;
        };
        let terms = joint.terms;
        let rate = qd[v];
        let stretch = q[k] - T::from_f64(terms.rest);
        let ratio = T::from_f64(terms.gear_ratio);
        kinetic += half * ratio * ratio * T::from_f64(terms.rotor_inertia) * rate * rate;
        potential += half * T::from_f64(terms.stiffness) * stretch * stretch;
        loss += T::from_f64(terms.damping) * rate * rate;
    }
    [kinetic, potential, loss]
}

/// (b − a) / 2h.
fn slope(a: &[Dd], b: &[Dd]) -> Vec<Dd> {
    a.iter().zip(b).map(|(a, b)| (*b - *a) / Dd::from(2.0 * STEP)).collect()
}

#[test]
fn every_rate_is_the_derivative_of_what_it_is_the_rate_of() {
    Ledger::over(robots(), |case, ledger| {
        let mut robot = Robot::new(case.compiled.exact.clone());
        let n_vy = robot.model.sizes().n_vy;
        let links: Vec<u16> = (0..robot.model.link_names().len().min(32) as u16).collect();
        let now = case.state::<Dd>(0);
        let want = FieldSet::of(&[
            Q, Qd, Qdd, U, Ud, Udd, G, GBias, K, KBias, CondKd, FramePose, FrameTwist, FrameAcc,
        ]);
        let mut at = |t: f64| -> Fields<Dd> {
            let state = later(case, &now, Dd::from(t));
            let query = Query::new(Request::Kinematics, FieldSet::EMPTY, want).with_frames(&links);
            robot.ask_for(query, &[(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)]).ok()
        };
        let [before, x, after] = [-STEP, 0.0, STEP].map(&mut at);
        let cond = x.get(CondKd)[0].to_f64();
        let allowed = ALLOWED * cond + case.contradiction().min(1e-3);
        let speed = largest(x.get(Qd)).max(1.0);
        let change = |field: Field| slope(before.get(field), after.get(field));
        let mut check = |what: &str, a: &[Dd], b: &[Dd], size: f64| {
            ledger.compare(what, case, a, b, size, allowed)
        };

        // joints of one degree of freedom have the same name in q and q̇
        let q_names = case.compiled.model.tree_q_names();
        let v_names = case.compiled.model.tree_names();
        let rate = change(Q);
        for (k, name) in q_names.iter().enumerate() {
            if let Some(v) = v_names.iter().position(|x| x == name) {
                check("q̇", &[rate[k]], &[x.get(Qd)[v]], speed);
            }
        }
        check("q̈", &change(Qd), x.get(Qdd), speed.powi(2));
        check("u̇", &change(U), x.get(Ud), speed);
        check("ü", &change(Ud), x.get(Udd), speed.powi(2));
        check("g = Ġ ẏ", &product(&change(G), &now.yd), x.get(GBias), speed.powi(2));
        assert_eq!(x.get(G).len() % n_vy.max(1), 0);
        let k_bias: Vec<Dd> = product(&change(K), x.get(Qd)).into_iter().map(|x| -x).collect();
        check("k = −K̇ q̇", &k_bias, x.get(KBias), largest(x.get(K)).max(1.0) * speed.powi(2));

        // frames: positions, quaternions (½ ω q, ω in world axes), twists
        let poses = change(FramePose);
        let twists = x.get(FrameTwist);
        let size = largest(twists).max(speed);
        for ((rate, pose), twist) in
            poses.chunks_exact(7).zip(x.get(FramePose).chunks_exact(7)).zip(twists.chunks_exact(6))
        {
            check("frame velocity", &rate[..3], &twist[3..], size);
            let back = [-pose[3], -pose[4], -pose[5], pose[6]];
            let in_body = turned(&back, &twist[..3]);
            check("quaternion rate", &rate[3..], &quaternion_rate(&pose[3..], &in_body), size);
        }
        check(
            "frame acceleration",
            &change(FrameTwist),
            x.get(FrameAcc),
            size.powi(2).max(largest(x.get(FrameAcc))),
        );
    });
}

#[test]
fn power_is_the_rate_of_energy() {
    Ledger::over(robots(), |case, ledger| {
        let mut robot = Robot::new(case.compiled.exact.clone());
        let now = case.state::<Dd>(1);
        let want = [TauY, MY, CondKd, Q, Qd];
        let x = robot
            .ask(Request::InverseDynamics, &[(Y, &now.y), (Yd, &now.yd), (Ydd, &now.ydd)], &want)
            .ok();
        let mut energy_at = |t: f64| {
            let state = later(case, &now, Dd::from(t));
            let (pose, twist) = frames(&mut robot, &state);
            let (kinetic, potential) = energy(case, &pose, &twist);
            let x =
                robot.ask(Request::Kinematics, &[(Y, &state.y), (Yd, &state.yd)], &[Q, Qd]).ok();
            let [rotors, springs, _] = in_joints(case, &robot.model, x.get(Q), x.get(Qd));
            (kinetic + rotors, potential + springs)
        };
        let (kinetic, _) = energy_at(0.0);
        let half = Dd::from(0.5) * inner(&now.yd, &product(x.get(MY), &now.yd));
        let cond = x.get(CondKd)[0].to_f64();
        // the inertia's frame is rotated in double
        ledger.note(
            "½ ẏᵀ M_y ẏ",
            case,
            ((half - kinetic) / kinetic).to_f64().abs(),
            1e-14 * cond + case.contradiction(),
        );
        let before = energy_at(-STEP);
        let after = energy_at(STEP);
        let sum = |x: (Dd, Dd)| x.0 + x.1;
        let rate = (sum(after) - sum(before)) / Dd::from(2.0 * STEP);
        let [_, _, loss] = in_joints(case, &case.compiled.exact, x.get(Q), x.get(Qd));
        let power = inner(x.get(TauY), &now.yd) - loss;
        let terms =
            x.get(TauY).iter().zip(&now.yd).fold(0.0, |sum, (a, b)| sum + (*a * *b).to_f64().abs());
        let size = terms.max(kinetic.to_f64()).max(loss.to_f64());
        ledger.note(
            "Ė = τ_y · ẏ less damping",
            case,
            (rate - power).to_f64().abs() / size,
            1e-11 * cond + case.contradiction(),
        );
    });
}
