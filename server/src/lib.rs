//! The program `sarrus`: its flags and commands.

mod commands;

use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, Parser, Subcommand};
use signal_hook::consts::SIGXFSZ;

use commands::output::conclude;

/// Low-latency kinematics and dynamics of series-parallel hybrid robots.
#[derive(Parser)]
#[command(name = "sarrus", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Show a server process and a controller that asks it, with every answer checked.
    ///
    /// Takes about five seconds and leaves one page, which it names: the robot with sliders. Ends
    /// with 0 when every answer is ok and
    /// within 1e-12 of double-double arithmetic.
    Demo(commands::demo::Demo),
    /// Read a robot's files and report every fault, or describe the robot.
    ///
    /// Each fault is one line, FILE:LINE:COLUMN first. Ends with 0 for a valid robot, 1 for faulty
    /// files, 2 for files that cannot be opened and wrong flags.
    Check(commands::check::Check),
    /// Answer requests: JSON lines in, JSON lines out.
    ///
    /// A line such as `{"y": [0.1], "yd": [1], "want": ["q", "tau_u"], "frames": ["hand"],
    /// "wrenches": {"hand": [0,0,0,0,0,-10]}}` gives the state from y, u or q (and their rates yd,
    /// ud, qd, ydd, udd, qdd; zero where they are missing), forces as tau_u, tau_y or tau_q, and
    /// for numerical loops a q_guess and qd_guess. `"joints": ["AL*"]` asks for the rows of some
    /// joints only. `sarrus check` prints the order of each list.
    /// The answer is one line with status, warnings and each wanted field: numbers, lists, lists of
    /// rows, or null where the status forbids numbers.
    ///
    /// Ends with 0 if every line was answered; a failed state is an answer, and so are wrong_size
    /// and singular_closure. Ends with 1 if some line was no valid request (status bad_request,
    /// with the column) or the model is bad, with 2 if it could not start or lost its server.
    Ask(commands::ask::Ask),
    /// Hold a robot and answer requests over shared memory.
    ///
    /// Prints `ready NAME FINGERPRINT` when clients can attach. SIGTERM and SIGINT are a clean
    /// stop, which ends with 0. With `--supervise` a server that dies is started again; one that
    /// dies five times within a minute soon after its start is given up, which ends with 2 (1 for a
    /// bad model).
    Serve(commands::serve::Serve),
    /// Compute a recording of `serve --record` again and compare every bit.
    ///
    /// Prints the number of requests, their time span, missing records, and the first answers that
    /// differ. Ends with 0 when all answers are the same, 1 when some differ or cannot be read, 2
    /// for a file that is no whole recording and wrong flags.
    Replay(commands::replay::Replay),
    /// Write one query on one robot as straight-line code, and build it where there is a compiler.
    ///
    /// NAME.c with one function, NAME.h with its sizes and orders, NAME_test.c with answers that it
    /// must give to the bit; with a C compiler (CC, or cc) a shared object and the test, which is
    /// run. Prints the files, the number of operations and the compiler's name or "not built".
    /// With `--language js` NAME.js and NAME_test.js, which node runs where it is installed.
    /// Ends with 0 when all was written, 1 when the query has no straight-line code, the test
    /// failed or the robot is bad, 2 for wrong flags and files that cannot be written.
    #[cfg(feature = "generate")]
    Generate(commands::generate::Generate),
    /// Check this machine for settings that slow or hinder a server, each with its remedy.
    ///
    /// Prints one line for each finding. Ends with 0 without a finding, 1 with one, 2 for wrong
    /// flags.
    Doctor(commands::doctor::Doctor),
    /// Print the state of a server and its clients: rates, latencies, statuses, heartbeat.
    Top(commands::top::Top),
    /// Remove the files of dead servers and clients; living ones are left alone.
    ///
    /// Prints the removed files. A server that starts or stops does the same.
    Tidy(commands::tidy::Tidy),
    /// List the bundled robots, or write the files of one.
    Robots(commands::robots::Robots),
    /// Convert robots of other formats, MJCF among them, into a URDF and a submechanism file.
    ///
    /// Writes NAME.urdf and NAME.yml, which `check` reads, with the names of bodies and joints, and
    /// prints how far the loops are from closed, and the independent joints. Each part that is not
    /// read is a line FILE:LINE:COLUMN: a note where it has no influence on the dynamics. Ends with
    /// 0 when all was written, 1 for faulty files and parts that cannot be expressed (--lenient: a
    /// warning), 2 for wrong flags and files that cannot be opened or written.
    Import(commands::import::Import),
    /// Write a robot for another program: MJCF, SDF, Pinocchio, Gepetto's tools, or our own files.
    ///
    /// Prints the files, and how far they are from the robot as an engine reads them: MuJoCo for
    /// mjcf, Pinocchio for pinocchio and gepetto, Drake for sdf, each from Python where its wheel
    /// is installed, else "not run". Ends with 0 when all was written, 1 for a bad robot, parts
    /// that the format cannot express (--lenient: a warning) and a difference beyond rounding, 2
    /// for wrong flags and files that cannot be written.
    #[cfg(feature = "report")]
    Export(commands::export::Export),
    /// Print the completions of commands, flags and values for a shell.
    ///
    /// For bash: `sarrus completions bash > ~/.local/share/bash-completion/completions/sarrus`.
    Completions(commands::completions::Completions),
    /// Write the manual: a page of the program and one of each command.
    Man(commands::man::Man),
    /// Measure: error against run time, time integration, stress cases, as a page that
    /// opens offline.
    ///
    /// Writes report.html, report.json and one CSV file for each figure and table. Ends with 0,
    /// with 1 when some stress case failed silently, and with 2 when it could not measure or
    /// write.
    #[cfg(feature = "report")]
    Report(commands::report::Report),
    /// Compare a robot's answers and times with another engine's.
    ///
    /// One line for each method and setting of the engine: the largest difference from the same
    /// model in double-double, the time of a call, ours beside it, and why they differ. Ends with
    /// 1 if a difference exceeds the softness of the engine's setting. An engine that is not built
    /// is not run.
    #[cfg(feature = "report")]
    Compare(commands::compare::Compare),
    /// Write a robot as one page that opens offline, with sliders that move it.
    ///
    /// The page draws the robot, its joint axes, cut points and inertia, and compares u and tau_u
    /// with their limits; sliders set y or u, and the loops follow. Prints the page's path. Ends
    /// with 0, with 1 for a bad robot and one without straight-line code, with 2 for wrong flags
    /// and a page that cannot be written.
    #[cfg(feature = "show")]
    Show(commands::show::Show),
    /// Map force, speed, rotor inertia and reach that the motors have at the joints.
    ///
    /// Without `--joints` each submechanism has a map by itself, over the limits of its independent
    /// joints, with the others at zero or where `--at` puts them. Motors without a limit are named
    /// on stderr, and their numbers are null. Ends with 0, with 1 for a bad robot, with 2 for wrong
    /// flags, more than a million points and a file that cannot be written.
    #[cfg(feature = "show")]
    Capability(commands::capability::Capability),
    /// Estimate masses, inertias and friction from a motion.
    ///
    /// Prints the base parameters with their standard errors, those that the motion does not
    /// excite, and how well each part of the motion is predicted from the others; with `--out` it
    /// writes the URDF with the nearest physical inertias. Ends with 0, with 1 for a bad robot and
    /// a motion that it cannot make, with 2 for wrong flags and tables.
    #[cfg(feature = "identify")]
    Identify(commands::identify::Identify),
    /// Estimate geometry and offsets of encoders from redundant encoders.
    ///
    /// Prints the offsets and the numbers of the geometry (page `guide::parameters`) that the
    /// encoders tell, with their standard errors, and names the others, which keep their values;
    /// with `--out` it writes the robot with its new geometry, closed at zero. Ends with 0, with 1
    /// for a bad robot and a log that it cannot make, with 2 for wrong flags and tables.
    #[cfg(feature = "identify")]
    Calibrate(commands::identify::Identify),
    /// Integrate a robot in time: a table, a page, and estimates of the error.
    ///
    /// From y and yd (or q and qd) under gravity, constant forces, a table of forces, gains and
    /// springs. Writes motion.csv, and motion.html with the robot beside its curves; prints the
    /// status, the run time, the drift of energy and the events on the way. Ends with 0 when the
    /// whole time was simulated, 1 when the robot's files are faulty or the motion ended early (the
    /// status names the reason), 2 for wrong flags and files that cannot be opened.
    #[cfg(feature = "simulate")]
    Simulate(Box<commands::simulate::Simulate>),
    /// Time a path within force, speed and stroke of the actuators.
    ///
    /// The fastest motion from rest to rest along a smooth curve through the rows of PATH, as a
    /// table of t, y, yd, ydd and tau_u. Inverse dynamics looks at it again between the rows, where
    /// it exceeds no limit by more than 0.1 %. Ends with 0, with 1 for a bad robot and for a path
    /// that cannot be driven or held at rest on the way, whose line and actuator are named, with 2
    /// for wrong flags and tables.
    #[cfg(feature = "simulate")]
    Time(commands::time::Time),
}

/// Runs the command of this process's arguments and returns its exit code.
pub fn run() -> ExitCode {
    // before any instruction that needs the baseline
    if let Err(message) = sarrus_client::processor::check_for("sarrus") {
        eprintln!("{message}");
        return ExitCode::from(2);
    }
    // a write beyond the limit of a file's size fails and ends nothing
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    match Arguments::parse().command {
        Command::Demo(command) => conclude("demo", command.run()),
        Command::Check(command) => conclude("check", command.run()),
        Command::Ask(command) => conclude("ask", command.run()),
        Command::Serve(command) => conclude("serve", command.run()),
        Command::Replay(command) => conclude("replay", command.run()),
        #[cfg(feature = "generate")]
        Command::Generate(command) => conclude("generate", command.run()),
        Command::Doctor(command) => conclude("doctor", command.run()),
        Command::Top(command) => conclude("top", command.run()),
        Command::Tidy(command) => conclude("tidy", command.run()),
        Command::Robots(command) => conclude("robots", command.run()),
        Command::Import(command) => conclude("import", command.run()),
        #[cfg(feature = "report")]
        Command::Export(command) => conclude("export", command.run()),
        Command::Completions(command) => conclude("completions", command.run(Arguments::command())),
        Command::Man(command) => conclude("man", command.run(Arguments::command())),
        #[cfg(feature = "report")]
        Command::Report(command) => conclude("report", command.run()),
        #[cfg(feature = "report")]
        Command::Compare(command) => conclude("compare", command.run()),
        #[cfg(feature = "show")]
        Command::Show(command) => conclude("show", command.run()),
        #[cfg(feature = "show")]
        Command::Capability(command) => conclude("capability", command.run()),
        #[cfg(feature = "identify")]
        Command::Identify(command) => conclude("identify", command.run()),
        #[cfg(feature = "identify")]
        Command::Calibrate(command) => conclude("calibrate", command.calibrate()),
        #[cfg(feature = "simulate")]
        Command::Simulate(command) => conclude("simulate", command.run()),
        #[cfg(feature = "simulate")]
        Command::Time(command) => conclude("time", command.run()),
    }
}
