//! Versions, names of numbers, and the text of the last failure.
#![allow(unsafe_code, reason = "functions have names that C can link")]

use core::ffi::c_char;
use core::ptr::null;

use sarrus_client::{Status, Warning, Warnings};

use crate::failure::last;
use crate::status::OwnStatus;

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
    let code = status.cast_unsigned();
    let own = || OwnStatus::from_code(code).map_or(c"unknown".as_ptr(), OwnStatus::c_name);
    Status::from_code(code).map_or_else(own, Status::c_name)
}

/// Name of the lowest warning among bits; NULL where there is none. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_warning_name(bits: u32) -> *const c_char {
    Warnings(bits).iter().next().map_or(null(), Warning::c_name)
}

/// The message of this thread's last status other than SARRUS_STATUS_OK; empty before. It is
/// overwritten by the next failure of this thread, and cut at 8 KiB.
#[unsafe(no_mangle)]
pub extern "C" fn sarrus_last_error() -> *const c_char {
    last()
}

#[cfg(test)]
mod tests {
    use core::ffi::CStr;
    use core::fmt::Debug;

    use sarrus_client::actuators::{MechanismState, Operation, Reason, flag};
    use sarrus_client::{Axes, QueryOptions, Request, TaskParts};

    use super::*;

    fn text(name: *const c_char) -> &'static str {
        assert!(!name.is_null());
        // SAFETY: names live for ever and end with a zero.
        unsafe { CStr::from_ptr(name) }.to_str().unwrap()
    }

    #[test]
    fn numbers_have_the_names_of_the_wire() {
        for status in Status::ALL {
            assert_eq!(text(sarrus_status_name(*status as i32)), status.name());
        }
        for own in OwnStatus::ALL {
            assert!(*own as i32 >= 100);
            assert_eq!(text(sarrus_status_name(*own as i32)), own.name());
        }
        for none in [-1, 99, i32::MIN, i32::MAX] {
            assert_eq!(text(sarrus_status_name(none)), "unknown");
        }
        for warning in Warning::ALL {
            assert_eq!(text(sarrus_warning_name(*warning as u32)), warning.name());
        }
        assert_eq!(text(sarrus_warning_name(u32::MAX)), "limits_exceeded");
        assert_eq!(text(sarrus_warning_name(1 << 31 | 24)), "input_projected");
        assert!(sarrus_warning_name(0).is_null() && sarrus_warning_name(1 << 31).is_null());
    }

    /// `OTHER_MECHANISM` of `OtherMechanism`.
    fn upper(variant: impl Debug) -> String {
        let mut name = String::new();
        for c in format!("{variant:?}").chars() {
            if c.is_ascii_uppercase() && !name.is_empty() {
                name.push('_');
            }
            name.push(c.to_ascii_uppercase());
        }
        name
    }

    #[test]
    fn the_header_has_the_numbers_of_the_wire() {
        let header = include_str!("../include/sarrus.h");
        let mut count = 0;
        let mut has = |line: String| {
            assert!(header.contains(&line), "no{line}");
            count += 1;
        };
        macro_rules! all {
            ($($enum:ident: $head:literal),*) => {$(for one in $enum::ALL {
                has(format!(" SARRUS_{}_{} = {},\n", $head, upper(one), *one as u32));
            })*};
        }
        all!(Status: "STATUS", OwnStatus: "STATUS", Warning: "WARNING", Request: "REQUEST");
        all!(Axes: "AXES", MechanismState: "MECHANISM_STATE", Reason: "REASON");
        all!(Operation: "OPERATION");
        for (bit, name) in flag::NAMES.iter().enumerate() {
            has(format!(" SARRUS_FLAG_{} = (1 << {bit}),\n", name.to_ascii_uppercase()));
        }
        let parts = [
            ("POSITION", TaskParts::POSITION),
            ("ORIENTATION", TaskParts::ORIENTATION),
            ("AXIS", TaskParts::AXIS),
            ("SECOND", TaskParts::SECOND),
            ("HELD", TaskParts::HELD),
        ];
        parts
            .iter()
            .for_each(|(name, part)| has(format!(" SARRUS_TASK_PART_{name} = {},\n", part.0)));
        let options = [
            ("CHECKSUM", QueryOptions::CHECKSUM),
            ("TIMES", QueryOptions::TIMES),
            ("SEARCH", QueryOptions::SEARCH),
            ("FRICTION", QueryOptions::FRICTION),
        ];
        for (name, option) in options {
            has(format!(" SARRUS_QUERY_OPTION_{name} = {},\n", option.0));
        }
        let others = ["ORDER", "TRANSPORT", "WAIT_STRATEGY"].map(|name| format!(" SARRUS_{name}_"));
        let is_number = |line: &&str| line.starts_with("    SARRUS_") && line.ends_with(',');
        let numbers = header.lines().filter(is_number);
        let wire = numbers.filter(|line| !others.iter().any(|head| line.contains(head))).count();
        assert_eq!(wire, count);
    }
}
