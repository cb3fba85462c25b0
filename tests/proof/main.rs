//! The proof in one binary, so that it links once.
// the symbols of the equations
#![allow(non_snake_case)]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    missing_docs,
    reason = "a test that fails panics"
)]

mod actuators;
mod agreement;
mod allocation;
mod assembly;
mod batches;
mod bounded;
mod c;
mod can;
mod closures;
mod commands;
mod conditions;
mod derivatives;
mod determinism;
mod documents;
mod duals;
mod energy;
mod examples;
mod exported;
mod failures;
mod forward;
mod generated;
mod geometry;
mod gradients;
mod hyrodyn;
mod implicit;
mod laws;
mod layers;
mod links;
mod motions;
mod motors;
mod observer;
mod pairs;
mod parameters;
mod parts;
mod published;
mod python;
mod reduction;
mod regressions;
mod safeguards;
mod scaling;
mod seeds;
mod simulation;
mod springs;
mod targets;
mod tasks;
mod timing;
mod tolerance;
mod tutorial;
mod vectors;
mod wire;
