//! The file system that sockets, locks and the transport's small files lie on: memory, or something
//! that others can make slow.

use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::fs::statfs;
use sarrus_proto::Domain;

use super::Finding;
use super::files::Files;

/// Files that are made to see how long that takes.
const TRIALS: usize = 16;

/// What a file system is to a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Memory,
    Disk,
    /// The layers of a container's image.
    Layers,
    /// Another machine, or a program, behind every call.
    Remote,
    Unknown,
}

/// File systems by the numbers that statfs has for them (`linux/magic.h`).
const KINDS: [(u32, &str, Kind); 22] = [
    (0x0102_1994, "tmpfs", Kind::Memory),
    (0x8584_58f6, "ramfs", Kind::Memory),
    (0x0000_ef53, "ext4", Kind::Disk),
    (0x5846_5342, "xfs", Kind::Disk),
    (0x9123_683e, "btrfs", Kind::Disk),
    (0x2fc1_2fc1, "zfs", Kind::Disk),
    (0xf2f5_2010, "f2fs", Kind::Disk),
    (0xca45_1a4e, "bcachefs", Kind::Disk),
    (0x5265_4973, "reiserfs", Kind::Disk),
    (0x794c_7630, "overlay", Kind::Layers),
    (0x6175_6673, "aufs", Kind::Layers),
    (0x0000_6969, "nfs", Kind::Remote),
    (0xff53_4d42, "cifs", Kind::Remote),
    (0xfe53_4d42, "smb2", Kind::Remote),
    (0x0102_1997, "9p", Kind::Remote),
    (0x00c3_6400, "ceph", Kind::Remote),
    (0x6573_5546, "fuse", Kind::Remote),
    (0x5346_414f, "afs", Kind::Remote),
    (0x0116_1970, "gfs2", Kind::Remote),
    (0x7461_636f, "ocfs2", Kind::Remote),
    (0x0bd0_0bd0, "lustre", Kind::Remote),
    (0x786f_4256, "vboxsf", Kind::Remote),
];

/// The folder of the domain, or that in which it would be made.
pub(super) fn file_system(files: &Files) -> Vec<Finding> {
    let Some(domain) = files.is_machine().then(Domain::of_user).and_then(Result::ok) else {
        return Vec::new();
    };
    let Some(folder) = domain.root().ancestors().find(|folder| folder.is_dir()) else {
        return Vec::new();
    };
    let Ok(found) = statfs(folder) else { return Vec::new() };
    // the numbers have 32 bits, whatever the word
    judge(domain.root(), found.f_type as u32, || trial(folder).ok())
}

fn judge(root: &Path, number: u32, trial: impl FnOnce() -> Option<[Duration; 2]>) -> Vec<Finding> {
    let known = KINDS.iter().find(|(one, ..)| *one == number);
    let (name, kind) = known.map_or_else(
        || (format!("type {number:#x}"), Kind::Unknown),
        |(_, name, kind)| ((*name).to_owned(), *kind),
    );
    let help = match kind {
        Kind::Memory => return Vec::new(),
        Kind::Disk | Kind::Unknown => "a client that attaches waits for some ten such files",
        Kind::Layers => {
            "an image's layers are slow; in a container `--tmpfs /run/sarrus` is another"
        }
        Kind::Remote => "sockets and locks may not work there at all",
    };
    let took = trial().map_or_else(String::new, |[middle, worst]| {
        format!(", where a small file is made and synced in {middle:.0?}, at worst {worst:.0?}")
    });
    let user = rustix::process::geteuid().as_raw();
    vec![Finding::new(
        "file system",
        format!("{} lies on {name}{took}", root.display()),
        "memory (tmpfs)",
        format!(
            "a folder in memory for server and clients, SARRUS_ROOT=/dev/shm/sarrus-{user}: {help}"
        ),
    )]
}

/// How long a small file takes to be made, synced and removed, usually and at worst.
fn trial(folder: &Path) -> io::Result<[Duration; 2]> {
    let path = folder.join(format!("sarrus-doctor-{}", std::process::id()));
    let mut times = [Duration::ZERO; TRIALS];
    for time in &mut times {
        let start = Instant::now();
        let mut file = fs::File::create_new(&path)?;
        // as the transport does
        let written = file.write_all(&[0; 64]).and_then(|()| file.sync_all());
        fs::remove_file(&path)?;
        written?;
        *time = start.elapsed();
    }
    times.sort_unstable();
    Ok([times[TRIALS / 2], times[TRIALS - 1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_memory_is_named_with_its_time_and_what_to_do() {
        let judge = |number| {
            let times = [Duration::from_micros(31), Duration::from_millis(4)];
            let found = judge(Path::new("/tmp/sarrus-7"), number, || Some(times));
            found.iter().map(super::super::line).collect::<String>()
        };
        assert_eq!([judge(0x0102_1994), judge(0x8584_58f6)], ["", ""]);
        let disk = judge(0xef53);
        assert!(disk.starts_with(
            "file system: /tmp/sarrus-7 lies on ext4, where a small file is made and synced in \
             31µs, at worst 4ms, expected memory (tmpfs); a folder in memory for server and clients"
        ));
        assert!(disk.contains("SARRUS_ROOT=/dev/shm/sarrus-"), "{disk}");
        assert!(judge(0x6969).contains("on nfs") && judge(0x6969).contains("locks may not work"));
        assert!(judge(0x794c_7630).contains("`--tmpfs /run/sarrus`"));
        assert!(judge(0x1234_5678).contains("lies on type 0x12345678"));
    }

    #[test]
    fn a_trial_leaves_nothing() {
        let folder = std::env::temp_dir().join(format!("sarrus-trial-{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        let [middle, worst] = trial(&folder).unwrap();
        assert!(middle > Duration::ZERO && middle <= worst);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
        fs::remove_dir(&folder).unwrap();
        // where nothing can be made there is no time
        assert!(trial(&folder).is_err());
    }
}
