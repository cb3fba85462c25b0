//! Forces by parameters: the matrices of a robot give the forces of every robot that differs from
//! it in inertia, rotors and friction alone.

use sarrus_dynamics::description::{Description, Friction, Inertial, JointKind, Placement, Terms};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Model, PlanScalar, Query, QueryOptions, Request};
use sarrus_tests::cases::{Case, Ledger, State, robots};
use sarrus_tests::compare::{assert_close, error_by_size, largest};
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::product;

use Field::*;

fn ask<S: PlanScalar>(
    model: &Model<S>,
    state: &State<S>,
    q_guess: Option<&[S]>,
    want: &[Field],
) -> Fields<S> {
    let base = Query::new(Request::InverseDynamics, FieldSet::EMPTY, FieldSet::of(want));
    let mut given = vec![(Y, state.y.as_slice()), (Yd, &state.yd), (Ydd, &state.ydd)];
    given.extend(q_guess.map(|q| (QGuess, q)));
    Robot::new(model.clone()).ask_for(base.with_options(QueryOptions::FRICTION), &given).ok()
}

/// The robot with random masses, rotors and friction, and without springs.
fn with_other_parameters(case: &Case) -> Description {
    let mut description = case.description.clone();
    let mut seeded = Seeded::new(case.seed ^ 0x9a4a);
    for link in &mut description.links {
        let mass = seeded.within(0.3, 2.0);
        let [xx, yy, zz] = [(); 3].map(|()| seeded.within(0.02, 0.03) * mass);
        let [xy, xz, yz] = [(); 3].map(|()| seeded.within(-0.002, 0.002) * mass);
        link.inertial = Some(Inertial {
            origin: Placement { xyz: seeded.vector(0.2), rpy: seeded.vector(1.0) },
            mass,
            inertia: [xx, xy, xz, yy, yz, zz],
        });
    }
    for joint in &mut description.joints {
        let is_single = !matches!(joint.kind, JointKind::Spherical | JointKind::Floating);
        joint.terms = match joint.kind {
            JointKind::Fixed => joint.terms,
            JointKind::Spherical => Terms { damping: seeded.within(0.1, 2.0), ..Terms::default() },
            _ if !is_single => Terms::default(),
            _ => Terms {
                damping: seeded.within(0.1, 2.0),
                stiffness: 0.0,
                rotor_inertia: seeded.within(0.001, 0.01),
                gear_ratio: seeded.within(1.0, 4.0),
                // where a joint has friction its speed stays
                friction: Friction {
                    coulomb: seeded.within(0.1, 2.0),
                    viscous: seeded.within(0.1, 2.0),
                    ..joint.terms.friction
                },
                ..joint.terms
            },
        };
    }
    description
}

fn sum_of_parts<S: Real>(row: &[S], parameters: &[S]) -> f64 {
    row.iter().zip(parameters).map(|(x, p)| (*x * *p).to_f64().abs()).sum()
}

fn compare<S: PlanScalar>(
    case: &Case,
    [model, other]: [&Model<S>; 2],
    k: u64,
    ledger: &mut Ledger,
) {
    let state = case.state::<S>(k);
    let forces = [TauY, TauU];
    let regressors = [RegressorY, RegressorU];
    let x = ask(model, &state, None, &[&regressors[..], &[Q, CondKd, CondGu]].concat());
    let tau = ask(other, &state, Some(x.get(Q)), &[&forces[..], &[Q]].concat());
    let parameters = other.parameters();
    let cond = x.get(CondKd)[0].to_f64().powi(2) * x.get(CondGu)[0].to_f64();
    let allowed = 500.0 * S::EPSILON * cond.max(1.0);
    let n = parameters.len();
    for (force, regressor) in forces.into_iter().zip(regressors) {
        let matrix = x.get(regressor);
        let size =
            matrix.chunks_exact(n).map(|row| sum_of_parts(row, &parameters)).fold(1.0, f64::max);
        let error = error_by_size(&product(matrix, &parameters), tau.get(force), size);
        let what = format!("{} in {}", regressor.name(), std::any::type_name::<S>());
        ledger.note(&what, case, error, allowed + case.contradiction());
    }
}

#[test]
fn forces_of_other_masses_and_friction_are_linear_in_them() {
    Ledger::over(robots(), |case, ledger| {
        let other = Model::compile(&with_other_parameters(case)).unwrap();
        compare(case, [&case.compiled.model, &other.model], case.seed % 2, ledger);
        compare::<Dd>(case, [&case.compiled.exact, &other.exact], 2 + case.seed % 2, ledger);
    });
}

/// The parameters are those of the files: mass, first moment, inertia about the link's origin.
#[test]
fn parameters_are_about_the_origin_of_the_link_in_its_axes() {
    let case = Case::bundled("lambda");
    let parameters = case.compiled.model.parameters();
    let info = case.compiled.model.info();
    let names = info.parameters();
    assert_eq!(names.len(), info.sizes.n_parameters());
    assert_eq!(parameters.len(), names.len());
    let value = |name: &str| parameters[names.iter().position(|x| x == name).unwrap()];
    let mut compared = 0;
    for joint in info.joints() {
        let described = case.description.joints.iter().find(|x| x.name == joint.name).unwrap();
        let link = described.child;
        let is_alone =
            !case.description.joints.iter().any(|x| x.parent == link && x.kind == JointKind::Fixed);
        let Some(Inertial { origin, mass, inertia }) = case.description.links[link].inertial else {
            continue;
        };
        if !is_alone || origin.rpy != [0.0; 3] {
            continue;
        }
        compared += 1;
        let [x, y, z] = origin.xyz;
        let of = |part: &str| value(&format!("{}/{part}", joint.name));
        let [xx, xy, xz, yy, yz, zz] = inertia;
        let expected = [
            ("m", mass),
            ("mx", mass * x),
            ("my", mass * y),
            ("mz", mass * z),
            ("ixx", xx + mass * (y * y + z * z)),
            ("ixy", xy - mass * x * y),
            ("iyy", yy + mass * (x * x + z * z)),
            ("ixz", xz - mass * x * z),
            ("iyz", yz - mass * y * z),
            ("izz", zz + mass * (x * x + y * y)),
        ];
        for (part, x) in expected {
            assert!((of(part) - x).abs() <= 1e-15 * (1.0 + mass), "{} {part}", joint.name);
        }
    }
    assert!(compared >= 2, "{compared} bodies compared");
}

/// Rows that are picked, a robot at rest, and matrices asked for alone have the same numbers.
#[test]
fn picked_rows_and_rest_have_the_numbers_of_all() {
    let case = Case::bundled("rh5v2_upper_body");
    let model = &case.compiled.model;
    let mut state = case.state::<f64>(1);
    let n = model.sizes().n_parameters();
    let all = ask(model, &state, None, &[RegressorY, RegressorU]);
    let u = ask(model, &state, None, &[RegressorU]);
    assert_eq!(u.get(RegressorU), all.get(RegressorU));
    let picked = [3_u16, 7];
    let names: Vec<&String> = picked.iter().map(|v| &model.tree_names()[usize::from(*v)]).collect();
    let base = Query::new(
        Request::InverseDynamics,
        FieldSet::EMPTY,
        FieldSet::of(&[RegressorY, RegressorU]),
    )
    .with_joints(picked);
    let given = [(Y, state.y.as_slice()), (Yd, &state.yd), (Ydd, &state.ydd)];
    let x = Robot::new(model.clone()).ask_for(base, &given).ok();
    for (field, order) in
        [(RegressorY, model.independent_names()), (RegressorU, model.active_names())]
    {
        let rows: Vec<f64> = (order.iter().enumerate())
            .filter(|(_, name)| names.contains(name))
            .flat_map(|(k, _)| all.get(field)[k * n..(k + 1) * n].to_vec())
            .collect();
        assert_eq!(x.get(field), rows, "{}", field.name());
    }
    state.yd.fill(0.0);
    state.ydd.fill(0.0);
    let still = ask(model, &state, None, &[RegressorY]);
    let base =
        Query::new(Request::InverseDynamics, FieldSet::EMPTY, FieldSet::of(&[RegressorY, TauY]));
    let rest = Robot::new(model.clone()).ask_for(base, &[(Y, state.y.as_slice())]).ok();
    assert_eq!(rest.get(RegressorY), still.get(RegressorY));
    let tau = product(rest.get(RegressorY), &model.parameters());
    assert_close("forces at rest", &tau, rest.get(TauY), largest(rest.get(TauY)), 1e-13);
}
