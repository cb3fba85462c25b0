//! Versions, names of numbers, and the text of the last failure.
#![allow(unsafe_code, reason = "functions have names that C can link")]

use core::ffi::{CStr, c_char};
use core::ptr::null;

use crate::failure::last;
use crate::status::{status_name, warning_name};

/// Version of this interface; it grows when a program must be compiled again.
pub const ABI_VERSION: u32 = 0;

/// SARRUS_ABI_VERSION of the library: a program that was compiled with another one must not go on.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_abi_version() -> u32 {
    ABI_VERSION
}

/// Version of the library, such as "0.1.0"; lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Name of a status, such as "unreachable"; "unknown" for a number that is none. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_status_name(status: i32) -> *const c_char {
    status_name(status).unwrap_or(c"unknown").as_ptr()
}

/// Name of the lowest warning among bits; NULL where there is none. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_warning_name(bits: u32) -> *const c_char {
    warning_name(bits).map_or(null(), CStr::as_ptr)
}

/// The message of this thread's last status other than SARRUS_STATUS_OK; empty before. It is
/// overwritten by the next failure of this thread, and cut at 8 KiB.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_last_error() -> *const c_char {
    last()
}
