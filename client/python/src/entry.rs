//! The entry point with which Python loads the extension; it checks the processor before any other
//! code runs.
//!
//! Everything here is built for x86-64-v3, pyo3's initialisation included. On an older processor
//! the first instruction that is not there would end the interpreter without a word, so nothing
//! but the question and an exception comes before that initialisation.
#![allow(unsafe_code, reason = "Python calls a function by its name, and pyo3 has the next one")]

use std::ffi::CString;
use std::ptr;

use pyo3::ffi;

unsafe extern "C" {
    /// The function that pyo3 generates for the module `native` in `lib.rs`.
    #[allow(non_snake_case)]
    fn PyInit__checked() -> *mut ffi::PyObject;
}

/// The extension `sarrus._native`, or an `ImportError` where the processor lacks an instruction.
#[allow(non_snake_case)]
#[unsafe(no_mangle)]
extern "C" fn PyInit__native() -> *mut ffi::PyObject {
    let Err(missing) = sarrus_client::processor::check() else {
        // SAFETY: Python calls this with its lock held to load the extension, as that expects
        return unsafe { PyInit__checked() };
    };
    let message = format!(
        "this processor has no {missing}; sarrus is built for x86-64-v3 (FMA and AVX2, processors \
         from 2015 on); build it for this one from a clone, see \"Older processors\" in \
         client/python/README.md"
    );
    let message = CString::new(message).unwrap_or_default();
    // SAFETY: Python's lock is held, and the text is copied; null reports an exception
    unsafe { ffi::PyErr_SetString(ffi::PyExc_ImportError, message.as_ptr()) };
    ptr::null_mut()
}
