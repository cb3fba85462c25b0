//! Clients beside a limit of memory: those that fit are served, further ones get the reason.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use sarrus_client::{Status, Transport};
use sarrus_proto::control::Call;
use sarrus_torture::raw::Raw;

use crate::plans::distinct;
use crate::support::{Asker, ROBOT, Sandbox};

/// A control group of this machine, removed when dropped.
struct Group(PathBuf);

impl Group {
    /// One with a limit of memory; `None` where this user may not make it.
    fn limited(bytes: u64) -> Option<Group> {
        let name = format!("sarrus-test-{}", std::process::id());
        let version_2 = ("/sys/fs/cgroup", "memory.max");
        let version_1 = ("/sys/fs/cgroup/memory", "memory.limit_in_bytes");
        [version_2, version_1].into_iter().find_map(|(tree, file)| {
            let folder = Path::new(tree).join(&name);
            fs::create_dir(&folder).ok()?;
            let group = Group(folder);
            let limit = group.0.join(file);
            (limit.exists() && fs::write(limit, bytes.to_string()).is_ok()).then_some(group)
        })
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.0);
    }
}

#[test]
fn clients_beyond_a_limit_of_memory_are_refused_and_the_server_goes_on() {
    let sandbox = Sandbox::new();
    let Some(group) = Group::limited(34 << 20) else {
        return println!("not run: this user has no control groups with limits");
    };
    let inner = sandbox.command(ROBOT, "tight", &["--lanes", "64"]);
    let mut outer = Command::new("sh");
    outer.args(["-c", "echo $$ > \"$0/cgroup.procs\" && exec \"$@\""]).arg(&group.0);
    outer.arg(inner.get_program()).args(inner.get_args());
    let server = sandbox.start(&mut outer);
    let mut asker = Asker::new(sandbox.connect("tight", Transport::Lane).unwrap());
    let mut raws = Vec::new();
    let mut refused = 0;
    for _ in 0..60 {
        let raw = sandbox.raw("tight");
        for call in [Call::Lane { n_in: 4096, n_out: 16384 }, Call::Batch] {
            let Err(words) = raw.call(call) else { continue };
            let is_known = words.contains("the server's memory is limited by") || words == "NoEnd";
            assert!(is_known, "{words}");
            refused += 1;
        }
        raws.push(raw);
        assert_eq!(asker.ask().unwrap().status, Status::Ok);
    }
    println!("{refused} of 120 calls were refused");
    assert!((40..110).contains(&refused), "{refused}");
    drop(raws);
    assert!(server.stop().success());
}

/// Writes files below a folder.
fn write(folder: &Path, files: &[(&str, &str)]) {
    for (file, text) in files {
        let path = folder.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
}

/// The refusal of each kind of call.
fn refusals(raw: &Raw) -> Vec<Option<String>> {
    let query = Box::new(distinct(1));
    let calls =
        [Call::Plan { query }, Call::Lane { n_in: 16, n_out: 16 }, Call::Batch, Call::Service];
    calls.into_iter().map(|call| raw.call(call).err()).collect()
}

#[test]
fn every_limit_above_counts_in_both_versions_of_control_groups() {
    let sandbox = Sandbox::new();
    let folder = sandbox.make_root().join("groups");
    // 5 MiB are left by the group itself or by one above; caches of files do not count
    let of_version_2 = [
        ("self", "0::/outer/inner\n"),
        ("memory.stat", ""),
        ("outer/memory.max", "104857600\n"),
        ("outer/memory.high", "max\n"),
        ("outer/memory.current", "110100480\n"),
        ("outer/memory.stat", "anon 5\ninactive_file 10485760\nactive_file 0\n"),
        ("outer/inner/memory.max", "max\n"),
        ("outer/inner/memory.high", "1073741824\n"),
        ("outer/inner/memory.current", "110100480\n"),
    ];
    let of_version_1 = [
        ("self", "9:name=systemd:/\n4:cpu,memory:/inner\n0::/\n"),
        ("memory/memory.limit_in_bytes", "9223372036854771712\n"),
        ("memory/inner/memory.limit_in_bytes", "104857600\n"),
        ("memory/inner/memory.usage_in_bytes", "110100480\n"),
        ("memory/inner/memory.stat", "inactive_file 9\ntotal_inactive_file 10485760\n"),
    ];
    let versions: [(&[(&str, &str)], &str, &str); 2] = [
        (&of_version_2, "outer/memory.current", "outer/memory.max"),
        (&of_version_1, "memory/inner/memory.usage_in_bytes", "memory/inner/memory.limit_in_bytes"),
    ];
    for (files, used, limit) in versions {
        write(&folder, files);
        let server = sandbox.serve("limits", &["--cgroups", folder.to_str().unwrap()]);
        let raw = sandbox.raw("limits");
        let [plan, lane, batch, service] = <[_; 4]>::try_from(refusals(&raw)).unwrap();
        assert_eq!([plan, lane, batch], [None, None, None]);
        let words = service.unwrap();
        let said = format!("{} leaves 5120 KiB; 2048 KiB are needed", folder.join(limit).display());
        assert!(words.contains(&said.replace(" leaves", ", which leaves")), "{words}");
        // beyond the limit nothing is granted, and what is held stays
        write(&folder, &[(used, "115343360\n")]);
        let raw = sandbox.raw("limits");
        assert!(refusals(&raw).iter().all(Option::is_some));
        let words = sandbox.connect("limits", Transport::Lane).err().unwrap().to_string();
        assert!(words.contains("the server's memory is limited by"), "{words}");
        write(&folder, &[(used, "1048576\n")]);
        assert_eq!(refusals(&raw), [None, None, None, None]);
        assert!(server.stop().success());
        fs::remove_dir_all(&folder).unwrap();
    }
}
