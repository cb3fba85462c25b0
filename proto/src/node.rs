//! A process's node in a part of shared memory.

use core::fmt::Debug;

use iceoryx2::node::Node as IceoryxNode;

use crate::lane::Threadsafe;

/// A node of this process in a part of shared memory. Its ports are dropped before it.
///
/// The transport is generic. Crates that hold nodes and ports reach it only through this crate's
/// trait objects, so they do not compile it.
#[derive(Debug)]
pub struct Node(Box<dyn Holder>);

/// Its table of functions holds the transport's destructor too.
trait Holder: Debug + Send + Sync {
    fn node(&self) -> &IceoryxNode<Threadsafe>;
}

impl Holder for IceoryxNode<Threadsafe> {
    fn node(&self) -> &IceoryxNode<Threadsafe> {
        self
    }
}

impl Node {
    pub(crate) fn new(node: IceoryxNode<Threadsafe>) -> Node {
        Node(Box::new(node))
    }

    pub(crate) fn inner(&self) -> &IceoryxNode<Threadsafe> {
        self.0.node()
    }
}
