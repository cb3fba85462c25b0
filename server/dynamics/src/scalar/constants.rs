//! `map` of the types that hold a model's constants.

/// A list whose items are converted one by one.
pub(crate) trait Each<X> {
    /// The list of converted items.
    type Of<Y>;
    fn each<Y>(&self, f: impl FnMut(&X) -> Y) -> Self::Of<Y>;
}

impl<X> Each<X> for Vec<X> {
    type Of<Y> = Vec<Y>;
    fn each<Y>(&self, f: impl FnMut(&X) -> Y) -> Vec<Y> {
        self.iter().map(f).collect()
    }
}

impl<X> Each<X> for Option<X> {
    type Of<Y> = Option<Y>;
    fn each<Y>(&self, f: impl FnMut(&X) -> Y) -> Option<Y> {
        self.as_ref().map(f)
    }
}

impl<X, const N: usize> Each<X> for [X; N] {
    type Of<Y> = [Y; N];
    fn each<Y>(&self, f: impl FnMut(&X) -> Y) -> [Y; N] {
        self.each_ref().map(f)
    }
}

/// Implements `map`, which converts every constant of a type. `keep` lists the fields without
/// constants, `number` the constants, `list` the lists of constants, `map` the vectors, matrices
/// and nested types, `each` the lists of these; a closure in brackets converts one item of a field.
/// Of an enum `map` lists the variants that hold constants.
macro_rules! constants {
    (enum $type:ident: $(keep $($plain:ident)*;)? map $($variant:ident)*;) => {
        impl<C: nalgebra::Scalar + Copy> $type<C> {
            /// Converts every constant to another scalar.
            pub(crate) fn map<D: nalgebra::Scalar>(
                &self,
                f: impl Fn(C) -> D + Copy,
            ) -> $type<D> {
                match self {
                    $($($type::$plain => $type::$plain,)*)?
                    $($type::$variant(of) => $type::$variant(of.map(f)),)*
                }
            }
        }
    };
    ($type:ident:
        $(keep $($keep:ident)*;)?
        $(number $($number:ident)*;)?
        $(list $($list:ident)*;)?
        $(map $($map:ident)*;)?
        $(each $($each:ident)*;)?
        $(other $other:ident: |$f:ident, $x:pat_param| $converted:expr;)*
    ) => {
        impl<C: nalgebra::Scalar + Copy> $type<C> {
            /// Converts every constant to another scalar.
            #[allow(clippy::clone_on_copy, reason = "some of the fields are no copies")]
            pub(crate) fn map<D: nalgebra::Scalar>(
                &self,
                f: impl Fn(C) -> D + Copy,
            ) -> $type<D> {
                #[allow(unused_imports, reason = "not every type has a list")]
                use $crate::scalar::Each;
                $type {
                    $($($keep: self.$keep.clone(),)*)?
                    $($($number: f(self.$number),)*)?
                    $($($list: self.$list.each(|x| f(*x)),)*)?
                    $($($map: self.$map.map(f),)*)?
                    $($($each: self.$each.each(|x| x.map(f)),)*)?
                    $($other: { let $f = f; self.$other.each(|$x| $converted) },)*
                }
            }
        }
    };
}

pub(crate) use constants;
