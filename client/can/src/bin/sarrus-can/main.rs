//! `sarrus-can`: the CAN bridge as a program, and what a robot's owner needs around it.

mod bus;
mod clock;
mod listen;
mod simulate;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// The CAN bridge of sarrus.
#[derive(Parser)]
#[command(name = "sarrus-can", version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// What is said on a bus, as `candump -L` prints it; nothing is sent.
    Listen(listen::Listen),
    /// Motors without motors: the motors of a configuration on pseudo-terminals or on its buses.
    Simulate(simulate::Simulate),
}

fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Listen(listen) => listen::run(&listen),
        Command::Simulate(simulate) => simulate::run(&simulate),
    }
}
