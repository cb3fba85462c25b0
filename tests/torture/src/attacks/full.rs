//! The shared memory is full, nearly full, or filled while clients attach.
//!
//! In a mount namespace of its own, where a small file system takes the place of the machine's
//! shared memory.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;
use fastrand::Rng;
use rustix::fs::statvfs;
use sarrus_client::Transport;

use crate::Settings;
use crate::honest::{Askers, TRANSPORTS};
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::process::{Process, SHARED_MEMORY};
use crate::report::{Clock, Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{Sandbox, program, words};

/// Free shared memory while newcomers try `[kB]`.
const LEFT: [u64; 8] = [0, 4, 16, 32, 64, 256, 1024, 4096];
/// SIGBUS.
const BUS: i32 = 7;
/// The size of the shared memory.
const SIZE: &str = "32m";

/// The process in the namespace.
#[derive(Args)]
pub(crate) struct Filler {
    /// For all roles; not used.
    #[arg(long)]
    root: Option<PathBuf>,
}

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    let script = format!(
        "mount -t tmpfs -o size={SIZE},mode=1777 tmpfs {SHARED_MEMORY} || exit 77; exec \"$0\" \"$@\""
    );
    let user: &[&str] = match rustix::process::geteuid().is_root() {
        true => &[],
        false => &["--user", "--map-root-user"],
    };
    let space = |rest: &[&str]| {
        let mut command = Command::new("unshare");
        command.args(user).args(["--mount", "--propagation", "private", "sh", "-c"]).args(rest);
        command
    };
    // a look whether it goes at all
    let look = script.replace("exec \"$0\" \"$@\"", "exit 0");
    match space(&[&look]).stderr(Stdio::null()).status() {
        Ok(status) if status.success() => {}
        Ok(_) => return Ok(Verdict::NotRun("a mount namespace is refused here".to_owned())),
        Err(error) => return Ok(Verdict::NotRun(format!("unshare: {error}"))),
    }
    let mut command = space(&[&script]);
    command.arg(std::env::current_exe().map_err(words)?).args(["role", "filler", "--sarrus"]);
    command.arg(program(settings)?);
    command.args(["--seconds", &settings.seconds.to_string()]);
    command.args(["--seed", &settings.seed.to_string()]);
    if let Some(robot) = &settings.robot {
        command.args(["--robot", robot]);
    }
    let output = command.stdout(Stdio::piped()).spawn().map_err(words)?;
    let output = output.wait_with_output().map_err(words)?;
    let mut report = Report::new(settings);
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        match line.strip_prefix("full: ") {
            Some(line) => match line.strip_prefix("fault: ") {
                Some(fault) => report.fault(fault),
                None => report.count(line),
            },
            None => {
                if let Some(fault) = line.strip_prefix("FAIL full: ") {
                    report.fault(fault);
                }
            }
        }
    }
    report.require(output.status.code().is_some_and(|code| code < 2), || {
        format!("the process in the namespace ended with {}", output.status)
    });
    Ok(Verdict::Done(report))
}

impl Filler {
    pub(crate) fn run(self, settings: &Settings) -> ExitCode {
        match attack(settings) {
            Ok(report) => ExitCode::from(report.print("full")),
            Err(error) => {
                println!("FAIL full: {error}");
                ExitCode::from(2)
            }
        }
    }
}

/// The outcomes of newcomers.
#[derive(Default)]
struct Newcomers {
    served: u64,
    refused: u64,
    /// Ended by the kernel while they opened a service: the transport touches its new files before
    /// their memory can be reserved. A limit that SECURITY.md names.
    ended: u64,
}

fn attack(settings: &Settings) -> Result<Report, String> {
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("rh5v2_upper_body");
    let oracle = Arc::new(Oracle::new(robot, settings.seed, 256)?);
    let mut random = Rng::with_seed(settings.seed);
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &["--lanes", "64"])?;
    let timeout = LIMIT;
    let askers = Askers::start(sandbox.domain(), &oracle, 1, timeout, settings.seed)?;

    // nearly full
    let start = Instant::now();
    let mut round = 0;
    while round == 0 || start.elapsed().as_secs_f64() < settings.seconds / 2.0 {
        for left in LEFT {
            let filler = Filling::down_to(left << 10)?;
            let mut newcomers = Newcomers::default();
            for transport in TRANSPORTS {
                try_newcomer(&sandbox, robot, transport, &mut newcomers, &mut report)?;
            }
            report.require(newcomers.ended == 0, || format!("SIGBUS at {left} kB left"));
            drop(filler);
            if round == 0 {
                let Newcomers { served, refused, .. } = newcomers;
                report.count(format!("{left} kB left: {served} served, {refused} refused"));
            }
            if let Some(status) = server.ended() {
                report.fault(format!("the server ended with {status} at {left} kB left"));
                return Ok(report);
            }
        }
        round += 1;
    }
    report.count(format!("{round} rounds of {} sizes", LEFT.len()));

    // filled and emptied while clients attach
    let stop = Arc::new(AtomicBool::new(false));
    let stopping = stop.clone();
    let seed = settings.seed;
    let thread = std::thread::spawn(move || {
        let mut random = Rng::with_seed(seed);
        let mut fillings = 0_u64;
        while !stopping.load(Relaxed) {
            let filling = Filling::down_to(random.u64(..64) << 10);
            fillings += 1;
            std::thread::sleep(Duration::from_micros(random.u64(..6000)));
            drop(filling);
            std::thread::sleep(Duration::from_micros(random.u64(..6000)));
        }
        fillings
    });
    let mut newcomers = Newcomers::default();
    let mut clock = Clock::new("full", settings.seconds / 2.0);
    while clock.runs(|| format!("{} newcomers served", newcomers.served)) {
        let transport = TRANSPORTS[random.usize(..2)];
        try_newcomer(&sandbox, robot, transport, &mut newcomers, &mut report)?;
        if let Some(status) = server.ended() {
            report.fault(format!("the server ended with {status} while memory was filled"));
            break;
        }
    }
    stop.store(true, Relaxed);
    let fillings = thread.join().map_err(|_| "the filling thread ended")?;
    report.count(format!(
        "{fillings} fillings while clients attach: {} served, {} refused, {} ended by SIGBUS (a \
         limit that is documented)",
        newcomers.served, newcomers.refused, newcomers.ended
    ));
    askers.finish().report(&mut report, "clients from before", false);
    if server.ended().is_none() {
        server.stop()?;
    }
    Ok(report)
}

/// A client that attaches now: its answers are right, or its error names the missing memory.
fn try_newcomer(
    sandbox: &Sandbox,
    robot: &str,
    transport: Transport,
    newcomers: &mut Newcomers,
    report: &mut Report,
) -> Result<(), String> {
    let flags = ["--robot", robot, "--once"].map(str::to_owned);
    let flags = flags.into_iter().chain(transport_flags(transport));
    let mut command = sandbox.role("asker", flags)?;
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut client = Process(command.spawn().map_err(words)?);
    let mut line = String::new();
    if let Some(out) = client.0.stdout.take() {
        BufReader::new(out).read_line(&mut line).map_err(words)?;
    }
    drop(client.0.stdin.take());
    let status = client.0.wait().map_err(words)?;
    match line.trim() {
        "ok" => newcomers.served += 1,
        text if text.starts_with("error ") && text.contains(SHARED_MEMORY) => {
            newcomers.refused += 1;
        }
        "" if transport == Transport::Service && status.signal() == Some(BUS) => {
            newcomers.ended += 1;
        }
        text => report.fault(format!(
            "a newcomer ({transport:?}) says {text:?}, signal {:?}",
            status.signal()
        )),
    }
    Ok(())
}

/// A file that leaves so much of the shared memory; gone when dropped.
struct Filling(PathBuf);

impl Filling {
    fn down_to(left: u64) -> Result<Filling, String> {
        let path = PathBuf::from(SHARED_MEMORY).join("filling");
        let mut file = File::create(&path).map_err(words)?;
        let filling = Filling(path);
        let block = [1_u8; 4096];
        loop {
            let found = statvfs(SHARED_MEMORY).map_err(words)?;
            let free = found.f_bavail.saturating_mul(found.f_frsize);
            let blocks = free.saturating_sub(left) / block.len() as u64;
            if blocks == 0 {
                return Ok(filling);
            }
            for _ in 0..blocks {
                // others take some as well
                if file.write_all(&block).is_err() {
                    return Ok(filling);
                }
            }
        }
    }
}

impl Drop for Filling {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
