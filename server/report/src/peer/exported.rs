//! How far the files of `sarrus export` are from the robot, by the engine that reads them: a
//! program in Python, which needs the engine's wheel.

use std::path::{Path, PathBuf};
use std::process::Command;

use sarrus_dynamics::description::{Description, JointKind};
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{BUILD, program, spoken};
use crate::Outcome;
use crate::robots::{Own, Planned, Robot, Subject};

/// The program.
const PROGRAM: &str = concat!(
    "import sys; sys.path = [of for of in sys.path if of] # none of the current folder\n",
    include_str!("exported.py")
);
/// Its exit code where a package is missing.
const MISSING: i32 = 3;
/// Random states.
const STATES: usize = 8;

/// The differences that an engine finds.
#[derive(Clone, Debug, Serialize)]
pub enum Deviation {
    /// It was not run, for this reason.
    NotRun(String),
    /// It was.
    Measured(Found),
}

/// The findings of an engine, as its program writes them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Found {
    /// The engine with its version.
    pub engine: String,
    /// Why its accelerations differ, if they were compared.
    pub why: String,
    /// The largest differences.
    pub rows: Vec<Difference>,
}

/// The largest difference of a quantity on all states, by size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Difference {
    /// `M`, `forces` (bias forces with springs and dampers), `loops` (rows of K and K̇ q̇, as
    /// combinations of the other side's), `accelerations` (by the engine's own solver).
    pub quantity: String,
    /// The difference.
    pub difference: f64,
}

impl Difference {
    /// Whether it is more than rounding; accelerations by the engine's solver need one right digit.
    pub fn is_finding(&self) -> bool {
        let most = if self.quantity == "accelerations" { 1.0 } else { 1e-9 };
        self.difference.is_nan() || self.difference > most
    }
}

/// The interpreters that may have an engine's wheel: that of `SARRUS_PYTHON`, that of the built
/// peers, `python3`.
pub fn pythons() -> Vec<PathBuf> {
    let named = std::env::var_os("SARRUS_PYTHON").map(PathBuf::from);
    let built = program("venv/bin/python");
    named.into_iter().chain(built).chain([PathBuf::from("python3")]).collect()
}

/// Compares a robot with its files as an engine (`MuJoCo`, `Pinocchio` or `Drake`) reads them, at
/// random states; `held` is the robot with the cuts of the files. The first of the interpreters
/// that has the engine's wheel counts.
///
/// # Errors
/// A robot whose loops do not close at most states, or an output of the program that cannot be
/// read.
pub fn deviation(
    description: &Description,
    held: &Description,
    engine: &str,
    file: &Path,
    pythons: &[PathBuf],
) -> Outcome<Deviation> {
    let parts = held.submechanisms.iter();
    let cuts =
        parts.flat_map(|part| part.loops.iter().map(|each| format!("{}/{}", part.name, each.name)));
    let input = json!({
        "engine": engine,
        "file": file,
        "joints": joints(held),
        "cuts": cuts.collect::<Vec<_>>(),
        "states": states(description, held)?,
    })
    .to_string();
    let mut reasons = Vec::new();
    for python in pythons {
        let output = match spoken(Command::new(python).args(["-c", PROGRAM]), &input) {
            Ok((_, output)) => output,
            Err(error) => {
                reasons.push(format!("{}: {error}", python.display()));
                continue;
            }
        };
        let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        match output.status.code() {
            Some(0) => return Ok(Deviation::Measured(serde_json::from_slice(&output.stdout)?)),
            Some(MISSING) => reasons.push(format!("{}: {words}", python.display())),
            _ => {
                let late = words.lines().find(|line| line.starts_with("Timeout"));
                let last = late.or(words.lines().last()).unwrap_or_default();
                return Ok(Deviation::NotRun(last.to_owned()));
            }
        }
    }
    Ok(Deviation::NotRun(format!("{} ({BUILD} installs it)", reasons.join("; "))))
}

/// The joints in the order of q, with their places.
fn joints(of: &Description) -> Vec<Value> {
    let mut all = Vec::new();
    let [mut q, mut v] = [0; 2];
    for joint in of.submechanisms.iter().flat_map(|part| &part.spanning_tree) {
        let Some(joint) = of.joints.get(*joint) else { continue };
        let [nq, nv] = match joint.kind {
            JointKind::Spherical => [4, 3],
            JointKind::Floating => [7, 6],
            _ => [1, 1],
        };
        let link = of.links.get(joint.child).map(|link| &link.name);
        let name = &joint.name;
        all.push(json!({"name": name, "link": link, "q": q, "nq": nq, "v": v, "nv": nv}));
        q += nq;
        v += nv;
    }
    all
}

/// Random states with M, bias forces, K and k of the tree.
fn states(description: &Description, held: &Description) -> Outcome<Vec<Value>> {
    let robot = Robot::load_some(Subject::Own(Own::new(description.clone())), STATES, |_| true)?;
    let model = &robot.variants.first().ok_or("no variant")?.compiled.model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::QGuess]);
    let closed = [Field::Q, Field::Qd, Field::K, Field::KBias];
    let query = Query::new(Request::Kinematics, given, FieldSet::of(&closed));
    let mut closed = Planned::new(model, Plan::new(model, &query)?, &robot.states, 0);
    let tree = Model::compile(&sarrus_models::as_tree(held))?.model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let wanted = FieldSet::of(&[Field::MY, Field::TauY]);
    let query = Query::new(Request::InverseDynamics, given, wanted);
    let mut terms = Planned::new(&tree, Plan::new(&tree, &query)?, &[], 0);
    let mut all = Vec::new();
    for s in 0..robot.states.len() {
        closed.answer(s).ok()?;
        let [q, qd] = [Field::Q, Field::Qd].map(|field| closed.get(field).to_vec());
        let n = qd.len();
        terms.inputs.push([&q[..], &qd, &vec![0.0; n]].concat());
        terms.answer(s).ok()?;
        let tau = (0..n).map(|i| 10.0 * ((7 * i + 3 * s) as f64 * 0.61).sin());
        all.push(json!({
            "q": q, "qd": qd, "tau": tau.collect::<Vec<_>>(),
            "M": terms.get(Field::MY), "h": terms.get(Field::TauY),
            "K": closed.get(Field::K), "k": closed.get(Field::KBias),
        }));
    }
    Ok(all)
}
