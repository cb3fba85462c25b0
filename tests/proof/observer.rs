//! The momentum observer: its momentum and rate against mass matrices and differences along the
//! motion, and its force against simulated motions with a known wrench.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Status};
use sarrus_tests::cases::{Case, Ledger, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::run::Robot;
use sarrus_tests::small::{minus, plus, product, times, transposed};

use crate::derivatives::moved;

use Field::*;

#[test]
fn momentum_is_that_of_the_mass_matrix_and_its_rate_that_along_the_motion() {
    Ledger::over(robots().iter().step_by(9), |case, ledger| {
        let mut robot = Robot::new(case.compiled.exact.clone());
        let state = case.state::<Dd>(0);
        let given = [(Y, state.y.as_slice()), (Yd, &state.yd)];
        let motion = [given[0], given[1], (Ydd, &state.ydd)];
        let forces = robot.ask(Request::InverseDynamics, &motion, &[TauY, MY]).ok();
        let one = [Dd::ONE];
        let mut ask = |y: &[Dd], yd: &[Dd]| {
            let given = [(Y, y), (Yd, yd), (TauY, forces.get(TauY)), (Dt, &one), (Gain, &one)];
            let x = robot.ask(Request::Observe, &given, &[Observer, TauExternal]).ok();
            assert_eq!(largest(x.get(TauExternal)), 0.0);
            let of = |k: usize| x.get(Observer).iter().skip(k).step_by(3).copied().collect();
            [of(1), of(2)]
        };
        let [p, rate]: [Vec<Dd>; 2] = ask(&state.y, &state.yd);
        let size = largest(&p).max(1e-3);
        ledger.compare("M_y ẏ", case, &p, &product(forces.get(MY), &state.yd), size, 1e-24);
        let h = Dd::from_f64(1e-9);
        let at =
            |t: Dd| (moved(case, &state.y, &state.yd, t), plus(&state.yd, &times(t, &state.ydd)));
        let before = at(-h);
        let behind = at(h);
        let [p0, _] = ask(&before.0, &before.1);
        let [p1, _] = ask(&behind.0, &behind.1);
        let expected = times(Dd::ONE / (h + h), &minus(&p1, &p0));
        let size = largest(forces.get(TauY)).max(largest(&rate)).max(1.0);
        ledger.compare("ṗ", case, &rate, &expected, size, 1e-11);
    });
}

/// Largest difference of the observed force from the filtered J_yᵀ w, with the wrench told to the
/// observer or not, and the largest force, over a motion of steps dt.
fn observed(case: &Case, dt: f64, tells: bool) -> [f64; 2] {
    const GAIN: f64 = 40.0;
    let mut robot = Robot::new(case.compiled.model.clone());
    let n = robot.model.sizes().n_vy;
    let state = case.state::<f64>(0);
    let mut y = times(0.3, &state.y);
    let mut yd = times(0.2, &state.yd);
    let hold = robot.ask(Request::InverseDynamics, &[(Y, &y)], &[TauU]).ok();
    let link = robot.model.info().links.len() as u16 - 1;
    let wrench = [0.4, -0.3, 0.6, 3.0, -2.0, 1.5];
    let mut observer = vec![0.0; 3 * n];
    let mut filtered = vec![0.0; n];
    let mut last: Option<Vec<f64>> = None;
    let mut worst = [0.0_f64; 2];
    let base = |request, want: &[Field]| Query::new(request, FieldSet::EMPTY, FieldSet::of(want));
    for step in 0..(0.15 / dt).round() as usize {
        let time = step as f64 * dt;
        let push = |time: f64| times(1.0 - (20.0 * time).cos(), &wrench);
        let tau_u = |time: f64| times(1.0 + 0.2 * (30.0 * time).sin(), hold.get(TauU));
        let now = [(Y, y.as_slice()), (Yd, &yd)];
        let kinematics = base(Request::Kinematics, &[JacobianIndependent]).with_frames(&[link]);
        let jacobian = robot.ask_for(kinematics, &now[..1]).ok();
        let force = transposed(jacobian.get(JacobianIndependent), &push(time), n);
        if let Some(last) = &last {
            let part = 1.0 - (-GAIN * dt).exp();
            for k in 0..n {
                filtered[k] += part * (0.5 * (force[k] + last[k]) - filtered[k]);
            }
        }
        last = Some(force);
        let step_now = [if step == 0 { 0.0 } else { dt }];
        let tau = tau_u(time);
        let pushed = push(time);
        let mut given = vec![now[0], now[1], (TauU, &tau), (Observer, &observer)];
        given.extend([(Dt, &step_now[..]), (Gain, &[GAIN])]);
        let mut query = base(Request::Observe, &[Observer, TauExternal]);
        if tells {
            query = query.with_wrenches(&[link]);
            given.push((Wrenches, &pushed));
        }
        let x = robot.ask_for(query, &given).ok();
        let expected = if tells { vec![0.0; n] } else { filtered.clone() };
        worst[0] = worst[0].max(largest(&minus(x.get(TauExternal), &expected)));
        worst[1] = worst[1].max(largest(&filtered));
        observer = x.get(Observer).to_vec();
        // a step of the classical Runge-Kutta method
        let mut slope = |time: f64, y: &[f64], yd: &[f64]| {
            let query = base(Request::ForwardDynamics, &[Ydd]).with_wrenches(&[link]);
            let given = [(Y, y), (Yd, yd), (TauU, &tau_u(time)), (Wrenches, &push(time))];
            robot.ask_for(query, &given).ok().get(Ydd).to_vec()
        };
        let h = 0.5 * dt;
        let a = slope(time, &y, &yd);
        let v2 = plus(&yd, &times(h, &a));
        let b = slope(time + h, &plus(&y, &times(h, &yd)), &v2);
        let v3 = plus(&yd, &times(h, &b));
        let c = slope(time + h, &plus(&y, &times(h, &v2)), &v3);
        let v4 = plus(&yd, &times(dt, &c));
        let d = slope(time + dt, &plus(&y, &times(dt, &v3)), &v4);
        let mean = |a: &[f64], b: &[f64], c: &[f64], d: &[f64]| {
            times(1.0 / 6.0, &plus(&plus(a, d), &times(2.0, &plus(b, c))))
        };
        y = plus(&y, &times(dt, &mean(&yd, &v2, &v3, &v4)));
        yd = plus(&yd, &times(dt, &mean(&a, &b, &c, &d)));
    }
    worst
}

#[test]
fn an_observed_force_is_the_unknown_wrench_of_a_simulated_motion_to_second_order_of_the_step() {
    for name in ["lambda", "torso", "ankle", "stewart", "rh5v2_upper_body"] {
        let case = Case::bundled(name);
        for tells in [false, true] {
            let [coarse, force] = observed(&case, 1e-3, tells);
            let [fine, _] = observed(&case, 5e-4, tells);
            println!("{name} {tells}: {coarse:.1e} {fine:.1e} of {force:.1e}");
            assert!(force > 0.1 && fine < 2e-3 * force, "{name}: {fine} of {force}");
            assert!(coarse / fine > 3.0, "{name}: {coarse} {fine}");
        }
    }
}

#[test]
fn a_step_back_and_a_query_without_what_an_observer_needs_are_refused() {
    let case = Case::bundled("torso");
    let mut robot = Robot::new(case.compiled.model.clone());
    let given = [Y, Yd, TauU, Dt, Gain];
    let query = |given: &[Field], want| {
        Query::new(Request::Observe, FieldSet::of(given), FieldSet::of(want))
    };
    for left in 0..given.len() {
        let mut fewer = given.to_vec();
        fewer.remove(left);
        assert!(Plan::new(&robot.model, &query(&fewer, &[TauExternal])).is_err());
    }
    assert!(Plan::new(&robot.model, &query(&given, &[Ydd])).is_err());
    for (dt, gain) in [(-1e-3, 1.0), (1e-3, -1.0)] {
        let given: [(Field, &[f64]); 5] =
            [(Y, &[0.1, 0.1]), (Yd, &[0.0; 2]), (TauU, &[0.0; 2]), (Dt, &[dt]), (Gain, &[gain])];
        let x = robot.ask(Request::Observe, &given, &[TauExternal]);
        assert_eq!(x.answer.status, Status::BadRequest);
        assert!(x.get(TauExternal).iter().all(|x| x.is_nan()));
    }
}
