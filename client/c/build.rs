//! Gives the shared library its soname: `libsarrus.so.` and SARRUS_ABI_VERSION of the header. A
//! program that has to be compiled again is then refused by the loader.

use std::io::{Error, Result};

const HEADER: &str = "include/sarrus.h";

fn main() -> Result<()> {
    println!("cargo::rerun-if-changed={HEADER}");
    let header = std::fs::read_to_string(HEADER)?;
    let line = header.lines().find_map(|line| line.strip_prefix("#define SARRUS_ABI_VERSION "));
    let version = line.ok_or_else(|| Error::other("sarrus.h has no SARRUS_ABI_VERSION"))?;
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libsarrus.so.{version}");
    }
    Ok(())
}
