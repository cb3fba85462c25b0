//! `sarrus-can listen`: the frames on a bus, for wiring. It sends nothing.

use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use sarrus_can_core::log::dumped;
use sarrus_can_run::bus::{self, Address, Bus, Heard, Reconnecting};
use sarrus_client::now_ns;

/// Options of `listen`.
#[derive(Args)]
pub(crate) struct Listen {
    /// socketcan or slcan
    #[arg(long, default_value = "socketcan")]
    interface: String,
    /// Network interface or serial port
    #[arg(long)]
    channel: String,
    /// Bit rate [bit/s]; slcan takes 1000000 without it; an interface of socketcan must have the
    /// given one
    #[arg(long)]
    bitrate: Option<u32>,
    /// Data bit rate of CAN FD [bit/s]
    #[arg(long)]
    data_bitrate: Option<u32>,
}

/// Prints frames as `candump -L` does, and news of the bus on stderr, until it is asked to stop.
pub(crate) fn run(arguments: &Listen) -> ExitCode {
    crate::ended("listen", listen(arguments))
}

fn listen(arguments: &Listen) -> Result<(), Box<dyn std::error::Error>> {
    let stop = crate::run::until_asked()?;
    let Listen { interface, channel, bitrate, data_bitrate } = arguments;
    let bitrate = bitrate.or((interface == "slcan").then_some(1_000_000));
    let address = Address {
        interface: interface.clone(),
        channel: channel.clone(),
        bitrate,
        data_bitrate: *data_bitrate,
        listen_only: true,
    };
    let mut bus = Reconnecting::open(channel, address)?;
    eprintln!("ready {channel}");
    while !stop.load(Ordering::Relaxed) {
        bus::wait_for_bus(&bus, Duration::from_millis(100))?;
        while let Some(heard) = bus.next()? {
            match heard {
                Heard::Frame(frame) => {
                    if crate::tell(dumped(now_ns(), channel, frame)).is_err() {
                        // the reader has gone
                        return Ok(());
                    }
                }
                Heard::Event(event) => {
                    eprintln!("{}", dumped(now_ns(), channel, format_args!("{event:?}")));
                }
            }
        }
    }
    Ok(())
}
