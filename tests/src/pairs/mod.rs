//! Pairs of features that meet in one robot, drawn from seeds and compared with the equations
//! written down a second time in double-double.

pub mod algebra;
pub mod draw;
pub mod judge;
pub mod oracle;
pub mod text;
