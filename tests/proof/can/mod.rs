//! The CAN bridge as a whole: processes, peers from PyPI, the Python package.

mod python;
