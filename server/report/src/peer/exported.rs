//! How far the files of `sarrus export` are from the robot, by the engine that reads them: a
//! program in Python, which needs the engine's wheel.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use sarrus_dynamics::description::{Description, JointKind, Submechanism, SubmechanismKind};
use sarrus_dynamics::{Compiled, Field, FieldSet, Model, Plan, Query, Request, Workspace};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::program;
use crate::Outcome;
use crate::robots::{Own, Robot, Subject, packed};

/// The program.
const PROGRAM: &str = include_str!("exported.py");
/// Its exit code where a package is missing.
const MISSING: i32 = 3;
/// Random states.
const STATES: usize = 8;

/// What an engine makes of the files.
#[derive(Clone, Debug, Serialize)]
pub enum Deviation {
    /// It was not run, for this reason.
    NotRun(String),
    /// It was.
    Measured {
        /// The engine with its version.
        engine: String,
        /// Why its accelerations differ, if they were compared.
        why: String,
        /// The largest differences.
        rows: Vec<Difference>,
    },
}

/// The largest difference of a quantity on all states, by size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Difference {
    /// `M`, `forces` (bias forces with springs and dampers), `loops` (rows of K and K̇ q̇, each as a
    /// combination of the other side's), `accelerations` (by the engine's own solver).
    pub quantity: String,
    /// The difference.
    pub difference: f64,
}

impl Difference {
    /// Whether it is more than rounding; accelerations are as exact as the engine's solver.
    pub fn is_finding(&self) -> bool {
        self.quantity != "accelerations" && !(self.difference <= 1e-9)
    }
}

#[derive(Deserialize)]
struct Found {
    engine: String,
    why: String,
    rows: Vec<Difference>,
}

/// Compares a robot with its files as an engine (`MuJoCo`, `Pinocchio` or `Drake`) reads them, at
/// random states; `held` is the robot with the cuts of the files.
///
/// # Errors
/// A robot whose loops do not close at most states, or an output of the program that cannot be
/// read.
pub fn deviation(
    description: &Description,
    held: &Description,
    engine: &str,
    file: &Path,
) -> Outcome<Deviation> {
    let input = json!({
        "engine": engine,
        "file": file,
        "joints": joints(description),
        "states": states(description, held)?,
    })
    .to_string();
    let named = std::env::var_os("SARRUS_PYTHON").map(PathBuf::from);
    let built = program("venv/bin/python");
    let mut why = String::new();
    for python in named.into_iter().chain(built).chain([PathBuf::from("python3")]) {
        let started = Command::new(&python)
            .args(["-c", PROGRAM])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = match started {
            Ok(child) => child,
            Err(error) => {
                why = format!("{}: {error}", python.display());
                continue;
            }
        };
        // a program that ends early closes its end
        if let Some(mut to) = child.stdin.take() {
            let _ = to.write_all(input.as_bytes());
        }
        let output = child.wait_with_output()?;
        let words = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        match output.status.code() {
            Some(0) => {
                let Found { engine, why, rows } = serde_json::from_slice(&output.stdout)?;
                return Ok(Deviation::Measured { engine, why, rows });
            }
            Some(MISSING) => why = format!("{}: {words}", python.display()),
            _ => {
                let last = words.lines().last().unwrap_or_default().to_owned();
                return Ok(Deviation::NotRun(last));
            }
        }
    }
    Ok(Deviation::NotRun(why))
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
        all.push(json!({"name": joint.name, "q": q, "nq": nq, "v": v, "nv": nv}));
        q += nq;
        v += nv;
    }
    all
}

/// Random states with M, bias forces, K and k of the tree.
fn states(description: &Description, held: &Description) -> Outcome<Vec<Value>> {
    let robot = Robot::load_some(Subject::Own(Own::new(description.clone())), STATES, |_| true)?;
    let Some(variant) = robot.variants.first() else { return Err("no variant".into()) };
    let model = &variant.compiled.model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::QGuess]);
    let mut closed = Asked::new(model, Request::Kinematics, given, &[Field::Q, Field::Qd])?;
    // the rows of the robot as it is: those of the files must be combinations of them
    let mut rows = match Model::compile(description) {
        Ok(Compiled { model, .. }) => {
            Asked::new(&model, Request::Kinematics, given, &[Field::K, Field::KBias])?
        }
        Err(error) => return Err(error.into()),
    };
    let tree = Model::compile(&tree(held))?.model;
    let given = FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]);
    let mut terms = Asked::new(&tree, Request::InverseDynamics, given, &[Field::MY, Field::TauY])?;
    let mut all = Vec::new();
    for (s, state) in robot.states.iter().enumerate() {
        let input = packed(&closed.plan, state, 0);
        let [q, qd] = closed.answer(&input)?;
        let [k_rows, k] = rows.answer(&input)?;
        let zeros = vec![0.0; qd.len()];
        let [m, h] = terms.answer(&[&q[..], &qd, &zeros].concat())?;
        let tau: Vec<f64> =
            (0..qd.len()).map(|i| 10.0 * ((7 * i + 3 * s) as f64 * 0.61).sin()).collect();
        all.push(json!({"q": q, "qd": qd, "tau": tau, "M": m, "h": h, "K": k_rows, "k": k}));
    }
    Ok(all)
}

/// The robot as a tree: all joints independent, without loops and couplings.
fn tree(of: &Description) -> Description {
    let mut tree = of.clone();
    let all: Vec<usize> =
        of.submechanisms.iter().flat_map(|part| part.spanning_tree.clone()).collect();
    tree.submechanisms = vec![Submechanism {
        name: "tree".to_owned(),
        kind: SubmechanismKind::Serial,
        type_name: "SERIAL".to_owned(),
        spanning_tree: all.clone(),
        independent: all,
        active: Vec::new(),
        loops: Vec::new(),
        closed_forms: true,
    }];
    tree.joints.iter_mut().for_each(|joint| joint.coupling = None);
    tree
}

/// A plan with its workspace.
struct Asked<const N: usize> {
    model: Model,
    plan: Plan,
    workspace: Workspace<f64>,
    wanted: [Field; N],
}

impl<const N: usize> Asked<N> {
    fn new(
        model: &Model,
        request: Request,
        given: FieldSet,
        wanted: &[Field; N],
    ) -> Outcome<Asked<N>> {
        let plan = Plan::new(model, &Query::new(request, given, FieldSet::of(wanted)))?;
        let workspace = Workspace::for_plans(model, [&plan]);
        Ok(Asked { model: model.clone(), plan, workspace, wanted: *wanted })
    }

    /// The wanted fields of a state that has an answer.
    fn answer(&mut self, input: &[f64]) -> Outcome<[Vec<f64>; N]> {
        let mut output = vec![0.0; self.plan.want().len()];
        self.plan.run(&self.model, &mut self.workspace, input, &mut output).ok()?;
        Ok(self.wanted.map(|field| {
            let slot = self.plan.want().slot(field);
            slot.map_or(Vec::new(), |slot| output[slot.range()].to_vec())
        }))
    }
}
