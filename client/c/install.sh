#!/usr/bin/env bash
# Builds libsarrus and installs it: client/c/install.sh [--portable] PREFIX [FOLDER]. FOLDER has
# libsarrus.so and libsarrus.a that were built before; without it they are built here, for
# processors with AVX2 and FMA as `.cargo/config.toml` has it, or with --portable for any x86-64.
# pkg-config and CMake find it below PREFIX. For packages: LIBDIR is the folder of libraries below
# PREFIX (lib), and everything goes below DESTDIR, which no file mentions.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)
root=$(cd "$here/../.." && pwd -P)
destination=${DESTDIR:-}
libdir=${LIBDIR:-lib}

refuse() {
    printf 'install.sh: %s\n' "$1" >&2
    exit "${2:-1}"
}

portable=
if [ "${1:-}" = --portable ]; then
    portable=yes
    shift
fi
if [ $# -lt 1 ] || [ $# -gt 2 ] || [ -z "$1" ] || [ "${1#-}" != "$1" ]; then
    refuse "usage: client/c/install.sh [--portable] PREFIX [FOLDER]" 2
fi
if [ -n "$portable" ] && [ $# -eq 2 ]; then
    refuse "--portable is how it is built: not with a FOLDER that was built before" 2
fi

# files name PREFIX as it will be, so it is absolute and can be written in a .pc file
case $1 in
    /*) prefix=$1 ;;
    *) prefix=$PWD/$1 ;;
esac
case "$prefix$libdir" in
    *[\"\'\$\`\\\#\&\|$'\n']*)
        refuse "pkg-config cannot name \"$prefix/$libdir\": it has quotes, \$, \`, \\, #, &, | \
or a new line" 2
        ;;
esac
case /$libdir/ in
    *//* | */../* | */./*)
        refuse "LIBDIR is a folder below PREFIX such as lib or lib64, found \"$libdir\"" 2
        ;;
esac

# folders first: what cannot be written is known before anything is built
for folder in include "$libdir/pkgconfig" "$libdir/cmake/sarrus"; do
    mkdir -p "$destination$prefix/$folder" && [ -w "$destination$prefix/$folder" ] ||
        refuse "\"$destination$prefix/$folder\" cannot be written: choose another PREFIX, or \
install as the user who may"
done
if [ -z "$destination" ]; then
    prefix=$(cd "$prefix" && pwd -P)
fi
to=$destination$prefix

# built, or given; a relative folder of targets is the caller's
if [ -n "${CARGO_TARGET_DIR:-}" ]; then
    CARGO_TARGET_DIR=$(realpath -m -- "$CARGO_TARGET_DIR")
    export CARGO_TARGET_DIR
fi
if [ $# -eq 2 ]; then
    built=$(cd "$2" && pwd -P)
elif [ -n "$portable" ]; then
    # other flags: in a folder of their own, so that both builds keep what they have compiled
    built=${CARGO_TARGET_DIR:-$root/target}/portable
    (cd "$root" && RUSTFLAGS=-Ctarget-cpu=x86-64 cargo build --release --locked -p sarrus-c \
        --features portable --target-dir "$built")
    built=$built/release
else
    (cd "$root" && cargo build --release --locked -p sarrus-c)
    built=${CARGO_TARGET_DIR:-$root/target}/release
fi
[ -f "$built/libsarrus.so" ] && [ -f "$built/libsarrus.a" ] ||
    refuse "\"$built\" has no libsarrus.so and libsarrus.a"
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' "$root/Cargo.toml")
abi=$(sed -n 's/^#define SARRUS_ABI_VERSION //p' "$here/include/sarrus.h")

# a library that runs programs is replaced, not written over
rm -f "$to/$libdir/libsarrus.so.$abi"
install -m 644 "$here/include/sarrus.h" "$here/include/sarrus.hpp" "$to/include"
install -m 644 "$built/libsarrus.so" "$to/$libdir/libsarrus.so.$abi"
ln -sf "libsarrus.so.$abi" "$to/$libdir/libsarrus.so"
install -m 644 "$built/libsarrus.a" "$to/$libdir"
# what debuggers read is most of them
if command -v strip >/dev/null; then
    strip --strip-unneeded "$to/$libdir/libsarrus.so.$abi"
    strip --strip-debug "$to/$libdir/libsarrus.a"
fi
# from LIBDIR up to PREFIX
up=$(sed 's|[^/][^/]*|..|g' <<<"$libdir")
fill() {
    sed "s|@PREFIX@|${prefix// /\\\\ }|; s|@LIBDIR@|${libdir// /\\\\ }|; s|@UP@|$up|
        s|@VERSION@|$version|; s|@MINOR@|${version%.*}|; s|@ABI@|$abi|" "$here/install/$1" >"$2"
    chmod 644 "$2"
}
fill sarrus.pc.in "$to/$libdir/pkgconfig/sarrus.pc"
fill sarrus-config.cmake.in "$to/$libdir/cmake/sarrus/sarrus-config.cmake"
fill sarrus-config-version.cmake.in "$to/$libdir/cmake/sarrus/sarrus-config-version.cmake"
echo "installed $to/$libdir/libsarrus.so.$abi $version"
