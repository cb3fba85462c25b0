//! The other process: this program again, as a server or as the far end of the floor. It ends when
//! its standard input does.

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use clap::ValueEnum;
use sarrus_client::describe;
use sarrus_models::{Options, Source, load};
use sarrus_proto::Domain;
use sarrus_report::Outcome;
use sarrus_report::measure::cores::{Cores, pin};
use sarrus_server::{ServeOptions, Wait, serve};

use crate::floor;
use crate::measure::ROBOT;

/// What the other process does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Role {
    /// Serves the robot.
    Server,
    /// Sends back what it gets.
    Floor,
}

/// A process that runs; killed when dropped.
pub(crate) struct Child(std::process::Child);

impl Child {
    /// Starts it and waits until it is ready.
    pub(crate) fn start(role: Role, domain: &Domain, cores: &Cores) -> Outcome<Child> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args([
            "--child",
            role.to_possible_value().as_ref().map_or("", |value| value.get_name()),
        ]);
        command.arg("--processors").args(cores.of_server().map(|cpu| cpu.to_string()));
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
pub(crate) fn child(role: Role, processors: &[usize]) -> Outcome {
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
        Role::Server => {
            let loaded = load(&Source::Bundled(ROBOT.to_owned()), &Options::default())?;
            let info = describe(&loaded);
            let options = ServeOptions {
                name: ROBOT.to_owned(),
                wait: Wait::Busy,
                lanes: 4,
                ..ServeOptions::default()
            };
            // the answering thread was started on the server's processor and stays there
            let ready = || {
                pin(upkeep);
                println!("ready");
            };
            Ok(serve(Arc::new(loaded.compiled.model), &info, &options, &stop, ready)?)
        }
    }
}
