//! Sets of forces and velocities, margins, rotors and gains of actuators, against every choice of
//! limits, maps of forces, mass matrices and differences.

use std::sync::OnceLock;

use sarrus_dynamics::description::{Description, Inertial, Limits};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, LinkId, Model, Plan, Query, Request, Status, Warnings,
};
use sarrus_models::{Options, Source, bundled_text, load};
use sarrus_tests::cases::{Case, Ledger};
use sarrus_tests::compare::{assert_close, largest};
use sarrus_tests::random::random_robot;
use sarrus_tests::run::{Fields, Robot};
use sarrus_tests::seed::Seeded;
use sarrus_tests::small::{inner, minus, product, times, transposed};

use crate::derivatives::moved;

use Field::*;

/// Bundled mechanisms, and random robots.
fn robots() -> &'static [Case] {
    const BUNDLED: [&str; 7] =
        ["lambda", "torso", "ankle", "wrist", "stewart", "active_ankle", "g1_ankle"];
    const SEEDS: u64 = 30;
    static ONCE: OnceLock<Vec<Case>> = OnceLock::new();
    ONCE.get_or_init(|| {
        let random = (0..SEEDS)
            .filter_map(|seed| Case::of_text(&random_robot(seed), seed, &Options::default()).ok());
        BUNDLED.iter().map(|name| Case::bundled(name)).chain(random).collect()
    })
}

/// A robot whose actuators have limits.
struct Limited {
    robot: Robot<f64>,
    description: Description,
    effort: Vec<f64>,
    velocity: Vec<f64>,
    /// The tree velocities of up to four independents of a mechanism, and their places in y.
    picks: Vec<(Vec<u16>, Vec<usize>)>,
}

fn limited(case: &Case) -> Limited {
    let mut description = case.description.clone();
    let names = case.compiled.model.active_names();
    let effort: Vec<f64> = (0..names.len()).map(|u| 3.0 + 1.7 * u as f64).collect();
    let velocity: Vec<f64> = (0..names.len()).map(|u| 2.0 + 0.3 * u as f64).collect();
    for joint in &mut description.joints {
        let at = names.iter().position(|name| *name == joint.name);
        if let Some(u) = at {
            let none = Limits {
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
                velocity: f64::INFINITY,
                effort: f64::INFINITY,
            };
            let limits = joint.limits.unwrap_or(none);
            joint.limits = Some(Limits { effort: effort[u], velocity: velocity[u], ..limits });
        }
    }
    let model = Model::compile(&description).unwrap().model;
    let place = |names: &[String], name: &String| names.iter().position(|x| x == name);
    let mut picks = description
        .submechanisms
        .iter()
        .map(|group| {
            let names = group.independent.iter().map(|j| &description.joints[*j].name);
            let (mut v, mut k): (Vec<u16>, Vec<usize>) = names
                .filter_map(|name| {
                    let v = place(model.tree_names(), name)?;
                    Some((v as u16, place(model.independent_names(), name)?))
                })
                .take(4)
                .unzip();
            // rows come in the order of y
            v.sort_unstable();
            k.sort_unstable();
            (v, k)
        })
        .filter(|(v, _): &(Vec<u16>, Vec<usize>)| !v.is_empty())
        .collect::<Vec<_>>();
    // up to four of two mechanisms or more
    let two = |(v, k): &(Vec<u16>, Vec<usize>)| v.iter().copied().zip(k.clone()).take(2).collect();
    let mixed = picks.iter().flat_map(|pick| -> Vec<(u16, usize)> { two(pick) }).take(4);
    let (mut v, mut k): (Vec<u16>, Vec<usize>) = mixed.unzip();
    v.sort_unstable();
    k.sort_unstable();
    if v.len() > 2 && !picks.contains(&(v.clone(), k.clone())) {
        picks.push((v, k));
    }
    Limited { robot: Robot::new(model), description, effort, velocity, picks }
}

pub(crate) fn query(request: Request, want: &[Field]) -> Query {
    Query::new(request, FieldSet::EMPTY, FieldSet::of(want))
}

/// The rows of vertices that are there, of p numbers each.
fn rows(numbers: &[f64], p: usize) -> Vec<&[f64]> {
    numbers.chunks_exact(p).take_while(|row| row.iter().all(|x| !x.is_nan())).collect()
}

/// Largest d · x.
fn reach<X: AsRef<[f64]>>(points: &[X], d: &[f64]) -> f64 {
    points.iter().map(|x| inner(x.as_ref(), d)).fold(f64::NEG_INFINITY, f64::max)
}

/// Rows `picked` of G_uᵀ τ for every choice of limits.
fn images(G_u: &[f64], n_vy: usize, limits: &[f64], picked: &[usize]) -> Vec<Vec<f64>> {
    let touched = |u: &usize| picked.iter().any(|k| G_u[u * n_vy + k] != 0.0);
    let touched: Vec<usize> = (0..limits.len()).filter(touched).collect();
    let image = |signs: usize| {
        let mut tau = vec![0.0; limits.len()];
        for (i, u) in touched.iter().enumerate() {
            tau[*u] = if signs >> i & 1 == 1 { limits[*u] } else { -limits[*u] };
        }
        let all = transposed(G_u, &tau, n_vy);
        picked.iter().map(|k| all[*k]).collect()
    };
    (0..1 << touched.len()).map(image).collect()
}

#[test]
fn sets_of_forces_are_those_of_every_choice_of_limits() {
    let mut sets = 0;
    let mut of_size = [0; 5];
    for case in robots() {
        let mut own = limited(case);
        let state = case.state::<f64>(0);
        let n = own.robot.model.sizes().n_vy;
        let mut random = Seeded::new(case.seed);
        let given = [(Y, state.y.as_slice()), (Yd, state.yd.as_slice())];
        for (velocities, picked) in own.picks.clone() {
            let mut d = vec![0.0; 8 * n];
            for direction in d.chunks_exact_mut(n) {
                picked.iter().for_each(|k| direction[*k] = random.within(-1.0, 1.0));
            }
            let base = query(
                Request::InverseDynamics,
                &[GU, CY, TorqueVertices, TorqueSupport, TorqueVerticesNet, TorqueSupportNet],
            );
            let whole = query(Request::InverseDynamics, &[GU, CY]);
            let whole = own.robot.ask_for(whole, &given).ok();
            let base = base.with_joints(velocities.clone()).with_directions(8);
            let given = [given[0], given[1], (Directions, d.as_slice())];
            let x = own.robot.ask_for(base, &given).ok();
            assert!(!x.answer.warnings.contains(Warnings::NO_LIMIT));
            let expected = images(whole.get(GU), n, &own.effort, &picked);
            let p = picked.len();
            let bias: Vec<f64> = picked.iter().map(|k| whole.get(CY)[*k]).collect();
            let size = expected.iter().map(|x| largest(x)).fold(1.0, f64::max);
            let vertices = rows(x.get(TorqueVertices), p);
            let net = rows(x.get(TorqueVerticesNet), p);
            assert_eq!(vertices.len(), net.len());
            for vertex in &vertices {
                let least = expected.iter().map(|y| largest(&minus(vertex, y)));
                assert!(least.fold(1.0, f64::min) < 1e-12 * size, "{}: no vertex", case.name);
            }
            for (k, d) in d.chunks_exact(n).enumerate() {
                let along: Vec<f64> = picked.iter().map(|k| d[*k]).collect();
                let most = reach(&expected, &along);
                let net_size = size + largest(&bias);
                for (found, wanted) in [
                    (reach(&vertices, &along), most),
                    (x.get(TorqueSupport)[k], most),
                    (reach(&net, &along), most - inner(&bias, &along)),
                    (x.get(TorqueSupportNet)[k], most - inner(&bias, &along)),
                ] {
                    assert!(
                        (found - wanted).abs() < 1e-12 * net_size,
                        "{}: {found} {wanted}",
                        case.name
                    );
                }
            }
            sets += 1;
            of_size[p] += 1;
        }
    }
    println!("{sets} sets, by their coordinates {of_size:?}");
    assert!(sets > 30 && of_size[3] > 3 && of_size[4] > 3, "{sets} {of_size:?}");
}

#[test]
fn the_power_of_vertices_of_velocities_is_the_same_on_both_sides_and_every_motor_is_at_its_limit() {
    let mut vertices = 0;
    for case in robots().iter().filter(|case| case.square && !case.floats()) {
        let mut own = limited(case);
        let state = case.state::<f64>(0);
        let n = own.robot.model.sizes().n_vy;
        if n > 4 {
            continue;
        }
        let given = [(Y, state.y.as_slice())];
        let x = own.robot.ask_for(query(Request::Kinematics, &[GU, SpeedVertices]), &given);
        if x.answer.status != Status::Ok {
            assert_eq!(x.answer.status, Status::SingularActuation);
            continue;
        }
        let found = rows(x.get(SpeedVertices), n);
        assert_eq!(found.len(), 1 << n, "{}", case.name);
        for yd in found {
            let ud = product(x.get(GU), yd);
            let condition = largest(x.get(GU)) * largest(yd);
            for (ud, most) in ud.iter().zip(&own.velocity) {
                assert!((ud.abs() - most).abs() < 1e-11 * condition.max(1.0), "{}", case.name);
            }
            let tau_y = transposed(x.get(GU), &own.effort, n);
            let [a, b] = [inner(&tau_y, yd), inner(&own.effort, &ud)];
            assert!((a - b).abs() < 1e-14 * n as f64 * condition * largest(&own.effort));
            vertices += 1;
        }
    }
    assert!(vertices > 20, "{vertices}");
}

#[test]
fn a_force_of_the_margin_takes_the_binding_actuators_to_their_limits() {
    let mut margins = 0;
    for case in robots().iter().filter(|case| case.square) {
        let mut own = limited(case);
        let state = case.state::<f64>(0);
        let n = own.robot.model.sizes().n_vy;
        let mut random = Seeded::new(case.seed);
        let actuated = own.robot.ask(Request::Kinematics, &[(Y, &state.y)], &[GU]).ok();
        let tau_u: Vec<f64> = own.effort.iter().map(|e| e * random.within(-3.0, 3.0)).collect();
        let tau_y = transposed(actuated.get(GU), &tau_u, n);
        let ask = |robot: &mut Robot<f64>, tau: &[f64], want: &[Field]| {
            robot.ask(Request::Map, &[(Y, &state.y), (TauY, tau)], want)
        };
        let x = ask(&mut own.robot, &tau_y, &[Margin, Clip, ClipNearest, Binding]);
        if x.answer.status != Status::Ok {
            assert_eq!(x.answer.status, Status::SingularActuation, "{}", case.name);
            continue;
        }
        let s = x.get(Margin)[0];
        let part = |tau: &[f64], u: usize| tau[u].abs() / own.effort[u];
        let most = (0..tau_u.len()).map(|u| part(&tau_u, u)).fold(0.0, f64::max);
        assert!((s * most - 1.0).abs() < 1e-7, "{}: {s} of {most}", case.name);
        let at_margin = ask(&mut own.robot, &times(s, &tau_y), &[TauU]).ok();
        for u in 0..tau_u.len() {
            let is_at_limit = part(at_margin.get(TauU), u) > 1.0 - 1e-7;
            let info = own.robot.model.info();
            let v = info.tree.iter().position(|name| *name == info.active[u]).unwrap();
            let side = if is_at_limit { at_margin.get(TauU)[u].signum() } else { 0.0 };
            assert_eq!(x.get(Binding)[3 * v + 2], side, "{}", case.name);
        }
        assert_close(&case.name, x.get(Clip), &times(s.min(1.0), &tau_y), 1.0, 1e-13);
        let clipped: Vec<f64> =
            tau_u.iter().zip(&own.effort).map(|(tau, e)| tau.clamp(-e, *e)).collect();
        let nearest = transposed(actuated.get(GU), &clipped, n);
        assert_close(&case.name, x.get(ClipNearest), &nearest, 1.0, 1e-7);
        margins += 1;
    }
    assert!(margins > 12, "{margins}");
}

#[test]
fn a_margin_of_more_motors_than_freedoms_reaches_the_border_of_the_set() {
    let mut margins = 0;
    for case in robots().iter().filter(|case| !case.square) {
        let mut own = limited(case);
        let state = case.state::<f64>(0);
        let n = own.robot.model.sizes().n_vy;
        let mut random = Seeded::new(case.seed);
        for (velocities, picked) in own.picks.clone() {
            let actuated = own.robot.ask(Request::Kinematics, &[(Y, &state.y)], &[GU]).ok();
            let tau_u: Vec<f64> = own.effort.iter().map(|e| e * random.within(-1.0, 1.0)).collect();
            let tau_y = transposed(actuated.get(GU), &tau_u, n);
            let base = query(Request::Map, &[Margin]).with_joints(velocities);
            let given = [(Y, state.y.as_slice()), (TauY, tau_y.as_slice())];
            let x = own.robot.ask_for(base, &given);
            if x.answer.status != Status::Ok || x.get(Margin)[0].is_nan() {
                continue;
            }
            let s = x.get(Margin)[0];
            // a force of motors within their limits is allowed; one beyond the margin lies outside
            assert!(s > 1.0 - 1e-9, "{}: {s}", case.name);
            let all = images(actuated.get(GU), n, &own.effort, &picked);
            let tau: Vec<f64> = picked.iter().map(|k| tau_y[*k]).collect();
            if picked.len() > 2 {
                continue;
            }
            let beyond = times(s * (1.0 + 1e-6), &tau);
            let separates = (0..3600).any(|k| {
                let angle = f64::from(k) * 1e-3 * std::f64::consts::PI / 1.8;
                let d = [angle.cos(), angle.sin()];
                inner(&beyond, &d[..picked.len()]) > reach(&all, &d[..picked.len()]) * (1.0 + 1e-9)
            });
            margins += usize::from(separates);
        }
    }
    println!("{margins} margins");
    assert!(margins > 1, "{margins}");
}

#[test]
fn rotors_add_the_reflected_inertia_to_the_mass_matrix_and_its_force_to_the_bias() {
    Ledger::over(robots(), |case, ledger| {
        let mut own = limited(case);
        let mut heavier = own.description.clone();
        for (u, name) in case.compiled.model.active_names().iter().enumerate() {
            let joint = heavier.joints.iter_mut().find(|joint| joint.name == *name).unwrap();
            joint.terms.rotor_inertia += 0.01 * (u + 1) as f64;
            joint.terms.gear_ratio =
                if joint.terms.gear_ratio == 0.0 { 1.0 } else { joint.terms.gear_ratio };
        }
        let mut other = Robot::new(Model::compile(&heavier).unwrap().model);
        let state = case.state::<f64>(0);
        let given = [(Y, state.y.as_slice()), (Yd, state.yd.as_slice())];
        let want = [MY, CY, ReflectedInertia, ReflectedForce];
        let a = own.robot.ask(Request::InverseDynamics, &given, &want).ok();
        let b = other.ask(Request::InverseDynamics, &given, &want).ok();
        for (whole, part) in [(MY, ReflectedInertia), (CY, ReflectedForce)] {
            let added = minus(b.get(whole), a.get(whole));
            let own = minus(b.get(part), a.get(part));
            let size = largest(b.get(whole)).max(1.0);
            ledger.compare(part.name(), case, &added, &own, size, 1e-11);
        }
    });
}

#[test]
fn gains_along_the_independents_are_the_slopes_of_the_force() {
    Ledger::over(robots(), |case, ledger| {
        if case.floats() || !case.square || case.is_open() {
            return;
        }
        let mut robot = Robot::new(case.compiled.exact.clone());
        let state = case.state::<Dd>(0);
        let n = robot.model.sizes().n_vy;
        let n_u = robot.model.sizes().n_u;
        let number = Dd::from_f64;
        let gains: Vec<Dd> = (0..2 * n_u).map(|k| number(5.0 + 0.7 * k as f64)).collect();
        let tau_u: Vec<Dd> = (0..n_u).map(|u| number(1.0 - 0.4 * u as f64)).collect();
        let now = robot.ask(Request::Kinematics, &[(Y, &state.y)], &[GU, U]).ok();
        let tau_y = transposed(now.get(GU), &tau_u, n);
        let x = robot.ask(
            Request::Map,
            &[(Y, &state.y), (TauY, &tau_y), (GainsU, &gains)],
            &[GainsY, TauU],
        );
        if x.answer.status != Status::Ok {
            return;
        }
        let columns = 2 * n + 1;
        let u = now.get(U).to_vec();
        let force = |robot: &mut Robot<Dd>, y: &[Dd]| {
            let there = robot.ask(Request::Kinematics, &[(Y, y)], &[GU, U]).ok();
            let moved = minus(there.get(U), &u);
            let law: Vec<Dd> = (0..n_u).map(|i| x.get(TauU)[i] - gains[2 * i] * moved[i]).collect();
            transposed(there.get(GU), &law, n)
        };
        let step = number(1e-8);
        for k in 0..n {
            let mut unit = vec![Dd::ZERO; n];
            unit[k] = Dd::ONE;
            let [ahead, behind] = [step, -step].map(|t| moved(case, &state.y, &unit, t));
            let [ahead, behind] = [ahead, behind].map(|y| force(&mut robot, &y));
            let slope = times(number(-0.5) / step, &minus(&ahead, &behind));
            let column: Vec<Dd> = (0..n).map(|r| x.get(GainsY)[r * columns + k]).collect();
            let size = largest(x.get(GainsY)).max(1.0);
            ledger.compare("stiffness along y", case, &column, &slope, size, 1e-10);
        }
        let force: Vec<Dd> = (0..n).map(|r| x.get(GainsY)[r * columns + 2 * n]).collect();
        ledger.compare("force of the gains", case, &force, &tau_y, largest(&tau_y), 1e-12);
    });
}

/// The ankle of the G1 with the motors of the table.
fn ankle() -> Model<f64> {
    let (urdf, yaml) = bundled_text("g1_ankle").unwrap();
    let motors = "peak_torque: 25\n  max_speed: 37\n  rotor_inertia: 3.609725e-3\n  gear_ratio: 1";
    let submechanisms = Some(yaml.replace("model: N5020-16", motors).into_bytes());
    let source = Source::Text { urdf: urdf.into(), submechanisms };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}")).compiled.model
}

/// Rounds to the digits of the table.
fn shown(x: f64, digits: i32) -> f64 {
    (x * 10_f64.powi(digits)).round() / 10_f64.powi(digits)
}

#[test]
fn the_published_table_of_an_ankle_is_reproduced_to_its_digits() {
    let mut robot = Robot::new(ankle());
    // G_u, force alone, speed alone, inertia pp rr pr
    let table = [
        (
            [0.0, 0.0],
            [-1.3757, 0.9006, 1.3886, 0.9123],
            [68.7, 45.1],
            [26.6, 40.6],
            [0.01379, 0.00593, 0.00010],
        ),
        (
            [-0.6, 0.0],
            [-1.7001, 0.8663, 1.6501, 0.8385],
            [82.4, 42.0],
            [21.8, 42.7],
            [0.02026, 0.00525, -0.00032],
        ),
        (
            [0.3, 0.2],
            [-1.3307, 0.8356, 2.1622, 1.8299],
            [58.0, 49.0],
            [17.1, 20.2],
            [0.02327, 0.01461, 0.01027],
        ),
        (
            [-0.87, 0.0],
            [-3.0096, 1.3381, 2.6734, 1.1693],
            [132.6, 58.9],
            [12.3, 27.7],
            [0.05850, 0.01140, -0.00325],
        ),
    ];
    for (y, G_u, force, speed, inertia) in table {
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[GU, ReflectedInertia]).ok();
        let found: Vec<f64> = x.get(GU).iter().map(|x| shown(*x, 4)).collect();
        assert_eq!(found, G_u, "G_u at {y:?}");
        let M = x.get(ReflectedInertia);
        assert_eq!([M[0], M[3], M[1]].map(|x| shown(x, 5)), inertia, "inertia at {y:?}");
        for k in 0..2 {
            let mut alone = [0.0; 2];
            alone[k] = 1.0;
            let margin = robot.ask(Request::Map, &[(Y, &y), (TauY, &alone)], &[Margin]).ok();
            assert_eq!(shown(margin.get(Margin)[0], 1), force[k], "force alone at {y:?}");
            let most = (0..2).map(|i| 37.0 / x.get(GU)[2 * i + k].abs()).fold(f64::MAX, f64::min);
            assert_eq!(shown(most, 1), speed[k], "speed alone at {y:?}");
        }
    }
    // in the published box of the joints, and out of reach
    for y in [[-0.87, 0.2], [0.5, 0.2]] {
        let x = robot.ask(Request::Kinematics, &[(Y, &y)], &[GU]);
        assert_ne!(x.answer.status, Status::Ok, "{y:?}");
        assert!(x.get(GU).iter().all(|x| x.is_nan()));
    }
}

#[test]
fn an_actuator_without_limit_has_no_numbers_and_a_warning() {
    let mut robot = DescriptionBuilder::new("two");
    robot.default_inertial(Inertial::sphere(1.0, [0.0, 0.0, -0.3], 0.1));
    let first = robot.revolute("first", LinkId::BASE, [0.0, 1.0, 0.0]).effort_limit(3.0).link();
    robot.revolute("second", first, [0.0, 1.0, 0.0]);
    let mut robot = Robot::new(robot.compile().unwrap().model);
    let directions = [1.0, 0.0, 0.0, 1.0];
    let base = query(
        Request::InverseDynamics,
        &[TorqueVertices, TorqueSupport, SpeedVertices, Margin, Clip, ClipNearest, Binding],
    );
    let given: [(Field, &[f64]); 2] = [(Y, &[0.3, 0.2]), (Directions, &directions)];
    let x = robot.ask_for(base.with_directions(2), &given).ok();
    assert!(x.answer.warnings.contains(Warnings::NO_LIMIT));
    for field in [TorqueVertices, SpeedVertices, Margin, Clip, ClipNearest, Binding] {
        assert!(x.get(field).iter().any(|x| x.is_nan()), "{}", field.name());
        assert!(!x.get(field).iter().any(|x| x.is_infinite()), "{}", field.name());
    }
    assert_eq!(x.get(TorqueSupport)[0], 3.0);
    assert!(x.get(TorqueSupport)[1].is_nan());
    // the limited joint alone has its numbers
    let base = query(Request::InverseDynamics, &[TorqueVertices, Margin]).with_joints([0]);
    let x = robot.ask_for(base, &given[..1]).ok();
    assert_eq!(rows(x.get(TorqueVertices), 1), [[-3.0], [3.0]]);
    assert_eq!(x.answer.warnings, Warnings::NONE);
}

#[test]
fn sets_of_many_coordinates_and_requests_without_their_numbers_are_refused() {
    let case = robots().iter().find(|case| case.compiled.model.sizes().n_vy > 4).unwrap();
    let model = &case.compiled.model;
    let given = FieldSet::of(&[Y]);
    let plan = |want| Plan::new(model, &Query::new(Request::Kinematics, given, FieldSet::of(want)));
    assert!(plan(&[TorqueVertices]).is_err());
    assert!(plan(&[TorqueSupport]).is_err());
    assert!(plan(&[GainsY]).is_err());
    assert!(plan(&[ReflectedInertia]).is_ok());
}

#[test]
fn near_dead_points_no_number_is_infinite() {
    let mut robot = Robot::new(ankle());
    let mut answered = 0;
    let mut refused = 0;
    for k in 0..4000 {
        let y = [-0.80 - 5e-5 * f64::from(k), 0.0];
        let tau = [1.0, 0.5];
        let want = [TorqueVertices, SpeedVertices, Margin, Clip, ClipNearest, ReflectedInertia];
        let x: Fields<f64> = robot.ask(Request::Map, &[(Y, &y), (TauY, &tau)], &want);
        let all = want.iter().flat_map(|field| x.get(*field));
        if x.answer.status == Status::Ok {
            answered += 1;
            assert!(all.clone().all(|x| !x.is_infinite()), "{y:?}");
            assert!(x.get(Margin)[0] > 0.0, "{y:?}");
        } else {
            refused += 1;
            assert!(all.clone().all(|x| x.is_nan()), "{y:?}");
        }
    }
    println!("{answered} answered, {refused} refused");
    assert!(answered > 100 && refused > 100);
}

#[test]
fn far_from_zero_an_answer_has_no_infinite_number_and_a_failure_none() {
    let mut counts = [0; 2];
    for case in robots().iter().filter(|case| !case.floats() && case.square) {
        let mut own = limited(case);
        for k in 0..12 {
            let state = case.state::<f64>(k);
            // towards the ends of the ranges, singular poses and beyond
            let y: Vec<f64> = state.y.iter().map(|y| y * (1.0 + k as f64)).collect();
            let tau = vec![1.0; own.robot.model.sizes().n_vy];
            let want = [TorqueVertices, SpeedVertices, Margin, Clip, ClipNearest, ReflectedInertia];
            for (velocities, _) in own.picks.clone() {
                let base = query(Request::Map, &want).with_joints(velocities);
                let x = own.robot.ask_for(base, &[(Y, &y), (TauY, &tau)]);
                let is_ok = x.answer.status == Status::Ok;
                counts[usize::from(is_ok)] += 1;
                for field in want {
                    let numbers = x.get(field);
                    assert!(!numbers.iter().any(|x| x.is_infinite()), "{} {y:?}", case.name);
                    assert_eq!(is_ok, !numbers[0].is_nan(), "{} {} {y:?}", case.name, field.name());
                }
            }
        }
    }
    println!("{counts:?} refused and answered");
    assert!(counts[0] > 10 && counts[1] > 100, "{counts:?}");
}
