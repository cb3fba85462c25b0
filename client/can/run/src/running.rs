//! The threads of a bridge that runs: one for the cycle, one for each bus, one for the logs.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::bus_load;
use sarrus_can_core::config::{BusConfig, Configuration};
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::telemetry::Telemetry;
use sarrus_client::now_ns;
use sarrus_proto::bridge::BridgeEnd;
use sarrus_proto::{Domain, DomainNode, ServerName};

use crate::bus::Bus;
use crate::bus_thread::BusThread;
use crate::journal::{JournalWriter, journal};
use crate::positions::Positions;
use crate::realtime;
use crate::rules::{Report, Rules};
use crate::stderr::say;

type Error = Box<dyn std::error::Error>;

/// Settings of a bridge that runs.
pub struct Settings {
    /// Name under which controllers find the bridge.
    pub name: String,
    /// Priority of the threads under SCHED_FIFO; `None` asks the system for nothing.
    pub priority: Option<u8>,
    /// Folder for the logs of faults; `None`: the usual one.
    pub fault_log: Option<PathBuf>,
    /// File for a log of all inputs.
    pub log: Option<PathBuf>,
}

/// A bridge whose buses are open and whose services exist, and which does not cycle yet.
pub struct Prepared {
    settings: Settings,
    fingerprint: u64,
    rules: Rules,
    buses: Vec<BusThread>,
    writer: JournalWriter,
    positions: Option<Positions>,
    domain: Domain,
    node: DomainNode,
}

/// Creates the services of a bridge and opens its buses. `stop` ends the bridge when it is set.
///
/// # Errors
/// The name is taken, a bus cannot be opened, or a log cannot be created.
pub fn prepare(
    configuration: Configuration,
    settings: Settings,
    stop: Arc<AtomicBool>,
    mut open: impl FnMut(&BusConfig) -> Result<Box<dyn Bus>, Error>,
) -> Result<Prepared, Error> {
    let name = ServerName::new(&settings.name)?;
    let domain = Domain::of_user()?;
    let node = domain.node()?;
    let services = BridgeEnd::create(&node, &name)?;

    let loads = bus_load::loads(&configuration);
    let fingerprint = configuration.fingerprint;
    let usual = FaultFiles::usual_folder(|name| std::env::var_os(name));
    let positions = Positions::new(&usual.with_file_name("positions"), &configuration);
    let mut bridge = Bridge::new(configuration);
    positions.iter().for_each(|positions| positions.remember(&mut bridge));
    let mut buses = Vec::new();
    let mut ends = Vec::new();
    for (number, config) in bridge.configuration().buses.iter().enumerate() {
        let shutdown_frames = bridge.shutdown_frames(number);
        let (bus, end) = BusThread::new(&config.name, open(config)?, shutdown_frames)?;
        buses.push(bus);
        ends.push(end);
    }
    // a bus that cannot be opened leaves an earlier log as it is
    let folder = settings.fault_log.clone().unwrap_or(usual);
    let files = FaultFiles::new(folder, name.as_str());
    let log = settings.log.as_deref();
    let (journal, writer) = journal(Some(files), log, &mut bridge).map_err(|error| {
        format!("{}: {error}", log.map_or("the log".into(), |path| path.to_string_lossy()))
    })?;
    let telemetry = Telemetry::new(&bridge, &loads, std::process::id(), now_ns())
        .ok_or("no memory for histograms")?;
    if settings.priority.is_some() {
        realtime::lock_memory().into_iter().for_each(|note| say(format_args!("{note}")));
    }
    let noted = positions.as_ref().map(|of| of.noted.clone());
    let rules =
        Rules { ends, bridge, telemetry, services, journal, positions: noted, stop, missed: 0 };
    Ok(Prepared { settings, fingerprint, rules, buses, writer, positions, domain, node })
}

impl Prepared {
    /// Fingerprint of the model, which controllers compare.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Starts the threads.
    ///
    /// # Errors
    /// The system gives no thread; the motors were commanded off.
    pub fn start(self) -> io::Result<Running> {
        let Prepared { settings, mut rules, buses, writer, positions, domain, node, .. } = self;
        let priority = settings.priority;
        let stop = rules.stop.clone();
        let named = |name: &str| thread::Builder::new().name(name.to_owned());
        let writer = named("log").spawn(move || writer.run())?;
        let is_over = Arc::new(AtomicBool::new(false));
        let over = is_over.clone();
        let positions = positions
            .map(|positions| named("positions").spawn(move || positions.run(&over)))
            .transpose()?;
        let buses = buses
            .into_iter()
            .map(|bus| named("bus").spawn(move || bus.run(priority)))
            .collect::<io::Result<_>>()?;
        let rules = named("rules").spawn(move || {
            realtime::be_first(priority);
            rules.run();
            rules.end()
        })?;
        let log = settings.log;
        Ok(Running { stop, rules, buses, writer, positions, is_over, log, domain, node })
    }
}

/// A bridge that runs.
pub struct Running {
    stop: Arc<AtomicBool>,
    rules: JoinHandle<Report>,
    buses: Vec<JoinHandle<()>>,
    writer: JoinHandle<io::Result<u64>>,
    positions: Option<JoinHandle<()>>,
    /// The cycle has ended.
    is_over: Arc<AtomicBool>,
    log: Option<PathBuf>,
    domain: Domain,
    node: DomainNode,
}

impl Running {
    /// Whether the cycle has ended. A bus whose thread ended by itself ends it.
    #[must_use]
    pub fn is_over(&self) -> bool {
        if self.buses.iter().any(JoinHandle::is_finished) {
            self.stop.store(true, Ordering::Relaxed);
        }
        self.rules.is_finished()
    }

    /// Ends the cycle, waits for the shutdown frames of all buses, and writes the logs to the end.
    ///
    /// # Errors
    /// A thread panicked, or the log could not be written.
    pub fn end(self) -> Result<Report, Error> {
        self.stop.store(true, Ordering::Relaxed);
        let cycled = self.rules.join();
        let mut faults = Vec::new();
        for bus in self.buses {
            if bus.join().is_err() {
                faults.push("the thread of a bus broke down".to_owned());
            }
        }
        self.is_over.store(true, Ordering::Relaxed);
        if self.positions.is_some_and(|positions| positions.join().is_err()) {
            faults.push("the thread of the positions broke down".to_owned());
        }
        let lost = cycled.as_ref().map_or(0, |report| report.lost);
        match (self.writer.join(), &self.log) {
            (Ok(Ok(lines)), Some(log)) => {
                let lost = if lost > 0 {
                    format!(", {lost} lost: it cannot be replayed")
                } else {
                    String::new()
                };
                say(format_args!("{lines} line(s) in {}{lost}", log.display()));
            }
            (Ok(Ok(_)), None) => {}
            (Ok(Err(error)), _) => faults.push(format!("the log: {error}")),
            (Err(_), _) => faults.push("the thread of the logs broke down".to_owned()),
        }
        if lost > 0 {
            say(format_args!("{lost} input(s) are missing in the logs of faults"));
        }
        drop(self.node);
        self.domain.tidy();
        match cycled {
            Ok(report) if faults.is_empty() => Ok(report),
            Ok(_) => Err(faults.join("; ").into()),
            Err(_) => {
                faults.push("the thread of the rules broke down; the motors were disabled".into());
                Err(faults.join("; ").into())
            }
        }
    }
}
