//! The binary `sarrus`.

mod commands;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// See `sarrus_server::pool`: the answering thread never reaches the system's allocator.
#[global_allocator]
static POOL: sarrus_server::pool::Pool = sarrus_server::pool::Pool;

/// Low-latency kinematics and dynamics of series-parallel hybrid robots.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// See it work: a server process, a controller that asks it, and the truth about every answer.
    Demo(commands::demo::Demo),
    /// Read a robot's files: every fault of them, or what the robot is.
    Check(commands::check::Check),
    /// Answer requests: JSON lines in, JSON lines out.
    Ask(commands::ask::Ask),
    /// Hold a robot and answer requests over shared memory.
    Serve(commands::serve::Serve),
    /// List the bundled robots.
    Robots(commands::robots::Robots),
}

fn main() -> ExitCode {
    // before anything that may need it
    if let Err(missing) = commands::processor::check() {
        eprintln!("sarrus: this processor has no {missing}; sarrus is built for x86-64-v3 (FMA and AVX2, processors from 2015 on)");
        return ExitCode::from(2);
    }
    match Arguments::parse().command {
        Command::Demo(command) => command.run(),
        Command::Check(command) => command.run(),
        Command::Ask(command) => command.run(),
        Command::Serve(command) => command.run(),
        Command::Robots(command) => command.run(),
    }
}
