//! Helpers of the tests: reference data, errors relative to size, running plans, random robots.
// the symbols of the equations
#![allow(non_snake_case)]
#![allow(clippy::panic, reason = "a test that fails panics")]

pub mod cases;
pub mod compare;
pub mod decimal;
pub mod draft;
pub mod dual;
pub mod pairs;
pub mod path;
pub mod plans;
pub mod python;
pub mod random;
pub mod reference;
pub mod rigid;
pub mod run;
pub mod seed;
pub mod small;
