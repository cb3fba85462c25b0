//! The memory limits of the control groups that this process is in.
//!
//! A process beyond such a limit is killed, and shared memory counts as it is reserved. What a
//! client asks for is therefore compared with the room under each limit first.

use std::fs;
use std::path::{Path, PathBuf};

use sarrus_proto::control::Refusal;

/// Room that stays free for work that is not asked for by a call `[byte]`.
const MARGIN: u64 = 4 << 20;
/// A larger number stands for no limit.
const UNLIMITED: u64 = 1 << 60;
/// Files of a limit and of the use that counts against it, and the beginning of the names of the
/// group's caches: of version 2, then of version 1.
const KINDS: [[&str; 3]; 3] = [
    ["memory.max", "memory.current", ""],
    ["memory.high", "memory.current", ""],
    ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_"],
];

/// The limits that held at the start; their numbers are read at each call.
pub(crate) struct MemoryLimits(Vec<Limit>);

/// A limit of one group.
struct Limit {
    group: PathBuf,
    kind: [&'static str; 3],
}

impl MemoryLimits {
    /// Those of the groups of this process and of all above; a folder stands for the system's
    /// files in tests.
    pub(crate) fn of_process(stand_in: Option<&Path>) -> MemoryLimits {
        let tree = stand_in.unwrap_or(Path::new("/sys/fs/cgroup"));
        let own = stand_in.map_or_else(|| "/proc/self/cgroup".into(), |folder| folder.join("self"));
        let mut limits = Vec::new();
        for line in fs::read_to_string(own).unwrap_or_default().lines() {
            let mut fields = line.splitn(3, ':').skip(1);
            let (Some(controllers), Some(path)) = (fields.next(), fields.next()) else { continue };
            let mount = match controllers {
                "" => tree.to_owned(),
                _ if controllers.split(',').any(|one| one == "memory") => tree.join("memory"),
                _ => continue,
            };
            // in a container the group itself may be the root of the tree
            let group = mount.join(path.trim_start_matches('/'));
            for group in group.ancestors().take_while(|group| group.starts_with(&mount)) {
                let limit = |kind| Limit { group: group.to_owned(), kind };
                limits.extend(KINDS.map(limit).into_iter().filter(|one| one.bytes().is_some()));
            }
        }
        MemoryLimits(limits)
    }

    /// Whether so many further bytes fit under each limit.
    ///
    /// # Errors
    /// [`Refusal::Failed`] with the limit.
    pub(crate) fn admit(&self, needed: u64) -> Result<(), Refusal> {
        for limit in &self.0 {
            if let Some(room) = limit.room()
                && room < needed + MARGIN
            {
                let [room, needed] = [room, needed].map(|bytes| bytes >> 10);
                let file = limit.group.join(limit.kind[0]);
                let reason = format!(
                    "the server's memory is limited by {}, which leaves {room} KiB; {needed} KiB \
                     are needed besides {} KiB that stay free; raise the limit or close a client",
                    file.display(),
                    MARGIN >> 10
                );
                return Err(Refusal::Failed { reason });
            }
        }
        Ok(())
    }
}

impl Limit {
    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.group.join(file)).unwrap_or_default()
    }

    fn bytes(&self) -> Option<u64> {
        self.read(self.kind[0]).trim().parse().ok().filter(|bytes| *bytes < UNLIMITED)
    }

    /// The bytes that are left; caches of files, which the kernel drops first, do not count.
    fn room(&self) -> Option<u64> {
        let [_, used, prefix] = self.kind;
        let used: u64 = self.read(used).trim().parse().ok()?;
        let caches = ["inactive_file", "active_file"].map(|name| format!("{prefix}{name}"));
        let stat = self.read("memory.stat");
        let lines = stat.lines().filter_map(|line| line.split_once(' '));
        let caches = lines.filter(|(name, _)| caches.iter().any(|cache| cache == name));
        let caches: u64 = caches.filter_map(|(_, bytes)| bytes.parse::<u64>().ok()).sum();
        Some(self.bytes()?.saturating_sub(used.saturating_sub(caches)))
    }
}
