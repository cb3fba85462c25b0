//! The folders of shared memory, sockets and locks: file system, room, owner.

use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, Instant};

use sarrus_proto::Domain;

use super::Finding;
use super::files::{Files, unreadable};

/// Room in bytes that a server with some clients needs.
const ROOM: u64 = 64 << 20;
/// Mode of a folder in which every user makes files and removes only their own.
const SHARED_BY_OWNERS: u32 = 0o1777;
const MOUNTS: &str = "proc/self/mounts";
const SHARED_MEMORY: &str = "/dev/shm";
/// Files that a trial makes.
const TRIALS: usize = 16;
/// File systems behind a network or another program, beside those whose name begins with `fuse`.
const REMOTE: [&str; 11] =
    ["9p", "afs", "ceph", "cifs", "gfs2", "lustre", "nfs", "nfs4", "ocfs2", "smb3", "vboxsf"];

/// A line of `/proc/self/mounts`.
struct Mount<'a> {
    folder: &'a str,
    file_system: &'a str,
    options: &'a str,
}

impl Mount<'_> {
    fn read(line: &str) -> Option<Mount<'_>> {
        let mut words = line.split_whitespace().skip(1);
        let [folder, file_system, options] = [words.next()?, words.next()?, words.next()?];
        Some(Mount { folder, file_system, options })
    }

    /// The mount of a path: the deepest one above it, of several in one folder the last.
    fn of<'a>(mounts: &'a str, path: &Path) -> Option<Mount<'a>> {
        let mounts = mounts.lines().filter_map(Mount::read);
        let above = mounts.filter(|mount| path.starts_with(mount.folder));
        above.max_by_key(|mount| mount.folder.len())
    }
}

pub(super) fn shared_memory(files: &Files) -> Vec<Finding> {
    let check = "shared memory";
    let Some(mounts) = files.text(MOUNTS) else { return Vec::new() };
    if mounts.lines().any(|line| Mount::read(line).is_none()) {
        return vec![unreadable(check, MOUNTS, &mounts, "a mounted folder in each line")];
    }
    let mut findings = Vec::new();
    let mount = Mount::of(&mounts, Path::new(SHARED_MEMORY));
    match mount.filter(|mount| mount.folder == SHARED_MEMORY) {
        None => findings.push(Finding::new(
            check,
            "nothing is mounted at /dev/shm",
            "a tmpfs",
            "`mount -t tmpfs -o mode=1777 tmpfs /dev/shm`",
        )),
        Some(Mount { file_system, options, .. }) => {
            if file_system != "tmpfs" || options.split(',').any(|option| option == "ro") {
                findings.push(Finding::new(
                    check,
                    format!("/dev/shm is mounted as {file_system},{options}"),
                    "a tmpfs that can be written",
                    "`mount -o remount,rw /dev/shm`, or a tmpfs in its place",
                ));
            }
        }
    }
    if let Some(folder) = files.metadata("dev/shm") {
        let owner = folder.uid();
        let mode = folder.mode() & 0o7777;
        if owner != 0 || mode != SHARED_BY_OWNERS {
            findings.push(Finding::new(
                check,
                format!("/dev/shm belongs to user {owner}, mode {mode:o}"),
                "root, mode 1777",
                "`chown root /dev/shm; chmod 1777 /dev/shm`: others could remove a server's files",
            ));
        }
    }
    findings
}

pub(super) fn free_space(files: &Files) -> Vec<Finding> {
    let Ok(space) = rustix::fs::statvfs(files.path("dev/shm")) else { return Vec::new() };
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

pub(super) fn runtime_folder(files: &Files) -> Vec<Finding> {
    if !files.is_machine() {
        return Vec::new();
    }
    let domain = match Domain::of_user() {
        Ok(domain) => domain,
        Err(error) => {
            let help = "servers and clients would end with the same words";
            return vec![Finding::new("runtime folder", error.to_string(), "no error", help)];
        }
    };
    let user = rustix::process::geteuid().as_raw();
    fs::symlink_metadata(domain.root()).map_or_else(
        |_| Vec::new(),
        |folder| judge_folder(domain.root(), folder.uid(), folder.mode() & 0o7777, user),
    )
}

fn judge_folder(path: &Path, owner: u32, mode: u32, user: u32) -> Vec<Finding> {
    if owner == user && mode & 0o077 == 0 {
        return Vec::new();
    }
    let path = path.display();
    vec![Finding::new(
        "runtime folder",
        format!("{path} belongs to user {owner}, mode {mode:o}"),
        format!("user {user}, mode 700"),
        format!("`chmod 700 {path}`, or another folder in SARRUS_ROOT"),
    )]
}

/// The file system of the domain's folder, or of the folder in which it would be made.
pub(super) fn file_system(files: &Files) -> Vec<Finding> {
    let domain = files.is_machine().then(Domain::of_user).and_then(Result::ok);
    let Some((domain, mounts)) = domain.zip(files.text(MOUNTS)) else { return Vec::new() };
    let made = domain.root().ancestors().find(|folder| folder.is_dir());
    let Some(folder) = made.and_then(|folder| folder.canonicalize().ok()) else {
        return Vec::new();
    };
    let Some(mount) = Mount::of(&mounts, &folder) else { return Vec::new() };
    judge_file_system(domain.root(), mount.file_system, || trial(&folder).ok())
}

fn judge_file_system(
    root: &Path,
    name: &str,
    trial: impl FnOnce() -> Option<[Duration; 2]>,
) -> Vec<Finding> {
    let help = match name {
        "tmpfs" | "ramfs" => return Vec::new(),
        "overlay" | "aufs" => {
            "an image's layers are slow; in a container `--tmpfs /run/sarrus` is another"
        }
        name if name.starts_with("fuse") || REMOTE.contains(&name) => {
            "sockets and locks may not work there at all"
        }
        _ => "a client that attaches waits for some ten such files",
    };
    let took = trial().map_or_else(String::new, |[median, worst]| {
        format!(", where a small file is made and synced in {median:.0?}, at worst {worst:.0?}")
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

/// Median and longest time in which a small file is made, synced and removed.
fn trial(folder: &Path) -> io::Result<[Duration; 2]> {
    let path = folder.join(format!("sarrus-doctor-{}", std::process::id()));
    let mut times = [Duration::ZERO; TRIALS];
    for time in &mut times {
        let start = Instant::now();
        let mut file = fs::File::create_new(&path)?;
        // as the transport writes its files
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
    use super::super::tests::judge;
    use super::*;

    #[test]
    fn shared_memory_is_a_tmpfs_that_can_be_written() {
        let mounts = |text| judge(shared_memory, &[("proc/self/mounts", text)]);
        assert_eq!(mounts("tmpfs /dev/shm tmpfs rw,nosuid,nodev,noexec 0 0\n"), [""; 0]);
        let found = mounts("tmpfs /dev/shm tmpfs rw 0 0\ntmpfs /dev/shm tmpfs ro,nosuid 0 0\n");
        assert!(found[0].starts_with("shared memory: /dev/shm is mounted as tmpfs,ro,nosuid"));
        assert!(mounts("proc /proc proc rw 0 0\n")[0].contains("nothing is mounted at /dev/shm"));
        assert_eq!(mounts("ext4 /dev/shm ext4 rw 0 0\n").len(), 1);
        assert!(mounts("what is this\n")[0].contains("reads `what is this`"));
        assert_eq!(judge(shared_memory, &[]), [""; 0]);
    }

    #[test]
    fn anybody_could_remove_files_from_a_folder_without_the_sticky_bit() {
        let mounted = ("proc/self/mounts", "tmpfs /dev/shm tmpfs rw 0 0");
        let found = judge(shared_memory, &[mounted, ("dev/shm/file", "")]);
        assert!(found[0].contains("expected root, mode 1777;"), "{found:?}");
    }

    #[test]
    fn little_room_is_a_finding() {
        assert_eq!(judge_space(ROOM, 1 << 30), []);
        let found = judge_space(5 << 20, 64 << 20);
        assert_eq!(found[0].found, "5 of 64 MiB in /dev/shm");
        assert_eq!(judge(free_space, &[]), [""; 0]);
    }

    #[test]
    fn the_folder_is_its_users_alone() {
        let judge = |owner, mode| judge_folder(Path::new("/run/user/7/sarrus"), owner, mode, 7);
        assert_eq!(judge(7, 0o700), []);
        assert_eq!(judge(7, 0o755).len(), 1);
        assert_eq!(judge(8, 0o700)[0].found, "/run/user/7/sarrus belongs to user 8, mode 700");
    }

    #[test]
    fn the_deepest_mount_above_a_path_is_its_own() {
        // a container may mount its root after the folders in it
        let mounts = "p /proc proc rw 0 0\nb /run tmpfs rw 0 0\nc /run/user/7 fuse rw 0 0\n\
            a / ext4 rw 0 0\nd / xfs rw 0 0\n";
        let name = |path: &str| Mount::of(mounts, Path::new(path)).unwrap().file_system;
        assert_eq!(["/proc/x", "/run/x", "/run/user/7/x"].map(name), ["proc", "tmpfs", "fuse"]);
        assert_eq!(name("/tmp"), "xfs");
    }

    #[test]
    fn a_file_system_outside_of_memory_is_named_with_its_time_and_the_remedy() {
        let judge = |name| {
            let times = [Duration::from_micros(31), Duration::from_millis(4)];
            let found = judge_file_system(Path::new("/tmp/sarrus-7"), name, || Some(times));
            found.iter().map(super::super::line).collect::<String>()
        };
        assert_eq!([judge("tmpfs"), judge("ramfs")], ["", ""]);
        let disk = judge("ext4");
        assert!(disk.starts_with(
            "file system: /tmp/sarrus-7 lies on ext4, where a small file is made and synced in \
             31µs, at worst 4ms, expected memory (tmpfs); a folder in memory for server and clients"
        ));
        assert!(disk.contains("SARRUS_ROOT=/dev/shm/sarrus-"), "{disk}");
        assert!(judge("nfs").contains("on nfs") && judge("nfs").contains("locks may not work"));
        assert!(judge("overlay").contains("`--tmpfs /run/sarrus`"));
        assert!(judge("fuse.sshfs").contains("locks may not work"));
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
