//! The binary `sarrus`.

use std::process::ExitCode;

/// The answering thread never reaches the system's allocator.
#[global_allocator]
static POOL: sarrus_serve::pool::Pool = sarrus_serve::pool::Pool;

fn main() -> ExitCode {
    sarrus_server::run()
}
