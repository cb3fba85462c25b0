//! The attacks.

mod batches;
mod burst;
mod clear;
mod fair;
mod flood;
pub(crate) mod full;
mod kill_clients;
mod kill_servers;
mod scribble;
mod soak;
mod stop;
pub(crate) mod uid;

use clap::Subcommand;

use crate::Settings;
use crate::report::Verdict;

/// An attack.
#[derive(Subcommand)]
pub(crate) enum Attack {
    /// Clients are killed while they attach and ask.
    KillClients(kill_clients::KillClients),
    /// Servers are killed under their clients, and started again.
    KillServers(kill_servers::KillServers),
    /// Servers and clients are stopped and continued.
    Stop,
    /// Hundreds of clients come at once.
    Burst(burst::Burst),
    /// The shared memory is full, nearly full, or filled while clients attach.
    Full,
    /// Another user looks for a way in.
    Uid,
    /// Clients write random bytes into shared memory.
    Scribble(scribble::Scribble),
    /// Clients send calls and garbage without end.
    Flood,
    /// Clients lie in batches, flood with them, die over them and keep their memory.
    Batches,
    /// The server's folder is removed while it runs.
    Clear,
    /// Clients of the costliest states beside one of 1 kHz.
    Fair(fair::Fair),
    /// Requests of every kind through many lanes and services, every bit compared.
    Soak(soak::Soak),
}

impl Attack {
    /// One of each, with the usual flags.
    pub(crate) fn all() -> Vec<Attack> {
        vec![
            Attack::KillClients(kill_clients::KillClients::default()),
            Attack::KillServers(kill_servers::KillServers::default()),
            Attack::Stop,
            Attack::Burst(burst::Burst::default()),
            Attack::Full,
            Attack::Uid,
            Attack::Scribble(scribble::Scribble::default()),
            Attack::Flood,
            Attack::Batches,
            Attack::Clear,
            Attack::Fair(fair::Fair::default()),
            Attack::Soak(soak::Soak::default()),
        ]
    }

    pub(crate) fn name(&self) -> &'static str {
        match self {
            Attack::KillClients(_) => "kill-clients",
            Attack::KillServers(_) => "kill-servers",
            Attack::Stop => "stop",
            Attack::Burst(_) => "burst",
            Attack::Full => "full",
            Attack::Uid => "uid",
            Attack::Scribble(_) => "scribble",
            Attack::Flood => "flood",
            Attack::Batches => "batches",
            Attack::Clear => "clear",
            Attack::Fair(_) => "fair",
            Attack::Soak(_) => "soak",
        }
    }

    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        match self {
            Attack::KillClients(attack) => attack.run(settings),
            Attack::KillServers(attack) => attack.run(settings),
            Attack::Stop => stop::run(settings),
            Attack::Burst(attack) => attack.run(settings),
            Attack::Full => full::run(settings),
            Attack::Uid => uid::run(settings),
            Attack::Scribble(attack) => attack.run(settings),
            Attack::Flood => flood::run(settings),
            Attack::Batches => batches::run(settings),
            Attack::Clear => clear::run(settings),
            Attack::Fair(attack) => attack.run(settings),
            Attack::Soak(attack) => attack.run(settings),
        }
    }
}
