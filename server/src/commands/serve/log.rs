//! The log of `serve`: events of the upkeep thread and the recorder, one line each, on stderr.

use std::io::{self, Write};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use clap::{Args, ValueEnum};
use sarrus_serve::system::stderr::write;
use tracing_subscriber::filter::LevelFilter;

/// The variable that sets the level where no flag does.
const VARIABLE: &str = "SARRUS_LOG";

/// Lines lost because stderr had no room.
static LOST: AtomicU64 = AtomicU64::new(0);

/// Flags of the log.
#[derive(Args)]
pub(super) struct LogFlags {
    /// Log to stderr: off, error, warn (refusals, late answers), info (clients, plans, recordings)
    /// or debug (lanes, services); by default SARRUS_LOG, else off.
    #[arg(long, value_name = "LEVEL", value_parser = level)]
    log: Option<LevelFilter>,
    /// Form of a line of the log.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    log_format: LogFormat,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    /// Time, level, event, then `key=value`.
    Text,
    /// An object with these.
    Json,
}

fn level(text: &str) -> Result<LevelFilter, String> {
    let known = ["off", "error", "warn", "info", "debug"].contains(&text);
    let level = known.then(|| LevelFilter::from_str(text).ok()).flatten();
    level.ok_or_else(|| "expected off, error, warn, info or debug".to_owned())
}

impl LogFlags {
    /// Logs from now on, if anything; why not, in words.
    pub(super) fn start(&self) -> Result<(), String> {
        let level = match (self.log, std::env::var_os(VARIABLE).filter(|text| !text.is_empty())) {
            (Some(level), _) => level,
            (None, None) => return Ok(()),
            (None, Some(text)) => {
                let text = text.to_string_lossy();
                level(&text).map_err(|error| format!("{VARIABLE}: {error}, found `{text}`"))?
            }
        };
        if level == LevelFilter::OFF {
            return Ok(());
        }
        let is_json = self.log_format == LogFormat::Json;
        let lines = tracing_subscriber::fmt()
            .with_max_level(level)
            .with_target(false)
            .with_ansi(false)
            .log_internal_errors(false)
            .with_writer(move || Stderr { is_json });
        let set =
            if is_json { lines.json().flatten_event(true).try_init() } else { lines.try_init() };
        set.map_err(|error| format!("nothing can be logged: {error}"))
    }
}

/// stderr; a line without room is left out, so that a full pipe delays no client.
struct Stderr {
    is_json: bool,
}

impl Write for Stderr {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut stderr = io::stderr().lock();
        let lost = LOST.load(Relaxed);
        if lost > 0 {
            let words = match self.is_json {
                true => {
                    format!("{{\"level\":\"WARN\",\"message\":\"lines lost\",\"lines\":{lost}}}\n")
                }
                false => format!("WARN lines lost lines={lost}\n"),
            };
            if write(&mut stderr, words.as_bytes()) {
                LOST.fetch_sub(lost, Relaxed);
            }
        }
        if !write(&mut stderr, line) {
            LOST.fetch_add(1, Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
