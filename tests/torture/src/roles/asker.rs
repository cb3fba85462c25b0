//! An honest client in a process of its own.

use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use clap::Args;

use super::Target;
use crate::Settings;
use crate::honest::Honest;
use crate::oracle::Oracle;
use crate::patience::LIMIT;
use crate::sandbox::words;

#[derive(Args)]
pub(crate) struct Asker {
    #[command(flatten)]
    target: Target,
    /// The longest wait of a call `[ms]`.
    #[arg(long, default_value_t = LIMIT.as_millis() as u64)]
    timeout: u64,
    /// Asks once and prints `ok` or `error` with the reason, then stays until its input ends.
    #[arg(long)]
    once: bool,
}

impl Asker {
    /// Without `once`: asks until its input ends, then prints the numbers of answers, of wrong and
    /// of lost ones.
    pub(crate) fn run(self, settings: &Settings) -> Result<(), String> {
        let robot = settings.robot.as_deref().unwrap_or("lambda");
        let oracle = Arc::new(Oracle::new(robot, settings.seed, if self.once { 6 } else { 256 })?);
        let over = Arc::new(AtomicBool::new(false));
        let ended = over.clone();
        let input = std::thread::spawn(move || {
            let _ = std::io::stdin().read_to_end(&mut Vec::new());
            ended.store(true, Relaxed);
        });
        let timeout = Duration::from_millis(self.timeout);
        let domain = self.target.domain()?;
        let transport = self.target.transport();
        let mut honest =
            Honest::connect(&domain, transport, timeout, &oracle, settings.seed).map_err(words)?;
        if self.once {
            // a refusal of one request, as that of a server that is stopping, is asked again
            while honest.counts.answers == 0 {
                honest.ask().map_err(words)?;
            }
            match &honest.counts.first_wrong {
                None => println!("ok"),
                Some(wrong) => println!("wrong {wrong}"),
            }
            let _ = input.join();
            return Ok(());
        }
        while !over.load(Relaxed) {
            let _ = honest.ask();
            std::thread::sleep(Duration::from_micros(200));
        }
        let counts = &honest.counts;
        let first = counts.first_wrong.as_ref().or(counts.first_error.as_ref());
        let first = first.map_or("", String::as_str).replace('\n', " ");
        println!("counts {} {} {} {first}", counts.answers, counts.wrong, counts.lost);
        Ok(())
    }
}
