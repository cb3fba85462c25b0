//! Hundreds of clients attach at once: each is served or gets an error that names the missing room.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::Instant;

use clap::Args;
use sarrus_client::Transport;
use sarrus_proto::control::{Call, Grant};

use crate::Settings;
use crate::patience::holds;
use crate::process::Process;
use crate::raw::Raw;
use crate::report::{Report, Verdict};
use crate::roles::transport_flags;
use crate::sandbox::{NAME, Sandbox, words};

#[derive(Args)]
pub(crate) struct Burst {
    /// Clients that come at once.
    #[arg(long, default_value_t = 200)]
    clients: usize,
}

impl Default for Burst {
    fn default() -> Burst {
        Burst { clients: 200 }
    }
}

impl Burst {
    pub(crate) fn run(&self, settings: &Settings) -> Result<Verdict, String> {
        let mut report = Report::new(settings);
        let start = Instant::now();
        let mut rounds = 0_u64;
        loop {
            for (lanes, transport, n) in [
                (256, Transport::Lane, self.clients),
                (16, Transport::Lane, self.clients),
                (16, Transport::Service, self.clients / 5),
                // more than may connect
                (1, Transport::Lane, self.clients + self.clients / 2),
            ] {
                burst(settings, lanes, transport, n, &mut report)?;
            }
            rounds += 1;
            if start.elapsed().as_secs_f64() >= settings.seconds {
                break;
            }
        }
        report.count(format!("{rounds} rounds"));
        Ok(Verdict::Done(report))
    }
}

fn burst(
    settings: &Settings,
    lanes: usize,
    transport: Transport,
    n: usize,
    report: &mut Report,
) -> Result<(), String> {
    let robot = settings.robot.as_deref().unwrap_or("lambda");
    let sandbox = Sandbox::new(settings)?;
    let mut server = sandbox.serve(robot, &["--lanes", &lanes.to_string()])?;
    let observer = Raw::greet(sandbox.domain(), NAME)?;
    let room = match transport {
        Transport::Lane => lanes,
        Transport::Service => 32,
    };
    let flags = ["--robot", robot, "--once"].map(str::to_owned);
    let flags: Vec<String> = flags.into_iter().chain(transport_flags(transport)).collect();
    let start = Instant::now();
    let mut clients = Vec::new();
    for _ in 0..n {
        let mut command = sandbox.role("asker", &flags)?;
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        clients.push(Process(command.spawn().map_err(words)?));
    }
    let mut said = BTreeMap::<String, usize>::new();
    for client in &mut clients {
        let mut line = String::new();
        if let Some(out) = client.0.stdout.take() {
            BufReader::new(out).read_line(&mut line).map_err(words)?;
        }
        *said.entry(line.trim().to_owned()).or_default() += 1;
    }
    let took = start.elapsed().as_secs_f64();
    let who = format!("{n} clients ({transport:?}) at --lanes {lanes}");
    let served = said.remove("ok").unwrap_or(0);
    let refused: usize = said.values().sum();
    report.count(format!("{who}: {served} served, {refused} refused, {took:.1} s"));
    report.require(served == room.min(n), || {
        format!("{who}: {served} served instead of {}", room.min(n))
    });
    for (text, count) in &said {
        // every refusal names the missing resource
        report.require(text.starts_with("error all ") && text.contains(" are taken; "), || {
            format!("{who}: {count} were told {text:?}")
        });
    }

    // everything is free again
    drop(clients);
    let free = holds(|| {
        matches!(observer.call(Call::Statistics), Ok(Grant::Statistics(statistics))
            if statistics.lanes_taken == 0 && statistics.plans == 0)
    });
    report.require(free, || format!("{who}: lanes or plans stay taken"));
    if let Some(status) = server.ended() {
        report.fault(format!("{who}: the server ended with {status}"));
        return Ok(());
    }
    drop(observer);
    server.stop()?;
    sandbox.require_empty(report);
    Ok(())
}
