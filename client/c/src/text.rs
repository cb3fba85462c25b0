//! Names as C sees them: bytes that end with a zero.

use std::ffi::CString;

/// Most bytes of a name of [`name_of`], with its zero.
pub(crate) const LONGEST: usize = 40;

/// The name of a number of an enum that travels, which lives for ever; NULL where it is none.
macro_rules! name_of {
    ($enum:ty, $code:expr) => {{
        use $crate::text::LONGEST;
        static NAMES: [[u8; LONGEST]; <$enum>::ALL.len()] = {
            let mut names = [[0; LONGEST]; <$enum>::ALL.len()];
            let mut i = 0;
            while i < names.len() {
                let name = <$enum>::ALL[i].name().as_bytes();
                assert!(name.len() < LONGEST);
                names[i].split_at_mut(name.len()).0.copy_from_slice(name);
                i += 1;
            }
            names
        };
        let place = <$enum>::ALL.iter().position(|one| *one as u32 == $code);
        place.and_then(|place| NAMES.get(place)).map_or(null(), |name| name.as_ptr().cast())
    }};
}

pub(crate) use name_of;

/// Names as a handle keeps them; a zero inside one, which no file can have, would leave it empty.
pub(crate) fn kept<'a>(names: impl IntoIterator<Item = &'a String>) -> Box<[CString]> {
    names.into_iter().map(|name| CString::new(name.as_str()).unwrap_or_default()).collect()
}
