#!/usr/bin/env bash
# Builds the Debian package of programs and libsarrus with cargo-deb, and prints where it is:
# server/debian/build.sh [FOLDER]. FOLDER has the programs `sarrus` and `sarrus-can` and libsarrus
# that were built before; without it they are built here.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)
root=$(cd "$here/../.." && pwd -P)
if [ $# -gt 1 ]; then
    echo "usage: server/debian/build.sh [FOLDER]" >&2
    exit 2
fi
# folders are those of the caller: resolved before the folder changes
target=$(realpath -m -- "${CARGO_TARGET_DIR:-$root/target}")
if [ $# -eq 1 ]; then
    built=$(cd "$1" && pwd -P)
fi
export CARGO_TARGET_DIR=$target
cd "$root"
if ! command -v cargo-deb >/dev/null; then
    echo "build.sh: cargo-deb is missing: cargo install --locked cargo-deb" >&2
    exit 1
fi
if [ $# -eq 0 ]; then
    cargo build --release --locked -p sarrus-server -p sarrus-can -p sarrus-c
    built=$target/release
fi
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
triplet=$(dpkg-architecture -qDEB_HOST_MULTIARCH 2>/dev/null || cc -print-multiarch)

# programs, library
stage=$target/release/debian
rm -rf "$stage"
share=$stage/usr/share
documents=$share/doc/sarrus
install -d "$stage/usr/bin" "$stage/usr/lib/systemd/system" "$documents/examples"
install -m 755 "$built/sarrus" "$built/sarrus-can" "$stage/usr/bin"
strip --strip-unneeded "$stage/usr/bin/sarrus" "$stage/usr/bin/sarrus-can"
DESTDIR=$stage LIBDIR=lib/$triplet client/c/install.sh /usr "$built" >/dev/null
install -m 644 'server/systemd/sarrus@.service' "$stage/usr/lib/systemd/system"

# what the program writes of itself
"$built/sarrus" man "$share/man/man1" >/dev/null
install -d "$share/bash-completion/completions" "$share/zsh/vendor-completions" \
    "$share/fish/vendor_completions.d"
"$built/sarrus" completions bash >"$share/bash-completion/completions/sarrus"
"$built/sarrus" completions zsh >"$share/zsh/vendor-completions/_sarrus"
"$built/sarrus" completions fish >"$share/fish/vendor_completions.d/sarrus.fish"

# documents, those compressed of which policy wants it
install -m 644 client/c/examples/* "$documents/examples"
install -m 644 server/README.md "$documents/README.md"
install -m 644 client/c/README.md "$documents/README.C.md"
install -m 644 client/can/README.md "$documents/README.CAN.md"
install -m 644 SECURITY.md "$documents"
install -m 644 CHANGELOG.md "$documents/changelog"
maintainer=$(sed -n 's/^maintainer = "\(.*\)"/\1/p' server/Cargo.toml)
seconds=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)}
printf 'sarrus (%s-1) unstable; urgency=medium\n\n  * As in changelog.gz.\n\n -- %s  %s\n' \
    "$version" "$maintainer" "$(LC_ALL=C date -u -R -d "@$seconds")" >"$documents/changelog.Debian"
cargo tree --locked -p sarrus-server -p sarrus-can -p sarrus-c -e normal --prefix none \
    --format '{p}: {l}' | grep -v " ($root" | sed 's/ (\*)$//' | sort -u \
    >"$documents/dependencies.txt"
gzip -9n "$share"/man/man1/*.1 "$documents/changelog" "$documents/changelog.Debian"

# prints where the package is
cargo deb --quiet --locked --no-build --no-strip -p sarrus-server
