#!/usr/bin/env bash
# A crate of a user's own, outside the workspace, where cargo does not read `.cargo/config.toml` of
# the project:
#   (a) without the baseline its build ends with an error that holds the two lines to paste,
#   (b) with these two lines, as they stand in that error, it builds, and inverse dynamics of the
#       upper body take as many instructions as inside the workspace, to 1 %,
#   (c) with the feature `portable` it compiles without them; `run.sh --bits` builds and runs that
#       too and compares the answers bit by bit.
# Of the project only the crates that it needs are copied and compiled.
set -Eeuo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd -P)
target=${CARGO_TARGET_DIR:-$root/target}
bits=${1:-}

# the flags of the environment come before every file
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS
unset CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUSTFLAGS

fail() {
    printf 'outside: %s\n' "$@" >&2
    exit 1
}

if [ "$(uname -m)" != x86_64 ]; then
    echo "not run: the baseline is one of x86-64"
    exit 0
fi

# the crate beside a copy of what it depends on, in a folder above which nothing configures cargo
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
above=$place
while [ "$above" != / ]; do
    [ ! -e "$above/.cargo" ] || [ "$above/.cargo" = "${CARGO_HOME:-$HOME/.cargo}" ] ||
        fail "$above/.cargo configures every build in $place: point TMPDIR elsewhere"
    above=$(dirname "$above")
done
mkdir -p "$place/sarrus" "$place/robot/src" "$place/robot/.cargo"
(
    cd "$root"
    cargo fetch --locked --quiet
    # cargo names the crates of the workspace by their folders
    cargo tree --locked --offline -p sarrus-dynamics -p sarrus-models -e normal,build \
        --prefix none >"$place/tree"
    sed -n "s|.*($root/\([^)]*\)).*|\1|p" "$place/tree" | sort -u |
        xargs cp -RL --parents Cargo.toml -t "$place/sarrus"
)
cp "$root/tests/outside/main.rs" "$place/robot/src/main.rs"
cp "$root/Cargo.lock" "$place/robot/Cargo.lock"
cat >"$place/robot/Cargo.toml" <<'END'
[package]
name = "outside"
version = "0.0.0"
edition = "2024"

[dependencies]
sarrus-dynamics = { path = "../sarrus/server/dynamics" }
sarrus-models = { path = "../sarrus/models" }

[features]
portable = ["sarrus-models/portable"]

# as in the workspace, whose compiled dependencies then serve here too; the kernels are at 3 in
# both
[profile.release]
codegen-units = 1

[profile.release.package]
END
# `"*"` means the crates of the project too, of which those without a level are at 3
sed -n '/^\[profile.release.package\]/,/^$/p' "$root/Cargo.toml" |
    awk 'NR == FNR { needed[$1] = 1; next }
        $1 in needed || $1 == "\"*\""
        { delete needed[$1] }
        END { for (name in needed) if (name ~ /^sarrus-/) print name " = { opt-level = 3 }" }' \
        "$place/tree" - >>"$place/robot/Cargo.toml"
cd "$place/robot"

# (a) nothing given: the error says what to do
if CARGO_TARGET_DIR=$target/outside cargo check --offline --quiet 2>"$place/error"; then
    fail "a build without FMA went through"
fi
wanted="\[target\.'cfg.*\]\$|rustflags = .*\$"
lines=$( (grep -oE "$wanted" "$place/error" || true) | awk '!seen[$0]++')
[ "$(grep -c . <<<"$lines")" -eq 2 ] ||
    fail "the error does not hold the two lines to paste:" "$(cat "$place/error")"
# the project says the same in its own way: its key within `all`, its flags as one string
plain() { sed 's/cfg(all(\(.*\)))/cfg(\1)/; s/[],"[]//g'; }
project=$(plain <"$root/.cargo/config.toml")
plain <<<"$lines" | while read -r line; do
    grep -qFx "$line" <<<"$project" || fail "the project is built without: $line"
done

# (c) the portable build compiles
CARGO_TARGET_DIR=$target/outside cargo check --offline --quiet --features portable ||
    fail "the feature portable does not compile"
if [ "$bits" = --bits ]; then
    CARGO_TARGET_DIR=$target/outside cargo build --offline --quiet --features portable
    "$target/outside/debug/outside" >"$place/portable"
fi

# (b) the lines of the message, pasted
printf '%s\n' "$lines" >.cargo/config.toml
CARGO_TARGET_DIR=$target cargo build --offline --quiet --release || fail "the two lines do not do"
cp "$target/release/outside" "$place/"
if [ "$bits" = --bits ]; then
    "$place/outside" | diff - "$place/portable" || fail "portable gives other bits"
    echo "portable: the same bits"
fi
if ! command -v valgrind >/dev/null; then
    echo "not run: valgrind is missing, so instructions are not compared (apt install valgrind)"
    exit 0
fi
(cd "$root" && cargo build --locked --quiet --release --workspace --example outside)

# the instructions of the passes alone: loading takes another number in every run
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='*outside::pass*' \
        "$1" 4 2>&1 | awk '/Collected :/ { printf "%.0f", $NF / 64 }'
}
without=$(count "$place/outside")
within=$(count "$target/release/examples/outside")
awk -v a="$without" -v b="$within" 'BEGIN {
    if (!(a > 0 && b > 0)) { print "outside: nothing was counted" > "/dev/stderr"; exit 1 }
    printf "inverse dynamics of the upper body: %d instructions outside, %d inside, %+.2f %%\n",
        a, b, 100 * (a / b - 1)
    exit (a / b - 1)^2 > 0.01^2
}' || fail "outside the workspace the kernels are other ones"
