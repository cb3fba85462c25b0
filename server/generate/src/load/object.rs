//! The one place that runs code which the Rust compiler has not seen.
//!
//! Loading an object runs its initialisers with the rights of this process; no check of ours can
//! find out their effect. Only files that this user or root wrote are loaded, after every check
//! that reading the file allows; SECURITY.md states this.
// lint: the system's loader and the function behind a pointer cannot be called in safe Rust; this
// file holds all unsafe code of the crate
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int};
use std::hint::black_box;
use std::os::fd::OwnedFd;

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};

use super::{LoadFault, Loaded, ObjectFile};
use crate::manifest::SYMBOL;

/// The type of every generated function.
type Function = unsafe extern "C" fn(input: *const f64, output: *mut f64) -> c_int;

/// A loaded object; its code is gone from memory when this is dropped.
#[derive(Debug)]
pub(super) struct Object {
    function: Function,
    /// That for rows, and how many it takes at once.
    of_rows: Option<(Function, usize)>,
    inputs: usize,
    outputs: usize,
    /// Dropped before the descriptor under whose number it was loaded: while the descriptor is open
    /// no other object can have the same path, by which the loader identifies objects.
    _library: Library,
    _file: OwnedFd,
}

impl Object {
    /// Loads a file whose manifest was found right.
    pub(super) fn load(file: &ObjectFile) -> Loaded<Object> {
        let refused = |reason: String| LoadFault::Loader(reason).of(file.path());
        let (descriptor, sealed) = file
            .sealed()
            .map_err(|error| refused(format!("no memory that can be sealed: {error}")))?;
        // SAFETY: the object's initialisers are trusted as far as the file's owner is: the user of
        // this process or root. Its parts lie within the file, which is sealed.
        let library = unsafe { Library::open(Some(&sealed), RTLD_NOW | RTLD_LOCAL) };
        let library = library.map_err(|error| refused(error.to_string()))?;
        if !keeps_small_numbers() {
            return Err(LoadFault::ChangesRounding.of(file.path()));
        }

        // the loaded manifest equals the file's
        // SAFETY: the symbol is an array of characters; its address is all that is taken here.
        let text = unsafe { library.get::<*const c_char>(SYMBOL.as_bytes()) };
        let text = text.map_err(|error| refused(error.to_string()))?;
        // SAFETY: the file has this text with its zero at its end as the value of the symbol, in
        // sealed memory that stays mapped as long as the library.
        let text = unsafe { CStr::from_ptr(text.into_raw().cast()) };
        if text.to_bytes() != file.text {
            return Err(LoadFault::NoKernel.of(file.path()));
        }
        let manifest = file.manifest();
        // SAFETY: objects with this manifest have a function of this type under this name.
        let function = unsafe { library.get::<Function>(manifest.function.as_bytes()) };
        let function = *function.map_err(|error| refused(error.to_string()))?;
        let mut of_rows = None;
        if manifest.rows > 0 {
            let name = format!("{}_rows{}", manifest.function, manifest.rows);
            // SAFETY: where the manifest declares it, another symbol of the same type under this
            // name.
            let function = unsafe { library.get::<Function>(name.as_bytes()) };
            let function = *function.map_err(|error| refused(error.to_string()))?;
            of_rows = Some((function, manifest.rows));
        }
        let inputs = manifest.inputs;
        let outputs = manifest.outputs;
        Ok(Object { function, of_rows, inputs, outputs, _library: library, _file: descriptor })
    }

    /// From now on rows are answered one by one.
    pub(super) fn leave_rows(&mut self) {
        self.of_rows = None;
    }

    /// How many rows one call takes; 0 where there is no function for them.
    #[inline]
    pub(super) fn rows(&self) -> usize {
        self.of_rows.map_or(0, |(_, rows)| rows)
    }

    /// Calls the function for rows and returns its result, or `None` where there is none, or the
    /// sizes are not its own. Never allocates.
    #[inline]
    pub(super) fn call_rows(&self, input: &[f64], output: &mut [f64]) -> Option<c_int> {
        let (function, rows) = self.of_rows?;
        let fits = input.len() == rows * self.inputs && output.len() == rows * self.outputs;
        fits.then(|| {
            // SAFETY: a function with this manifest reads `inputs` numbers of each of its rows and
            // writes `outputs`, keeps neither pointer and has no memory of its own.
            unsafe { function(input.as_ptr(), output.as_mut_ptr()) }
        })
    }

    /// Calls the function and returns its result, or `None` where the sizes are not its own. Never
    /// allocates.
    #[inline]
    pub(super) fn call(&self, input: &[f64], output: &mut [f64]) -> Option<c_int> {
        (input.len() == self.inputs && output.len() == self.outputs).then(|| {
            // SAFETY: a function with this manifest reads `inputs` numbers and writes `outputs`,
            // keeps neither pointer and has no memory of its own.
            unsafe { (self.function)(input.as_ptr(), output.as_mut_ptr()) }
        })
    }
}

/// False where numbers below the normal ones have become zeros, as some linkers make it for a
/// whole thread when an object of theirs is loaded.
fn keeps_small_numbers() -> bool {
    black_box(f64::MIN_POSITIVE) * black_box(0.5) != 0.0
}
