//! Numbers on the wire and the names that people see: one macro for every enum that travels, one
//! for enums with names alone.

/// Declares an enum that travels: each line is the documentation, the variant, its number and its
/// name. The numbers are for ever: a variant that goes leaves its number unused.
///
/// It has `ALL` in the order of the numbers, `name()`, which is also its `Display`, `from_code()`,
/// which is `None` for a number that this version does not know, and `name_of()`, which is
/// `unknown` there: an unknown number never takes the meaning of a known one.
#[doc(hidden)]
#[macro_export]
macro_rules! wire_enum {
    (
        $(#[$of_enum:meta])*
        $enum:ident: $number:ident {
            $($(#[$of_variant:meta])* $variant:ident = $code:literal, $name:literal;)*
        }
    ) => {
        $(#[$of_enum])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr($number)]
        #[non_exhaustive]
        pub enum $enum { $($(#[$of_variant])* $variant = $code,)* }

        impl $enum {
            /// All of them, in the order of their numbers.
            pub const ALL: &[$enum] = &[$($enum::$variant,)*];

            /// The name that people and scripts see.
            pub const fn name(self) -> &'static str {
                match self { $($enum::$variant => $name,)* }
            }

            /// The name with a zero behind it, as C reads it; it lives for ever.
            pub const fn c_name(self) -> *const core::ffi::c_char {
                match self { $($enum::$variant => concat!($name, "\0").as_ptr().cast(),)* }
            }

            /// The one of a number on the wire; `None` for a number that this version does not
            /// know.
            pub const fn from_code(code: $number) -> Option<$enum> {
                match code { $($code => Some($enum::$variant),)* _ => None }
            }

            /// The name of a number on the wire; `unknown` for a number that this version does not
            /// know.
            pub const fn name_of(code: $number) -> &'static str {
                match $enum::from_code(code) { Some(known) => known.name(), None => "unknown" }
            }
        }

        impl core::fmt::Display for $enum {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

/// Declares an enum whose variants have names and no numbers on the wire. It has `ALL` and `NAMES`,
/// in this order, and `name()`.
#[doc(hidden)]
#[macro_export]
macro_rules! named_enum {
    (
        $(#[$of_enum:meta])*
        $vis:vis enum $enum:ident {
            $($(#[$of_variant:meta])* $variant:ident = $name:literal,)*
        }
    ) => {
        $(#[$of_enum])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $vis enum $enum { $($(#[$of_variant])* $variant,)* }

        #[allow(dead_code)] // few enums need all of it
        impl $enum {
            /// All of them.
            $vis const ALL: [$enum; $enum::NAMES.len()] = [$($enum::$variant),*];
            /// Their names.
            $vis const NAMES: [&'static str; [$($name),*].len()] = [$($name),*];

            /// The name that people and scripts see.
            $vis const fn name(self) -> &'static str {
                match self { $($enum::$variant => $name,)* }
            }
        }
    };
}

pub(crate) use {named_enum, wire_enum};

#[cfg(test)]
mod tests {
    use crate::Request;

    #[test]
    fn a_number_that_is_not_known_has_no_meaning() {
        assert_eq!(Request::Map.to_string(), "map");
        assert_eq!((Request::from_code(4), Request::name_of(4)), (Some(Request::Map), "map"));
        for code in [0, 9, u32::MAX] {
            assert_eq!((Request::from_code(code), Request::name_of(code)), (None, "unknown"));
        }
    }
}
