//! Cassie: its halves are mirror images, and its mass is that of its source.

use sarrus_models::Base;
use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

#[test]
fn the_legs_of_cassie_are_mirror_images_and_each_is_the_leg_alone() {
    let [mut whole, mut alone] =
        ["cassie", "cassie_leg"].map(|name| Robot::new(bundled(name).model));
    // hip roll and hip yaw turn the other way
    let signs = [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let mut seeded = Seeded::new(5);
    for _ in 0..20 {
        let [y, yd, ydd] = [0.25, 1.0, 4.0].map(|size| seeded.numbers(7, size));
        let both = |x: &[f64]| -> Vec<f64> {
            x.iter().copied().chain(x.iter().zip(signs).map(|(x, sign)| sign * x)).collect()
        };
        let want = [Q, TauU, MY];
        let given = [(Y, y.clone()), (Yd, yd), (Ydd, ydd)];
        let own = given.each_ref().map(|(field, x)| (*field, x.as_slice()));
        let own = alone.ask(Request::InverseDynamics, &own, &want).ok();
        let given = given.each_ref().map(|(field, x)| (*field, both(x)));
        let given = given.each_ref().map(|(field, x)| (*field, x.as_slice()));
        let found = whole.ask(Request::InverseDynamics, &given, &want).ok();
        let [q, tau] = [Q, TauU].map(|field| found.get(field));
        assert_close("the left leg", &q[..12], own.get(Q), 1.0, 1e-13);
        assert_close("its motors", &tau[..5], own.get(TauU), 1.0, 1e-12);
        let of_right: Vec<f64> = tau[5..].iter().zip(signs).map(|(x, sign)| sign * x).collect();
        assert_close("motors of the right leg", &of_right, own.get(TauU), 1.0, 1e-12);
        let mass = |i: usize, k: usize| found.get(MY)[14 * i + k];
        for (i, k) in (0..7).flat_map(|i| (0..7).map(move |k| (i, k))) {
            let sign = signs[i] * signs[k];
            let [left, right] = [mass(i, k), sign * mass(i + 7, k + 7)];
            assert_close("inertia", &[left, right], &[own.get(MY)[7 * i + k]; 2], 1.0, 1e-12);
            assert_eq!(mass(i, k + 7), 0.0, "a held pelvis keeps the legs apart");
        }
        // points of the feet, whose z is the hinge's, mirrored in the plane of x and z
        for x in [[0.1, 0.2, 0.05], [-0.3, 0.0, 0.1]] {
            let [left, right] = [("left_foot", x), ("right_foot", [x[0], x[1], -x[2]])]
                .map(|(foot, x)| point_of(&pose(&mut whole, foot, &both(&y)), x));
            assert_close("a foot", &right, &[left[0], -left[1], left[2]], 1.0, 1e-13);
        }
    }
}

#[test]
fn cassie_weighs_what_its_source_says_on_a_free_pelvis() {
    let options = Options { base: Base::Floating, ..Options::default() };
    let loaded = load(&Source::Bundled("cassie".into()), &options).unwrap();
    let mut robot = Robot::new(loaded.compiled.model);
    let sizes = robot.model.sizes();
    assert_eq!((sizes.n_v, sizes.n_vy, sizes.n_u, sizes.n_c), (30, 20, 10, 10));
    let y: Vec<f64> = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0].into_iter().chain([0.0; 14]).collect();
    let found = robot.ask(Request::InverseDynamics, &[(Y, &y)], &[MY, Com, TauY]).ok();
    let legs =
        [1.82, 1.171, 5.52, 0.1567, 0.7578, 0.186, 0.577, 0.782, 0.126, 0.1261, 0.1186, 0.1498];
    // a cross of a gram stands for each ball joint
    let mass = 10.33 + 2.0 * (legs.iter().sum::<f64>() + 0.001);
    for k in 3..6 {
        assert_close("mass", &[found.get(MY)[21 * k]], &[mass], 1.0, 1e-13);
    }
    assert_close("weight", &found.get(TauY)[3..6], &[0.0, 0.0, 9.81 * mass], 1.0, 1e-12);
    // symmetric legs leave the pelvis' own offset
    assert_close("centre of mass", &[found.get(Com)[1]], &[10.33 * 0.000346 / mass], 1.0, 1e-15);
}
