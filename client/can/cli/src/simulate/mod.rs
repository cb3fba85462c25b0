//! `sarrus-can simulate`: the motors of a configuration from their own side, one process for each
//! bus or for all.
//!
//! Prints `ready BUS CHANNEL` for each bus, then events as JSON lines: power, faults, tripped
//! watchdogs, the first set-point. Lines on stdin request a report or inject faults, see
//! [`console`]. Times are CLOCK_MONOTONIC in nanoseconds, so that tests can compare processes.

mod console;
mod line;
mod link;
mod motors;
mod robot;

use std::io::{self, BufRead, IsTerminal};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use clap::{Args, ValueEnum};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::{process, termios};
use sarrus_can_core::config::Configuration;
use sarrus_can_sim::Physics;

use console::Order;
use line::Line;
use link::Link;
use motors::Motors;
use sarrus_can_run::bus::{self, Address, Bus, BusError, Pseudo, Reconnecting};
use sarrus_client::now_ns;

/// Longest time between two steps of the motors.
const STEP: Duration = Duration::from_millis(1);

/// Inertia and viscous friction of a small brushless motor on a shaft of its own `[kg m², N m
/// s/rad]`. Through a screw with a lead of 10 mm they are 39 kg and 39 N s/m.
const ROTOR: f64 = 1e-4;

type Error = Box<dyn std::error::Error>;

/// Options of `simulate`.
#[derive(Args)]
pub(crate) struct Simulate {
    /// The configuration of the robot's buses and motors
    config: PathBuf,
    /// Only this bus; without it all of them in one process
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// Make a pseudo-terminal for each bus that speaks slcan, and a link to it where the
    /// configuration has its channel
    #[arg(long)]
    pty: bool,
    /// Make the link here instead, for one bus
    #[arg(long, value_name = "PATH", requires = "pty", requires = "bus")]
    link: Option<PathBuf>,
    /// Mechanics behind the motors
    #[arg(long, value_enum, default_value_t = Dynamics::Motor)]
    dynamics: Dynamics,
    /// Inertia of each motor, at its output [kg m²]: without it 0.01, which counts the load, and
    /// 1e-4 with `--dynamics robot`, which has the loads
    #[arg(long)]
    inertia: Option<f64>,
    /// Viscous friction of each motor, at its output [N m s/rad]: without it 0.01, and 1e-4 with
    /// `--dynamics robot`
    #[arg(long)]
    friction: Option<f64>,
    /// A line as on stdin, done at the start; may be repeated
    #[arg(long, value_name = "LINE")]
    fault: Vec<String>,
    /// Seed of the losses
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Mechanics behind the motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Dynamics {
    /// Each motor turns an inertia of its own
    Motor,
    /// The motors move the robot of the configuration
    Robot,
}

/// Runs until a signal ends it: 0; 1 for a faulty configuration, 2 for failures at start-up.
pub(crate) fn run(arguments: &Simulate) -> Result<ExitCode, ExitCode> {
    let configuration = crate::configuration(&arguments.config)?;
    let result = prepare(arguments, &configuration).and_then(|mut simulation| simulation.run());
    Ok(crate::ended("simulate", result))
}

struct Simulation {
    motors: Motors,
    lines: Vec<Line>,
    orders: mpsc::Receiver<Order>,
    stop: Arc<AtomicBool>,
    _links: Vec<Link>,
}

fn prepare(arguments: &Simulate, configuration: &Configuration) -> Result<Simulation, Error> {
    let stop = crate::run::until_asked()?;
    let chosen: Vec<usize> = match &arguments.bus {
        None => (0..configuration.buses.len()).collect(),
        Some(name) => {
            let known: Vec<&str> = configuration.buses.iter().map(|bus| &*bus.name).collect();
            let known = known.join(", ");
            vec![configuration.bus(name).ok_or_else(|| {
                format!("no bus `{name}` in the configuration, expected one of {known}")
            })?]
        }
    };
    let usual = match arguments.dynamics {
        Dynamics::Motor => 0.01,
        Dynamics::Robot => ROTOR,
    };
    let [inertia, friction] =
        [arguments.inertia, arguments.friction].map(|given| given.unwrap_or(usual));
    let physics = Physics { inertia, friction, torque_limit: f64::INFINITY };
    let motors = Motors::new(configuration, &chosen, physics, arguments.dynamics)?;
    let mut lines = Vec::new();
    let mut links = Vec::new();
    for &place in &chosen {
        let Some(config) = configuration.buses.get(place) else { continue };
        let (bus, channel): (Box<dyn Bus>, String) =
            if arguments.pty && (config.interface == "slcan" || arguments.link.is_some()) {
                let pseudo = Pseudo::new()?;
                let path = arguments.link.clone().unwrap_or_else(|| PathBuf::from(&config.channel));
                links.push(Link::make(pseudo.path(), &path)?);
                (Box::new(pseudo), path.display().to_string())
            } else {
                let bus = Reconnecting::open(&config.name, Address::of(config))?;
                (Box::new(bus), config.channel.clone())
            };
        // a closed stdout changes nothing
        let _ = crate::tell(format_args!("ready {} {channel}", config.name));
        let seed = arguments.seed.wrapping_add(place as u64);
        lines.push(Line::new(config.name.clone(), place, bus, seed));
    }
    let orders = listen(&arguments.fault)?;
    Ok(Simulation { motors, lines, orders, stop, _links: links })
}

/// Lines of stdin in a thread of their own, which ends with stdin.
fn listen(first: &[String]) -> Result<mpsc::Receiver<Order>, String> {
    let (sender, receiver) = mpsc::channel();
    for line in first {
        let _ = sender.send(console::read(line).map_err(|why| format!("--fault `{line}`: {why}"))?);
    }
    std::thread::spawn(move || {
        let mut lines = io::stdin().lock().lines();
        loop {
            wait_for_terminal();
            let Some(Ok(line)) = lines.next() else { return };
            match console::read(&line) {
                Ok(order) => {
                    if sender.send(order).is_err() {
                        return;
                    }
                }
                Err(why) => eprintln!("`{line}`: {why}"),
            }
        }
    });
    Ok(receiver)
}

/// Where stdin is a terminal, waits until it has a line for this process. A read in the background
/// would stop the process, motors and all.
fn wait_for_terminal() {
    const LOOK: Duration = Duration::from_millis(100);
    let stdin = io::stdin();
    while stdin.is_terminal() {
        let _ = poll(&mut [PollFd::new(&stdin, PollFlags::IN)], None);
        if !termios::tcgetpgrp(&stdin).is_ok_and(|group| group != process::getpgrp()) {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

impl Simulation {
    fn run(&mut self) -> Result<(), Error> {
        // orders of `--fault` take effect before the first frame
        self.obey(now_ns())?;
        while !self.stop.load(Ordering::Relaxed) {
            self.cycle()?;
        }
        Ok(())
    }

    fn obey(&mut self, now_ns: u64) -> Result<(), BusError> {
        while let Ok(order) = self.orders.try_recv() {
            console::obey(&order, now_ns, &mut self.motors, &mut self.lines)?;
        }
        Ok(())
    }

    fn cycle(&mut self) -> Result<(), BusError> {
        let now_ns = now_ns();
        // the motors' clocks run first: after a gap a watchdog has tripped before the frames that
        // waited are read
        self.motors.step(now_ns);
        for line in &mut self.lines {
            line.hear(now_ns, &mut self.motors)?;
            line.send(now_ns)?;
        }
        self.obey(now_ns)?;
        self.motors.news(now_ns).iter().for_each(|news| drop(crate::tell(news)));
        let readable = self.lines.iter().filter_map(|line| line.bus.readable());
        let mut fds: Vec<PollFd<'_>> =
            readable.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
        let due_ns = self.lines.iter().filter_map(Line::due_ns).min();
        let rest = due_ns.map(|due_ns| Duration::from_nanos(due_ns.saturating_sub(now_ns)));
        bus::wait_for(&mut fds, rest.map_or(STEP, |rest| rest.min(STEP)))?;
        Ok(())
    }
}
