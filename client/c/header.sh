#!/usr/bin/env bash
# Writes client/c/include/sarrus.h, or another file, from the sources: with cbindgen 0.29.4, which
# SARRUS_CBINDGEN names, else the one on PATH.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
header=${1:-include/sarrus.h}
sources=$(mktemp)
trap 'rm -f "$sources"' EXIT
./sources.py >"$sources"
"${SARRUS_CBINDGEN:-cbindgen}" --quiet --config cbindgen.toml --output "$header" "$sources"
# the payloads' comments address readers of Rust: units, links and letters as elsewhere in a header
sed -i -E 's/`(\[[^]`]*\])`/\1/; s/\[`MechanismState`\]/sarrus_mechanism_state/
    s/\[`Reason`\]/sarrus_reason/; s/\[`flag`\]/sarrus_flag/
    s/τ/tau/g; s/−/-/g; s/°C/degrees Celsius/' "$header"
