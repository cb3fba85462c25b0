//! Other independents, where those in use come near a singularity.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request, Status};

use super::events::EventKind;
use crate::coordinates::{largest, pick, places};
use crate::error::Outcome;
use crate::motion::engine::Engine;

/// Distance to singularity below which better independents are looked for.
pub(crate) const NEAR: f64 = 0.1;
/// How much farther from a singularity others have to be.
const BETTER: f64 = 3.0;
/// How much nearer it has to be for another attempt.
const AGAIN: f64 = 0.25;

/// Joints up to which the distance is measured after each step, and the growth of G after which it
/// is in larger robots.
const CHEAP: usize = 16;
const GROWN: f64 = 1.5;

/// Looks at the independents after each step.
pub(crate) struct Watch {
    planned: Planned<f64>,
    /// How near a singularity others were tried in vain; forgotten away from it.
    refused: f64,
    /// Measuring takes no time worth sparing.
    cheap: bool,
    /// The least of the largest entries of G so far, and its value when the distance was last
    /// measured.
    least: f64,
    measured: f64,
    distance: Option<f64>,
}

/// The effect of other independents.
pub(crate) struct Better {
    pub(crate) engine: Engine,
    pub(crate) x: Vec<f64>,
    pub(crate) event: EventKind,
}

impl Watch {
    /// A watch over a model, if it has loops at all.
    pub(crate) fn new(model: &Model<f64>) -> Outcome<Option<Watch>> {
        use Field::*;
        if model.sizes().n_c == 0 {
            return Ok(None);
        }
        let given = FieldSet::of(&[Y, QGuess, QdGuess]);
        let planned = Planned::new(
            model,
            &Query::new(Request::Kinematics, given, FieldSet::of(&[SigmaMin, GoodIndependents])),
        )?;
        let cheap = model.sizes().n_v <= CHEAP;
        let infinite = f64::INFINITY;
        Ok(Some(Watch {
            planned,
            refused: infinite,
            cheap,
            least: infinite,
            measured: 0.0,
            distance: None,
        }))
    }

    /// Distance to singularity at the engine's settled state, measured again where it may have
    /// become less: at a singularity of the independents G has no bound. `close` always measures.
    pub(crate) fn distance(&mut self, engine: &Engine, x: &[f64], close: bool) -> Option<f64> {
        let largest = largest(engine.anchor.G.iter().copied());
        self.least = self.least.min(largest);
        let grown = largest > GROWN * self.least && largest > GROWN * self.measured;
        if self.cheap || close || self.distance.is_none() || grown || engine.anchor.G.is_empty() {
            self.measured = largest;
            self.distance = self.measure(engine, x);
        } else if largest < self.measured {
            self.measured = largest;
        }
        self.distance
    }

    /// The cause of the singularity at the pose that was measured last: the independents where
    /// others are good, else the loops.
    pub(crate) fn blame(&self) -> Status {
        let good = self.planned.get(Field::GoodIndependents);
        if good.is_empty() || good.iter().any(|x| x.is_nan()) {
            Status::SingularClosure
        } else {
            Status::SingularIndependents
        }
    }

    /// A robot with better independents at the engine's settled state x, as near a singularity as
    /// was just measured, or why there is none. `pressed`: there is no way on with those in use.
    pub(crate) fn better(
        &mut self,
        engine: &Engine,
        x: &[f64],
        near: f64,
        pressed: bool,
    ) -> Option<Result<Box<Better>, EventKind>> {
        if near >= NEAR && !pressed {
            self.refused = f64::INFINITY;
            return None;
        }
        // compiling takes its time: again only when it has become much nearer
        if near > AGAIN * self.refused && !pressed {
            return None;
        }
        let model = &engine.compiled.model;
        let good = self.planned.get(Field::GoodIndependents);
        let is_good = |name: &String| {
            model.tree_names().iter().zip(good).any(|(of, good)| of == name && *good == 1.0)
        };
        if model.independent_names().iter().all(is_good) || good.iter().any(|x| x.is_nan()) {
            return None;
        }
        let to: Vec<String> =
            model.tree_names().iter().filter(|name| is_good(name)).cloned().collect();
        self.refused = near;
        match with_independents(engine, &to, x, near) {
            Ok((_, after)) if after < BETTER * near && !(pressed && after > near) => None,
            Ok((better, _)) => Some(Ok(better)),
            Err(why) => Some(Err(EventKind::NotSwitched { to, why })),
        }
    }

    /// Distance to singularity at a state.
    fn measure(&mut self, engine: &Engine, x: &[f64]) -> Option<f64> {
        self.planned.give(Field::Y, &x[..engine.mechanism.sizes.n_qy]);
        self.planned.give(Field::QGuess, &engine.anchor.q);
        self.planned.give(Field::QdGuess, &engine.anchor.qd);
        let status = self.planned.run(&engine.compiled.model).status;
        let distance = self.planned.get(Field::SigmaMin).first().copied()?;
        (status == Status::Ok && distance.is_finite()).then_some(distance)
    }
}

/// The robot with other independents at the same state, and its distance to singularity.
fn with_independents(
    engine: &Engine,
    to: &[String],
    x: &[f64],
    before: f64,
) -> Result<(Box<Better>, f64), String> {
    let mut description = engine.description.clone();
    redeclare(&mut description, to);
    let compiled = Model::compile(&description).map_err(|error| error.to_string())?;
    if compiled.model.tree_q_names() != engine.compiled.model.tree_q_names() {
        return Err("the coordinates of the tree would change their order".to_owned());
    }
    let springs = engine.mechanism.springs.clone();
    let inputs = engine.mechanism.inputs.clone();
    let mut next = Engine::new(
        (description, compiled),
        springs,
        inputs,
        engine.mechanism.effects.clone(),
        &engine.anchor.q,
    )
    .map_err(|error| error.to_string())?;
    next.counts = engine.counts;
    (next.anchor.t, next.anchor.qd) = (engine.anchor.t, engine.anchor.qd.clone());
    // y and ẏ are among q and q̇
    let model = &next.compiled.model;
    let y = places(model.independent_q_names(), model.tree_q_names());
    let yd = places(model.independent_names(), model.tree_names());
    let mut state = [pick(&engine.anchor.q, &y), pick(&engine.anchor.qd, &yd)].concat();
    // the windings, the rotors behind springs and the work go on
    state.extend(&x[engine.mechanism.sizes.n_qy + engine.mechanism.sizes.n_vy..]);
    next.settle(engine.anchor.t, &mut state).map_err(|status| status.to_string())?;
    let distance = Watch::new(&next.compiled.model)
        .ok()
        .flatten()
        .and_then(|mut watch| watch.distance(&next, &state, true));
    let after = distance.ok_or("their distance to singularity is not known")?;
    let from = engine.compiled.model.independent_names().to_vec();
    let to = next.compiled.model.independent_names().to_vec();
    let event = EventKind::Switched { from, to, before, after };
    Ok((Box::new(Better { engine: next, x: state, event }), after))
}

/// Declares other joints independent, each in the submechanism that has it; those that stay keep
/// their places.
fn redeclare(description: &mut Description, to: &[String]) {
    let joints = &description.joints;
    // a joint of several freedoms counts by its first
    let is_wanted = |joint: &usize| {
        let name = &joints[*joint].name;
        to.iter().any(|of| of == name || of.strip_suffix("/rx") == Some(name))
    };
    for submechanism in &mut description.submechanisms {
        let new: Vec<usize> =
            submechanism.spanning_tree.iter().copied().filter(is_wanted).collect();
        let declared = &mut submechanism.independent;
        let mut added = new
            .iter()
            .copied()
            .filter(|joint| !declared.contains(joint))
            .collect::<Vec<_>>()
            .into_iter();
        let kept: Vec<usize> = declared
            .iter()
            .filter_map(|joint| if new.contains(joint) { Some(*joint) } else { added.next() })
            .collect();
        *declared = kept.into_iter().chain(added).collect();
    }
}
