//! Why a call failed, and the text of it that stays with the thread.

use core::cell::RefCell;
use core::ffi::c_char;
use core::fmt::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use sarrus_client::{Error, LoadError, Status};

use crate::status::{OwnStatus, StatusCode};

/// Longest text of an error, with its zero `[byte]`; longer ones are cut.
const LONGEST: usize = 8192;
/// The end mark of a truncated text.
const CUT: &str = " ...";

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// An argument is NULL.
    #[error("`{0}` is NULL")]
    Null(&'static str),
    /// An argument is not aligned.
    #[error("`{0}` is not aligned for what it points to")]
    Unaligned(&'static str),
    /// An array that cannot be: more numbers than memory has addresses.
    #[error("`{0}` has more numbers than there is memory")]
    Endless(&'static str),
    /// An output and another array.
    #[error("`{0}` overlaps `{1}`; outputs need memory of their own")]
    Overlap(&'static str, &'static str),
    /// A text that cannot be read.
    #[error("`{0}`: {1}")]
    Text(&'static str, String),
    /// An enum, and the number found in its place.
    #[error("{1} is no {0} of this version")]
    Number(&'static str, u32),
    /// A name of a field that a plan does not have.
    #[error("`{0}` is no field of this plan")]
    NoField(String),
    /// A place in a list: the kind of entry, the place, and the number of entries.
    #[error("there is no {0} {1}; this robot has {2}, counted from 0")]
    Place(&'static str, usize, usize),
    /// There is no memory for these.
    #[error("there is no memory for {0}; ask for fewer at a time")]
    NoMemory(&'static str),
    #[error(transparent)]
    Load(LoadError),
    #[error(transparent)]
    Ask(Error),
    #[error("nothing new came since the last call")]
    NothingNew,
    #[error("the command could not be sent; see whether the bridge runs, and connect again")]
    NotSent,
    #[error("this processor lacks {0}; build libsarrus with the feature `portable`")]
    Processor(&'static str),
    #[error("a fault inside libsarrus; free the handle, and please report what led to it")]
    Internal,
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Failure {
        Failure::Ask(error.into())
    }
}

impl Failure {
    pub(crate) fn status(&self) -> StatusCode {
        StatusCode(match self {
            Failure::Null(_) => OwnStatus::NullPointer as i32,
            Failure::Unaligned(_) => OwnStatus::UnalignedPointer as i32,
            Failure::Endless(_) => Status::WrongSize as i32,
            Failure::Overlap(..) => OwnStatus::OverlappingArrays as i32,
            Failure::Text(..) => OwnStatus::BadText as i32,
            Failure::Number(..) | Failure::Place(..) => OwnStatus::UnknownNumber as i32,
            Failure::NoField(_) => OwnStatus::UnknownName as i32,
            Failure::NoMemory(_) => OwnStatus::NoMemory as i32,
            Failure::Load(_) => OwnStatus::LoadFailed as i32,
            Failure::Ask(error) => StatusCode::of_error(error).0,
            Failure::NothingNew => OwnStatus::NothingNew as i32,
            Failure::NotSent => OwnStatus::NotSent as i32,
            Failure::Processor(_) => OwnStatus::OldProcessor as i32,
            Failure::Internal => OwnStatus::Internal as i32,
        })
    }
}

thread_local! {
    // without a destructor and with a constant start it needs no allocation of ours
    static LAST: RefCell<[u8; LONGEST]> = const { RefCell::new([0; LONGEST]) };
}

/// The text of this thread's last failure.
pub(crate) fn last() -> *const c_char {
    LAST.with(|text| text.as_ptr().cast_const().cast())
}

/// Writes as much text as fits, and records a truncation.
struct Cursor<'a> {
    text: &'a mut [u8],
    len: usize,
    cut: bool,
}

impl Write for Cursor<'_> {
    fn write_str(&mut self, part: &str) -> fmt::Result {
        let room = LONGEST - 1 - CUT.len() - self.len;
        let n = (0..=part.len().min(room)).rev().find(|n| part.is_char_boundary(*n)).unwrap_or(0);
        self.text[self.len..self.len + n].copy_from_slice(&part.as_bytes()[..n]);
        self.len += n;
        self.cut |= n < part.len();
        if self.cut { Err(fmt::Error) } else { Ok(()) }
    }
}

fn keep(failure: &Failure) {
    LAST.with(|text| {
        // no other borrow can exist: the text is this thread's and released at once
        let Ok(mut text) = text.try_borrow_mut() else { return };
        let mut cursor = Cursor { text: &mut text[..], len: 0, cut: false };
        // an error stands for a text that was cut
        let _ = write!(cursor, "{failure}");
        let Cursor { mut len, cut, .. } = cursor;
        if cut {
            text[len..len + CUT.len()].copy_from_slice(CUT.as_bytes());
            len += CUT.len();
        }
        text[len] = 0;
    });
}

/// Runs one call: an error or a panic becomes its status and a text.
#[inline]
pub(crate) fn guarded(work: impl FnOnce() -> Result<(), Failure>) -> StatusCode {
    let outcome = catch_unwind(AssertUnwindSafe(work)).unwrap_or(Err(Failure::Internal));
    match outcome {
        Ok(()) => StatusCode::OK,
        Err(failure) => {
            keep(&failure);
            failure.status()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text() -> String {
        LAST.with(|text| {
            let text = text.borrow();
            let end = text.iter().position(|byte| *byte == 0).unwrap();
            String::from_utf8(text[..end].to_vec()).unwrap()
        })
    }

    #[test]
    fn a_panic_is_a_status() {
        assert_eq!(guarded(|| panic!("on purpose")).0, OwnStatus::Internal as i32);
        assert!(text().contains("fault inside"));
    }

    #[test]
    fn a_text_that_is_too_long_is_cut_between_letters() {
        for start in 0..3 {
            let why = format!("{}{}", "x".repeat(start), "ä".repeat(LONGEST));
            assert_eq!(guarded(|| Err(Failure::Text("urdf", why))).0, OwnStatus::BadText as i32);
            let text = text();
            assert!(text.ends_with("ä ...") && text.len() > LONGEST - 8, "{}", text.len());
        }
        assert_eq!(guarded(|| Err(Failure::Null("robot"))).0, OwnStatus::NullPointer as i32);
        assert_eq!(text(), "`robot` is NULL");
    }
}
