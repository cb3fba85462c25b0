//! `sarrus doctor`: lines, JSON and exit codes.

use std::fs;
use std::process::{Command, Output};

fn doctor(flags: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sarrus")).arg("doctor").args(flags).output().unwrap()
}

#[test]
fn a_finding_is_a_line_with_what_to_do_and_exit_code_1() {
    let root = std::env::temp_dir().join(format!("sarrus-doctor-test-{}", std::process::id()));
    let folder = root.join("sys/kernel/mm/transparent_hugepage");
    fs::create_dir_all(&folder).unwrap();
    let root_flags = ["--root", root.to_str().unwrap()];

    fs::write(folder.join("enabled"), "[always] madvise never\n").unwrap();
    let output = doctor(&root_flags);
    let words = String::from_utf8(output.stdout).unwrap();
    assert_eq!((output.status.code(), output.stderr.len()), (Some(1), 0), "{words}");
    assert_eq!(words.lines().count(), 1, "{words}");
    assert!(words.starts_with("huge pages: always: "), "{words}");
    assert!(words.contains("; `echo madvise > /sys/"), "{words}");

    let output = doctor(&[&root_flags[..], &["--format", "json"]].concat());
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(object["findings"][0]["check"], "huge pages");
    assert!(object["checks"].as_u64().unwrap() >= 8);

    fs::write(folder.join("enabled"), "always [madvise] never\n").unwrap();
    let output = doctor(&root_flags);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(0), 0), "{output:?}");
    fs::remove_dir_all(&root).unwrap();
    assert_eq!(doctor(&["--fromat", "json"]).status.code(), Some(2));
    // any machine has a list of findings
    assert!(matches!(doctor(&[]).status.code(), Some(0 | 1)));
}

#[test]
fn a_folder_that_is_not_in_memory_is_named() {
    let found = |root: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus"));
        let output = command.arg("doctor").env("SARRUS_ROOT", root).output().unwrap();
        let words = String::from_utf8(output.stdout).unwrap();
        let line = words.lines().find(|line| line.starts_with("file system: "));
        line.map(str::to_owned)
    };
    let line = found("/proc/sarrus").unwrap();
    assert!(line.starts_with("file system: /proc/sarrus lies on proc, "), "{line}");
    assert!(line.contains("SARRUS_ROOT=/dev/shm/sarrus-"), "{line}");
    let is_memory = fs::read_to_string("/proc/self/mounts")
        .is_ok_and(|mounts| mounts.lines().any(|line| line.contains(" /dev/shm tmpfs ")));
    if is_memory {
        let root = format!("/dev/shm/sarrus-doctor-test-{}", std::process::id());
        assert_eq!(found(&root), None);
        // the check leaves no files
        assert!(!fs::exists(root).unwrap());
    }
}
