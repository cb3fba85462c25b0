//! The processes that attacks start: this program again, with a role.

mod asker;
mod flooder;
mod liar;
mod scribbler;
mod victim;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand, ValueEnum};
use sarrus_client::{Domain, Transport};

use crate::Settings;
use crate::attacks::{full, uid};
use crate::sandbox::words;

pub(crate) use victim::Stage;

/// The role of a process.
#[derive(Subcommand)]
pub(crate) enum Role {
    /// Attaches and is killed on the way.
    Victim(victim::Victim),
    /// Asks, compares and prints its counts.
    Asker(asker::Asker),
    /// Writes random bytes into shared memory.
    Scribbler(scribbler::Scribbler),
    /// Sends calls and garbage as fast as it can.
    Flooder(flooder::Flooder),
    /// Lies in batches, or floods with them.
    Liar(liar::Liar),
    /// Fills the shared memory of a namespace of its own.
    Filler(full::Filler),
    /// Another user who looks for a way in.
    Intruder(uid::Intruder),
}

/// Flags of most roles.
#[derive(Args)]
pub(crate) struct Target {
    /// Root of the domain.
    #[arg(long)]
    pub(crate) root: PathBuf,
    #[arg(long, default_value = "lane")]
    pub(crate) transport: TransportFlag,
}

#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum TransportFlag {
    Lane,
    Service,
}

impl Target {
    pub(crate) fn domain(&self) -> Result<Domain, String> {
        Domain::at(&self.root).map_err(words)
    }

    pub(crate) fn transport(&self) -> Transport {
        match self.transport {
            TransportFlag::Lane => Transport::Lane,
            TransportFlag::Service => Transport::Service,
        }
    }
}

/// A transport as a flag of a role.
pub(crate) fn transport_flags(transport: Transport) -> [String; 2] {
    let name = match transport {
        Transport::Lane => "lane",
        Transport::Service => "service",
    };
    ["--transport".to_owned(), name.to_owned()]
}

impl Role {
    pub(crate) fn run(self, settings: &Settings) -> ExitCode {
        let outcome = match self {
            Role::Victim(role) => role.run(),
            Role::Asker(role) => role.run(settings),
            Role::Scribbler(role) => role.run(settings),
            Role::Flooder(role) => role.run(settings),
            Role::Liar(role) => role.run(settings),
            Role::Intruder(role) => role.run(),
            Role::Filler(role) => return role.run(settings),
        };
        match outcome {
            Ok(()) => ExitCode::SUCCESS,
            Err(reason) => {
                println!("error {reason}");
                ExitCode::from(1)
            }
        }
    }
}
