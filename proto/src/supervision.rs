//! A supervisor's notice to clients that it has given up a server: one small file.
//!
//! `ROOT/server/NAME/state` holds a JSON object with `state` (`given_up`), `reason` and `at_unix`;
//! the next start that succeeds removes it.

use std::fs::{self, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::process::geteuid;
use serde::{Deserialize, Serialize};

use crate::ServerName;
use crate::domain::{make_folder, make_root};

/// Longer than any reason.
const MAX_BYTES: u64 = 16_384;

#[derive(Serialize, Deserialize)]
struct State {
    state: String,
    reason: String,
    at_unix: u64,
}

/// The reason why the supervisor has given up a server; none if it has not.
pub fn given_up(root: &Path, name: &ServerName) -> Option<String> {
    let path = folder(root, name).join("state");
    // accepts only a regular file of this user, no link or pipe
    let mut options = OpenOptions::new();
    let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
    let file = options.read(true).custom_flags(flags.bits() as i32).open(path).ok()?;
    let metadata = file.metadata().ok()?;
    if !metadata.is_file() || metadata.uid() != geteuid().as_raw() {
        return None;
    }
    let mut text = String::new();
    file.take(MAX_BYTES).read_to_string(&mut text).ok()?;
    let state: State = serde_json::from_str(&text).ok()?;
    (state.state == "given_up").then_some(state.reason)
}

/// Records that the supervisor has given up a server, with the time in seconds since 1970.
///
/// # Errors
/// The folder or the file cannot be made.
pub fn give_up(root: &Path, name: &ServerName, reason: &str, at_unix: u64) -> io::Result<()> {
    let folder = folder(root, name);
    make_root(root)?;
    make_folder(&folder)?;
    let reason = reason.chars().take(1000).collect();
    let state = State { state: "given_up".to_owned(), reason, at_unix };
    let text = serde_json::to_string(&state).map_err(io::Error::other)?;

    // atomically
    let [temporary, path] =
        [format!("state.{}", std::process::id()), "state".to_owned()].map(|name| folder.join(name));
    let _ = fs::remove_file(&temporary);
    let mut options = OpenOptions::new();
    let written = options
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&temporary)
        .and_then(|mut file| writeln!(file, "{text}"))
        .and_then(|()| fs::rename(&temporary, path));
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Removes the notice, as a server runs, and folders that become empty.
pub fn clear(root: &Path, name: &ServerName) {
    let folder = folder(root, name);
    if fs::remove_file(folder.join("state")).is_ok() {
        let _ = fs::remove_dir(&folder).and_then(|()| fs::remove_dir(root.join("server")));
    }
}

/// The folder of a server.
fn folder(root: &Path, name: &ServerName) -> PathBuf {
    root.join("server").join(name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::DirBuilder;
    use std::os::unix::fs::DirBuilderExt;

    fn with_root(test: impl FnOnce(&Path, &ServerName)) {
        let root = std::env::temp_dir().join(format!(
            "sarrus-supervision-{}-{:?}",
            std::process::id(),
            std::thread::current().id()
        ));
        DirBuilder::new().mode(0o700).create(&root).unwrap();
        test(&root, &ServerName::new("arm").unwrap());
        let _ = fs::remove_dir_all(&root);
    }

    #[test]
    fn a_reason_is_read_until_a_server_runs_again() {
        with_root(|root, name| {
            assert_eq!(given_up(root, name), None);
            give_up(root, name, "robot.urdf:3:1: no \"mass\"", 1_800_000_000).unwrap();
            assert_eq!(given_up(root, name).as_deref(), Some("robot.urdf:3:1: no \"mass\""));
            let text = fs::read_to_string(root.join("server/arm/state")).unwrap();
            let expected = "{\"state\":\"given_up\",\"reason\":\"robot.urdf:3:1: no \\\"mass\\\"\",\
                            \"at_unix\":1800000000}\n";
            assert_eq!(text, expected);
            // a later one replaces it, and no reason is too long to be read again
            give_up(root, name, &"ä\"".repeat(2000), 1_800_000_001).unwrap();
            assert_eq!(given_up(root, name).map(|reason| reason.chars().count()), Some(1000));
            clear(root, name);
            assert_eq!(given_up(root, name), None);
            assert_eq!(fs::read_dir(root).unwrap().count(), 0);
        });
    }

    #[test]
    fn the_folder_of_a_running_server_stays() {
        with_root(|root, name| {
            give_up(root, name, "reason", 0).unwrap();
            fs::write(root.join("server/arm/lock"), "").unwrap();
            clear(root, name);
            assert!(root.join("server/arm/lock").exists());
            let mode = fs::metadata(root.join("server/arm")).unwrap().mode();
            assert_eq!(mode & 0o777, 0o700);
        });
    }

    #[test]
    fn damaged_files_links_and_pipes_say_nothing() {
        with_root(|root, name| {
            give_up(root, name, "reason", 0).unwrap();
            let path = root.join("server/arm/state");
            for damaged in ["", "{", "[]", "{\"state\":\"fine\",\"reason\":\"\",\"at_unix\":0}"] {
                fs::write(&path, damaged).unwrap();
                assert_eq!(given_up(root, name), None, "{damaged}");
            }
            let other = root.join("other");
            fs::write(&other, "{\"state\":\"given_up\",\"reason\":\"x\",\"at_unix\":0}").unwrap();
            fs::remove_file(&path).unwrap();
            std::os::unix::fs::symlink(&other, &path).unwrap();
            assert_eq!(given_up(root, name), None);
            fs::remove_file(&path).unwrap();
            // a child process would hold the locks of other tests until it runs
            let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
            let kind = rustix::fs::FileType::Fifo;
            rustix::fs::mknodat(rustix::fs::CWD, &path, kind, mode, 0).unwrap();
            assert_eq!(given_up(root, name), None);
            assert!(ServerName::new("..").is_err(), "a folder of no server");
        });
    }
}
