//! Random states, the same in every run.

use sarrus_dynamics::description::JointKind;
use sarrus_dynamics::{Field, FieldSet, Plan, Request, Status, Wanted, Workspace};

use crate::Outcome;
use crate::cases::{self, Question, Variant, packed};

/// Positions within ± this many radians or metres, velocities (1/s), accelerations (1/s²), actuator forces (N or N m).
const ANGLE: f64 = 0.25;
const LENGTH: f64 = 0.03;
const VELOCITY: f64 = 1.0;
const ACCELERATION: f64 = 5.0;
const FORCE: f64 = 10.0;
/// How long before a state its guess was closed, in seconds.
const EARLIER: f64 = 1e-3;

/// A robot with its variants and the states that all of them can take.
pub(crate) struct Robot {
    pub(crate) name: &'static str,
    pub(crate) variants: Vec<Variant>,
    pub(crate) states: Vec<State>,
    /// States that were drawn and left out because some variant has no answer there.
    pub(crate) left_out: usize,
}

/// One state and, for each variant, the closed pose shortly before it.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) y: Vec<f64>,
    pub(crate) yd: Vec<f64>,
    pub(crate) ydd: Vec<f64>,
    pub(crate) tau_u: Vec<f64>,
    pub(crate) guesses: Vec<Vec<f64>>,
}

impl Robot {
    /// Loads every variant and draws the states.
    pub(crate) fn load(name: &'static str, n_states: usize) -> Outcome<Robot> {
        Robot::load_some(name, n_states, |_| true)
    }

    /// The same with the variants of some names only.
    pub(crate) fn load_some(name: &'static str, n_states: usize, wanted: impl Fn(&str) -> bool) -> Outcome<Robot> {
        let (bundled, variants) = cases::variants(name, wanted)?;
        let sliding = |joint: &String| {
            bundled.description.joints.iter().any(|candidate| candidate.name == *joint && candidate.kind == JointKind::Prismatic)
        };
        let reach: Vec<f64> =
            bundled.compiled.model.independent_names().iter().map(|joint| if sliding(joint) { LENGTH } else { ANGLE }).collect();
        let n_u = bundled.compiled.model.sizes().n_u;

        let mut random = Random(0);
        let (mut states, mut left_out) = (Vec::new(), 0);
        while states.len() < n_states {
            let mut state = State {
                y: reach.iter().map(|reach| reach * random.next()).collect(),
                yd: reach.iter().map(|_| VELOCITY * random.next()).collect(),
                ydd: reach.iter().map(|_| ACCELERATION * random.next()).collect(),
                tau_u: (0..n_u).map(|_| FORCE * random.next()).collect(),
                guesses: Vec::new(),
            };
            if fits(&variants, &mut state)? {
                states.push(state);
            } else {
                left_out += 1;
            }
            if left_out > n_states {
                return Err(format!("{name}: more than half of the random states have no answer").into());
            }
        }
        Ok(Robot { name, variants, states, left_out })
    }
}

/// Finds the guesses; false where some variant cannot close its loops or has no forward dynamics.
fn fits(variants: &[Variant], state: &mut State) -> Outcome<bool> {
    let earlier: Vec<f64> = state.y.iter().zip(&state.yd).map(|(y, yd)| y - EARLIER * yd).collect();
    for (k, Variant { compiled, .. }) in variants.iter().enumerate() {
        let model = &compiled.model;
        let mut workspace = Workspace::new(model);
        let close = Plan::new(model, &Wanted::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q])))?;
        let mut q = vec![0.0; model.sizes().n_q];
        if close.run(model, &mut workspace, &earlier, &mut q).status != Status::Ok {
            return Ok(false);
        }
        state.guesses.push(q);
        for question in [Question::InverseDynamics, Question::ForwardDynamics] {
            let plan = Plan::new(model, &question.wanted())?;
            let mut output = vec![0.0; plan.want().len()];
            if plan.run(model, &mut workspace, &packed(&plan, state, k), &mut output).status != Status::Ok {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// SplitMix64.
struct Random(u64);

impl Random {
    /// Uniform in [−1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ x >> 31) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
