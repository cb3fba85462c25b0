//! Blocks in closed form, one after the other: the form of a block takes the joints that blocks
//! before it found for its independents. The rows of the blocks give the levels below the position.

use crate::closure::constraint::rows::place;
use crate::closure::numerical::block::Blocks;
use crate::closure::{Form, Level, Local, Validity};
use crate::mechanism::{Body, Cluster, turn};
use crate::scalar::{Real, constants};
use crate::spatial::Pose;

/// The blocks of a cluster whose joints have one degree of freedom each.
#[derive(Clone, Debug)]
pub(crate) struct Chain<T> {
    /// One for each block.
    pub(crate) parts: Vec<BlockForm<T>>,
    /// Their rows.
    pub(crate) rows: Blocks,
    /// The independent joints that turn, as places of cosine and sine and of the coordinate.
    pub(crate) given: Vec<(usize, usize)>,
}

constants! { Chain:
    keep rows given;
    each parts;
}

/// A block: the joints of its loops or couplings as a cluster of their own.
#[derive(Clone, Debug)]
pub(crate) struct BlockForm<T> {
    pub(crate) form: Form<T>,
    pub(crate) cluster: Cluster<T>,
    pub(crate) bodies: Vec<Body<T>>,
    /// The joints in the whole cluster.
    pub(crate) joints: Vec<usize>,
}

constants! { BlockForm:
    keep joints;
    map form cluster;
    each bodies;
}

impl<T: Real> Chain<T> {
    /// All levels.
    pub(super) fn close(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let &mut Local { cluster, bodies, .. } = local;
        local.scratch.choice = 0;
        turn(&self.given, local.q, local.cos_sin);
        let mut validity = Validity::fine();
        for (b, (block, part)) in self.rows.blocks.iter().zip(&self.parts).enumerate() {
            let of_part = part.close(local);
            block.multiply_gain(b, of_part.gain, &mut local.scratch.gain);
            validity = validity.or(Validity { gain: local.scratch.gain[b], ..of_part });
        }
        if level == Level::Position {
            return validity;
        }
        local.scratch.pose[0] = Pose::identity();
        for j in 0..cluster.n {
            place(cluster, bodies, j, local.q, local.cos_sin, &mut local.scratch.pose);
        }
        let is_regular = self.rows.rates(local, level);
        Validity { singular: validity.singular | !is_regular, ..validity }
    }
}

impl<T: Real> BlockForm<T> {
    /// Coordinates, cosines and sines of its joints.
    fn close(&self, local: &mut Local<'_, T>) -> Validity<T> {
        let [mut q, mut qd] = core::mem::take(&mut local.scratch.of_part);
        let mut cos_sin = core::mem::take(&mut local.scratch.turns_of_part);
        for (own, j) in self.joints.iter().enumerate() {
            q[own] = local.q[*j];
        }
        let mut own = Local {
            cluster: &self.cluster,
            bodies: &self.bodies,
            start: &[],
            from_zero: false,
            is_trial: true,
            tangent: None,
            q: &mut q,
            cos_sin: &mut cos_sin,
            qd: &mut qd,
            G: &mut [],
            g: &mut [],
            scratch: local.scratch,
        };
        let (validity, _) = self.form.close(&mut own, Level::Position);
        for own in &self.cluster.dependent {
            let j = self.joints[*own];
            local.q[j] = q[*own];
            local.cos_sin[j] = cos_sin[*own];
        }
        local.scratch.of_part = [q, qd];
        local.scratch.turns_of_part = cos_sin;
        validity
    }
}
