//! Builds robots in code: joints, inertias, loops and couplings one by one, all faults at the end.

mod check;
mod cut;
mod inertia;
mod joint;
mod submechanism;
#[cfg(test)]
mod tests;

pub use cut::{CutBuilder, CutJoint};
pub use joint::JointBuilder;

use self::submechanism::Group;
use crate::description::{Curve, Description, Inertial, JointKind, Link, SubmechanismKind};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::model::{Compiled, Model};
use crate::scalar::Dd;
use crate::spatial::Pose;

/// A link of a robot under construction, and the joint that moves it.
///
/// The tree has one joint for each link except the base, so one name denotes both: as the parent of
/// a joint or the end of a cut it is the link, in the lists of a submechanism and in a coupling the
/// joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LinkId(usize);

impl LinkId {
    /// The root link, which no joint moves.
    pub const BASE: LinkId = LinkId(0);

    /// Index of the link in [`Description::links`].
    pub fn index(self) -> usize {
        self.0
    }

    /// Index of the joint that moves it in [`Description::joints`]; `None` for the base.
    pub fn joint(self) -> Option<usize> {
        self.0.checked_sub(1)
    }
}

/// A robot under construction: a [`Description`] without a file.
///
/// Links are made by their joints, from the base outwards. A joint stands where its parent's frame
/// is unless it is placed, carries no mass unless it is given some, and belongs to the
/// submechanism that was begun last. Nothing fails on the way: [`DescriptionBuilder::build`] and
/// [`DescriptionBuilder::compile`] return every fault at once. Allocates; not for the hot path.
///
/// # Examples
/// A pendulum, 1 kg on a massless rod of 1 m, that is held level:
/// ```
/// use sarrus_dynamics::description::Inertial;
/// use sarrus_dynamics::{DescriptionBuilder, LinkId};
///
/// let mut robot = DescriptionBuilder::new("pendulum");
/// let bob = Inertial::point(1.0, [0.0, 0.0, -1.0]);
/// robot.revolute("pivot", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(bob);
/// let model = robot.compile()?.model;
/// assert_eq!(model.independent_names(), ["pivot"]);
/// # Ok::<(), sarrus_dynamics::CompileError>(())
/// ```
/// A four-bar by its pins, driven at the crank and closed by its closed form:
/// ```
/// use sarrus_dynamics::description::{Inertial, SubmechanismKind};
/// use sarrus_dynamics::{ClosureKind, CutJoint, DescriptionBuilder, LinkId};
///
/// let [a, b, c, d] = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.9, 0.0, 0.6], [1.0, 0.0, 0.0]];
/// let y = [0.0, 1.0, 0.0];
/// let mut robot = DescriptionBuilder::new("four-bar");
/// robot.default_inertial(Inertial::sphere(1.0, [0.0; 3], 0.1));
/// robot.submechanism("bars", SubmechanismKind::FourBar);
/// let crank = robot.revolute("crank", LinkId::BASE, y).at(a).link();
/// let coupler = robot.revolute("coupler", crank, y).at(b).link();
/// let rocker = robot.revolute("rocker", LinkId::BASE, y).at(d).link();
/// robot.cut("pin", coupler, rocker).at(c).joint(CutJoint::PlanarRevolute { axis: y });
/// robot.independent([crank]);
/// let model = robot.compile()?.model;
/// assert_eq!(model.closures()[0].kind, ClosureKind::Analytic);
/// # Ok::<(), sarrus_dynamics::CompileError>(())
/// ```
/// All faults come back together:
/// ```
/// use sarrus_dynamics::{DescriptionBuilder, LinkId};
///
/// let mut robot = DescriptionBuilder::new("faulty");
/// robot.revolute("pivot", LinkId::BASE, [0.0, f64::NAN, 0.0]).limits(1.0, -1.0);
/// robot.independent([LinkId::BASE]);
/// assert_eq!(robot.build().unwrap_err().errors.len(), 3);
/// ```
#[derive(Clone, Debug)]
pub struct DescriptionBuilder {
    /// Links, joints and gravity; its submechanisms are made of the groups.
    description: Description,
    /// Pose of each link at zero {root}.
    x_root_link: Vec<Pose<Dd>>,
    /// Inertia of links without their own.
    default_inertial: Option<Inertial>,
    groups: Vec<Group>,
    /// Faults that no description can hold.
    faults: Vec<Diagnostic>,
}

impl DescriptionBuilder {
    /// A robot of one link, `base`, under a gravity of (0, 0, −9.81) m/s².
    pub fn new(name: impl Into<String>) -> DescriptionBuilder {
        let description = Description {
            name: name.into(),
            links: vec![Link { name: "base".into(), inertial: None }],
            joints: Vec::new(),
            submechanisms: Vec::new(),
            gravity: [0.0, 0.0, -9.81],
            zero_pose: Vec::new(),
        };
        DescriptionBuilder {
            description,
            x_root_link: vec![Pose::identity()],
            default_inertial: None,
            groups: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// How many joints there are so far.
    pub fn n_joints(&self) -> usize {
        self.description.joints.len()
    }

    /// Gravity `[m/s²]` (3) {root}.
    pub fn gravity(&mut self, gravity: [f64; 3]) -> &mut DescriptionBuilder {
        self.description.gravity = gravity;
        self
    }

    /// Inertia of the links of later joints, unless they get their own or are massless.
    pub fn default_inertial(&mut self, inertial: Inertial) -> &mut DescriptionBuilder {
        self.default_inertial = Some(inertial);
        self
    }

    /// Rotation about an axis `[-]` (3) {joint frame}; a new link on the parent.
    pub fn revolute(
        &mut self,
        name: impl Into<String>,
        parent: LinkId,
        axis: [f64; 3],
    ) -> JointBuilder<'_> {
        self.joint(name, JointKind::Revolute, parent).axis(axis)
    }

    /// Translation along an axis `[-]` (3) {joint frame}; a new link on the parent.
    pub fn prismatic(
        &mut self,
        name: impl Into<String>,
        parent: LinkId,
        axis: [f64; 3],
    ) -> JointBuilder<'_> {
        self.joint(name, JointKind::Prismatic, parent).axis(axis)
    }

    /// No motion; a new link on the parent, whose frame can be asked for by name.
    pub fn fixed(&mut self, name: impl Into<String>, parent: LinkId) -> JointBuilder<'_> {
        self.joint(name, JointKind::Fixed, parent)
    }

    /// All three rotations, q = x y z w; a new link on the parent.
    pub fn spherical(&mut self, name: impl Into<String>, parent: LinkId) -> JointBuilder<'_> {
        self.joint(name, JointKind::Spherical, parent)
    }

    /// All six freedoms, q = [p; x y z w]; a new link on the parent.
    pub fn floating(&mut self, name: impl Into<String>, parent: LinkId) -> JointBuilder<'_> {
        self.joint(name, JointKind::Floating, parent)
    }

    /// A joint of any kind, of axis x where its kind has one; a new link on the parent.
    pub fn joint(
        &mut self,
        name: impl Into<String>,
        kind: JointKind,
        parent: LinkId,
    ) -> JointBuilder<'_> {
        let name = name.into();
        let parent = self.known(parent, Site::Joint(self.description.joints.len()));
        let joint = self.push(name, kind, parent.0);
        if kind != JointKind::Fixed {
            self.group().spanning_tree.push(joint);
        }
        JointBuilder::new(self, joint)
    }

    /// Begins a submechanism; the joints, cuts and lists after it belong to it. Those before the
    /// first one belong to a serial submechanism of the robot's name.
    pub fn submechanism(
        &mut self,
        name: impl Into<String>,
        kind: SubmechanismKind,
    ) -> &mut DescriptionBuilder {
        self.groups.push(Group::new(name.into(), kind));
        self
    }

    /// The independent joints of the submechanism, in the order of y; without it, where there is
    /// no loop, all that follow no other.
    pub fn independent(
        &mut self,
        joints: impl IntoIterator<Item = LinkId>,
    ) -> &mut DescriptionBuilder {
        let joints = self.joints(joints);
        self.group().independent = Some(joints);
        self
    }

    /// The actuated joints of the submechanism, in the order of u; without it the independent ones
    /// but those of a quaternion.
    pub fn active(&mut self, joints: impl IntoIterator<Item = LinkId>) -> &mut DescriptionBuilder {
        let joints = self.joints(joints);
        self.group().active = Some(joints);
        self
    }

    /// All joints of the submechanism in the order of q; without it that of their making.
    pub fn order(&mut self, joints: impl IntoIterator<Item = LinkId>) -> &mut DescriptionBuilder {
        let joints = self.joints(joints);
        self.group().spanning_tree = joints;
        self
    }

    /// Closes a loop of the submechanism between two links; without a cut the loops are those that
    /// the submechanism's kind defines.
    pub fn cut(
        &mut self,
        name: impl Into<String>,
        predecessor: LinkId,
        successor: LinkId,
    ) -> CutBuilder<'_> {
        CutBuilder::new(self, name.into(), predecessor, successor)
    }

    /// A joint follows others: q = Σ multiplier · q_master + offset, `[m, rad]`.
    pub fn couple(
        &mut self,
        follower: LinkId,
        masters: impl IntoIterator<Item = (LinkId, f64)>,
        offset: f64,
    ) -> &mut DescriptionBuilder {
        let (joints, multipliers): (Vec<LinkId>, Vec<f64>) = masters.into_iter().unzip();
        let terms = self.joints(joints).into_iter().zip(multipliers).collect();
        if let Some(&follower) = self.joints([follower]).first() {
            let joint = &mut self.description.joints[follower];
            let coupling = joint.coupling.get_or_insert_default();
            coupling.offset = offset;
            if !core::mem::replace(&mut coupling.terms, terms).is_empty() {
                let found = format!("joint {} that follows others twice", joint.name);
                self.fault(Site::Joint(follower), found, "one coupling", "add their masters up");
            }
        }
        self
    }

    /// A joint follows another one by a curve, besides those of [`DescriptionBuilder::couple`]: q =
    /// … + f(q_of).
    pub fn couple_by(
        &mut self,
        follower: LinkId,
        of: LinkId,
        curve: Curve,
    ) -> &mut DescriptionBuilder {
        if let [follower, of] = self.joints([follower, of])[..] {
            let coupling = &mut self.description.joints[follower].coupling;
            coupling.get_or_insert_default().curves.push((of, curve));
        }
        self
    }

    /// The description.
    ///
    /// # Errors
    /// All faults that were found: names that stand twice, numbers that are not finite, links of
    /// another robot, lists that name the base or a fixed joint, loops without rows, place or
    /// independent joints.
    pub fn build(&self) -> Result<Description, CompileError> {
        let mut description = self.description.clone();
        let mut errors = self.faults.clone();
        for (s, group) in self.groups.iter().enumerate() {
            let part = group.finished(s, &self.description.joints, &mut errors);
            description.submechanisms.push(part);
        }
        errors.extend(check::check(&description));
        if errors.is_empty() { Ok(description) } else { Err(CompileError::of(errors)) }
    }

    /// The description as a model: [`DescriptionBuilder::build`], then [`Model::compile`].
    ///
    /// # Errors
    /// The faults of the first of the two that finds any.
    pub fn compile(&self) -> Result<Compiled, CompileError> {
        Model::compile(&self.build()?)
    }

    /// The submechanism that was begun last.
    fn group(&mut self) -> &mut Group {
        if self.groups.is_empty() {
            let name = self.description.name.clone();
            self.submechanism(name, SubmechanismKind::Serial);
        }
        let last = self.groups.len() - 1;
        &mut self.groups[last]
    }

    /// The joints of these links; a link without a moving joint is a fault.
    fn joints(&mut self, links: impl IntoIterator<Item = LinkId>) -> Vec<usize> {
        let mut joints = Vec::new();
        for link in links {
            let site = self.groups.len().checked_sub(1).map_or(Site::Robot, Site::Submechanism);
            let link = self.known(link, site);
            match link.joint() {
                Some(joint) if self.description.joints[joint].kind != JointKind::Fixed => {
                    joints.push(joint);
                }
                _ => {
                    let found = format!(
                        "the link {} where a joint is named",
                        self.description.links[link.0].name
                    );
                    self.fault(site, found, "a link that a joint moves", "name another");
                }
            }
        }
        joints
    }

    /// A link of this robot; of another one it is a fault, and the base stands for it.
    fn known(&mut self, link: LinkId, site: Site) -> LinkId {
        if link.0 < self.description.links.len() {
            return link;
        }
        let found = format!("link {} of {}", link.0, self.description.links.len());
        self.fault(site, found, "a link of this robot", "use what its own joints return");
        LinkId::BASE
    }

    fn fault(&mut self, site: Site, found: String, expected: &str, help: &str) {
        self.faults.push(Diagnostic::new(site, found, expected, help));
    }
}
