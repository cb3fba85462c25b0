//! Derivatives by the geometry: against differences of models that are compiled from displaced
//! joints and cuts, and against G, K and the Jacobians of frames, whose columns are those of
//! displacements along the axis of a joint.

use sarrus_dynamics::description::{Description, Joint, JointKind, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Axes, Field, FieldSet, Model, Plan, PlanScalar, Query, Request, Status, displaced,
};
use sarrus_generate::{GenerateError, Kernel};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::{Fields, Robot};

use Field::*;

/// Displacement of the differences `[rad, m]`.
const H: f64 = 2e-8;

/// q, poses of frames and residual, by Newton's method.
fn closed(robot: &Description, query: Query, y: &[Dd], q: &[Dd]) -> Option<Fields<Dd>> {
    let mut robot = robot.clone();
    for of in &mut robot.submechanisms {
        of.closed_forms = false;
        if !matches!(of.kind, Kind::Serial | Kind::Transmission | Kind::Differential) {
            of.kind = Kind::Numerical;
        }
    }
    let exact = Model::compile(&robot).ok()?.exact;
    let x = Robot::new(exact).ask_for(query, &[(Y, y), (QGuess, q)]);
    (x.answer.status == Status::Ok).then_some(x)
}

/// The vector of the turn from one quaternion to another near it.
fn turn(from: &[Dd], to: &[Dd]) -> [Dd; 3] {
    let [&[ax, ay, az, aw], &[bx, by, bz, bw]] =
        [from, to].map(|x| <&[Dd; 4]>::try_from(x).unwrap());
    let two = Dd::from_f64(2.0);
    [
        two * (bx * aw - bw * ax - by * az + bz * ay),
        two * (by * aw - bw * ay - bz * ax + bx * az),
        two * (bz * aw - bw * az - bx * ay + by * ax),
    ]
}

/// Compares some columns of a robot; returns how many were compared.
fn compare(case: &Case, k: u64, most: usize, ledger: &mut Ledger) -> usize {
    let placed = displaced(&case.description, &[], &[]).unwrap();
    let compiled = Model::compile(&placed).unwrap_or_else(|error| panic!("{error}"));
    let model = &compiled.model;
    let names = model.info().geometry();
    let width = model.sizes().n_geometry();
    assert_eq!(names.len(), width, "{}", case.name);
    let n_v = model.sizes().n_v;
    let links = model.link_names().len();
    let frames = [links - 1, links / 2].map(|link| u16::try_from(link).unwrap());
    let query = |want: &[Field]| {
        Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(want)).with_frames(&frames)
    };
    let y = case.state::<Dd>(k).y;
    let exact = Robot::new(compiled.exact.clone())
        .ask_for(query(&[Q, DgammaDtheta]), &[(Y, y.as_slice())])
        .ok();
    let of_y: Vec<f64> = y.iter().map(|x| x.to_f64()).collect();
    let plain = Robot::new(model.clone()).ask_for(query(&[DgammaDtheta, CondKd]), &[(Y, &of_y)]);
    let plain = plain.ok();
    let X = exact.get(DgammaDtheta);
    let size = largest(X).max(1.0);
    for (a, b) in plain.get(DgammaDtheta).iter().zip(X) {
        let allowed = 1e-13 * plain.get(CondKd)[0].powi(2).max(10.0) + case.contradiction();
        ledger.note("doubles", case, (a - b.to_f64()).abs() / size, allowed);
    }
    let mut compared = 0;
    // all six parts in turn
    let stride = (width / most).max(1) | 1;
    for column in (0..width).skip(k as usize % stride).step_by(stride) {
        let [ahead, back] = [H, -H].map(|h| {
            let mut theta = vec![0.0; width];
            theta[column] = h;
            let moved = displaced(&placed, &names, &theta).unwrap();
            closed(&moved, query(&[Q, FramePose, Residual]), &y, exact.get(Q))
        });
        // loops with redundant rows do not close after every displacement
        let (Some(ahead), Some(back)) = (ahead, back) else { continue };
        if [&ahead, &back].iter().any(|x| x.get(Residual)[0].to_f64() > 1e-4 * H) {
            continue;
        }
        compared += 1;
        let slope = |a: Dd, b: Dd| ((a - b) / Dd::from_f64(2.0 * H)).to_f64();
        let mut found: Vec<f64> =
            ahead.get(Q).iter().zip(back.get(Q)).map(|(a, b)| slope(*a, *b)).collect();
        assert_eq!(found.len(), n_v);
        for (a, b) in ahead.get(FramePose).chunks(7).zip(back.get(FramePose).chunks(7)) {
            found.extend(turn(&b[3..], &a[3..]).map(|x| slope(x, Dd::ZERO)));
            found.extend((0..3).map(|k| slope(a[k], b[k])));
        }
        for (row, found) in found.iter().enumerate() {
            let error = (X[row * width + column].to_f64() - found).abs() / size;
            let what = if row < n_v { "joints" } else { "frames" };
            ledger.note(what, case, error, 1e-6);
        }
    }
    compared
}

#[test]
fn derivatives_by_geometry_are_those_of_displaced_models() {
    let mut counts = Vec::new();
    let bundled =
        ["lambda", "torso", "delta", "squeezer", "five_bar", "r3_lambda_r", "wrist", "stewart"];
    let cases: Vec<Case> = bundled.map(Case::bundled).into();
    Ledger::over(&cases, |case, ledger| {
        let compared = compare(case, 1, 48, ledger);
        counts.push(format!("{} {compared}", case.name));
        ledger.note("columns compared", case, if compared >= 8 { 0.0 } else { 2.0 }, 1.0);
    });
    Ledger::over([&Case::bundled("rh5v2_upper_body")], |case, ledger| {
        counts.push(format!("{} {}", case.name, compare(case, 2, 30, ledger)));
    });
    println!("columns: {counts:?}");
}

/// Six numbers of a displacement along the axis of a joint.
fn along(joint: &Joint) -> Option<[f64; 6]> {
    let length = joint.axis.iter().fold(0.0, |sum: f64, x| sum.hypot(*x));
    let [x, y, z] = joint.axis.map(|x| x / length);
    match joint.kind {
        JointKind::Revolute | JointKind::Continuous => Some([x, y, z, 0.0, 0.0, 0.0]),
        JointKind::Prismatic => Some([0.0, 0.0, 0.0, x, y, z]),
        _ => None,
    }
}

fn compare_with_joints<S: PlanScalar>(case: &Case, model: &Model<S>, ledger: &mut Ledger) {
    let info = model.info();
    let link = |k: u64| ((case.seed + k) % info.links.len() as u64) as u16;
    let axes = [Axes::Mixed, Axes::World, Axes::Local][(case.seed % 3) as usize];
    let mut base = Query::new(
        Request::Kinematics,
        FieldSet::EMPTY,
        FieldSet::of(&[DgammaDtheta, G, K, CondKd, JacobianIndependent]),
    )
    .with_frames(&[link(0), link(3)])
    .with_axes(axes);
    if case.seed % 2 == 1 {
        base = base.relative_to(link(7));
    }
    let x = Robot::new(model.clone()).ask_for(base, &[(Y, case.state::<S>(3).y.as_slice())]).ok();
    let [n_v, n_vy, width] = [info.sizes.n_v, info.sizes.n_vy, info.sizes.n_geometry()];
    assert_eq!(info.geometry().len(), width, "{}", case.name);
    let X = x.get(DgammaDtheta);
    let size = largest(X).max(1.0);
    let cond = x.get(CondKd)[0].to_f64().max(1.0).powi(2);
    // the axis is a double
    let allowed = 1e-14 + 1e3 * S::EPSILON * cond + case.contradiction();
    // couplings and idle joints hold the coordinate, wherever its place is
    let joints = &case.description.joints;
    let mut held: Vec<&str> =
        info.closures.iter().flat_map(|of| &of.idle).map(|x| &x[..]).collect();
    for (j, coupling) in joints.iter().filter_map(|x| Some((x, x.coupling.as_ref()?))) {
        held.push(&j.name);
        let curves = coupling.curves.iter().map(|(master, _)| master);
        let masters = coupling.terms.iter().map(|(master, _)| master).chain(curves);
        held.extend(masters.map(|master| &joints[*master].name[..]));
    }
    for (n, joint) in info.joints().enumerate() {
        let described = joints.iter().find(|x| x.name == joint.name).unwrap();
        let Some(axis) = along(described).filter(|_| !held.contains(&joint.name)) else { continue };
        let v = joint.v.start;
        let moved: Vec<f64> = X
            .chunks(width)
            .map(|row| (0..6).map(|k| row[6 * n + k].to_f64() * axis[k]).sum())
            .collect();
        let y = info.independent.iter().position(|name| *name == info.tree[v]);
        let expected = |row: usize| match y {
            // as that of the joint itself, which stands still
            Some(k) if row < n_v => {
                x.get(G)[row * n_vy + k].to_f64() - f64::from(u8::from(row == v))
            }
            Some(k) => x.get(JacobianIndependent)[(row - n_v) * n_vy + k].to_f64(),
            None => -f64::from(u8::from(row == v)),
        };
        for (row, found) in moved.iter().enumerate() {
            let error = (found - expected(row)).abs() / size;
            let what = format!("joints as they move, {}", std::any::type_name::<S>());
            ledger.note(&what, case, error, allowed);
        }
        // K X = −∂φ/∂θ, which is the column of the joint
        for row in x.get(K).chunks(n_v.max(1)) {
            let left = row.iter().zip(&moved).map(|(k, x)| k.to_f64() * x).sum::<f64>();
            let error = (left + row[v].to_f64()).abs() / size;
            ledger.note("K X = −∂φ/∂θ", case, error, allowed);
        }
    }
}

#[test]
fn displacements_along_joints_are_those_of_their_motion() {
    Ledger::over(robots().iter().step_by(2), |case, ledger| {
        compare_with_joints(case, &case.compiled.model, ledger);
        if case.seed % 5 == 0 {
            compare_with_joints::<Dd>(case, &case.compiled.exact, ledger);
        }
    });
}

#[test]
fn picked_rows_have_the_numbers_of_all_and_other_plans_and_kernels_have_none() {
    let case = Case::bundled("rh5v2_upper_body");
    let model = &case.compiled.model;
    let y = case.state::<f64>(1).y;
    let width = model.sizes().n_geometry();
    let base = Query::new(Request::Kinematics, Y.into(), DgammaDtheta.into());
    let all = Robot::new(model.clone()).ask_for(base, &[(Y, &y)]).ok();
    let picked = base.with_joints([4_u16, 9]);
    let rows = Robot::new(model.clone()).ask_for(picked, &[(Y, &y)]).ok();
    let X = all.get(DgammaDtheta);
    assert_eq!(
        rows.get(DgammaDtheta),
        [&X[4 * width..][..width], &X[9 * width..][..width]].concat()
    );
    let closed = |query: &Query| Plan::new(model, query).unwrap().outline(model);
    assert!(closed(&picked).closed < closed(&base).closed);
    assert!(closed(&base).steps.contains(&"derivatives by geometry"));
    let field = Kernel::trace(model, &Plan::new(model, &base).unwrap()).unwrap_err();
    assert!(matches!(field, GenerateError::Field(DgammaDtheta)), "{field}");
    let query = Query::new(Request::InverseDynamics, Y.into(), Q | TauU | DtauYDy);
    assert!(!closed(&query).steps.contains(&"derivatives by geometry"));
}
