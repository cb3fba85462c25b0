//! `sarrus-can`: the CAN bridge as a program, with tools for operators.

#![forbid(unsafe_code)]

mod check;
mod commission;
mod doctor;
mod listen;
mod operate;
mod replay;
mod run;
mod simulate;
mod top;

use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use sarrus_can_core::config::{Configuration, ConfigurationError};
use sarrus_client::actuators::Operation;

/// The CAN bridge of sarrus.
#[derive(Parser)]
#[command(name = "sarrus-can", version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Check a configuration: print every fault, or its motors, the loads of its buses and the
    /// frames of a command of zeros.
    ///
    /// Each fault is one line, FILE:LINE:COLUMN first. Ends with 0 for a valid configuration, 1 for
    /// a faulty one, 2 for a file that cannot be opened and wrong flags.
    Check(check::Check),
    /// Find obstacles in this computer, its buses and a configuration, with their remedies.
    ///
    /// One line a finding: bit rates, queues and states of the buses, real-time rights, locked
    /// memory, watchdogs, and the warnings of `check`. Ends with 0 for none, 1 for a finding or a
    /// faulty configuration, 2 for a file that cannot be opened and wrong flags.
    Doctor(doctor::Doctor),
    /// Run the bridge between controllers and motors.
    ///
    /// Prints `ready NAME FINGERPRINT` when controllers can connect. The motors have no power until
    /// an operator arms, and lose it when commands stop, when a motor fails, and at every end of
    /// this program. SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP and the other signals that would end
    /// or stop it are a clean end, with 0.
    Run(run::Run),
    /// Give the motors power, as soon as everything is in order and a controller commands.
    Arm(operate::Operate),
    /// Take the motors' power away.
    Disarm(operate::Operate),
    /// Clear faults, once an operator has found their cause.
    Reset(operate::Operate),
    /// Move actuators that are outside their limits back inside, slowly and without a controller;
    /// the motors have no power before and after it.
    Return(operate::Operate),
    /// Believe the positions of motors that are elsewhere than where they were last seen, once an
    /// operator has looked.
    Confirm(operate::Operate),
    /// Move each motor a little, compare it with the robot's model, and write the record without
    /// which a robot is not armed.
    ///
    /// Prints a table and the record's path. Ends with 0 where all is as in the model, 1 for a
    /// finding or a faulty configuration, 2 for wrong flags and failures at start-up.
    Commission(commission::Commission),
    /// Watch a running bridge: states, times, counts.
    Top(top::Top),
    /// Run the rules on a recorded input, without buses.
    Replay(replay::Replay),
    /// Decode a recorded input: position, velocity and effort of each actuator, a row each cycle.
    Log(replay::Log),
    /// Print the frames on a bus, as `candump -L` does; nothing is sent.
    Listen(listen::Listen),
    /// Simulate the motors of a configuration, on pseudo-terminals or on its buses.
    Simulate(simulate::Simulate),
}

fn main() -> ExitCode {
    // before anything that may need it
    if let Err(message) = sarrus_client::processor::check_for("sarrus-can") {
        eprintln!("{message}");
        return ExitCode::from(2);
    }
    let code = match Arguments::parse().command {
        Command::Check(check) => Ok(check.run()),
        Command::Doctor(doctor) => doctor.run(),
        Command::Run(run) => run.run(),
        Command::Arm(operate) => Ok(operate.run(Operation::Arm)),
        Command::Disarm(operate) => Ok(operate.run(Operation::Disarm)),
        Command::Reset(operate) => Ok(operate.run(Operation::Reset)),
        Command::Return(operate) => Ok(operate.run(Operation::Return)),
        Command::Confirm(operate) => Ok(operate.run(Operation::Confirm)),
        Command::Commission(commission) => commission.run(),
        Command::Top(top) => Ok(top.run()),
        Command::Replay(replay) => replay.run(),
        Command::Log(log) => log.run(),
        Command::Listen(listen) => Ok(listen::run(&listen)),
        Command::Simulate(simulate) => simulate::run(&simulate),
    };
    code.unwrap_or_else(|code| code)
}

/// The code of a command that fails at start-up only: 0, or 2 with the reason.
fn ended<E: Display>(command: &str, result: Result<(), E>) -> ExitCode {
    result.map_or_else(|error| failed(command, error), |()| ExitCode::SUCCESS)
}

/// Prints why a command failed; its code.
fn failed(command: &str, error: impl Display) -> ExitCode {
    eprintln!("sarrus-can {command}: {error}");
    ExitCode::from(2)
}

/// Writes a line to stdout and flushes it; an error where stdout is closed.
fn tell(line: impl Display) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush())
}

/// A configuration, or the end: every fault of it is reported, and the code is 1 for faults and 2
/// for a file that cannot be opened.
fn configuration(path: &Path) -> Result<Configuration, ExitCode> {
    Configuration::load(path).map_err(|error| {
        eprintln!("{error}");
        ExitCode::from(if matches!(error, ConfigurationError::Open(..)) { 2 } else { 1 })
    })
}
