/// Double-double.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Dd { pub(crate) hi: f64, pub(crate) lo: f64 }
