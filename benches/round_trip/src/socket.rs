//! The floor's bytes there and back through a Unix-domain socket between two processes that wait in
//! the kernel.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;

use sarrus_benches::cores::Cores;
use sarrus_proto::Domain;
use sarrus_report::Outcome;

use crate::child::{Child, Role};

/// Bytes that one message can carry: 64 numbers.
const MOST: usize = 512;
/// The count of bytes that follow, and of those to go back.
const HEAD: usize = 4;

fn path(domain: &Domain) -> PathBuf {
    domain.root().join("round_trip.sock")
}

/// The end that measures.
pub(crate) struct Near {
    stream: UnixStream,
    child: Child,
    bytes: Vec<u8>,
}

impl Near {
    /// Starts the other process.
    pub(crate) fn start(domain: &Domain, cores: &Cores) -> Outcome<Near> {
        let child = Child::start(Role::Socket, domain, cores, None)?;
        let stream = UnixStream::connect(path(domain))?;
        std::fs::remove_file(path(domain))?;
        Ok(Near { stream, child, bytes: Vec::with_capacity(HEAD + MOST) })
    }

    /// One round trip: `input` there, the first `n_out` of its numbers back.
    pub(crate) fn trip(&mut self, input: &[f64], n_out: usize) -> Outcome {
        self.bytes.clear();
        let lengths = [8 * input.len(), 8 * n_out].map(|bytes| (bytes as u16).to_le_bytes());
        self.bytes.extend(lengths.iter().flatten());
        self.bytes.extend(input.iter().flat_map(|x| x.to_le_bytes()));
        self.stream.write_all(&self.bytes)?;
        let mut back = [0; MOST];
        let back = back.get_mut(..8 * n_out).ok_or("the message is too long")?;
        self.stream.read_exact(back)?;
        if *back == self.bytes[HEAD..][..8 * n_out] {
            Ok(())
        } else {
            Err("the socket sends back other numbers".into())
        }
    }

    pub(crate) fn stop(self) -> Outcome {
        drop(self.stream);
        self.child.stop()
    }
}

/// The other end, until the near one closes.
pub(crate) fn far() -> Outcome {
    let domain = Domain::of_user()?;
    std::fs::create_dir_all(domain.root())?;
    let listener = UnixListener::bind(path(&domain))?;
    println!("ready");
    let (mut stream, _) = listener.accept()?;
    let mut head = [0; HEAD];
    let mut bytes = [0; MOST];
    while stream.read_exact(&mut head).is_ok() {
        let [a, b, c, d] = head;
        let there = usize::from(u16::from_le_bytes([a, b]));
        let back = usize::from(u16::from_le_bytes([c, d]));
        stream.read_exact(bytes.get_mut(..there).ok_or("the message is too long")?)?;
        stream.write_all(bytes.get(..back).ok_or("the answer is too long")?)?;
    }
    Ok(())
}
