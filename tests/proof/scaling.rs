//! Invariance to units: scaling lengths and masses by 1e±3 keeps the angles and scales the forces,
//! up to rounding.

use sarrus_dynamics::description::{Cut, Description, JointKind, Placement};
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Field, Model, Request, Status};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use Field::*;

/// Allowed rounding at condition 1 in units of ε: every number of the description is rounded again.
const ROUNDING: f64 = 256.0;

/// Scales every length by L and every mass by M; times stay, so gravity scales with the lengths.
pub(crate) fn scaled(of: &Description, L: f64, M: f64) -> Description {
    let mut to = of.clone();
    let place = |x: &mut Placement| x.xyz = x.xyz.map(|x| L * x);
    to.gravity = to.gravity.map(|x| L * x);
    for inertial in to.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        place(&mut inertial.origin);
        inertial.mass *= M;
        inertial.inertia = inertial.inertia.map(|x| M * L * L * x);
    }
    let slides: Vec<bool> =
        of.joints.iter().map(|joint| joint.kind == JointKind::Prismatic).collect();
    let unit = |joint: usize| if slides[joint] { L } else { 1.0 };
    for (j, joint) in to.joints.iter_mut().enumerate() {
        place(&mut joint.origin);
        if let Some(coupling) = &mut joint.coupling {
            coupling.offset *= unit(j);
            coupling.terms.iter_mut().for_each(|(master, c)| *c *= unit(j) / unit(*master));
        }
        let terms = &mut joint.terms;
        let force = M * L * L / unit(j).powi(2);
        terms.damping *= force;
        terms.stiffness *= force;
        terms.rest *= unit(j);
        terms.rotor_inertia *= M * L * L;
        terms.gear_ratio /= unit(j);
    }
    for of in to.submechanisms.iter_mut().flat_map(|x| &mut x.loops) {
        if let Cut::Placed { predecessor, successor } = &mut of.cut {
            place(predecessor);
            place(successor);
        }
    }
    to
}

/// Factor of each named coordinate or velocity.
fn units(case: &Case, names: &[String], L: f64) -> Vec<f64> {
    let slides = |name: &str| {
        case.description
            .joints
            .iter()
            .any(|joint| joint.name == name && joint.kind == JointKind::Prismatic)
    };
    let moves =
        |name: &str| ["/x", "/y", "/z", "/tx", "/ty", "/tz"].iter().any(|end| name.ends_with(end));
    names.iter().map(|name| if slides(name) || moves(name) { L } else { 1.0 }).collect()
}

fn times(x: &[f64], units: &[f64]) -> Vec<f64> {
    x.iter().zip(units).map(|(x, unit)| x * unit).collect()
}

fn over(x: &[f64], units: &[f64]) -> Vec<f64> {
    x.iter().zip(units).map(|(x, unit)| x / unit).collect()
}

#[test]
fn angles_stay_and_forces_scale_with_lengths_and_masses() {
    let mut same = 0;
    let mut other = 0;
    Ledger::over(robots(), |case, ledger| {
        let mut robot = Robot::new(case.compiled.model.clone());
        for (L, M) in [(1e-3, 1e-3), (1e-3, 1e3), (1e3, 1e-3), (1e3, 1e3)] {
            let compiled = Model::compile(&scaled(&case.description, L, M))
                .unwrap_or_else(|faults| panic!("{faults:?}"));
            let mut large = Robot::new(compiled.model);
            let of = |names: &[String]| units(case, names, L);
            let model = &robot.model;
            let qy = of(model.independent_q_names());
            let y = of(model.independent_names());
            let q = of(model.tree_q_names());
            let v = of(model.tree_names());
            let u = of(model.active_names());
            // a generalised force is power divided by speed
            let force =
                |units: &[f64]| units.iter().map(|unit| M * L * L / unit).collect::<Vec<f64>>();
            let state = case.state::<f64>(2);
            let given = [(Y, state.y.as_slice()), (Yd, &state.yd), (Ydd, &state.ydd)];
            let want = [Q, Qd, Qdd, G, TauQ, TauY, TauU, MY, CondKd, CondGu, CondMy];
            let x = robot.ask(Request::InverseDynamics, &given, &want).ok();
            let [sy, syd, sydd] =
                [times(&state.y, &qy), times(&state.yd, &y), times(&state.ydd, &y)];
            let given = [(Y, sy.as_slice()), (Yd, &syd), (Ydd, &sydd)];
            let z = large.ask(Request::InverseDynamics, &given, &want).ok();
            let [cond, cond_u, cond_M] = [CondKd, CondGu, CondMy].map(|field| x.get(field)[0]);
            let unit = ROUNDING * <f64 as Real>::EPSILON;
            let allowed = |c: f64| unit * c + case.contradiction();
            let speed = largest(x.get(Qd)).max(1.0);
            ledger.compare("q", case, &over(z.get(Q), &q), x.get(Q), 1.0, allowed(cond));
            ledger.compare("q̇", case, &over(z.get(Qd), &v), x.get(Qd), speed, allowed(cond));
            let size = speed.powi(2).max(largest(x.get(Qdd)));
            ledger.compare(
                "q̈",
                case,
                &over(z.get(Qdd), &v),
                x.get(Qdd),
                size,
                allowed(cond * cond),
            );
            let n = y.len();
            let of_G: Vec<f64> = (0..x.get(G).len()).map(|k| v[k / n] / y[k % n]).collect();
            ledger.compare("G", case, &over(z.get(G), &of_G), x.get(G), 1.0, allowed(cond));
            let of_M: Vec<f64> = (0..n * n).map(|k| M * L * L / (y[k / n] * y[k % n])).collect();
            ledger.compare("M_y", case, &over(z.get(MY), &of_M), x.get(MY), 0.0, allowed(cond));
            let size = largest(x.get(TauQ));
            ledger.compare(
                "τ_q",
                case,
                &over(z.get(TauQ), &force(&v)),
                x.get(TauQ),
                size,
                allowed(cond * cond),
            );
            ledger.compare(
                "τ_y",
                case,
                &over(z.get(TauY), &force(&y)),
                x.get(TauY),
                size,
                allowed(cond * cond),
            );
            if case.square {
                // with unlike units of actuators the least norm has another minimum
                ledger.compare(
                    "τ_u",
                    case,
                    &over(z.get(TauU), &force(&u)),
                    x.get(TauU),
                    size,
                    allowed(cond * cond * cond_u),
                );
            }
            let mut seeded = Seeded::new(case.seed);
            let tau: Vec<f64> =
                x.get(TauY).iter().map(|tau| tau * seeded.within(0.5, 1.5)).collect();
            let given = [(Y, state.y.as_slice()), (Yd, &state.yd), (TauY, &tau)];
            let x = robot.ask(Request::ForwardDynamics, &given, &[Ydd]).ok();
            let tau = times(&tau, &force(&y));
            let z = large
                .ask(Request::ForwardDynamics, &[(Y, &sy), (Yd, &syd), (TauY, &tau)], &[Ydd])
                .ok();
            let size = largest(x.get(Ydd)).max(largest(&state.ydd));
            ledger.compare(
                "ÿ of FD",
                case,
                &over(z.get(Ydd), &y),
                x.get(Ydd),
                size,
                allowed(cond * cond * cond_M),
            );

            // far away, where an answer may not exist
            for k in 0..6 {
                let y: Vec<f64> = case
                    .state::<f64>(k)
                    .y
                    .iter()
                    .zip(robot.model.independent_q_names())
                    .map(|(y, name)| if name.contains('/') { *y } else { 4.0 * y })
                    .collect();
                let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, CondKd]);
                let z = large.ask(Request::Kinematics, &[(Y, &times(&y, &qy))], &[Q]);
                if x.answer.status != z.answer.status {
                    other += 1;
                } else {
                    same += 1;
                }
                if (x.answer.status, z.answer.status) == (Status::Ok, Status::Ok) {
                    let cond = x.get(CondKd)[0];
                    ledger.compare(
                        "q far away",
                        case,
                        &over(z.get(Q), &q),
                        x.get(Q),
                        1.0,
                        allowed(cond),
                    );
                }
            }
        }
    });
    println!("far away: {same} end alike, {other} otherwise");
    assert!(other * 100 <= same, "{other} of {same} end otherwise in other units");
}
