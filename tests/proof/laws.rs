//! Laws between the answers to one state, on every robot, in double and in double-double.
//!
//! In double-double a law tests the formulas to their last digits; in double it measures their
//! rounding.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Compiled, Field, FieldSet, Model, PlanScalar, Query, Request, Status};
use sarrus_models::Options;
use sarrus_tests::cases::{Case, Ledger, SEEDS, State, robots};
use sarrus_tests::compare::largest;
use sarrus_tests::random::random_robot;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{
    inner, is_positive_definite, matrix_product, minus, plus, product, times, transposed,
};

use Field::*;

/// States of each robot.
const STATES: u64 = 2;

#[test]
fn every_random_robot_can_be_read() {
    let read = |seed| Case::of_text(&random_robot(seed), seed, &Options::default());
    let failures: Vec<String> = (0..SEEDS).filter_map(|seed| read(seed).err()).collect();
    assert!(failures.is_empty(), "{} of {SEEDS} seeds\n{}", failures.len(), failures.join("\n"));
}

/// A law, written once for both scalars.
trait Law {
    fn check<T: PlanScalar>(
        case: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    );
}

/// Records the errors of a law.
struct Note<'a> {
    ledger: &'a mut Ledger,
    case: &'a Case,
    scalar: &'static str,
}

impl Note<'_> {
    fn close<T: PlanScalar>(&mut self, what: &str, a: &[T], b: &[T], least: f64, allowed: f64) {
        self.ledger.compare(&format!("{what} in {}", self.scalar), self.case, a, b, least, allowed);
    }
}

fn on_every_robot<L: Law>() {
    on_all::<L>(robots());
}

/// Checks every law on some robots.
pub(crate) fn every_law(cases: &[Case]) {
    on_all::<LoopsAreClosed>(cases);
    on_all::<ForcesAgree>(cases);
    on_all::<Inverses>(cases);
    on_all::<Frames>(cases);
    on_all::<RoundTrips>(cases);
}

/// Checks a law on some robots; `unit(c)` is the allowed error at condition c.
fn on_all<L: Law>(cases: &[Case]) {
    Ledger::over(cases, |case, ledger| {
        let Compiled { model, exact, .. } = &case.compiled;
        let loops = case.contradiction();
        for k in 0..STATES {
            let mut note = Note { ledger, case, scalar: "double" };
            L::check(
                case,
                model,
                &case.state::<f64>(k),
                &|c| (1e3 * f64::EPSILON + loops) * c,
                &mut note,
            );
            let mut note = Note { ledger, case, scalar: "double-double" };
            L::check(
                case,
                exact,
                &case.state::<Dd>(k),
                &|c| (1e3 * <Dd as Real>::EPSILON + loops) * c,
                &mut note,
            );
        }
    });
}

fn zeros<T: PlanScalar>(n: usize) -> Vec<T> {
    vec![T::ZERO; n]
}

fn value<T: PlanScalar>(fields: &Fields<T>, field: Field) -> f64 {
    fields.get(field)[0].to_f64()
}

/// Indices in q̇ of named joints.
fn places<T>(model: &Model<T>, names: &[String]) -> Vec<usize> {
    names
        .iter()
        .map(|name| model.tree_names().iter().position(|tree| tree == name).unwrap())
        .collect()
}

fn motion<T>(state: &State<T>) -> [(Field, &[T]); 3] {
    [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)]
}

struct LoopsAreClosed;
impl Law for LoopsAreClosed {
    fn check<T: PlanScalar>(
        _: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    ) {
        let sizes = model.sizes();
        let mut robot = Robot::new(model.clone());
        let want =
            [Y, Yd, Ydd, Q, Qd, Qdd, U, Ud, Udd, G, GBias, GU, GUBias, K, KBias, Residual, CondKd];
        let x = robot.ask(Request::Kinematics, &motion(state), &want).ok();
        let cond = value(&x, CondKd);
        let K_size = largest(x.get(K));
        let qd_size = largest(x.get(Qd));
        note.close("residual", x.get(Residual), &[T::ZERO], 1.0, unit(cond));
        let KG = matrix_product(x.get(K), x.get(G), sizes.n_v, sizes.n_vy);
        note.close("K G = 0", &KG, &zeros(KG.len()), K_size * largest(x.get(G)), unit(cond));
        note.close(
            "K q̇ = 0",
            &product(x.get(K), x.get(Qd)),
            &zeros(sizes.n_c),
            K_size * qd_size,
            unit(cond),
        );
        let size = K_size * (qd_size * qd_size).max(largest(x.get(GBias)));
        note.close("K g = k", &product(x.get(K), x.get(GBias)), x.get(KBias), size, unit(cond));
        let size = size.max(K_size * largest(x.get(Qdd)));
        note.close("K q̈ = k", &product(x.get(K), x.get(Qdd)), x.get(KBias), size, unit(cond));
        // maps of velocities and accelerations
        note.close("q̇ = G ẏ", &product(x.get(G), &state.yd), x.get(Qd), 0.0, unit(cond));
        note.close(
            "q̈ = G ÿ + g",
            &plus(&product(x.get(G), &state.ydd), x.get(GBias)),
            x.get(Qdd),
            0.0,
            unit(cond),
        );
        note.close("u̇ = G_u ẏ", &product(x.get(GU), &state.yd), x.get(Ud), qd_size, unit(cond));
        let udd = plus(&product(x.get(GU), &state.ydd), x.get(GUBias));
        note.close("ü = G_u ÿ + g_u", &udd, x.get(Udd), largest(x.get(Qdd)), unit(cond));
        for (field, given) in [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)] {
            note.close("y comes back", x.get(field), given, 1.0, unit(1.0));
        }
        // a joint has one value under its name in every space
        for (names, fields) in
            [(model.independent_names(), [Yd, Ydd]), (model.active_names(), [Ud, Udd])]
        {
            for (field, tree) in fields.into_iter().zip([Qd, Qdd]) {
                let of_tree: Vec<T> =
                    places(model, names).into_iter().map(|v| x.get(tree)[v]).collect();
                note.close("spaces name the same joints", x.get(field), &of_tree, 0.0, 1e-300);
            }
        }
    }
}

#[test]
fn loops_stay_closed_at_every_level() {
    on_every_robot::<LoopsAreClosed>();
}

struct ForcesAgree;
impl Law for ForcesAgree {
    fn check<T: PlanScalar>(
        _: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    ) {
        let n = model.sizes().n_vy;
        let mut robot = Robot::new(model.clone());
        let x = robot.ask(Request::Kinematics, &motion(state), &[Qd, Ud, G, GU, K]).ok();
        let want = [TauQ, TauY, TauU, TauUnactuated, Lambda, MY, CY, CondKd, CondGu, CondMy];
        let id = robot.ask(Request::InverseDynamics, &motion(state), &want).ok();
        let cond = value(&id, CondKd);
        let cond_u = value(&id, CondGu);
        let tau_y = id.get(TauY);
        note.close(
            "τ_y = Gᵀ τ_q",
            &transposed(x.get(G), id.get(TauQ), n),
            tau_y,
            largest(id.get(TauQ)),
            unit(cond),
        );

        // power is equal in every space
        let p_q = inner(id.get(TauQ), x.get(Qd));
        let p_y = inner(tau_y, &state.yd);
        let p_u = inner(id.get(TauU), x.get(Ud)) + inner(id.get(TauUnactuated), &state.yd);
        let size = id
            .get(TauQ)
            .iter()
            .zip(x.get(Qd))
            .fold(0.0, |sum, (a, b)| sum + (*a * *b).to_f64().abs());
        note.close("power of τ_q and τ_y", &[p_q], &[p_y], size, unit(cond));
        let size = id
            .get(TauU)
            .iter()
            .zip(x.get(Ud))
            .fold(size, |sum, (a, b)| sum + (*a * *b).to_f64().abs());
        note.close("power of τ_u and τ_y", &[p_u], &[p_y], size, unit(cond * cond_u));
        let back = plus(&transposed(x.get(GU), id.get(TauU), n), id.get(TauUnactuated));
        note.close(
            "τ_y = G_uᵀ τ_u + rest",
            &back,
            tau_y,
            largest(id.get(TauU)),
            unit(cond * cond_u),
        );

        // M_y ÿ + C_y = τ_y, column by column
        let M = id.get(MY);
        let symmetric = (0..n).all(|i| (0..i).all(|j| M[i * n + j] == M[j * n + i]));
        assert!(symmetric, "M_y is not symmetric");
        assert!(is_positive_definite(M, n), "M_y is not positive definite");
        let size = largest(M) * largest(&state.ydd) + largest(id.get(CY));
        note.close(
            "M_y ÿ + C_y = τ_y",
            &plus(&product(M, &state.ydd), id.get(CY)),
            tau_y,
            size,
            unit(cond),
        );
        let at_rest =
            robot.ask(Request::InverseDynamics, &[(Y, &state.y), (Yd, &state.yd)], &[TauY]).ok();
        note.close("C_y = τ_y of ÿ = 0", at_rest.get(TauY), id.get(CY), size, unit(cond));
        for i in 0..n {
            let mut e = zeros(n);
            e[i] = T::ONE;
            let of_e = robot
                .ask(
                    Request::InverseDynamics,
                    &[(Y, &state.y), (Yd, &state.yd), (Ydd, &e)],
                    &[TauY],
                )
                .ok();
            let column: Vec<T> = (0..n).map(|j| M[j * n + i]).collect();
            let size = largest(M) + largest(id.get(CY));
            note.close(
                "M_y column by column",
                &minus(of_e.get(TauY), id.get(CY)),
                &column,
                size,
                unit(cond),
            );
        }

        // balance of the tree: τ_q = Kᵀ λ + forces of actuators and independents
        let mut given = transposed(x.get(K), id.get(Lambda), model.sizes().n_v);
        let size = largest(&given).max(largest(id.get(TauQ)));
        let loops = largest(&given);
        places(model, model.active_names())
            .into_iter()
            .zip(id.get(TauU))
            .for_each(|(v, tau)| given[v] += *tau);
        places(model, model.independent_names())
            .into_iter()
            .zip(id.get(TauUnactuated))
            .for_each(|(v, tau)| given[v] += *tau);
        note.close(
            "τ_q = Kᵀ λ + τ_u",
            &given,
            id.get(TauQ),
            size.max(largest(id.get(TauU))).max(loops),
            unit(cond * cond_u),
        );
    }
}

#[test]
fn forces_agree_in_all_spaces() {
    on_every_robot::<ForcesAgree>();
}

struct Inverses;
impl Law for Inverses {
    fn check<T: PlanScalar>(
        _: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    ) {
        let sizes = model.sizes();
        let n = sizes.n_vy;
        let mut robot = Robot::new(model.clone());
        let id = robot
            .ask(Request::InverseDynamics, &motion(state), &[TauQ, TauY, MY, CY, CondKd, CondMy])
            .ok();
        let cond = value(&id, CondKd);
        let cond_M = value(&id, CondMy);
        let place = [(Y, state.y.as_slice()), (Yd, &state.yd)];
        let backward = |ydd: &[T], tau: &[T], of: &Fields<T>| {
            let rest = minus(&plus(&product(of.get(MY), ydd), of.get(CY)), tau);
            let size = largest(of.get(MY)) * largest(ydd) + largest(of.get(CY)) + largest(tau);
            largest(&rest) / size
        };
        for (field, what) in [(TauY, "FD(τ_y) ∘ ID"), (TauQ, "FD(τ_q) ∘ ID")] {
            let given = [place[0], place[1], (field, id.get(field))];
            let fd = robot.ask(Request::ForwardDynamics, &given, &[Ydd, Qdd, MY, CY, TauY]).ok();
            let size = (largest(id.get(CY)) + largest(id.get(TauY))) / largest(id.get(MY));
            note.close(what, fd.get(Ydd), &state.ydd, size, unit(cond * cond_M));
            let error = T::from_f64(backward(fd.get(Ydd), id.get(TauY), &id));
            note.close("backward error of FD", &[error], &[T::ZERO], 1.0, unit(cond));
            note.close(
                "C_y of FD and ID",
                fd.get(CY),
                id.get(CY),
                largest(id.get(TauQ)),
                unit(cond),
            );
            note.close("M_y of FD and ID", fd.get(MY), id.get(MY), 0.0, unit(1.0));
            // without M_y among the wanted fields an open robot uses articulated bodies
            let other = robot.ask(Request::ForwardDynamics, &given, &[Ydd]).ok();
            note.close(
                "articulated bodies and projection",
                other.get(Ydd),
                fd.get(Ydd),
                1.0,
                unit(cond_M),
            );
            let error = T::from_f64(backward(other.get(Ydd), id.get(TauY), &id));
            note.close(
                "backward error of articulated bodies",
                &[error],
                &[T::ZERO],
                1.0,
                unit(cond),
            );
        }

        // ID ∘ FD from the actuators, with λ on both sides
        let tau_u: Vec<T> = Seeded::new(7)
            .numbers(sizes.n_u, largest(id.get(TauY)))
            .into_iter()
            .map(T::from_f64)
            .collect();
        let fd = robot
            .ask(
                Request::ForwardDynamics,
                &[place[0], place[1], (TauU, &tau_u)],
                &[Ydd, Qdd, TauY, Lambda, G, GU, K, GBias],
            )
            .ok();
        let qdd = plus(&product(fd.get(G), fd.get(Ydd)), fd.get(GBias));
        note.close("q̈ of FD", &qdd, fd.get(Qdd), 0.0, unit(cond));
        let ydd = fd.get(Ydd).to_vec();
        let back = robot
            .ask(Request::InverseDynamics, &[place[0], place[1], (Ydd, &ydd)], &[TauQ, TauY])
            .ok();
        let size = largest(id.get(MY)) * largest(&ydd) + largest(id.get(CY)) + largest(&tau_u);
        note.close(
            "ID ∘ FD(τ_u)",
            back.get(TauY),
            &transposed(fd.get(GU), &tau_u, n),
            size,
            unit(cond),
        );
        note.close(
            "τ_y of given τ_u",
            fd.get(TauY),
            &transposed(fd.get(GU), &tau_u, n),
            size,
            unit(cond),
        );
        let mut given = transposed(fd.get(K), fd.get(Lambda), sizes.n_v);
        let size = largest(&given).max(largest(back.get(TauQ))).max(size);
        places(model, model.active_names())
            .into_iter()
            .zip(&tau_u)
            .for_each(|(v, tau)| given[v] += *tau);
        note.close("M q̈ + C = τ_q + Kᵀ λ of FD", &given, back.get(TauQ), size, unit(cond * cond));
    }
}

#[test]
fn forward_and_inverse_dynamics_are_inverses() {
    on_every_robot::<Inverses>();
}

struct Frames;
impl Law for Frames {
    fn check<T: PlanScalar>(
        case: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    ) {
        let sizes = model.sizes();
        let mut robot = Robot::new(model.clone());
        let mut seeded = Seeded::new(case.seed);
        let links: Vec<u16> =
            (0..8).map(|_| seeded.below(model.link_names().len()) as u16).collect();
        let actuated = case.square && !case.floats();
        let mut want =
            vec![FrameTwist, JacobianTree, JacobianIndependent, Qd, Ud, G, CondKd, CondGu];
        if actuated {
            want.push(JacobianActuator);
        }
        let ask = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&want))
            .with_frames(&links);
        let x = robot.ask_for(ask, &motion(state)).ok();
        let cond = value(&x, CondKd);
        let twist = x.get(FrameTwist);
        let size = largest(x.get(JacobianTree)) * largest(x.get(Qd));
        note.close("twist = J q̇", &product(x.get(JacobianTree), x.get(Qd)), twist, size, unit(1.0));
        note.close(
            "twist = J_y ẏ",
            &product(x.get(JacobianIndependent), &state.yd),
            twist,
            size,
            unit(cond),
        );
        let JG = matrix_product(x.get(JacobianTree), x.get(G), sizes.n_v, sizes.n_vy);
        note.close(
            "J_y = J G",
            &JG,
            x.get(JacobianIndependent),
            largest(x.get(JacobianTree)) * largest(x.get(G)),
            unit(cond),
        );
        if actuated {
            let size = size.max(largest(x.get(JacobianActuator)) * largest(x.get(Ud)));
            note.close(
                "twist = J_u u̇",
                &product(x.get(JacobianActuator), x.get(Ud)),
                twist,
                size,
                unit(cond * value(&x, CondGu)),
            );
        }

        // the transposed Jacobian maps wrenches to joint forces
        let on = &links[..2];
        let w: Vec<T> = seeded.numbers(12, 30.0).into_iter().map(T::from_f64).collect();
        let of = |request, want: &[Field]| Query::new(request, FieldSet::EMPTY, FieldSet::of(want));
        let push = |columns: usize, J: &[T]| transposed(&J[..12 * columns], &w, columns);
        let push_q = push(sizes.n_v, x.get(JacobianTree));
        let push_y = push(sizes.n_vy, x.get(JacobianIndependent));
        let want = [TauQ, TauY, TauU, TauUnactuated, Lambda, K, CY, CondMy];
        let free = robot.ask(Request::InverseDynamics, &motion(state), &want).ok();
        let m = motion(state);
        let given = [m[0], m[1], m[2], (Wrenches, w.as_slice())];
        let pushed =
            robot.ask_for(of(Request::InverseDynamics, &want).with_wrenches(on), &given).ok();
        let size = largest(free.get(TauQ)) + largest(&push_q);
        note.close(
            "τ_q less Jᵀ w",
            &minus(free.get(TauQ), &push_q),
            pushed.get(TauQ),
            size,
            unit(1.0),
        );
        note.close(
            "τ_y less J_yᵀ w",
            &minus(free.get(TauY), &push_y),
            pushed.get(TauY),
            size,
            unit(cond),
        );
        note.close("C_y holds no wrench (ID)", pushed.get(CY), free.get(CY), size, unit(cond));
        let mut balance = transposed(pushed.get(K), pushed.get(Lambda), sizes.n_v);
        let size = size + largest(&balance);
        places(model, model.active_names())
            .into_iter()
            .zip(pushed.get(TauU))
            .for_each(|(v, tau)| balance[v] += *tau);
        places(model, model.independent_names())
            .into_iter()
            .zip(pushed.get(TauUnactuated))
            .for_each(|(v, tau)| balance[v] += *tau);
        let cond_u = value(&x, CondGu);
        note.close(
            "λ with wrenches",
            &balance,
            pushed.get(TauQ),
            size.max(largest(pushed.get(TauU))),
            unit(cond * cond_u),
        );

        // forward dynamics returns the accelerations
        let given = [m[0], m[1], (TauY, pushed.get(TauY)), (Wrenches, w.as_slice())];
        let fd = robot
            .ask_for(of(Request::ForwardDynamics, &[Ydd, CY, Lambda, MY]).with_wrenches(on), &given)
            .ok();
        note.close(
            "FD with wrenches",
            fd.get(Ydd),
            &state.ydd,
            1.0 + size / largest(fd.get(MY)),
            unit(cond * value(&free, CondMy)),
        );
        note.close("C_y holds no wrench (FD)", fd.get(CY), free.get(CY), size, unit(cond));
    }
}

#[test]
fn jacobians_move_velocities_and_wrenches() {
    on_every_robot::<Frames>();
}

struct RoundTrips;
impl Law for RoundTrips {
    fn check<T: PlanScalar>(
        case: &Case,
        model: &Model<T>,
        state: &State<T>,
        unit: &dyn Fn(f64) -> f64,
        note: &mut Note<'_>,
    ) {
        let mut robot = Robot::new(model.clone());
        let want = [Y, Yd, Ydd, Q, Qd, Qdd, U, Ud, Udd, CondKd, CondGu, CondMy];
        let x = robot.ask(Request::InverseDynamics, &motion(state), &want).ok();
        let cond = value(&x, CondKd);
        // a complete q serves as independents and guess
        let given = [(Q, x.get(Q)), (Qd, x.get(Qd)), (Qdd, x.get(Qdd))];
        let q = robot.ask(Request::Kinematics, &given, &want[..9]).ok();
        for field in [Y, Yd, Ydd, Q, Qd, Qdd, U, Ud, Udd] {
            note.close("from q", q.get(field), x.get(field), 1.0, unit(cond));
        }
        if !case.square || case.floats() {
            return;
        }
        // encoder values, with a guess near the pose and at zero
        let cond = cond * value(&x, CondGu);
        let given = [(U, x.get(U)), (Ud, x.get(Ud)), (Udd, x.get(Udd))];
        let near: Vec<T> = times(T::from_f64(0.8), &state.y);
        let guess = robot.ask(Request::Kinematics, &[(Y, &near)], &[Q]).ok();
        let with_guess = [given[0], given[1], given[2], (QGuess, guess.get(Q))];
        for (what, given) in [("from u with a guess", with_guess.as_slice()), ("from u", &given)] {
            let u = robot.ask(Request::Kinematics, given, &want[..9]);
            assert!(u.answer.status == Status::Ok, "{what}: {}", u.answer.status);
            let size = largest(x.get(Qd)).max(1.0).powi(2).max(largest(x.get(Qdd)));
            for (field, least) in [
                (Y, 1.0),
                (Q, 1.0),
                (U, 1.0),
                (Yd, size),
                (Qd, size),
                (Ydd, size),
                (Qdd, size),
                (Udd, size),
            ] {
                note.close(what, u.get(field), x.get(field), least, unit(cond * cond));
            }
        }
        // forces mapped both ways
        let tau: Vec<T> =
            Seeded::new(11).numbers(model.sizes().n_u, 10.0).into_iter().map(T::from_f64).collect();
        let there = robot.ask(Request::Map, &[(Y, &state.y), (TauU, &tau)], &[TauY]).ok();
        let back = robot.ask(Request::Map, &[(Y, &state.y), (TauY, there.get(TauY))], &[TauU]).ok();
        note.close("τ_u to τ_y and back", back.get(TauU), &tau, 0.0, unit(cond * cond));
        // dynamics from encoder values too
        let id = robot.ask(Request::InverseDynamics, &motion(state), &[TauU]).ok();
        let of_u = robot.ask(Request::InverseDynamics, &given, &[TauU]).ok();
        note.close(
            "inverse dynamics from u",
            of_u.get(TauU),
            id.get(TauU),
            0.0,
            unit(cond * cond * value(&x, CondMy)),
        );
    }
}

#[test]
fn spaces_map_to_each_other_and_back() {
    on_every_robot::<RoundTrips>();
}
