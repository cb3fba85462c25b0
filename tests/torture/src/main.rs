//! The program `torture`; everything is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    sarrus_torture::main()
}
