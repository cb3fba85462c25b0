//! Commands with unusual streams or files.

use std::io::Write;
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::{Folder, Run, run, sarrus};

const LINE: &[u8] = b"{\"y\": [0.1], \"want\": [\"q\"]}\n";
const ASK: [&str; 4] = ["ask", "kinematics", "--robot", "lambda"];

#[test]
fn answers_that_go_nowhere_are_an_error() {
    // opened only for reading, and a full device
    for stdout in ["1</dev/null", ">/dev/full"] {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec \"$0\" \"$@\" {stdout}")]).arg(sarrus());
        let asked = Run::of(shell.args(ASK), LINE);
        assert_eq!(asked.code, Some(2), "{stdout}: {asked:?}");
        assert!(asked.err.contains("the answers cannot be written"), "{stdout}: {asked:?}");
    }
    // answers may be discarded
    let mut shell = Command::new("sh");
    shell.args(["-c", "exec \"$0\" \"$@\" >/dev/null"]).arg(sarrus());
    assert_eq!(Run::of(shell.args(ASK), LINE).code, Some(0));
}

#[test]
fn a_stdin_that_does_not_wait_is_waited_for() {
    let (mut there, here) = UnixStream::pair().unwrap();
    here.set_nonblocking(true).unwrap();
    let mut command = Command::new(sarrus());
    command.args(ASK).stdin(OwnedFd::from(here)).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    // keeps only the command's copy
    drop(command);
    for half in LINE.chunks(12) {
        std::thread::sleep(Duration::from_millis(50));
        there.write_all(half).unwrap();
    }
    drop(there);
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), words.as_str()), (Some(0), ""));
    assert_eq!(output.stdout, run(&ASK, LINE).out.as_bytes());
}

#[test]
fn a_byte_order_mark_before_the_first_line_is_skipped() {
    let asked = run(&ASK, &[&b"\xef\xbb\xbf"[..], LINE].concat());
    assert_eq!((asked.code, asked.statuses()), (Some(0), vec!["ok".to_owned()]), "{asked:?}");
    let later = run(&ASK, &[LINE, &b"\xef\xbb\xbf"[..], LINE].concat());
    assert_eq!(later.statuses(), ["ok", "bad_request"], "{later:?}");
}

#[test]
fn pages_of_the_manual_are_written_over_nothing() {
    let folder = Folder::new("man-twice");
    let pages = folder.0.join("man1");
    std::fs::create_dir(&pages).unwrap();
    let files = || std::fs::read_dir(&pages).unwrap().count();
    let man = || run(&["man", pages.to_str().unwrap()], b"");
    // not through a link either, and no other page remains
    let elsewhere = folder.0.join("elsewhere");
    symlink(&elsewhere, pages.join("sarrus-tidy.1")).unwrap();
    let refused = man();
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.err.contains("sarrus-tidy.1 cannot be written"), "{refused:?}");
    assert!(!elsewhere.exists() && files() == 1);
    std::fs::remove_file(pages.join("sarrus-tidy.1")).unwrap();

    let done = man();
    assert_eq!((done.code, done.out.lines().count()), (Some(0), files()), "{done:?}");
    assert!(done.out.lines().all(|page| Path::new(page).exists()));
    let page = pages.join("sarrus.1");
    let all = files();
    std::fs::write(&page, "somebody's").unwrap();
    assert_eq!((man().code, files()), (Some(2), all));
    assert_eq!(std::fs::read_to_string(page).unwrap(), "somebody's");
}

#[test]
fn a_folder_without_a_name_is_refused() {
    let folder = Folder::new("no-name");
    for arguments in [&["robots", "--export", "lambda", ""][..], &["man", ""]] {
        let mut command = Command::new(sarrus());
        let refused = Run::of(command.args(arguments).current_dir(&folder.0), b"");
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 0, "{arguments:?}");
    }
}

#[test]
fn shells_offer_the_bundled_robots() {
    let script = run(&["completions", "bash"], b"").out;
    let offered =
        script.lines().skip_while(|line| line.trim() != "--robot)").nth(1).unwrap_or_default();
    for robot in ["lambda", "rh5v2_full"] {
        assert!(offered.split([' ', '"']).any(|name| name == robot), "{offered}");
    }
    // the loader refuses other names
    let unknown = run(&["check", "--robot", "lamda"], b"");
    assert!(unknown.err.contains("did you mean `lambda`"), "{unknown:?}");
}

#[test]
fn the_first_page_can_be_pasted_as_one_block() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (_, after) = page.split_once("sarrus robots --export").unwrap();
    // the rest of the block takes long
    let (block, _) = after.split_once("sarrus simulate").unwrap();
    assert!(block.contains("--connect elbow"), "{block}");
    let folder = Folder::new("first-page");
    let programs = sarrus().parent().unwrap().to_str().unwrap();
    let mut shell = Command::new("timeout");
    shell
        .args(["60", "sh", "-ec", &format!("sarrus robots --export{block}\nwait $!")])
        .env("PATH", format!("{programs}:{}", std::env::var("PATH").unwrap()))
        .env("SARRUS_ROOT", folder.0.join("domain"))
        .current_dir(&folder.0);
    let pasted = Run::of(&mut shell, b"");
    assert_eq!(pasted.code, Some(0), "{pasted:?}");
    for part in ["ready elbow", "\"ydd\":[", "\"tau_u\":["] {
        assert!(pasted.out.contains(part), "{part}: {pasted:?}");
    }
}
