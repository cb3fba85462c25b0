//! Single precision: right to its rounding, or a status that says why not.

use sarrus_dynamics::scalar::{Real, Scalar};
use sarrus_dynamics::{Field, Request, Status};
use sarrus_tests::cases::{Case, Ledger, State};
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::reference::ROBOTS;
use sarrus_tests::run::Robot;

use Field::*;

/// States of each robot.
const STATES: u64 = 40;
/// Rounding allowed at condition 1, in units of the scalar.
const ROUNDING: f64 = 128.0;
/// Distance from which on a pose is another branch's.
const ANOTHER: f64 = 0.02;
const EPSILON: f64 = <f32 as Real>::EPSILON;

/// Every bundled robot.
fn bundled() -> impl Iterator<Item = Case> {
    ROBOTS.into_iter().chain(["stewart_floating", "bricard"]).map(Case::bundled)
}

fn wide(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

fn narrow(x: &[f64]) -> Vec<f32> {
    x.iter().map(|x| *x as f32).collect()
}

/// Both precisions at one state that is exact in both; the statuses of positions, and how far these
/// are apart by size.
fn positions(
    case: &Case,
    single: &mut Robot<f32>,
    double: &mut Robot<f64>,
    k: u64,
) -> (Status, Status, f64) {
    let y = case.state::<f32>(k).y;
    let x = single.ask(Request::Kinematics, &[(Y, &y)], &[Q]);
    let reference = double.ask(Request::Kinematics, &[(Y, &wide(&y))], &[Q]);
    let error = if x.answer.status == Status::Ok && reference.answer.status == Status::Ok {
        error_by_size(&wide(x.get(Q)), reference.get(Q), 1.0)
    } else {
        0.0
    };
    (x.answer.status, reference.answer.status, error)
}

/// Compares everything at one state; false where single precision has no answer.
fn compare(
    case: &Case,
    single: &mut Robot<f32>,
    double: &mut Robot<f64>,
    k: u64,
    ledger: &mut Ledger,
) -> bool {
    let State { y, yd, ydd } = case.state::<f32>(k);
    let [wide_y, wide_yd, wide_ydd] = [&y, &yd, &ydd].map(|x| wide(x));
    let motion: [(Field, &[f64]); 3] = [(Y, &wide_y), (Yd, &wide_yd), (Ydd, &wide_ydd)];
    let reference = double.ask(Request::Kinematics, &motion, &[Q, Qd, Qdd, CondKd]).ok();
    let forces = double.ask(Request::InverseDynamics, &motion, &[TauQ, TauY, CondMy]).ok();
    let tau = narrow(forces.get(TauY));
    let forward = double
        .ask(Request::ForwardDynamics, &[motion[0], motion[1], (TauY, &wide(&tau))], &[Ydd])
        .ok();

    let motion: [(Field, &[f32]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
    let x = single.ask(Request::Kinematics, &motion, &[Q, Qd, Qdd]);
    let tau_y = single.ask(Request::InverseDynamics, &motion, &[TauY]);
    let ydd = single.ask(Request::ForwardDynamics, &[motion[0], motion[1], (TauY, &tau)], &[Ydd]);
    if [&x, &tau_y, &ydd].iter().any(|x| x.answer.status != Status::Ok) {
        return false;
    }

    let (cond, cond_M) = (reference.get(CondKd)[0], forces.get(CondMy)[0]);
    let allowed = ROUNDING * EPSILON * cond;
    let speed = largest(reference.get(Qd)).max(1.0);
    let rate = speed.powi(2).max(largest(reference.get(Qdd)));
    ledger.compare("q", case, &wide(x.get(Q)), reference.get(Q), 1.0, allowed);
    ledger.compare("q̇", case, &wide(x.get(Qd)), reference.get(Qd), speed, allowed);
    ledger.compare("q̈", case, &wide(x.get(Qdd)), reference.get(Qdd), rate, allowed * cond);
    let force = largest(forces.get(TauQ));
    ledger.compare("τ_y", case, &wide(tau_y.get(TauY)), forces.get(TauY), force, allowed * cond);
    let acceleration = largest(forward.get(Ydd)).max(rate);
    ledger.compare(
        "ÿ",
        case,
        &wide(ydd.get(Ydd)),
        forward.get(Ydd),
        acceleration,
        allowed * cond * cond_M,
    );
    true
}

#[test]
fn single_precision_is_right_to_its_rounding_on_every_bundled_robot() {
    let cases: Vec<Case> = bundled().collect();
    let mut refused = Vec::new();
    Ledger::over(&cases, |case, ledger| {
        let double = &case.compiled.model;
        let (mut single, mut double) =
            (Robot::new(double.convert(|x| x as f32)), Robot::new(double.clone()));
        let answered =
            (0..STATES).filter(|k| compare(case, &mut single, &mut double, *k, ledger)).count();
        refused.push((case.name.clone(), STATES as usize - answered));
    });
    println!("refused of {STATES}: {refused:?}");
    let total: usize = refused.iter().map(|x| x.1).sum();
    assert!(
        total * 50 <= cases.len() * STATES as usize,
        "more than one in fifty refused: {refused:?}"
    );
}

/// Out to where loops do not close: an answer is on the branch of the double one, and where that
/// has none there is none.
#[test]
fn single_precision_never_gives_another_branch() {
    let (mut answered, mut refused) = (0, 0);
    for mut case in bundled() {
        case.reach.iter_mut().for_each(|reach| *reach *= 8.0);
        let double = &case.compiled.model;
        let (mut single, mut double) =
            (Robot::new(double.convert(|x| x as f32)), Robot::new(double.clone()));
        for k in 0..4 * STATES {
            let (status, reference, error) = positions(&case, &mut single, &mut double, k);
            let name = &case.name;
            assert!(
                status != Status::Ok || reference == Status::Ok,
                "{name}, state {k}: ok, but {reference} in double"
            );
            assert!(error < ANOTHER, "{name}, state {k}: {error}");
            *(if status == Status::Ok { &mut answered } else { &mut refused }) += 1;
        }
    }
    println!("{answered} answered, {refused} refused");
    assert!(answered > 200 && refused > 200);
}

#[test]
fn a_request_that_single_precision_cannot_tell_is_refused() {
    let case = Case::bundled("lambda");
    let mut robot = Robot::new(case.compiled.model.convert(|x| x as f32));
    let status = |robot: &mut Robot<f32>, y: f32| {
        robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).answer.status
    };
    assert_eq!(status(&mut robot, 0.1), Status::Ok);
    for y in [f32::NAN, f32::INFINITY, f32::MAX, 1e30] {
        assert_ne!(status(&mut robot, y), Status::Ok, "y = {y}");
    }
    let residual =
        robot.ask(Request::Kinematics, &[(Y, &[0.1])], &[Residual]).ok().get(Residual)[0].to_f64();
    assert!(residual < 1e-6, "{residual}");
}
