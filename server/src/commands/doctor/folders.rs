//! Where shared memory and sockets live: room, owners, and who clears them away.

use std::os::unix::fs::MetadataExt;
use std::path::Path;

use sarrus_proto::Domain;

use super::Finding;
use super::files::{Files, unreadable};

/// Room in bytes that a server with some clients needs.
const ROOM: u64 = 64 << 20;
/// The write bit of everybody else, and the bit that keeps files their owners'.
const SHARED_BY_OWNERS: u32 = 0o1777;

/// The options of a mounted folder, its kind first.
fn mount(mounts: &str, folder: &str) -> Option<String> {
    // the last one covers the others
    mounts.lines().rev().find_map(|line| {
        let mut words = line.split_whitespace().skip(1);
        (words.next()? == folder).then(|| words.take(2).collect::<Vec<_>>().join(","))
    })
}

pub(super) fn shared_memory(files: &Files) -> Vec<Finding> {
    let check = "shared memory";
    let path = "proc/self/mounts";
    let Some(mounts) = files.text(path) else { return Vec::new() };
    if mounts.lines().any(|line| line.split_whitespace().count() < 4) {
        return vec![unreadable(check, path, &mounts, "a mounted folder in each line")];
    }
    let mut findings = Vec::new();
    match mount(&mounts, "/dev/shm") {
        None => findings.push(Finding::new(
            check,
            "nothing is mounted at /dev/shm",
            "a tmpfs",
            "`mount -t tmpfs -o mode=1777 tmpfs /dev/shm`",
        )),
        Some(options) => {
            let has = |option| options.split(',').any(|one| one == option);
            if !has("tmpfs") || has("ro") {
                findings.push(Finding::new(
                    check,
                    format!("/dev/shm is mounted as {options}"),
                    "a tmpfs that can be written",
                    "`mount -o remount,rw /dev/shm`, or a tmpfs in its place",
                ));
            }
        }
    }
    if let Some(folder) = files.metadata("dev/shm") {
        let (owner, mode) = (folder.uid(), folder.mode() & 0o7777);
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
    let folder = std::fs::symlink_metadata(domain.root());
    let findings = folder.map_or_else(
        |_| Vec::new(),
        |folder| judge_folder(domain.root(), folder.uid(), folder.mode() & 0o7777, user),
    );
    // looking leaves nothing
    domain.tidy();
    findings
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

pub(super) fn cleaner(files: &Files) -> Vec<Finding> {
    let root = match Domain::of_user() {
        Ok(domain) => {
            domain.tidy();
            domain.root().to_owned()
        }
        Err(_) => return Vec::new(),
    };
    // a file of the administrator's takes the place of the system's with the same name
    let folders = ["etc/tmpfiles.d", "run/tmpfiles.d", "usr/lib/tmpfiles.d"];
    let mut texts: Vec<(String, String)> = Vec::new();
    for folder in folders {
        for name in files.names(folder).into_iter().filter(|name| name.ends_with(".conf")) {
            if texts.iter().all(|(known, _)| *known != name) {
                let text = files.text(&format!("{folder}/{name}")).unwrap_or_default();
                texts.push((name, text));
            }
        }
    }
    let texts: Vec<String> = texts.into_iter().map(|(_, text)| text).collect();
    judge_cleaner(&root, &texts)
}

/// Whether a line of systemd-tmpfiles clears a folder below which the root is, by age.
fn judge_cleaner(root: &Path, texts: &[String]) -> Vec<Finding> {
    let lines = || {
        texts.iter().flat_map(|text| text.lines()).filter_map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let (kind, path) = (words.first()?, words.get(1)?);
            (!kind.starts_with('#')).then(|| (kind.chars().next(), *path, words.get(5).copied()))
        })
    };
    let root_text = root.to_string_lossy();
    let is_spared = lines().any(|(kind, path, _)| {
        matches!(kind, Some('x' | 'X'))
            && match path.strip_suffix('*') {
                Some(start) => root_text.starts_with(start),
                None => root_text == path,
            }
    });
    let clears = |(kind, path, age): (Option<char>, &str, Option<&str>)| {
        let is_folder = matches!(kind, Some('d' | 'D' | 'e' | 'q' | 'Q' | 'v'));
        let age = age.filter(|age| is_folder && *age != "-" && *age != "0")?;
        (path != "/" && root.starts_with(path)).then(|| (path.to_owned(), age.to_owned()))
    };
    let Some((path, age)) = lines().find_map(clears).filter(|_| !is_spared) else {
        return Vec::new();
    };
    vec![Finding::new(
        "cleaner",
        format!("systemd-tmpfiles removes from {path} what is older than {age}"),
        format!("{root_text} left alone"),
        format!(
            "a line `x {root_text}*` in /etc/tmpfiles.d/sarrus.conf, or a folder elsewhere in \
             SARRUS_ROOT"
        ),
    )]
}

#[cfg(test)]
mod tests {
    use super::super::files::tests::judge;
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
    fn a_cleaner_of_a_folder_above_is_found_unless_it_spares_ours() {
        let judge = |root: &str, texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
            judge_cleaner(Path::new(root), &texts)
        };
        let system = "# comment\nq /tmp 1777 root root 10d\nq /var/tmp 1777 root root 30d\n";
        let found = judge("/tmp/sarrus-7", &[system]);
        assert_eq!(found[0].found, "systemd-tmpfiles removes from /tmp what is older than 10d");
        assert_eq!(judge("/tmp/sarrus-7", &[system, "x /tmp/sarrus-*\n"]), []);
        assert_eq!(judge("/run/user/7/sarrus", &[system]), []);
        assert_eq!(judge("/tmp/sarrus-7", &["D /tmp 1777 root root -\n"]), []);
        assert_eq!(judge("/tmp/sarrus-7", &["q /tmp", "", "\u{0}\n1 2 3 4 5 6 7"]), []);
    }

    #[test]
    fn the_administrators_file_takes_the_place_of_the_systems() {
        let files = [
            ("usr/lib/tmpfiles.d/tmp.conf", "q /tmp 1777 root root 10d\nq / 0755 - - 1d\n"),
            ("etc/tmpfiles.d/tmp.conf", "q /tmp 1777 root root -\n"),
        ];
        assert_eq!(judge(cleaner, &files), [""; 0]);
    }
}
