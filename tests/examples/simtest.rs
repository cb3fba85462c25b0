#![allow(non_snake_case, dead_code, unused)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#[path = "../proof/derivatives.rs"]
mod derivatives;
#[path = "../proof/published/mod.rs"]
mod published;
#[path = "../proof/simulation/mod.rs"]
mod simulation;
fn main() {}
