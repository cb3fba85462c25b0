//! Another user looks for a way in: connects, opens, takes names that the next client needs.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use rustix::process::Signal;
use sarrus_client::Transport;
use sarrus_proto::ServerName;
use sarrus_proto::socket::ControlSocket;

use crate::Settings;
use crate::honest::TRANSPORTS;
use crate::process::{Process, SHARED_MEMORY, send_signal, shared_files};
use crate::report::{Clock, Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{NAME, Sandbox, words};

/// The user that serves, and the one that looks for a way in.
const USERS: [u32; 2] = [65533, 65534];
/// How the transport ends the name of a file that each node opens first.
const COUNTER: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
/// Names of so many clients to come are taken.
const AHEAD: u64 = 64;

/// The process of the other user.
#[derive(Args)]
pub(crate) struct Intruder {
    #[arg(long)]
    root: PathBuf,
    /// How names of the domain begin.
    #[arg(long)]
    prefix: String,
    /// A file of the user that serves.
    #[arg(long)]
    bait: PathBuf,
}

pub(crate) fn run(settings: &Settings) -> Result<Verdict, String> {
    if !rustix::process::geteuid().is_root() {
        return Ok(Verdict::NotRun("only root can be two users".to_owned()));
    }
    let mut report = Report::new(settings);
    let robot = settings.robot.as_deref().unwrap_or("lambda");
    // programs where both users can read them
    let sandbox = Sandbox::new(settings)?;
    let root = sandbox.domain().root().to_owned();
    let folder = root.with_extension("programs");
    fs::create_dir(&folder).map_err(words)?;
    let outcome = attack(settings, &sandbox, &folder, robot, &mut report);
    let _ = fs::remove_dir_all(&folder);
    outcome?;
    Ok(Verdict::Done(report))
}

fn attack(
    settings: &Settings,
    sandbox: &Sandbox,
    folder: &Path,
    robot: &str,
    report: &mut Report,
) -> Result<(), String> {
    let root = sandbox.domain().root().to_owned();
    let [sarrus, torture] = ["sarrus", "torture"].map(|name| folder.join(name));
    fs::copy(crate::sandbox::program(settings)?, &sarrus).map_err(words)?;
    fs::copy(std::env::current_exe().map_err(words)?, &torture).map_err(words)?;
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).map_err(words)?;
    let bait = folder.join("bait");
    fs::write(&bait, "bait").map_err(words)?;
    chown(&bait, Some(USERS[0]), None).map_err(words)?;
    fs::set_permissions(&bait, fs::Permissions::from_mode(0o400)).map_err(words)?;
    let user = |program: &Path, user: u32| {
        let mut command = Command::new(program);
        command.uid(user).gid(user).current_dir("/").env("SARRUS_ROOT", &root);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        command
    };
    let server = || {
        let mut command = user(&sarrus, USERS[0]);
        command.args(["serve", "--robot", robot, "--name", NAME]);
        command
    };

    // the folder belongs to another user
    fs::create_dir(&root).map_err(words)?;
    chown(&root, Some(USERS[1]), None).map_err(words)?;
    let refused = server().stderr(Stdio::piped()).output().map_err(words)?;
    let text = String::from_utf8_lossy(&refused.stderr).trim().to_owned();
    report.count(format!("a folder of another user: {text}"));
    let names = text.contains(&*root.to_string_lossy()) && text.contains(&USERS[1].to_string());
    report.require(!refused.status.success() && names, || {
        format!("a folder of another user: the server says {text:?}")
    });
    fs::remove_dir(&root).map_err(words)?;

    // names taken before the server is there
    let intruder = || {
        let mut command = user(&torture, USERS[1]);
        command.args(["role", "intruder", "--root"]).arg(&root);
        command.args(["--prefix", &sandbox.domain().prefix(), "--bait"]).arg(&bait);
        command
    };
    let mut ways_in = Vec::new();
    look(&mut intruder(), &mut ways_in)?;
    let mut child = Process(server().spawn().map_err(words)?);
    let mut line = String::new();
    if let Some(out) = child.0.stdout.take() {
        BufReader::new(out).read_line(&mut line).map_err(words)?;
    }
    report.require(line.starts_with("ready "), || "the server does not start".to_owned());

    // and while it runs
    let mut clock = Clock::new("uid", settings.seconds);
    let mut rounds = 0_u64;
    let mut served = 0_u64;
    while clock.runs(|| format!("{served} clients served")) {
        let mut holders = Vec::new();
        for transport in [Transport::Lane, Transport::Service, Transport::Lane] {
            // one client is there, so that names can be seen
            holders.push(newcomer(&mut user(&torture, USERS[0]), &root, robot, transport)?);
            look(&mut intruder(), &mut ways_in)?;
        }
        for transport in TRANSPORTS {
            holders.push(newcomer(&mut user(&torture, USERS[0]), &root, robot, transport)?);
        }
        for (_, text) in &holders {
            served += u64::from(text == "ok");
            report.require(text == "ok", || format!("a client is told {text:?}"));
        }
        rounds += 1;
        if rounds == 1 {
            // the other user's files of later rounds are the same
            report.count(format!("{} names taken", shared_files(&sandbox.domain().prefix()).len()));
        }
    }
    report.count(format!("{rounds} rounds, {served} clients served"));
    report.require(ways_in.is_empty(), || {
        format!("{} ways in, as: {}", ways_in.len(), ways_in.first().cloned().unwrap_or_default())
    });
    let mode = fs::metadata(&bait).map_err(words)?.permissions().mode() & 0o777;
    report.require(mode == 0o400, || format!("a foreign file has mode {mode:o}"));
    report.require(matches!(child.0.try_wait(), Ok(None)), || "the server ended".to_owned());
    send_signal(child.0.id(), Signal::TERM);
    let status = child.0.wait().map_err(words)?;
    report.require(status.success(), || format!("the server ended with {status}"));
    Ok(())
}

/// A client of the serving user: its process and its first line.
fn newcomer(
    command: &mut Command,
    root: &Path,
    robot: &str,
    transport: Transport,
) -> Result<(Process, String), String> {
    command.args(["role", "asker", "--once", "--robot", robot, "--root"]).arg(root);
    command.args(transport_flags(transport)).stdin(Stdio::piped());
    let mut client = Process(command.spawn().map_err(words)?);
    let mut line = String::new();
    if let Some(out) = client.0.stdout.take() {
        BufReader::new(out).read_line(&mut line).map_err(words)?;
    }
    Ok((client, line.trim().to_owned()))
}

/// Lets the other user look; the ways in that it found.
fn look(intruder: &mut Command, ways_in: &mut Vec<String>) -> Result<(), String> {
    let output = intruder.output().map_err(words)?;
    let text = String::from_utf8_lossy(&output.stdout);
    match text.lines().last() {
        Some("done") => {}
        _ => return Err(format!("the other user says {text:?}")),
    }
    ways_in.extend(text.lines().filter(|line| *line != "done").map(str::to_owned));
    Ok(())
}

impl Intruder {
    pub(crate) fn run(self) -> Result<(), String> {
        // the socket and the folders
        let name = ServerName::new(NAME).map_err(words)?;
        let folder = self.root.join("server").join(name.as_str());
        if ControlSocket::connect(&folder).is_ok() {
            println!("connected to {}", folder.display());
        }
        if fs::read_dir(&self.root).is_ok() {
            println!("listed {}", self.root.display());
        }
        // the memory
        let mut seen = Vec::new();
        for path in shared_files(&self.prefix) {
            let ours = fs::symlink_metadata(&path)
                .is_ok_and(|found| std::os::unix::fs::MetadataExt::uid(&found) == USERS[1]);
            if ours {
                continue;
            }
            for write in [false, true] {
                if fs::OpenOptions::new().read(!write).write(write).open(&path).is_ok() {
                    println!("opened {} (writing: {write})", path.display());
                }
            }
            // INSTANCE_NUMBER_ follows the prefix
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let mut parts = name.strip_prefix(&self.prefix).unwrap_or_default().split('_');
            let instance = parts.next().unwrap_or_default().to_owned();
            let number = parts.next().and_then(|part| u64::from_str_radix(part, 16).ok());
            seen.extend(number.map(|number| (instance, number)));
        }
        // names that the next client may need
        let mut squatted = vec![format!("{}{COUNTER}", self.prefix)];
        if let Some((instance, last)) = seen.into_iter().max_by_key(|(_, number)| *number) {
            for number in last.wrapping_add(1)..=last.saturating_add(AHEAD) {
                squatted.push(format!("{}{instance}_{number:08x}_{COUNTER}", self.prefix));
                squatted.push(format!("{}{instance}_{number:08x}_x", self.prefix));
            }
        }
        for (k, name) in squatted.iter().enumerate() {
            let path = Path::new(SHARED_MEMORY).join(name);
            if k % 2 == 0 {
                let _ = symlink(&self.bait, &path);
            } else if fs::write(&path, "").is_ok() {
                let _ = fs::set_permissions(&path, fs::Permissions::from_mode(0o000));
            }
        }
        println!("done");
        Ok(())
    }
}
