//! A client that writes random bytes into shared memory.

use std::fs::OpenOptions;
use std::os::unix::fs::FileExt;
use std::path::Path;

use clap::Args;
use fastrand::Rng;
use sarrus_client::{Field, FieldSet, Query, Request, Transport};
use sarrus_proto::control::Call;
use sarrus_proto::message::store_numbers;

use super::Target;
use crate::Settings;
use crate::process::shared_files;
use crate::raw::Raw;
use crate::sandbox::NAME;

const STATE: Query =
    Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));

#[derive(Args)]
pub(crate) struct Scribbler {
    #[command(flatten)]
    target: Target,
    /// Cuts files short instead.
    #[arg(long)]
    truncate: bool,
    /// Scribbles over the memory of all clients.
    #[arg(long)]
    others: bool,
    /// Only into files whose names hold this.
    #[arg(long)]
    only: Option<String>,
}

impl Scribbler {
    /// Scribbles and asks until it is killed or dies of it.
    pub(crate) fn run(self, settings: &Settings) -> Result<(), String> {
        let mut random = Rng::with_seed(settings.seed);
        let domain = self.target.domain()?;
        let raw = Raw::greet(&domain, NAME)?;
        let (plan, sizes) = raw.plan(&STATE)?;
        let numbers = vec![0.1; sizes[0]];
        let scribble = |random: &mut Rng, prefix: &str| {
            let prefix = if self.others { domain.prefix() } else { prefix.to_owned() };
            let mut files = shared_files(&prefix);
            if let Some(part) = &self.only {
                files.retain(|path| path.to_string_lossy().contains(part.as_str()));
            }
            if let Some(path) = random.choice(&files) {
                let _ = damage(path, random, self.truncate);
            }
        };
        match self.target.transport() {
            Transport::Lane => {
                let (link, classes) = raw.lane(sizes)?;
                let (mut lane, _node) = raw.claim(link, classes)?;
                let prefix = raw.prefix_of(link);
                for sequence in 1.. {
                    store_numbers(lane.outbox.numbers(), &numbers);
                    scribble(&mut random, &prefix);
                    lane.outbox.publish(raw.head(plan, sequence));
                    let _ = lane.inbox.poll();
                }
            }
            Transport::Service => {
                let link = raw.service()?;
                let (mut client, _node) = raw.open(link)?;
                let prefix = raw.prefix_of(link);
                // half of them before the server has seen their end
                if random.bool() {
                    scribble(&mut random, &prefix);
                }
                raw.call(Call::Serve)?;
                for sequence in 1.. {
                    client.cancel();
                    client.send(&raw.head(plan, sequence), &numbers);
                    scribble(&mut random, &prefix);
                    for _ in 0..random.u32(..100) {
                        if !matches!(client.poll(), Ok(None)) {
                            break;
                        }
                        std::thread::yield_now();
                    }
                }
            }
        }
        Ok(())
    }
}

/// Writes something at random into a file.
fn damage(path: &Path, random: &mut Rng, truncate: bool) -> std::io::Result<()> {
    let file = OpenOptions::new().write(true).open(path)?;
    let size = file.metadata()?.len();
    if truncate {
        return file.set_len(random.u64(..=size));
    }
    // most records lie at the front
    let reach = if random.bool() { size.min(512) } else { size };
    let place = random.u64(..reach.max(1)) & !7;
    let mut bytes = [0_u8; 64];
    let length = random.usize(1..=bytes.len()).min((size - place.min(size)) as usize);
    match random.u8(..4) {
        0 => bytes.fill(0xff),
        1 => bytes.fill(0),
        _ => random.fill(&mut bytes),
    }
    file.write_all_at(bytes.get(..length).unwrap_or_default(), place)
}
