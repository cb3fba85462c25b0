//! HyRoDyn's robots and answers, where they are installed beside the project: its numerical answers
//! to 1e-11 by size, its closed forms to the accuracy of their own agreement.

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

use sarrus_dynamics::{Field, Request};
use sarrus_models::{Loaded, Options, Source, load};
use sarrus_tests::cases::Case;
use sarrus_tests::compare::{error_by_size, largest};
use sarrus_tests::reference::{folder, numbers};
use sarrus_tests::run::Robot;
use serde_json::Value;

use crate::laws::every_law;

/// Tolerance of each compared quantity.
struct Tolerance {
    q: f64,
    qd: f64,
    qdd: f64,
    inverse: f64,
    forward: f64,
}

impl Tolerance {
    const NUMERICAL: Tolerance = Tolerance::all(1e-11);
    /// HyRoDyn's leg: its positions agree to the last digit, its Jacobian to eleven digits.
    const NUMERICAL_LEG: Tolerance = Tolerance { q: 1e-11, ..Tolerance::all(2e-10) };
    /// RH5v2: its closed-form torso is 8e-8 away from its numerical one.
    const TORSO: Tolerance =
        Tolerance { q: 1e-7, qd: 5e-7, qdd: 1e-6, inverse: 1e-6, forward: 1e-6 };
    /// RH5's leg: axes 4e-5 rad from parallel, knee out of its plane.
    const LEG: Tolerance = Tolerance { q: 5e-6, qd: 2e-5, qdd: 8e-5, inverse: 2e-4, forward: 5e-4 };

    const fn all(x: f64) -> Tolerance {
        Tolerance { q: x, qd: x, qdd: x, inverse: x, forward: x }
    }
}

/// A file of the reference folder; the vectors have paths relative to different folders.
fn find(root: &Path, path: &str) -> PathBuf {
    let rest = path.trim_start_matches("../").trim_start_matches("robots/");
    root.join("robots/hyrodyn").join(rest)
}

fn read(root: &Path, name: &str) -> Option<(Value, PathBuf, Option<PathBuf>)> {
    let path = root.join("vectors/hyrodyn").join(format!("{name}.json"));
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("not run: {} is not there", path.display());
        return None;
    };
    let file: Value = serde_json::from_str(&text).unwrap();
    let urdf = find(root, file["urdf"].as_str().unwrap());
    let submechanisms = file["submechanisms"].as_str().map(|path| find(root, path));
    Some((file, urdf, submechanisms))
}

fn names(file: &Value, key: &str) -> Vec<String> {
    file[key].as_array().unwrap().iter().map(|x| x.as_str().unwrap().to_owned()).collect()
}

/// Loads a robot of HyRoDyn leniently, because its files have invalid inertias that HyRoDyn does
/// not check, and with its rotations as urdfdom reads them. `None` if it cannot be loaded.
fn loaded(name: &str, urdf: &Path, submechanisms: Option<PathBuf>) -> Option<Loaded> {
    let changed =
        std::env::temp_dir().join(format!("sarrus_proof_{}_{name}.urdf", std::process::id()));
    std::fs::write(&changed, as_urdfdom_reads(&std::fs::read_to_string(urdf).unwrap())).unwrap();
    let read = load(
        &Source::Files { urdf: changed.clone(), submechanisms },
        &Options { lenient: true, ..Options::default() },
    );
    std::fs::remove_file(&changed).unwrap();
    read.map_err(|error| println!("not run: {name} cannot be read\n{error}")).ok()
}

/// The URDF with its rotations as urdfdom reads them. urdfdom stores a quaternion and converts it
/// back to roll, pitch, yaw. If the sine of the pitch is within 1e-5 of ±1, the pitch becomes a
/// right angle, the roll zero, and the yaw a function of two components of the quaternion. The
/// rounded neck of RH5v2's torso (rpy −1.570793 −1.570793 1.570796) is rotated by 3e-6 rad that
/// way.
fn as_urdfdom_reads(urdf: &str) -> String {
    let mut parts = urdf.split("rpy=\"");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (value, rest) = part.split_once('"').unwrap();
        let rpy: [f64; 3] =
            std::array::from_fn(|k| value.split_whitespace().nth(k).unwrap().parse().unwrap());
        let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(|x| (0.5 * x).sin_cos());
        let x = sr * cp * cy - cr * sp * sy;
        let y = cr * sp * cy + sr * cp * sy;
        let side = rpy[1].sin();
        let turn =
            [0.0, side.signum() * FRAC_PI_2, 2.0 * (-side.signum() * x).atan2(side.signum() * y)];
        let value = if side.abs() >= 0.99999 {
            turn.map(|x| format!("{x:?}")).join(" ")
        } else {
            value.to_owned()
        };
        text += &format!("rpy=\"{value}\"{rest}");
    }
    text
}

/// Compares every state of a file and returns the deviations.
fn compare(root: &Path, name: &str, tolerance: &Tolerance) -> Vec<String> {
    let Some((file, urdf, submechanisms)) = read(root, name) else { return vec![] };
    let Some(loaded) = loaded(name, &urdf, submechanisms) else { return vec![] };
    let mut robot = Robot::new(loaded.compiled.model);
    let order = |ours: &[String], theirs: &[String]| -> Vec<usize> {
        theirs
            .iter()
            .map(|name| {
                ours.iter()
                    .position(|x| x == name)
                    .unwrap_or_else(|| panic!("no joint {name} in {ours:?}"))
            })
            .collect()
    };
    // both orders are those of the submechanism file
    let tree = order(robot.model.tree_names(), &names(&file, "joints_spanningtree"));
    let independent = order(robot.model.independent_names(), &names(&file, "joints_independent"));
    let active = order(robot.model.active_names(), &names(&file, "joints_active"));
    let pick = |x: &[f64], order: &[usize]| order.iter().map(|i| x[*i]).collect::<Vec<f64>>();
    let place = |x: &[f64], order: &[usize]| {
        let mut to = vec![0.0; x.len()];
        order.iter().zip(x).for_each(|(i, x)| to[*i] = *x);
        to
    };
    let mut worst: Vec<(&str, f64, f64)> = Vec::new();
    let mut note =
        |what: &'static str, error: f64, allowed: f64| match worst.iter_mut().find(|x| x.0 == what)
        {
            Some(seen) => seen.1 = seen.1.max(error),
            None => worst.push((what, error, allowed)),
        };
    for case in file["states"].as_array().unwrap() {
        let of = |key: &str| numbers(&case[key]);
        let [y, yd, ydd] = ["y", "yd", "ydd"].map(|key| place(&of(key), &independent));
        let motion: [(Field, &[f64]); 3] = [(Field::Y, &y), (Field::Yd, &yd), (Field::Ydd, &ydd)];
        use Field::*;
        let state = robot.ask(Request::Kinematics, &motion, &[Q, Qd, Qdd, U, Ud, Udd]).ok();
        // the size of an acceleration is that of its terms
        let size = largest(&of("qd")).powi(2).max(largest(&of("ydd"))).max(1.0);
        let t = tolerance;
        for (field, key, order, least, allowed) in [
            (Q, "q", &tree, 1.0, t.q),
            (Qd, "qd", &tree, 1.0, t.qd),
            (Qdd, "qdd", &tree, size, t.qdd),
            (U, "u", &active, 1.0, t.q),
            (Ud, "ud", &active, 1.0, t.qd),
            (Udd, "udd", &active, size, t.qdd),
        ] {
            note(key, error_by_size(&pick(state.get(field), order), &of(key), least), allowed);
        }
        let inverse = robot.ask(Request::InverseDynamics, &motion, &[TauU, TauY, MY]).ok();
        note(
            "tau_u",
            error_by_size(&pick(inverse.get(TauU), &active), &of("tau_u"), 0.0),
            t.inverse,
        );
        note(
            "tau_y",
            error_by_size(&pick(inverse.get(TauY), &independent), &of("tau_y"), 0.0),
            t.inverse,
        );
        let n = independent.len();
        let M: Vec<f64> = (0..n * n)
            .map(|k| inverse.get(MY)[independent[k / n] * n + independent[k % n]])
            .collect();
        // symmetric, so the order of rows and columns does not matter
        note("M_y", error_by_size(&M, &of("H_y_colmajor"), 0.0), t.inverse);
        let tau = place(&of("fd_tau_u_in"), &active);
        let forward =
            robot.ask(Request::ForwardDynamics, &[motion[0], motion[1], (TauU, &tau)], &[Ydd]).ok();
        note(
            "fd_ydd",
            error_by_size(&pick(forward.get(Ydd), &independent), &of("fd_ydd"), 0.0),
            t.forward,
        );
    }
    let mut off = Vec::new();
    for (what, error, allowed) in worst {
        println!("{name} {what}: {error:.2e} of {allowed:.0e}");
        if error.is_nan() || error > allowed {
            off.push(format!("{name} {what}: {error:.2e}, allowed {allowed:.0e}"));
        }
    }
    off
}

fn compare_all(files: &[(&str, Tolerance)]) {
    let Some(root) = folder() else { return };
    let off: Vec<String> =
        files.iter().flat_map(|(name, tolerance)| compare(&root, name, tolerance)).collect();
    assert!(off.is_empty(), "{}", off.join("\n"));
}

/// URDF and submechanism file of each robot, as published or cut out of a published one.
const ROBOTS: [[&str; 2]; 8] = [
    ["leg/urdf/leg.urdf", "leg/urdf/submechanisms.yml"],
    ["leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee.yml"],
    ["leg/derived/leg_hip_knee.urdf", "leg/derived/leg_hip_knee_numerical.yml"],
    ["rh5v2/derived/RH5v2.urdf", "rh5v2/derived/submechanisms_full_hybrid.yml"],
    ["rh5v2/derived/RH5v2.urdf", "rh5v2/derived/submechanisms_full_numerical.yml"],
    ["rh5v2/derived/submechanisms_reduced.urdf", "rh5v2/derived/submechanisms_reduced.yml"],
    [
        "rh5v2/derived/submechanisms_reduced.urdf",
        "rh5v2/derived/submechanisms_reduced_hybrid_elbows_numerical.yml",
    ],
    [
        "rh5v2/derived/submechanisms_reduced.urdf",
        "rh5v2/derived/submechanisms_reduced_numerical.yml",
    ],
];

#[test]
fn hyrodyns_robots_obey_every_law() {
    let Some(root) = folder() else { return };
    let read = |(k, [urdf, submechanisms]): (usize, &[&str; 2])| -> Option<Case> {
        let [urdf, submechanisms] =
            [urdf, submechanisms].map(|path| root.join("robots/hyrodyn").join(path));
        let name = submechanisms.file_name().unwrap().to_string_lossy().into_owned();
        let Loaded { compiled, description, .. } = loaded(&name, &urdf, Some(submechanisms))?;
        let sizes = compiled.model.sizes();
        let reach = vec![0.1; sizes.n_vy];
        // its placements are rounded
        Some(Case {
            name,
            seed: 5000 + k as u64,
            description,
            compiled,
            reach,
            square: sizes.n_u == sizes.n_vy,
            rounded: true,
            scale: 0.3,
        })
    };
    let cases: Vec<Case> = ROBOTS.iter().enumerate().filter_map(read).collect();
    every_law(&cases);
    assert_eq!(cases.len(), ROBOTS.len(), "some cannot be read");
}

#[test]
fn hyrodyns_numerical_answers_are_ours() {
    compare_all(&[
        ("rh5v2_reduced_numerical", Tolerance::NUMERICAL),
        ("rh5_leg_hip_knee_numerical", Tolerance::NUMERICAL_LEG),
        ("rh5v2_full_numerical", Tolerance::NUMERICAL),
        ("rh5v2_full_hybrid", Tolerance::TORSO),
    ]);
}

#[test]
fn hyrodyns_closed_forms_are_ours_as_closely_as_it_agrees_with_itself() {
    compare_all(&[
        ("rh5v2_reduced", Tolerance::TORSO),
        ("rh5v2_reduced_hybrid_elbows_numerical", Tolerance::TORSO),
        ("rh5v2_reduced_hybrid_torso_numerical", Tolerance::TORSO),
        ("rh5_leg_hip_knee", Tolerance::LEG),
    ]);
}

#[test]
fn hyrodyns_ankle_stands_where_ours_does() {
    let Some(root) = folder() else { return };
    let Some((file, urdf, _)) = read(&root, "rh5_leg_ankle_gamma_2SPRR1U") else { return };
    let list = |names: &[String]| names.join(", ");
    let tree = names(&file, "joints_spanningtree");
    // the ankle has no submechanism file; its type must define its loops
    let yaml = format!(
        "submechanisms:\n- type: 2SPRR+1U\n  contextual_name: ankle\n  jointnames_spanningtree: \
         [{}]\n  jointnames_independent: [{}]\n  jointnames_active: [{}]\n",
        list(&tree),
        list(&tree[..2]),
        list(&[tree[6].clone(), tree[9].clone()])
    );
    let source =
        Source::Text { urdf: std::fs::read(urdf).unwrap(), submechanisms: Some(yaml.into_bytes()) };
    let loaded = match load(&source, &Options { lenient: true, ..Options::default() }) {
        Ok(loaded) => loaded,
        Err(error) => {
            return println!(
                "not run: 2SPRR+1U with ten joints has no closure of its own yet\n{error}"
            );
        }
    };
    let mut robot = Robot::new(loaded.compiled.model);
    let mut worst: f64 = 0.0;
    for (k, case) in file["states"].as_array().unwrap().iter().enumerate() {
        let y = numbers(&case["y"]);
        let state = robot.ask(Request::Kinematics, &[(Field::Y, &y)], &[Field::Q]).ok();
        let open = case["closure_residual_leg1_m"].as_f64().unwrap();
        let error = error_by_size(state.get(Field::Q), &numbers(&case["q"]), 1.0);
        worst = worst.max(error / open.abs().max(1e-12));
        println!("state {k}: q differs by {error:.2e}, HyRoDyn's own loop is open by {open:.2e} m");
    }
    println!("worst {worst:.1} rad for each metre by which HyRoDyn's loop is open");
    // an error of 1 m turns a rod of a quarter of a metre, or an arm of a few centimetres, by 1
    // over its length
    assert!(worst < 200.0, "{worst}");
}
