//! Attacks on a running server, each for a given time.
//!
//! ```sh
//! cargo build --release -p sarrus-server -p sarrus-torture
//! target/release/torture kill-clients --seconds 600 --seed 7
//! target/release/torture all --seconds 60
//! ```
//!
//! An attack starts its own servers in its own folder, prints its counts and ends with one line
//! that begins with PASS, FAIL or `not run`.
//!
//! The library holds the parts that the server's process tests share with the attacks: a client
//! made of single protocol steps ([`raw`]), the files and the state of processes ([`process`]) and
//! the one time limit ([`patience`]).

mod attacks;
mod honest;
mod oracle;
pub mod patience;
pub mod process;
pub mod raw;
mod report;
mod roles;
mod sandbox;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::attacks::Attack;
use crate::report::Verdict;
use crate::roles::Role;

/// Attacks on a running server of sarrus.
///
/// Ends with 0 when every attack was withstood or could not be run here, with 1 when one was not,
/// with 2 when nothing could be started.
#[derive(Parser)]
#[command(name = "torture")]
struct Arguments {
    #[command(flatten)]
    settings: Settings,
    #[command(subcommand)]
    command: Command,
}

/// Settings common to all attacks.
#[derive(Args, Clone)]
pub(crate) struct Settings {
    /// How long an attack goes on.
    #[arg(long, global = true, default_value_t = 10.0)]
    pub(crate) seconds: f64,
    /// Seed of everything random.
    #[arg(long, global = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// The program `sarrus`; without it, the one beside this program.
    #[arg(long, global = true, value_name = "PATH")]
    pub(crate) sarrus: Option<PathBuf>,
    /// The bundled robot that is served.
    #[arg(long, global = true)]
    pub(crate) robot: Option<String>,
    /// How the server waits for requests: `busy` or `sleep`.
    #[arg(long, global = true)]
    pub(crate) wait: Option<String>,
    /// Times over their aims are faults; without it they are printed only, for busy machines.
    #[arg(long, global = true)]
    pub(crate) strict: bool,
}

#[derive(Subcommand)]
enum Command {
    #[command(flatten)]
    Attack(Attack),
    /// Every attack, each for the seconds given.
    All,
    /// A process that an attack starts.
    #[command(hide = true, subcommand)]
    Role(Role),
}

/// Runs the program `torture`.
pub fn main() -> ExitCode {
    let Arguments { settings, command } = Arguments::parse();
    let attacks = match command {
        Command::Role(role) => return role.run(&settings),
        Command::Attack(attack) => vec![attack],
        Command::All => Attack::all(),
    };
    let mut code = 0;
    for attack in &attacks {
        let name = attack.name();
        code = code.max(match attack.run(&settings) {
            Ok(Verdict::Done(report)) => report.print(name),
            Ok(Verdict::NotRun(reason)) => {
                println!("not run: {name}: {reason}");
                0
            }
            Err(reason) => {
                println!("FAIL {name}: could not be carried out: {reason}");
                2
            }
        });
    }
    ExitCode::from(code)
}
