//! The spanning tree of moving joints: merges fixed joints, finds clusters and orders both depth
//! first.

use crate::compile::geometry::pose;
use crate::description::{Description, Joint, JointKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::scalar::Dd;
use crate::spatial::Pose;

/// The moving joints of a description and the links that each carries.
pub(super) struct Skeleton {
    /// Moving joints of the description, and the index of each joint among them.
    pub(super) moving: Vec<usize>,
    pub(super) moving_of: Vec<usize>,
    /// Moving joint that carries each link (`None`: the world), and the link's pose in that joint's
    /// child link.
    pub(super) carrier: Vec<Option<usize>>,
    pub(super) x_carrier_link: Vec<Pose<Dd>>,
    /// For each moving joint the moving joint below it towards the root, and its frame there.
    pub(super) parent: Vec<Option<usize>>,
    pub(super) x_parent_joint: Vec<Pose<Dd>>,
}

impl Skeleton {
    /// Walks the joints from the root outwards.
    pub(super) fn new(description: &Description) -> Result<Skeleton, Diagnostic> {
        let n_links = description.links.len();
        let mut joint_of = vec![None; n_links];
        for (j, joint) in description.joints.iter().enumerate() {
            if joint.parent >= n_links || joint.child >= n_links || joint.parent == joint.child {
                return Err(fault(
                    Site::Joint(j),
                    "a joint between links that do not exist",
                    "two links of the robot",
                ));
            }
            if joint_of[joint.child].replace(j).is_some() {
                return Err(fault(
                    Site::Link(joint.child),
                    "a link that is the child of two joints",
                    "one parent joint",
                ));
            }
        }
        let mut roots = (0..n_links).filter(|link| joint_of[*link].is_none());
        let (Some(root), None) = (roots.next(), roots.next()) else {
            return Err(fault(
                Site::Robot,
                "no root link or several",
                "exactly one link that is no joint's child",
            ));
        };
        let mut children = vec![Vec::new(); n_links];
        for (j, joint) in description.joints.iter().enumerate() {
            children[joint.parent].push(j);
        }

        let moving = (0..description.joints.len())
            .filter(|j| description.joints[*j].kind != JointKind::Fixed)
            .collect::<Vec<_>>();
        let mut moving_of = vec![usize::MAX; description.joints.len()];
        moving.iter().enumerate().for_each(|(m, j)| moving_of[*j] = m);
        let mut skeleton = Skeleton {
            carrier: vec![None; n_links],
            x_carrier_link: vec![Pose::identity(); n_links],
            parent: vec![None; moving.len()],
            x_parent_joint: vec![Pose::identity(); moving.len()],
            moving,
            moving_of,
        };
        let mut stack = vec![root];
        let mut seen = 1;
        while let Some(link) = stack.pop() {
            for &j in &children[link] {
                let joint: &Joint = &description.joints[j];
                let here = skeleton.x_carrier_link[link].then(&pose(&joint.origin));
                if joint.kind == JointKind::Fixed {
                    skeleton.carrier[joint.child] = skeleton.carrier[link];
                    skeleton.x_carrier_link[joint.child] = here;
                } else {
                    let m = skeleton.moving_of[j];
                    skeleton.parent[m] = skeleton.carrier[link];
                    skeleton.x_parent_joint[m] = here;
                    skeleton.carrier[joint.child] = Some(m);
                }
                stack.push(joint.child);
                seen += 1;
            }
        }
        if seen != n_links {
            return Err(fault(
                Site::Robot,
                "links that the root does not reach: the joints form a cycle",
                "a tree of joints",
            ));
        }
        Ok(skeleton)
    }

    /// The moving joints between the root and a joint, that joint first.
    pub(super) fn chain(&self, joint: Option<usize>) -> Vec<usize> {
        std::iter::successors(joint, |m| self.parent[*m]).collect()
    }

    /// The moving joints between two links, below the joint that carries both: (on the first's
    /// side, on the second's side).
    pub(super) fn path_between(&self, a: usize, b: usize) -> (Vec<usize>, Vec<usize>) {
        let mut a = self.chain(self.carrier[a]);
        let mut b = self.chain(self.carrier[b]);
        while let (Some(x), Some(y)) = (a.last(), b.last()) {
            if x != y {
                break;
            }
            a.pop();
            b.pop();
        }
        (a, b)
    }
}

/// A fault that the readers of files exclude.
fn fault(site: Site, found: &str, expected: &str) -> Diagnostic {
    Diagnostic::new(site, found, expected, "correct the description")
}

/// Partition of the moving joints into clusters, in depth-first order.
pub(super) struct Partition {
    /// Joints of each cluster, parents first.
    pub(super) members: Vec<Vec<usize>>,
    /// Moving joint that is the parent of each cluster.
    pub(super) parent: Vec<Option<usize>>,
}

impl Partition {
    /// Ties the joints of each group and all joints between them, so that each cluster has one
    /// parent body.
    pub(super) fn new(skeleton: &Skeleton, ties: &[Vec<usize>]) -> Partition {
        let n = skeleton.moving.len();
        let mut leader = (0..n).collect::<Vec<_>>();
        for tie in ties {
            tie.windows(2).for_each(|pair| join(&mut leader, pair[0], pair[1]));
        }
        // a cluster takes in the joints between its members and the body that carries them all
        loop {
            let mut changed = false;
            for c in 0..n {
                let members = (0..n).filter(|m| find(&leader, *m) == c).collect::<Vec<_>>();
                let parent_joint = common_parent(skeleton, &members);
                for &m in &members {
                    for between in skeleton
                        .chain(skeleton.parent[m])
                        .into_iter()
                        .take_while(|x| Some(*x) != parent_joint)
                    {
                        if find(&leader, between) != find(&leader, m) {
                            join(&mut leader, between, m);
                            changed = true;
                        }
                    }
                }
            }
            if !changed {
                break;
            }
        }
        let leaders = (0..n).filter(|m| find(&leader, *m) == *m).collect::<Vec<_>>();
        let groups = leaders
            .iter()
            .map(|c| (0..n).filter(|m| find(&leader, *m) == *c).collect::<Vec<_>>())
            .collect::<Vec<_>>();
        let parent_joint =
            groups.iter().map(|members| common_parent(skeleton, members)).collect::<Vec<_>>();

        // depth-first over clusters
        let mut partition = Partition { members: Vec::new(), parent: Vec::new() };
        let children = |of: Option<&Vec<usize>>| {
            let is_child = |g: &usize| match parent_joint[*g] {
                Some(m) => of.is_some_and(|group| group.contains(&m)),
                None => of.is_none(),
            };
            (0..groups.len()).filter(is_child).rev().collect::<Vec<_>>()
        };
        let mut stack = children(None);
        while let Some(g) = stack.pop() {
            partition.members.push(parents_first(skeleton, &groups[g]));
            partition.parent.push(parent_joint[g]);
            stack.extend(children(Some(&groups[g])));
        }
        partition
    }
}

fn find(leader: &[usize], mut m: usize) -> usize {
    while leader[m] != m {
        m = leader[m];
    }
    m
}

fn join(leader: &mut [usize], a: usize, b: usize) {
    let a = find(leader, a);
    let b = find(leader, b);
    leader[a.max(b)] = a.min(b);
}

/// The moving joint that carries the parents of all members.
fn common_parent(skeleton: &Skeleton, members: &[usize]) -> Option<usize> {
    let mut common: Option<Vec<usize>> = None;
    for &m in members {
        let chain = skeleton.chain(skeleton.parent[m]);
        common = Some(match common {
            None => chain,
            Some(before) => before.into_iter().filter(|x| chain.contains(x)).collect(),
        });
    }
    common.and_then(|chain| chain.first().copied())
}

/// Members sorted by depth, then by their order in the description.
fn parents_first(skeleton: &Skeleton, members: &[usize]) -> Vec<usize> {
    let mut sorted = members.to_vec();
    sorted.sort_by_key(|m| (skeleton.chain(Some(*m)).len(), *m));
    // a depth-first order keeps the legs together
    let mut ordered: Vec<usize> = Vec::with_capacity(sorted.len());
    let mut stack: Vec<usize> = sorted
        .iter()
        .rev()
        .copied()
        .filter(|m| skeleton.parent[*m].is_none_or(|p| !members.contains(&p)))
        .collect();
    while let Some(m) = stack.pop() {
        ordered.push(m);
        stack.extend(sorted.iter().rev().copied().filter(|x| skeleton.parent[*x] == Some(m)));
    }
    ordered
}
