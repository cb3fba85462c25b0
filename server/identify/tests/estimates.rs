//! Estimates from simulated logs: of a robot that differs from its model, with and without noise.

#![allow(clippy::unwrap_used, reason = "a test that fails panics")]

use sarrus_dynamics::description::{Description, Friction, JointKind, SubmechanismKind, Terms};
use sarrus_dynamics::{
    Field, FieldSet, Model, OpenModel, Plan, Query, QueryOptions, Request, Status, Workspace,
    displaced, rezeroed,
};
use sarrus_identify::{
    Base, Estimate, IdentifyError, Log, Sample, base_parameters, calibrate, identify,
};
use sarrus_models::{Loaded, Options, Source, load};

/// Random numbers.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    fn normal(&mut self) -> f64 {
        let turn = core::f64::consts::TAU * self.uniform();
        (-2.0 * self.uniform().ln()).sqrt() * turn.cos()
    }
}

/// The robot with other masses and friction.
fn another(description: &Description, random: &mut Random) -> Description {
    let mut other = description.clone();
    for inertial in other.links.iter_mut().filter_map(|link| link.inertial.as_mut()) {
        let factor = random.within(0.7, 1.4);
        inertial.mass *= factor;
        inertial.inertia.iter_mut().for_each(|x| *x *= factor);
        inertial.origin.xyz.iter_mut().for_each(|x| *x += random.within(-0.01, 0.01));
    }
    let moves = |kind: JointKind| {
        !matches!(kind, JointKind::Fixed | JointKind::Spherical | JointKind::Floating)
    };
    for joint in other.joints.iter_mut().filter(|joint| moves(joint.kind)) {
        let coulomb = random.within(0.1, 1.0);
        let viscous = random.within(0.1, 1.0);
        joint.terms = Terms {
            friction: Friction { coulomb, viscous, ..joint.terms.friction },
            ..joint.terms
        };
    }
    other
}

/// Sums of sines within the middle of the limits, where the loops close; joints that are `still`
/// do not move. Forces have noise of this part of their root mean square.
fn recorded(
    model: &Model<f64>,
    still: &[&str],
    (samples, noise): (usize, f64),
    random: &mut Random,
) -> Log {
    const SINES: usize = 5;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let query = Query::new(Request::InverseDynamics, given, FieldSet::of(&[Field::TauU]))
        .with_options(QueryOptions::FRICTION);
    let plan = Plan::new(model, &query).unwrap();
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let info = model.info();
    let waves: Vec<(f64, Vec<[f64; 3]>)> = model
        .independent_names()
        .iter()
        .map(|name| {
            let v = info.tree.iter().position(|x| x == name).unwrap();
            let limits = info.limits[v].unwrap();
            let [low, high] = [limits.lower.unwrap(), limits.upper.unwrap()];
            let reach = if still.contains(&name.as_str()) { 0.0 } else { 0.3 * (high - low) };
            let wave = |k: usize| {
                let rate = 0.6 * (1 + k) as f64 * random.within(0.9, 1.1);
                [reach / SINES as f64 * random.within(0.5, 1.5), rate, random.within(0.0, 6.0)]
            };
            (f64::midpoint(low, high), (0..SINES).map(wave).collect())
        })
        .collect();
    let mut log = Log::default();
    for k in 0..samples {
        let t = 20.0 * k as f64 / samples as f64;
        let mut sample = Sample::default();
        for (middle, waves) in &waves {
            let sum = |of: fn([f64; 3], f64) -> f64| waves.iter().map(|x| of(*x, t)).sum::<f64>();
            sample.y.push(middle + sum(|[a, w, p], t| a * (w * t + p).sin()));
            sample.yd.push(sum(|[a, w, p], t| a * w * (w * t + p).cos()));
            sample.ydd.push(sum(|[a, w, p], t| -a * w * w * (w * t + p).sin()));
        }
        let input = [&sample.y[..], &sample.yd, &sample.ydd].concat();
        sample.tau_u = vec![0.0; model.sizes().n_u];
        let answer = plan.run(model, &mut workspace, &input, &mut sample.tau_u);
        if answer.status == Status::Ok {
            log.samples.push(sample);
        }
    }
    assert!(log.samples.len() * 2 > samples, "most poses of {} are reachable", model.name());
    for u in 0..model.sizes().n_u {
        let square: f64 = log.samples.iter().map(|x| x.tau_u[u] * x.tau_u[u]).sum();
        let size = noise * (square / log.samples.len() as f64).sqrt();
        log.samples.iter_mut().for_each(|x| x.tau_u[u] += size * random.normal());
    }
    log
}

fn bundled(robot: &str) -> Loaded {
    load(&Source::Bundled(robot.into()), &Options::default()).unwrap()
}

/// Ranks of the inertial parameters alone, from an independent program over Pinocchio.
#[test]
fn loops_leave_as_many_base_parameters_as_another_program_finds() {
    for (robot, rank) in [
        ("lambda", 8),
        // its inertia is constant, and gravity has a sine and a cosine
        ("parallelogram", 3),
        ("torso", 36),
        ("ankle", 36),
        ("r3_lambda_r", 40),
    ] {
        let model = bundled(robot).compiled.model;
        let log = recorded(&model, &[], (400, 0.0), &mut Random(5));
        let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
        let want = FieldSet::of(&[Field::RegressorY, Field::BaseParameters]);
        let query = Query::new(Request::InverseDynamics, given, want);
        let plan = Plan::new(&model, &query).unwrap();
        let mut workspace = Workspace::for_plans(&model, [&plan]);
        let n = model.sizes().n_parameters();
        let mut output = vec![0.0; plan.want().len()];
        let mut rows = Vec::new();
        for Sample { y, yd, ydd, .. } in &log.samples {
            let input = [&y[..], yd, ydd].concat();
            plan.run(&model, &mut workspace, &input, &mut output).ok().unwrap();
            rows.extend_from_slice(&output[..output.len() - n]);
        }
        let inertial = 10 * model.sizes().n_bodies;
        let of_bodies: Vec<f64> =
            rows.chunks_exact(n).flat_map(|row| row[..inertial].iter().copied()).collect();
        assert_eq!(Base::of_rows(&of_bodies, inertial).columns.len(), rank, "{robot}");
        // Y π = Y_c π_base at other states than those of the base
        let base = base_parameters(&model).unwrap();
        let parameters: Vec<f64> = (0..n).map(|k| (k as f64).sin()).collect();
        let values = base.of(&parameters);
        for row in rows.chunks_exact(n).take(40) {
            let whole: f64 = row.iter().zip(&parameters).map(|(x, p)| x * p).sum();
            let reduced: f64 = base.columns.iter().zip(&values).map(|(j, x)| row[*j] * x).sum();
            let size: f64 = row.iter().zip(&parameters).map(|(x, p)| (x * p).abs()).sum();
            assert!((whole - reduced).abs() < 1e-9 * size, "{robot}: {whole} {reduced}");
        }
        // the field has those of the model
        let mut field = vec![f64::NAN; n];
        let of_model = base.of(&model.parameters());
        base.columns.iter().zip(of_model).for_each(|(j, x)| field[*j] = x);
        let found = &output[output.len() - n..];
        assert!(found.iter().zip(&field).all(|(a, b)| a == b || a.is_nan() && b.is_nan()));
    }
}

/// An estimate, and the true base parameters.
fn estimated(
    loaded: &Loaded,
    still: &[&str],
    size: (usize, f64),
    seed: u64,
) -> (Estimate, Vec<f64>, Vec<f64>) {
    let mut random = Random(seed);
    let truth = Model::compile(&another(&loaded.description, &mut random)).unwrap().model;
    let log = recorded(&truth, still, size, &mut random);
    let model = &loaded.compiled.model;
    let estimate = identify(&loaded.description, model, &log).unwrap();
    let base = base_parameters(model).unwrap();
    (estimate, base.of(&truth.parameters()), truth.parameters())
}

#[test]
fn parameters_come_back_from_a_motion_without_noise() {
    for robot in ["lambda", "torso", "r3_lambda_r"] {
        let (estimate, truth, _) = estimated(&bundled(robot), &[], (400, 0.0), 3);
        let largest = truth.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (of, truth) in
            estimate.base.iter().zip(&truth).filter(|(of, _)| of.standard_error.is_some())
        {
            let error = (of.value - truth).abs() / largest;
            assert!(error < 1e-7, "{robot} {:?}: {} {truth}", of.combination, of.value);
        }
        // in units of a noise that is rounding
        assert!(estimate.prediction.model > 1e6 && estimate.prediction.held_out < 3.0, "{robot}");
    }
}

#[test]
fn estimates_from_noise_are_within_three_standard_errors_as_often_as_they_should_be() {
    for (robot, seeds) in [("lambda", 60), ("torso", 3), ("r3_lambda_r", 8)] {
        let loaded = bundled(robot);
        let mut count = 0;
        let mut within = [0; 3];
        for seed in 0..seeds {
            let (estimate, truth, _) = estimated(&loaded, &[], (500, 0.01), 100 + seed);
            for (of, truth) in estimate.base.iter().zip(&truth) {
                let Some(error) = of.standard_error else { continue };
                let ratio = (of.value - truth).abs() / error;
                count += 1;
                (0..3).for_each(|k| within[k] += usize::from(ratio <= (k + 1) as f64));
            }
            let of = estimate.prediction;
            assert!(of.model > 2.0 && of.physical < 1.5 * of.fitted, "{robot} {seed}: {of:?}");
            assert!(of.held_out >= of.fitted, "{robot} {seed}: {of:?}");
        }
        // normal errors: 68 %, 95 %, 99.7 %
        let share = within.map(|k| f64::from(k as u32) / f64::from(count));
        println!("{robot}: {count} estimates, {share:.3?} within 1, 2 and 3 standard errors");
        assert!((0.60..0.76).contains(&share[0]) && share[1] > 0.92 && share[2] > 0.985, "{robot}");
    }
}

#[test]
fn what_a_motion_does_not_excite_is_named_and_stays() {
    let loaded = bundled("r3_lambda_r");
    let still = loaded.compiled.model.independent_names()[0].clone();
    let (estimate, ..) = estimated(&loaded, &[&still], (400, 0.01), 5);
    let name = format!("{still}/viscous");
    let of = estimate.base.iter().find(|of| estimate.names[of.combination[0].0] == name).unwrap();
    assert!(of.standard_error.is_none() && of.value == of.model, "{of:?}");
    assert!(estimate.base.iter().filter(|of| of.standard_error.is_some()).count() > 10);
}

/// A robot with this geometry, and its coordinates at the zero pose of the other.
fn displaced_robot(description: &Description, theta: &[f64]) -> (Model<f64>, Vec<f64>) {
    let model = Model::compile(description).unwrap().model;
    let mut moved = displaced(description, &model.info().geometry(), theta).unwrap();
    for of in &mut moved.submechanisms {
        (of.kind, of.closed_forms) = (SubmechanismKind::Numerical, false);
    }
    let open = OpenModel::compile(&moved).unwrap();
    let held = |name| if model.independent_names().contains(name) { f64::INFINITY } else { 1.0 };
    let weights: Vec<f64> = open.tree_names().iter().map(held).collect();
    let q = open.assemble(&open.tree_zero(), &weights).unwrap().q;
    let robot = rezeroed(&moved, &q).unwrap();
    (Model::compile(&robot).unwrap().model, q)
}

/// What the encoders of these joints measure at random poses.
fn measured(
    (model, at_zero): &(Model<f64>, Vec<f64>),
    encoders: &[(usize, f64)],
    (rows, noise): (usize, f64),
    random: &mut Random,
) -> Vec<Vec<f64>> {
    let info = model.info();
    let query = Query::new(Request::Kinematics, Field::Y.into(), Field::Q.into());
    let plan = Plan::new(model, &query).unwrap();
    let mut workspace = Workspace::for_plans(model, [&plan]);
    let mut q = vec![0.0; info.sizes.n_q];
    let units = model.tree_units();
    let mut row = || {
        let y: Vec<f64> = (info.independent.iter())
            .map(|name| {
                let v = info.tree.iter().position(|x| x == name).unwrap();
                let limits = info.limits[v].unwrap();
                let [low, high] = [limits.lower.unwrap(), limits.upper.unwrap()];
                random.within(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
            })
            .collect();
        let is_closed = plan.run(model, &mut workspace, &y, &mut q).status == Status::Ok;
        let mut read =
            |(k, o): &(usize, f64)| q[*k] + at_zero[*k] + o + noise * units[*k] * random.normal();
        is_closed.then(|| encoders.iter().map(&mut read).collect())
    };
    core::iter::from_fn(|| Some(row())).flatten().take(rows).collect()
}

/// The geometry and the offsets that the encoders tell are found within three standard errors, and
/// the noise of the encoders is what is left over.
#[test]
fn geometry_is_found_from_redundant_encoders() {
    const NOISE: f64 = 1e-5;
    let mut random = Random(7);
    let mut within = [0; 2];
    for (name, least) in [("lambda", 4), ("five_bar", 6), ("agile_eye", 10), ("torso", 10)] {
        let loaded = load(&Source::Bundled(name.into()), &Options::default()).unwrap();
        let Loaded { description, compiled, .. } = &loaded;
        let info = compiled.model.info();
        let encoders: Vec<usize> = (0..info.tree.len()).collect();
        let heads = info.tree.clone();
        let n = info.geometry().len();
        let own = displaced_robot(description, &vec![0.0; n]);
        let plain: Vec<(usize, f64)> = encoders.iter().map(|k| (*k, 0.0)).collect();
        let rows = measured(&own, &plain, (300, 0.0), &mut random);
        let exact = calibrate(description, &heads, &rows).unwrap();
        assert!(exact.noise[1] < 1e-12, "{name}: {:?}", exact.noise);
        let told: Vec<usize> = (0..exact.parameters.len())
            .filter(|k| exact.parameters[*k].standard_error.is_some())
            .collect();
        println!("{name}: {} of {} told", told.len(), exact.parameters.len());
        assert!(told.len() >= least, "{name}: {}", told.len());
        // what is told differs
        let mut truth = vec![0.0; exact.parameters.len()];
        told.iter().for_each(|k| truth[*k] = random.within(-1e-3, 1e-3));
        let (offsets, theta) = truth.split_at(encoders.len());
        let other = displaced_robot(description, theta);
        let with_offsets: Vec<(usize, f64)> =
            encoders.iter().copied().zip(offsets.iter().copied()).collect();
        let rows = measured(&other, &with_offsets, (2000, NOISE), &mut random);
        let found = calibrate(description, &heads, &rows).unwrap();
        let [model, fitted] = found.noise;
        assert!(model > 5.0 * NOISE && (fitted / NOISE - 1.0).abs() < 0.03, "{name}: {fitted:e}");
        for (of, truth) in found.parameters.iter().zip(&truth) {
            let Some(error) = of.standard_error else { continue };
            within[usize::from((of.value - truth).abs() < 3.0 * error)] += 1;
        }
    }
    println!("{within:?}");
    assert!(within[0] * 50 < within[1], "{within:?}");
}

#[test]
fn logs_that_no_parameters_explain_are_refused() {
    let loaded = load(&Source::Bundled("lambda".into()), &Options::default()).unwrap();
    let Loaded { description, compiled, .. } = &loaded;
    let info = compiled.model.info();
    let encoders: Vec<(usize, f64)> = (0..info.tree.len()).map(|k| (k, 0.0)).collect();
    let own = displaced_robot(description, &vec![0.0; info.geometry().len()]);
    let mut random = Random(11);
    let in_radians = measured(&own, &encoders, (200, 1e-5), &mut random);
    // poses close by the independents, which stay in radians
    let is_independent = |k: usize| info.independent.contains(&info.tree[k]);
    let read = |(k, x): (usize, &f64)| if is_independent(k) { *x } else { x.to_degrees() };
    let degrees = |row: &Vec<f64>| row.iter().enumerate().map(read).collect::<Vec<f64>>();
    let in_degrees: Vec<Vec<f64>> = in_radians.iter().map(degrees).collect();
    calibrate(description, &info.tree, &in_radians).unwrap();
    let error = calibrate(description, &info.tree, &in_degrees).unwrap_err();
    assert!(matches!(error, IdentifyError::Unexplained), "{error}");
}
