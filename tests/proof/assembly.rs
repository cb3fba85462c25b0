//! Assembly: closed poses near given ones.

use sarrus_dynamics::description::{Cut, Description};
use sarrus_dynamics::{
    AssembleError, Field, Model, OpenModel, Request, closing_placements, rezeroed,
};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::error_by_size;
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{product, transposed};

/// A pose near a closed one: each joint that is not a quaternion is moved by up to `size` radians
/// or lengths.
fn beside(case: &Case, robot: &mut Robot<f64>, seeded: &mut Seeded, size: f64) -> Option<Vec<f64>> {
    let state = case.state::<f64>(seeded.bits() % 100);
    let fields = robot.ask(Request::Kinematics, &[(Field::Y, &state.y)], &[Field::Q]);
    if fields.answer.status.name() != "ok" {
        return None;
    }
    let model = &case.compiled.model;
    let units = model.tree_units();
    let mut q = fields.get(Field::Q).to_vec();
    for (x, name) in q.iter_mut().zip(model.tree_q_names()) {
        // a joint of one degree of freedom has the same name among the velocities
        if let Some(v) = model.tree_names().iter().position(|of| of == name && !name.contains('/'))
        {
            *x += seeded.within(-size, size) * units[v];
        }
    }
    Some(q)
}

/// Change of each joint by tree velocity; quaternion joints must not move.
fn gone(model: &Model, q: &[f64], near: &[f64]) -> Vec<f64> {
    let way = model.tree_names().iter().map(|name| {
        match model.tree_q_names().iter().position(|of| of == name) {
            Some(at) if !name.contains('/') => q[at] - near[at],
            _ => 0.0,
        }
    });
    way.collect()
}

#[test]
fn poses_beside_closed_ones_are_closed_and_nearest() {
    Ledger::over(robots(), |case, ledger| {
        let model = &case.compiled.model;
        let mut robot = Robot::new(model.clone());
        let mut seeded = Seeded::new(case.seed);
        let n = model.sizes().n_v;
        for _ in 0..3 {
            let Some(near) = beside(case, &mut robot, &mut seeded, 0.03) else { continue };
            let weights: Vec<f64> = (0..n).map(|_| seeded.within(0.2, 5.0)).collect();
            let found = model.assemble(&near, &weights).unwrap_or_else(|error| panic!("{error}"));
            ledger.note(
                "residual of a closed pose",
                case,
                found.residual,
                1e-12 + case.contradiction(),
            );

            // the robot's closure at these independents, continued from that pose, gives the same
            // pose
            let closed = robot
                .ask(
                    Request::Kinematics,
                    &[(Field::Q, &found.q)],
                    &[Field::Q, Field::G, Field::CondKd],
                )
                .ok();
            let allowed =
                1e-12 * closed.get(Field::CondKd)[0].max(1.0) + 10.0 * case.contradiction();
            ledger.note(
                "closure of the found pose",
                case,
                error_by_size(&found.q, closed.get(Field::Q), 1.0),
                allowed,
            );

            // at the nearest pose the weighted change is a combination of the rows of K, so that Gᵀ
            // takes it to zero
            let way = gone(model, &found.q, &near);
            let pull: Vec<f64> = way
                .iter()
                .zip(&weights)
                .zip(model.tree_units())
                .map(|((d, w), unit)| w * d / (unit * unit))
                .collect();
            let along = transposed(closed.get(Field::G), &pull, model.sizes().n_vy);
            let scale = transposed(
                &closed.get(Field::G).iter().map(|x| x.abs()).collect::<Vec<_>>(),
                &pull.iter().map(|x| x.abs()).collect::<Vec<_>>(),
                along.len(),
            );
            let worst = along.iter().zip(&scale).fold(0.0, |worst: f64, (x, size)| {
                if *size > 0.0 { worst.max(x.abs() / size) } else { worst }
            });
            ledger.note(
                "slope of the distance along closed poses",
                case,
                worst,
                1e-10 + 1e3 * case.contradiction(),
            );
            let square: f64 = way
                .iter()
                .zip(&weights)
                .zip(model.tree_units())
                .map(|((d, w), unit)| w * (d / unit).powi(2))
                .sum();
            ledger.note("distance", case, (square.sqrt() - found.distance).abs(), 1e-12);

            // and no neighbouring closed pose is nearer
            for _ in 0..4 {
                let dy: Vec<f64> = (0..model.sizes().n_vy)
                    .map(|_| seeded.within(-1e-3, 1e-3) * case.scale.min(1.0))
                    .collect();
                let step = product(closed.get(Field::G), &dy);
                let other: f64 = way
                    .iter()
                    .zip(&step)
                    .zip(&weights)
                    .zip(model.tree_units())
                    .map(|(((d, s), w), unit)| w * ((d + s) / unit).powi(2))
                    .sum();
                let size: f64 =
                    step.iter().zip(model.tree_units()).map(|(s, unit)| (s / unit).powi(2)).sum();
                assert!(
                    other + 40.0 * size * (1.0 + square.sqrt()) > square,
                    "{}: a nearer pose",
                    case.name
                );
            }
        }
    });
}

#[test]
fn a_closed_pose_is_its_own_nearest() {
    Ledger::over(robots(), |case, ledger| {
        let model = &case.compiled.model;
        let mut robot = Robot::new(model.clone());
        let Some(near) = beside(case, &mut robot, &mut Seeded::new(case.seed), 0.0) else { return };
        let found = model
            .assemble(&near, &vec![1.0; model.sizes().n_v])
            .unwrap_or_else(|error| panic!("{error}"));
        ledger.note(
            "way of a closed pose",
            case,
            found.distance,
            1e-10 + 100.0 * case.contradiction(),
        );
    });
}

#[test]
fn a_joint_of_infinite_weight_stays_and_a_heavier_one_goes_less() {
    let case = Case::bundled("lambda");
    let model = &case.compiled.model;
    let near = [0.1, 0.05, -0.02];
    for k in 0..3 {
        let mut weights = [1.0; 3];
        weights[k] = f64::INFINITY;
        let found = model.assemble(&near, &weights).unwrap();
        assert_eq!(found.q[k].to_bits(), near[k].to_bits(), "joint {k} moved");
        let way = |weight: f64| {
            let mut weights = [1.0; 3];
            weights[k] = weight;
            (model.assemble(&near, &weights).unwrap().q[k] - near[k]).abs()
        };
        assert!(way(0.0) > way(1.0) && way(1.0) > way(100.0) && way(100.0) > way(1e4), "joint {k}");
    }
    // weights in another unit give the same result
    let one = model.assemble(&near, &[1.0, 2.0, 3.0]).unwrap();
    let thousand = model.assemble(&near, &[1e30, 2e30, 3e30]).unwrap();
    assert!(error_by_size(&one.q, &thousand.q, 1.0) < 1e-12);
    assert!((thousand.distance / one.distance / 1e15 - 1.0).abs() < 1e-9);
}

#[test]
fn every_joint_free_is_closed_by_small_steps() {
    let case = Case::bundled("wrist");
    let model = &case.compiled.model;
    let mut robot = Robot::new(model.clone());
    let near = beside(&case, &mut robot, &mut Seeded::new(5), 0.05).unwrap();
    let found = model.assemble(&near, &vec![0.0; model.sizes().n_v]).unwrap();
    assert!(found.residual < 1e-12 && found.distance == 0.0, "{found:?}");
    assert!(error_by_size(&found.q, &near, 1.0) < 0.2);
}

#[test]
fn what_cannot_be_closed_is_unreachable_with_the_nearest_pose() {
    let case = Case::bundled("lambda");
    let model = &case.compiled.model;
    // positions of rocker and slider that contradict each other
    let weights = [f64::INFINITY, 1.0, f64::INFINITY];
    let near = [0.0, 0.3, 0.05];
    let Err(AssembleError::Unreachable { residual, nearest }) = model.assemble(&near, &weights)
    else {
        panic!("reached")
    };
    assert_eq!([nearest[0], nearest[2]], [near[0], near[2]]);
    // the stator turns to bring the slider as near to the pin as it can
    assert!((0.01..1.0).contains(&residual), "{residual}");
    let at = |stator: f64| match model.assemble(&[near[0], stator, near[2]], &[f64::INFINITY; 3]) {
        Err(AssembleError::Unreachable { residual, .. }) => residual,
        other => panic!("{other:?}"),
    };
    assert!(at(near[1]) > residual);
    // if every joint is kept, the given pose is the nearest
    let kept = model.assemble(&near, &[f64::INFINITY; 3]);
    assert!(matches!(kept, Err(AssembleError::Unreachable { nearest, .. }) if nearest == near));
    // a closed pose may be kept entirely
    assert_eq!(model.assemble(&model.tree_zero(), &[f64::INFINITY; 3]).unwrap().distance, 0.0);
}

#[test]
fn lists_of_wrong_sizes_and_numbers_without_meaning_are_typed() {
    let case = Case::bundled("lambda");
    let model = &case.compiled.model;
    let weights = [1.0; 3];
    assert!(matches!(
        model.assemble(&[0.0; 2], &weights),
        Err(AssembleError::WrongSize { found: 2, expected: 3, .. })
    ));
    assert!(matches!(
        model.assemble(&[0.0; 3], &[1.0; 4]),
        Err(AssembleError::WrongSize { found: 4, expected: 3, .. })
    ));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = model.assemble(&[0.0, bad, 0.0], &weights).unwrap_err();
        assert!(
            matches!(&error, AssembleError::BadPose { name, .. } if name == "ElbowB11"),
            "{error}"
        );
    }
    for bad in [f64::NAN, -1.0, f64::NEG_INFINITY] {
        let error = model.assemble(&[0.0; 3], &[1.0, 1.0, bad]).unwrap_err();
        assert!(
            matches!(&error, AssembleError::BadWeights { name, .. } if name == "ElbowAct"),
            "{error}"
        );
    }
    // a pose far beyond every length has a status too
    for huge in [1e6, 1e200, f64::MAX] {
        let _ = model.assemble(&[huge, -huge, huge], &weights);
    }
    // a quaternion must have unit length
    let floating = robots().iter().find(|case| case.floats()).unwrap();
    let model = &floating.compiled.model;
    let mut near = model.tree_zero();
    let weights = vec![1.0; model.sizes().n_v];
    assert!(model.assemble(&near, &weights).is_ok());
    let quaternion = model.tree_q_names().iter().position(|name| name.contains('/')).unwrap();
    near[quaternion..quaternion + 7].fill(0.3);
    assert!(matches!(model.assemble(&near, &weights), Err(AssembleError::BadPose { .. })));
    // a part of such a joint cannot be kept
    let mut weights = weights;
    let v = model.tree_names().iter().position(|name| name.contains('/')).unwrap();
    weights[v] = f64::INFINITY;
    assert!(matches!(
        model.assemble(&model.tree_zero(), &weights),
        Err(AssembleError::BadWeights { .. })
    ));
}

/// The description with its zero pose moved to q, which may be open; every placement is explicit.
fn moved(description: &Description, q: &[f64]) -> Description {
    rezeroed(description, q).unwrap()
}

#[test]
fn files_that_are_open_at_zero_are_assembled_and_closed_by_their_new_origins() {
    let mut open_ones = 0;
    Ledger::over(robots().iter().filter(|case| !case.rounded && !case.floats()), |case, ledger| {
        let explicit = case
            .description
            .submechanisms
            .iter()
            .all(|of| of.independent.len() == of.spanning_tree.len() || !of.loops.is_empty());
        if case.is_open() || !explicit {
            return;
        }
        let model = &case.compiled.model;
        let mut robot = Robot::new(model.clone());
        let mut seeded = Seeded::new(case.seed + 7);
        let Some(start) = beside(case, &mut robot, &mut seeded, 0.03) else { return };
        let open = moved(&case.description, &start);
        if let Err(error) = Model::compile(&open) {
            open_ones += 1;
            assert!(!error.errors.is_empty());
        }

        // the nearest closed pose of the open file is the robot's, relative to the other zero pose
        let assembler = OpenModel::compile(&open).unwrap();
        let weights = vec![1.0; model.sizes().n_v];
        let found = assembler
            .assemble(&assembler.tree_zero(), &weights)
            .unwrap_or_else(|error| panic!("{error}"));
        // the clusters have other lengths at the other zero pose
        let there: Vec<f64> = model
            .tree_units()
            .iter()
            .zip(assembler.tree_units())
            .map(|(a, b)| (a / b).powi(2))
            .collect();
        let there = model.assemble(&start, &there).unwrap_or_else(|error| panic!("{error}"));
        let q: Vec<f64> = start.iter().zip(&found.q).map(|(a, b)| a + b).collect();
        let redundant = model.closures().iter().any(|x| x.rank < x.rows);
        let allowed = if redundant { 1e-7 } else { 1e-12 };
        ledger.note(
            "pose of an open file",
            case,
            error_by_size(&q, &there.q, 1.0),
            allowed + 100.0 * case.contradiction(),
        );

        // with the new origins the file is the same robot
        let closed = moved(&open, &found.q);
        let compiled = Model::compile(&closed).unwrap_or_else(|error| panic!("{error}"));
        let mass = |robot: &mut Robot<f64>, q: &[f64]| {
            let fields = robot.ask(Request::InverseDynamics, &[(Field::Q, q)], &[Field::MY]);
            (fields.answer.status.name() == "ok").then(|| fields.get(Field::MY).to_vec())
        };
        let zero = compiled.model.tree_zero();
        let new = mass(&mut Robot::new(compiled.model), &zero);
        if let (Some(old), Some(new)) = (mass(&mut robot, &q), new) {
            let size = old.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            ledger.note(
                "mass matrix of the new zero pose",
                case,
                error_by_size(&new, &old, size),
                1e-10 + 1e3 * case.contradiction(),
            );
        }
    });
    assert!(open_ones > 20, "only {open_ones} robots were open");
}

#[test]
fn a_closing_placement_closes_the_zero_pose() {
    let case = Case::bundled("wrist");
    let mut robot = Robot::new(case.compiled.model.clone());
    let start = beside(&case, &mut robot, &mut Seeded::new(3), 0.05).unwrap();
    let mut open = moved(&case.description, &start);
    assert!(Model::compile(&open).is_err());
    for (s, l, placement) in closing_placements(&open) {
        let Cut::Placed { successor, .. } = &mut open.submechanisms[s].loops[l].cut else {
            panic!("{s} {l}")
        };
        *successor = placement;
    }
    let weights = vec![1.0; start.len()];
    let found =
        OpenModel::compile(&open).unwrap().assemble(&vec![0.0; start.len()], &weights).unwrap();
    assert!(found.residual_before < 1e-13 && found.distance < 1e-12, "{found:?}");
    assert!(Model::compile(&open).is_ok());
}

#[test]
fn the_branch_of_an_assembled_pose_is_that_of_its_answer() {
    Ledger::over(robots(), |case, ledger| {
        let model = &case.compiled.model;
        let mut robot = Robot::new(model.clone());
        let Some(near) = beside(case, &mut robot, &mut Seeded::new(case.seed + 2), 0.01) else {
            return;
        };
        let found = model
            .assemble(&near, &vec![1.0; model.sizes().n_v])
            .unwrap_or_else(|error| panic!("{error}"));
        let answer = robot.ask(Request::Kinematics, &[(Field::Q, &found.q)], &[Field::Branch]);
        if answer.answer.status.name() == "ok" {
            let same = found.branch == answer.get(Field::Branch);
            ledger.note("branches that differ", case, if same { 0.0 } else { 1.0 }, 0.5);
        }
    });
}
