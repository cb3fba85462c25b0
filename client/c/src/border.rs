//! Pointer arguments: checked, then converted into slices or texts.
//!
//! Handles need nothing of this: the compiler has a reference or a box that may be absent as a
//! pointer that may be NULL.
#![allow(unsafe_code, reason = "C passes pointers and lengths")]

use core::ffi::{CStr, c_char};
use core::mem::MaybeUninit;
use core::ops::Range;
use core::slice;

use crate::failure::{Failure, guarded};
use crate::status::StatusCode;

/// An input array of the caller: its name, its address, its length.
pub(crate) type Given = (&'static str, *const f64, usize);
/// An array of the caller that is written.
pub(crate) type Want = (&'static str, *mut f64, usize);

/// The addresses of an array, or its fault. An array without numbers may be NULL.
fn addresses<T>(name: &'static str, start: *const T, n: usize) -> Result<Range<usize>, Failure> {
    let at = start.addr();
    if n == 0 {
        return Ok(at..at);
    }
    if start.is_null() {
        return Err(Failure::Null(name));
    }
    if !start.is_aligned() {
        return Err(Failure::Unaligned(name));
    }
    let bytes = n.checked_mul(size_of::<T>()).filter(|bytes| *bytes <= isize::MAX as usize);
    match bytes.and_then(|bytes| at.checked_add(bytes)) {
        Some(end) => Ok(at..end),
        None => Err(Failure::Endless(name)),
    }
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start < b.end && b.start < a.end
}

/// The arrays of one call: none is NULL, unaligned or endless, and no output overlaps another.
///
/// # Safety
/// Each array holds the stated number of elements and stays for `'a`; no other code writes the
/// inputs or accesses the outputs meanwhile.
#[inline]
pub(crate) unsafe fn arrays<'a, const I: usize, const O: usize>(
    given: [Given; I],
    want: [Want; O],
) -> Result<([&'a [f64]; I], [&'a mut [f64]; O]), Failure> {
    let mut inputs: [Range<usize>; I] = [const { 0..0 }; I];
    let mut outputs: [Range<usize>; O] = [const { 0..0 }; O];
    for i in 0..I {
        inputs[i] = addresses(given[i].0, given[i].1, given[i].2)?;
    }
    for o in 0..O {
        let range = addresses(want[o].0, want[o].1, want[o].2)?;
        if let Some(i) = inputs.iter().position(|other| overlap(&range, other)) {
            return Err(Failure::Overlap(want[o].0, given[i].0));
        }
        if let Some(other) = outputs[..o].iter().position(|other| overlap(&range, other)) {
            return Err(Failure::Overlap(want[o].0, want[other].0));
        }
        outputs[o] = range;
    }
    let given = given.map(|(_, start, n)| match n {
        0 => &[][..],
        // SAFETY: it is aligned, not NULL and no longer than memory, as just checked; the rest is
        // this function's own condition.
        _ => unsafe { slice::from_raw_parts(start, n) },
    });
    let want = want.map(|(_, start, n)| match n {
        0 => &mut [][..],
        // SAFETY: as above, and no other slice of this call holds any of it.
        _ => unsafe { slice::from_raw_parts_mut(start, n) },
    });
    Ok((given, want))
}

/// Where an array of the caller lies.
pub(crate) fn addresses_of<T>(array: &[T]) -> Range<usize> {
    let range = array.as_ptr_range();
    range.start.addr()..range.end.addr()
}

/// An array that is written beside those of [`arrays`], of which it overlaps none; empty if it is
/// NULL, that is, not wanted.
///
/// # Safety
/// As [`arrays`].
pub(crate) unsafe fn array_beside<'a, T>(
    name: &'static str,
    start: *mut T,
    n: usize,
    others: &[(&'static str, Range<usize>)],
) -> Result<&'a mut [T], Failure> {
    if start.is_null() {
        return Ok(&mut []);
    }
    let range = addresses(name, start, n)?;
    if let Some((other, _)) = others.iter().find(|(_, other)| overlap(&range, other)) {
        return Err(Failure::Overlap(name, other));
    }
    if n == 0 {
        return Ok(&mut []);
    }
    // SAFETY: aligned, not NULL, no longer than memory and apart from the other slices; the rest is
    // this function's own condition.
    Ok(unsafe { slice::from_raw_parts_mut(start, n) })
}

/// A text of the caller.
///
/// # Safety
/// It ends with a zero and stays as it is for `'a`.
pub(crate) unsafe fn text<'a>(
    name: &'static str,
    start: *const c_char,
) -> Result<&'a str, Failure> {
    if start.is_null() {
        return Err(Failure::Null(name));
    }
    // SAFETY: it is not NULL; the rest is this function's own condition.
    let text = unsafe { CStr::from_ptr(start) };
    text.to_str().map_err(|error| Failure::Text(name, error.to_string()))
}

/// A text that may be NULL.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn text_or_none<'a>(
    name: &'static str,
    start: *const c_char,
) -> Result<Option<&'a str>, Failure> {
    if start.is_null() {
        return Ok(None);
    }
    // SAFETY: this function's own condition.
    unsafe { text(name, start) }.map(Some)
}

/// Texts of the caller.
///
/// # Safety
/// The array has the stated length, and each element is as in [`text`].
pub(crate) unsafe fn texts<'a>(
    name: &'static str,
    start: *const *const c_char,
    n: usize,
) -> Result<Vec<&'a str>, Failure> {
    if addresses(name, start, n)?.is_empty() {
        return Ok(Vec::new());
    }
    // SAFETY: aligned, not NULL and no longer than memory; the rest is this function's own
    // condition.
    let starts = unsafe { slice::from_raw_parts(start, n) };
    // SAFETY: this function's own condition.
    starts.iter().map(|start| unsafe { text(name, *start) }).collect()
}

/// Bytes of the caller, such as the contents of a file.
///
/// # Safety
/// The array has the stated length.
pub(crate) unsafe fn bytes<'a>(
    name: &'static str,
    start: *const c_char,
    n: usize,
) -> Result<&'a [u8], Failure> {
    if addresses(name, start, n)?.is_empty() {
        return Ok(&[]);
    }
    // SAFETY: not NULL, and no longer than memory; the rest is this function's own condition.
    Ok(unsafe { slice::from_raw_parts(start.cast(), n) })
}

/// Where a new handle goes; NULL lies there until it does.
pub(crate) type Place<'a, T> = Option<&'a mut MaybeUninit<Option<Box<T>>>>;

/// Makes a handle and puts it there, on processors that this build of the library runs on.
pub(crate) fn make<T>(
    name: &'static str,
    place: Place<'_, T>,
    new: impl FnOnce() -> Result<T, Failure>,
) -> StatusCode {
    guarded(|| {
        let place = place.ok_or(Failure::Null(name))?;
        place.write(None);
        sarrus_client::processor::check().map_err(Failure::Processor)?;
        place.write(Some(Box::new(new()?)));
        Ok(())
    })
}

/// Frees a handle, where there is one.
pub(crate) fn free<T>(handle: Option<Box<T>>) {
    guarded(|| {
        drop(handle);
        Ok(())
    });
}

/// Where a value goes.
pub(crate) type Out<'a, T> = Option<&'a mut MaybeUninit<T>>;

/// Puts a value where it is wanted, if it is.
#[inline]
pub(crate) fn put<T>(place: Out<'_, T>, value: T) {
    if let Some(place) = place {
        place.write(value);
    }
}
