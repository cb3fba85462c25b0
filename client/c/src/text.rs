//! Names as C sees them: bytes that end with a zero.

use core::ffi::{CStr, c_char};
use core::ptr::null;

use std::ffi::CString;

/// Longest name of a table, with its zero.
const LONGEST: usize = 40;

/// A name that is known at compile time.
#[derive(Clone, Copy)]
pub(crate) struct Name([u8; LONGEST]);

impl Name {
    const EMPTY: Name = Name([0; LONGEST]);

    /// The name, cut where it is too long.
    pub(crate) const fn of(name: &str) -> Name {
        let from = name.as_bytes();
        let mut into = Name::EMPTY;
        let mut i = 0;
        while i < from.len() && i + 1 < LONGEST {
            into.0[i] = from[i];
            i += 1;
        }
        into
    }

    /// Where it begins.
    pub(crate) const fn pointer(&'static self) -> *const c_char {
        self.0.as_ptr().cast()
    }
}

/// The table of the names of an enum that travels, by the place of each in `ALL`.
macro_rules! names {
    ($enum:ty) => {{
        const N: usize = <$enum>::ALL.len();
        const TABLE: [$crate::text::Name; N] = {
            let mut table = [$crate::text::Name::of(""); N];
            let mut i = 0;
            while i < N {
                table[i] = $crate::text::Name::of(<$enum>::ALL[i].name());
                i += 1;
            }
            table
        };
        static NAMES: [$crate::text::Name; N] = TABLE;
        &NAMES
    }};
}

pub(crate) use names;

/// The name beside the first key that fits; NULL where none does.
pub(crate) fn find<K>(
    mut table: impl Iterator<Item = (K, &'static CStr)>,
    fits: impl Fn(K) -> bool,
) -> *const c_char {
    table.find_map(|(key, name)| fits(key).then_some(name.as_ptr())).unwrap_or(null())
}

/// Names as a handle keeps them; a zero inside one, which no file can have, would leave it empty.
pub(crate) fn kept<'a>(names: impl IntoIterator<Item = &'a String>) -> Box<[CString]> {
    names.into_iter().map(|name| CString::new(name.as_str()).unwrap_or_default()).collect()
}
