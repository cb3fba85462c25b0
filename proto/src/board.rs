//! Boards: the lanes, made by the server and claimed by its clients, and the status that anybody
//! may read.

use iceoryx2::node::Node;
use iceoryx2::port::reader::EntryHandle;
use iceoryx2::port::writer::{EntryHandleMut, Writer, WriterCreateError};
use iceoryx2::prelude::{CallbackProgression, PortFactory, ServiceName, ZeroCopySend};
use iceoryx2::service::builder::blackboard::{BlackboardCreateError, BlackboardOpenError};
use iceoryx2::service::port_factory::blackboard;

use crate::lane::{Inbox, KEY, Outbox, Threadsafe, inbox, outbox};
use crate::message::{Entry, Heartbeat, RequestHead, ResponseHead, Statistics};
use crate::service::ServiceError;
use crate::{LaneId, PROTOCOL_VERSION, ServerName};

type Board = blackboard::PortFactory<Threadsafe, u64>;

/// Processes and threads that can read one status board.
const MAX_OBSERVERS: usize = 128;

/// The classes of lanes: how many numbers an entry has room for.
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

/// The server's side of a lane; made and retired beside the thread that answers.
pub struct ServedLane {
    request: Board,
    /// Sees that the client has been there, also when it left at once.
    claimed: Box<dyn Inbox<RequestHead>>,
}

impl ServedLane {
    /// Makes both boards of a lane and the ends that the answering thread polls and writes.
    pub fn create(
        node: &Node<Threadsafe>,
        name: &ServerName,
        instance: u64,
        lane: LaneId,
        [class_in, class_out]: [usize; 2],
    ) -> Result<
        (ServedLane, Box<dyn Inbox<RequestHead>>, Box<dyn Outbox<ResponseHead>>),
        ServiceError,
    > {
        let [request_name, response_name] = name.lane(instance, lane)?;
        let no_class = |class: usize| {
            move || ServiceError::Memory {
                service: name.as_str().to_owned(),
                reason: format!("no class of {class} numbers"),
            }
        };
        let request = by_class!(class_in, RequestHead, create_board(node, &request_name))
            .ok_or_else(no_class(class_in))??;
        let response = by_class!(class_out, ResponseHead, create_board(node, &response_name))
            .ok_or_else(no_class(class_out))??;

        let reader = request
            .reader_builder()
            .create()
            .map_err(|error| ServiceError::memory(&request_name, &error))?;
        let claimed = by_class!(class_in, RequestHead, inbox(&reader)).flatten();
        let inbox = by_class!(class_in, RequestHead, inbox(&reader)).flatten();
        let writer = response
            .writer_builder()
            .create()
            .map_err(|error| ServiceError::memory(&response_name, &error))?;
        let outbox = by_class!(class_out, ResponseHead, outbox(writer)).flatten();
        let inbox =
            inbox.ok_or_else(|| ServiceError::Locked { service: request_name.to_string() })?;
        let claimed =
            claimed.ok_or_else(|| ServiceError::Locked { service: request_name.to_string() })?;
        let mut outbox =
            outbox.ok_or_else(|| ServiceError::Locked { service: response_name.to_string() })?;
        map(outbox.as_mut());
        Ok((ServedLane { request, claimed }, inbox, outbox))
    }

    /// True once a client has claimed the lane, whether it is still there or not.
    pub fn was_claimed(&self) -> bool {
        self.claimed.has_news()
    }

    /// True while a client holds the request board's write port.
    pub fn is_claimed(&self) -> bool {
        // listed, not counted: the count keeps writers that died
        let mut claimed = false;
        self.request.dynamic_config().list_writers(|_| {
            claimed = true;
            CallbackProgression::Stop
        });
        claimed
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
        node: &Node<Threadsafe>,
        name: &ServerName,
        instance: u64,
        lane: LaneId,
        [class_in, class_out]: [usize; 2],
    ) -> Result<ClaimedLane, ServiceError> {
        let [request_name, response_name] = name.lane(instance, lane)?;
        let (request, response) =
            (open_board(node, &request_name)?, open_board(node, &response_name)?);
        let reader = response
            .reader_builder()
            .create()
            .map_err(|error| ServiceError::memory(&response_name, &error))?;
        let inbox = by_class!(class_out, ResponseHead, inbox(&reader)).flatten();
        let inbox = inbox.ok_or_else(|| ServiceError::OtherVersion {
            service: response_name.to_string(),
            version: PROTOCOL_VERSION,
        })?;
        let writer = request.writer_builder().create().map_err(|error| match error {
            WriterCreateError::ExceedsMaxSupportedWriters => {
                ServiceError::Full { service: request_name.to_string(), limit: 1 }
            }
            other => ServiceError::memory(&request_name, &other),
        })?;
        let outbox = by_class!(class_in, RequestHead, outbox(writer)).flatten();
        let mut outbox =
            outbox.ok_or_else(|| ServiceError::Locked { service: request_name.to_string() })?;
        // its heads have sequence 0: no request, a sign that the lane is claimed
        map(outbox.as_mut());
        Ok(ClaimedLane { outbox, inbox })
    }
}

/// Writes both cells of an entry, so that their memory is there before anybody waits for it.
fn map<H: Default>(outbox: &mut dyn Outbox<H>) {
    for _ in 0..2 {
        outbox.numbers().fill(0.0);
        outbox.publish(H::default());
    }
}

fn create_board<H: Copy + Default + 'static, const N: usize>(
    node: &Node<Threadsafe>,
    service: &ServiceName,
) -> Result<Board, ServiceError>
where
    Entry<H, N>: ZeroCopySend,
{
    let zero = Entry { head: H::default(), numbers: [0.0; N] };
    let builder = node
        .service_builder(service)
        .blackboard_creator::<u64>()
        .max_readers(1)
        .max_nodes(4)
        .add::<Entry<H, N>>(KEY, zero);
    builder.create().map_err(|error| board_not_made(service, error))
}

fn board_not_made(service: &ServiceName, error: BlackboardCreateError) -> ServiceError {
    match error {
        BlackboardCreateError::AlreadyExists => {
            ServiceError::Taken { service: service.to_string() }
        }
        other => ServiceError::memory(service, &other),
    }
}

fn open_board(node: &Node<Threadsafe>, service: &ServiceName) -> Result<Board, ServiceError> {
    node.service_builder(service).blackboard_opener::<u64>().open().map_err(|error| match error {
        BlackboardOpenError::DoesNotExist | BlackboardOpenError::IsMarkedForDestruction => {
            ServiceError::Absent { service: service.to_string() }
        }
        BlackboardOpenError::ExceedsMaxNumberOfNodes => {
            ServiceError::Full { service: service.to_string(), limit: MAX_OBSERVERS }
        }
        other => ServiceError::memory(service, &other),
    })
}

const STATISTICS: u64 = 0;
const HEARTBEAT: u64 = 1;

/// Where the answering thread writes its heartbeat.
pub type HeartbeatEntry = EntryHandleMut<Threadsafe, u64, Heartbeat>;
/// The writing port of a status board.
pub type StatusPort = Writer<Threadsafe, u64>;
/// Where statistics are written.
pub type StatisticsEntry = EntryHandleMut<Threadsafe, u64, Statistics>;

/// The server's side of the status board: two entries, one for each thread that writes.
pub struct StatusBoard {
    /// Written by the thread that answers.
    pub heartbeat: HeartbeatEntry,
    /// Written beside it.
    pub statistics: StatisticsEntry,
    /// Goes last: entries whose port is gone are never recognised as a dead server's.
    pub port: StatusPort,
}

impl StatusBoard {
    /// Makes the status board of a run of the server.
    pub fn create(
        node: &Node<Threadsafe>,
        name: &ServerName,
        instance: u64,
    ) -> Result<StatusBoard, ServiceError> {
        let service = name.status(instance)?;
        let builder = node
            .service_builder(&service)
            .blackboard_creator::<u64>()
            .max_readers(MAX_OBSERVERS)
            .max_nodes(MAX_OBSERVERS);
        let builder =
            builder.add(STATISTICS, Statistics::default()).add(HEARTBEAT, Heartbeat::default());
        let board = builder.create().map_err(|error| board_not_made(&service, error))?;
        let writer = board
            .writer_builder()
            .create()
            .map_err(|error| ServiceError::memory(&service, &error))?;
        let heartbeat =
            writer.entry(&HEARTBEAT).map_err(|error| ServiceError::memory(&service, &error))?;
        let statistics =
            writer.entry(&STATISTICS).map_err(|error| ServiceError::memory(&service, &error))?;
        Ok(StatusBoard { heartbeat, statistics, port: writer })
    }
}

/// The reading side of a status board; reading takes nothing from the server.
pub struct StatusReader {
    heartbeat: EntryHandle<Threadsafe, u64, Heartbeat>,
    statistics: EntryHandle<Threadsafe, u64, Statistics>,
}

impl StatusReader {
    /// Opens the status board of a run of the server.
    pub fn open(
        node: &Node<Threadsafe>,
        name: &ServerName,
        instance: u64,
    ) -> Result<StatusReader, ServiceError> {
        let service = name.status(instance)?;
        let board = open_board(node, &service)?;
        let reader = board
            .reader_builder()
            .create()
            .map_err(|error| ServiceError::memory(&service, &error))?;
        let other_version = |_| ServiceError::OtherVersion {
            service: service.to_string(),
            version: PROTOCOL_VERSION,
        };
        let heartbeat = reader.entry(&HEARTBEAT).map_err(other_version)?;
        let statistics = reader.entry(&STATISTICS).map_err(other_version)?;
        Ok(StatusReader { heartbeat, statistics })
    }

    /// The last heartbeat.
    pub fn heartbeat(&self) -> Heartbeat {
        *self.heartbeat.get()
    }

    /// The last statistics.
    pub fn statistics(&self) -> Statistics {
        *self.statistics.get()
    }
}
