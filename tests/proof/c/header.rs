//! The header agrees with cbindgen's output and with the exports of the library.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Command;

use super::{folder, libraries, soname};

/// Version of cbindgen that writes the committed header.
const CBINDGEN: &str = "0.29.4";

fn header() -> String {
    std::fs::read_to_string(folder().join("include/sarrus.h")).unwrap()
}

/// Functions declared in the header.
fn declared() -> BTreeSet<String> {
    let header = header();
    let code = header.lines().filter(|line| !line.starts_with(" *"));
    let name = |line: &str| {
        let (before, _) = line.split_once('(')?;
        let name = before.rsplit([' ', '*']).next()?;
        name.starts_with("sarrus_").then(|| name.to_owned())
    };
    code.filter_map(name).collect()
}

/// Exported functions in the sources.
fn defined() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder().join("src")).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        for function in text.split("no_mangle)]").skip(1) {
            let (_, name) = function.split_once("fn ").unwrap();
            found.insert(name.split('(').next().unwrap().to_owned());
        }
    }
    found
}

#[test]
fn the_header_declares_what_the_library_exports_and_nothing_else() {
    let declared = declared();
    let defined = defined();
    assert!(declared.len() > 40, "{declared:?}");
    assert_eq!(declared, defined);
    let library = libraries().join("libsarrus.so");
    match Command::new("nm").args(["-D", "--defined-only"]).arg(library).output() {
        Ok(output) => {
            let symbols = String::from_utf8(output.stdout).unwrap();
            let exported: BTreeSet<String> = symbols
                .lines()
                .filter_map(|line| line.rsplit(' ').next())
                .filter(|name| name.starts_with("sarrus_"))
                .map(str::to_owned)
                .collect();
            assert_eq!(exported, declared);
        }
        Err(_) => println!("not run: nm is missing"),
    }
}

#[test]
fn the_soname_is_the_version_of_the_interface() {
    let library = libraries().join("libsarrus.so");
    match Command::new("readelf").arg("-d").arg(library).output() {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stdout);
            assert!(text.contains(&format!("[{}]", soname())), "{text}");
        }
        Err(_) => println!("not run: readelf is missing"),
    }
}

/// cbindgen of the right version: `SARRUS_CBINDGEN`, the one on PATH, or the one that `.ci/run
/// prepare` builds beside this build.
fn cbindgen() -> Option<PathBuf> {
    let is_right = |path: &PathBuf| {
        let output = Command::new(path).arg("--version").output();
        output.is_ok_and(|output| {
            String::from_utf8_lossy(&output.stdout).trim() == format!("cbindgen {CBINDGEN}")
        })
    };
    let target = libraries().ancestors().find(|path| path.join("CACHEDIR.TAG").exists())?.join("c");
    let built = target.join("bin/cbindgen");
    let named = std::env::var_os("SARRUS_CBINDGEN").map_or("cbindgen".into(), PathBuf::from);
    [named, built].into_iter().find(is_right)
}

#[test]
fn the_header_is_what_cbindgen_writes() {
    let Some(cbindgen) = cbindgen() else {
        println!("not run: no cbindgen {CBINDGEN} (.ci/run prepare builds it)");
        return;
    };
    let written = std::env::temp_dir().join(format!("sarrus-{}.h", std::process::id()));
    let script = folder().join("header.sh");
    let status = Command::new(script).arg(&written).env("SARRUS_CBINDGEN", cbindgen).status();
    assert!(status.unwrap().success());
    let text = std::fs::read_to_string(&written).unwrap();
    let _ = std::fs::remove_file(&written);
    let first = text.lines().zip(header().lines().map(str::to_owned)).find(|(a, b)| a != b);
    assert!(text == header(), "run client/c/header.sh; the first difference: {first:?}");
}
