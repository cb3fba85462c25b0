#!/usr/bin/env bash
# Builds libsarrus and installs it: client/c/install.sh PREFIX [FOLDER]. FOLDER has libsarrus.so and
# libsarrus.a that were built before; without it they are built here, for processors with AVX2 and
# FMA as `.cargo/config.toml` has it. pkg-config and CMake find it below PREFIX.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)
root=$(cd "$here/../.." && pwd -P)
if [ $# -lt 1 ] || [ $# -gt 2 ]; then
    echo "usage: client/c/install.sh PREFIX [FOLDER]" >&2
    exit 2
fi
mkdir -p "$1"
prefix=$(cd "$1" && pwd -P)
if [ $# -eq 2 ]; then
    built=$(cd "$2" && pwd -P)
else
    (cd "$root" && cargo build --release --locked -p sarrus-c)
    built=${CARGO_TARGET_DIR:-$root/target}/release
fi
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' "$root/Cargo.toml")

install -d "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/sarrus"
install -m 644 "$here/include/sarrus.h" "$here/include/sarrus.hpp" "$prefix/include"
install -m 755 "$built/libsarrus.so" "$prefix/lib"
install -m 644 "$built/libsarrus.a" "$prefix/lib"
# what debuggers read is most of them
if command -v strip >/dev/null; then
    strip --strip-debug "$prefix/lib/libsarrus.so" "$prefix/lib/libsarrus.a"
fi
fill() { sed "s|@PREFIX@|$prefix|; s|@VERSION@|$version|; s|@MINOR@|${version%.*}|" "$1"; }
fill "$here/install/sarrus.pc.in" >"$prefix/lib/pkgconfig/sarrus.pc"
fill "$here/install/sarrus-config-version.cmake.in" \
    >"$prefix/lib/cmake/sarrus/sarrus-config-version.cmake"
install -m 644 "$here/install/sarrus-config.cmake" "$prefix/lib/cmake/sarrus"
echo "installed $prefix/lib/libsarrus.so $version"
