//! Sums over the links (centre of mass, momentum, energy) against those of poses and twists.

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, LinkId, Model, PlanScalar, Query, Request, Status,
};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::Robot;
use sarrus_tests::small::{inner, product, times};

use crate::derivatives::{frames, in_joints, plus_cross, sums};

use Field::*;

const WANT: [Field; 6] = [Com, ComJacobian, ComBias, Momentum, Centroidal, Energy];
/// Rounding allowed, in units of the scalar.
const ROUNDING: f64 = 256.0;

fn compare_on<S: PlanScalar>(case: &Case, model: &Model<S>, ledger: &mut Ledger, scalar: &str) {
    let mut robot = Robot::new(model.clone());
    let now = case.state::<S>(0);
    let (pose, twist) = frames(&mut robot, &now);
    let links = sums(case, &pose, &twist);
    let given = [(Y, now.y.as_slice()), (Yd, &now.yd), (Ydd, &now.ydd)];
    let want = [&WANT[..], &[Q, Qd]].concat();
    let x = robot.ask(Request::Kinematics, &given, &want).ok();
    let scale = case.scale.max(largest(&pose).to_f64());
    let speed = largest(x.get(Qd)).max(1.0);
    let mass = links.mass.to_f64();
    let allowed = ROUNDING * S::EPSILON * case.compiled.model.sizes().n_v as f64;
    // the sums turn an inertia by a rotation in doubles
    let of_inertia = allowed.max(ROUNDING * f64::EPSILON);
    let mut check = |what: &str, a: &[S], b: &[S], least: f64, allowed: f64| {
        ledger.compare(&format!("{what} in {scalar}"), case, a, b, least, allowed)
    };

    let moment = times(links.mass, x.get(Com));
    check("m com = Σ m c", &moment, &links.moment, mass * scale, allowed);
    // the momentum about the root's origin, moved to the centre of mass
    let mut angular = links.angular;
    plus_cross(&mut angular, -S::ONE, x.get(Com), &links.linear);
    let momentum = [angular, links.linear].concat();
    check(
        "momentum",
        x.get(Momentum),
        &momentum,
        mass * scale.max(1.0) * scale.max(1.0) * speed,
        of_inertia,
    );
    let linear = &product(x.get(Centroidal), &now.yd)[3..];
    let of_com = times(links.mass, &product(x.get(ComJacobian), &now.yd));
    check("m J_com ẏ", &of_com, linear, mass * scale.max(1.0) * speed, allowed);

    let [rotors, springs, _] = in_joints(case, model, x.get(Q), x.get(Qd));
    let gravity = case.description.gravity.map(S::from_f64);
    let kinetic = links.kinetic + rotors;
    let potential = springs - inner(&gravity, &links.moment);
    let weight = mass * scale * largest(&gravity).max(1.0) + springs.to_f64();
    check("kinetic energy", &x.get(Energy)[..1], &[kinetic], kinetic.to_f64(), of_inertia);
    check("potential energy", &x.get(Energy)[1..], &[potential], weight, allowed);
    let of_mass = robot.ask(Request::InverseDynamics, &given, &[MY, Energy, Com, Momentum]).ok();
    let twice = inner(&product(of_mass.get(MY), &now.yd), &now.yd);
    check("2 T = ẏᵀ M_y ẏ", &[x.get(Energy)[0] + x.get(Energy)[0]], &[twice], 0.0, allowed);

    // the same bits beside forces, and at rest nothing moves
    for field in [Energy, Com, Momentum] {
        let same = of_mass.get(field).iter().zip(x.get(field)).all(|(a, b)| a == b);
        assert!(same, "{}: {}", case.name, field.name());
    }
    let rest = robot.ask(Request::Kinematics, &given[..1], &[Momentum, ComBias, Energy]).ok();
    let [momentum, bias] = [Momentum, ComBias].map(|field| rest.get(field));
    assert!(momentum.iter().chain(bias).chain(&rest.get(Energy)[..1]).all(|x| *x == S::ZERO));
}

#[test]
fn sums_over_the_links_are_those_of_their_poses_and_twists() {
    Ledger::over(robots(), |case, ledger| {
        compare_on(case, &case.compiled.model, ledger, "double");
        compare_on(case, &case.compiled.exact, ledger, "double-double");
    });
}

#[test]
fn a_robot_without_mass_has_no_centre_of_it_and_no_kinetic_energy() {
    let mut robot = DescriptionBuilder::new("massless");
    let mut inertial = Inertial::point(0.0, [0.0; 3]);
    inertial.inertia = [0.0; 6];
    robot.revolute("pivot", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(inertial);
    let mut robot = Robot::new(robot.compile().unwrap().model);
    let base =
        |want: &[Field]| Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(want));
    let given: [(Field, &[f64]); 2] = [(Y, &[0.3]), (Yd, &[2.0])];
    for field in [Com, ComJacobian, ComBias, Momentum, Centroidal] {
        let x = robot.ask_for(base(&[field]), &given);
        assert_eq!(x.answer.status, Status::MassNotPositive, "{}", field.name());
        assert!(x.get(field).iter().all(|x| x.is_nan()));
    }
    assert_eq!(robot.ask_for(base(&[Energy]), &given).ok().get(Energy), [0.0, 0.0]);
}
