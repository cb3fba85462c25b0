//! The boards of a lane, made by the server and claimed by its client.

use core::fmt::Debug;
use core::sync::atomic::Ordering::Relaxed;

use iceoryx2::port::writer::WriterCreateError;
use iceoryx2::prelude::{ServiceName, ZeroCopySend};
use iceoryx2::service::builder::blackboard::{BlackboardCreateError, BlackboardOpenError};
use iceoryx2::service::port_factory::blackboard;

use crate::lane::{Inbox, KEY, Outbox, Threadsafe, inbox, outbox};
use crate::message::{Entry, RequestHead, ResponseHead};
use crate::service::{ServiceError, link_service};
use crate::{Node, PROTOCOL_VERSION};

type Board = blackboard::PortFactory<Threadsafe, u64>;

/// The classes of lanes: numbers that fit in an entry.
pub const CLASSES: [usize; 11] = [16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384];

/// The smallest class that holds `n` numbers.
pub fn class_of(n: usize) -> Option<usize> {
    CLASSES.into_iter().find(|class| n <= *class)
}

// runs `$function::<head, class>($arguments)` for the class that is known at run time only
macro_rules! by_class {
    ($class:expr, $head:ty, $function:ident($($argument:expr),*)) => {
        match $class {
            16 => Some($function::<$head, 16>($($argument),*)),
            32 => Some($function::<$head, 32>($($argument),*)),
            64 => Some($function::<$head, 64>($($argument),*)),
            128 => Some($function::<$head, 128>($($argument),*)),
            256 => Some($function::<$head, 256>($($argument),*)),
            512 => Some($function::<$head, 512>($($argument),*)),
            1024 => Some($function::<$head, 1024>($($argument),*)),
            2048 => Some($function::<$head, 2048>($($argument),*)),
            4096 => Some($function::<$head, 4096>($($argument),*)),
            8192 => Some($function::<$head, 8192>($($argument),*)),
            16384 => Some($function::<$head, 16384>($($argument),*)),
            _ => None,
        }
    };
}

/// The server's ends of a lane.
pub struct ServedLane {
    /// Where requests appear.
    pub inbox: Box<dyn Inbox<RequestHead>>,
    /// Where answers are written.
    pub outbox: Box<dyn Outbox<ResponseHead>>,
}

impl ServedLane {
    /// Makes both boards of a lane for these classes in and out; made and dropped off the answering
    /// thread.
    pub fn create(
        node: &Node,
        [class_in, class_out]: [usize; 2],
    ) -> Result<ServedLane, ServiceError> {
        let [request_name, response_name] = names()?;
        let no_class = |service: &ServiceName, class: usize| {
            ServiceError::Memory(service.to_string(), format!("no class of {class} numbers"))
        };
        let request = by_class!(class_in, RequestHead, create_board(node, &request_name))
            .ok_or_else(|| no_class(&request_name, class_in))??;
        let response = by_class!(class_out, ResponseHead, create_board(node, &response_name))
            .ok_or_else(|| no_class(&response_name, class_out))??;

        let locked = |service: &ServiceName| ServiceError::Locked(service.to_string());
        let reader = request.reader_builder().create().map_err(in_memory(&request_name))?;
        let inbox = by_class!(class_in, RequestHead, inbox(&reader)).flatten();
        let writer = response.writer_builder().create().map_err(in_memory(&response_name))?;
        let outbox = by_class!(class_out, ResponseHead, outbox(writer)).flatten();
        Ok(ServedLane {
            inbox: inbox.ok_or_else(|| locked(&request_name))?,
            outbox: outbox.ok_or_else(|| locked(&response_name))?,
        })
    }

    /// Writes both cells of the answers, so that their memory is mapped before a client waits; call
    /// it when the memory is reserved.
    pub fn map(&mut self) {
        map(self.outbox.as_mut());
    }
}

/// The client's side of a lane.
pub struct ClaimedLane {
    /// Where requests are written.
    pub outbox: Box<dyn Outbox<RequestHead>>,
    /// Where answers appear.
    pub inbox: Box<dyn Inbox<ResponseHead>>,
}

impl ClaimedLane {
    /// Takes a lane that the server made for this client.
    pub fn claim(
        node: &Node,
        [class_in, class_out]: [usize; 2],
    ) -> Result<ClaimedLane, ServiceError> {
        let [request_name, response_name] = names()?;
        let request = open_board(node, &request_name)?;
        let response = open_board(node, &response_name)?;
        let reader = response.reader_builder().create().map_err(in_memory(&response_name))?;
        let inbox = by_class!(class_out, ResponseHead, inbox(&reader)).flatten();
        let inbox = inbox.ok_or_else(|| {
            ServiceError::OtherVersion(response_name.to_string(), PROTOCOL_VERSION)
        })?;
        let writer = request.writer_builder().create().map_err(|error| match error {
            WriterCreateError::ExceedsMaxSupportedWriters => {
                ServiceError::Full(request_name.to_string(), 1)
            }
            other => ServiceError::memory(&request_name, &other),
        })?;
        let outbox = by_class!(class_in, RequestHead, outbox(writer)).flatten();
        let mut outbox = outbox.ok_or_else(|| ServiceError::Locked(request_name.to_string()))?;
        // sequence 0 in its heads: no request, but a sign that the lane is claimed
        map(outbox.as_mut());
        Ok(ClaimedLane { outbox, inbox })
    }
}

/// The error of a port that cannot be made.
fn in_memory<E: Debug>(service: &ServiceName) -> impl FnOnce(E) -> ServiceError {
    move |error| ServiceError::memory(service, &error)
}

/// The boards of a link's lane.
fn names() -> Result<[ServiceName; 2], ServiceError> {
    Ok([link_service("request")?, link_service("response")?])
}

/// Writes both cells of an entry, so that their memory is mapped before a client waits for it.
fn map<H: Default>(outbox: &mut dyn Outbox<H>) {
    for _ in 0..2 {
        outbox.numbers().iter().for_each(|word| word.store(0, Relaxed));
        outbox.publish(H::default());
    }
}

fn create_board<H: Copy + Default + 'static, const N: usize>(
    node: &Node,
    service: &ServiceName,
) -> Result<Board, ServiceError>
where
    Entry<H, N>: ZeroCopySend,
{
    let zero = Entry { head: H::default(), numbers: [0.0; N] };
    let builder = node
        .inner()
        .service_builder(service)
        .blackboard_creator::<u64>()
        .max_readers(1)
        .max_nodes(2)
        .add::<Entry<H, N>>(KEY, zero);
    builder.create().map_err(|error| board_not_made(service, error))
}

fn board_not_made(service: &ServiceName, error: BlackboardCreateError) -> ServiceError {
    match error {
        BlackboardCreateError::AlreadyExists => ServiceError::Taken(service.to_string()),
        other => ServiceError::memory(service, &other),
    }
}

fn open_board(node: &Node, service: &ServiceName) -> Result<Board, ServiceError> {
    node.inner().service_builder(service).blackboard_opener::<u64>().open().map_err(|error| {
        match error {
            BlackboardOpenError::DoesNotExist | BlackboardOpenError::IsMarkedForDestruction => {
                ServiceError::Absent(service.to_string())
            }
            other => ServiceError::memory(service, &other),
        }
    })
}
