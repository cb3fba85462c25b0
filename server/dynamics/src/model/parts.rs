//! The parts in which the loops of a cluster are closed.

use crate::closure::{
    Block, BlockForm, Chain, Closure, Dyads, Form, Formed, Numerical, Pin, Platform, Rods, Step,
};
use crate::mechanism::Cluster;
use crate::model::Model;

/// A set of rows that determines as many joints once the parts before it are closed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// `linear` of couplings; `dyad`, `leg` and the turns of a `rod` in closed form; `newton`.
    /// Where a table has closed poses ([`ClosureAtZero::seeds`](crate::ClosureAtZero)) a closed
    /// form is that of its cells, and Newton's method on the rows answers beyond them and from a
    /// guess.
    pub method: &'static str,
    /// Number of its rows, dropped ones not counted.
    pub rows: usize,
    /// The joints that it determines.
    pub joints: Vec<String>,
}

impl Model<f64> {
    /// The parts of a cluster's closure in the order of solution. Allocates.
    pub(super) fn parts_of(&self, c: usize) -> Vec<Part> {
        let cluster = &self.clusters[c];
        let name = |v: &usize| self.meta.tree[self.order.v_external[cluster.v + v]].clone();
        let sets = sets(&self.closures[c], cluster).into_iter();
        sets.map(|(method, joints)| Part {
            method,
            rows: joints.len(),
            joints: joints.iter().map(name).collect(),
        })
        .collect()
    }
}

/// The method and the local velocities of each part.
fn sets(closure: &Closure<f64>, cluster: &Cluster<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let whole = |method| vec![(method, cluster.dependent.clone())];
    match closure {
        Closure::Serial => Vec::new(),
        Closure::Coupling(of) => of.polish.as_ref().map_or_else(|| whole("linear"), blocks),
        Closure::Rrpr(of) => of.polish.as_ref().map_or_else(|| whole("dyad"), blocks),
        Closure::Planar(of) => of.polish.as_ref().map_or_else(|| whole("dyad"), blocks),
        Closure::Platform(of) => of.polish.as_ref().map_or_else(|| legs(of), blocks),
        Closure::Numerical(numerical) => match numerical.form() {
            Some(Formed { form: Form::Platform(of), .. }) => legs(of),
            Some(Formed { form: Form::Planar(_) | Form::Rrpr(_), .. }) => whole("dyad"),
            Some(Formed { form: Form::Dyads(of), .. }) => dyads(of),
            Some(Formed { form: Form::Rods(of), .. }) => rods(of),
            Some(Formed { form: Form::Coupling(_), .. }) => whole("linear"),
            Some(Formed { form: Form::Chain(of), .. }) => chain(of),
            Some(Formed { form: Form::Steps(_), .. }) | None => blocks(numerical),
        },
    }
}

fn legs(of: &Platform<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let legs = of.legs.iter().map(|leg| {
        let arm = leg.arm.as_ref().map(|arm| arm.joint.v);
        arm.into_iter().chain(leg.strut.joints.map(|dof| dof.v)).collect()
    });
    let rods = of.rods.iter().map(|rod| {
        let drive = rod.drive.as_ref().map_or(&[][..], |of| &of.joints[1..]);
        rod.joints().into_iter().chain(drive.iter().copied()).collect()
    });
    legs.chain(rods).map(|joints| ("leg", joints)).collect()
}

fn dyads(of: &Dyads<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let pair = |step: &Step<f64>| match step {
        Step::Driven(_) | Step::DrivenSlide(_) => None,
        Step::Pair(pair) => Some((pair.to, Vec::new())),
        Step::SlidingPair(pair) => Some((pair.to, pair.sliders.iter().map(|x| x.joint).collect())),
    };
    let pairs: Vec<([usize; 2], Vec<usize>)> = of.steps.iter().filter_map(pair).collect();
    // a joint between two pairs belongs to the later one
    let moves = |pin: &Pin<f64>, to: &[usize; 2]| pin.links.iter().any(|link| to.contains(link));
    let last = |pin: &Pin<f64>| pairs.iter().rposition(|(to, _)| moves(pin, to));
    let own = |k: usize| of.others.iter().filter(move |pin| last(pin) == Some(k));
    let joints = |k: usize| own(k).map(|pin| pin.joint).chain(pairs[k].1.clone()).collect();
    (0..pairs.len()).map(|k| ("dyad", joints(k))).collect()
}

fn rods(of: &Rods<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let lengths = ("newton", of.unknowns.iter().map(|dof| dof.v).collect());
    let mut turns: Vec<_> = of.rods.iter().map(|rod| ("rod", rod.turns.to_vec())).collect();
    turns.iter_mut().for_each(|(_, of_rod)| of_rod.dedup());
    [lengths].into_iter().chain(turns).collect()
}

fn chain(of: &Chain<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let method = |form: &Form<f64>| match form {
        Form::Coupling(_) => "linear",
        Form::Platform(_) => "leg",
        _ => "dyad",
    };
    let joints = |of: &BlockForm<f64>| of.cluster.dependent.iter().map(|j| of.joints[*j]).collect();
    of.parts.iter().map(|part| (method(&part.form), joints(part))).collect()
}

fn blocks(numerical: &Numerical<f64>) -> Vec<(&'static str, Vec<usize>)> {
    let blocks = numerical.choices[0].blocks.iter();
    let method = |couples| if couples { "linear" } else { "newton" };
    let joints = |block: &Block| block.unknowns.iter().map(|dof| dof.v).collect();
    blocks.map(|block| (method(block.couples), joints(block))).collect()
}
