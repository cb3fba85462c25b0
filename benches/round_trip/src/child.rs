//! The other process: this program again, as a server or as the far end of the floor. It ends when
//! its standard input does.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use clap::ValueEnum;
use sarrus_benches::cores::{Cores, pin};
use sarrus_client::describe;
use sarrus_models::{LoadError, Options, Source, load};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_serve::record::{RecordOptions, RecordedRobot};
use sarrus_serve::{ServeOptions, Wait, serve};

use crate::measure::ROBOT;
use crate::{floor, socket};

/// The role of the other process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Role {
    /// Serves the robot.
    Server,
    /// Sends its input back.
    Floor,
    /// Sends its input back through a socket.
    Socket,
}

/// A process that runs; killed when dropped.
pub(crate) struct Child(std::process::Child);

impl Child {
    /// Starts it and waits until it is ready.
    pub(crate) fn start(
        role: Role,
        domain: &Domain,
        cores: &Cores,
        record: Option<&Path>,
    ) -> Outcome<Child> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args([
            "--child",
            role.to_possible_value().as_ref().map_or("", |value| value.get_name()),
        ]);
        command.arg("--processors").args(cores.of_server().map(|cpu| cpu.to_string()));
        if let Some(file) = record {
            command.arg("--record").arg(file);
        }
        command.env("SARRUS_ROOT", domain.root()).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = Child(command.spawn()?);
        let mut line = String::new();
        if let Some(out) = child.0.stdout.take() {
            BufReader::new(out).read_line(&mut line)?;
        }
        if line.trim() == "ready" {
            Ok(child)
        } else {
            Err(format!("the {role:?} process does not start").into())
        }
    }

    /// Lets it end.
    pub(crate) fn stop(mut self) -> Outcome {
        drop(self.0.stdin.take());
        let status = self.0.wait()?;
        if status.success() {
            Ok(())
        } else {
            Err(format!("the other process ends with {status}").into())
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        // already gone after `stop`
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Is the other process.
pub(crate) fn child(role: Role, processors: &[usize], record: Option<PathBuf>) -> Outcome {
    let &[server, upkeep] = processors else { return Err("--child needs --processors".into()) };
    pin(server);
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    std::thread::spawn(move || {
        // ends with the process that started this one, however that ends
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        flag.store(true, Relaxed);
    });
    match role {
        Role::Floor => floor::far(&stop),
        Role::Socket => socket::far(),
        Role::Server => {
            let source = Source::Bundled(ROBOT.to_owned());
            let options = Options::default();
            let loaded = load(&source, &options)?;
            let record = record.map(|file| {
                let robot = RecordedRobot::new(&source, &options)?;
                Ok::<_, LoadError>(RecordOptions { file, seconds: 10, robot, is_optional: false })
            });
            let info = describe(&loaded);
            let options = ServeOptions {
                name: ROBOT.to_owned(),
                wait: Wait::Busy,
                lanes: 64,
                record: record.transpose()?,
                ..ServeOptions::default()
            };
            // the answering thread was started on the server's processor and stays there
            let ready = || {
                pin(upkeep);
                pin_recorder(upkeep);
                println!("ready");
            };
            Ok(serve(Arc::new(loaded.compiled.model), &info, &options, &stop, ready)?)
        }
    }
}

/// The recording thread, if there is one, was started on the server's processor too; it belongs
/// elsewhere. A thread that cannot be pinned is measured where it is.
fn pin_recorder(cpu: usize) {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let is_recorder = |task: &std::fs::DirEntry| {
        let name = std::fs::read_to_string(task.path().join("comm"));
        name.is_ok_and(|name| name.trim() == "sarrus-record")
    };
    for task in tasks.filter(is_recorder) {
        let mut taskset = Command::new("taskset");
        taskset.args(["-cp", &cpu.to_string()]).arg(task.file_name()).stdout(Stdio::null());
        if !taskset.status().is_ok_and(|status| status.success()) {
            eprintln!("the recorder stays on the server's processor: taskset is missing");
        }
    }
}
