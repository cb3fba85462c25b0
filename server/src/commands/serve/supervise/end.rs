//! Why a supervisor ends, and what it leaves for clients then.

use std::io;
use std::time::{SystemTime, UNIX_EPOCH};

use sarrus_proto::{Domain, ServerName, supervision};

/// Why the supervisor ends.
pub(super) enum End {
    /// A signal.
    Ordered,
    /// The server cannot be kept alive.
    GivenUp {
        reason: String,
        code: u8,
        /// Whether clients are to learn the reason; not where another server has the name.
        is_public: bool,
    },
}

pub(super) fn given_up(reason: String, code: u8) -> End {
    End::GivenUp { reason, code, is_public: true }
}

pub(super) fn too_often(how: &str) -> End {
    given_up(
        format!("five times within a minute the server died soon after its start; the last {how}"),
        2,
    )
}

/// What to say where the files of the robot are no longer those that were announced.
pub(super) fn changed(announced: Option<u64>, loaded: u64) -> Option<String> {
    let announced = announced.filter(|announced| *announced != loaded)?;
    Some(format!(
        "the robot's files have changed (fingerprint {loaded:016x}, announced was \
         {announced:016x}); start the supervisor again to serve what they are now"
    ))
}

/// For clients, which then need not guess.
pub(super) fn leave_reason(name: &str, reason: &str) -> io::Result<()> {
    let name = ServerName::new(name).map_err(io::Error::other)?;
    let domain = Domain::of_user().map_err(io::Error::other)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    supervision::give_up(domain.root(), &name, reason, now)
}
