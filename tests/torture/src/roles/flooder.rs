//! A client that sends calls and garbage as fast as it can.

use clap::Args;
use fastrand::Rng;
use sarrus_client::{Domain, Field, FieldSet, Query, Request};
use sarrus_proto::control::Call;
use sarrus_proto::message::PlanNumber;
use sarrus_proto::socket::MAX_MESSAGE;

use super::Target;
use crate::Settings;
use crate::raw::Raw;
use crate::sandbox::NAME;

#[derive(Args)]
pub(crate) struct Flooder {
    #[command(flatten)]
    target: Target,
}

impl Flooder {
    /// Goes on until it is killed.
    pub(crate) fn run(self, settings: &Settings) -> Result<(), String> {
        let mut random = Rng::with_seed(settings.seed);
        let domain = self.target.domain()?;
        loop {
            if flood(&domain, &mut random).is_err() {
                // the server has hung up, or is gone: again
                std::thread::yield_now();
            }
        }
    }
}

/// One connection's worth.
fn flood(domain: &Domain, random: &mut Rng) -> Result<(), String> {
    let raw = Raw::connect(domain, NAME)?;
    let mut buffer = vec![0_u8; MAX_MESSAGE + 1];
    // some never read an answer
    let reads = random.bool();
    for _ in 0..random.u32(1..2000) {
        let call = match random.u8(..12) {
            0 => Call::Lane { n_in: random.usize(..100), n_out: random.usize(..20_000) },
            1 => Call::Service,
            2 => Call::Serve,
            3 => Call::Model { page: random.usize(..4) },
            4 => Call::Release { plan: PlanNumber(random.u32(..)) },
            5 | 6 => {
                let given = FieldSet::of(&[Field::Y]);
                let want = FieldSet(random.u128(..));
                Call::Plan { query: Box::new(Query::new(Request::Kinematics, given, want)) }
            }
            7 => Call::Hello,
            _ => Call::Statistics,
        };
        let mut bytes = raw.request(call).to_bytes();
        match random.u8(..8) {
            0 => random.fill(&mut bytes),
            1 => bytes = vec![b'['; random.usize(1..=MAX_MESSAGE)],
            2 => {
                if let Some(byte) = random.choice(bytes.iter_mut()) {
                    *byte = random.u8(..);
                }
            }
            _ => {}
        }
        let sent = raw.socket.send(&bytes, None);
        if reads {
            while let Ok(Some(_)) = raw.socket.receive(&mut buffer) {}
        }
        match sent {
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                std::thread::yield_now();
            }
            Err(error) => return Err(error.to_string()),
            Ok(()) => {}
        }
    }
    Ok(())
}
