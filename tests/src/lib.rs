//! What the tests share: reference data, comparison by size, running plans, random robots.

pub mod compare;
pub mod reference;
pub mod run;
