#!/usr/bin/env bash
# Uses the Debian package without installing it: server/debian/test.sh PACKAGE. Programs run, every
# file that the README names is there, the shell can read the scripts for dpkg, the first program of
# client/c/README.md is compiled by pkg-config and run, and lintian finds no error where it is
# installed.
set -euo pipefail
package=$(realpath "$1")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
dpkg-deb -x "$package" "$place/tree"
dpkg-deb -e "$package" "$place/control"
for script in postinst prerm postrm; do
    sh -n "$place/control/$script"
done
cd "$place/tree"

usr/bin/sarrus check --robot lambda >/dev/null
usr/bin/sarrus-can --version
for file in 'usr/lib/systemd/system/sarrus@.service' usr/share/man/man1/sarrus-serve.1.gz \
    usr/share/bash-completion/completions/sarrus usr/share/zsh/vendor-completions/_sarrus \
    usr/share/fish/vendor_completions.d/sarrus.fish usr/share/doc/sarrus/copyright \
    usr/share/doc/sarrus/dependencies.txt usr/include/sarrus.hpp; do
    [ -s "$file" ] || { echo "test.sh: the package has no $file" >&2; exit 1; }
done

# as after an installation, but for the folder
config=$(echo usr/lib/*/pkgconfig)
libraries=$place/tree/${config%/pkgconfig}
sed -n '/^```c$/,/^```$/p' "$here/../../client/c/README.md" | sed '1d; /^```$/,$d' >"$place/main.c"
if command -v cc >/dev/null && command -v pkg-config >/dev/null; then
    flags=$(PKG_CONFIG_SYSROOT_DIR=$place/tree PKG_CONFIG_LIBDIR=$place/tree/$config \
        pkg-config --cflags --libs sarrus)
    # shellcheck disable=SC2086
    cc -Wall -Werror "$place/main.c" -o "$place/main" $flags
    found=$(LD_LIBRARY_PATH=$libraries "$place/main")
    [ "$found" = 16.8023 ] || { echo "test.sh: expected 16.8023, found $found" >&2; exit 1; }
else
    echo "not run: no C compiler or pkg-config"
fi
if command -v lintian >/dev/null; then
    lintian --fail-on error --suppress-tags-from-file "$here/lintian.txt" "$package"
else
    echo "not run: lintian is missing"
fi
echo "$(basename "$package") works"
