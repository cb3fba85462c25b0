//! The clusters of a description and the joints along each loop, without a model.

use crate::compile::assemble::Assembly;
use crate::description::{Description, Loop};
use crate::diagnostic::CompileError;

/// The joints of a description in clusters.
pub(crate) struct Structure {
    /// Joints of each cluster, parents first.
    pub(crate) clusters: Vec<Vec<usize>>,
    /// Cluster of each joint; `None` for a fixed one.
    pub(crate) cluster_of: Vec<Option<usize>>,
    /// Moving joint that carries each link; `None`: the world.
    pub(crate) carrier: Vec<Option<usize>>,
    /// Moving joint below each joint towards the root.
    pub(crate) parent: Vec<Option<usize>>,
    /// Loops of each submechanism: the given ones, or the defaults of its type.
    pub(crate) loops: Vec<Vec<Loop>>,
    /// Moving joints between the two ends of each loop.
    pub(crate) paths: Vec<Vec<Vec<usize>>>,
}

impl Structure {
    /// # Errors
    /// Faults of the structure: joints, owners, undefined loops.
    pub(crate) fn of(description: &Description) -> Result<Structure, CompileError> {
        let mut errors = Vec::new();
        let assembly = Assembly::new(description, &mut errors);
        let Some(Assembly { skeleton, loops, members: clusters, .. }) = assembly else {
            return Err(CompileError::of(errors));
        };
        let mut cluster_of = vec![None; description.joints.len()];
        for (c, joints) in clusters.iter().enumerate() {
            joints.iter().for_each(|j| cluster_of[*j] = Some(c));
        }
        let joint = |m: &Option<usize>| m.map(|m| skeleton.moving[m]);
        let carrier: Vec<Option<usize>> = skeleton.carrier.iter().map(joint).collect();
        let parent = description.joints.iter().map(|joint| carrier[joint.parent]).collect();
        let path = |cycle: &Loop| {
            let (a, b) = skeleton.path_between(cycle.predecessor, cycle.successor);
            a.into_iter().chain(b).map(|m| skeleton.moving[m]).collect()
        };
        let paths = loops.iter().map(|loops| loops.iter().map(path).collect()).collect();
        Ok(Structure { clusters, cluster_of, carrier, parent, loops, paths })
    }

    /// True where a loop closes joints of a cluster.
    pub(crate) fn has_loop(&self, c: usize) -> bool {
        let mut joints = self.paths.iter().flatten().flatten();
        joints.any(|j| self.cluster_of[*j] == Some(c))
    }
}
