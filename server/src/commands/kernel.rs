//! `--kernel`: the code that answers queries. The bits of the answers are the same.

use std::convert::Infallible;
use std::path::PathBuf;
use std::str::FromStr;

/// The value of `--kernel`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum KernelFlag {
    /// The generic kernels alone.
    None,
    /// Generated kernels, where they can be made.
    Auto,
    /// One generated kernel; a file called `auto` is `./auto`.
    File(PathBuf),
}

impl FromStr for KernelFlag {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<KernelFlag, Infallible> {
        Ok(match text {
            "none" => KernelFlag::None,
            "auto" => KernelFlag::Auto,
            path => KernelFlag::File(path.into()),
        })
    }
}
