//! The tree of a robot's links at the zero pose.

use sarrus_dynamics::description::{Cut, Description, Joint, JointKind, Loop};

use crate::pose::Pose;

/// A tree of links.
pub(crate) struct Tree<'a> {
    pub(crate) of: &'a Description,
    /// The link that is no joint's child.
    pub(crate) root: usize,
    /// The joint above each link.
    above: Vec<Option<usize>>,
    /// The pose of each link at zero {root}.
    pub(crate) zero: Vec<Pose>,
}

impl<'a> Tree<'a> {
    pub(crate) fn new(of: &'a Description) -> Tree<'a> {
        let n = of.links.len();
        let mut above = vec![None; n];
        let mut below = vec![Vec::new(); n];
        for (j, joint) in of.joints.iter().enumerate() {
            above[joint.child] = Some(j);
            below[joint.parent].push(joint);
        }
        let root = above.iter().position(Option::is_none).unwrap_or(0);
        let mut tree = Tree { of, root, above, zero: vec![Pose::NONE; n] };
        let mut open = vec![root];
        while let Some(link) = open.pop() {
            for joint in &below[link] {
                tree.zero[joint.child] = tree.zero[link].then(Pose::of(&joint.origin));
                open.push(joint.child);
            }
        }
        tree
    }

    /// The joints below a link.
    pub(crate) fn below(&self, link: usize) -> impl Iterator<Item = (usize, &'a Joint)> + use<'a> {
        let joints = self.of.joints.iter().enumerate();
        joints.filter(move |(_, joint)| joint.parent == link)
    }

    pub(crate) fn link(&self, link: usize) -> &'a str {
        self.of.links.get(link).map_or("", |of| &of.name)
    }

    /// The two frames of a cut, each in its link.
    pub(crate) fn places(&self, of: &Loop) -> [Pose; 2] {
        let at = match of.cut {
            Cut::AtJoint(joint) => self.of.joints.get(joint).map_or(self.root, |of| of.child),
            Cut::AtLink(link) => link,
            Cut::Placed { predecessor, successor } => {
                return [Pose::of(&predecessor), Pose::of(&successor)];
            }
            _ => self.root,
        };
        [of.predecessor, of.successor].map(|link| self.zero[link].inverse().then(self.zero[at]))
    }

    /// The two frames of a cut {root}.
    pub(crate) fn ends(&self, of: &Loop) -> [Pose; 2] {
        let [first, second] = self.places(of);
        [self.zero[of.predecessor].then(first), self.zero[of.successor].then(second)]
    }

    /// Joints with a motor, in the order of u.
    pub(crate) fn active(&self) -> impl Iterator<Item = &'a Joint> + use<'a> {
        let of = self.of;
        let all = of.submechanisms.iter().flat_map(|part| &part.active);
        all.filter_map(|joint| of.joints.get(*joint))
    }

    /// The moving joints that carry a link, the nearest first.
    pub(crate) fn carriers(&self, link: usize) -> Vec<usize> {
        let joint = |link: usize| self.above[link];
        let path = std::iter::successors(joint(link), |j| joint(self.of.joints[*j].parent));
        path.filter(|j| self.of.joints[*j].kind != JointKind::Fixed).collect()
    }

    /// Whether only fixed joints are between a link and the root.
    pub(crate) fn stands(&self, link: usize) -> bool {
        self.carriers(link).is_empty()
    }
}
