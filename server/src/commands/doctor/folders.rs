//! Room in shared memory, and the file system of the sockets and locks.

use std::path::Path;

use sarrus_proto::Domain;

use super::{Finding, text};

/// Room in bytes that a server with some clients needs.
const ROOM: u64 = 64 << 20;

pub(super) fn free_space(root: &Path) -> Vec<Finding> {
    let Ok(space) = rustix::fs::statvfs(root.join("dev/shm")) else { return Vec::new() };
    judge_space(space.f_bavail * space.f_frsize, space.f_blocks * space.f_frsize)
}

fn judge_space(free: u64, size: u64) -> Vec<Finding> {
    if free >= ROOM {
        return Vec::new();
    }
    let [free, size, room] = [free, size, ROOM].map(|bytes| bytes >> 20);
    vec![Finding::new(
        "free space",
        format!("{free} of {size} MiB in /dev/shm"),
        format!("{room} MiB or more"),
        "`mount -o remount,size=256m /dev/shm` (in a container --shm-size=256m), or remove what \
         is in it; `sarrus tidy` clears what crashes of sarrus left",
    )]
}

/// The file system of a path: that of the deepest mount above it; of several mounts on one folder,
/// the last.
fn file_system_of<'a>(mounts: &'a str, path: &Path) -> Option<&'a str> {
    let mounts = mounts.lines().filter_map(|line| {
        let mut words = line.split_whitespace().skip(1);
        Some((words.next()?, words.next()?))
    });
    let above = mounts.filter(|(folder, _)| path.starts_with(folder));
    above.max_by_key(|(folder, _)| folder.len()).map(|(_, file_system)| file_system)
}

/// The file system of the domain's folder, or of the folder in which it would be made.
pub(super) fn file_system(root: &Path) -> Vec<Finding> {
    let domain = Domain::of_user().ok().filter(|_| root == Path::new("/"));
    let Some((domain, mounts)) = domain.zip(text(root, "proc/self/mounts")) else {
        return Vec::new();
    };
    let made = domain.root().ancestors().find(|folder| folder.is_dir());
    let folder = made.and_then(|folder| folder.canonicalize().ok());
    let name = folder.and_then(|folder| file_system_of(&mounts, &folder));
    name.map_or_else(Vec::new, |name| judge_file_system(domain.root(), name))
}

fn judge_file_system(root: &Path, name: &str) -> Vec<Finding> {
    if ["tmpfs", "ramfs"].contains(&name) {
        return Vec::new();
    }
    let user = rustix::process::geteuid().as_raw();
    vec![Finding::new(
        "file system",
        format!("{} lies on {name}", root.display()),
        "memory (tmpfs)",
        format!(
            "a folder in memory for server and clients, SARRUS_ROOT=/dev/shm/sarrus-{user}, in a \
             container also `--tmpfs /run/sarrus`: a client that attaches waits for some ten \
             files, and behind a network locks may not work at all"
        ),
    )]
}

#[cfg(test)]
mod tests {
    use super::super::tests::judge;
    use super::*;

    #[test]
    fn little_room_is_a_finding() {
        assert_eq!(judge_space(ROOM, 1 << 30), []);
        let found = judge_space(5 << 20, 64 << 20);
        assert_eq!(found[0].found, "5 of 64 MiB in /dev/shm");
        assert_eq!(judge(free_space, &[]), [""; 0]);
    }

    #[test]
    fn the_deepest_mount_above_a_path_is_its_own() {
        // a container may mount its root after its folders
        let mounts = "p /proc proc rw 0 0\nb /run tmpfs rw 0 0\nc /run/user/7 fuse rw 0 0\n\
            a / ext4 rw 0 0\nd / xfs rw 0 0\n";
        let name = |path: &str| file_system_of(mounts, Path::new(path)).unwrap();
        assert_eq!(["/proc/x", "/run/x", "/run/user/7/x"].map(name), ["proc", "tmpfs", "fuse"]);
        assert_eq!(name("/tmp"), "xfs");
    }

    #[test]
    fn a_file_system_outside_of_memory_is_named_with_the_remedy() {
        let judge = |name| {
            let found = judge_file_system(Path::new("/tmp/sarrus-7"), name);
            found.iter().map(super::super::line).collect::<String>()
        };
        assert_eq!([judge("tmpfs"), judge("ramfs")], ["", ""]);
        let disk = judge("ext4");
        assert!(disk.starts_with(
            "file system: /tmp/sarrus-7 lies on ext4, expected memory (tmpfs); a folder in memory \
             for server and clients"
        ));
        assert!(disk.contains("SARRUS_ROOT=/dev/shm/sarrus-"), "{disk}");
        assert!(judge("overlay").contains("`--tmpfs /run/sarrus`"));
        assert!(judge("fuse.sshfs").contains("locks may not work"));
    }
}
